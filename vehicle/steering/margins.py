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
from collections.abc import Sequence
from itertools import islice, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.frozen import frozen
from steer_env.vehicle.steering import by_wire, linear, wire_loops
from steer_env.vehicle.steering.assist import active_return
from steer_env.vehicle.steering.assist.functions import Functions, gain_at
from steer_env.vehicle.steering.column import Column
from steer_env.vehicle.steering.eps import SAMPLE_TIME, Assist, boost_curve

if TYPE_CHECKING:
    import control

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
    wire = by_wire.transmitted(a.wire, factor)
    if isinstance(f, Functions):
        of_return = f.active_return
        f = f._replace(
            active_return=of_return._replace(gain=factor * of_return.gain, saturation=factor * of_return.saturation),
            damping=f.damping._replace(gain=factor * f.damping.gain),
            inertia_compensation=f.inertia_compensation._replace(gain=factor * f.inertia_compensation.gain),
            lead_lag=f.lead_lag._replace(gain=factor * f.lead_lag.gain),
            friction_compensation=f.friction_compensation._replace(gain=0.0 * f.friction_compensation.gain),
        )
    return frozen(a._replace(boost=factor * a.boost, damping=factor * a.damping, functions=f, wire=wire))  # (E25)


def boost_gain(a: Assist, torque: float, speed: float) -> float:
    """Local slope of the boost curve [1] at a torsion-bar torque [N m] and a vehicle speed [m/s]."""
    step = 1e-6
    return (boost_curve(a, torque + step, speed)[0] - boost_curve(a, torque - step, speed)[0]) / (2.0 * step)


def hands_fixed_loop(c: Column, a: Assist, gain: float, speed: float, slope: float = 0.0) -> "control.StateSpace":
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
    plant = linear.plant(c, a, speed).state_space()
    return -linear.answer(a, gain, slope).state_space() * plant["torsion_bar_torque", "request"]  # (E6)


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


def of_slopes(c: Column, a: Assist, slopes: Sequence[tuple[float, float]], speed: float) -> list[Margins]:
    """Margins of :func:`hands_fixed_loop` at each pair of slopes, of boost and functions [1], at a speed [m/s].

    The plant is read once for all, and the answer to the torque, which is linear in the slope of the boost, at 0 and 1.
    """
    if not slopes:
        return []
    plant, z = linear.plant(c, a, speed), np.exp(2j * math.pi * FREQUENCIES * SAMPLE_TIME)
    P, none, one = (linear.response(each, z) for each in (plant, linear.answer(a, 0.0), linear.answer(a, 1.0)))
    boosts, others = np.transpose(slopes)
    stable = np.abs(linear.poles(plant, a, boosts, others)).max(axis=1) < 1.0
    loops = [-(none + boost * (one - none) + other) * P for boost, other in slopes]  # (E6)
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
    friction, and with functions of the assist over their slopes of :func:`slopes_of_functions`. By wire a cell is one
    of the feel's map, whose slope is in N m/rad, and each has the margins of the rack's loop, too (W8), (W9).
    """
    if isinstance(a.wire, by_wire.Wire):
        return _cells_by_wire(c, a, speed, transmissions)
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


def _cells_by_wire(c: Column, a: Assist, speed: float, transmissions: Sequence[float]) -> list[Cell]:
    z = np.exp(2j * math.pi * FREQUENCIES * SAMPLE_TIME)

    def margins(loop: wire_loops.Loop) -> Margins:
        return read(FREQUENCIES, loop.response(z), bool(np.abs(loop.poles()).max() <= wire_loops.STABLE))

    of_rack = [margins(wire_loops.position_loop(c, transmitted(a, factor))) for factor in transmissions]
    return [
        Cell(torque, slope, least([*of_rack, *map(margins, wire_loops.feel_loops(c, a.wire, slope, speed))]))
        for torque, slope in wire_loops.slopes(a.wire, speed)
    ]


def worst_margins(c: Column, a: Assist, speed: float, transmissions: Sequence[float] = (1.0,)) -> Margins:
    """:func:`least` over :func:`of_cells` at a speed [m/s]; infinite for an assist that answers no torque."""
    cells = of_cells(c, a, speed, transmissions)
    return least([cell.margins for cell in cells]) if cells else Margins(*(math.inf,) * 3, 2.0, math.nan, True)
