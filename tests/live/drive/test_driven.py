"""Drives that have no metrics as a whole, and the part of them that has."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steer_env import manoeuvres, metrics
from steer_env.recording import driven as driven_module
from steer_env.vehicle import cars


@pytest.fixture(scope="module")
def robot():
    return manoeuvres.drive(cars.load("compact"), manoeuvres.make("weave"), "lugre")


def driven(robot, motor=True, gain=(), configurations=(), missed=(), mixed=()):
    """The robot's weave as a person's drive, with other values of gain, configuration, missed deadlines and share."""
    time = robot.time
    own = {"chosen_set": np.ones(time.size), "share_of_next_set": np.zeros(time.size)}
    own["deadlines_missed"] = np.zeros(time.size)
    own["watchdog_gain"] = np.minimum(time - time[0], 1.0)  # soft start
    for name, changes in zip(("watchdog_gain", "chosen_set", "deadlines_missed"), (gain, configurations, missed)):
        for t0, t1, value in changes:
            own[name][(time >= t0) & (time < t1)] = value
    own["share_of_next_set"][1:] = np.abs(np.diff(own["chosen_set"])) * 0.5
    for t0, t1, value in mixed:
        own["share_of_next_set"][(time >= t0) & (time < t1)] = value
    meta = {**robot.meta, "motor": motor, "sets": [{"label": "lugre"}, {"label": "masing"}]}
    units = {**robot.units, **dict.fromkeys(own, "1")}
    return replace(robot, channels={**robot.channels, **own}, units=units, meta=meta)


def refusal(recording):
    reasons = {value.reason for value in metrics.evaluate(recording, intervals=False).values()}
    assert len(reasons) == 1
    return reasons.pop()


def between(sentence):
    """The part that a refusal tells."""
    return [float(word) for word in sentence.rpartition("--between ")[2].split()]


def test_soft_start_and_last_fade_belong_to_a_drive(robot):
    expected = metrics.evaluate(robot, intervals=False)
    end = robot.time[-1]
    found = metrics.evaluate(driven(robot, gain=[(end - 0.1, end + 1.0, 0.0)]), intervals=False)
    assert {name: value.value for name, value in found.items()} == {n: v.value for n, v in expected.items()}


def test_a_torque_that_was_off_is_refused_with_the_part_that_is_whole(robot):
    off = driven(robot, gain=[(10.0, 11.0, 0.0)])
    sentence = refusal(off)
    assert "the torque was off or faded, first at 10.0 s" in sentence
    start, end = between(sentence)
    assert (start, end) == (11.0, pytest.approx(robot.time[-1], abs=0.1))
    assert not any(value.reason for value in metrics.evaluate(off.between(start, end), intervals=False).values())


def test_a_torque_that_ends_early_or_never_begins_is_refused(robot):
    end = robot.time[-1]
    assert between(refusal(driven(robot, gain=[(end - 2.0, end + 1.0, 0.0)])))[1] == pytest.approx(end - 2.0, abs=0.11)
    assert "drive again" in refusal(driven(robot, gain=[(0.0, end + 1.0, 0.0)]))
    assert "off or faded, first at 0.0 s" in refusal(driven(robot, gain=[(0.0, 5.0, 0.0)]))


def test_two_configurations_that_are_mixed_and_numbers_of_none_are_refused(robot):
    mixed = driven(robot, motor=False, mixed=[(20.0, 20.5, 0.9)])
    assert "two configurations were mixed, first at 20.0 s. The longest part that is whole: --between 20.5" in refusal(
        mixed
    )
    assert "two configurations were mixed" in refusal(driven(robot, motor=False, mixed=[(0.0, 1e3, np.nan)]))
    for number in (np.nan, 3.0, 0.0):
        assert "chosen_set is not everywhere the number" in refusal(driven(robot, configurations=[(5.0, 6.0, number)]))


def test_no_part_below_a_second_is_told(robot):
    pulses = [(t, t + 0.5, 0.0) for t in np.arange(0.0, 70.0, 1.0)]
    assert "drive again" in refusal(driven(robot, gain=pulses))


def test_doubts_of_the_timing_are_not_of_what_tells_the_torque(robot):
    late = driven(robot, gain=[(0.0, 1.9, 0.0)])
    found = metrics.evaluate(late, timing=0.02)
    assert not any("watchdog_gain" in value.reason or "chosen_set" in value.reason for value in found.values())
    assert not all(value.reason for value in found.values())


def test_without_a_motor_there_is_no_torque_that_could_be_off(robot):
    found = metrics.evaluate(driven(robot, motor=False, gain=[(0.0, 1e3, 0.0)]), intervals=False)
    assert not any(value.reason for value in found.values())


def test_several_configurations_are_refused_with_the_longest_part_of_one(robot):
    several = driven(robot, motor=False, configurations=[(0.0, 8.0, 2.0)])
    sentence = refusal(several)
    assert "several configurations acted: masing to 8.0 s, lugre to" in sentence
    start, end = between(sentence)
    assert start == pytest.approx(8.0, abs=0.1)
    part = several.between(start, end)
    assert set(part["chosen_set"]) == {1.0}
    assert not any(value.reason for value in metrics.evaluate(part, intervals=False).values())


def test_a_simulation_that_stood_still_is_refused_with_the_part_in_time(robot):
    at = robot.time[np.searchsorted(robot.time, 9.0)]
    halted = driven(robot, motor=False, missed=[(at, at + 1e-9, 150.0)])
    sentence = refusal(halted)
    assert f"the simulation stood still, first at {at:.1f} s and for up to 0.1 s" in sentence
    start, end = between(sentence)
    assert (start, end) == (pytest.approx(at, abs=0.11), pytest.approx(robot.time[-1], abs=0.11))
    assert not any(value.reason for value in metrics.evaluate(halted.between(start, end), intervals=False).values())


def test_many_missed_deadlines_are_refused_with_a_part_that_has_few(robot):
    many = driven(robot, missed=[(2.0, 8.0, 3.0)])
    assert driven_module.share_missed(many) == pytest.approx(18e3 / (18e3 + robot.time.size), rel=1e-3)
    sentence = refusal(many)
    assert "% of the deadlines were missed, first at 2.0 s, by which the person was too fast" in sentence
    start, end = between(sentence)
    assert 5.9 < start <= 6.1  # 2 s with three deadlines missed at each sample are 10 % of the 60 s that they last
    driven_module.check(many.between(start, end))
    with pytest.raises(ValueError, match="deadlines were missed"):
        driven_module.check(many.between(start - 0.1, end))
    assert "drive again" in refusal(driven(robot, missed=[(0.0, 1e3, 1.0)]))


def test_few_missed_deadlines_are_no_reason(robot):
    driven_module.check(driven(robot, missed=[(5.0, 5.02, 20.0)]))


@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.01, 0.09))
def test_the_part_that_is_told_is_sound_and_none_that_is_longer(robot, seed, share):
    rng = np.random.default_rng(seed)
    whole = driven(robot.without(*list(robot.channels)[1:]))  # what is checked are the channels of a drive
    gain = whole["watchdog_gain"].copy()
    gain[rng.integers(0.2 * gain.size, 0.9 * gain.size, size=3)] = 0.5
    missed = rng.binomial(1, share, gain.size).astype(float)
    several = replace(whole, channels={**whole.channels, "watchdog_gain": gain, "deadlines_missed": missed})
    with pytest.raises(ValueError, match="torque was off") as error:
        driven_module.check(several)
    start, end = between(str(error.value))
    driven_module.check(several.between(start, end))
    for earlier, later in ((round(start - 0.1, 1), end), (start, round(end + 0.1, 1))):
        if earlier >= robot.time[0] + 1.0 and later <= robot.time[-1]:
            wider = several.between(earlier, later)
            many = wider["deadlines_missed"].sum()  # of a robot's drive, a row is one sample
            assert many / (many + wider.time.size) > 0.1 or (wider["watchdog_gain"] < 1.0).any()
