"""Column EPS: a controller sampled at 1 kHz, a delay, and a motor with a lag and a limit.

At each sample the controller passes the torsion-bar torque through the boost curve of the speed and a phase lead,
subtracts the motor damping, adds a request and limits the sum. The request comes from outside (for example of an assist
policy) and from the functions of :mod:`steer_env.vehicle.steering.assist`. The command takes effect ``delay`` later and
holds for one sample; the motor follows with a first-order lag. Torques are referred to the column axis, and a positive
assist turns left.

    command = limit(lead(boost(T_s, v)) - D(v) w + request)                   (E1)
    T_m' = omega_m (command(t - delay) - T_m)                                 (E2)

Source: boost table, lead, damping and loop data of a column EPS of a compact car (assumed, anchored on its hand
torques); :mod:`steer_env.vehicle.steering.margins` computes gain and phase margin of the loop.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.keys import checked
from steer_env.vehicle.steering import motor
from steer_env.vehicle.steering.assist import damping as damping_law
from steer_env.vehicle.steering.assist import functions
from steer_env.vehicle.steering.assist.by_speed import by_speed, interpolate_cell, table
from steer_env.vehicle.steering.assist.functions import Functions, NoFunctions
from steer_env.vehicle.steering.by_wire import NoWire
from steer_env.vehicle.steering.motor import Motor, NoMotor

SAMPLE_TIME = 1e-3  # [s]
MAX_DELAY = 4  # whole samples that the queue holds

STATES = (
    ("lead_filter", "N m"),
    ("motor_torque", "N m"),
    *((f"command_{i}", "N m") for i in range(MAX_DELAY + 1)),  # i samples old
)
# Positions of these states; ``QUEUE`` is that of the newest command.
LEAD_STATE, MOTOR_TORQUE, QUEUE = range(3)
STATE_SIZE = len(STATES)

TABLE_SPEEDS = tuple(kph / 3.6 for kph in (0.0, 20.0, 40.0, 80.0, 100.0, 140.0))
TABLE_TORQUES = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)
TABLE_ASSIST = (
    (0.0, 0.40, 1.80, 8.0, 18.0, 28.0, 35.0, 38.0, 38.0),
    (0.0, 0.35, 1.50, 6.5, 14.0, 22.0, 28.0, 31.0, 31.0),
    (0.0, 0.30, 1.10, 4.5, 9.5, 15.0, 20.0, 23.0, 23.0),
    (0.0, 0.25, 0.80, 2.8, 6.0, 10.0, 14.0, 16.0, 16.0),
    (0.0, 0.20, 0.60, 2.2, 5.0, 8.5, 12.0, 14.0, 14.0),
    (0.0, 0.15, 0.45, 1.6, 3.6, 6.5, 9.5, 11.0, 11.0),
)


class Assist(NamedTuple):
    """Parameters as the kernels take them; :func:`make` checks."""

    speeds: NDArray[np.float64]  # (V,) speeds of the boost table [m/s]
    torques: NDArray[np.float64]  # (T,) torsion-bar torques of the boost table, from zero [N m]
    boost: NDArray[np.float64]  # (V, T) assist at the column, scaled [N m]
    damping: NDArray[np.float64]  # (V,) motor damping at the column [N m s/rad]
    lead_b0: float  # lead filter, y = b0 u + x; x <- b1 u - a1 y [1]
    lead_b1: float  # lead filter, its b1 [1]
    lead_a1: float  # lead filter, its a1 [1]
    delay: int  # whole samples between measurement and effect
    offset: float  # remainder of the delay beyond whole samples [s]
    bandwidth: float  # corner of the motor torque loop [rad/s]
    limit: float  # motor peak torque at the column [N m]
    functions: Functions | NoFunctions = NoFunctions()  # in addition to boost and damping
    motor: Motor | NoMotor = NoMotor()  # its limits beside the largest torque
    wire: Any = NoWire()  # by_wire.Wire of a steer-by-wire, whose motor at the rack this one is


def make(
    *,
    speeds: ArrayLike = TABLE_SPEEDS,
    torques: ArrayLike = TABLE_TORQUES,
    boost: ArrayLike = TABLE_ASSIST,
    boost_scale: ArrayLike = (1.0,),
    damping: ArrayLike = (3.0, 2.5, 2.0, 1.0, 1.0, 1.0),
    lead_zero: float = 15.0,
    lead_pole: float = 150.0,
    delay: float = 0.5e-3,
    bandwidth: float = 150.0,
    limit: float = 3.5 * 20.5,
    **more: Any,
) -> Assist:
    """Checked assist parameters; the defaults are those of a compact car, assumed; the packaged cars have their own.

    The further keys, which ``inspect.signature`` lists, are those of the functions in
    :mod:`steer_env.vehicle.steering.assist`, one file each, and of :func:`steer_env.vehicle.steering.motor.make`; by
    default every function is off, and the motor has no other limit.

    Parameters
    ----------
    speeds : (V,) array_like
        Vehicle speeds of the table, ascending [m/s].
    torques : (T,) array_like
        Torsion-bar torques of the table, ascending from zero [N m]; the curve is odd and flat beyond the last.
    boost : (V, T) array_like
        Assist torque at the column, not negative, zero in the first column [N m].
    boost_scale : (V,) or (1,) array_like, or float
        Factor on the boost, 0 to 10, for each speed or one for all [1].
    damping : (V,) array_like
        Motor damping at the column [N m s/rad].
    lead_zero, lead_pole : float
        Corner frequencies of the phase lead, below 450 Hz [Hz].
    delay : float
        Time from measurement to effect, at most 4 ms [s]; with the hold, which adds half a sample, 1 ms in total.
    bandwidth : float
        Corner of the motor's torque loop [Hz].
    limit : float
        Peak torque of the motor at the column [N m]; 3.5 N m through 20.5:1.

    Raises
    ------
    ValueError
        Naming the value and what is allowed.
    """
    v, t, b, d = _tables(speeds, torques, boost, damping)
    latency = number("delay", delay, minimum=0.0, maximum=MAX_DELAY * SAMPLE_TIME)
    samples = int(latency / SAMPLE_TIME + 1e-9)
    # Tustin's rule on (1 + s/z)/(1 + s/p), corners pre-warped
    zero, pole = (
        math.tan(math.pi * checked("assist", name, f) * SAMPLE_TIME)
        for name, f in (("lead_zero", lead_zero), ("lead_pole", lead_pole))
    )
    gain = (1.0 / zero + 1.0) / (1.0 / pole + 1.0)  # (E3)
    return Assist(
        frozen(v),
        frozen(t),
        frozen(by_speed("boost_scale", boost_scale, v.size)[:, None] * b),
        frozen(d),
        lead_b0=gain,
        lead_b1=(1.0 - 1.0 / zero) / (1.0 + 1.0 / pole),  # (E3)
        lead_a1=(1.0 - 1.0 / pole) / (1.0 + 1.0 / pole),  # (E3)
        delay=samples,
        offset=max(latency - samples * SAMPLE_TIME, 0.0),
        bandwidth=2.0 * math.pi * checked("assist", "bandwidth", bandwidth),
        limit=checked("assist", "limit", limit),
        functions=functions.make(
            frozen(v), SAMPLE_TIME, **{key: more[key] for key in more if key not in motor.MOTOR_KEYS}
        ),
        motor=motor.make(**{key: more[key] for key in more if key in motor.MOTOR_KEYS}),
    )


make.__signature__ = functions.with_keys(make, motor.make)  # type: ignore[attr-defined]  # inspect reads it


def _tables(
    speeds: ArrayLike, torques: ArrayLike, boost: ArrayLike, damping: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The tables of :func:`make`, checked."""
    tables = {"speeds": speeds, "torques": torques, "boost": boost, "damping": damping}
    v, t, b, d = (table(name, values) for name, values in tables.items())
    for name, axis in (("speeds", v), ("torques", t)):
        if axis.ndim != 1 or axis.size < 2 or not np.isfinite(axis).all() or np.any(np.diff(axis) <= 0.0):
            raise ValueError(f"{name} must be finite and ascending, at least two values, got {axis}")
    if t[0] != 0.0:
        raise ValueError(f"torques must start at zero, got {t[0]:g}")
    if b.shape != (v.size, t.size):
        rows = f"{v.size} speeds, each of {t.size} torques"
        raise ValueError(f"boost must be finite, with a row for each of the {rows}, got an array of shape {b.shape}")
    if not np.isfinite(b).all() or np.any(b < 0.0) or np.any(b[:, 0] != 0.0):
        raise ValueError(f"boost must be finite, not negative, and zero at zero torque, got {b.tolist()}")
    if d.shape != v.shape or not np.isfinite(d).all() or np.any(d < 0.0):
        raise ValueError(f"damping must hold {v.size} finite values of at least 0, got {d}")
    return v, t, b, d


def keys(a: Assist) -> dict[str, Any]:
    """The keys of section ``assist`` of a car file that make an assist, to twelve digits where they are derived.

    ``boost`` contains its scale, so that ``boost_scale`` is not among them.
    """
    zero, pole = lead_corners(a)
    derived = {
        "lead_zero": zero,
        "lead_pole": pole,
        "delay": a.delay * SAMPLE_TIME + a.offset,
        "bandwidth": a.bandwidth / (2.0 * math.pi),
    }
    return {
        **{name: getattr(a, name).tolist() for name in ("speeds", "torques", "boost", "damping")},
        **{name: float(f"{value:.12g}") for name, value in derived.items()},
        "limit": a.limit,
        **functions.keys(a.functions, SAMPLE_TIME),
        **motor.keys(a.motor),
    }


def without_assist(a: Assist) -> Assist:
    """The same controller without boost, damping and functions, as if the motor were off; a wire stays as it is."""
    return frozen(a._replace(boost=0.0 * a.boost, damping=0.0 * a.damping, functions=NoFunctions()))


def lead_corners(a: Assist) -> tuple[float, float]:
    """Zero and pole of the phase lead [Hz], as :func:`make` took them."""
    pole = (1.0 + a.lead_a1) / (1.0 - a.lead_a1)
    zero = 1.0 / (a.lead_b0 * (1.0 / pole + 1.0) - 1.0)
    return math.atan(zero) / (math.pi * SAMPLE_TIME), math.atan(pole) / (math.pi * SAMPLE_TIME)


def available(a: Assist, speed: float) -> float:
    """Largest torque [N m] with which the cold motor drives at a column speed [rad/s]."""
    return a.limit if isinstance(a.motor, NoMotor) else min(a.limit, motor.largest(a.motor, 0.0, speed, True))


@kernel
def boost_curve(a, torque, speed):
    """Boost at a torsion-bar torque [N m] and a vehicle speed [m/s], odd in the torque, and the motor damping (E4).

    In reverse the tables are read at the same speed forwards, as by a controller that knows only the wheels' speeds.
    """
    i, u = bracket(a.speeds, abs(speed))
    j, s = bracket(a.torques, abs(torque))
    low = a.boost[i, j] + s * (a.boost[i, j + 1] - a.boost[i, j])
    high = a.boost[i + 1, j] + s * (a.boost[i + 1, j + 1] - a.boost[i + 1, j])
    # (E4)
    return math.copysign(low + u * (high - low), torque), interpolate_cell(a.damping, i, u)


@kernel
def sample(a, x, torsion_bar_torque, column_speed, vehicle_speed, request):
    """One sample of the controller; ``x`` is its slice of the state, changed in place.

    Returns
    -------
    before, after : float
        The commands [N m] that act until ``offset`` has passed since the sample, and from then on.
    """
    assist, damping = boost_curve(a, torsion_bar_torque, vehicle_speed)
    lead = a.lead_b0 * assist + x[LEAD_STATE]  # (E3)
    x[LEAD_STATE] = a.lead_b1 * assist - a.lead_a1 * lead
    before = x[QUEUE + a.delay]
    for i in range(QUEUE + a.delay, QUEUE, -1):
        x[i] = x[i - 1]
    x[QUEUE] = within(lead + damping_law.torque(damping, column_speed) + request, -a.limit, a.limit)  # (E1)
    return before, x[QUEUE + a.delay]


@kernel
def motor_step(a, x, heat, before, after, elapsed, speed, h):
    """Mean motor torque [N m] over a step ``h`` that starts ``elapsed`` after the last sample [s] (E5).

    ``speed`` is that of the column [rad/s], ``heat`` the states of the motor's limits.
    """
    before, after = motor.limited(a.motor, heat, before, speed), motor.limited(a.motor, heat, after, speed)
    mean = motor.lagged(a.bandwidth, a.offset, x, MOTOR_TORQUE, before, after, elapsed, h)  # (E5)
    motor.warm(a.motor, heat, mean, h)
    return mean
