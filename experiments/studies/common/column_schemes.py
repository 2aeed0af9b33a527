"""The column alone under a sine of hand torque, by three schemes and a reference.

The schemes are the project's midpoint scheme, and explicit and backward Euler, with which it is compared. The
reference is scipy's integration at a tight tolerance. A road spring on the column lets the friction site slide and come
back:

    T1 = A sin(2 pi f t),    T_C = -K_road th2
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from steer_env.experiments.studies.friction_laws import set_valued
from steer_env.friction import sites
from steer_env.friction.law import advance, law_of, rate, torque
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.steering import column

SMALLEST = math.ulp(0.0)  # speed next to zero [rad/s]


class Case(NamedTuple):
    """One run of the column."""

    c: column.Column
    friction: Any  # parameters of a law
    amplitude: float  # of the hand torque [N m]
    frequency: float  # [Hz]
    duration: float  # [s]
    K_road: float = 20.0  # road spring at the column [N m/rad], assumed: about the default car's at 100 km/h


def default_case(p: Any) -> Case:
    """Column of the default car with a law; one cycle of the hand torque passes through every regime."""
    return Case(column.make(), p, amplitude=2.5, frequency=0.5, duration=4.0)


@kernel
def midpoint_step(c, p, q, memory, work, T1, K_road, h):
    """The project's midpoint scheme; as in the plant, the road torque is extrapolated to the middle of the step."""
    now = -K_road * q[column.COLUMN_ANGLE]
    _, w, T_F = column.step_torque(c, p, 1.0, q, memory, T1, 1.5 * now - 0.5 * work[0], h)
    work[0] = now
    return T_F, w


@kernel
def explicit_euler_step(c, p, q, memory, work, T1, K_road, h):
    """Explicit Euler: all torques are those at the start of the step."""
    th1, v1, th2, v2 = q[0], q[1], q[2], q[3]
    T_F = torque(p, 1.0, memory, v2)
    rate(p, 1.0, memory, v2, work)
    bar = c.K_tb * (th1 - th2) + c.C_tb * (v1 - v2)
    q[0] = th1 + h * v1
    q[1] = v1 + h * (T1 - c.C1 * v1 - bar) / c.I1
    q[2] = th2 + h * v2
    q[3] = v2 + h * (bar - c.C2 * v2 - K_road * th2 - T_F) / c.I2
    for j in range(memory.size):
        memory[j] += h * work[j]
    return T_F, v2


@kernel
def _end_torque(p, memory, work, v, h):
    for j in range(memory.size):
        work[j] = memory[j]
    advance(p, 1.0, work, v, h)
    return torque(p, 1.0, work, v)


@kernel
def backward_euler_step(c, p, q, memory, work, T1, K_road, h):
    """Backward Euler, solved by bisection: the mechanics are those at the end of the step.

    The memory follows its law exactly at that speed.
    """
    K = c.C_tb + h * c.K_tb
    a11 = c.I1 / h + c.C1 + K
    S = c.I2 / h + c.C2 + K - K * K / a11 + h * K_road
    torsion_bar_torque = c.K_tb * (q[0] - q[2])
    r1 = c.I1 / h * q[1] + T1 - torsion_bar_torque
    R = c.I2 / h * q[3] + torsion_bar_torque - K_road * q[2] + K / a11 * r1
    rest = _end_torque(p, memory, work, 0.0, h)
    side = 1.0 if R > rest else -1.0
    low, high = 0.0, abs(R - rest) / S
    if side * (_end_torque(p, memory, work, side * SMALLEST, h) - R) >= 0.0:
        high = 0.0  # a set-valued law sticks: the bisection would halve a thousand times to find it
    while high > 0.0 and side * (S * side * high + _end_torque(p, memory, work, side * high, h) - R) < 0.0:
        low, high = high, 2.0 * high
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if side * (S * side * middle + _end_torque(p, memory, work, side * middle, h) - R) < 0.0:
            low = middle
        else:
            high = middle
    v2 = side * low
    v1 = (r1 + K * v2) / a11
    advance(p, 1.0, memory, v2, h)
    q[0] += h * v1
    q[1] = v1
    q[2] += h * v2
    q[3] = v2
    return R - S * v2, v2


# Compiled code takes no function as an argument, so every scheme has its own loop over the steps.


@kernel
def midpoint(c, p, q, memory, work, T1, K_road, h, T_F, w):
    """The midpoint scheme over a hand torque for each step; friction torque and speed go to ``T_F`` and ``w``."""
    for i in range(T_F.size):
        T_F[i], w[i] = midpoint_step(c, p, q, memory, work, T1[i], K_road, h)


@kernel
def explicit_euler(c, p, q, memory, work, T1, K_road, h, T_F, w):
    """Explicit Euler, as :func:`midpoint`."""
    for i in range(T_F.size):
        T_F[i], w[i] = explicit_euler_step(c, p, q, memory, work, T1[i], K_road, h)


@kernel
def backward_euler(c, p, q, memory, work, T1, K_road, h, T_F, w):
    """Backward Euler, as :func:`midpoint`."""
    for i in range(T_F.size):
        T_F[i], w[i] = backward_euler_step(c, p, q, memory, work, T1[i], K_road, h)


class Scheme(NamedTuple):
    """Kernels of a scheme, and the hand torque that it takes for each step."""

    step: Any  # kernel of one step -> T_F, w
    loop: Any  # kernel over all steps
    hand: Callable[[NDArray, float], NDArray]  # instants, omega -> torque of each step at unit amplitude


SCHEMES = {
    "midpoint": Scheme(midpoint_step, midpoint, lambda t, omega: -np.diff(np.cos(omega * t)) / (omega * np.diff(t))),
    "explicit Euler": Scheme(explicit_euler_step, explicit_euler, lambda t, omega: np.sin(omega * t[:-1])),
    "backward Euler": Scheme(backward_euler_step, backward_euler, lambda t, omega: np.sin(omega * t[1:])),
}


def arguments(case: Case, scheme: str, h: float) -> tuple[Any, ...]:
    """Arguments of a scheme's loop at rest, without the results; its step kernel takes a single hand torque."""
    t = h * np.arange(round(case.duration / h) + 1)
    T1 = case.amplitude * SCHEMES[scheme].hand(t, 2.0 * math.pi * case.frequency)
    size = law_of(case.friction).memory_size(case.friction)
    return case.c, sites.bound(case.friction), np.zeros(4), np.zeros(size), np.zeros(max(size, 1)), T1, case.K_road, h


def integrate(case: Case, scheme: str, h: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Run a case with one of ``SCHEMES``.

    Returns
    -------
    T_F, w : (N,) arrays
        Friction torque [N m] and column speed [rad/s] of each step, from rest.
    """
    start = arguments(case, scheme, h)
    T_F, w = np.empty_like(start[5]), np.empty_like(start[5])
    SCHEMES[scheme].loop(*start, T_F, w)
    return T_F, w


def reference(case: Case, h: float, tolerance: float = 1e-10) -> NDArray[np.float64]:
    """Mean friction torque over steps of ``h``, (N,) [N m], by scipy's DOP853 on the plain differential equations.

    The impulse of the friction torque is integrated with the states, so its differences are exact means. A law that
    is set-valued or has modes, such as stick and slip, has no differential equation: its reference is the midpoint
    scheme at 2 us, or at a fifth of the step.
    """
    p, c = case.friction, case.c
    n = round(case.duration / h)
    if set_valued(p) or law_of(p).modes(p):
        parts = max(round(h / 2e-6), 5)
        fine, _ = integrate(case, "midpoint", h / parts)
        return fine.reshape(n, parts).mean(axis=1)
    law, size = law_of(p), law_of(p).memory_size(p)
    omega = 2.0 * math.pi * case.frequency

    def derivative(t: float, x: NDArray) -> NDArray:
        th1, v1, th2, v2 = x[:4].tolist()  # numbers of Python are quicker than numpy's
        memory, change = x[4 : 4 + size].copy(), np.zeros(x.size)
        T_F = law.torque(p, 1.0, memory, v2)
        law.rate(p, 1.0, memory, v2, change[4 : 4 + size])
        bar = c.K_tb * (th1 - th2) + c.C_tb * (v1 - v2)
        a1 = (case.amplitude * math.sin(omega * t) - c.C1 * v1 - bar) / c.I1
        a2 = (bar - c.C2 * v2 - case.K_road * th2 - T_F) / c.I2
        change[:4], change[-1] = (v1, a1, v2, a2), T_F
        return change

    nodes = np.linspace(0.0, n * h, n + 1)
    solution = solve_ivp(
        derivative,
        (0.0, nodes[-1]),
        np.zeros(5 + size),
        method="DOP853",
        t_eval=nodes,
        rtol=tolerance,
        atol=tolerance * 1e-2,
    )
    return np.diff(solution.y[-1]) / h
