"""Limit cycles of the assist loop by harmonic balance: what friction and the boost's end make of an unstable loop.

In a motion of the column x = A sin(omega t) around straight running, friction is its describing function N (F40) and
the boost, an odd curve of the torsion bar's torque, has the real one

    B(a) = 2/(pi a) int_0^pi boost(a sin phi) sin phi dphi                                         (E19)

The linear rest is the plant without boost and friction, P and Q the torque and the column angle over the request r and
the disturbance d of the rack (E17), K the filter of the boost. With x = A, d = N x/r_p in the middle of a sample,

    r = (x - Q_d d)/Q_r,   T = P_r r + P_d d,   r = K B(|T|) T                                      (E20)

are two real equations for A and omega. At complex omega the growth of a motion whose amplitude is a little larger tells
whether the cycle attracts. The filter behind the boost and the rest must pass little of the third harmonic.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import root

from steer_env.friction.describing_function import describing_function
from steer_env.vehicle import assist_loop, plant
from steer_env.vehicle.linearised import Point
from steer_env.vehicle.operating_point import held
from steer_env.vehicle.steering.eps import SAMPLE_TIME, Assist, boost_curve
from steer_env.vehicle.steering.margins import answer

Array = NDArray[np.float64]

AMPLITUDES = np.geomspace(1e-4, 0.5, 30)  # of the column, in which cycles are sought [rad]
FREQUENCIES = np.geomspace(2.0, 150.0, 80)  # [Hz]
_RATES = np.geomspace(1.5, 200.0, 6)  # frequencies between which the describing function is interpolated [Hz]
KICKS = 0.02, 0.1  # amplitudes from which cycles are sought in the simulation, assumed [rad]
THIRD, AGREES = 0.05, 0.1  # third harmonic below which a prediction counts, and how close it then is [1]
_LARGER = 1.02  # amplitude at which the growth is read, over that of the cycle, assumed [1]


class Cycle(NamedTuple):
    """A limit cycle that the harmonic balance predicts."""

    amplitude: float  # of the column angle [rad]
    frequency: float  # [Hz]
    attracts: bool  # whether a larger motion decays to it


class Motion(NamedTuple):
    """What the simulated column does at the end."""

    amplitude: float  # first harmonic of the column angle; 0 where it comes to rest [rad]
    frequency: float  # NaN at rest [Hz]
    third: float  # third harmonic of the column angle over the first [1]


class Compared(NamedTuple):
    """A predicted cycle beside the simulated motion; one of them may be missing."""

    predicted: Cycle | None
    simulated: Motion

    @property
    def sinusoidal(self) -> bool:
        """Whether the third harmonic is small enough for the harmonic balance."""
        return bool(self.simulated.third < THIRD)

    @property
    def agrees(self) -> bool:
        """Whether frequency and amplitude are those of the simulation, within 10 %."""
        c, m = self.predicted, self.simulated
        if c is None or not m.amplitude:
            return False
        return abs(c.amplitude / m.amplitude - 1.0) < AGREES and abs(c.frequency / m.frequency - 1.0) < AGREES


def boost_gain(a: Assist, amplitude: float, speed: float) -> float:
    """B of (E19) at an amplitude of the torsion bar's torque [N m] and a vehicle speed [m/s]."""
    phase = math.pi * (np.arange(200) + 0.5) / 200.0
    boost = np.array([boost_curve(a, amplitude * s, speed)[0] for s in np.sin(phase)])
    return float(2.0 * np.mean(boost * np.sin(phase)) / amplitude)  # (E19)


class _Balance:
    """The balance (E20) of one point as a function of amplitude and complex frequency."""

    def __init__(self, point: Point, law: Any) -> None:
        self.point, self.loop = point, assist_loop.open_loop(point)
        self.filter = answer(point.plant.assist, 1.0, 0.0)
        values = np.array([[describing_function(law, A, f).value for f in _RATES] for A in AMPLITUDES])
        over = np.log(AMPLITUDES), np.log(_RATES)
        self._friction = [RectBivariateSpline(*over, part * AMPLITUDES[:, None]) for part in (values.real, values.imag)]

    def friction(self, A: float, f: float) -> complex:
        """N [N m/rad]."""
        return complex(*(float(part(math.log(A), math.log(f))[0, 0]) / A for part in self._friction))

    def off(self, A: float, f: complex, responses: Any = None) -> complex:
        """One less K B T/r, which is zero in a cycle."""
        p = self.point.plant
        (P_r, P_d), (Q_r, Q_d) = self.loop.plant_response(np.array([f]))[0] if responses is None else responses
        z = np.exp(2j * math.pi * SAMPLE_TIME * f)
        d = self.friction(A, complex(f).real) * A / p.pinion_radius * np.sqrt(z)  # the mean of the coming sample
        r = (A - Q_d * d) / Q_r
        T = P_r * r + P_d * d
        return complex(1.0 - self.filter(z) * boost_gain(p.assist, abs(T), self.point.speed) * T / r)  # (E20)


def predict(point: Point, law: Any) -> list[Cycle]:
    """The limit cycles around straight running, by amplitude.

    Parameters
    ----------
    point : Point
        Straight running, with sliding friction, of :mod:`steer_env.vehicle.operating_point`.
    law : str or parameters
        The friction.
    """
    balance = _Balance(point, law)
    responses = balance.loop.plant_response(FREQUENCIES)
    off = np.array([[balance.off(A, f, own) for f, own in zip(FREQUENCIES, responses)] for A in AMPLITUDES])
    found = list[Cycle]()
    for i, j in np.ndindex(len(AMPLITUDES) - 1, len(FREQUENCIES) - 1):
        cell = off[i : i + 2, j : j + 2]
        if any(np.ptp(np.sign(part)) == 0.0 for part in (cell.real, cell.imag)):
            continue
        start = [math.log(AMPLITUDES[i] * AMPLITUDES[i + 1]) / 2.0, math.log(FREQUENCIES[j] * FREQUENCIES[j + 1]) / 2.0]

        def pair(y: Array) -> list[float]:
            value = balance.off(math.exp(y[0]), math.exp(y[1]))
            return [value.real, value.imag]

        solved = root(pair, start)
        A, f = np.exp(solved.x)
        known = any(abs(A / c.amplitude - 1.0) < 1e-3 and abs(f / c.frequency - 1.0) < 1e-3 for c in found)
        if solved.success and AMPLITUDES[0] < A < AMPLITUDES[-1] and not known:
            found.append(Cycle(float(A), float(f), _attracts(balance, float(A), float(f))))
    return sorted(found)


def _attracts(balance: _Balance, A: float, f: float) -> bool:
    """Whether a motion with a little larger amplitude decays: s = j 2 pi f with f complex has a negative real part."""

    def pair(y: Array) -> list[float]:
        value = balance.off(_LARGER * A, complex(y[0], y[1]))
        return [value.real, value.imag]

    return bool(root(pair, [f, 0.0]).x[1] > 0.0)


def simulate(point: Point, law: Any, amplitude: float, time: float = 20.0) -> Motion:
    """Start the column with an amplitude [rad], let it go, and read its motion over the last seconds.

    Parameters
    ----------
    point : Point
        As in :func:`predict`.
    law : str or parameters
    amplitude : float
        Of the column angle at the start, at rest [rad].
    time : float
        Of the simulation [s].
    """
    start = held(point, "on" if point.plant.robot else "off", law)
    p, state, n = start.plant, start.state.copy(), round(time / SAMPLE_TIME)
    state[plant.column.COLUMN_ANGLE] += amplitude
    record = np.zeros((n, len(plant.channels(p))))
    plant.run(p, state, np.tile(start.inputs, (n, 1)), record, 1)
    x = record[-min(n // 4, 4096) :, plant.CHANNEL["column_angle"]]
    return _read(x - x.mean())


def compare(point: Point, law: Any) -> list[Compared]:
    """Every attracting cycle that is predicted beside its simulation, then the simulated ones that are not predicted.

    Parameters are those of :func:`predict`. The simulation starts above each predicted cycle, and from ``KICKS``.
    """
    found = [Compared(c, simulate(point, law, 1.1 * c.amplitude)) for c in predict(point, law) if c.attracts]
    for kick in KICKS:
        motion = simulate(point, law, kick)
        if motion.amplitude and not any(_same(motion, each.simulated) for each in found):
            found.append(Compared(None, motion))
    return found


def _same(one: Motion, other: Motion) -> bool:
    return bool(other.amplitude) and abs(one.amplitude / other.amplitude - 1.0) < AGREES


def _read(x: Array) -> Motion:
    """First and third harmonic of a settled oscillation, over whole periods between its upward crossings."""
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    if up.size < 3 or np.abs(x).max() < 1e-6:
        return Motion(0.0, math.nan, math.nan)
    exact = up + x[up] / (x[up] - x[up + 1])
    period = (exact[-1] - exact[0]) / (up.size - 1)
    t = np.arange(math.ceil(exact[0]), math.floor(exact[-1]) + 1)
    waves = [np.exp(-2j * math.pi * k * t / period) for k in (1, 3)]
    first, third = (abs(2.0 * np.mean(x[t] * wave)) for wave in waves)
    return Motion(float(first), float(1.0 / (period * SAMPLE_TIME)), float(third / first))
