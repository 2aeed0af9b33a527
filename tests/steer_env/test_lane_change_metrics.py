"""Lane-change metrics against passes whose answers are known in closed form, clean, in noise, and in bad recordings."""

import numpy as np
import pytest

from steer_env import metrics
from steer_env.recording import DEGREE, Recording

SPEED = 80.0 / 3.6  # [m/s]
WIDTH, LENGTH, CENTRE = 1.8, 4.5, -0.3  # of the car, and of its middle ahead of where x and y are measured [m]
FRONT, REAR = CENTRE + LENGTH / 2, CENTRE - LENGTH / 2
ANGLE, TORQUE, AY, YAW = 60 * DEGREE, 4.0, 5.0, 15 * DEGREE
YAW_LAG, AY_LAG, CYCLES = 0.08, 0.12, 3
NOISE = {
    "handwheel_angle": 0.05 * DEGREE,
    "handwheel_speed": 1.0 * DEGREE,
    "handwheel_torque": 0.05,
    "lateral_acceleration": 0.02,
    "yaw_rate": 0.1 * DEGREE,
    "vehicle_speed": 0.05,
}
PLACE = {
    "entry_x_m": 60.0,
    "entry_y_m": 0.0,
    "edition": "2018",
    "vehicle_width_m": WIDTH,
    "vehicle_length_m": LENGTH,
    "vehicle_centre_m": CENTRE,
}
SIGNED = ("handwheel_angle", "handwheel_speed", "handwheel_torque", "lateral_acceleration", "yaw_rate", "yaw_angle")


def double_lane_change(rate, passes=6, aside=0.2):
    """Passes at 80 km/h, driven backwards between, in half-cosine lane changes that no cone is near.

    In the side lane the car is ``aside`` to the left of its middle. The hand steers three cycles a pass.
    """
    span, run = 245.0, 245.0 / SPEED
    time = np.arange(int(2 * passes * run * rate)) / rate
    x = 0.5 * span - np.arcsin(np.cos(np.pi * time / run)) * span / np.pi  # to and fro
    side, back = 3.5 - 1.115 + 1.205 + aside, 0.28  # the last lane's middle is 0.18

    def step(x, start, end):
        u = np.pi * np.clip((x - 60.0 - start) / (end - start), 0.0, 1.0)
        return 0.5 * (1 - np.cos(u)), 0.5 * np.pi / (end - start) * np.sin(u)

    # The outline is clear of the lanes while it moves aside.
    first, second = step(x, 15 - REAR + 0.5, 45 - FRONT - 0.5), step(x, 70 - REAR + 0.5, 95 - FRONT - 0.5)
    omega = 2 * np.pi * CYCLES * SPEED / (125.0 + LENGTH)
    phase = omega * (np.mod(time - (60.0 - FRONT) / SPEED + run / 2, 2 * run) - run / 2)  # from the begin of each pass

    def wave(delay=0.0):
        """A sine whose first half cycle is the largest: a largest of equals would be the one that noise favours."""
        p = phase - omega * delay
        return np.sin(p) * np.where((p > 0) & (p < np.pi), 1.0, 0.8)

    rate = np.cos(phase) * np.where(np.abs(phase - 2 * np.pi) < np.pi / 2, 1.0, 0.8)  # largest after a cycle
    channels = {
        "x": x,
        "y": side * first[0] + (back - side) * second[0],
        "yaw_angle": np.arctan(side * first[1] + (back - side) * second[1]),
        "handwheel_angle": ANGLE * wave(),
        "handwheel_speed": ANGLE * omega * rate,
        "handwheel_torque": TORQUE * wave(),
        "lateral_acceleration": AY * wave(AY_LAG),
        "yaw_rate": YAW * wave(YAW_LAG),
        "vehicle_speed": np.full(time.size, SPEED),
    }
    answers = {
        "course_completed": 1.0,
        "cones_hit": 0.0 if aside < 0.305 else 6.0,
        "smallest_cone_margin": 0.305 - aside,
        "lane_change_entry_speed": 80.0,
        "lane_change_exit_speed": 80.0,
        "lane_change_lateral_acceleration": AY,
        "lane_change_yaw_rate": YAW / DEGREE,
        "lane_change_handwheel_angle": ANGLE / DEGREE,
        "lane_change_handwheel_speed": ANGLE * omega / DEGREE,
        "lane_change_handwheel_torque": TORQUE,
        "lane_change_torque_rms": TORQUE * np.sqrt(0.5 * (2 + 10 * 0.64) / 12),  # of twelve quarters
        "lane_change_steering_effort": 0.5 * TORQUE * ANGLE * (4 * 0.8 + 8 * 0.64),
        "lane_change_yaw_lag": 1e3 * YAW_LAG,
    }
    return Recording(time, channels, {name: metrics.CHANNELS[name] for name in channels}, PLACE), answers


def evaluate(recording, **given):
    return metrics.evaluate(recording, "double-lane-change", **given)


def changed(recording, meta=None, **channels):
    meta = recording.meta if meta is None else meta
    return Recording(recording.time, {**recording.channels, **channels}, recording.units, meta)


def without(recording, name):
    units = {key: unit for key, unit in recording.units.items() if key != name}
    return Recording(recording.time, {key: recording[key] for key in units}, units, recording.meta)


@pytest.mark.parametrize("aside", [0.2, 0.4])
@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_closed_forms(rate, aside):
    """Within 0.2 % or 2 mm: a parabola for a sine over 0.16 s, and the low-pass."""
    recording, answers = double_lane_change(rate, passes=2, aside=aside)
    found = evaluate(recording)
    assert found.keys() == answers.keys() == set(metrics.available("double-lane-change"))
    for name, value in found.items():
        assert value.reason == ""
        assert len(value.repeats) == 2
        assert value.value == pytest.approx(answers[name], rel=2e-3, abs=2e-3), name


def test_interval_covers_the_truth():
    """In 40 trials with six passes each, at least 85 % for each metric that the noise reaches."""
    recording, answers = double_lane_change(100.0)
    covered = dict.fromkeys(answers, 0)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        noisy = {
            name: recording[name] + size * rng.standard_normal(recording.time.size) for name, size in NOISE.items()
        }
        for name, value in evaluate(changed(recording, **noisy)).items():
            covered[name] += value.low <= answers[name] <= value.high
    print(covered)
    # without noise in position and direction these repeat themselves; test_position_noise has some
    for name in ("course_completed", "cones_hit", "smallest_cone_margin"):
        del covered[name]
    assert min(covered.values()) >= 0.85 * 40


def test_position_noise():
    """2 cm and 0.05 deg of a good satellite receiver cost the margin 3 cm, three deviations of what is left of them."""
    recording, answers = double_lane_change(100.0, passes=2)
    rng = np.random.default_rng(0)
    noise = {"x": 0.02, "y": 0.02, "yaw_angle": 0.05 * DEGREE}
    found = evaluate(
        changed(recording, **{n: recording[n] + s * rng.standard_normal(recording.time.size) for n, s in noise.items()})
    )
    assert found["cones_hit"].repeats == (0.0, 0.0)
    assert found["smallest_cone_margin"].value == pytest.approx(answers["smallest_cone_margin"], abs=0.03)


def test_course_elsewhere_turned_and_mirrored():
    """A course at another place and in another direction, a yaw angle that jumps by a turn, and the mirror image."""
    recording, _ = double_lane_change(200.0, passes=1)
    plain = evaluate(recording)
    turn, along, across = 2.9, recording["x"] - 60.0, recording["y"]
    moved = changed(
        recording,
        meta={**PLACE, "entry_x_m": -300.0, "entry_y_m": 1000.0, "entry_yaw_rad": turn},
        x=-300.0 + np.cos(turn) * along - np.sin(turn) * across,
        y=1000.0 + np.sin(turn) * along + np.cos(turn) * across,
        yaw_angle=recording["yaw_angle"] + turn,
    )
    jumping = changed(moved, yaw_angle=np.mod(moved["yaw_angle"] - turn + 1e-3, 2 * np.pi) + turn - 1e-3)
    mirrored = changed(
        recording, meta={**PLACE, "mirrored": True}, y=-recording["y"], **{name: -recording[name] for name in SIGNED}
    )
    for other in (moved, jumping, mirrored):
        found = evaluate(other)
        for name, value in plain.items():
            assert found[name].value == pytest.approx(value.value, rel=1e-6, abs=1e-6), name


def test_speeds_at_both_ends():
    """A speed that falls by 0.5 m/s2 is read where the car's ends pass the cones; a mean over 0.2 s keeps it."""
    recording, _ = double_lane_change(200.0, passes=1)
    found = evaluate(changed(recording, vehicle_speed=30.0 - 0.5 * recording.time), speed_m_s=28.7)
    begin, end = (60.0 - FRONT) / SPEED, (60.0 + 125.0 - REAR) / SPEED
    assert found["lane_change_entry_speed"].value == pytest.approx(3.6 * (30.0 - 0.5 * begin), abs=0.01)
    assert found["lane_change_exit_speed"].value == pytest.approx(3.6 * (30.0 - 0.5 * end), abs=0.01)


def refusals(recording, test="double-lane-change", **given):
    return {name: value.reason for name, value in metrics.evaluate(recording, test, **given).items() if value.reason}


CLEAN, _ = double_lane_change(100.0, passes=1)


@pytest.mark.parametrize("key", ["entry_x_m", "entry_y_m", "edition", "vehicle_width_m", "vehicle_length_m"])
def test_a_course_that_is_not_known_is_refused(key):
    recording = changed(CLEAN, meta={name: value for name, value in PLACE.items() if name != key})
    refused = refusals(recording)
    assert refused.keys() == set(metrics.available("double-lane-change"))
    assert all(reason.startswith(f"{key} is not known (") and f"{key}=..." in reason for reason in refused.values())
    assert not refusals(recording, **{key: PLACE[key]})


@pytest.mark.parametrize(
    ("recording", "given", "reason"),
    [
        (CLEAN, {"edition": "1066"}, "no edition '1066'; there are 2018, 1999"),
        (CLEAN, {"entry_x_m": 600.0}, "never passes the first cones: start the recording before them"),
        (CLEAN, {"speed_m_s": 100 / 3.6}, "enters at 80 km/h, not at 100 km/h +- 3%: enter at that speed"),
        (without(CLEAN, "yaw_angle"), {}, "no channel 'yaw_angle': record it"),
        (without(CLEAN, "x"), {}, "no channel 'x': record it"),
        (changed(CLEAN, y=np.where(CLEAN.time < 1.0, np.nan, CLEAN["y"])), {}, "'y' has samples that are not finite"),
        (CLEAN.resampled(20.0), {}, "record at 40 Hz or faster"),
        (Recording(CLEAN.time, CLEAN.channels, {**CLEAN.units, "x": "1"}, PLACE), {}, "x is in '1': give it in 'm'"),
    ],
)
def test_refused_altogether(recording, given, reason):
    refused = refusals(recording, **given)
    assert refused.keys() == set(metrics.available("double-lane-change"))
    assert all(reason in text for text in refused.values()), refused


def test_refused_one_by_one():
    of_torque = {"lane_change_handwheel_torque", "lane_change_torque_rms", "lane_change_steering_effort"}
    swapped = refusals(changed(CLEAN, handwheel_torque=-CLEAN["handwheel_torque"]))
    assert swapped.keys() == of_torque
    assert "handwheel_torque runs against handwheel_angle: check the signs" in swapped["lane_change_torque_rms"]
    assert refusals(changed(CLEAN, yaw_rate=-CLEAN["yaw_rate"])).keys() == {
        "lane_change_yaw_rate",
        "lane_change_yaw_lag",
    }
    assert refusals(changed(CLEAN, handwheel_speed=-CLEAN["handwheel_speed"])).keys() == {
        "lane_change_handwheel_speed",
        "lane_change_steering_effort",
    }
    burst = CLEAN["lateral_acceleration"].copy()
    burst[300:310] = np.nan
    assert refusals(changed(CLEAN, lateral_acceleration=burst)).keys() == {"lane_change_lateral_acceleration"}
    assert refusals(without(CLEAN, "handwheel_torque")).keys() == of_torque
    assert refusals(without(CLEAN, "vehicle_speed")).keys() == {"lane_change_entry_speed", "lane_change_exit_speed"}
    still = refusals(changed(CLEAN, handwheel_angle=0.01 * CLEAN["handwheel_angle"]))
    assert {"cones_hit", "course_completed", "lane_change_entry_speed"}.isdisjoint(still)
    assert still["lane_change_yaw_lag"] == "handwheel_angle stays below 5 deg: steer through the course"


def test_a_pass_that_is_broken_off():
    """It counts as not completed; there is nothing else to read."""
    short = CLEAN.between(0.0, 6.0)
    found = evaluate(short)
    assert found["course_completed"].value == 0.0
    assert found["cones_hit"].reason == "no pass reaches the last cones: record to behind them"


def test_a_car_beside_the_lanes_has_not_completed_the_course():
    found = evaluate(changed(CLEAN, y=np.zeros_like(CLEAN.time), yaw_angle=np.zeros_like(CLEAN.time)))
    assert found["course_completed"].value == 0.0
    assert found["cones_hit"].value == 0.0  # it drives past the side lane, 1.485 m from its cones
    assert found["smallest_cone_margin"].value == pytest.approx(0.215, abs=2e-3)


def test_obstacle_avoidance_reads_any_speed():
    """Its course is shorter; the same passes go through its metrics and hit what stands elsewhere."""
    found = metrics.evaluate(changed(CLEAN, meta={**PLACE, "edition": "2011"}), "obstacle-avoidance")
    assert set(found) == set(metrics.available("obstacle-avoidance"))
    assert found["lane_change_entry_speed"].value == pytest.approx(80.0, rel=1e-3)
    assert found["cones_hit"].value > 0
