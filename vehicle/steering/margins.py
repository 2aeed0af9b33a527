"""Stability margins of the assist loop, opened at the torsion-bar torque (E6).

The loop is the sampled loop of the plant: the mechanics with the lag of the motor between hold and sampler, the delay
in whole samples, motor damping and inertia compensation closed, and the boost curve replaced by its local gain. All
that answers the torsion bar's torque stands beside the boost: the lead-lag, and at their steepest the fade of the
active return and, as a spring of negative stiffness, the friction compensation (E16).
"""

import math
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from steer_env.vehicle.steering.assist import active_return
from steer_env.vehicle.steering.assist.first_order import FirstOrder
from steer_env.vehicle.steering.assist.functions import Functions, gain_at
from steer_env.vehicle.steering.column import Column
from steer_env.vehicle.steering.eps import SAMPLE_TIME, Assist, boost_curve

Array = NDArray[np.float64]

TARGETS = 30.0, 6.0  # usual lower limits of phase [deg] and gain [dB] margin of an assist loop; assumed


class Margins(NamedTuple):
    """Margins of one operating point; infinite where the loop has no such crossing."""

    phase: float  # [rad]
    gain: float  # factor [1]
    phase_crossover: float  # frequency of unit gain, where the phase margin is read [Hz]
    stable: bool  # the closed loop's poles lie inside the unit circle


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


def margins(c: Column, a: Assist, gain: float, speed: float, slope: float = 0.0) -> Margins:
    """Phase and gain margin of :func:`hands_fixed_loop`, and whether the closed loop is stable."""
    loop = hands_fixed_loop(c, a, gain, speed, slope)
    omega = np.geomspace(1.0, 0.999 * math.pi / SAMPLE_TIME, 2000)
    response = control.frequency_response(loop, omega)
    gain_margin, phase_margin, _, _, crossover, _ = control.stability_margins(response)  # (E6)
    closed = control.feedback(loop, 1)
    return Margins(
        math.radians(phase_margin),
        float(gain_margin),
        crossover / (2.0 * math.pi),
        bool(np.all(np.abs(closed.poles()) < 1.0)),
    )


def worst_margins(c: Column, a: Assist, speed: float) -> Margins:
    """Smallest phase and gain margin over the slopes of the boost curve at a speed [m/s].

    The results are those of :func:`margins` at every slope, but from one frequency response without functions of the
    assist, in a hundredth of the time. With functions each slope of the boost curve meets those of
    :func:`slopes_of_functions`. The loop counts as stable if it is stable at every slope. A loop without a crossing at
    any slope has infinite margins.
    """
    omega = np.geomspace(1.0, 0.999 * math.pi / SAMPLE_TIME, 1000)
    torques = list(pairwise(a.torques))
    slopes = [boost_gain(a, 0.5 * (high + low), speed) for low, high in torques]
    if isinstance(a.functions, Functions):
        cases = {
            (slope, more)
            for slope, (low, high) in zip(slopes, torques)
            for more in slopes_of_functions(c, a, low, high, speed)
        }
        found = [_read(hands_fixed_loop(c, a, slope, speed, more), omega, [1.0]) for slope, more in sorted(cases)]
    else:
        found = [_read(hands_fixed_loop(c, a, 1.0, speed), omega, [g for g in np.unique(slopes) if g > 0.0])]
    worst = min(found, key=lambda m: m.phase)
    return worst._replace(gain=min(m.gain for m in found), stable=all(m.stable for m in found))


def _read(loop: control.StateSpace, omega: Array, gains: list[float]) -> Margins:
    """Smallest margins of a loop at frequencies (N,) [rad/s], with a gain that takes each of some values."""
    A, B, C, D = loop.A, loop.B, loop.C, loop.D
    z = np.exp(1j * omega * SAMPLE_TIME)
    inverse = np.linalg.solve(z[:, None, None] * np.eye(len(A)) - A, np.broadcast_to(B, (z.size, *B.shape)))
    response = (C @ inverse + D)[:, 0, 0]
    size, angle = np.log(np.abs(response)), np.unwrap(np.angle(response))
    phase, crossover, gain = math.inf, math.nan, math.inf
    for each in gains:
        above = size + math.log(each)
        for i in np.flatnonzero(np.signbit(above[1:]) != np.signbit(above[:-1])):
            s = above[i] / (above[i] - above[i + 1])
            turned = angle[i] + s * (angle[i + 1] - angle[i])
            left = abs(math.remainder(turned + math.pi, 2.0 * math.pi))  # to -180 deg
            if left < phase:
                phase, crossover = left, float(omega[i] * (omega[i + 1] / omega[i]) ** s) / (2.0 * math.pi)
    imaginary = response.imag
    for i in np.flatnonzero(np.signbit(imaginary[1:]) != np.signbit(imaginary[:-1])) if gains else ():
        s = imaginary[i] / (imaginary[i] - imaginary[i + 1])
        real = response.real[i] + s * (response.real[i + 1] - response.real[i])
        if real < 0.0:
            gain = min(gain, -1.0 / (gains[-1] * real))
    poles = [np.abs(np.linalg.eigvals(A - each / (1.0 + each * D[0, 0]) * B @ C)).max() for each in gains]
    return Margins(phase, float(gain), crossover, all(pole < 1.0 for pole in poles))
