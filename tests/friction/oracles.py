"""Closed forms of the friction laws: the error of the kernels against each, and its limit.

Work is summed from exact step means, so where a limit is 1e-11 or less only rounding contributes.
``python -m tests.maintain verify friction`` evaluates the errors.
"""

import math
from collections.abc import Callable, Iterable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.friction import law
from steer_env.friction.models.gms import level as gms_level
from steer_env.friction.models.lugre import saturation
from steer_env.friction.models.masing import Masing, virgin_torque
from steer_env.testing.histories import at_rest

Array = NDArray[np.float64]


class Oracle(NamedTuple):
    """One closed form."""

    what: str
    limit: float  # [unit]
    unit: str
    errors: Callable[[], Iterable[float]]  # errors of all cases [unit]


ORACLES: dict[str, Oracle] = {}


def _oracle(what: str, limit: float, unit: str) -> Callable[[Callable[[], Iterable[float]]], Any]:
    def register(errors: Callable[[], Iterable[float]]) -> Any:
        ORACLES[errors.__name__] = Oracle(what, limit, unit, errors)
        return errors

    return register


STRIBECK = friction.make("lugre", sigma_1=1.0, sigma_2=0.6, F_c=0.9, F_s=1.35, v_s=0.02)
# Not passive; it only serves the formula.
ACTIVE = friction.make("lugre", sigma_1=2.0, sigma_2=0.1, F_c=0.9, F_s=1.5, v_s=0.05, allow_active=True)
# Binary fractions, with which sums of displacements are exact, so that results must be equal to the bit.
DYADIC = friction.make("masing", k=[64.0, 32.0, 16.0, 8.0], y=[1 / 512, 1 / 256, 3 / 256, 1 / 32])
RATIOS = (0.1, 1.0, 10.0)  # amplitude over pre-sliding distance


def _cycle(p: Any, memory: Array, displacements: Array, speed: float) -> float:
    """Work over a closed path, advanced in place [J]."""
    work = 0.0
    for dx in displacements:
        w, h = math.copysign(speed, dx), abs(dx) / speed
        work += law.mean_torque(p, 1.0, memory, w, h)[0] * w * h
        law.advance(p, 1.0, memory, w, h)
    return work


def _settled_work(p: Any, memory: Array, displacements: Array, speed: float, ratio: float) -> float:
    """Work of a settled cycle [J]; the transient decays by exp(-4 ratio) in each cycle."""
    return [_cycle(p, memory, displacements, speed) for _ in range(1 + math.ceil(10.0 / ratio))][-1]


@_oracle("LuGre at constant speed from rest", 1e-12, "of the largest torque")
def lugre_constant_speed() -> Iterable[float]:
    """T = G sgn v (1 - e) + sigma_1 v e + sigma_2 v with e = exp(-sigma_0 |v| t/G)."""
    for p, v in product((friction.make("lugre"), STRIBECK, ACTIVE), (1e-3, -0.02, 0.5, -20.0)):
        G = p.F_c + (p.F_s - p.F_c) * math.exp(-((v / p.v_s) ** 2))
        dt = 0.05 * G / (p.sigma_0 * abs(v))
        t = dt * np.arange(200)
        e = np.exp(-p.sigma_0 * abs(v) * t / G)
        expected = G * math.copysign(1.0, v) * (1.0 - e) + p.sigma_1 * v * e + p.sigma_2 * v
        yield np.abs(friction.response(p, v * t, dt) - expected)[1:].max() / np.abs(expected).max()


@_oracle("LuGre triangle: tip z_g tanh(A/z_g) and work", 1e-12, "of tip, of largest work")
def lugre_triangle() -> Iterable[float]:
    """Work of a settled cycle: 4 (G (A - tip) + sigma_1 |v| tip + sigma_2 |v| A)."""
    for p, ratio, v in product((friction.make("lugre"), STRIBECK), RATIOS, (2e-3, 0.05, 1.0)):
        G = saturation(p, 1.0, v)[0]
        A, tip, memory = ratio * G / p.sigma_0, G / p.sigma_0 * math.tanh(ratio), at_rest(p)
        work = _settled_work(p, memory, np.repeat([A / 4.0, -A / 4.0], 8), v, ratio)
        yield abs(memory[0] / -tip - 1.0)
        expected = 4.0 * (G * (A - tip) + p.sigma_1 * v * tip + p.sigma_2 * v * A)
        # at small amplitudes the works of the branches cancel down to A^3: the error is relative to torque times path
        yield abs(work - expected) / (4.0 * A * (G + (p.sigma_1 + p.sigma_2) * v))


@_oracle("LuGre sliding, linearised", 1e-5, "of its branches")
def lugre_sliding_linearisation() -> Iterable[float]:
    """dF/dv = sigma_2 + (sigma_0 + sigma_1 j omega) (v g'/g)/(j omega + v/g)."""
    p = STRIBECK
    for v_0, pace in product((0.005, 0.02, 0.04), RATIOS):
        g, slope = (value / p.sigma_0 for value in saturation(p, 1.0, v_0))
        omega = pace * v_0 / g
        expected = p.sigma_2 + (p.sigma_0 + p.sigma_1 * 1j * omega) * (v_0 * slope / g) / (1j * omega + v_0 / g)
        n, ripple = 1000, 1e-4 * v_0
        h = 2.0 * math.pi / omega / n
        waves = np.exp(1j * omega * h * (np.arange(n) + 0.5))
        memory = np.array([g])
        for _ in range(2 + math.ceil(3.0 * pace)):  # transients decay as exp(-t v_0/g): 18 time constants
            F = []
            for wave in waves:
                w = v_0 + ripple * wave.real
                F.append(law.mean_torque(p, 1.0, memory, w, h)[0])
                law.advance(p, 1.0, memory, w, h)
        gain = 2.0 * np.mean(np.array(F) * waves.conj()) / ripple
        # constant speed in a step: (omega h)^2/24 = 2e-6; square of the ripple: 1e-8; both relative to the branches
        yield abs(gain - expected) / (abs(expected - p.sigma_2) + p.sigma_2)


@_oracle("Dahl, work of any waveform", 1e-11, "of largest work")
def dahl_work() -> Iterable[float]:
    """Work of a settled cycle: 4 F_c (A - z_c tanh(A/z_c))."""
    p = friction.make("dahl", sigma_0=100.0, F_c=0.9)
    z_c = p.F_c / p.sigma_0
    for ratio in RATIOS:
        A, rng = ratio * z_c, np.random.default_rng(3)
        up, down = (np.diff(np.r_[0.0, np.sort(rng.uniform(0.0, 2.0 * A, 30)), 2.0 * A]) for _ in range(2))
        work = _settled_work(p, at_rest(p), np.r_[up, -down], rng.uniform(0.01, 10.0), ratio)
        yield abs(work - 4.0 * p.F_c * (A - z_c * math.tanh(ratio))) / (4.0 * A * p.F_c)


@_oracle("Dahl's drift under a force cycle", 1e-13, "of the force")
def dahl_drift() -> Iterable[float]:
    """Drift in each cycle between the forces f_1 and f_2, in units of F_c: z_c ln[(1 - f_1^2)/(1 - f_2^2)]."""
    p, z_c = friction.make("dahl", sigma_0=100.0, F_c=0.9), 0.009
    for f_1, f_2 in ((-0.3, 0.8), (0.2, 0.9), (0.5, 0.6)):
        up = z_c * math.log((1.0 - f_1) / (1.0 - f_2))
        drift = z_c * math.log((1.0 - f_1**2) / (1.0 - f_2**2))
        start = z_c * math.log(1.0 / (1.0 - f_1)) if f_1 > 0.0 else -z_c * math.log(1.0 / (1.0 + f_1))
        f = friction.response(p, np.cumsum([0.0, start] + 5 * [up, drift - up]), 1e-3)[1:] / p.F_c
        yield from (np.abs(f[0::2] / f_1 - 1.0).max(), np.abs(f[1::2] / f_2 - 1.0).max())


@_oracle("Masing does not drift", 1e-15, "of the force")
def masing_drift() -> Iterable[float]:
    """A force cycle is a displacement cycle: the loop closes."""
    torque = friction.response("masing", [0.0] + 3 * [0.011, 0.004], 1e-3)[1:].reshape(-1, 2)
    yield np.abs(torque / torque[0] - 1.0).max()


@_oracle("Masing, branch after a reversal", 1e-15, "of F_c")
def masing_branch() -> Iterable[float]:
    """F = F_r - 2 f((x_r - x)/2), f the virgin curve."""
    p = friction.make("masing")
    for x_r, part in product((0.001, 0.006, 0.02, 0.1), np.linspace(-1.0, 1.0, 101)):
        expected = virgin_torque(p, x_r) - 2.0 * virgin_torque(p, 0.5 * x_r * (1.0 - part))
        yield abs(friction.response(p, [0.0, x_r, part * x_r], 1e-3)[-1] - expected) / 0.9


@_oracle("Masing, return points and wiping out", 0.0, "N m")
def masing_memory() -> Iterable[float]:
    """Every inner loop closes where it began; past its tip the torque continues as if there had been no loop."""

    def torque(path: list[int]) -> Array:
        return friction.response(DYADIC, np.array(path) / 1024, 1 / 1024)

    plain = torque([0, 20, -8, 20, 25])
    nested = torque([0, 20, -8, 10, 2, 7, 5, 7, 2, 10, -8, 20, 25])
    yield from np.abs(nested[[10, 9, 8, 7]] - nested[[2, 3, 4, 5]])
    yield from np.abs(nested[[2, 11, 12]] - plain[[2, 3, 4]])
    yield abs(plain[4] - virgin_torque(DYADIC, 25 / 1024))  # past the first tip the torque follows the virgin curve
    yield abs(torque([0, 3, -17, 5, 100, 90])[-1] - torque([0, -40, 100, 90])[-1])  # saturation wipes out all memory


def masing_loop_work(p: Masing, A: float) -> float:
    """Work of a settled cycle between ``-A`` and ``A`` [J], exact as the torque is straight between these vertices."""
    up = np.unique(np.r_[-A, np.minimum(-A + 2.0 * p.y, A), A])
    x = np.r_[0.0, A, -up, up]
    return float(np.trapezoid(friction.response(p, x, 1e-3)[1:], x[1:]))


@_oracle("Masing, work of a cycle, two closed forms", 1e-15, "of 4 A f(A)")
def masing_work() -> Iterable[float]:
    """8 int_0^A f - 4 A f(A) = 4 sum k_i y_i (A - y_i)+."""
    sets = (friction.make("masing"), DYADIC, friction.make("masing", k=[50.0], y=[0.003]))
    for p, A in product(sets, (0.0005, 0.004, 0.012, 0.05)):
        f, area = virgin_torque(p, A), np.sum(p.k * np.where(A < p.y, 0.5 * A**2, p.y * (A - 0.5 * p.y)))
        work = masing_loop_work(p, A)
        for form in (8.0 * area - 4.0 * A * f, 4.0 * np.sum(p.k * p.y * np.maximum(A - p.y, 0.0))):
            yield abs(work - form) / (4.0 * A * f)


def exponential(x_c: float, x: Array) -> Masing:
    """A Masing law with many elements on ``1 - exp(-x/x_c)``, with knots at ``x``."""
    slopes = np.diff(-np.expm1(-x / x_c), prepend=0.0) / np.diff(x, prepend=0.0)
    return Masing(slopes - np.append(slopes[1:], 0.0), x, 0.0)


@_oracle("Dahl's work over Masing's, 2.011, 2.255, 1.106", 5.1e-4, "")
def work_ratio() -> Iterable[float]:
    """At A/z_c = 0.0115, 1.146, 11.46 on one virgin curve, to the printed digits; the chords leave 1/2000^2."""
    for ratio, expected in ((0.0115, 2.011), (1.146, 2.255), (11.46, 1.106)):
        masing = masing_loop_work(exponential(1.0, np.linspace(0.0, ratio, 2001)[1:]), ratio)
        yield abs(4.0 * (ratio - math.tanh(ratio)) / masing - expected)


@_oracle("GMS slip after a change of speed", 1e-12, "of the level")
def gms_slip() -> Iterable[float]:
    """F_i = a s_2 + a (s_1 - s_2) exp(-C t/s_2), after a slide at v_1 that has settled."""
    p = friction.make("gms", F_s=1.6, v_s=0.5, C=5.0)
    for v_1, v_2 in ((0.1, 0.6), (0.6, 0.4), (-0.2, -3.0)):
        (s_1, _), (s_2, _) = gms_level(p, 1.0, v_1), gms_level(p, 1.0, v_2)
        memory = at_rest(p)
        law.advance(p, 1.0, memory, v_1, 1e3)
        for _ in range(50):
            law.advance(p, 1.0, memory, v_2, 0.01)
            s_1 = s_2 + (s_1 - s_2) * math.exp(-p.C * 0.01 / s_2)
            expected = math.copysign(1.0, v_2) * p.alpha * s_1
            yield float(np.abs(memory[: p.k.size] - expected).max()) / s_2


@_oracle("GMS without Stribeck effect is Masing", 1e-14, "of F_c")
def gms_masing() -> Iterable[float]:
    """With F_s = F_c and no change of the level, every element is a spring with a slider."""
    x = np.cumsum(np.random.default_rng(4).normal(0.0, 2e-3, 2000))
    yield np.abs(friction.response(friction.make("gms", F_s=0.9), x, 1e-3) - friction.response("masing", x, 1e-3)).max()


@_oracle("Exponential spring with a Maxwell branch at constant speed", 1e-12, "of the largest torque")
def exponential_spring_constant_speed() -> Iterable[float]:
    """T = F_c sgn v (1 - exp(-sigma_0 |v| t/F_c)) + k_m v tau_m (1 - exp(-t/tau_m))."""
    p = friction.make("exponential_spring", k_m=200.0, tau_m=0.05)
    for v in (1e-3, -0.02, 0.5):
        t = 1e-3 * np.arange(1000)
        expected = p.F_c * math.copysign(1.0, v) * -np.expm1(-p.sigma_0 * abs(v) * t / p.F_c)
        expected += p.k_m * v * p.tau_m * -np.expm1(-t / p.tau_m)
        yield np.abs(friction.response(p, v * t, 1e-3) - expected).max() / np.abs(expected).max()


@_oracle("Coulomb oscillator, 2 F_c/k a half cycle", 2e-6, "rad")
def coulomb_oscillator() -> Iterable[float]:
    """The amplitude falls until |x| <= F_c/k, where the mass sticks.

    A step across a turning point covers at most a h^2/2 = 4e-7 rad.
    """
    m, k, F, x_0, h = 0.05, 8.0, 0.1, 0.51, 1e-4
    p, memory = friction.make("coulomb", F_c=F), np.zeros(0)
    x, v, w, last, turns = x_0, 0.0, 0.0, 0.0, 0
    yield 0.0
    for _ in range(60_000):
        w, _ = law.step(p, 1.0, memory, 2.0 * m / h + 0.5 * k * h, 2.0 * m * v / h - k * x, h, w)
        x, v = x + h * w, (2.0 * w - v if w else 0.0)  # a stuck step ends at rest
        if w * last < 0.0 or (w == 0.0 and last != 0.0):
            turns += 1
            yield abs(x - (-1) ** turns * (x_0 - turns * 2.0 * F / k))
        last = w
    yield math.inf if (turns, w) != (20, 0.0) else 0.0


@_oracle("Elasto-plastic, loading: logistic beyond break-away", 1e-13, "of F_c")
def elasto_plastic_loading() -> Iterable[float]:
    """x = z up to z_ba, then z_ba + z_c b/(z_c + b) ln[(z + b) b/((z_c - z) z_c)], b = z_c - z_ba."""
    p = friction.make("elasto_plastic", sigma_1=0.0, F_ba=0.6)
    z_c, z_ba = p.F_c / p.sigma_0, p.F_ba / p.sigma_0
    b = z_c - z_ba
    z = np.linspace(0.0, 0.999, 50) * z_c
    x = np.where(z <= z_ba, z, z_ba + z_c * b / (z_c + b) * np.log((z + b) * b / ((z_c - z) * z_c)))
    for steps in (x, x[[0, -1]]):
        yield np.abs(friction.response(p, steps, 1e-3) - p.sigma_0 * np.interp(steps, x, z)).max() / p.F_c


@_oracle("Elasto-plastic does not drift below break-away", 1e-15, "of F_c")
def elasto_plastic_drift() -> Iterable[float]:
    """T = sigma_0 x, whatever the path."""
    p = friction.make("elasto_plastic", sigma_1=0.0)
    x = np.r_[0.0, np.random.default_rng(4).uniform(-1.0, 1.0, 200) * p.F_ba / p.sigma_0]
    yield np.abs(friction.response(p, x, 1e-3) - p.sigma_0 * x).max() / p.F_c


@_oracle("Bouc-Wen, loading with n = 1 and n = 2", 1e-9, "of F_c")
def bouc_wen_loading() -> Iterable[float]:
    """A/(b+g) (1 - exp(-(b+g) x)) and sqrt(A/c) tanh(sqrt(A c) x), c = b + g, in the parameters of the law."""
    x = np.linspace(0.0, 0.1, 40)
    for n, curve in ((1.0, lambda u: -np.expm1(-u)), (2.0, np.tanh)):
        p = friction.make("bouc_wen", n=n, F_c=0.7)
        yield np.abs(friction.response(p, x, 1e-3) / p.F_c - curve(p.sigma_0 / p.F_c * x)).max()


@_oracle("Bouc-Wen with n = 1 and beta = 1 is Dahl", 1e-8, "of F_c")
def bouc_wen_dahl() -> Iterable[float]:
    """On a random path."""
    x = np.cumsum(np.random.default_rng(6).normal(0.0, 4e-3, 300))
    yield np.abs(
        friction.response(friction.make("bouc_wen", n=1.0, beta=1.0), x, 1e-3) - friction.response("dahl", x, 1e-3)
    ).max()
