"""Decay of an oscillation: a damped cosine about a constant, fitted by least squares; also extremes in noise.

    y = c + exp(-s t) (a cos w t + b sin w t),   damping ratio s / sqrt(s^2 + w^2)

The search is over the rate s and the frequency w; c, a and b follow linearly (variable projection). In contrast to the
logarithmic decrement, the fit uses every sample and needs no peak that stands out of the noise.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from steer_env.metrics.common.definitions import RefusedError

Array = NDArray[np.float64]

EXPLAINED = 0.8  # fraction of the variance that the oscillation must explain; assumed [1]
SLOWEST, FASTEST = 0.2, 4.0  # range of frequencies of the search; assumed [Hz]
HEAVIEST = 30.0  # highest rate of decay; assumed [1/s]
SAMPLES = 100  # largest number of samples in a fit; the signal is low-passed, so more would add nothing
# Rates of decay and frequencies [1/s, rad/s]; the search starts at the best pair.
GRID = np.array([(s, 2 * np.pi * f) for s in (0.3, 1.0, 3.0, 9.0) for f in np.geomspace(SLOWEST, FASTEST, 12)])
HALF_WIDTH = 0.08  # half width of the parabola through an extreme; assumed [s]


class Decay(NamedTuple):
    """A damped cosine."""

    damping_ratio: float  # [1]
    natural_frequency: float  # undamped [Hz]


def _basis(t: Array, rate: Any, omega: Any) -> Array:
    """Orthonormal basis (..., T, 3) of the linear part of the model, for rates and frequencies of shape (...)."""
    wave = np.exp(np.asarray(1j * omega - rate)[..., None] * t)
    return np.linalg.qr(np.stack([np.ones_like(wave.real), wave.real, wave.imag], axis=-1))[0]


def _residual(x: Array, t: Array, y: Array) -> Array:
    """Residual (T,) of the best damped cosine with the rate and frequency ``x``."""
    basis = _basis(t, *x)
    return y - basis @ (y @ basis)


def fit(time: Array, y: Array, name: str) -> Decay:
    """The damped cosine in samples (T,) of the channel ``name`` at ``time`` (T,) [s].

    Raises RefusedError where the cosine leaves more than a fifth of the variance unexplained, or does not decay.
    """
    thin = max(1, time.size // SAMPLES)
    t, y = time[::thin] - time[0], y[::thin]
    start = GRID[np.argmax(np.sum((y @ _basis(t, *GRID.T)) ** 2, axis=-1))]
    found = optimize.least_squares(_residual, start, method="lm", args=(t, y), x_scale=(1.0, 5.0))
    explained = 1 - 2 * found.cost / np.sum((y - y.mean()) ** 2)
    if not (explained >= EXPLAINED and found.x[0] < HEAVIEST and SLOWEST < abs(found.x[1]) / np.pi < 4 * FASTEST):
        raise RefusedError(
            f"a decaying oscillation explains {max(explained, 0.0):.0%} of the {name}, less than {EXPLAINED:.0%}: "
            "it is buried in noise or does not oscillate; excite the car more, or use a better sensor"
        )
    rate, omega = found.x[0], abs(found.x[1])
    if rate <= 0:
        raise RefusedError(f"the oscillation of {name} does not die out: there is no damping to report")
    natural = float(np.hypot(rate, omega))
    return Decay(float(rate) / natural, natural / (2 * np.pi))


def lowest(time: Array, y: Array, half_width: float = HALF_WIDTH, at: float | None = None) -> tuple[float, float]:
    """Time [s] and value of the lowest point: the vertex of a parabola through the samples around the lowest sample.

    The lowest sample itself would be too low because of noise. If the time of the lowest point is known, it is given as
    ``at`` [s], and the parabola is evaluated there.
    """
    k = int(np.argmin(y if at is None else np.abs(time - at)))
    near = np.abs(time - time[k]) <= half_width
    if near.sum() < 5:
        raise RefusedError(f"{near.sum()} samples around an extreme are too few: record at 25 Hz or faster")
    powers = ((time[near] - time[k]) / half_width) ** np.arange(3)[:, None]
    c0, c1, c2 = np.linalg.solve(powers @ powers.T, powers @ y[near]) / half_width ** np.arange(3)
    if at is not None:
        return at, float(c0 + (at - time[k]) * (c1 + (at - time[k]) * c2))
    if c2 <= 0:  # the samples end at the lowest point, or are flat
        return float(time[k]), float(y[k])
    place = float(np.clip(-c1 / (2 * c2), -half_width, half_width))
    return float(time[k]) + place, float(c0 + place * (c1 + place * c2))


def last_outside(time: Array, y: Array, band: float) -> float:
    """Time at which ``|y|`` last enters ``band`` [s], interpolated; the first instant if it is never outside."""
    outside = np.flatnonzero(np.abs(y) > band)
    if outside.size == 0:
        return float(time[0])
    k = int(outside[-1])
    if k + 1 == time.size:
        raise RefusedError("it does not settle before the recording or the free section ends: leave it free for longer")
    a, b = abs(y[k]) - band, abs(y[k + 1]) - band
    return float(time[k] + (time[k + 1] - time[k]) * a / (a - b))


def first_below(time: Array, y: Array, level: float, name: str) -> float:
    """Time at which y first falls through ``level`` [s], interpolated; RefusedError where it does not."""
    below = np.flatnonzero(y < level)
    if below.size == 0 or below[0] == 0:
        raise RefusedError(
            f"{name} does not fall through the level of {level:.3g}: turn further, or leave it free longer"
        )
    k = int(below[0])
    return float(time[k - 1] + (time[k] - time[k - 1]) * (y[k - 1] - level) / (y[k - 1] - y[k]))
