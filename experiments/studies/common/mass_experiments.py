"""The experiments of the LuGre paper: a mass of 1 kg on a friction force, by the project's own step equation.

Canudas de Wit, Olsson, Åström, Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425: table I and section III.
A mass is here what the column is elsewhere, so forces stand for torques [N] and displacements for angles [m]. Over a
step h with the mean speed w the mass, a spring k to the ground and a position controller give one scalar equation,

    (2/h + K_v + k h/2 + K_i h^2/4) w + mean F(w) = 2 v/h - k x - K_i (I + h e/2) + u,

with the integral I of the error e; the friction law solves it.
"""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from steer_env.experiments.studies.common.scaling import scale_record
from steer_env.friction import defaults, make
from steer_env.friction.law import advance, law_of, step, torque
from steer_env.friction.numerics.kernel import kernel

Array = NDArray[np.float64]

# Table I of the paper [N/m, N s/m, N s/m, N, N, m/s]. The set creates energy at some speeds.
PAPER = make("lugre", sigma_0=1e5, sigma_1=math.sqrt(1e5), sigma_2=0.4, F_c=1.0, F_s=1.5, v_s=1e-3, allow_active=True)

PRESLIDING_TIMES, PRESLIDING_FORCE = (0.0, 15.0, 20.0, 45.0, 50.0, 75.0), 1.425  # [s], [N]
LAG_SPEED = 1e-3  # speed of the lag experiment: LAG_SPEED (1.5 + cos omega t) [m/s]
LAG_OMEGAS = (1.0, 10.0, 25.0)  # [rad/s]
RATES = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # of the force [N/s]
SPRING_STIFFNESS, DRAWN_SPEED = 2.0, 0.1  # stick-slip: stiffness [N/m], speed of the free end [m/s]
K_V, K_P, K_I = 6.0, 3.0, 4.0  # position control [N s/m, N/m, N/(m s)]
SLIP_SPEED = 0.01  # speed that a slip passes [m/s]


class Motion(NamedTuple):
    """The mass over time, (T,) each: at the ends of the steps, but for the means over each step."""

    t: Array  # [s]
    x: Array  # position [m]
    w: Array  # mean speed [m/s]
    F: Array  # mean friction force [N]


@kernel
def _steps(p, memory, u, h, k, K_v, K_i, target, out):
    S = 2.0 / h + K_v + 0.5 * k * h + 0.25 * K_i * h * h
    x = v = w = integral = 0.0
    for i in range(u.size):
        error = x - target
        R = 2.0 * v / h - k * x - K_i * (integral + 0.5 * h * error) + u[i]
        w, F = step(p, 1.0, memory, S, R, h, w)
        x += h * w
        v = 2.0 * w - v
        integral += h * (error + 0.5 * h * w)
        out[i, 0], out[i, 1], out[i, 2] = x, w, F


def _memory(p: Any) -> Array:
    return np.zeros(law_of(p).memory_size(p))


def move(
    p: Any,
    duration: float,
    h: float,
    force: Callable[[Array], Array],
    *,
    stiffness: float = 0.0,
    K_v: float = 0.0,
    K_i: float = 0.0,
    target: float = 0.0,
) -> Motion:
    """The mass from rest under ``force(t)`` [N], at steps of ``h`` [s]."""
    n = round(duration / h)
    out = np.empty((n, 3))
    t: Array = h * np.arange(0.5, n)
    _steps(p, _memory(p), force(t), h, stiffness, K_v, K_i, target, out)
    return Motion(t + 0.5 * h, *out.T)


def presliding(p: Any, h: float = 2e-4) -> Motion:
    """A force that goes up, holds, comes back to the other side, holds and returns, all below break-away."""
    forces = PRESLIDING_FORCE * np.array([0.0, 1.0, 1.0, -1.0, -1.0, 1.0])
    return move(p, PRESLIDING_TIMES[-1], h, lambda t: np.interp(t, PRESLIDING_TIMES, forces))


@kernel
def _prescribed_motion(p, memory, middle, end, h, out):
    for i in range(middle.size):
        advance(p, 1.0, memory, middle[i], h)
        out[i] = torque(p, 1.0, memory, end[i])


class Lag(NamedTuple):
    """One settled cycle of the lag experiment, (T,) each, and the friction at 1.5 times ``LAG_SPEED``."""

    v: Array  # [m/s]
    F: Array  # [N]
    falling: float  # friction while the speed falls [N]
    rising: float  # friction while it rises [N]


def lag(p: Any, omega: float, n: int = 20_000) -> Lag:
    """Friction at a speed that varies around 1.5 times ``LAG_SPEED``, ``omega`` in rad/s, ``n`` steps in a cycle."""
    h = 2.0 * math.pi / omega / n
    steps = np.arange(2 * n)  # the first cycle settles
    middle, v = (LAG_SPEED * (1.5 + np.cos(omega * h * (steps + part))) for part in (0.5, 1.0))
    F = np.empty(2 * n)
    _prescribed_motion(p, _memory(p), middle, v, h, F)
    quarter = n + n // 4 - 1  # cos = 0
    return Lag(v[n:], F[n:], falling=float(F[quarter]), rising=float(F[quarter + n // 2]))


def steady(p: Any, v: float, duration: float = 10.0) -> float:
    """Friction after some time at one speed [N]."""
    memory = _memory(p)
    advance(p, 1.0, memory, v, duration)
    return float(torque(p, 1.0, memory, v))


def first_peak(t: Array, F: Array) -> tuple[float, float]:
    """Time and value of the first local maximum; the end where there is none."""
    falls = np.diff(F) < 0.0
    i = int(np.argmax(falls)) if falls.any() else F.size - 1
    return float(t[i]), float(F[i])


def ramp(p: Any, rate: float) -> Motion:
    """The mass under a force that grows at ``rate`` [N/s] until well after break-away."""
    return move(p, 1.6 / rate, 2e-4 / rate, lambda t: rate * t)


def break_away(p: Any, rate: float) -> tuple[float, float]:
    """Time and friction at break-away: the first local maximum of the friction force [s, N]."""
    motion = ramp(p, rate)
    return first_peak(motion.t, motion.F)


def stick_slip(p: Any, duration: float = 40.0, h: float = 5e-4) -> Motion:
    """A spring whose free end is drawn at a constant speed pulls the mass."""
    return move(p, duration, h, lambda t: SPRING_STIFFNESS * DRAWN_SPEED * t, stiffness=SPRING_STIFFNESS)


def hunting(p: Any, duration: float = 200.0, h: float = 1e-3) -> Motion:
    """Position control to a unit step: the integrator winds up in stick and the mass jumps past the target."""
    return move(p, duration, h, lambda t: np.full(t.size, K_P), stiffness=K_P, K_v=K_V, K_i=K_I, target=1.0)


def upward_crossings(t: Array, signal: Array, level: float) -> Array:
    """Samples at which a signal has risen to a level [s]."""
    return t[1:][(signal[:-1] < level) & (signal[1:] >= level)]


def reference(
    duration: float, force: Callable[[float], float], points: int, stiffness: float = 0.0
) -> tuple[Array, Array, Array]:
    """Times, speeds and friction of the paper's own differential equations, by scipy's LSODA at 1e-9.

    This is independent of the step equation: bristle, mass and force are one system of equations.
    """
    p = PAPER

    def slip(v: Any, z: Any) -> Any:
        return v - p.sigma_0 * abs(v) * z / (p.F_c + (p.F_s - p.F_c) * np.exp(-((v / p.v_s) ** 2)))

    def derivative(t: float, y: Array) -> list[float]:
        F = p.sigma_0 * y[2] + p.sigma_1 * slip(y[1], y[2]) + p.sigma_2 * y[1]
        return [y[1], force(t) - stiffness * y[0] - F, slip(y[1], y[2])]

    solution = solve_ivp(derivative, (0.0, duration), np.zeros(3), "LSODA", rtol=1e-9, atol=1e-13, dense_output=True)
    t = np.linspace(0.0, duration, points)
    _, v, z = solution.sol(t)
    return t, v, p.sigma_0 * z + p.sigma_1 * slip(v, z) + p.sigma_2 * v


def laws(names: Iterable[str], F: float = PAPER.F_c) -> dict[str, Any]:
    """Laws by name at the paper's scale: the car's calibration with a saturated force ``F`` and the paper's sigma_0.

    Where a law has other parameters of table I, it takes these values; LuGre becomes the paper's whatever ``F`` is.
    """
    distance = F / PAPER.sigma_0 / (defaults.F_C / defaults.SIGMA_0)
    found = {}
    for name in names:
        p = scale_record(make(name), F / defaults.F_C, distance)
        known = PAPER._asdict() if "F_s" in p._fields else {**PAPER._asdict(), "F_c": F}
        found[name] = p._replace(**{key: x for key, x in known.items() if key in p._fields})
    return found
