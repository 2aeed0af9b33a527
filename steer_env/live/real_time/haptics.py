"""Whether a force-feedback wheel on the loop is stable: how long its delay may be, or how much torque it may give.

A person's wheel with inertia J and damping b feels the torsion bar's torque, which follows its angle through the plant
and a delay. What the plant answers to a sine of the angle, G(jω) [N m/rad], is taken from the plant itself with its
friction, assist and tyres, at several amplitudes, since friction makes small motions stiffer. With a delay tau the
wheel oscillates at the limit of stability where

    J s^2 + b s + G(s) e^(-s tau) = 0,  s = jω

A column that stands still would give G = K_tb, and for a light wheel the limit b / K_tb. Hands only add damping.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.live.real_time.angle_filter import response
from steer_env.live.real_time.model import make_model, step
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Subsystem

# From the angle, which is up to a sample old, to the torque, which holds for a sample [s].
OWN_DELAY = 1.5 * SAMPLE_TIME
AMPLITUDES = (0.003, 0.01, 0.03, 0.1)  # of the angle [rad]
FREQUENCIES = np.geomspace(0.5, 100.0, 40)  # [Hz]
MARGIN = 0.8  # of the torque that oscillates with the delay of the wheel, the share that it may give; assumed
_FINE_GRID_SIZE = 10_000  # frequencies between which a crossing is sought
_LEAST_TIME, _LEAST_CYCLES = 1.0, 6  # of a sine [s]; the second half of it counts


class Wheel(NamedTuple):
    """A force-feedback wheel."""

    inertia: float  # of rim and motor [kg m2]
    damping: float  # of motor and bearings [N m s/rad]
    delay: float  # from the angle of the rim to the loop, and from the loop to the torque at the rim, together [s]


class Stability(NamedTuple):
    """What a wheel may do."""

    longest_delay: float  # of the wheel, beside the loop's own; infinite where every delay is stable [s]
    frequency: float  # at which it oscillates beyond that; NaN where it never does [Hz]
    share: float  # of the torsion bar's torque that it may give with its delay: MARGIN of what oscillates, at most 1


def make(inertia: float, damping: float, delay: float) -> Wheel:
    """A wheel.

    Raises
    ------
    ValueError
        A number outside its range.
    """
    return Wheel(
        number("inertia of the wheel [kg m2]", inertia, minimum=0.001, maximum=1.0),
        number("damping of the wheel [N m s/rad]", damping, minimum=0.0, above=True, maximum=100.0),
        number("delay of the wheel [s]", delay, minimum=0.0, maximum=0.2),
    )


@kernel
def _sine(model, angle, speed, omega, amplitude, torque):
    """Turn the handwheel by a sine and note the torsion bar's torque after each sample."""
    for i in range(torque.size):
        t = (i + 1) * SAMPLE_TIME
        model.given[angle] = amplitude * math.sin(omega * t)
        model.given[speed] = amplitude * omega * math.cos(omega * t)
        step(model, 1)
        torque[i] = model.outputs[0, model.torque]


def driving_stiffness(subsystem: Subsystem, amplitude: float) -> NDArray[np.complex128]:
    """What the plant answers to a sine of the handwheel angle at ``FREQUENCIES``: (F,) [N m/rad].

    Parameters
    ----------
    subsystem : Subsystem
        The car, with ``robot=True``.
    amplitude : float
        Of the angle [rad].

    Raises
    ------
    ValueError
        Another subsystem, or hands that give a torque.
    """
    if subsystem.name != "car" or not subsystem.parameters.robot:
        raise ValueError("the stability of a wheel is that of the subsystem car, with hands that give the angle")
    names = [signal.name for signal in subsystem.given]
    places = names.index("hand_angle"), names.index("hand_speed")
    answers = []
    for frequency in FREQUENCIES:
        omega = 2.0 * math.pi * frequency
        cycles = max(_LEAST_CYCLES, math.ceil(_LEAST_TIME * frequency))
        torque = np.zeros(round(cycles / frequency / SAMPLE_TIME))
        bind(_sine, *(arguments := (make_model(subsystem), *places, omega, amplitude, torque)))(*arguments)
        t = SAMPLE_TIME * np.arange(1, torque.size + 1)[torque.size // 2 :]
        shapes = np.column_stack([np.sin(omega * t), np.cos(omega * t), np.ones(t.size)])
        real, imaginary, _ = np.linalg.lstsq(shapes, torque[torque.size // 2 :], rcond=None)[0]
        answers.append((real + 1j * imaginary) / amplitude)
    return np.array(answers)


def longest_delay(wheel: Wheel, stiffness: NDArray[np.complex128]) -> tuple[float, float]:
    """The longest delay of the whole loop [s] and the frequency [Hz] of the oscillation at it; (inf, NaN) for none.

    ``stiffness`` (F,) is that at ``FREQUENCIES``; below and above them it is taken as at the first and the last. The
    wheel begins to oscillate where its own stiffness outgrows that of the plant. A plant that lags by more than the
    wheel there is unstable without any delay.
    """
    known, answer = 2.0 * math.pi * FREQUENCIES, np.abs(stiffness)
    if not answer.any():
        return math.inf, math.nan
    # Beyond these the wheel's own stiffness is surely below, and above, that of the plant.
    low = min(known[0], 0.5 * answer[0] / wheel.damping, math.sqrt(0.5 * answer[0] / wheel.inertia))
    high = max(known[-1], 1.1 * math.sqrt(answer.max() / wheel.inertia))
    omega = np.geomspace(low, high, _FINE_GRID_SIZE)
    size, phase = np.interp(omega, known, answer), np.interp(omega, known, np.unwrap(np.angle(stiffness)))
    own = wheel.inertia * omega**2 - 1j * wheel.damping * omega
    larger = size > np.abs(own)
    crossings = np.flatnonzero(larger[:-1] & ~larger[1:])
    lead = (phase[crossings] - np.angle(own[crossings]) + math.pi) % (2.0 * math.pi) - math.pi
    delays = np.maximum(lead, 0.0) / omega[crossings]
    k = int(np.argmin(delays))
    return float(delays[k]), float(omega[crossings[k]] / (2.0 * math.pi))


def stability(subsystem: Subsystem, wheel: Wheel, bandwidth: float | None = None, interval: float = 0.002) -> Stability:
    """What a wheel may do on a car: the worst of all amplitudes.

    Parameters
    ----------
    subsystem : Subsystem
        As of :func:`driving_stiffness`.
    wheel : Wheel
    bandwidth : float, optional
        Of the filter of the angle (``angle_bandwidth`` of ``Mailboxes``), whose answer counts beside the delay of the
        wheel; by default there is none [Hz].
    interval : float
        Between the readings that the filter receives [s].

    Raises
    ------
    ValueError
        As :func:`driving_stiffness` and :func:`steer_env.live.real_time.angle_filter.response`.
    """
    filtered = response(FREQUENCIES, bandwidth, interval) if bandwidth is not None else 1.0
    answers = [filtered * driving_stiffness(subsystem, amplitude) for amplitude in AMPLITUDES]

    def longest(share: float) -> tuple[float, float]:
        return min(longest_delay(wheel, share * stiffness) for stiffness in answers)

    def quiet(share: float) -> bool:
        return longest(share / MARGIN)[0] >= wheel.delay + OWN_DELAY

    delay, frequency = longest(1.0)
    low, high = (1.0, 1.0) if quiet(1.0) else (0.0, 1.0)
    while high - low > 0.001:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if quiet(middle) else (low, middle)
    return Stability(delay - OWN_DELAY, frequency, low)
