"""Steer-by-wire: the controllers of a handwheel and of a rack that nothing but messages connects.

At each sample of 1 ms the handwheel's controller sends angle and speed, every ``every`` samples, and they arrive
``wait`` samples later. With their age t the rack's controller makes of them a wanted angle and speed at the pinion,
which a cascade of a proportional and a proportional-integral loop follows with the actuator's torque:

    wanted = within(i(v) (th1 + t w1), -lock, lock),   wanted' = i(v) w1, 0 at the lock                    (W1)
    e_w = k_p (wanted - th2) + wanted' - w2                                                                (W2)
    request = k_w e_w + I,   I' = (k_w/T_i) e_w unless the request is beyond the actuator's limit          (W3)

The actuator is the motor of :mod:`steer_env.vehicle.steering.eps`, with its delay, lag and limits (E1), (E2). The
handwheel's feedback motor makes the wanted feel: a map of torque over angle and speed, damping, the hysteresis of a
friction law that the handwheel turns, and a stop where the rack is at its lock:

    feel = map(th1, v) + D(v) w1 + T_law(th1) + K_stop beyond(th1, lock/i(v))                              (W4)
    command = limit(request of the hand - feel)                                                            (W5)
    T_f' = omega_f (command(t - delay) - T_f)                                                              (W6)

T_f acts on the handwheel, positive to the left. (W5) takes the requests from outside, as of a policy.

Source: cascaded position control of servo drives; numbers of the defaults are assumed, (E7) the shape of the map.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.law import advance, law_of
from steer_env.friction.law import torque as law_torque
from steer_env.friction.numerics import units
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import COMPILED, dispatch, kernel
from steer_env.friction.numerics.units import RETURNS_NUMBER, Function, Unit, array, caller, memory_size, part, values
from steer_env.friction.sites import resolve_one
from steer_env.vehicle.keys import checked, declared_keys
from steer_env.vehicle.steering.assist.by_speed import interpolate_cell, table
from steer_env.vehicle.steering.motor import lagged

Array = NDArray[np.float64]

SECTION = "steer_by_wire"  # of a car file
SAMPLE_TIME = 1e-3  # [s]
MAX_DELAY, MAX_WAIT = 4, 20  # whole samples that the queues of commands and of messages hold
STOP_STIFFNESS = 100.0  # of the handwheel's stop, assumed [N m/rad]

_COMMANDS = tuple((f"feedback_command_{i}", "N m") for i in range(MAX_DELAY + 1))  # i samples old
_MESSAGES = tuple(
    (f"{name}_{i}", unit)
    for name, unit in (("sent_angle", "rad"), ("sent_speed", "rad/s"), ("sent_age", "s"))
    for i in range(MAX_WAIT + 1)
)
STATES = (
    ("feedback_torque", "N m"),
    ("feedback_command_before", "N m"),
    ("position_integral", "N m"),
    ("handwheel_angle_before", "rad"),
    ("samples_since_message", "1"),
    *_COMMANDS,
    *_MESSAGES,
)
# Positions of these states; the memory of the wanted friction law ends them.
FEEDBACK, BEFORE, INTEGRAL, ANGLE_BEFORE, COUNT, COMMANDS = range(6)
ANGLES = COMMANDS + len(_COMMANDS)
SPEEDS, AGES = ANGLES + MAX_WAIT + 1, ANGLES + 2 * (MAX_WAIT + 1)
MEMORY = len(STATES)


class NoWire(NamedTuple):
    """A column connects handwheel and rack."""


class Wire(NamedTuple):
    """Parameters as the kernels take them; :func:`make` checks."""

    speeds: Array  # (V,) of the vehicle, for what depends on it [m/s]
    ratio: Array  # (V,) pinion angle over handwheel angle [1]
    angles: Array  # (A,) handwheel angles of the map, from zero [rad]
    feel: Array  # (V, A) torque that resists, of the map [N m]
    damping: Array  # (V,) [N m s/rad]
    law: Any  # of the wanted friction
    law_size: int  # floats that the law remembers
    limit: float  # of the feedback motor [N m]
    bandwidth: float  # corner of its torque loop [rad/s]
    delay: int  # whole samples between measurement and effect
    offset: float  # remainder of the delay beyond whole samples [s]
    position_gain: float  # k_p [1/s]
    speed_gain: float  # k_w [N m s/rad]
    integral_gain: float  # k_w/T_i [N m/rad]
    actuator_limit: float  # of the request [N m]
    lock: float  # pinion angle at the rack's end stops [rad]
    every: int  # samples between two messages
    wait: int  # samples that a message travels


def make(
    *,
    lock: float,
    actuator_limit: float,
    speeds: ArrayLike,
    ratio: ArrayLike,
    angles: ArrayLike,
    feel: ArrayLike,
    feel_scale: float,
    damping: ArrayLike,
    friction_law: Any,
    feedback_limit: float,
    feedback_bandwidth: float,
    feedback_delay: float,
    position_gain: float,
    speed_gain: float,
    integral_time: float,
    wire_delay: float,
    wire_sample_time: float,
) -> Wire:
    """Checked parameters, for the keys of section ``steer_by_wire`` of a car file beside the first two.

    Parameters
    ----------
    lock, actuator_limit : float
        Pinion angle at the end stops of the rack [rad], largest torque of its actuator at the pinion [N m].
    speeds, ratio, damping : (V,) array_like
        Vehicle speeds, ascending [m/s]; there the pinion angle over the handwheel angle, of one sign [1], and the
        damping of the handwheel [N m s/rad].
    angles, feel : (A,), (V, A) array_like
        Handwheel angles, ascending from zero [rad], and the torque that resists there, not negative, zero in the first
        column [N m]; the map is odd and flat beyond the last angle.
    feel_scale : float
        Factor on it [1].
    friction_law : str, mapping or parameters
        The friction that the hand is wanted to feel, in a form of :func:`steer_env.friction.law.resolve`.
    feedback_limit, feedback_bandwidth, feedback_delay : float
        Of the feedback motor: largest torque [N m], corner of its torque loop [Hz], time from measurement to effect,
        at most 4 ms [s].
    position_gain, speed_gain, integral_time : float
        k_p, k_w and T_i of (W2) and (W3) [1/s, N m s/rad, s].
    wire_delay, wire_sample_time : float
        Whole milliseconds that a message travels, at most 20 ms, and that lie between two of them [s].

    Raises
    ------
    ValueError
        Naming the key and what is allowed.
    """
    v, i, a, f, d = (
        table(name, given)
        for name, given in (
            ("speeds", speeds), ("ratio", ratio), ("angles", angles), ("feel", feel), ("damping", damping)
        )
    )  # fmt: skip
    _check_tables(v, i, a, f, d)
    law = _law(friction_law)
    gain = checked(SECTION, "speed_gain", speed_gain)
    return frozen(
        Wire(
            v,
            i,
            a,
            checked(SECTION, "feel_scale", feel_scale) * f,
            d,
            law,
            law_of(law).memory_size(law),
            limit=checked(SECTION, "feedback_limit", feedback_limit),
            bandwidth=2.0 * math.pi * checked(SECTION, "feedback_bandwidth", feedback_bandwidth),
            **as_samples(checked(SECTION, "feedback_delay", feedback_delay)),
            position_gain=checked(SECTION, "position_gain", position_gain),
            speed_gain=gain,
            integral_gain=gain / checked(SECTION, "integral_time", integral_time),
            actuator_limit=actuator_limit,
            lock=lock,
            every=_milliseconds("wire_sample_time", wire_sample_time),
            wait=_milliseconds("wire_delay", wire_delay),
        )
    )


def as_samples(delay: float) -> dict[str, Any]:
    """A delay [s] of a motor as its whole samples and what remains of it, by the names of both fields."""
    samples = int(delay / SAMPLE_TIME + 1e-9)
    return {"delay": samples, "offset": max(delay - samples * SAMPLE_TIME, 0.0)}


def _law(friction_law: Any) -> Any:
    """Parameters of the wanted friction; ValueError names the key."""
    try:
        return resolve_one(friction_law, "the wanted feel")
    except ValueError as error:
        raise ValueError(f"friction_law: {error}") from None


def _milliseconds(key: str, value: float) -> int:
    """A time of the wire in whole samples; ValueError for another one."""
    found = checked(SECTION, key, value) / SAMPLE_TIME
    if abs(found - round(found)) > 1e-6:
        raise ValueError(f"{key} must be whole milliseconds, {declared_keys()[SECTION][key].allowed}, got {value!r}")
    return round(found)


def _check_tables(v: Array, i: Array, a: Array, f: Array, d: Array) -> None:
    """ValueError for tables of :func:`make` that are refused."""
    for name, axis in (("speeds", v), ("angles", a)):
        if axis.ndim != 1 or axis.size < 2 or not np.isfinite(axis).all() or np.any(np.diff(axis) <= 0.0):
            raise ValueError(f"{name} must be finite and ascending, at least two values, got {axis.tolist()}")
    if a[0] != 0.0:
        raise ValueError(f"angles must start at zero, got {a[0]:g}")
    for name, found in (("ratio", i), ("damping", d)):
        about = declared_keys()[SECTION][name]
        if found.shape != v.shape or not np.all((found >= about.low) & (found <= about.high)):
            allowed = f"{v.size} values for as many speeds, each {about.low:g} to {about.high:g} [{about.unit}]"
            raise ValueError(f"{name} must hold {allowed}, got {found.tolist()}")
    most = declared_keys()[SECTION]["feel"].high
    if f.shape != (v.size, a.size) or not np.all((f >= 0.0) & (f <= most)) or np.any(f[:, 0] != 0.0):
        raise ValueError(
            f"feel must have {v.size} rows of {a.size} torques, 0 to {most:g} N m and zero at zero angle, "
            f"got {f.tolist()}"
        )


def transmitted(w: "Wire | NoWire", factor: float) -> "Wire | NoWire":
    """The same with a position loop whose motor acts by a factor, as behind a gear that slides (E25)."""
    if isinstance(w, NoWire):
        return w
    return w._replace(speed_gain=factor * w.speed_gain, integral_gain=factor * w.integral_gain)


def states(w: "Wire | NoWire") -> tuple[tuple[str, str], ...]:
    """Names and units of the states."""
    if isinstance(w, NoWire):
        return ()
    return (*STATES, *((f"wanted_friction_memory_{i}", "") for i in range(w.law_size)))


def ratio_at(w: "Wire | NoWire", speed: float) -> float:
    """Pinion angle over handwheel angle at a vehicle speed [m/s]; 1 of a column [1]."""
    return 1.0 if isinstance(w, NoWire) else float(np.interp(abs(speed), w.speeds, w.ratio))


def handwheel_lock(rack_limit: float, pinion_radius: float, w: "Wire | NoWire", speed: float) -> float:
    """Handwheel angle [rad] at which the rack meets its end stop [m], without twist, at a vehicle speed [m/s]."""
    return rack_limit / pinion_radius / ratio_at(w, speed)


@kernel
def feel_map(w, angle, speed):
    """Torque of the map at a handwheel angle [rad] and a vehicle speed [m/s], odd in the angle [N m]."""
    i, u = bracket(w.speeds, abs(speed))
    j, s = bracket(w.angles, abs(angle))
    low = w.feel[i, j] + s * (w.feel[i, j + 1] - w.feel[i, j])
    high = w.feel[i + 1, j] + s * (w.feel[i + 1, j + 1] - w.feel[i + 1, j])
    return math.copysign(low + u * (high - low), angle)  # (W4)


@kernel
def _received(w, x, angle, speed):
    """Angle [rad], speed [rad/s] and age [s] of the message that the rack's controller has, after one more sample."""
    for first in (ANGLES, SPEEDS, AGES):
        for i in range(first + w.wait, first, -1):
            x[i] = x[i - 1]
    x[AGES] += SAMPLE_TIME
    if x[COUNT] == 0.0:
        x[ANGLES], x[SPEEDS], x[AGES] = angle, speed, 0.0
    x[COUNT] = x[COUNT] + 1.0 if x[COUNT] + 1.0 < w.every else 0.0
    return x[ANGLES + w.wait], x[SPEEDS + w.wait], x[AGES + w.wait] + w.wait * SAMPLE_TIME


@kernel
def _position_torque(w, x, ratio, angle, speed, pinion_angle, pinion_speed):
    """Request [N m] of the position loop to the actuator."""
    sent, turning, age = _received(w, x, angle, speed)
    ahead, rate = ratio * (sent + age * turning), ratio * turning
    wanted = within(ahead, -w.lock, w.lock)  # (W1)
    if wanted != ahead:
        rate = 0.0
    off = w.position_gain * (wanted - pinion_angle) + rate - pinion_speed  # (W2)
    found = w.speed_gain * off + x[INTEGRAL]
    if abs(found) < w.actuator_limit or found * off < 0.0:
        x[INTEGRAL] += SAMPLE_TIME * w.integral_gain * off  # (W3)
    return found


@kernel
def _feel_torque(w, x, ratio, damping, angle, speed, vehicle_speed):
    """Torque [N m] that the hand is wanted to feel against a turn to the left."""
    memory, moving = x[MEMORY : MEMORY + w.law_size], (angle - x[ANGLE_BEFORE]) / SAMPLE_TIME
    x[ANGLE_BEFORE] = angle
    advance(w.law, 1.0, memory, moving, SAMPLE_TIME)
    beyond = angle - within(angle, -w.lock / ratio, w.lock / ratio)
    held = law_torque(w.law, 1.0, memory, moving) + STOP_STIFFNESS * beyond
    return feel_map(w, angle, vehicle_speed) + damping * speed + held  # (W4)


@kernel
def _sampled(w, x, angle, speed, pinion_angle, pinion_speed, vehicle_speed, request):
    i, u = bracket(w.speeds, abs(vehicle_speed))
    ratio, damping = interpolate_cell(w.ratio, i, u), interpolate_cell(w.damping, i, u)
    feel = _feel_torque(w, x, ratio, damping, angle, speed, vehicle_speed)
    x[BEFORE] = x[COMMANDS + w.delay]
    for k in range(COMMANDS + w.delay, COMMANDS, -1):
        x[k] = x[k - 1]
    x[COMMANDS] = within(request - feel, -w.limit, w.limit)  # (W5)
    return _position_torque(w, x, ratio, angle, speed, pinion_angle, pinion_speed)


@kernel
def _fed(w, x, elapsed, h):
    return lagged(w.bandwidth, w.offset, x, FEEDBACK, x[BEFORE], x[COMMANDS + w.delay], elapsed, h)  # (W6)


@kernel
def _size(w):
    return MEMORY + w.law_size


# Of a column.


@kernel
def _unchanged(w, x, angle, speed, pinion_angle, pinion_speed, vehicle_speed, request):
    return request


@kernel
def _nothing(w, x, elapsed, h):
    return 0.0


@kernel
def _no_size(w):
    return 0


# The controllers as a unit (steer_env.friction.numerics.units), which is empty where there are none.


@kernel
def _sampled_by(numbers, sizes, x, angle, speed, pinion_angle, pinion_speed, vehicle_speed, request):
    w, own = values(numbers, sizes), array(x, sizes)
    return _sampled(w, own, angle, speed, pinion_angle, pinion_speed, vehicle_speed, request)


@kernel
def _fed_by(numbers, sizes, x, elapsed, h):
    return _fed(values(numbers, sizes), array(x, sizes), elapsed, h)


FUNCTIONS = (Function(_sampled_by, "pnnnnnn", RETURNS_NUMBER), Function(_fed_by, "pnn", RETURNS_NUMBER))
_call = caller(RETURNS_NUMBER)


@kernel
def _sampled_of_unit(w, x, angle, speed, pinion_angle, pinion_speed, vehicle_speed, request):
    if w.code.addresses.size == 0:
        return request
    return _call(part(w), 0, (x, angle, speed, pinion_angle, pinion_speed, vehicle_speed, request))


@kernel
def _fed_of_unit(w, x, elapsed, h):
    return _call(part(w), 1, (x, elapsed, h))


def bound(w: Any) -> Any:
    """The controllers as compiled kernels take them in this process, so that these are compiled once for all."""
    return units.bound(w, () if isinstance(w, NoWire) else FUNCTIONS, len(states(w))) if COMPILED else w


_KERNELS: dict[type, dict[str, Any]] = {
    NoWire: {"size": _no_size, "sampled": _unchanged, "fed": _nothing},
    Wire: {"size": _size, "sampled": _sampled, "fed": _fed},
    Unit: {"size": memory_size, "sampled": _sampled_of_unit, "fed": _fed_of_unit},
}

# The dispatch points. Plain Python runs the bodies; compiled code takes the kernel for the class.


def size(w):
    """Number of states, 0 of a column."""
    return _KERNELS[type(w)]["size"](w)


def sampled(w, x, angle, speed, pinion_angle, pinion_speed, vehicle_speed, request):
    """Request [N m] to the motor at the rack after one sample of both controllers, whose states ``x`` advance.

    ``request`` is that from outside [N m]: of a wire to the feedback motor, of a column to the assist, as it is.
    """
    return _KERNELS[type(w)]["sampled"](w, x, angle, speed, pinion_angle, pinion_speed, vehicle_speed, request)


def fed(w, x, elapsed, h):
    """Mean torque of the feedback motor [N m] over a step ``h`` that starts ``elapsed`` after the last sample [s]."""
    return _KERNELS[type(w)]["fed"](w, x, elapsed, h)


for _point in (size, sampled, fed):
    dispatch(_point, lambda kind, name: _KERNELS.get(kind, {}).get(name))
