"""The path and the kernel that finds a car on it."""

import numpy as np
import pytest

from steer_env.courses import path

STEP = 10.0  # between the points seen ahead [m]


def where(points, x, y, yaw, guess=0.0):
    out = np.zeros(2 + 3)
    return path.locate(points, x, y, yaw, guess, STEP, out), out


def test_a_circle_closes():
    """A full turn at constant curvature comes back; Simpson's rule on 1 m arcs of 100 m radius leaves under 1e-8 m."""
    length = 2.0 * np.pi * 100.0
    points = path.from_curvature(np.full(629, 0.01))
    s = np.arange(629.0)
    assert points[:, 0] == pytest.approx(100.0 * np.sin(s / 100.0), abs=1e-7)
    assert points[:, 1] == pytest.approx(100.0 * (1.0 - np.cos(s / 100.0)), abs=1e-7)
    assert points[-1, 2] == pytest.approx(0.01 * 628.0)
    assert length == pytest.approx(628.3, abs=0.1)


@pytest.mark.parametrize("offset", [-1.5, 0.0, 1.5])
@pytest.mark.parametrize("s", [0.4, 20.7, 300.2])
def test_offset_and_heading_on_a_circle(s, offset):
    """Left of a left turn is inside. The arc is taken to second order, 2e-4 m over a metre at 100 m radius; off the
    path the projection falls on the tangent, which shifts the heading by offset/radius of a metre."""
    points = path.from_curvature(np.full(400, 0.01))
    angle = s / 100.0
    x, y = (100.0 - offset) * np.sin(angle), 100.0 - (100.0 - offset) * np.cos(angle)
    position, out = where(points, x, y, angle + 0.05)
    assert out[0] == pytest.approx(offset, abs=2e-4)
    assert out[1] == pytest.approx(0.05, abs=0.02 * abs(offset) / 1.5 + 1e-6)
    assert position == pytest.approx(s, abs=0.02 * s / 100.0 + 0.02)
    ahead = angle + STEP * np.arange(1, 4) / 100.0
    to_x, to_y = 100.0 * np.sin(ahead) - x, 100.0 * (1.0 - np.cos(ahead)) - y
    left = to_y * np.cos(angle + 0.05) - to_x * np.sin(angle + 0.05)
    # What is nearest is found to (offset/radius) of a metre: so far ahead, that turns into this much.
    assert out[2:] == pytest.approx(left, abs=2e-3 + 0.02 * abs(offset) * 0.4)


def test_outside_a_curve_there_is_one_nearest_point():
    """There a car is beyond one point's metre before it comes to the next point."""
    P, R, out = path.from_curvature(np.full(700, 0.01)), 100.0, np.zeros(4)
    for s in np.linspace(300.0, 310.0, 1001):
        for offset in (-4.0, -1.0, -0.1, 1.0):
            a, r = s / R, R - offset
            place = path.locate(P, r * np.sin(a), R - r * np.cos(a), a, s - 0.2, 2.0, out)
            assert place == pytest.approx(s, abs=0.1)
            assert out[:2] == pytest.approx((offset, 0.0), abs=1e-3)


def test_mirror_image():
    rng = np.random.default_rng(1)
    points = path.winding(rng, 300.0, 0.005)
    mirrored = path.from_curvature(-points[:, 3])
    _, out = where(points, 120.0, 3.0, 0.2)
    _, other = where(mirrored, 120.0, -3.0, -0.2)
    assert np.array_equal(out, -other)


def test_beyond_both_ends_the_path_is_straight():
    points = path.from_curvature(np.zeros(11))
    assert where(points, -5.0, 1.0, 0.0)[1] == pytest.approx([1.0, 0.0, -1.0, -1.0, -1.0])
    position, out = where(points, 25.0, -2.0, 0.1)
    assert position == pytest.approx(25.0)
    assert out[:2] == pytest.approx([-2.0, 0.1])


def test_heading_error_wraps():
    points = path.from_curvature(np.zeros(11))
    assert where(points, 5.0, 0.0, 2.0 * np.pi + 0.3)[1][1] == pytest.approx(0.3)


def test_winding_road_is_seeded_bounded_and_starts_straight():
    one, two = (path.winding(np.random.default_rng(7), 500.0, 0.004) for _ in range(2))
    assert np.array_equal(one, two)
    assert np.abs(one[:, 3]).max() <= 0.004
    assert one[0, 3] == 0.0


def test_a_path_through_points_keeps_to_them():
    """A circle of 50 m radius from points half a metre apart: their cubic spline leaves it by some 1e-7 m."""
    angle = np.arange(0.0, 2.0, 0.01)
    found = path.path_through_points(50.0 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)]))
    s = np.arange(len(found)) * path.SPACING
    assert found[:, 0] == pytest.approx(50.0 * np.sin(s / 50.0), abs=1e-5)
    assert found[:, 2] == pytest.approx(s / 50.0, abs=1e-4)
    assert found[5:-5, 3] == pytest.approx(0.02, rel=1e-3)
