"""Efficiency of a gear between motor and column, which says how its friction grows with the load.

Source of (F45): textbooks of machine elements, for example Shigley, Mechanical Engineering Design, worm gearing.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction.numerics.check import construct, not_negative, number, numbers

LEAST_EFFICIENCY = 0.01  # below, a gear is taken to lock itself; assumed [1]


class Efficiency(NamedTuple):
    """Of a gear between motor and column, each output over input in settled motion [1]."""

    driving: float  # the motor drives
    driven: float  # the column drives the motor back


def worm(lead_angle: float, friction_coefficient: float, pressure_angle: float = math.radians(20.0)) -> Efficiency:
    """Efficiencies of a worm gear from its geometry (F45), without its preload.

        eta_d = (cos a - mu tan g)/(cos a + mu cot g),    eta_b = (cos a - mu cot g)/(cos a + mu tan g)    (F45)

    Parameters
    ----------
    lead_angle, pressure_angle : float
        g of the worm and a in the normal section [rad].
    friction_coefficient : float
        mu of the flanks [1].

    Raises
    ------
    ValueError
        A lead angle outside 0.01 to 1.5 or a pressure angle outside 0 to 1, a coefficient below 0, or a gear that
        locks itself, with the coefficient at which an efficiency falls below ``LEAST_EFFICIENCY``.
    """
    g = number("lead_angle [rad]", lead_angle, minimum=0.01, maximum=1.5)
    a = number("pressure_angle [rad]", pressure_angle, minimum=0.0, maximum=1.0)
    mu = not_negative("friction_coefficient", friction_coefficient)
    n, tangent = math.cos(a), math.tan(g)
    flat, steep = min(tangent, 1.0 / tangent), max(tangent, 1.0 / tangent)  # driven back, of a steep lead driving
    locks = n * (1.0 - LEAST_EFFICIENCY) / (steep + LEAST_EFFICIENCY * flat)  # (F45)
    if mu >= locks:
        raise ValueError(
            f"the gear locks itself: friction_coefficient must be less than {locks:.4g} at a lead angle of {g:g} rad, "
            f"got {mu:g}"
        )
    return Efficiency((n - mu * tangent) / (n + mu / tangent), (n - mu / tangent) / (n + mu * tangent))  # (F45)


def efficiency(given: Any) -> Efficiency:
    """From one number for both directions, from two, or from a mapping of the arguments of :func:`worm`.

    Raises
    ------
    ValueError
        Another form, a value below ``LEAST_EFFICIENCY`` or above 1, or as of :func:`worm`.
    """
    if isinstance(given, Mapping):
        return construct("the worm gear", worm, given)
    if isinstance(given, bool | str):
        raise ValueError(f"efficiency must be a number, two or a mapping, got {given!r}")
    if not isinstance(given, Sequence | np.ndarray):
        both = number("efficiency", given, minimum=LEAST_EFFICIENCY, maximum=1.0)
        return Efficiency(both, both)
    values = numbers("efficiency", given)
    if values.size not in (1, 2) or not np.all((values >= LEAST_EFFICIENCY) & (values <= 1.0)):
        raise ValueError(
            "efficiency must be one number for both directions or two, driving and driven back, each at least "
            f"{LEAST_EFFICIENCY} (a gear that cannot be driven back locks itself) and at most 1, got {given!r}"
        )
    return Efficiency(float(values[0]), float(values[-1]))
