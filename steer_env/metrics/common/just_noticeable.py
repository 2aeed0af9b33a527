"""Whether a driver notices a difference of a metric: just-noticeable differences of the handwheel's force and angle.

A driver notices a change of a sustained steering force, or of a sustained steering angle, from about 15 % on. These are
the thresholds of Newberry, Griffin and Dowson, "Driver perception of steering feel", Proc. IMechE Part D 221 (2007)
405, for a force and an angle that are held, noticed in 79 % of the trials. On one handwheel a share of the force is the
same share of the torque.

The share is that of the smaller of both values, so that the verdict is the same whichever of two recordings is the
base. Near zero no share is constant: a value below the floor counts as the floor, and there is no threshold for two
such values. A difference of exactly the share is noticed.

The thresholds hold for what they were found for. There is none here for dead bands, gradients, phases, lags, torque at
0 g, peaks of quick manoeuvres, or the motion of the car.
"""

import math
from typing import NamedTuple

from steer_env.metrics.common.definitions import definition

SHARE = 0.15  # of the smaller value, from which on a difference is noticed [1]
ROUNDING = 1e-9  # by which a difference may miss the threshold and still reach it, as a fraction of it [1]

# Floor: smallest value for which the share holds, by unit of the metric: 5 N at a rim of 0.19 m (radius assumed), and
# 3 deg, the smallest force and angle of the first experiment of the same paper.
LEAST_STIMULUS = {"N m": 1.0, "deg": 3.0}

TORQUE = SHARE * LEAST_STIMULUS["N m"]  # smallest change of a sustained torque that is known to be noticed [N m]

# Metrics that are a sustained torque or angle of the handwheel. Those of the slow weave, of slow sweeps and of the slow
# transition change so slowly that they count as sustained (assumed).
SUSTAINED = frozenset(
    (
        *("torque_at_0p1g", "peak_handwheel_torque", "peak_handwheel_angle", "steady_step_torque"),
        *("transition_torque_at_1m_s2", "quasi_static_torque", "handwheel_torque_mean", "handwheel_torque_peak"),
    )
)

PERCEPTIBLE, IMPERCEPTIBLE, UNKNOWN = "perceptible", "not perceptible", "no threshold known"


class Perception(NamedTuple):
    """Whether a difference is noticed."""

    verdict: str  # PERCEPTIBLE, IMPERCEPTIBLE or UNKNOWN
    sure: bool | None = None  # whether the whole 95 % interval has this verdict; None where there is none to have

    def __str__(self) -> str:
        """The verdict, with a question mark where the interval reaches across the threshold."""
        return self.verdict + ("?" if self.sure is False else "")


def applies(name: str) -> bool:
    """Whether a threshold is known for a metric; ValueError for an unknown name."""
    return definition(name).name in SUSTAINED


def perception(name: str, base: float, gap: tuple[float, float, float], share: float = SHARE) -> Perception:
    """Whether a driver notices that a metric differs.

    Parameters
    ----------
    name : str
        Name of the metric.
    base : float
        The value that the other is compared with [unit of the metric].
    gap : (float, float, float)
        The other value less ``base``, and its 95 % interval, NaN where there is none [unit of the metric].
    share : float
        Just-noticeable difference as a share of the smaller of both values, above 0 [1].

    Raises
    ------
    ValueError
        For an unknown name, a share that is not above 0, or an infinite number.
    """
    if not share > 0.0:
        raise ValueError(f"the just-noticeable difference must be above 0, got {share!r}")
    if any(map(math.isinf, (base, *gap, share))):
        raise ValueError(f"{name}: base {base!r}, difference and interval {gap!r} and share {share!r} must be finite")
    value, low, high = gap
    small, large = sorted((abs(base), abs(base + value)))
    # A value that is missing, as that of a refused metric, is not a number and so not from the floor on.
    if not applies(name) or not large >= LEAST_STIMULUS[definition(name).unit]:
        return Perception(UNKNOWN)
    threshold = (1.0 - ROUNDING) * share * max(small, LEAST_STIMULUS[definition(name).unit])
    noticed = abs(value) >= threshold
    if math.isnan(low) or math.isnan(high):
        return Perception(PERCEPTIBLE if noticed else IMPERCEPTIBLE)
    if noticed:
        return Perception(PERCEPTIBLE, low >= threshold or high <= -threshold)
    return Perception(IMPERCEPTIBLE, -threshold < low and high < threshold)
