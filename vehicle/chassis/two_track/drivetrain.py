"""Engine and automatic gearbox: the drive torques on the axles.

    engine    T_e = throttle (T_full + T_drag) - T_drag,  curves over the engine speed omega_e                 (D1)
    gearbox   omega_e = i omega_out,  T_out = i T_e eta, or i T_e/eta if T_e < 0                               (D2)
    axles     T_f = s T_out,  T_r = (1 - s) T_out,  omega_out = s omega_f + (1 - s) omega_r     open centre differential

The engine never stalls. Below the idle speed the clutch slips, the engine turns at idle, and the gearbox receives the
engine torque at idle. The drag at closed throttle is zero at idle, where the idle governor overcomes it: the car does
not creep, and the torque does not jump as the clutch closes.

A wheel's angular velocity is positive where it rolls forward, a torque where it drives forward.
Source: equations derived here; the defaults are a compact petrol car of 85 kW with five gears, all of them assumed.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import numbers
from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.keys import checked

RPM = math.pi / 30.0  # [rad/s]
ENGINE_SPEEDS = tuple(rpm * RPM for rpm in (800, 1500, 2000, 3000, 4000, 5000, 6000, 6300, 6600))
FULL_LOAD = (95.0, 118.0, 128.0, 142.0, 150.0, 147.0, 135.3, 124.0, 0.0)  # 85 kW at 6000 rpm; then the limiter
DRAG = (0.0, 14.0, 18.0, 22.0, 26.0, 31.0, 37.0, 39.0, 41.0)


class Drivetrain(NamedTuple):
    """Parameters as the kernels take them; :func:`make` checks."""

    speeds: NDArray[np.float64]  # (N,) engine speeds of both torque curves, the first is the idle speed [rad/s]
    full_load: NDArray[np.float64]  # (N,) torque at full throttle [N m]
    drag: NDArray[np.float64]  # (N,) drag torque at closed throttle, zero at idle [N m]
    inertia: float  # engine and flywheel [kg m2]
    ratios: NDArray[np.float64]  # (G,) gears 1 to G [1]
    final_drive: float  # [1]
    efficiency: float  # engine to wheels, and wheels to engine [1]
    up_closed: float  # engine speed above which it shifts up, throttle closed [rad/s]
    up_open: float  # engine speed above which it shifts up, full throttle [rad/s]
    down_closed: float  # engine speed below which it shifts down, throttle closed [rad/s]
    down_open: float  # engine speed below which it shifts down, full throttle [rad/s]
    shift_time: float  # drive interrupted [s]
    front_share: float  # of the drive torque: 1 front-wheel, 0 rear-wheel drive [1]


def make(
    *,
    speeds: ArrayLike = ENGINE_SPEEDS,
    full_load: ArrayLike = FULL_LOAD,
    drag: ArrayLike = DRAG,
    inertia: float = 0.12,
    ratios: ArrayLike = (3.55, 1.95, 1.28, 0.98, 0.80),
    final_drive: float = 4.06,
    efficiency: float = 0.92,
    up_shift: ArrayLike = (2400.0 * RPM, 6100.0 * RPM),
    down_shift: ArrayLike = (1100.0 * RPM, 2300.0 * RPM),
    shift_time: float = 0.4,
    front_share: float = 1.0,
) -> Drivetrain:
    """Checked drivetrain; the defaults are the compact car's, all assumed.

    Parameters
    ----------
    speeds : (N,) array_like
        Engine speeds of the curves, ascending from the idle speed [rad/s]; a curve is held beyond its ends.
    full_load : (N,) array_like
        Torque at full throttle, not negative [N m]; let it end at zero, as a speed limiter does.
    drag : (N,) array_like
        Drag torque at closed throttle, not negative, zero at idle [N m].
    inertia : float
        Engine and flywheel [kg m2].
    ratios : (G,) array_like
        Gears 1 to G, descending [1].
    final_drive, efficiency : float
        Ratio [1] and efficiency of gearbox and final drive together, in either direction of the power [1].
    up_shift, down_shift : (2,) array_like
        Engine speeds of the shifts at closed and at full throttle, linear between [rad/s]. No shift, at any throttle,
        may land where the opposite one is due.
    shift_time : float
        How long a shift interrupts the drive [s].
    front_share : float
        Share of the drive torque on the front axle [1].

    Raises
    ------
    ValueError
        Naming the parameter, the value and what is allowed.
    """
    n, full, closed = numbers("speeds", speeds), numbers("full_load", full_load), numbers("drag", drag)
    if n.size < 2 or n[0] <= 0.0 or np.any(np.diff(n) <= 0.0):
        raise ValueError(f"speeds must be ascending from the idle speed above zero, at least two values, got {n}")
    for name, curve in (("full_load", full), ("drag", closed)):
        if curve.shape != n.shape or np.any(curve < 0.0):
            raise ValueError(f"{name} must hold {n.size} values of at least 0, one for each of speeds, got {curve}")
    if closed[0] != 0.0:
        raise ValueError(f"drag must be 0 at the idle speed, the first of speeds, got {closed[0]:g}")
    if np.any(full + closed == 0.0):
        raise ValueError(f"full_load and drag must not both be 0, got that at {n[full + closed == 0.0][0]:g} rad/s")
    i = numbers("ratios", ratios)
    if np.any(i <= 0.0) or np.any(np.diff(i) >= 0.0):
        raise ValueError(f"ratios must be greater than 0 and descending, got {i}")
    up, down = _shift_limits(up_shift, down_shift, n, i)
    for array in (n, full, closed, i):
        array.flags.writeable = False
    return Drivetrain(
        n,
        full,
        closed,
        inertia=checked("drivetrain", "inertia", inertia),
        ratios=i,
        final_drive=checked("drivetrain", "final_drive", final_drive),
        efficiency=checked("drivetrain", "efficiency", efficiency),
        up_closed=float(up[0]),
        up_open=float(up[1]),
        down_closed=float(down[0]),
        down_open=float(down[1]),
        shift_time=checked("drivetrain", "shift_time", shift_time),
        front_share=checked("drivetrain", "front_share", front_share),
    )


def _shift_limits(
    up_shift: ArrayLike, down_shift: ArrayLike, n: NDArray[np.float64], i: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Checked engine speeds of the shifts, for engine speeds ``n`` of the curves and ratios ``i``."""
    up, down = numbers("up_shift", up_shift), numbers("down_shift", down_shift)
    for name, pair in (("up_shift", up), ("down_shift", down)):
        if pair.size != 2 or np.any(pair < n[0]) or np.any(pair > n[-1]):
            raise ValueError(
                f"{name} must be two speeds, at closed and at full throttle, of at least {n[0]:g} and at most {n[-1]:g}"
                f" (the ends of speeds), got {pair}"
            )
    # Both limits are linear in the throttle, so that its ends are sufficient. A down-shift that ends below the up-shift
    # speed is the same inequality as an up-shift that ends above the down-shift speed.
    step = float(np.max(i[:-1] / i[1:], initial=1.0))
    if np.any(down * step >= up):
        raise ValueError(
            f"down_shift must be below up_shift by more than the widest step of ratios ({step:.3f}), or it hunts,"
            f" got down_shift {down}, up_shift {up}"
        )
    return up, down


@kernel
def _curves(d, omega_e):
    """Full-load and drag torque at an engine speed; a curve keeps its end values beyond its ends [N m]."""
    i, s = bracket(d.speeds, omega_e)
    full = d.full_load[i] + s * (d.full_load[i + 1] - d.full_load[i])
    return full, d.drag[i] + s * (d.drag[i + 1] - d.drag[i])


@kernel
def _gear(d, gear, omega_front, omega_rear):
    """Engine turns per turn of the wheels, and the gearbox's input speed [rad/s]."""
    i = d.final_drive * d.ratios[int(gear) - 1]
    return i, i * (d.front_share * omega_front + (1.0 - d.front_share) * omega_rear)  # (D2)


@kernel
def engine_torque(d, omega_e, throttle):
    """Torque at the clutch [N m] at an engine speed [rad/s] and a throttle from 0 to 1 (D1)."""
    full, drag = _curves(d, omega_e)
    return throttle * (full + drag) - drag  # (D1)


@kernel
def axle_torques(d, gear, engaged, throttle, omega_front, omega_rear):
    """Drive torque on each axle, both wheels together (D2).

    Parameters
    ----------
    d : Drivetrain
    gear : float
        1 to G.
    engaged : bool
        False while a shift runs: no torque.
    throttle : float
        From 0 to 1.
    omega_front, omega_rear : float
        Mean angular velocity of the wheels of each axle [rad/s].

    Returns
    -------
    T_front, T_rear : float
        Negative in engine braking [N m]. The inertia of the engine is not in them; see :func:`reflected_inertia`.
    """
    if not engaged:
        return 0.0, 0.0
    i, omega_e = _gear(d, gear, omega_front, omega_rear)
    torque = i * engine_torque(d, omega_e, throttle)  # (D2)
    torque = torque * d.efficiency if torque > 0.0 else torque / d.efficiency  # (D2)
    return d.front_share * torque, (1.0 - d.front_share) * torque  # (D2)


@kernel
def throttle_for(d, gear, torque, omega_front, omega_rear):
    """Throttle for a torque on all driven wheels together [N m], or the nearest possible.

    During a shift it is the throttle for the next gear, so that the shift map does not receive a lifted throttle.
    """
    i, omega_e = _gear(d, gear, omega_front, omega_rear)
    full, drag = _curves(d, omega_e)
    wanted = torque / (i * d.efficiency) if torque > 0.0 else torque * d.efficiency / i
    return within((wanted + drag) / (full + drag), 0.0, 1.0)


@kernel
def shift(d, gear, left, throttle, omega_front, omega_rear, h):
    """Gear, and time left of a running shift, after a step of ``h``; the drive is engaged where no time is left (D4).

    Parameters
    ----------
    d : Drivetrain
    gear : float
        1 to G.
    left : float
        Time left of a running shift [s].
    throttle : float
        The last one, from 0 to 1.
    omega_front, omega_rear : float
        Mean angular velocity of the wheels of each axle [rad/s].
    h : float
        Step [s].

    Returns
    -------
    gear, left : float
    """
    if left > 0.0:
        return gear, max(left - h, 0.0)
    _, omega_e = _gear(d, gear, omega_front, omega_rear)
    if gear < d.ratios.size and omega_e > d.up_closed + throttle * (d.up_open - d.up_closed):  # (D4)
        return gear + 1.0, d.shift_time
    if gear > 1.0 and omega_e < d.down_closed + throttle * (d.down_open - d.down_closed):  # (D4)
        return gear - 1.0, d.shift_time
    return gear, 0.0


@kernel
def reflected_inertia(d, gear, engaged, omega_front, omega_rear):
    """Engine inertia seen at the output of the gearbox [kg m2]; zero while the clutch slips or a shift runs (D3).

    The slipping clutch closes at equal speeds, so the angular velocity does not jump when the inertia is added. The
    clutch takes the change of engine speed in a shift, which does no work on the car. With drive on both axles, each
    axle carries its share of the torque and of the inertia; this is exact while both axles turn equally fast.
    """
    i, omega_e = _gear(d, gear, omega_front, omega_rear)
    return d.inertia * i * i if engaged and omega_e >= d.speeds[0] else 0.0  # (D3)
