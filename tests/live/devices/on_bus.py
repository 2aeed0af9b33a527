"""Drives the wheel of a bus, until somebody ends, stops or kills it: ``python on_bus.py DBC CHANNEL``."""

import sys
import time

import numpy as np

from steer_env.live import devices
from steer_env.live.real_time import Mailboxes, RealTime
from steer_env.vehicle import cars, subsystems


def main(dbc, channel):
    """Exchange angle and torque with the loop in every 2 ms."""
    speed = 100.0 / 3.6
    part = subsystems.make("car", cars.load("compact").plant("lugre", speed, True), speed)
    names = [signal.name for signal in part.given]
    mail = Mailboxes(part)
    options = {"dbc": dbc, "interface": "udp_multicast", "channel": channel, "speed": "WHEEL.SPEED"}
    with devices.make("can", **options, max_torque=8.0) as device, RealTime(part, mail.device):
        print("drives", flush=True)
        while True:
            reading = device.read()
            if reading is not None:
                inputs = np.zeros(len(names))
                inputs[names.index("hand_angle")] = reading.angle
                inputs[names.index("hand_speed")] = reading.speed
                mail.put(inputs, reading.stamp)
            device.write(mail.get()[0])
            time.sleep(0.002)


if __name__ == "__main__":
    main(*sys.argv[1:])
