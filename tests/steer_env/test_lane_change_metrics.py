"""Lane-change metrics against passes whose answers are known in closed form, and in bad recordings."""

from dataclasses import replace

import numpy as np
import pytest

from steer_env import metrics
from steer_env.recording.recording import Recording
from tests.steer_env.checks import burst, check, check_alike, check_refused, refusals
from tests.synthetic.lane_change import (
    FRONT,
    REAR,
    SPEED,
    double_lane_change,
    hitting,
    lane_change,
    obstacle_avoidance,
)
from tests.synthetic.recordings import changed, mirrored


def evaluate(recording, **given):
    return metrics.evaluate(recording, "double-lane-change", **given)


def placed(recording, **meta):
    """The recording with another meta."""
    return replace(recording, meta={**recording.meta, **meta})


@pytest.mark.parametrize("case", [double_lane_change, hitting, obstacle_avoidance])
@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_closed_forms(rate, case):
    """Within 0.2 %: a parabola for a sine over 0.16 s, and the low-pass; 2 mm of the margin, in short lane changes."""
    found = check(*case(rate), {"rest": 2e-3, "smallest_cone_margin": 2e-2})
    assert all(len(value.repeats) == 4 for value in found.values())


def test_course_elsewhere_turned_and_mirrored():
    """A course at another place and in another direction, a yaw angle that jumps by a turn, and the mirror image."""
    recording, _ = lane_change(200.0, "double-lane-change", passes=1)
    turn, along, across = 2.9, recording["x"] - 60.0, recording["y"]
    moved = changed(
        placed(recording, entry_x_m=-300.0, entry_y_m=1000.0, entry_yaw_rad=turn),
        x=-300.0 + np.cos(turn) * along - np.sin(turn) * across,
        y=1000.0 + np.sin(turn) * along + np.cos(turn) * across,
        yaw_angle=recording["yaw_angle"] + turn,
    )
    jumping = changed(moved, yaw_angle=np.mod(moved["yaw_angle"] - turn + 1e-3, 2 * np.pi) + turn - 1e-3)
    for other in (moved, jumping, mirrored(placed(recording, mirrored=True))):
        check_alike(recording, other, "double-lane-change", rel=1e-6, abs=1e-6)


def test_speeds_at_both_ends():
    """A speed that falls by 0.5 m/s2 is read where the car's ends pass the cones; a mean over 0.2 s keeps it."""
    recording, _ = lane_change(200.0, "double-lane-change", passes=1)
    found = evaluate(changed(recording, vehicle_speed=30.0 - 0.5 * recording.time), speed_m_s=28.7)
    begin, end = (60.0 - FRONT) / SPEED, (60.0 + 125.0 - REAR) / SPEED
    assert found["lane_change_entry_speed"].value == pytest.approx(3.6 * (30.0 - 0.5 * begin), abs=0.01)
    assert found["lane_change_exit_speed"].value == pytest.approx(3.6 * (30.0 - 0.5 * end), abs=0.01)


CLEAN, _ = lane_change(100.0, "double-lane-change", passes=1)


@pytest.mark.parametrize("key", ["entry_x_m", "entry_y_m", "edition", "vehicle_width_m", "vehicle_length_m"])
def test_a_course_that_is_not_known_is_refused(key):
    recording = placed(CLEAN, **{key: None})
    check_refused(recording, f"{key} is not known (")
    check_refused(recording, f"{key}=...")
    assert not refusals(recording, **{key: CLEAN.meta[key]})


@pytest.mark.parametrize(
    ("recording", "given", "reason"),
    [
        (CLEAN, {"edition": "1066"}, "no edition '1066'; there are 2018, 1999"),
        (CLEAN, {"entry_x_m": 600.0}, "never passes the first cones: start the recording before them"),
        (CLEAN, {"speed_m_s": 100 / 3.6}, "enters at 80 km/h, not at 100 km/h +- 3%: enter at that speed"),
        (CLEAN.without("yaw_angle"), {}, "no channel 'yaw_angle': record it"),
        (CLEAN.without("x"), {}, "no channel 'x': record it"),
        (changed(CLEAN, y=np.where(CLEAN.time < 1.0, np.nan, CLEAN["y"])), {}, "'y' has samples that are not finite"),
        (CLEAN.resampled(20.0), {}, "record at 40 Hz or faster"),
        (
            Recording(CLEAN.time, CLEAN.channels, {**CLEAN.units, "x": "1"}, CLEAN.meta),
            {},
            "x is in '1': give it in 'm'",
        ),
    ],
)
def test_refused_altogether(recording, given, reason):
    check_refused(recording, reason, **given)


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
    assert refusals(burst(CLEAN, "lateral_acceleration")).keys() == {"lane_change_lateral_acceleration"}
    assert refusals(CLEAN.without("handwheel_torque")).keys() == of_torque
    assert refusals(CLEAN.without("vehicle_speed")).keys() == {"lane_change_entry_speed", "lane_change_exit_speed"}
    still = refusals(changed(CLEAN, handwheel_angle=0.01 * CLEAN["handwheel_angle"]))
    assert {"cones_hit", "course_completed", "lane_change_entry_speed"}.isdisjoint(still)
    assert still["lane_change_yaw_lag"] == "handwheel_angle stays below 5 deg: steer through the course"


def test_a_pass_that_is_broken_off():
    """It counts as not completed; there is nothing else to read."""
    short = CLEAN.between(0.0, 6.0)
    found = evaluate(short)
    assert found["course_completed"].value == 0.0
    assert found["cones_hit"].reason == "no pass reaches the last cones: record until the car is behind them"


def test_a_car_beside_the_lanes_has_not_completed_the_course():
    found = evaluate(changed(CLEAN, y=np.zeros_like(CLEAN.time), yaw_angle=np.zeros_like(CLEAN.time)))
    assert found["course_completed"].value == 0.0
    assert found["cones_hit"].value == 0.0  # it drives past the side lane, 1.485 m from its cones
    assert found["smallest_cone_margin"].value == pytest.approx(0.215, abs=2e-3)


def test_obstacle_avoidance_reads_any_speed():
    """Its course is shorter; the same passes go through its metrics and hit what stands elsewhere."""
    found = metrics.evaluate(placed(CLEAN, edition="2011"), "obstacle-avoidance")
    assert set(found) == set(metrics.available("obstacle-avoidance"))
    assert found["lane_change_entry_speed"].value == pytest.approx(80.0, rel=1e-3)
    assert found["cones_hit"].value > 0
