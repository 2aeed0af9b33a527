"""Torque of the torsion bar from handwheel angle and speed alone, without any earlier torque.

    T = T_0 + k a + T_c tanh(a/a_c) + k_w th + k_s S + C th' + I th'' + T_F(th)             (H1)
    a = g (v^2 kappa - b kappa_s),  kappa = th / (i (l + K v^2))                            (H2)
    S' = th' - (v / sigma) S                                                                (H4)

th is the handwheel angle, v the speed, kappa the curvature of the path that a steady turn with this angle would have
and a the lateral acceleration that its tyres give. A road in a bend is banked, and the bank gives b kappa_s of it:
kappa_s is kappa smoothed over the distance driven, the road's without the corrections within its lane,
and the square root of b is the speed at which the bank alone leads the car through the bend. T_0 is the offset of
sensor and road, k the gradient of the torque, T_c its steep part on centre, where an assist gives little (both are what
the assist leaves to the hands), k_w the part by the weight on inclined king-pins, which is there at walking pace too,
and k_s that of tyres which are turned on their contact and lose this angle S as they roll on, over the relaxation
length sigma. C is damping, I inertia, and T_F the torque of a friction law over the handwheel angle, with its memory
at rest at the first sample. The twist of the torsion bar is part of the pre-sliding distance. Left is positive, and a
positive torque turns left.

Source: (H1) is the column's balance (C2) with assist and rack torque together as a function of a, th and S, which
leaves a sixth of the hand torque of the packaged car on two tracks in stop-and-go; (H2) is the steady single-track
model with ratio i, wheelbase l and understeer K, on a road whose bank follows its bends; (H4) is the first-order
relaxation of a rolling contact (Pacejka, Tyre and Vehicle Dynamics) for the angle that it is turned by.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction import response
from steer_env.friction.defaults import F_C, SIGMA_0
from steer_env.friction.identification import scales
from steer_env.friction.law import LAWS, as_mapping, make, resolve
from steer_env.friction.numerics.check import number, numbers, positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.recording.recording import Recording, low_passed

Array = NDArray[np.float64]

RATE = 50.0  # of the uniform samples [Hz]
CUTOFF = 5.0  # of the zero-phase low-pass of the angle: the sensor has steps, and hands move below 3 Hz; assumed [Hz]
GRID = 2.0  # of the curvature over the distance driven [m]
BEND = 100.0  # deviation of the Gaussian that smooths it to that of the road: a transition curve's length, assumed [m]

UNITS = {
    "T_0": "N m",
    "k": "N m s2/m",
    "T_c": "N m",
    "k_w": "N m/rad",
    "k_s": "N m/rad",
    "C": "N m s/rad",
    "I": "kg m2",
    "level": "N m",
}


class Prior(NamedTuple):
    """What a drive does not determine, of which (H2) is made."""

    ratio: float = 15.0  # i: handwheel angle over road-wheel angle; assumed [1]
    wheelbase: float = 2.8  # l; assumed [m]
    understeer: float = 0.0025  # K: road-wheel angle over lateral acceleration beyond Ackermann's; assumed [rad s2/m]
    gain: float = 1.0  # g: measured yaw rate or lateral acceleration over the one of i, l and K [1]


class Model(NamedTuple):
    """Equation (H1) with its numbers."""

    a_c: float  # lateral acceleration over which the torque is steep on centre [m/s2]
    terms: Mapping[str, float]  # those of ``UNITS`` without the level
    friction: Any  # parameters of a law, or None
    prior: Prior  # of (H2)
    balance: float = 0.0  # b, of the road where it predicts: another road has another bank [m2/s2]
    relaxation: float = 0.6  # sigma: over which a rolling tyre loses what it was turned by [m]


def curvature(prior: Prior, angle: Array, speed: Array) -> Array:
    """Curvature of the path of a steady turn (T,) by (H2) [1/m] at an angle [rad] and a speed [m/s]."""
    return prior.gain * angle / (prior.ratio * (prior.wheelbase + prior.understeer * speed**2))  # (H2)


def lateral_acceleration(prior: Prior, angle: Array, speed: Array) -> Array:
    """Lateral acceleration of a steady turn (T,) by (H2) [m/s2] on a level road."""
    return speed**2 * curvature(prior, angle, speed)


def bends(prior: Prior, angle: Array, speed: Array, dt: float) -> Array:
    """Curvature (T,) of the road, kappa_s of (H2), as far as the handwheel angle shows it [1/m]."""
    from scipy.ndimage import gaussian_filter1d  # imported here, because that takes longer than the import of all laws

    way = np.cumsum(np.maximum(speed, 0.0)) * dt
    places = np.arange(0.0, way[-1] + GRID, GRID)
    there = np.interp(places, way, curvature(prior, angle, speed))
    return np.interp(way, places, gaussian_filter1d(there, BEND / GRID, mode="nearest"))


@kernel
def _turn_slip(angle, speed, dt, relaxation, out):  # type: ignore[no-untyped-def]
    s = 0.0
    for i in range(1, angle.size):
        s = (s + angle[i] - angle[i - 1]) * math.exp(-abs(speed[i]) * dt / relaxation)  # (H4)
        out[i] = s


def turn_slip(angle: Array, speed: Array, dt: float, relaxation: float) -> Array:
    """Angle (T,) by which rolling tyres are turned on their contact, S of (H4), in terms of the handwheel [rad]."""
    out = np.zeros(angle.size)
    _turn_slip(angle, speed, dt, relaxation, out)
    return out


def stretched(law: str, level: float, distance: float) -> Any:
    """Parameters of a law with a level [N m] and a pre-sliding distance [rad]; its shape is that of its defaults.

    The defaults of all laws share the level ``F_C`` and the distance ``F_C/SIGMA_0``.
    """
    factors = scales.Scales(level / F_C, distance / (F_C / SIGMA_0), 1.0)
    given = as_mapping(make(law))
    values = {name: np.asarray(value) for name, value in given.items() if name != "law"}
    there = scales.scaled(LAWS[law], values, factors, back=True)
    return make(law, **{name: value.tolist() for name, value in there.items()})


def has_distance(law: str) -> bool:
    """Whether a law has a pre-sliding distance, or a speed, that can be stretched."""
    return any(scales.exponents(unit)[1] for unit in LAWS[law].units.values())


def smoothed(angle: Array, dt: float) -> Array:
    """The handwheel angle (T,) [rad] after the zero-phase low-pass at ``CUTOFF``, which smooths the sensor's steps."""
    return low_passed("handwheel_angle", angle, CUTOFF, 1.0 / dt)


def predict(model: Model, time: ArrayLike, handwheel_angle: ArrayLike, vehicle_speed: ArrayLike) -> Array:
    """Torque of the torsion bar (T,) [N m] by (H1) at the instants of a drive, of which no torque is used.

    Parameters
    ----------
    model : Model
    time : (T,) array_like
        Ascending, at any steps [s].
    handwheel_angle, vehicle_speed : (T,) array_like
        [rad], left positive; [m/s].

    Raises
    ------
    ValueError
        For arrays that are not finite or of different lengths, or a time that does not ascend.
    """
    given = {"handwheel_angle": numbers("handwheel_angle", handwheel_angle)}
    given["vehicle_speed"] = numbers("vehicle_speed", vehicle_speed)
    drive = Recording(numbers("time", time), given, {"handwheel_angle": "rad", "vehicle_speed": "m/s"})
    even = drive.resampled(RATE)
    angle = smoothed(even["handwheel_angle"], 1.0 / RATE)
    found = on_samples(model, angle, even["vehicle_speed"], 1.0 / RATE)
    return np.interp(drive.time, even.time, found)


def linear_terms(angle: Array, dt: float) -> dict[str, Array]:
    """The terms of (H1) that the angle alone makes (T,), each for a coefficient of one."""
    rate = np.gradient(angle, dt)
    return {
        "T_0": np.ones_like(angle),
        "k_w": angle,
        "C": rate,
        "I": np.gradient(rate, dt),
    }


def on_samples(model: Model, angle: Array, speed: Array, dt: float) -> Array:
    """Torque (T,) [N m] by (H1) at uniform steps ``dt`` [s], from the smoothed angle [rad] and the speed [m/s]."""
    a = lateral_acceleration(model.prior, angle, speed)
    a -= model.balance * bends(model.prior, angle, speed, dt)  # (H2)
    slip = turn_slip(angle, speed, dt, model.relaxation)
    terms = {**linear_terms(angle, dt), "k": a, "T_c": np.tanh(a / model.a_c), "k_s": slip}
    found = np.asarray(sum(value * terms[name] for name, value in model.terms.items()))  # (H1)
    return found if model.friction is None else found + response(resolve(model.friction), angle, dt)  # (H1)


def prior_from_meta(meta: Mapping[str, Any], given: Prior | None = None) -> Prior:
    """The prior with ratio, wheelbase and understeer that a recording's meta holds.

    Raises
    ------
    ValueError
        For a value that is not positive, or an understeer that is not finite.
    """
    found = given or Prior()
    if "steering_ratio" in meta:
        found = found._replace(ratio=positive("meta steering_ratio", meta["steering_ratio"]))
    if "wheelbase_m" in meta:
        found = found._replace(wheelbase=positive("meta wheelbase_m", meta["wheelbase_m"]))
    if "understeer_rad_s2_m" in meta:
        found = found._replace(understeer=number("meta understeer_rad_s2_m", meta["understeer_rad_s2_m"], minimum=0.0))
    return found
