"""Roads: spectra of the random road against ISO 8608, geometry of the bump, smoothness, repetition and symmetry."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal
from scipy.integrate import quad
from scipy.special import k1

from steer_env.friction.numerics.kernel import COMPILED
from steer_env.vehicle import road
from steer_env.vehicle.road import LEFT_TRACK, RIGHT_TRACK

WAVY = road.make_road(heights=np.cumsum(np.sin(np.outer([3.0, 4.0], 2.0 * np.pi * np.arange(60) / 60)), axis=1) * 1e-3)


def heights(r, side, distances):
    """Heights and slopes (2, N) at distances (N,)."""
    return np.array([road.height(r, side, s) for s in distances]).T


def test_flat_road_is_level_and_dry():
    r = road.flat()
    assert r.level
    for side in (LEFT_TRACK, RIGHT_TRACK):
        for s in (-1e4, 0.0, 3.3, 1e9):
            assert road.height(r, side, s) == (0.0, 0.0)
            assert road.friction(r, side, s) == 1.0


# Interpolation


def test_heights_equal_the_grid_and_slopes_half_the_difference_of_the_neighbours():
    z, slope = heights(WAVY, LEFT_TRACK, np.arange(60) * WAVY.spacing + 1e-12)
    np.testing.assert_allclose(z, WAVY.heights[0], atol=1e-13)
    around = np.roll(WAVY.heights[0], -1) - np.roll(WAVY.heights[0], 1)
    np.testing.assert_allclose(slope, 0.5 * around / WAVY.spacing, atol=1e-9)


@pytest.mark.parametrize("side", [LEFT_TRACK, RIGHT_TRACK])
def test_heights_and_slopes_are_continuous_and_belong_together(side):
    grid = np.arange(-60, 120) * WAVY.spacing
    before, after = heights(WAVY, side, grid - 1e-9), heights(WAVY, side, grid + 1e-9)
    np.testing.assert_allclose(before, after, atol=1e-7)
    s = np.random.default_rng(2).uniform(-5.0, 5.0, 300)
    central = (heights(WAVY, side, s + 1e-6)[0] - heights(WAVY, side, s - 1e-6)[0]) / 2e-6
    np.testing.assert_allclose(heights(WAVY, side, s)[1], central, atol=1e-6)


def test_a_quadratic_is_reproduced():
    """The slopes of Catmull-Rom splines are exact for a parabola."""
    x = np.arange(200) * 0.05
    r = road.make_road(heights=np.tile((x * (x[-1] - x)) / 100.0, (2, 1)))
    s = np.linspace(0.1, 9.7, 333)
    np.testing.assert_allclose(heights(r, LEFT_TRACK, s)[0], s * (x[-1] - s) / 100.0, atol=1e-14)


@given(s=st.floats(-50.0, 50.0), turns=st.integers(-3, 3), side=st.sampled_from([LEFT_TRACK, RIGHT_TRACK]))
def test_road_repeats(s, turns, side):
    again = road.height(WAVY, side, s + turns * 60 * WAVY.spacing)
    assert again == pytest.approx(road.height(WAVY, side, s), abs=1e-11)


@given(s=st.floats(-1e3, 1e3))
def test_swapping_the_sides_swaps_heights_and_friction(s):
    r = WAVY._replace(friction=np.array([[0.3, 0.4, 0.9], [1.0, 0.8, 0.7]]))
    mirrored = r._replace(heights=r.heights[::-1].copy(), friction=r.friction[::-1].copy())
    for side in (LEFT_TRACK, RIGHT_TRACK):
        assert road.height(r, side, s) == road.height(mirrored, 1 - side, s)
        assert road.friction(r, side, s) == road.friction(mirrored, 1 - side, s)


def test_friction_of_a_side_and_over_distance():
    split = road.make_road(friction=(0.2, 0.9))
    assert [road.friction(split, side, 12.3) for side in (LEFT_TRACK, RIGHT_TRACK)] == [0.2, 0.9]
    patches = road.make_road(friction=[[1.0, 1.0, 0.2, 0.2], [1.0, 1.0, 1.0, 1.0]], spacing=2.0)
    assert [road.friction(patches, LEFT_TRACK, s) for s in (0.0, 3.0, 4.5, 7.0, 8.0, -1.0)] == pytest.approx(
        [1.0, 0.6, 0.2, 0.6, 1.0, 0.6]
    )
    assert road.friction(patches, RIGHT_TRACK, 5.0) == 1.0


# Bump


@pytest.mark.parametrize(("side", "rises"), [("both", (1, 1)), ("left", (1, 0)), ("right", (0, 1))])
@pytest.mark.parametrize(("height", "length"), [(0.08, 0.5), (-0.05, 4.0)])
def test_bump_is_a_squared_cosine(side, rises, height, length):
    at = 20.0
    r = road.bump(height, length, at, side=side, period=100.0)
    s = np.linspace(at - length, at + length, 1001)
    inside = np.abs(s - at) < 0.5 * length
    expected = np.where(inside, height * np.cos(np.pi * (s - at) / length) ** 2, 0.0)
    slope = np.where(inside, -height * np.pi / length * np.sin(2.0 * np.pi * (s - at) / length), 0.0)
    for track, rise in zip((LEFT_TRACK, RIGHT_TRACK), rises):
        z, dz = heights(r, track, s)
        np.testing.assert_allclose(z, rise * expected, atol=2e-3 * abs(height))
        np.testing.assert_allclose(dz, rise * slope, atol=0.05 * abs(height) * np.pi / length)
        assert road.height(r, track, 0.0) == (0.0, 0.0)
        assert road.height(r, track, at + 100.0)[0] == pytest.approx(rise * height, rel=1e-3)


# Random road


@pytest.mark.parametrize("road_class", ["A", "C", "E"])
def test_random_road_has_the_spectrum_of_its_class(road_class):
    r = road.iso8608(3, road_class, length=20000.0)
    n, G = signal.welch(r.heights, 1.0 / r.spacing, window="hann", nperseg=8192)
    expected = road.ROUGHNESS[road_class] * (0.1 / np.maximum(n, 1e-9)) ** 2
    for low, high in ((0.02, 0.1), (0.1, 1.0), (1.0, 9.0)):
        band = (n > low) & (n < high)
        ratio = np.mean(G[:, band] / expected[band], axis=1)
        # 97 averages of 50 % overlap scatter by some 8 % a line, and the lowest band has only 33 lines
        np.testing.assert_allclose(ratio, 1.0, atol=0.06)


def test_classes_are_a_factor_of_four_apart():
    assert road.ROUGHNESS["H"] == pytest.approx(4.0**7 * road.ROUGHNESS["A"])
    a, b = (road.iso8608(1, name, length=500.0).heights for name in "AB")
    np.testing.assert_allclose(b, 2.0 * a, atol=1e-15)


def test_tracks_cohere_as_on_an_isotropic_surface():
    r = road.iso8608(5, length=40000.0, track=1.4)
    n, C = signal.coherence(*r.heights, 1.0 / r.spacing, nperseg=2048)
    x = 2.0 * np.pi * 1.4 * n[1:]
    expected = (x * k1(x)) ** 2
    band = (n[1:] > 0.02) & (n[1:] < 2.0)
    # A coherence of 0 comes out at one over the number of averages, some 400.
    np.testing.assert_allclose(C[1:][band], expected[band], atol=0.1)
    assert np.mean(np.abs(C[1:][band] - expected[band])) < 0.01


def test_coherency_is_the_ratio_of_basset_integrals():
    for x in (0.3, 1.0, 4.0):
        cross, _ = quad(lambda t: (1.0 + t * t) ** -1.5, 0.0, np.inf, weight="cos", wvar=x)
        assert cross == pytest.approx(x * k1(x), rel=1e-6)  # the integral without the weight is 1


@pytest.mark.parametrize("track", [0.0, 1e-9])
def test_tracks_without_distance_are_equal(track):
    np.testing.assert_allclose(*road.iso8608(5, length=500.0, track=track).heights, atol=1e-8)


def test_random_road_starts_level_and_repeats_smoothly():
    r = road.iso8608(7, "H", length=300.0)
    s = np.linspace(-4.9, 4.9, 197)
    for side in (LEFT_TRACK, RIGHT_TRACK):
        np.testing.assert_array_equal(heights(r, side, s), 0.0)
        np.testing.assert_array_equal(heights(r, side, s + 300.0), 0.0)
    assert np.max(np.abs(r.heights)) > 0.1


def test_same_seed_same_road():
    first, second, other = (
        road.iso8608(seed, "B", length=300.0).heights for seed in (11, np.random.default_rng(11), 12)
    )
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, other)


# Construction


@pytest.mark.parametrize(
    ("build", "arguments", "key", "allowed"),
    [
        (road.make_road, {"heights": np.zeros((3, 4))}, "heights", r"shape \(2,\) or \(2, N\)"),
        (road.make_road, {"heights": [[0.0, math.nan], [0.0, 0.0]]}, "heights", "finite"),
        (road.make_road, {"heights": [[0.0, 1.0], [0.0]]}, "heights", "numbers"),
        (road.make_road, {"heights": np.tile(np.linspace(0.0, 1.0, 50), (2, 1))}, "heights", "where they start"),
        (road.make_road, {"grade": 1.0}, "grade", "at most 0.5"),
        (road.bump, {"height": 0.1, "length": 4.0, "at": 1.0}, "at", "at least 2"),
        (road.bump, {"height": 0.1, "length": 4.0, "at": 50.0, "period": 51.0}, "period", "at least 52"),
        (road.bump, {"height": 0.1, "length": 1.0, "at": 5.0, "side": "middle"}, "side", "'both', 'left' or 'right'"),
        (road.iso8608, {"seed": 1, "road_class": "I"}, "road_class", "one of A, B"),
        (road.iso8608, {"seed": 1, "length": 100.0}, "length", "at least 200"),
    ],
)
def test_bad_values_are_named(build, arguments, key, allowed):
    with pytest.raises(ValueError, match=rf"(?s)^{key} must.*{allowed}.*got"):
        build(**arguments)


def test_arrays_are_read_only_copies():
    given_heights = np.zeros((2, 5))
    r = road.make_road(heights=given_heights)
    given_heights[0, 0] = 1.0
    assert not r.heights.any()
    assert not r.heights.flags.writeable
    assert not r.friction.flags.writeable


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_plain_python_equals_compiled():
    for s in np.random.default_rng(4).uniform(-10.0, 10.0, 50):
        assert road.height(WAVY, RIGHT_TRACK, s) == road.height.py_func(WAVY, RIGHT_TRACK, s)
