"""How an oscillation dies out: a damped cosine about a constant, by least squares; extremes in noise.

    y = c + exp(-s t) (a cos w t + b sin w t),   damping ratio s / sqrt(s^2 + w^2)

The rate s and the frequency w are searched for; c, a and b follow linearly (variable projection). Unlike the
logarithmic decrement, the fit takes every sample, so it needs no peak that stands out of the noise.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from steer_env.metrics.common.definitions import RefusedError

Array = NDArray[np.float64]

EXPLAINED = 0.8  # of the variance that the oscillation must carry; assumed
SLOWEST, FASTEST = 0.2, 4.0  # frequencies that are searched [Hz]; assumed
HEAVIEST = 30.0  # rate of decay that is searched [1/s]; assumed
SAMPLES = 100  # that a fit takes at most: the signal is low-passed
# Rates of decay and frequencies [1/s, rad/s] out of which the search begins with the best.
GRID = np.array([(s, 2 * np.pi * f) for s in (0.3, 1.0, 3.0, 9.0) for f in np.geomspace(SLOWEST, FASTEST, 12)])
HALF_WIDTH = 0.08  # of the parabola through an extreme [s]; assumed


class Decay(NamedTuple):
    """A damped cosine."""

    damping_ratio: float  # [1]
    natural_frequency: float  # undamped [Hz]


def _basis(t: Array, rate: Any, omega: Any) -> Array:
    """Of what is linear (..., T, 3), at rates and frequencies (...), orthonormal."""
    wave = np.exp(np.asarray(1j * omega - rate)[..., None] * t)
    return np.linalg.qr(np.stack([np.ones_like(wave.real), wave.real, wave.imag], axis=-1))[0]


def _rest(x: Array, t: Array, y: Array) -> Array:
    """What the best cosine of a rate and a frequency leaves."""
    basis = _basis(t, *x)
    return y - basis @ (y @ basis)


def fit(time: Array, y: Array, name: str) -> Decay:
    """The damped cosine in samples (T,) of a channel ``name`` at ``time`` (T,) [s].

    Raises RefusedError where the cosine leaves more than a fifth of the variance, or does not die out.
    """
    thin = max(1, time.size // SAMPLES)
    t, y = time[::thin] - time[0], y[::thin]
    start = GRID[np.argmax(np.sum((y @ _basis(t, *GRID.T)) ** 2, axis=-1))]
    found = optimize.least_squares(_rest, start, method="lm", args=(t, y), x_scale=(1.0, 5.0))
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
    """Time [s] and value of the lowest point, at the vertex of a parabola through the samples around it.

    A single lowest sample would be low by the noise. Where it is known to be ``at`` [s], the parabola is read there.
    """
    k = int(np.argmin(y if at is None else np.abs(time - at)))
    near = np.abs(time - time[k]) <= half_width
    if near.sum() < 5:
        raise RefusedError(f"{near.sum()} samples around an extreme are too few: record at 25 Hz or faster")
    powers = ((time[near] - time[k]) / half_width) ** np.arange(3)[:, None]
    c0, c1, c2 = np.linalg.solve(powers @ powers.T, powers @ y[near]) / half_width ** np.arange(3)
    if at is not None:
        return at, float(c0 + (at - time[k]) * (c1 + (at - time[k]) * c2))
    if c2 <= 0:  # at the end of the samples, or flat
        return float(time[k]), float(y[k])
    place = float(np.clip(-c1 / (2 * c2), -half_width, half_width))
    return float(time[k]) + place, float(c0 + place * (c1 + place * c2))


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
