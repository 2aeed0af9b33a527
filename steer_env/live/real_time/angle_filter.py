"""Angle and speed of a handwheel at 1 kHz, from readings of a coarse sensor that arrive at other, uneven times.

A step of 16 bit over 900 deg in one sample is a speed of 0.24 rad/s for one sample, and the handwheel torque of a robot
that follows it would be 9 N m. The filter follows the readings with the straight line that fits them best, older ones
counting less by ``exp(-omega t)`` (fading memory of the second order). From a reading to the next, ``dt`` later,

    b = exp(-omega dt)
    angle += speed dt;  miss = reading - angle
    angle += (1 - b^2) miss;  speed += (1 - b)^2 / dt miss

so that it is stable whatever dt is, and has no lag where the speed is constant. Between readings it goes on along the
line. For readings that arrive often it is the filter (2 omega s + omega^2) / (s + omega)^2.

Source: Morrison, Introduction to Sequential Smoothing and Prediction, 1969, chapter 13.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.vehicle.steering.eps import SAMPLE_TIME

BANDWIDTH = 50.0  # [Hz]; assumed
HORIZON = 20_000_000  # time without a reading after which the line is not followed any further [ns]
_SECONDS, _LEAST_CYCLES = 1.0, 6  # of a sine in `response`; the second half of it counts


class AngleFilter(NamedTuple):
    """A filter and its memory."""

    omega: float  # [rad/s]
    memory: NDArray[np.float64]  # (2,) angle [rad] and speed [rad/s] at the last reading
    stamp: NDArray[np.int64]  # (1,) time of the last reading, -1 before the first [ns]


def make(bandwidth: float = BANDWIDTH) -> AngleFilter:
    """A filter of a bandwidth [Hz].

    Raises
    ------
    ValueError
        A bandwidth outside 1 to 300 Hz.
    """
    omega = 2.0 * math.pi * number("bandwidth of the angle filter [Hz]", bandwidth, minimum=1.0, maximum=300.0)
    return AngleFilter(omega, np.zeros(2), np.full(1, -1))


@kernel
def follow(f, reading, stamp):
    """Take a reading [rad] of a time [ns]; one that is not newer than the last changes nothing.

    Behind a gap of ``HORIZON`` the filter begins anew.
    """
    gap = stamp - f.stamp[0]
    if f.stamp[0] >= 0 and gap <= 0:
        return
    if f.stamp[0] < 0 or gap > HORIZON:
        f.memory[0], f.memory[1] = reading, 0.0
    else:
        dt = 1e-9 * gap
        b = math.exp(-f.omega * dt)
        f.memory[0] += f.memory[1] * dt
        miss = reading - f.memory[0]
        f.memory[0] += (1.0 - b * b) * miss
        f.memory[1] += (1.0 - b) * (1.0 - b) / dt * miss
    f.stamp[0] = stamp


@kernel
def estimate(f, now):
    """Angle [rad] and speed [rad/s] at a time [ns]."""
    return f.memory[0] + 1e-9 * within(now - f.stamp[0], -HORIZON, HORIZON) * f.memory[1], f.memory[1]


@kernel
def _sine(f, omega, interval, found):
    """What the filter makes of the readings of a sine, at every sample."""
    stamp = 0
    for i in range(found.size):
        now = (i + 1) * 1_000_000
        while stamp + interval <= now:
            stamp += interval
            follow(f, math.sin(omega * 1e-9 * stamp), stamp)
        found[i], _ = estimate(f, now)


def response(frequencies: ArrayLike, bandwidth: float = BANDWIDTH, interval: float = 0.002) -> NDArray[np.complex128]:
    """The filter's answer to sines of the angle at frequencies (F,) [Hz], from readings at an interval [s]: (F,) [1].

    The delay at a frequency f is ``-angle(answer) / (2 pi f)``; it is below zero where the line looks ahead.

    Raises
    ------
    ValueError
        A bandwidth as of :func:`make`, or an interval outside 0.1 to 15 ms.
    """
    gap = round(1e9 * number("interval of the readings [s]", interval, minimum=1e-4, maximum=0.015))
    answers = []
    for frequency in np.atleast_1d(np.asarray(frequencies, float)):
        omega = 2.0 * math.pi * frequency
        cycles = max(_LEAST_CYCLES, math.ceil(_SECONDS * frequency))
        found = np.zeros(round(cycles / frequency / SAMPLE_TIME))
        bind(_sine, *(arguments := (make(bandwidth), omega, gap, found)))(*arguments)
        half = found.size // 2
        t = SAMPLE_TIME * np.arange(1, found.size + 1)[half:]
        shapes = np.column_stack([np.sin(omega * t), np.cos(omega * t)])
        real, imaginary = np.linalg.lstsq(shapes, found[half:], rcond=None)[0]
        answers.append(real + 1j * imaginary)
    return np.array(answers)
