"""The functions of the assist together: active return, damping of the handwheel, friction and inertia compensation,
lead-lag. Each adds a torque to the request that the controller passes on within the motor's limit (E1).

A car without any of them has :class:`NoFunctions`, and needs neither state nor time for them. A plant calls them by
address (:func:`bound`).
"""

from collections.abc import Callable, Iterator
from inspect import Parameter, Signature, signature
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics import units
from steer_env.friction.numerics.check import parameters_of
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import COMPILED, dispatch, kernel
from steer_env.friction.numerics.units import RETURNS_NUMBER, Function, Unit, array, caller, memory_size, part, values
from steer_env.vehicle.steering.assist import (
    active_return,
    damping,
    friction_compensation,
    inertia_compensation,
    lead_lag,
)
from steer_env.vehicle.steering.assist.by_speed import interpolate_cell

MODULES = (active_return, damping, inertia_compensation, lead_lag, friction_compensation)
# First position of each function's states; the memory of the observer's friction law ends them.
INERTIA, LEAD_LAG, FRICTION = 0, 1, 3
STATES = tuple(state for module in MODULES for state in module.STATES)


class NoFunctions(NamedTuple):
    """No function is on."""


class Functions(NamedTuple):
    """Parameters of every function, those that are off too; :func:`make` checks."""

    speeds: NDArray[np.float64]  # (V,) of the values that depend on speed [m/s]
    active_return: active_return.ActiveReturn
    damping: damping.HandwheelDamping
    inertia_compensation: inertia_compensation.InertiaCompensation
    lead_lag: lead_lag.LeadLag
    friction_compensation: friction_compensation.FrictionCompensation


class Signals(NamedTuple):
    """What the functions measure at a sample."""

    handwheel_angle: float  # [rad]
    handwheel_speed: float  # [rad/s]
    column_speed: float  # [rad/s]
    torsion_bar_torque: float  # [N m]
    speed: float  # of the vehicle, below 0 in reverse [m/s]


def _own_keys(make: Callable) -> Iterator[Parameter]:
    return (p for p in parameters_of(make).values() if p.kind is Parameter.KEYWORD_ONLY)


def with_keys(make: Callable, *others: Callable) -> Signature:
    """The signature of ``make(*, ..., **more)`` with the keys of every function and of others in place of the last."""
    own = [p for p in signature(make).parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
    makes = (*(module.make for module in MODULES), *others)
    return signature(make).replace(parameters=[*own, *(key for each in makes for key in _own_keys(each))])


def make(speeds: NDArray[np.float64], dt: float, **keys: Any) -> "Functions | NoFunctions":
    """The functions with these keys of section ``assist`` of a car file; a key that is not given has its default.

    Parameters
    ----------
    speeds : (V,) array
        Of the boost table [m/s].
    dt : float
        Sample time [s].

    Raises
    ------
    ValueError
        A value out of range, by the name of its key.
    TypeError
        An unknown key.
    """
    known = {key.name for module in MODULES for key in _own_keys(module.make)}
    for key in keys:
        if key not in known:
            raise TypeError(f"the assist has no key {key!r}")
    common = {"count": speeds.size, "dt": dt}
    made = {}
    for module in MODULES:
        taken = parameters_of(module.make)
        given = {key: value for key, value in {**common, **keys}.items() if key in taken}
        made[module.__name__.rpartition(".")[2]] = module.make(**given)
    if not any(np.any(function.gain) for function in made.values()):
        return NoFunctions()
    return frozen(Functions(speeds, **made))


def keys(f: "Functions | NoFunctions", dt: float) -> dict[str, Any]:
    """The keys of a car file that make these functions; none where no function is on."""
    found: dict[str, Any] = {}
    if isinstance(f, Functions):
        for module in MODULES:
            p = getattr(f, module.__name__.rpartition(".")[2])
            found |= module.keys(p, dt) if "dt" in parameters_of(module.keys) else module.keys(p)
    return found


def gain_at(f: Functions, values: NDArray[np.float64], speed: float) -> float:
    """A value of the functions (V,) at a vehicle speed [m/s]."""
    return float(np.interp(abs(speed), f.speeds, values))


class Linear(NamedTuple):
    """The functions around straight running, without filters and lags."""

    gain: float  # torque over the torsion bar's torque [1]
    stiffness: float  # torque against the handwheel angle [N m/rad]
    damping: float  # torque against the handwheel speed [N m s/rad]
    inertia: float  # torque with the column acceleration [kg m2]


def linear(f: "Functions | NoFunctions", speed: float, torque: float = 0.0) -> Linear:
    """The functions linearised at a vehicle speed [m/s] and a torsion-bar torque [N m], friction compensation apart."""
    if isinstance(f, NoFunctions):
        return Linear(0.0, 0.0, 0.0, 0.0)
    gains = (f.active_return.gain, f.damping.gain, f.inertia_compensation.gain)
    gain, damped, inertia = (gain_at(f, values, speed) for values in gains)
    fade = 1.0 + (torque / f.active_return.hold) ** 2
    stiffness = gain / fade * active_return.share(f.active_return, speed)
    return Linear(f.lead_lag.gain, stiffness, damped + stiffness * f.active_return.lead, inertia)


def states(f: "Functions | NoFunctions") -> tuple[tuple[str, str], ...]:
    """Names and units of the states of the functions."""
    if isinstance(f, NoFunctions):
        return ()
    return (*STATES, *((f"observer_memory_{i}", "") for i in range(f.friction_compensation.memory_size)))


@kernel
def _no_size(f):
    return 0


@kernel
def _size(f):
    return FRICTION + friction_compensation.MEMORY + f.friction_compensation.memory_size


@kernel
def _unchanged(f, x, s, request):
    return request


@kernel
def _with_functions(f, x, s, request):
    i, u = bracket(f.speeds, abs(s.speed))
    returned = active_return.torque(
        f.active_return,
        interpolate_cell(f.active_return.gain, i, u),
        s.handwheel_angle,
        s.handwheel_speed,
        s.torsion_bar_torque,
        s.speed,
    )
    damped = damping.torque(interpolate_cell(f.damping.gain, i, u), s.handwheel_speed)
    inertia = interpolate_cell(f.inertia_compensation.gain, i, u)
    accelerated = inertia_compensation.torque(f.inertia_compensation, inertia, x[INERTIA:LEAD_LAG], s.column_speed)
    shifted = lead_lag.torque(f.lead_lag, f.lead_lag.gain, x[LEAD_LAG:FRICTION], s.torsion_bar_torque)
    p = f.friction_compensation
    compensated = friction_compensation.torque(p, x[FRICTION:], s.column_speed, s.torsion_bar_torque)
    return request + returned + damped + accelerated + shifted + interpolate_cell(p.gain, i, u) * compensated


# The functions as a unit (steer_env.friction.numerics.units), which is empty where there are none.


@kernel
def _requested(numbers, sizes, x, angle, handwheel_speed, column_speed, torsion_bar_torque, speed, request):
    measured = Signals(angle, handwheel_speed, column_speed, torsion_bar_torque, speed)
    return _with_functions(values(numbers, sizes), array(x, sizes), measured, request)


_request = caller(RETURNS_NUMBER)


@kernel
def _requested_of_unit(f, x, s, request):
    if f.code.addresses.size == 0:
        return request
    given = (x, s.handwheel_angle, s.handwheel_speed, s.column_speed, s.torsion_bar_torque, s.speed, request)
    return _request(part(f), 0, given)


def bound(f: Any) -> Any:
    """The functions as compiled kernels take them in this process, so that these are compiled once for all."""
    given = () if isinstance(f, NoFunctions) else (Function(_requested, "pnnnnnn", RETURNS_NUMBER),)
    return units.bound(f, given, len(states(f))) if COMPILED else f


_KERNELS: dict[type, dict[str, Any]] = {
    NoFunctions: {"size": _no_size, "requested": _unchanged},
    Functions: {"size": _size, "requested": _with_functions},
    Unit: {"size": memory_size, "requested": _requested_of_unit},
}

# The dispatch points. Plain Python runs the bodies; compiled code takes the kernel for the class.


def size(f):
    """Number of states of the functions."""
    return _KERNELS[type(f)]["size"](f)


def requested(f, x, s, request):
    """The request [N m] with the torques of the functions, whose states ``x`` advance by a sample of ``Signals``."""
    return _KERNELS[type(f)]["requested"](f, x, s, request)


for _point in (size, requested):
    dispatch(_point, lambda kind, name: _KERNELS.get(kind, {}).get(name))
