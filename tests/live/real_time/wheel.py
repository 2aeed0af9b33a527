"""A fake wheel on a fake clock: it gives an angle and takes a torque, with faults at stated times."""

import math

from steer_env.live.real_time import Limits, Mailboxes
from steer_env.live.real_time.loop import PERIOD, make_loop_memory, tick
from steer_env.live.real_time.model import make_model
from steer_env.vehicle import cars, subsystems


class Wheel:
    """A wheel that a person turns to and fro, and the loop that it hangs on.

    Parameters
    ----------
    limits : Limits
        Of the watchdog.
    amplitude : float
        Of the angle [rad].
    frequency : float
        [Hz]
    dead_man : bool
        Whether the torque needs a dead-man key that is held.
    angle_bandwidth : float, optional
        Of a filter of the angle [Hz].
    """

    def __init__(self, limits=None, amplitude=0.5, frequency=0.5, dead_man=False, angle_bandwidth=None):
        self.limits = limits or Limits()
        self.part = subsystems.make("car", cars.load("compact").plant("lugre", robot=True), 100.0 / 3.6)
        names = [signal.name for signal in self.part.given]
        self.angle, self.speed = names.index("hand_angle"), names.index("hand_speed")
        clock = {"clock": lambda: self.now}
        self.mail = Mailboxes(self.part, dead_man=dead_man, angle_bandwidth=angle_bandwidth, **clock)
        self.model, self.loop = make_model(self.part), make_loop_memory(self.limits)
        self.amplitude, self.omega = amplitude, 2.0 * math.pi * frequency
        self.now = 5 * PERIOD  # [ns]
        self.offset = 0  # of the clock that stamps the wheel's readings [ns]
        self.torques, self.phases = [], []  # of the motor, after each sample

    def run(self, seconds, silent=False, missed=0, held=True):
        """Let time pass; ``silent`` where the wheel's angle no longer arrives, and
        ``held`` where the dead-man key is held. The torques of these samples [N m]."""
        first = len(self.torques)
        for _ in range(round(seconds * 1e3) - missed):
            self.now += (1 + missed) * PERIOD
            t = 1e-9 * self.now
            inputs = [0.0] * len(self.part.given)
            inputs[self.angle] = self.amplitude * math.sin(self.omega * t)
            inputs[self.speed] = self.amplitude * self.omega * math.cos(self.omega * t)
            if not silent:
                self.mail.put(inputs, self.now + self.offset, dead_man=held)
            tick(self.model, self.loop, self.mail.device, self.now, missed)
            missed = 0
            torque, phase, _ = self.mail.get()
            self.torques.append(torque)
            self.phases.append(phase)
        return self.torques[first:]
