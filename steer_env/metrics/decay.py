"""How an oscillation dies out: a damped cosine about a constant, by least squares; extremes in noise.

    y = c + exp(-s t) (a cos w t + b sin w t),   damping ratio s / sqrt(s^2 + w^2)

The rate s and the frequency w are searched for; c, a and b follow linearly (variable projection). Unlike the
logarithmic decrement, the fit takes every sample, so it needs no peak that stands out of the noise.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from steer_env.metrics.definitions import RefusedError

Array = NDArray[np.float64]

EXPLAINED = 0.8  # of the variance that the oscillation must carry; assumed
SLOWEST, FASTEST = 0.2, 4.0  # frequencies that are searched [Hz]; assumed
HEAVIEST = 30.0  # rate of decay that is searched [1/s]; assumed
SAMPLES = 200  # that a fit takes at most: the signal is low-passed
HALF_WIDTH = 0.1  # of the parabola through an extreme [s]; assumed


class Decay(NamedTuple):
    """A damped cosine."""

    damping_ratio: float  # [1]
    natural_frequency: float  # undamped [Hz]


def _basis(t: Array, rate: float, omega: float) -> Array:
    envelope = np.exp(-rate * t)
    return np.column_stack([np.ones_like(t), envelope * np.cos(omega * t), envelope * np.sin(omega * t)])


def _rest(x: Array, t: Array, y: Array) -> Array:
    """What the best cosine of a rate and a frequency leaves."""
    basis = _basis(t, *x)
    return y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]


def fit(time: Array, y: Array, name: str) -> Decay:
    """The damped cosine in samples (T,) of a channel ``name`` at ``time`` (T,) [s].

    Raises RefusedError where the cosine leaves more than a fifth of the variance, or does not die out.
    """
    thin = max(1, time.size // SAMPLES)
    t, y = time[::thin] - time[0], y[::thin]
    grid = [(s, 2 * np.pi * f) for s in (0.2, 0.6, 1.5, 3.0, 6.0) for f in np.geomspace(SLOWEST, FASTEST, 15)]
    start = min(grid, key=lambda x: float(np.sum(_rest(np.array(x), t, y) ** 2)))
    bounds = ([-5.0, 2 * np.pi * 0.5 * SLOWEST], [HEAVIEST, 2 * np.pi * 2 * FASTEST])
    found = optimize.least_squares(_rest, start, bounds=bounds, args=(t, y), x_scale=(1.0, 5.0))
    explained = 1 - 2 * found.cost / np.sum((y - y.mean()) ** 2)
    if not explained >= EXPLAINED:
        raise RefusedError(
            f"a decaying oscillation explains {max(explained, 0.0):.0%} of the {name}, less than {EXPLAINED:.0%}: "
            "it is buried in noise or does not oscillate; excite the car more, or use a better sensor"
        )
    rate, omega = found.x
    if rate <= 0:
        raise RefusedError(f"the oscillation of {name} does not die out: there is no damping to report")
    natural = float(np.hypot(rate, omega))
    return Decay(float(rate) / natural, natural / (2 * np.pi))


def lowest(time: Array, y: Array, half_width: float = HALF_WIDTH) -> tuple[float, float]:
    """Time [s] and value of the lowest point, at the vertex of a parabola through the samples around it.

    A single lowest sample would be low by the noise.
    """
    k = int(np.argmin(y))
    near = np.abs(time - time[k]) <= half_width
    if near.sum() < 5:
        raise RefusedError(f"{near.sum()} samples around an extreme are too few: record at 25 Hz or faster")
    c0, c1, c2 = np.polynomial.polynomial.polyfit(time[near] - time[k], y[near], 2)
    if c2 <= 0:  # at the end of the samples, or flat
        return float(time[k]), float(y[k])
    at = float(np.clip(-c1 / (2 * c2), -half_width, half_width))
    return float(time[k]) + at, float(c0 + at * (c1 + at * c2))


def last_outside(time: Array, y: Array, band: float) -> float:
    """When ``|y|`` last comes inside ``band`` [s], interpolated; the first instant if it is never outside."""
    outside = np.flatnonzero(np.abs(y) > band)
    if outside.size == 0:
        return float(time[0])
    k = int(outside[-1])
    if k + 1 == time.size:
        raise RefusedError("it does not settle before the recording or the free section ends: leave it free for longer")
    a, b = abs(y[k]) - band, abs(y[k + 1]) - band
    return float(time[k] + (time[k + 1] - time[k]) * a / (a - b))


def first_below(time: Array, y: Array, level: float, name: str) -> float:
    """When y first falls through ``level`` [s], interpolated; refused where it does not."""
    below = np.flatnonzero(y < level)
    if below.size == 0 or below[0] == 0:
        raise RefusedError(
            f"{name} does not fall through the level of {level:.3g}: turn further, or leave it free longer"
        )
    k = int(below[0])
    return float(time[k - 1] + (time[k] - time[k - 1]) * (y[k - 1] - level) / (y[k - 1] - y[k]))
