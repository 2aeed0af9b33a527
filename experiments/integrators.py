"""The column alone under a sine of hand torque, integrated four ways.

What a step scheme costs and how far off it is, for every law: the project's midpoint frame, explicit Euler and backward
Euler (kept here for comparison, not for use), and a reference by scipy at tight tolerance. A road spring on the column
lets the site slide and come back:

    T1 = A sin(2 pi f t),    T_C = -K_road th2
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import friction
from friction.kernel import kernel
from friction.law import advance, law_of, rate, torque
from friction.models.coulomb import Coulomb
from vehicle import column


class Case(NamedTuple):
    """One run of the column."""

    c: column.Column
    friction: Any  # parameters of a law
    amplitude: float  # of the hand torque [N m]
    frequency: float  # [Hz]
    duration: float  # [s]
    K_road: float = 20.0  # road spring at the column [N m/rad], assumed: about the default car's at 100 km/h


@kernel
def _sine(amplitude, omega, t):
    return amplitude * math.sin(omega * t)


@kernel
def midpoint(c, p, q, memory, amplitude, omega, K_road, h, T_F, w):
    """The project's frame; the road torque is extrapolated to the middle of the step, as the plant does it."""
    before = -K_road * q[column.COLUMN_ANGLE]
    for i in range(T_F.size):
        T1 = amplitude * (math.cos(omega * i * h) - math.cos(omega * (i + 1) * h)) / (omega * h)
        now = -K_road * q[column.COLUMN_ANGLE]
        _, w[i], T_F[i] = column.step_torque(c, p, 1.0, q, memory, T1, 1.5 * now - 0.5 * before, h)
        before = now


@kernel
def explicit_euler(c, p, q, memory, amplitude, omega, K_road, h, T_F, w):
    """Everything at the start of the step."""
    z_rate = np.zeros_like(memory)
    for i in range(T_F.size):
        th1, v1, th2, v2 = q[0], q[1], q[2], q[3]
        T_F[i] = torque(p, 1.0, memory, v2)
        w[i] = v2
        rate(p, 1.0, memory, v2, z_rate)
        bar = c.K_tb * (th1 - th2) + c.C_tb * (v1 - v2)
        q[0] = th1 + h * v1
        q[1] = v1 + h * (_sine(amplitude, omega, i * h) - c.C1 * v1 - bar) / c.I1
        q[2] = th2 + h * v2
        q[3] = v2 + h * (bar - c.C2 * v2 - K_road * th2 - T_F[i]) / c.I2
        for j in range(memory.size):
            memory[j] += h * z_rate[j]


@kernel
def _end_torque(p, memory, scratch, v, h):
    for j in range(memory.size):
        scratch[j] = memory[j]
    advance(p, 1.0, scratch, v, h)
    return torque(p, 1.0, scratch, v)


@kernel
def backward_euler(c, p, q, memory, amplitude, omega, K_road, h, T_F, w):
    """Mechanics at the end of the step; the memory follows its law exactly at that speed. Solved by bisection."""
    scratch = np.zeros_like(memory)
    K = c.C_tb + h * c.K_tb
    a11 = c.I1 / h + c.C1 + K
    S = c.I2 / h + c.C2 + K - K * K / a11 + h * K_road
    for i in range(T_F.size):
        twist = c.K_tb * (q[0] - q[2])
        r1 = c.I1 / h * q[1] + _sine(amplitude, omega, (i + 1) * h) - twist
        R = c.I2 / h * q[3] + twist - K_road * q[2] + K / a11 * r1
        rest = _end_torque(p, memory, scratch, 0.0, h)
        side = 1.0 if R > rest else -1.0
        low, high = 0.0, abs(R - rest) / S
        while side * (S * side * high + _end_torque(p, memory, scratch, side * high, h) - R) < 0.0:
            low, high = high, 2.0 * high
        while True:
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            if side * (S * side * middle + _end_torque(p, memory, scratch, side * middle, h) - R) < 0.0:
                low = middle
            else:
                high = middle
        v2 = side * low
        v1 = (r1 + K * v2) / a11
        T_F[i] = R - S * v2
        w[i] = v2
        advance(p, 1.0, memory, v2, h)
        q[0] += h * v1
        q[1] = v1
        q[2] += h * v2
        q[3] = v2


SCHEMES: dict[str, Callable] = {
    "midpoint": midpoint,
    "explicit Euler": explicit_euler,
    "backward Euler": backward_euler,
}


def integrate(case: Case, scheme: str, h: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Run a case with one of ``SCHEMES``.

    Returns
    -------
    T_F, w : (N,) arrays
        Friction torque [N m] and column speed [rad/s] of each step, from rest.
    """
    p = case.friction
    n = round(case.duration / h)
    T_F, w = np.empty(n), np.empty(n)
    omega = 2.0 * math.pi * case.frequency
    memory = np.zeros(law_of(p).memory_size(p))
    SCHEMES[scheme](case.c, p, np.zeros(4), memory, case.amplitude, omega, case.K_road, h, T_F, w)
    return T_F, w


def reference(case: Case, h: float, tolerance: float = 1e-10) -> NDArray[np.float64]:
    """Mean friction torque over steps of ``h``, (N,) [N m], by scipy's DOP853 on the plain differential equations.

    The impulse of the friction torque is integrated with the states, so its differences are exact means. Set-valued
    laws have no differential equation: for those the midpoint frame at a five-hundredth of the step stands in.
    """
    p, c = case.friction, case.c
    n = round(case.duration / h)
    if isinstance(p, Coulomb):
        fine, _ = integrate(case, "midpoint", h / 500)
        return fine.reshape(n, 500).mean(axis=1)
    size = law_of(p).memory_size(p)
    z_rate = np.zeros(size)
    omega = 2.0 * math.pi * case.frequency

    def derivative(t, x):
        th1, v1, th2, v2 = x[:4]
        memory = x[4 : 4 + size].copy()
        T_F = torque(p, 1.0, memory, v2)
        rate(p, 1.0, memory, v2, z_rate)
        bar = c.K_tb * (th1 - th2) + c.C_tb * (v1 - v2)
        a1 = (case.amplitude * math.sin(omega * t) - c.C1 * v1 - bar) / c.I1
        a2 = (bar - c.C2 * v2 - case.K_road * th2 - T_F) / c.I2
        return np.concatenate(([v1, a1, v2, a2], z_rate, [T_F]))

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


def twelve_cases(law: str) -> list[Case]:
    """Friction 0.3, 0.9, 3 N m x pre-sliding 0.05, 0.5 deg x 0.2, 2 Hz, two cycles each, for "lugre" or "masing".

    The pre-sliding distance is ``F_c/sigma_0`` for LuGre, with a damping ratio of 0.5 of the pre-sliding mode, and the
    length of the virgin curve for Masing. Half a newton metre is left to move the column.
    """
    c = column.make()
    cases = []
    for F_c in (0.3, 0.9, 3.0):
        for length in np.radians((0.05, 0.5)):
            for frequency in (0.2, 2.0):
                if law == "lugre":
                    stiffness = F_c / length
                    p = friction.make(law, F_c=F_c, sigma_0=stiffness, sigma_1=math.sqrt(stiffness * c.I2))
                else:
                    p = friction.make(law, F_c=F_c, x_c=length)
                cases.append(Case(c, p, F_c + 0.5, frequency, 2.0 / frequency))
    return cases


def relative_error(case: Case, h: float = 1e-3, scheme: str = "midpoint") -> float:
    """RMS error of the friction torque in units of its peak in the reference (the saturated torque)."""
    exact = reference(case, h)
    with np.errstate(over="ignore", invalid="ignore"):
        T_F, _ = integrate(case, scheme, h)
        return float(np.sqrt(np.mean((T_F - exact) ** 2)) / np.max(np.abs(exact)))


if __name__ == "__main__":
    for law in ("lugre", "masing"):
        for case in twelve_cases(law):
            print(f"{law:7s} A {case.amplitude:.1f} N m  {case.frequency:.1f} Hz  {100 * relative_error(case):.4f} %")
