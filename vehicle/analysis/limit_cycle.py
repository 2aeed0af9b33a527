"""Limit cycles of the assist loop by harmonic balance: what friction and the boost's end make of an unstable loop.

In a motion of the column x = A sin(omega t) around straight running, friction is its describing function N (F40), and
the command of the assist the first harmonic of what the controller makes of a sinusoidal torque T and column speed w,

    q(T, w) = 2/period int limit(K boost(T sin) - D w sin) exp(-j omega t) dt                      (E19)

with the boost, the filter K behind it at every harmonic below half the sampling rate, motor damping D and the motor's
limit. The linear rest is the plant without them and friction, P, Q and W the torque, the column angle and the column
speed over the request r and the disturbance d of the rack (E17). With x = A, d = N x/r_p in the middle of a sample,

    r = (x - Q_d d)/Q_r,   T = P_r r + P_d d,   w = W_r r + W_d d,   r = q(T, w)                    (E20)

are two real equations for A and omega. At complex omega the growth of a motion whose amplitude is a little larger tells
whether the cycle attracts. The filter behind the boost and the rest must pass little of the third harmonic.
N is that of the friction below the torsion bar at its own level: that above it, which moves with free hands only, and
the growth of a gear's friction with the motor's torque are in the simulation alone.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import root

from steer_env import friction
from steer_env.friction import sites
from steer_env.friction.describing_function import describing_function
from steer_env.friction.numerics.frozen import frozen
from steer_env.vehicle import plant
from steer_env.vehicle.analysis import assist_loop
from steer_env.vehicle.analysis.linearised import Point
from steer_env.vehicle.analysis.operating_point import with_hands
from steer_env.vehicle.steering.by_wire import Wire
from steer_env.vehicle.steering.eps import SAMPLE_TIME, boost_curve
from steer_env.vehicle.steering.linear import answer

Array = NDArray[np.float64]

AMPLITUDES = np.geomspace(1e-4, 0.5, 30)  # of the column, in which cycles are sought [rad]
FREQUENCIES = np.geomspace(2.0, 150.0, 80)  # [Hz]
_RATES = np.geomspace(1.5, 200.0, 6)  # frequencies between which the describing function is interpolated [Hz]
KICKS = 0.02, 0.1  # amplitudes from which cycles are sought in the simulation, assumed [rad]
THIRD, AGREES = 0.05, 0.1  # third harmonic below which a prediction counts, and how close it then is [1]
_PHASE = 2.0 * math.pi * np.arange(256) / 256.0  # of a period
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


class _Balance:
    """The balance (E20) of one point as a function of amplitude and complex frequency."""

    def __init__(self, point: Point, law: Any) -> None:
        a = point.plant.assist
        undamped = frozen(point.plant._replace(assist=a._replace(damping=0.0 * a.damping)))
        self.point, self.loop = point, assist_loop.open_loop(point._replace(plant=undamped))
        self.damping = boost_curve(a, 0.0, point.speed)[1]
        self.boost = np.array([boost_curve(a, float(t), point.speed)[0] for t in a.torques])
        self.filter = answer(point.plant.assist, 1.0).state_space()
        below = sites.below(friction.resolve(law))
        values = np.array([[describing_function(below, A, f).value for f in _RATES] for A in AMPLITUDES])
        over = np.log(AMPLITUDES), np.log(_RATES)
        self._friction = [RectBivariateSpline(*over, part * AMPLITUDES[:, None]) for part in (values.real, values.imag)]

    def friction(self, A: float, f: float) -> complex:
        """N [N m/rad]."""
        return complex(*(float(part(math.log(A), math.log(f))[0, 0]) / A for part in self._friction))

    def off(self, A: float, f: complex, responses: Any = None) -> complex:
        """One less q/r, which is zero in a cycle."""
        p = self.point.plant
        (P_r, P_d), (Q_r, Q_d), (W_r, W_d) = (
            self.loop.plant_response(np.array([f]))[0] if responses is None else responses
        )
        z = np.exp(2j * math.pi * SAMPLE_TIME * f)
        d = self.friction(A, complex(f).real) * A / p.pinion_radius * np.sqrt(z)  # the mean of the coming sample
        r = (A - Q_d * d) / Q_r
        T, w = P_r * r + P_d * d, W_r * r + W_d * d
        return complex(1.0 - self.command(z, T, w) / r)  # (E20)

    def command(self, z: complex, T: complex, w: complex) -> complex:
        """q of (E19) for first harmonics of torque and column speed [N m]."""
        a = self.point.plant.assist
        torque = abs(T) * np.cos(_PHASE)
        boost = np.fft.rfft(np.sign(torque) * np.interp(np.abs(torque), a.torques, self.boost))
        n = min(int(math.pi / abs(np.angle(z))), _PHASE.size // 2)  # harmonics below half the sampling rate
        boost[1 : n + 1 : 2] *= self.filter(z ** np.arange(1, n + 1, 2))
        boost[n + 1 :] = 0.0
        asked = np.fft.irfft(boost) - self.damping * np.real(w / T * abs(T) * np.exp(1j * _PHASE))
        first = np.fft.rfft(np.clip(asked, -a.limit, a.limit))[1] * 2.0 / _PHASE.size
        return complex(first * T / abs(T))  # (E19)


def predict(point: Point, law: Any) -> list[Cycle]:
    """The limit cycles around straight running, by amplitude.

    Parameters
    ----------
    point : Point
        Straight running, with sliding friction, of :mod:`steer_env.vehicle.analysis.operating_point`.
    law : str, mapping or parameters
        The friction, in a form of :func:`steer_env.friction.resolve`. By wire no cycle is predicted.
    """
    if isinstance(point.plant.assist.wire, Wire):  # whose motor answers no torque of a torsion bar
        return []
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
    law : str, mapping or parameters
    amplitude : float
        Of the column angle at the start, at rest [rad].
    time : float
        Of the simulation [s].
    """
    start = with_hands(point, "on" if point.plant.robot else "off", law)
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
