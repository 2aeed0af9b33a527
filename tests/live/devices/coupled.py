"""A fake wheel on the loop, all in simulated time: the wheel's clock, the samples of the loop, and the exchange."""

import numpy as np

from steer_env.live import devices
from steer_env.live.devices import DeviceError
from steer_env.live.real_time import Limits, Mailboxes
from steer_env.live.real_time.angle_filter import BANDWIDTH
from steer_env.live.real_time.loop import PERIOD, make_loop_memory, tick
from steer_env.live.real_time.model import make_model
from steer_env.vehicle import cars, subsystems
from tests.live.devices.stages import Clock

EXCHANGE = 2  # of Python's thread with the device [ms]


class Coupled:
    """A drive of the fake wheel; options are its."""

    def __init__(self, speed=100.0 / 3.6, limits=None, **options):
        self.clock = Clock()
        self.device = devices.make("fake", clock=self.clock, **options)
        self.device.__enter__()
        self.part = subsystems.make("car", cars.load("compact").plant("lugre", speed, True), speed)
        self.names = [signal.name for signal in self.part.given]
        self.mail = Mailboxes(self.part, angle_bandwidth=BANDWIDTH, clock=self.clock)
        self.limits = limits or Limits()
        self.model, self.loop = make_model(self.part), make_loop_memory(self.limits)
        self.sentence = ""
        self.torques, self.motor, self.phases = [], [], []  # of the loop and of the wheel's motor, after each ms
        self._left = 0

    def exchange(self):
        """What the thread of Python does every 2 ms; where the device fails, it tells the loop and goes on trying."""
        try:
            reading = self.device.read()
            if reading is not None:
                inputs = np.zeros(len(self.names))
                inputs[self.names.index("hand_angle")] = reading.angle
                self.mail.put(inputs, reading.stamp)
            self.device.write(self.mail.get()[0])
        except DeviceError as error:
            self.sentence = self.sentence or str(error)
            self.mail.fail()

    def run(self, seconds, missed=0, kept=True):
        """Let time pass; ``kept`` where it is noted what happens. Before the first sample, deadlines may be missed."""
        for _ in range(round(1e3 * seconds)):
            self.clock.now += (1 + missed) * PERIOD
            self._left -= 1 + missed
            if self._left <= 0:
                self.exchange()
                self._left = EXCHANGE
            tick(self.model, self.loop, self.mail.device, self.clock.now, missed)
            missed = 0
            if kept:
                self.device.wheel.advance(self.clock.now)
                torque, phase, _ = self.mail.get()
                self.torques.append(torque)
                self.phases.append(phase)
                self.motor.append(self.device.wheel.motor)
