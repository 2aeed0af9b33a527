"""Limits of the motor by its speed, its supply and its temperature; without them only ``limit`` of (E1) holds.

    |T| <= curve(|w|/s)                  torque over speed, which falls where the field is weakened       (E21)
    |T| <= P/|w|                         while it drives, of a supply that gives the power P              (E22)
    tau theta' = (T/T_c)^2 - theta       temperature, 1 where T_c heats it to in the long run             (E23)
    |T| <= T_c + (T_0 - T_c)(1 - theta)/(1 - theta_0)   from theta_0 to 1, at the standstill torque T_0   (E24)

w is the speed of the column below the torsion bar, to which the ratio refers the curve of the motor's own shaft. s is
the voltage of the supply over that of the curve: without losses in the winding the speed of a torque is proportional to
it. The limits act on the command that has reached the motor, whose lag (E2) the torque still has.

Source: the limits of permanent-magnet synchronous machines at a limited current and voltage; the linear derating and
theta_0 are assumed.
"""

import math
from inspect import signature
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics import units
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import COMPILED, dispatch, kernel
from steer_env.friction.numerics.simd import any_of
from steer_env.friction.numerics.units import (
    RETURNS_NOTHING,
    RETURNS_NUMBER,
    Function,
    Unit,
    array,
    caller,
    memory_size,
    part,
    values,
)
from steer_env.vehicle.keys import checked
from steer_env.vehicle.steering.assist.by_speed import table

Array = NDArray[np.float64]

DERATED_FROM = 0.8  # theta_0 of (E24) [1]


class NoMotor(NamedTuple):
    """No limit of the motor but the largest torque."""


class Motor(NamedTuple):
    """Parameters as the kernels take them; :func:`make` checks."""

    ratio: float  # motor speed over column speed [1]
    speeds: Array  # (K,) of the curve [rad/s]
    torques: Array  # (K,) of the curve, at the motor [N m]
    voltage: float  # s, of the supply over that of the curve [1]
    power: float  # P, mechanical power that the supply allows; 0 is no limit [W]
    continuous: float  # T_c, at the motor; 0 is no limit [N m]
    thermal_time: float  # tau [s]


def make(
    *,
    motor_ratio: float = 20.5,
    motor_speeds: ArrayLike = (),
    motor_torques: ArrayLike = (),
    motor_voltage: float = 1.0,
    motor_power: float = 0.0,
    motor_continuous: float = 0.0,
    motor_thermal_time: float = 60.0,
) -> "Motor | NoMotor":
    """The limits with these keys of section ``assist`` of a car file; there are none without a curve.

    Parameters
    ----------
    motor_ratio : float
        Motor speed over column speed [1].
    motor_speeds : (K,) array_like
        Speeds of the motor's curve, ascending from zero [rad/s].
    motor_torques : (K,) array_like
        Its largest torques there, none above the one before; the last holds beyond [N m].
    motor_voltage : float
        Voltage of the supply over that of the curve [1].
    motor_power : float
        Largest mechanical power that the supply allows [W]; 0 is no limit.
    motor_continuous : float
        Torque of the motor that heats it to its limit in the long run [N m]; 0 is no limit.
    motor_thermal_time : float
        Time constant of its temperature [s].

    Raises
    ------
    ValueError
        Naming the key and what is allowed.
    """
    v, t = table("motor_speeds", motor_speeds), table("motor_torques", motor_torques)
    ratio, voltage = checked("assist", "motor_ratio", motor_ratio), checked("assist", "motor_voltage", motor_voltage)
    power, time = (
        checked("assist", "motor_power", motor_power),
        checked("assist", "motor_thermal_time", motor_thermal_time),
    )
    continuous = checked("assist", "motor_continuous", motor_continuous)
    if v.size == t.size == 0:
        if power or continuous:
            name = "motor_power" if power else "motor_continuous"
            raise ValueError(f"{name} needs the curve of the motor: give motor_speeds and motor_torques")
        return NoMotor()
    if v.ndim != 1 or v.size < 2 or v[0] != 0.0 or not (np.isfinite(v).all() and np.all(np.diff(v) > 0.0)):
        raise ValueError(f"motor_speeds must ascend from 0 [rad/s], at least two values, got {v.tolist()}")
    if t.shape != v.shape or not (0.0 < t[0] < np.inf and t[-1] >= 0.0 and np.all(np.diff(t) <= 0.0)):
        raise ValueError(
            f"motor_torques must be {v.size} torques [N m] for as many motor_speeds, the first above 0, none above the "
            f"one before and none below 0, got {t.tolist()}"
        )
    if continuous > t[0]:
        raise ValueError(
            f"motor_continuous must be at most the first of motor_torques, {t[0]:g} [N m], got {continuous:g}"
        )
    return frozen(Motor(ratio, v, t, voltage, power, continuous, time))


MOTOR_KEYS = tuple(signature(make).parameters)


def keys(m: "Motor | NoMotor") -> dict[str, Any]:
    """The keys of a car file that make these limits; none where there are none."""
    return {f"motor_{name}": np.asarray(value).tolist() for name, value in m._asdict().items()}


def states(m: "Motor | NoMotor") -> tuple[tuple[str, str], ...]:
    """Names and units of the states."""
    return () if isinstance(m, NoMotor) else (("motor_temperature", "1"),)


@kernel
def _follow(bandwidth, x, at, command, h, lost):
    """Impulse of the motor torque over ``h`` at a constant command [N m s], exact for the first-order lag (E2)."""
    gap = x[at] - command
    x[at] -= gap * lost  # (E2)
    return command * h + gap * lost / bandwidth  # (E2)


@kernel
def lagged(bandwidth, offset, x, at, before, after, elapsed, h):
    """Mean torque [N m] of a motor over a step ``h`` that starts ``elapsed`` after the last sample [s] (E5).

    Its torque is ``x[at]``, its command ``before`` until ``offset`` after the sample, and ``after`` from then on.
    """
    first = within(offset - elapsed, 0.0, h)
    rest = h - first
    lost = -math.expm1(-bandwidth * first)
    impulse = _follow(bandwidth, x, at, before, first, lost)
    if any_of(rest != first):  # the default offset splits the step into equal halves
        lost = -math.expm1(-bandwidth * rest)
    return (impulse + _follow(bandwidth, x, at, after, rest, lost)) / h  # (E5)


@kernel
def largest(m, temperature, speed, drives):
    """Largest torque at the column [N m] at its speed [rad/s] and a temperature, where the motor drives or brakes."""
    turning = abs(speed) * m.ratio
    i, u = bracket(m.speeds, turning / m.voltage)
    found = m.torques[i] + u * (m.torques[i + 1] - m.torques[i])  # (E21)
    if drives and 0.0 < m.power < found * turning:
        found = m.power / turning  # (E22)
    if temperature > DERATED_FROM:
        cold = max((1.0 - temperature) / (1.0 - DERATED_FROM), 0.0)
        found = min(found, m.continuous + cold * (m.torques[0] - m.continuous))  # (E24)
    return found * m.ratio


@kernel
def _no_size(m):
    return 0


@kernel
def _size(m):
    return 1


@kernel
def _unlimited(m, x, command, speed):
    return command


@kernel
def _limited(m, x, command, speed):
    most = largest(m, x[0], speed, command * speed > 0.0)
    return within(command, -most, most)


@kernel
def _unwarmed(m, x, torque, h):
    pass


@kernel
def _warmed(m, x, torque, h):
    if m.continuous > 0.0:
        x[0] += h / m.thermal_time * ((torque / m.ratio / m.continuous) ** 2 - x[0])  # (E23)


# The limits as a unit (steer_env.friction.numerics.units), which is empty where there are none.


@kernel
def _limited_by(numbers, sizes, x, command, speed):
    return _limited(values(numbers, sizes), array(x, sizes), command, speed)


@kernel
def _warmed_by(numbers, sizes, x, torque, h):
    _warmed(values(numbers, sizes), array(x, sizes), torque, h)


FUNCTIONS = (Function(_limited_by, "pnn", RETURNS_NUMBER), Function(_warmed_by, "pnn", RETURNS_NOTHING))
_limit, _warm = caller(RETURNS_NUMBER), caller(RETURNS_NOTHING)


@kernel
def _limited_of_unit(m, x, command, speed):
    if m.code.addresses.size == 0:
        return command
    return _limit(part(m), 0, (x, command, speed))


@kernel
def _warmed_of_unit(m, x, torque, h):
    if m.code.addresses.size > 0:
        _warm(part(m), 1, (x, torque, h))


def bound(m: Any) -> Any:
    """The limits as compiled kernels take them in this process, so that these are compiled once for all."""
    return units.bound(m, () if isinstance(m, NoMotor) else FUNCTIONS, len(states(m))) if COMPILED else m


_KERNELS: dict[type, dict[str, Any]] = {
    NoMotor: {"size": _no_size, "limited": _unlimited, "warm": _unwarmed},
    Motor: {"size": _size, "limited": _limited, "warm": _warmed},
    Unit: {"size": memory_size, "limited": _limited_of_unit, "warm": _warmed_of_unit},
}

# The dispatch points. Plain Python runs the bodies; compiled code takes the kernel for the class.


def size(m):
    """Number of states."""
    return _KERNELS[type(m)]["size"](m)


def limited(m, x, command, speed):
    """A command [N m] within what the motor can give at a column speed [rad/s] and its temperature, in ``x``."""
    return _KERNELS[type(m)]["limited"](m, x, command, speed)


def warm(m, x, torque, h):
    """Advance the temperature in ``x`` by a step ``h`` [s] with a torque [N m]."""
    _KERNELS[type(m)]["warm"](m, x, torque, h)


for _point in (size, limited, warm):
    dispatch(_point, lambda kind, name: _KERNELS.get(kind, {}).get(name))


def course(m: "Motor | NoMotor", time: Array, torque: Array, speed: Array) -> Array:
    """Largest torque (T,) [N m] along a record (T,) of time [s], motor torque [N m] and column speed [rad/s]."""
    found = np.full(time.size, np.inf)
    if isinstance(m, Motor):
        _course(m, np.zeros(1), np.diff(time, prepend=time[0]), torque, speed, found)
    return found


@kernel
def _course(m, temperature, step, torque, speed, found):
    for i in range(found.size):
        _warmed(m, temperature, torque[i], step[i])
        found[i] = largest(m, temperature[0], speed[i], torque[i] * speed[i] > 0.0)
