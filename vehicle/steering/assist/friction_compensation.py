"""Friction compensation: a friction law is the observer of the friction torque, and a share of it is fed back (E13).

At every sample the law's own kernels advance its memory by the displacement of the sample at the column speed, and give
the present torque, exact for that history (equal to :func:`steer_env.friction.response`). The law need not be the
car's:

    z <- advance(z, w, dt),    T_obs = torque(z, w),    T <- limit(T + limit(T_obs - T, k |w| dt), T_max)
    grip <- max(|T_tb|, grip exp(-dt/tau)),    request = share(v) T grip^2/(grip^2 + hold^2)             (E13)

The observed torque is limited for these reasons:

* The stiffness k bounds its slope over displacement. Coulomb's jump at a reversal has an unbounded gain at small
  amplitudes and, sampled and delayed, causes a limit cycle at standstill; as a ramp it is elastic there, as real
  friction is.
* T_max bounds its size: a viscous observer would cancel the damping of fast motions.
* The grip fades it out with the torsion bar's torque. With a released handwheel the oscillation of a car with little
  motor damping is damped by little else than friction: if most of it is compensated, the car does not come to rest, and
  if the observer has more friction than the car, no share is safe. Hands on the handwheel add damping, and only they
  feel the friction.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction import defaults
from steer_env.friction.law import advance, as_mapping, law_of
from steer_env.friction.law import torque as law_torque
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.sites import resolve_one
from steer_env.vehicle.keys import checked
from steer_env.vehicle.steering.assist.by_speed import by_speed, shortest

STIFFNESS = 2.0 * defaults.SIGMA_0  # slope of the default laws directly after a reversal from saturation [N m/rad]
LIMIT = 2.0 * defaults.F_C  # of the observed torque, before the share is taken [N m]
HOLD = 0.5  # torsion-bar torque at which half of the share is fed back, assumed [N m]
GRIP_TIME = 0.3  # time constant with which the grip decays, assumed [s]


class FrictionCompensation(NamedTuple):
    """Parameters as the kernels take them."""

    gain: NDArray[np.float64]  # (V,) share of the observed torque that is fed back [1]
    law: Any  # parameters of the observer's friction law
    memory_size: int  # floats that the law remembers
    stiffness: float  # largest slope of the torque over displacement, k [N m/rad]
    limit: float  # largest torque before the share is taken, T_max [N m]
    hold: float  # torsion-bar torque at which half of the share is fed back [N m]
    dt: float  # sample time [s]
    decay: float  # factor on the grip over a sample [1]


STATES = (
    ("observed_friction", "N m"),  # torque of the law
    ("limited_friction", "N m"),  # within slope and size
    ("grip", "N m"),  # decaying peak of the torsion bar's torque
)
# Positions of these states in the function's part of the state, which the memory of the law ends.
OBSERVED, LIMITED, GRIP, MEMORY = range(4)


def make(
    count: int,
    dt: float,
    *,
    friction_share: ArrayLike = (0.0,),
    friction_law: Any = "lugre",
    friction_stiffness: float = STIFFNESS,
    friction_limit: float = LIMIT,
    friction_hold: float = HOLD,
    friction_grip_time: float = GRIP_TIME,
) -> FrictionCompensation:
    """Checked parameters for ``count`` speeds and samples of ``dt`` [s]; a share of 0 is off.

    Parameters
    ----------
    count : int
        Speeds of the boost table, V.
    dt : float
        Sample time [s].
    friction_share : (V,) or (1,) array_like, or float
        Share of the observed torque that is fed back, 0 to 1.
    friction_law : str, mapping or parameters
        The observer's law in a form of :func:`steer_env.friction.law.resolve`, in a car file as text.
    friction_stiffness : float
        Largest slope of the torque over displacement, 1 to 10000 [N m/rad].
    friction_limit : float
        Largest torque before the share is taken, above 0 to 20 [N m].
    friction_hold : float
        Torsion-bar torque at which half of the share is fed back, 0.01 to 100 [N m].
    friction_grip_time : float
        Time constant with which the share fades after the hands have let go, 0.01 to 100 [s].
    """
    try:
        law = resolve_one(friction_law, "the observer")
    except ValueError as error:
        raise ValueError(f"friction_law: {error}") from None
    return FrictionCompensation(
        by_speed("friction_share", friction_share, count),
        law,
        law_of(law).memory_size(law),
        checked("assist", "friction_stiffness", friction_stiffness),
        checked("assist", "friction_limit", friction_limit),
        checked("assist", "friction_hold", friction_hold),
        dt,
        math.exp(-dt / checked("assist", "friction_grip_time", friction_grip_time)),
    )


def _text(parameters: Any) -> str:
    """Parameters of a law as :func:`steer_env.friction.resolve` reads them from text, to the bit."""
    values = as_mapping(parameters)
    pairs = (f"{key}={':'.join(map(repr, np.ravel(value).tolist()))}" for key, value in values.items() if key != "law")
    return ",".join([values["law"], *pairs])


def keys(p: FrictionCompensation) -> dict[str, Any]:
    """The keys of a car file that make these parameters; the time constant to twelve digits."""
    return {
        "friction_share": shortest(p.gain),
        "friction_law": _text(p.law),
        "friction_stiffness": p.stiffness,
        "friction_limit": p.limit,
        "friction_hold": p.hold,
        "friction_grip_time": float(f"{-p.dt / math.log(p.decay):.12g}"),
    }


@kernel
def torque(p, x, w, twist):
    """Torque to feed back [N m], before the share is taken.

    Parameters
    ----------
    p : FrictionCompensation
    x : array
        ``STATES`` and the memory of the law; advanced in place.
    w : float
        Column speed [rad/s].
    twist : float
        Torsion-bar torque [N m].
    """
    memory = x[MEMORY : MEMORY + p.memory_size]
    advance(p.law, 1.0, memory, w, p.dt)
    x[OBSERVED] = law_torque(p.law, 1.0, memory, w)
    most = p.stiffness * abs(w) * p.dt
    change = min(max(x[OBSERVED] - x[LIMITED], -most), most)
    x[LIMITED] = min(max(x[LIMITED] + change, -p.limit), p.limit)
    grip = max(abs(twist), p.decay * x[GRIP])
    x[GRIP] = grip
    return x[LIMITED] * grip * grip / (grip * grip + p.hold * p.hold)  # (E13)
