"""Kernels of interpolation against scipy's."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from steer_env.friction.numerics.interpolation import spline


@pytest.mark.parametrize("knots", [4, 5, 40])
def test_spline_is_scipys(knots):
    """With uneven knots, also beyond the ends; to the rounding of either elimination."""
    random = np.random.default_rng(knots)
    x, y = np.cumsum(random.uniform(0.5, 1.5, knots)), random.standard_normal(knots)
    at, found = np.linspace(x[0] - 0.1, x[-1] + 0.1, 200), np.empty(200)
    spline(x, y, at, np.empty(knots), np.empty(knots), found)
    np.testing.assert_allclose(found, CubicSpline(x, y)(at), rtol=0, atol=1e-13)
