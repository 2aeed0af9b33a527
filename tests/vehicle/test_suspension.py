"""Closure of the linkage and its derivatives; ``tests.verification`` has the table, and the rack force by statics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steer_env.vehicle.suspension.macpherson import (
    MacPherson,
    mirrored,
)

STRUT = MacPherson.load("s1")
RACK = st.floats(-0.075, 0.075)
TRAVEL = st.floats(-0.080, 0.080)
POSITIONS = ("wheel_centre", "contact", "lower_ball_joint", "tie_rod_outer", "tie_rod_inner")


def random_cases(count, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.075, 0.075, count), rng.uniform(-0.08, 0.08, count)


def test_s2_as_the_pages_tell_it():
    """Caster, king-pin inclination [deg], trail, scrub [mm], and both wheels with the rack at 64 mm [deg]."""
    strut = MacPherson.load("s2")
    pose, (inner, outer) = strut.straight, strut.solve_pair(0.064, 0.0, 0.0)
    angles = (pose.caster, pose.kingpin_inclination, inner.steer_angle, outer.steer_angle)
    assert np.degrees(angles) == pytest.approx([2.50, 13.60, 37.42, 30.20], abs=0.005)
    assert 1e3 * np.array([pose.trail, pose.scrub]) == pytest.approx([27.5, 7.5], abs=0.05)


def test_design_pose_is_that_of_the_hard_points():
    pose = STRUT.solve(0.0, 0.0)
    assert abs(pose.toe) < 1e-15
    assert abs(pose.camber) < 1e-15
    np.testing.assert_allclose(pose.wheel_centre, STRUT.points["wheel_centre"], rtol=0, atol=1e-15)


# Kinematics.


@given(RACK, TRAVEL)
def test_links_keep_their_length_and_the_strut_its_axis(rack, travel):
    pose = STRUT.solve(rack, travel)
    design = {name: np.array(point) for name, point in STRUT.points.items()}
    moved = {"lower_ball_joint": pose.lower_ball_joint, "tie_rod_outer": pose.tie_rod_outer}
    moved["tie_rod_inner"] = design["tie_rod_inner"] - [0.0, rack, 0.0]  # behind the axle: to the right for left
    for one, other in (
        ("lower_ball_joint", "lower_arm_front_pivot"),
        ("lower_ball_joint", "lower_arm_rear_pivot"),
        ("tie_rod_outer", "tie_rod_inner"),
    ):
        length = np.linalg.norm(moved[one] - moved.get(other, design[other]))
        assert length == pytest.approx(np.linalg.norm(design[one] - design[other]), abs=1e-12)
    in_knuckle = pose.rotation.T @ (design["strut_top"] - pose.lower_ball_joint) + design["lower_ball_joint"]
    axis = design["strut_top"] - design["strut_axis_lower_point"]
    off = np.cross(axis / np.linalg.norm(axis), in_knuckle - design["strut_axis_lower_point"])
    assert np.abs(off).max() < 1e-12
    assert pose.strut_length == pytest.approx(np.linalg.norm(in_knuckle - design["strut_axis_lower_point"]), abs=1e-12)
    assert pose.wheel_centre[2] == pytest.approx(travel, abs=1e-12)
    assert np.abs(pose.rotation @ pose.rotation.T - np.eye(3)).max() < 1e-14


@given(RACK, TRAVEL)
def test_left_is_positive(rack, travel):
    here, further = STRUT.solve(np.array([rack, rack + 1e-4]), travel).steer_angle
    assert further > here


@pytest.mark.parametrize(("coordinate", "du"), [("per_rack", (1e-5, 0.0)), ("per_travel", (0.0, 1e-5))])
def test_derivatives_equal_differences(coordinate, du):
    rack, travel = random_cases(50)
    motion = getattr(STRUT.solve(rack, travel), coordinate)
    ahead, behind = STRUT.solve(rack + du[0], travel + du[1]), STRUT.solve(rack - du[0], travel - du[1])
    h = 2 * sum(du)
    # Central differences with 10 um: truncation up to 1e-6 of the derivative near lock, rounding 1e-10.
    close = {"rtol": 2e-6, "atol": 1e-6}
    np.testing.assert_allclose(motion.wheel_centre, (ahead.wheel_centre - behind.wheel_centre) / h, **close)
    np.testing.assert_allclose(motion.strut_length, (ahead.strut_length - behind.strut_length) / h, **close)
    turn = (ahead.rotation - behind.rotation) / h @ STRUT.solve(rack, travel).rotation.transpose(0, 2, 1)
    np.testing.assert_allclose(motion.rotation, turn[:, [2, 0, 1], [1, 2, 0]], **close)
    # The contact moves as a point of the knuckle, not with the lowest point of the tyre.
    lever = STRUT.solve(rack, travel).contact - STRUT.solve(rack, travel).wheel_centre
    np.testing.assert_allclose(
        motion.contact, motion.wheel_centre + np.cross(motion.rotation, lever), rtol=0, atol=1e-12
    )


def test_fixed_strut_turns_about_the_king_pin():
    rack, travel = random_cases(50)
    pose = STRUT.solve(rack, travel)
    motion = pose.at_fixed_strut()
    axis = pose.strut_top - pose.lower_ball_joint
    assert np.abs(np.cross(axis, motion.rotation)).max() < 1e-12
    expected = np.cross(motion.rotation, pose.contact - pose.lower_ball_joint)
    np.testing.assert_allclose(motion.contact, expected, rtol=0, atol=1e-12)


def test_batch_equals_scalar():
    rack, travel = random_cases(6)
    batch = STRUT.solve(rack.reshape(2, 3), travel.reshape(2, 3))
    assert batch.contact.shape == (2, 3, 3)
    for k in range(6):
        pose = STRUT.solve(rack[k], travel[k])
        np.testing.assert_allclose(pose.contact, batch.contact.reshape(6, 3)[k], rtol=0, atol=1e-14)
        np.testing.assert_allclose(pose.steer_angle, batch.steer_angle.flat[k], rtol=0, atol=1e-14)


def test_track_moves_the_strut_only():
    narrow = STRUT.at_track(1.390)
    assert narrow.points["wheel_centre"][1] == pytest.approx(0.695)
    here, there = STRUT.solve(0.03, 0.02), narrow.solve(0.03, 0.02)
    assert there.steer_angle == pytest.approx(here.steer_angle, abs=1e-14)
    np.testing.assert_allclose(there.contact - here.contact, [0.0, -0.055, 0.0], atol=1e-14)


def test_rack_ahead_of_the_axle_steers_left_too():
    points = dict(STRUT.points)
    for name in ("tie_rod_outer", "tie_rod_inner"):
        x, y, z = points[name]
        points[name] = (-x, y, z)
    pose = MacPherson(points, 0.298).solve(0.02, 0.0)
    assert pose.steer_angle > 0.1
    assert pose.tie_rod_inner[1] - points["tie_rod_inner"][1] == pytest.approx(0.02)  # now to the left
    assert STRUT.solve(0.02, 0.0).tie_rod_inner[1] - STRUT.points["tie_rod_inner"][1] == pytest.approx(-0.02)


def test_right_wheel_is_the_mirror_image():
    left, right = STRUT.solve_pair(0.03, 0.02, -0.01)
    other_left, other_right = STRUT.solve_pair(-0.03, -0.01, 0.02)
    assert right.steer_angle == -other_left.steer_angle
    assert right.inclination == -other_left.inclination
    assert right.toe == other_left.toe
    for name in POSITIONS:
        np.testing.assert_array_equal(getattr(right, name), getattr(other_left, name) * [1, -1, 1])
        np.testing.assert_array_equal(getattr(left, name), getattr(other_right, name) * [1, -1, 1])
    again = mirrored(mirrored(left))
    np.testing.assert_array_equal(again.rotation, left.rotation)
    np.testing.assert_array_equal(again.per_rack.rotation, left.per_rack.rotation)


# Refusals.


@pytest.mark.parametrize("value", [(np.nan, 0.0, 0.0), (0.0, 1.0), "here", (99.0, 0.0, 0.0)])
def test_bad_coordinates_are_named(value):
    with pytest.raises(ValueError, match=r"strut_top is .*three finite coordinates"):
        MacPherson({**STRUT.points, "strut_top": value}, 0.298)


def test_a_missing_point_is_named():
    with pytest.raises(ValueError, match="points lack strut_top;"):
        MacPherson({key: point for key, point in STRUT.points.items() if key != "strut_top"}, 0.298)


def test_an_unknown_point_is_named():
    with pytest.raises(ValueError, match="unknown upper_arm"):
        MacPherson({**STRUT.points, "upper_arm": (0, 0, 0)}, 0.298)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("lower_ball_joint", STRUT.points["tie_rod_outer"], "lower_ball_joint is .*from tie_rod_outer"),
        ("lower_arm_rear_pivot", STRUT.points["lower_arm_front_pivot"], "lower_arm_front_pivot is .*rear_pivot"),
        ("lower_ball_joint", (0.310, 0.340, -0.102), "lower_ball_joint is .*the line of the arm's pivots"),
        ("wheel_centre", (0.0, -0.75, 0.0), "wheel_centre is .*left wheel"),
        ("strut_top", (-0.04, 0.56, -0.3), "strut_top is .*height"),
        ("tie_rod_outer", (-0.00545, 0.67821, 0.0), "tie_rod_outer is .*lever"),
        ("tie_rod_inner", (-0.4, 0.680, -0.05), "tie_rod_inner is .*along the rack"),
    ],
)
def test_points_that_make_no_strut_are_named(name, value, message):
    with pytest.raises(ValueError, match=message):
        MacPherson({**STRUT.points, name: value}, 0.298)


def test_a_wheel_that_cannot_rise_is_refused():
    x, y, z = STRUT.points["wheel_centre"]
    pivot = 1 / STRUT.solve(0.0, 0.0).per_travel.rotation[1]  # so far ahead the knuckle pitches without lifting
    with pytest.raises(ValueError, match=r"wheel_centre is .*up and down"):
        MacPherson({**STRUT.points, "wheel_centre": (x + pivot, y, z)}, 0.298)


@pytest.mark.parametrize("radius", [0.0, -0.3, np.nan, np.inf])
def test_loaded_radius_is_checked(radius):
    with pytest.raises(ValueError, match="loaded_radius is"):
        MacPherson(STRUT.points, radius)


def test_out_of_reach_names_the_range():
    with pytest.raises(ValueError, match=r"rack 0\.1 m, travel 0 m; reachable: rack at travel 0 m from .* to 0\.083 m"):
        STRUT.solve(0.1, 0.0)
    with pytest.raises(ValueError, match=r"travel 0\.5 m; reachable: travel at rack 0 from"):
        STRUT.solve(np.array([0.0, 0.01]), np.array([0.0, 0.5]))
    STRUT.solve(0.083, 0.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e300])
def test_rack_and_travel_are_finite(value):
    with pytest.raises(ValueError, match="rack is"):
        STRUT.solve(value, 0.0)
    with pytest.raises(ValueError, match="travel is"):
        STRUT.solve(0.0, value)


def test_unknown_set_and_track():
    with pytest.raises(ValueError, match=r"no strut named 's9'; packaged: s1"):
        MacPherson.load("s9")
    with pytest.raises(ValueError, match="track is"):
        STRUT.at_track(np.nan)
