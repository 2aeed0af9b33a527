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

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.vehicle.keys import LARGEST, checked
from steer_env.vehicle.steering.assist.by_speed import table

Array = NDArray[np.float64]

DERATED_FROM = 0.8  # theta_0 of (E24) [1]
KEYS = (
    "motor_ratio",
    "motor_speeds",
    "motor_torques",
    "supply_voltage",
    "supply_power",
    "continuous_torque",
    "thermal_time",
)


class NoMotor(NamedTuple):
    """No limit of the motor but the largest torque."""


class Motor(NamedTuple):
    """Parameters as the kernels take them, at the column; :func:`make` checks."""

    speeds: Array  # (K,) of the curve, with the voltage of the supply [rad/s]
    torques: Array  # (K,) [N m]
    power: float  # P, of the supply, as mechanical power [W]
    continuous: float  # T_c [N m]
    cooling: float  # 1/tau [1/s]
    ratio: float  # motor speed over column speed [1]
    voltage: float  # s, of the supply over that of the curve [1]


def make(
    *,
    motor_ratio: float = 20.5,
    motor_speeds: ArrayLike = (),
    motor_torques: ArrayLike = (),
    supply_voltage: float = 1.0,
    supply_power: float = 0.0,
    continuous_torque: float = 0.0,
    thermal_time: float = 60.0,
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
    supply_voltage : float
        Voltage of the supply over that of the curve [1].
    supply_power : float
        Largest mechanical power that the supply allows [W]; 0 is no limit.
    continuous_torque : float
        Torque of the motor that heats it to its limit in the long run [N m]; 0 is no limit.
    thermal_time : float
        Time constant of its temperature [s].

    Raises
    ------
    ValueError
        Naming the key and what is allowed.
    """
    speeds, torques = table("motor_speeds", motor_speeds), table("motor_torques", motor_torques)
    single = {"motor_ratio": motor_ratio, "supply_voltage": supply_voltage, "supply_power": supply_power}
    single |= {"continuous_torque": continuous_torque, "thermal_time": thermal_time}
    ratio, voltage, power, continuous, time = (checked("assist", key, value) for key, value in single.items())
    if speeds.size == torques.size == 0:
        limits = [key for key in ("supply_power", "continuous_torque") if single[key]]
        if limits:
            raise ValueError(f"{limits[0]} needs the curve of the motor: give motor_speeds and motor_torques")
        return NoMotor()
    if speeds.ndim != 1 or speeds.size < 2 or speeds[0] != 0.0 or not _all(np.diff(speeds) > 0.0, speeds):
        raise ValueError(f"motor_speeds must ascend from 0 [rad/s], at least two values, got {speeds.tolist()}")
    falls = _all(np.diff(torques) <= 0.0, torques) and np.all(torques >= 0.0)
    if torques.shape != speeds.shape or not falls or torques[0] == 0.0:
        raise ValueError(
            f"motor_torques must be {speeds.size} torques [N m] for as many motor_speeds, the first above 0, none "
            f"above the one before and none below 0, got {torques.tolist()}"
        )
    if continuous > torques[0]:
        raise ValueError(
            f"continuous_torque must be at most {torques[0]:g} [N m], the first of motor_torques, got {continuous:g}"
        )
    return frozen(
        Motor(
            speeds * voltage / ratio,
            torques * ratio,
            power or LARGEST,
            continuous * ratio or LARGEST,
            1.0 / time,
            ratio,
            voltage,
        )
    )


def _all(holds: NDArray[np.bool_], values: Array) -> bool:
    return bool(np.all(holds) and np.isfinite(values).all())


def keys(m: "Motor | NoMotor") -> dict[str, Any]:
    """The keys of a car file that make these limits, to twelve digits; none where there are none."""
    if isinstance(m, NoMotor):
        return {}
    return {
        "motor_ratio": m.ratio,
        "motor_speeds": [float(f"{v:.12g}") for v in m.speeds * m.ratio / m.voltage],
        "motor_torques": [float(f"{t:.12g}") for t in m.torques / m.ratio],
        "supply_voltage": m.voltage,
        "supply_power": m.power % LARGEST,
        "continuous_torque": float(f"{m.continuous % LARGEST / m.ratio:.12g}"),
        "thermal_time": float(f"{1.0 / m.cooling:.12g}"),
    }


def states(m: "Motor | NoMotor") -> tuple[tuple[str, str], ...]:
    """Names and units of the states."""
    return () if isinstance(m, NoMotor) else (("motor_temperature", "1"),)


@kernel
def largest(m, temperature, speed, drives):
    """Largest torque [N m] at a column speed [rad/s] and a temperature (E23), while the motor drives or brakes."""
    turning = abs(speed)
    i, u = bracket(m.speeds, turning)
    found = m.torques[i] + u * (m.torques[i + 1] - m.torques[i])  # (E21)
    if drives and found * turning > m.power:
        found = m.power / turning  # (E22)
    cold = within((1.0 - temperature) / (1.0 - DERATED_FROM), 0.0, 1.0)
    return min(found, m.continuous + cold * max(m.torques[0] - m.continuous, 0.0)) if cold < 1.0 else found  # (E24)


def course(m: "Motor | NoMotor", time: Array, torque: Array, speed: Array) -> Array:
    """Largest torque (T,) [N m] along a record (T,) of time [s], motor torque [N m] and column speed [rad/s]."""
    if isinstance(m, NoMotor):
        return np.full(time.size, np.inf)
    found, temperature = np.empty(time.size), np.zeros(1)
    for i, step in enumerate(np.diff(time, prepend=time[0])):
        warm(m, temperature, torque[i], step)
        found[i] = largest(m, temperature[0], speed[i], torque[i] * speed[i] > 0.0)
    return found


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
    x[0] += h * m.cooling * ((torque / m.continuous) ** 2 - x[0])  # (E23)


_KERNELS: dict[type, dict[str, Any]] = {
    NoMotor: {"size": _no_size, "limited": _unlimited, "warm": _unwarmed},
    Motor: {"size": _size, "limited": _limited, "warm": _warmed},
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
