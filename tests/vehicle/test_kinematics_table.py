"""The table of a strut against the exact solution, its mirror symmetry and its edges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steer_env.vehicle.suspension import kinematics_table
from steer_env.vehicle.suspension.macpherson import MacPherson, WheelLoad, load_coefficients, rack_force

STRUT = MacPherson.load("s1").at_track(1.390)
MAP = kinematics_table.tabulate_strut(STRUT)
RACK = st.floats(-0.075, 0.075)
TRAVEL = st.floats(-0.080, 0.080)


def exact(rack, travel):
    pose = STRUT.solve(rack, travel)
    work = load_coefficients(pose)
    forces = (work.F_x_contact, work.F_x_centre, work.F_y, work.F_z)
    return np.stack([pose.steer_angle, pose.inclination, *forces, work.M_x, work.M_z], -1)


@pytest.mark.parametrize(
    ("rack_range", "travel_range", "angle_error", "work_error"),
    [((-0.075, 0.075), (-0.08, 0.08), 1e-6, 1e-5), ((-0.03, 0.03), (-0.04, 0.04), 1e-8, 1e-7)],
)
def test_table_equals_solution(rack_range, travel_range, angle_error, work_error):
    rng = np.random.default_rng(1)
    rack, travel = rng.uniform(*rack_range, 4000), rng.uniform(*travel_range, 4000)
    # A quarter of the points in the corner where the linkage is closest to its end.
    rack[:1000], travel[:1000] = (
        rack_range[1] - rng.uniform(0, 2e-3, 1000),
        travel_range[0] + rng.uniform(0, 8e-3, 1000),
    )
    truth = exact(rack, travel)
    table = np.array([kinematics_table.left_knuckle(MAP, *point) for point in zip(rack, travel)])
    error = np.abs(table - truth).max(axis=0)
    assert (error[:2] < angle_error).all()
    assert (error[2:] < work_error * np.abs(truth[:, 2:]).max(axis=0)).all()


def test_straight_ahead_is_exact():
    np.testing.assert_allclose(kinematics_table.left_knuckle(MAP, 0.0, 0.0), exact(0.0, 0.0), rtol=1e-10, atol=1e-13)


def test_error_falls_with_the_fourth_order():
    rack = np.linspace(-0.0497, 0.0497, 200)
    truth = exact(rack, 0.0)[:, 0]
    maps = [kinematics_table.tabulate_strut(STRUT, rack_cells=cells) for cells in (20, 40)]
    coarse, fine = (
        np.abs([kinematics_table.left_knuckle(m, q, 0.0).steer_angle for q in rack] - truth).max() for m in maps
    )
    assert np.log2(coarse / fine) == pytest.approx(4.0, abs=0.7)


@given(RACK, TRAVEL)
def test_right_is_the_mirror_of_left_to_the_last_bit(rack, travel):
    left, right = kinematics_table.left_knuckle(MAP, rack, travel), kinematics_table.right_knuckle(MAP, -rack, travel)
    assert tuple(right) == tuple(s * v for s, v in zip((-1, -1, -1, -1, 1, -1, 1, 1), left))


@given(RACK, TRAVEL, TRAVEL)
def test_rack_force_equals_suspension(rack, travel_left, travel_right):
    F_x_contact, F_x_centre, F_y, F_z, M_x, M_z, weight = 900.0, -700.0, 2500.0, 3700.0, 80.0, -60.0, 400.0
    full = WheelLoad(F_x_contact, F_x_centre, F_y, F_z, M_x, 0.0, M_z, -weight)
    knuckles = (
        kinematics_table.left_knuckle(MAP, rack, travel_left),
        kinematics_table.right_knuckle(MAP, rack, travel_right),
    )
    for k, pose in zip(knuckles, STRUT.solve_pair(rack, travel_left, travel_right)):
        moment = M_x + kinematics_table.overturning(k, STRUT.loaded_radius, weight)
        force = kinematics_table.rack_force(k, F_x_contact, F_x_centre, F_y, F_z - weight, moment, M_z)
        # 1e-5 of what these loads exert together, some 10 kN
        assert force == pytest.approx(float(rack_force(pose, full)), abs=0.1)


@pytest.mark.parametrize(("rack", "travel"), [(1.0, 0.02), (-1.0, 0.02), (0.01, 9.0), (0.01, -9.0), (np.inf, -np.inf)])
def test_beyond_the_range_the_edge_holds(rack, travel):
    edge = kinematics_table.left_knuckle(MAP, min(max(rack, -0.075), 0.075), min(max(travel, -0.08), 0.08))
    np.testing.assert_allclose(kinematics_table.left_knuckle(MAP, rack, travel), edge, rtol=1e-12)


def test_continuous_over_the_cells_and_the_edge():
    for rack in (0.0, 0.001, 0.0743, 0.075):
        before, after = (
            kinematics_table.left_knuckle(MAP, rack - 1e-12, 0.0),
            kinematics_table.left_knuckle(MAP, rack + 1e-12, 0.0),
        )
        np.testing.assert_allclose(before, after, rtol=0, atol=1e-8)


@pytest.mark.parametrize("point", [(np.nan, 0.0), (0.0, np.nan)])
def test_not_a_number_stays_one(point):
    assert np.isnan(kinematics_table.left_knuckle(MAP, *point)).all()


def test_compiled_equals_plain_python(monkeypatch):
    rng = np.random.default_rng(2)
    points = list(zip(rng.uniform(-0.09, 0.09, 300), rng.uniform(-0.09, 0.09, 300)))
    compiled = [
        tuple(wheel(MAP, *point))
        for point in points
        for wheel in (kinematics_table.left_knuckle, kinematics_table.right_knuckle)
    ]
    for name in ("_cell", "_weights", "_row", "_patch", "_splines_and_weights", "left_knuckle", "right_knuckle"):
        function = getattr(kinematics_table, name)
        monkeypatch.setattr(kinematics_table, name, getattr(function, "py_func", function))
    plain = [
        tuple(wheel(MAP, *point))
        for point in points
        for wheel in (kinematics_table.left_knuckle, kinematics_table.right_knuckle)
    ]
    assert compiled == plain


@pytest.mark.parametrize("name", ["rack", "travel", "rack_cells", "travel_cells"])
@pytest.mark.parametrize("value", [0, -1, float("nan")])
def test_sizes_are_checked(name, value):
    with pytest.raises(ValueError, match=f"{name} is"):
        kinematics_table.tabulate_strut(STRUT, **{name: value})


def test_a_range_out_of_reach_is_refused():
    with pytest.raises(ValueError, match="reachable"):
        kinematics_table.tabulate_strut(STRUT, rack=0.1)


@given(RACK, TRAVEL)
def test_linear_kinematics(rack, travel):
    m = kinematics_table.linear(6.0, inclination=0.4, path=-0.05)
    assert m.table.flags.c_contiguous
    expected = (6.0 * rack, 0.4 * travel, 0.0, 0.0, 0.0, 0.0, 0.0, 6.0)
    np.testing.assert_allclose(kinematics_table.left_knuckle(m, rack, travel), expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        kinematics_table.left_travel(m, rack, travel), (0.0, -0.05, 0.4, 0.0, travel, 1.0), atol=1e-15
    )
    assert kinematics_table.right_knuckle(m, rack, travel).steer_angle == pytest.approx(6.0 * rack)  # both wheels alike


def test_travel_equals_differences_of_the_solution():
    """Motion by travel at fixed rack: wheel centre, contact point fixed to the knuckle, rotation, strut length."""
    m, h = kinematics_table.tabulate_strut(STRUT), 1e-5
    for rack, travel in ((0.0, 0.0), (0.03, 0.02), (-0.05, -0.03)):
        low, pose, high = (STRUT.solve(rack, travel + d) for d in (-h, 0.0, h))
        centre = (high.wheel_centre - low.wheel_centre) / (2.0 * h)
        turn = ((high.rotation - low.rotation) / (2.0 * h)) @ pose.rotation.T  # the cross-product matrix of the turning
        contact = centre + turn @ (pose.contact - pose.wheel_centre)
        length = (high.strut_length - low.strut_length) / (2.0 * h)
        compression = STRUT.solve(0.0, 0.0).strut_length - pose.strut_length
        expected = (centre[0], contact[1], turn[2, 1], turn[0, 2], compression, -length)
        np.testing.assert_allclose(kinematics_table.left_travel(m, rack, travel), expected, rtol=1e-5, atol=2e-6)


@pytest.mark.parametrize("name", ["rack", "travel"])
def test_linear_checks_its_range(name):
    with pytest.raises(ValueError, match=f"^{name} is -1.0; allowed: positive"):
        kinematics_table.linear(6.0, **{name: -1.0})
