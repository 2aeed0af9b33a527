"""Steer-by-wire: the controllers of a handwheel and of a rack that nothing but messages connects.

At each sample of 1 ms the handwheel's controller sends angle and speed, every ``every`` samples, and they arrive
``wait`` samples later. With their age t the rack's controller makes of them a wanted angle and speed at the pinion,
which a cascade of a proportional and a proportional-integral loop follows with the actuator's torque:

    wanted = within(i(v) (th1 + t w1), -lock, lock),   wanted' = i(v) w1, 0 at the lock                    (W1)
    e_w = k_p (wanted - th2) + wanted' - w2                                                                (W2)
    request = k_w e_w + I,   I' = (k_w/T_i) e_w unless the request is beyond the actuator's limit          (W3)

The actuator is the motor of :mod:`steer_env.vehicle.steering.eps`, with its delay, lag and limits (E1), (E2). The
handwheel's feedback motor makes the wanted feel: the torque of a law of :mod:`steer_env.vehicle.steering.feels`,
damping, the hysteresis of a friction law that the handwheel turns, and a stop where the rack is at its lock:

    feel = T_feel + D(v) w1 + T_law(th1) + K_stop beyond(th1, lock/i(v))                                   (W4)
    command = limit(request of the hand - feel)                                                            (W5)
    T_f' = omega_f (command(t - delay) - T_f)                                                              (W6)

T_f acts on the handwheel, positive to the left. (W5) takes the requests from outside, as of a policy.

Source: cascaded position control of servo drives; numbers of the defaults are assumed, (E7) the shape of the map.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.law import advance, law_of
from steer_env.friction.law import torque as law_torque
from steer_env.friction.numerics import units
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import COMPILED, dispatch, kernel
from steer_env.friction.numerics.units import RETURNS_NUMBER, Function, Unit, array, caller, memory_size, part, values
from steer_env.friction.sites import resolve_one, sliding_torque
from steer_env.vehicle.keys import checked, declared_keys
from steer_env.vehicle.steering import rack_observer
from steer_env.vehicle.steering.assist.by_speed import interpolate_cell, table
from steer_env.vehicle.steering.feels import common as feels
from steer_env.vehicle.steering.feels.common import FEELS
from steer_env.vehicle.steering.motor import lagged
from steer_env.vehicle.steering.rack_observer import Observer, Rack

Array = NDArray[np.float64]

SECTION = "steer_by_wire"  # of a car file
SAMPLE_TIME = 1e-3  # [s]
MAX_DELAY, MAX_WAIT = 4, 20  # whole samples that the queues of commands and of messages hold
STOP_STIFFNESS = 100.0  # of the handwheel's stop, assumed [N m/rad]

_COMMANDS = tuple((f"feedback_command_{i}", "N m") for i in range(MAX_DELAY + 1))  # i samples old
_MESSAGES = tuple(
    (f"{name}_{i}", unit)
    for name, unit in (("sent_angle", "rad"), ("sent_speed", "rad/s"), ("sent_force", "N"), ("sent_age", "s"))
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
    *rack_observer.STATES,
)
# Positions of these states; the memories of both friction laws end them.
FEEDBACK, BEFORE, INTEGRAL, ANGLE_BEFORE, COUNT, COMMANDS = range(6)
ANGLES = COMMANDS + len(_COMMANDS)
SPEEDS, FORCES, AGES, OBSERVED = (ANGLES + k * (MAX_WAIT + 1) for k in (1, 2, 3, 4))
MEMORY = len(STATES)  # of the wanted friction law, then that of the observer's
_BY_SPEED = ("ratio", "damping", "force_share")
_NUMBERS = (
    *("feel_scale", "feedback_limit", "feedback_bandwidth", "feedback_delay", "position_gain", "speed_gain"),
    *("integral_time", "observer_bandwidth", "observer_gear_loss", "observer_load"),
)


class NoWire(NamedTuple):
    """A column connects handwheel and rack."""


class Wire(NamedTuple):
    """Parameters as the kernels take them; :func:`make` checks."""

    speeds: Array  # (V,) of the vehicle, for what depends on it [m/s]
    ratio: Array  # (V,) pinion angle over handwheel angle [1]
    damping: Array  # (V,) [N m s/rad]
    force_share: Array  # (V,) of the rack force in a blended feel [1]
    angles: Array  # (A,) handwheel angles of the map, from zero [rad]
    feel: Array  # (V, A) torque that resists, of the map [N m]
    forces: Array  # (K,) told rack forces, from zero [N]
    force_feel: Array  # (K,) torque that resists there [N m]
    feel_law: Any  # class of steer_env.vehicle.steering.feels
    law: Any  # of the wanted friction
    law_size: int  # floats that the law remembers
    limit: float  # of the feedback motor [N m]
    bandwidth: float  # corner of its torque loop [rad/s]
    delay: int  # whole samples between measurement and effect
    offset: float  # remainder of the delay beyond whole samples [s]
    position_gain: float  # k_p [1/s]
    speed_gain: float  # k_w [N m s/rad]
    integral_gain: float  # k_w/T_i [N m/rad]
    every: int  # samples between two messages
    wait: int  # samples that a message travels
    observer: Observer  # of the rack force


def make(p: Mapping[str, Any], rack: Rack) -> Wire:
    """Checked parameters of a complete section ``steer_by_wire`` of a car file and what is known of the rack.

    ``data/cars/keys.toml`` declares meaning, unit and range of each key.

    Raises
    ------
    ValueError
        Naming the key and what is allowed.
    """
    tables = {key: table(key, p[key]) for key in (*_BY_SPEED, "speeds", "angles", "feel", "forces", "force_feel")}
    if tables["force_share"].shape == (1,):
        tables["force_share"] = np.full(tables["speeds"].shape, tables["force_share"])
    _check_tables(**tables)
    number = {key: checked(SECTION, key, p[key]) for key in _NUMBERS}
    law, known = (_law(key, p[key]) for key in ("friction_law", "observer_law"))
    try:
        feel_law = FEELS[p["feel_law"]].parameters()
    except ValueError as error:
        raise ValueError(f"feel_law: {error}") from None
    own: dict[str, Any] = {**tables, "feel": number["feel_scale"] * tables["feel"]}
    own["force_feel"] = number["feel_scale"] * tables["force_feel"]
    return frozen(
        Wire(
            **own,
            feel_law=feel_law,
            law=law,
            law_size=law_of(law).memory_size(law),
            limit=number["feedback_limit"],
            bandwidth=2.0 * math.pi * number["feedback_bandwidth"],
            **as_samples(number["feedback_delay"]),
            position_gain=number["position_gain"],
            speed_gain=number["speed_gain"],
            integral_gain=number["speed_gain"] / number["integral_time"],
            every=_milliseconds("wire_sample_time", p["wire_sample_time"]),
            wait=_milliseconds("wire_delay", p["wire_delay"]),
            observer=Observer(
                rack,
                rack_observer.decay(number["observer_bandwidth"], SAMPLE_TIME),
                known,
                law_of(known).memory_size(known),
                max(sliding_torque(known), 0.0),
                number["observer_gear_loss"],
                number["observer_load"],
            ),
        )
    )


def as_samples(delay: float) -> dict[str, Any]:
    """A delay [s] of a motor as its whole samples and what remains of it, by the names of both fields."""
    samples = int(delay / SAMPLE_TIME + 1e-9)
    return {"delay": samples, "offset": max(delay - samples * SAMPLE_TIME, 0.0)}


def _law(key: str, given: Any) -> Any:
    """Parameters of a friction law that a key gives; ValueError names the key."""
    try:
        return resolve_one(given, "a controller by wire")
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None


def _milliseconds(key: str, value: float) -> int:
    """A time of the wire in whole samples; ValueError for another one."""
    found = checked(SECTION, key, value) / SAMPLE_TIME
    if abs(found - round(found)) > 1e-6:
        raise ValueError(f"{key} must be whole milliseconds, {declared_keys()[SECTION][key].allowed}, got {value!r}")
    return round(found)


def _check_tables(**tables: Array) -> None:
    """ValueError for tables of :func:`make` that are refused."""
    keys, v = declared_keys()[SECTION], tables["speeds"]
    for name in ("speeds", "angles", "forces"):
        axis = tables[name]
        if axis.ndim != 1 or axis.size < 2 or not np.isfinite(axis).all() or np.any(np.diff(axis) <= 0.0):
            raise ValueError(f"{name} must be finite and ascending, at least two values, got {axis.tolist()}")
        if name != "speeds" and axis[0] != 0.0:
            raise ValueError(f"{name} must start at zero, got {axis[0]:g}")
    for name in _BY_SPEED:
        about, found = keys[name], tables[name]
        if found.shape != v.shape or not np.all((found >= about.low) & (found <= about.high)):
            allowed = f"{v.size} values for as many speeds, each {about.low:g} to {about.high:g} [{about.unit}]"
            raise ValueError(f"{name} must hold {allowed}, got {found.tolist()}")
    for name, shape in (("feel", (v.size, tables["angles"].size)), ("force_feel", tables["forces"].shape)):
        found, most = tables[name], keys[name].high
        if found.shape != shape or not np.all((found >= 0.0) & (found <= most)) or np.any(found[..., 0] != 0.0):
            rows = f"{shape[0]} rows of {shape[1]}" if len(shape) > 1 else f"{shape[0]}"
            raise ValueError(
                f"{name} must have {rows} torques, 0 to {most:g} N m and zero at the first, got {found.tolist()}"
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
    sizes = {"wanted": w.law_size, "rack": w.observer.law_size}
    return (*STATES, *((f"{name}_friction_memory_{i}", "") for name, n in sizes.items() for i in range(n)))


def ratio_at(w: "Wire | NoWire", speed: float) -> float:
    """Pinion angle over handwheel angle at a vehicle speed [m/s]; 1 of a column [1]."""
    return 1.0 if isinstance(w, NoWire) else float(np.interp(abs(speed), w.speeds, w.ratio))


def handwheel_lock(rack_limit: float, pinion_radius: float, w: "Wire | NoWire", speed: float) -> float:
    """Handwheel angle [rad] at which the rack meets its end stop [m], without twist, at a vehicle speed [m/s]."""
    return rack_limit / pinion_radius / ratio_at(w, speed)


@kernel
def _send(w, x, angle, speed, force):
    """Send what both sides know, where it is time to, and let the messages travel by a sample."""
    for first in (ANGLES, SPEEDS, FORCES, AGES):
        for i in range(first + w.wait, first, -1):
            x[i] = x[i - 1]
    x[AGES] += SAMPLE_TIME
    if x[COUNT] == 0.0:
        x[ANGLES], x[SPEEDS], x[FORCES], x[AGES] = angle, speed, force, 0.0
    x[COUNT] = x[COUNT] + 1.0 if x[COUNT] + 1.0 < w.every else 0.0


@kernel
def _position_torque(w, x, ratio, pinion_angle, pinion_speed):
    """Request [N m] of the position loop to the actuator."""
    sent, turning, age = x[ANGLES + w.wait], x[SPEEDS + w.wait], x[AGES + w.wait] + w.wait * SAMPLE_TIME
    ahead, rate = ratio * (sent + age * turning), ratio * turning
    wanted = within(ahead, -w.observer.rack.lock, w.observer.rack.lock)  # (W1)
    if wanted != ahead:
        rate = 0.0
    off = w.position_gain * (wanted - pinion_angle) + rate - pinion_speed  # (W2)
    found = w.speed_gain * off + x[INTEGRAL]
    if abs(found) < w.observer.rack.limit or found * off < 0.0:
        x[INTEGRAL] += SAMPLE_TIME * w.integral_gain * off  # (W3)
    return found


@kernel
def _feel_torque(w, x, ratio, damping, angle, speed, vehicle_speed):
    """Torque [N m] that the hand is wanted to feel against a turn to the left."""
    memory, moving = x[MEMORY : MEMORY + w.law_size], (angle - x[ANGLE_BEFORE]) / SAMPLE_TIME
    x[ANGLE_BEFORE] = angle
    advance(w.law, 1.0, memory, moving, SAMPLE_TIME)
    beyond = angle - within(angle, -w.observer.rack.lock / ratio, w.observer.rack.lock / ratio)
    held = law_torque(w.law, 1.0, memory, moving) + STOP_STIFFNESS * beyond
    return feels.torque(w.feel_law, w, angle, x[FORCES + w.wait], vehicle_speed) + damping * speed + held  # (W4)


@kernel
def _sampled(w, x, angle, speed, pinion_angle, pinion_speed, motor, vehicle_speed, request):
    i, u = bracket(w.speeds, abs(vehicle_speed))
    ratio, damping = interpolate_cell(w.ratio, i, u), interpolate_cell(w.damping, i, u)
    own, memory = x[OBSERVED:MEMORY], x[MEMORY + w.law_size :]
    force = rack_observer.observe(w.observer, own, memory, motor, pinion_angle, pinion_speed, SAMPLE_TIME)
    _send(w, x, angle, speed, force)
    feel = _feel_torque(w, x, ratio, damping, angle, speed, vehicle_speed)
    x[BEFORE] = x[COMMANDS + w.delay]
    for k in range(COMMANDS + w.delay, COMMANDS, -1):
        x[k] = x[k - 1]
    x[COMMANDS] = within(request - feel, -w.limit, w.limit)  # (W5)
    return _position_torque(w, x, ratio, pinion_angle, pinion_speed)


@kernel
def _fed(w, x, elapsed, h):
    return lagged(w.bandwidth, w.offset, x, FEEDBACK, x[BEFORE], x[COMMANDS + w.delay], elapsed, h)  # (W6)


@kernel
def _size(w):
    return MEMORY + w.law_size + w.observer.law_size


# Of a column.


@kernel
def _unchanged(w, x, angle, speed, pinion_angle, pinion_speed, motor, vehicle_speed, request):
    return request


@kernel
def _nothing(w, x, elapsed, h):
    return 0.0


@kernel
def _no_size(w):
    return 0


# The controllers as a unit (steer_env.friction.numerics.units), which is empty where there are none.


@kernel
def _sampled_by(numbers, sizes, x, angle, speed, pinion_angle, pinion_speed, motor, vehicle_speed, request):
    w, own = values(numbers, sizes), array(x, sizes)
    return _sampled(w, own, angle, speed, pinion_angle, pinion_speed, motor, vehicle_speed, request)


@kernel
def _fed_by(numbers, sizes, x, elapsed, h):
    return _fed(values(numbers, sizes), array(x, sizes), elapsed, h)


FUNCTIONS = (Function(_sampled_by, "pnnnnnnn", RETURNS_NUMBER), Function(_fed_by, "pnn", RETURNS_NUMBER))
_call = caller(RETURNS_NUMBER)


@kernel
def _sampled_of_unit(w, x, angle, speed, pinion_angle, pinion_speed, motor, vehicle_speed, request):
    if w.code.addresses.size == 0:
        return request
    return _call(part(w), 0, (x, angle, speed, pinion_angle, pinion_speed, motor, vehicle_speed, request))


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


def sampled(w, x, angle, speed, pinion_angle, pinion_speed, motor, vehicle_speed, request):
    """Request [N m] to the motor at the rack after one sample of both controllers, whose states ``x`` advance.

    ``request`` is that from outside [N m]: of a wire to the feedback motor, of a column to the assist, as it is.
    """
    return _KERNELS[type(w)]["sampled"](w, x, angle, speed, pinion_angle, pinion_speed, motor, vehicle_speed, request)


def fed(w, x, elapsed, h):
    """Mean torque of the feedback motor [N m] over a step ``h`` that starts ``elapsed`` after the last sample [s]."""
    return _KERNELS[type(w)]["fed"](w, x, elapsed, h)


for _point in (size, sampled, fed):
    dispatch(_point, lambda kind, name: _KERNELS.get(kind, {}).get(name))
