"""First-order filters, discretised by the rule of Tustin: y = b0 u + x; x <- b1 u - a1 y (E10).

lead or lag:  (1 + s/z)/(1 + s/p)         derivative:  s/(1 + s/p)          z, p: corners [rad/s]
"""

import math
from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel


class FirstOrder(NamedTuple):
    """Coefficients of a filter with one state, y = b0 u + x; x <- b1 u - a1 y [1], b0 and b1 of a derivative [1/s]."""

    b0: float  # weight of the input in the output of the filter
    b1: float  # weight of the input in the next state of the filter
    a1: float  # weight of the output in the next state of the filter, with a minus sign


def lead(zero: float, pole: float, dt: float) -> FirstOrder:
    """Lead or lag with corners [Hz] at samples of ``dt`` [s]; its gain at 0 Hz is 1."""
    z, p = (1.0 / (math.pi * corner * dt) for corner in (zero, pole))
    return FirstOrder((1.0 + z) / (1.0 + p), (1.0 - z) / (1.0 + p), (1.0 - p) / (1.0 + p))  # (E10)


def derivative(bandwidth: float, dt: float) -> FirstOrder:
    """Derivative [1/s] up to a corner [Hz] at samples of ``dt`` [s]."""
    p = 1.0 / (math.pi * bandwidth * dt)
    gain = 2.0 / dt / (1.0 + p)
    return FirstOrder(gain, -gain, (1.0 - p) / (1.0 + p))  # (E10)


def pole(f: FirstOrder, dt: float) -> float:
    """Upper corner of a filter [Hz], to twelve digits."""
    p = (1.0 - f.a1) / (1.0 + f.a1)
    return float(f"{1.0 / (math.pi * p * dt):.12g}")


def zero(f: FirstOrder, dt: float) -> float:
    """Lower corner of a lead [Hz], to twelve digits."""
    z = (f.b0 - f.b1) / (f.b0 + f.b1)
    return float(f"{1.0 / (math.pi * z * dt):.12g}")


@kernel
def filtered(f, x, i, u):
    """Output of a filter, whose state is ``x[i]``, for one sample of its input."""
    y = f.b0 * u + x[i]  # (E10)
    x[i] = f.b1 * u - f.a1 * y  # (E10)
    return y
