"""The recorder of the loop: every sample, in order, and what is lost is counted."""

import sys

import numpy as np
import pytest

from steer_env.live.real_time import Limits, Mailboxes, RealTime
from steer_env.live.real_time.loop import PERIOD, make_loop_memory, tick
from steer_env.live.real_time.model import make_model
from steer_env.live.real_time.recorder import RECORD_HEAD, Recorder
from steer_env.live.real_time.safety import PHASES
from steer_env.vehicle import cars, subsystems


class Recorded:
    """A loop on a clock of its own, with a recorder of 0.1 s."""

    def __init__(self):
        self.part = subsystems.make("car", cars.load("compact").plant("lugre", robot=True), 100.0 / 3.6)
        self.mail = Mailboxes(self.part, clock=lambda: self.now)
        self.model, self.recorder = make_model(self.part), Recorder(self.part, 0.1)
        self.loop, self.now, self.told = make_loop_memory(Limits(soft_start=0.01), ring=self.recorder.ring), PERIOD, []

    def run(self, samples, missed=0):
        """What the mailbox tells of each sample: torque, phase and outputs."""
        for _ in range(samples):
            self.now += (1 + missed) * PERIOD
            self.mail.put([0.0, 1e-10 * self.now, 0.1, 0.0, 0.0, 0.0, 0.0][: len(self.part.given)], self.now)
            tick(self.model, self.loop, self.mail.device, self.now, missed)
            torque, phase, outputs = self.mail.get()
            self.told.append([1e-9 * self.now, missed, torque, PHASES.index(phase), *self.model.given, *outputs])
            missed = 0

    def drain(self):
        rows, lost = self.recorder.drain()
        told, self.told = self.told[: len(rows)], []
        names = self.recorder.columns
        first = ("time", "missed", "motor_torque", "phase")
        assert names[: len(RECORD_HEAD)] == tuple(RECORD_HEAD)
        assert rows.shape[1] == len(names)
        if len(rows):
            shown = [names.index(name) for name in first]
            kept = np.hstack([rows[:, shown], rows[:, len(RECORD_HEAD) :]])
            given, outputs = len(self.part.given), len(self.part.outputs)
            expected = np.array(told)
            used = [*range(4 + given), *range(expected.shape[1] - outputs, expected.shape[1])]
            assert np.array_equal(kept, expected[:, used])
        return len(rows), lost


def test_every_sample_is_kept_as_it_was():
    loop = Recorded()
    assert loop.drain() == (0, 0)
    loop.run(30)
    loop.run(1, missed=3)
    assert loop.drain() == (31, 0)
    for _ in range(7):  # around the end of the ring
        loop.run(60)
        assert loop.drain() == (60, 0)
    assert loop.drain() == (0, 0)


def test_what_nobody_takes_in_time_is_counted_and_the_rest_stays():
    loop = Recorded()
    loop.run(250)
    assert loop.drain() == (100, 150)
    loop.run(100)
    assert loop.drain() == (100, 0)


def test_a_recorder_of_a_loop_in_its_thread_loses_nothing_that_is_taken_in_time():
    if sys.platform != "linux":
        pytest.skip("the loop needs Linux")
    part = subsystems.make("car", cars.load("compact").plant("lugre", robot=True), 100.0 / 3.6)
    mail, taken = Mailboxes(part), []
    with RealTime(part, mail.device, most=1500, recorded=5.0) as running:
        while running.counts()["ticks"] < 1500:
            rows, lost = running.recorder.drain()
            assert lost == 0
            taken.append(rows)
            running._thread.join(0.01)
            if not running._thread.is_alive():
                break
    taken.append(running.recorder.drain()[0])
    rows = np.vstack(taken)
    assert len(rows) == running.counts()["ticks"]
    names = running.recorder.columns
    time, missed = rows[:, names.index("time")], rows[:, names.index("missed")]
    assert (np.diff(time) > 0.0).all()
    assert missed.sum() == running.counts()["missed"]


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), 1e9])
def test_bad_times_are_named(seconds):
    part = subsystems.make("steering", cars.load("compact").plant("lugre", robot=True), 20.0)
    with pytest.raises(ValueError, match="recorded seconds must be finite and at least 0 and at most 3600"):
        Recorder(part, seconds)
    assert len(Recorder(part, 0.0).drain()[0]) == 0
