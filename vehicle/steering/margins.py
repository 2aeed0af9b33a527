"""Stability margins of the assist loop, opened at the torsion-bar torque (E6).

The loop is the sampled loop of the plant: the mechanics with the lag of the motor between hold and sampler, the delay
in whole samples, motor damping and inertia compensation closed, and the boost curve replaced by its local gain. All
that answers the torsion bar's torque stands beside the boost: the lead-lag, and at their steepest the fade of the
active return and, as a spring of negative stiffness, the friction compensation (E16).

The friction of a gear with an efficiency grows with the motor's torque T_m (F44). While it slides at a speed w, without
its preload, it takes (1 - eta_d) |T_m| where T_m drives the motion, and (1/eta_b - 1) |T_m| where it is driven back,
against w. What is left of T_m, and of a small change of it, is

    k T_m,   k = eta_d  if T_m w > 0,   k = 1/eta_b  if T_m w < 0,   k = 1  at rest                            (E25)

The loop is linear in T_m, so that k is a factor on all that the motor answers, of which :func:`transmitted` makes the
loop. A sliding gear drags the observer of the friction compensation along, whose spring acts at k = 1 only.

    alpha = 1/max |S - 1/2|,   S = 1/(1 + L)                                                                   (E18)

alpha is the disk margin: the loop stays stable while gain and phase together change by any complex factor of the disk
whose real ends are (1 - alpha/2)/(1 + alpha/2) and its inverse.

Source of (E18): Seiler, Packard, Gahinet, An introduction to disk margins, IEEE Control Systems Magazine 40 (2020).
"""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import islice, pairwise
from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.frozen import frozen
from steer_env.vehicle.steering.assist import active_return
from steer_env.vehicle.steering.assist.first_order import FirstOrder
from steer_env.vehicle.steering.assist.functions import Functions, gain_at
from steer_env.vehicle.steering.column import Column
from steer_env.vehicle.steering.eps import SAMPLE_TIME, Assist, boost_curve

Array = NDArray[np.float64]

TARGETS = 30.0, 6.0  # usual lower limits of phase [deg] and gain [dB] margin of an assist loop; assumed

FREQUENCIES = np.geomspace(0.3, 490.0, 400)  # at which margins are read [Hz]


class Margins(NamedTuple):
    """Margins of one operating point; infinite where the loop has no such crossing."""

    gain: float  # largest factor that the boost's slope may take [1]
    phase: float  # [rad]
    delay: float  # further delay [s]
    disk: float  # alpha of (E18) [1]
    crossover: float  # highest frequency of unit gain; NaN without one [Hz]
    stable: bool  # no motion of the closed loop grows


class Cell(NamedTuple):
    """The column's loop in one cell of the boost table."""

    torque: float  # of the torsion bar, in the middle of the cell [N m]
    slope: float  # of the boost curve [1]
    margins: Margins


def transmitted(a: Assist, factor: float) -> Assist:
    """The assist whose loop is that of ``a`` behind a gear that slides, with a factor of (E25); ``a`` itself at 1."""
    if factor == 1.0:
        return a
    f = a.functions
    if isinstance(f, Functions):
        of_return = f.active_return
        f = f._replace(
            active_return=of_return._replace(gain=factor * of_return.gain, saturation=factor * of_return.saturation),
            damping=f.damping._replace(gain=factor * f.damping.gain),
            inertia_compensation=f.inertia_compensation._replace(gain=factor * f.inertia_compensation.gain),
            lead_lag=f.lead_lag._replace(gain=factor * f.lead_lag.gain),
            friction_compensation=f.friction_compensation._replace(gain=0.0 * f.friction_compensation.gain),
        )
    return frozen(a._replace(boost=factor * a.boost, damping=factor * a.damping, functions=f))  # (E25)


def boost_gain(a: Assist, torque: float, speed: float) -> float:
    """Local slope of the boost curve [1] at a torsion-bar torque [N m] and a vehicle speed [m/s]."""
    step = 1e-6
    return (boost_curve(a, torque + step, speed)[0] - boost_curve(a, torque - step, speed)[0]) / (2.0 * step)


@lru_cache
def _discrete(c: Column, bandwidth: float, time: float) -> control.StateSpace:
    """Column and motor, hands fixed, at inputs that are constant for a time [s]; cached, as many assists share them."""
    A = [[0.0, -1.0, 0.0], [c.K_tb / c.I2, -(c.C2 + c.C_tb) / c.I2, 1.0 / c.I2], [0.0, 0.0, -bandwidth]]
    B = [[0.0, 1.0, 0.0], [0.0, c.C_tb / c.I2, 1.0 / c.I2], [bandwidth, 0.0, 0.0]]
    C = np.array([[c.K_tb, 0.0, 0.0], [0.0, 1.0, 0.0]])
    if time == 0.0:
        return control.ss(np.eye(3), np.zeros((3, 3)), C, 0.0)
    return control.c2d(control.ss(A, B, C, 0.0), time, "zoh")


def hands_fixed_plant(c: Column, a: Assist, speed: float) -> control.StateSpace:
    """From the assist request to the sensor, under a prescribed handwheel motion: motor damping closed, boost open.

    Parameters
    ----------
    c, a : parameters of column and assist
    speed : float
        Vehicle speed, for the motor damping [m/s].

    Returns
    -------
    control.StateSpace
        Discrete at 1 ms. Inputs, held over a sample: request [N m], handwheel speed [rad/s], torque on the column from
        rack and friction [N m]. Outputs: torsion-bar torque [N m], column speed [rad/s]. States: twist of the torsion
        bar [rad], column speed, motor torque, then the commands of the last delay + 1 samples, the newest first.
    """
    damping = boost_curve(a, 0.0, speed)[1]
    # The command changes within the sample: the old one acts for the offset, the new one for the rest.
    rest, first = _discrete(c, a.bandwidth, SAMPLE_TIME - a.offset), _discrete(c, a.bandwidth, a.offset)
    n = a.delay + 1
    phi, gamma = np.zeros((3 + n, 3 + n)), np.zeros((3 + n, 3))
    phi[:3, :3] = rest.A @ first.A
    phi[:3, 2 + n] = rest.A @ first.B[:, 0]
    phi[4:, 3:-1] = np.eye(n - 1)
    gamma[:3, 1:] = rest.A @ first.B[:, 1:] + rest.B[:, 1:]
    gamma[3, 0] = 1.0
    if a.delay:
        phi[:3, 1 + n] += rest.B[:, 0]
    else:
        gamma[:3, 0] = rest.B[:, 0]
    phi[:, 1] -= damping * gamma[:, 0]
    C = np.hstack([rest.C, np.zeros((2, n))])
    if isinstance(a.functions, Functions):
        gamma[:, 1] -= gain_at(a.functions, a.functions.damping.gain, speed) * gamma[:, 0]
        phi, gamma, C = _accelerated(phi, gamma, C, a.functions, speed)
    return control.ss(phi, gamma, C, 0.0, SAMPLE_TIME)


def _accelerated(phi: Array, gamma: Array, C: Array, f: Functions, speed: float) -> tuple[Array, Array, Array]:
    """The plant with the inertia compensation closed (E14); the state of its filter is the last one."""
    J, d, request = gain_at(f, f.inertia_compensation.gain, speed), f.inertia_compensation.derivative, gamma[:, :1]
    phi = np.block([[phi, J * request], [np.zeros((1, len(phi))), np.array([[-d.a1]])]])
    phi[:-1, 1] += J * d.b0 * request[:, 0]
    phi[-1, 1] = d.b1 - d.a1 * d.b0
    return phi, np.vstack([gamma, np.zeros((1, 3))]), np.hstack([C, np.zeros((2, 1))])


def filter_model(f: FirstOrder, dt: float = SAMPLE_TIME) -> control.StateSpace:
    """A first-order filter at samples of ``dt`` [s]."""
    return control.ss(-f.a1, f.b1 - f.a1 * f.b0, 1.0, f.b0, dt)


def answer(a: Assist, gain: float, slope: float) -> control.StateSpace:
    """From the torsion bar's torque to the request, at a slope of the boost curve and one that needs no lead [1]."""
    boosted = gain * filter_model(FirstOrder(a.lead_b0, a.lead_b1, a.lead_a1))
    if not isinstance(a.functions, Functions):
        return boosted
    h = a.functions.lead_lag
    return boosted + h.gain * filter_model(h.lead) * filter_model(h.lag) + slope


def assisted_plant(c: Column, a: Assist, gain: float, speed: float) -> control.StateSpace:
    """:func:`hands_fixed_plant` with boost and lead-lag closed, at a local gain of the boost curve [1]."""
    plant, K = hands_fixed_plant(c, a, speed), answer(a, gain, 0.0)
    T, request, n = plant.C[:1], plant.B[:, :1], K.nstates
    phi = np.block([[plant.A + request @ K.D @ T, request @ K.C], [K.B @ T, K.A]])
    gamma = np.vstack([plant.B, np.zeros((n, 3))])
    return control.ss(phi, gamma, np.hstack([plant.C, np.zeros((2, n))]), 0.0, SAMPLE_TIME)


def hands_fixed_loop(c: Column, a: Assist, gain: float, speed: float, slope: float = 0.0) -> control.StateSpace:
    """Open loop at the torsion-bar torque, handwheel held, friction sliding at constant torque.

    Parameters
    ----------
    c, a : parameters of column and assist
    gain : float
        Local gain of the boost curve [1].
    speed : float
        Vehicle speed, for what depends on it [m/s].
    slope : float
        Slope of the functions over the torsion bar's torque, without the lead-lag, which is in the loop [1].

    Returns
    -------
    control.StateSpace
        Discrete at 1 ms; negative feedback around it is the assist loop.
    """
    return -answer(a, gain, slope) * hands_fixed_plant(c, a, speed)[0, 0]  # (E6)


def slopes_of_functions(c: Column, a: Assist, low: float, high: float, speed: float) -> tuple[float, ...]:
    """Slopes of active return and friction compensation over torsion-bar torques from low to high [N m], as extremes.

    The return is at its saturation, and its fade at the torque where it is steepest. The friction compensation slides,
    or has its largest stiffness k: share k/K_tb is the slope of a spring at the column of negative stiffness (E16).
    """
    f = a.functions
    if not isinstance(f, Functions):
        return (0.0,)
    fade = active_return.slope(f.active_return, gain_at(f, f.active_return.gain, speed), low, high, speed)
    spring = gain_at(f, f.friction_compensation.gain, speed) * f.friction_compensation.stiffness / c.K_tb  # (E16)
    return tuple(sorted({-spring, 0.0, fade, fade - spring}))


def read(frequency: Array, L: NDArray[np.complex128], stable: bool = True) -> Margins:
    """Margins of a loop from its response (F,) at ascending frequencies (F,) [Hz].

    Those of a loop that is not stable are distances; its gain margin is below 1 where less boost would be stable.
    """
    phase = delay = gain = math.inf
    if not L.any():  # a set-valued law at rest holds the column
        return Margins(gain, phase, delay, 2.0, math.nan, stable)
    size, angle = np.log(np.abs(L)), np.angle(L)
    crossover = math.nan
    for i in np.flatnonzero(np.signbit(size[1:]) != np.signbit(size[:-1])):
        s = size[i] / (size[i] - size[i + 1])
        f = float(frequency[i] * (frequency[i + 1] / frequency[i]) ** s)
        turn = (angle[i + 1] - angle[i] + math.pi) % (2.0 * math.pi) - math.pi
        lag = (angle[i] + s * turn + math.pi) % (2.0 * math.pi)  # that may be added
        phase, delay = min(phase, lag, 2.0 * math.pi - lag), min(delay, lag / (2.0 * math.pi * f))
        crossover = f
    for i in np.flatnonzero(np.signbit(L.imag[1:]) != np.signbit(L.imag[:-1])):
        s = L.imag[i] / (L.imag[i] - L.imag[i + 1])
        real = L.real[i] + s * (L.real[i + 1] - L.real[i])
        # A stable loop that crosses beyond -1 has a margin to less gain, which is not the one read here.
        if real < 0.0 and not (stable and real <= -1.0):
            gain = min(gain, -1.0 / real)
    disk = 1.0 / np.abs(1.0 / (1.0 + L) - 0.5).max()  # (E18)
    return Margins(float(gain), float(phase), float(delay), float(disk), crossover, stable)


def _response(system: control.StateSpace, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Output over input at points z (F,), of a system with one of each."""
    inputs = np.broadcast_to(system.B, (z.size, *system.B.shape))
    states = np.linalg.solve(z[:, None, None] * np.eye(system.nstates) - system.A, inputs)
    return (system.C @ states + system.D)[:, 0, 0]  # type: ignore[no-any-return]


def of_slopes(c: Column, a: Assist, slopes: Iterable[tuple[float, float]], speed: float) -> list[Margins]:
    """Margins of :func:`hands_fixed_loop` at each pair of slopes, of boost and functions [1], at a speed [m/s].

    The plant is read once for all, and the answer to the torque, which is linear in the slope of the boost, at 0 and 1.
    """
    plant, none, one = hands_fixed_plant(c, a, speed)[0, 0], answer(a, 0.0, 0.0), answer(a, 1.0, 0.0)
    z = np.exp(2j * math.pi * FREQUENCIES * SAMPLE_TIME)
    P, others, lead = (_response(system, z) for system in (plant, none, one - none))
    loops, closed = [], []
    for boost, more in slopes:
        B, D = none.B + boost * (one.B - none.B), none.D + boost * (one.D - none.D) + more
        closed.append(np.block([[plant.A + plant.B @ D @ plant.C, plant.B @ one.C], [B @ plant.C, one.A]]))
        loops.append(-(others + boost * lead + more) * P)  # (E6)
    if not closed:
        return []
    stable = np.abs(np.linalg.eigvals(closed)).max(axis=1) < 1.0  # in one call: less than half the time
    return [read(FREQUENCIES, L, bool(holds)) for L, holds in zip(loops, stable)]


def margins(c: Column, a: Assist, gain: float, speed: float, slope: float = 0.0) -> Margins:
    """Margins of :func:`hands_fixed_loop`, whose parameters these are, and whether the closed loop is stable."""
    return of_slopes(c, a, [(gain, slope)], speed)[0]


def least(found: Sequence[Margins]) -> Margins:
    """The margins with the smallest phase margin, with the smallest of the others; stable where all are."""
    worst = min(found, key=lambda m: m.phase)
    gain, delay, disk = (min(getattr(m, name) for m in found) for name in ("gain", "delay", "disk"))
    return worst._replace(gain=gain, delay=delay, disk=disk, stable=all(m.stable for m in found))


def of_cells(c: Column, a: Assist, speed: float, transmissions: Sequence[float] = (1.0,)) -> list[Cell]:
    """The column's loop in every cell of the boost table that answers the torque at a speed [m/s].

    It is :func:`least` over the factors of (E25), which :func:`steer_env.friction.sites.transmissions` gives for a
    friction, and with functions of the assist over their slopes of :func:`slopes_of_functions`.
    """
    each = [_cells(c, transmitted(a, factor), speed) for factor in transmissions]
    return [
        Cell(cells[0].torque, boost_gain(a, cells[0].torque, speed), least([cell.margins for cell in cells]))
        for cells in zip(*each, strict=True)
    ]


def _cells(c: Column, a: Assist, speed: float) -> list[Cell]:
    cells, pairs = [], []
    for low, high in pairwise(a.torques.tolist()):
        torque = 0.5 * (high + low)
        slope = boost_gain(a, torque, speed)
        if slope > 1e-6 or isinstance(a.functions, Functions):  # the table is flat at its end
            own = [(slope, more) for more in slopes_of_functions(c, a, low, high, speed)]
            cells.append((torque, slope, len(own)))
            pairs += own
    found = iter(of_slopes(c, a, pairs, speed))  # all at once, as the plant is the same for all
    return [Cell(torque, slope, least(list(islice(found, count)))) for torque, slope, count in cells]


def worst_margins(c: Column, a: Assist, speed: float, transmissions: Sequence[float] = (1.0,)) -> Margins:
    """:func:`least` over :func:`of_cells` at a speed [m/s]; infinite for an assist that answers no torque."""
    cells = of_cells(c, a, speed, transmissions)
    return least([cell.margins for cell in cells]) if cells else Margins(*(math.inf,) * 3, 2.0, math.nan, True)
