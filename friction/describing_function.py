"""The describing function of a friction law: its torque in a settled sinusoidal motion as an amplitude and a phase.

    x = A sin(omega t),   T = sum of |T_n| sin(n omega t + phi_n)                                   (F40)
    N(A, omega) = T_1/A                                                                            (F40)

N replaces the law where the rest of a loop passes the first harmonic only; its imaginary part is the loop's work over
pi A^2. Source: Gelb, Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.law import resolve
from steer_env.friction.numerics.check import positive
from steer_env.friction.response import response

POINTS = 2000  # of a cycle
CYCLES = 400  # at most, until a loop has settled
SETTLED = 1e-6  # change of the torque from cycle to cycle, of its largest value


class Describing(NamedTuple):
    """A law in one sinusoidal motion."""

    value: complex  # N [N m/rad]
    third: float  # third harmonic of the torque over the first [1]
    settled: bool  # whether the loop repeats itself; a law that creeps may not within 400 cycles


def describing_function(law: Any, amplitude: float, frequency: float = 1.0) -> Describing:
    """The describing function of a law, from its own settled loop.

    Parameters
    ----------
    law : str or parameters
        As in :func:`steer_env.friction.law.resolve`.
    amplitude : float
        Of the displacement [rad].
    frequency : float
        On which only a law with viscous parts or lags depends [Hz].

    Raises
    ------
    ValueError
        For no law, or a value that is not positive.
    """
    p, A, f = resolve(law), positive("amplitude [rad]", amplitude), positive("frequency [Hz]", frequency)
    phase = 2.0 * np.pi * np.arange(POINTS + 1) / POINTS
    cycles = 4
    while True:
        x = A * np.sin(np.append(np.tile(phase[:-1], cycles), 2.0 * np.pi))
        torque = response(p, x, 1.0 / (f * POINTS))[1:].reshape(cycles, POINTS)
        change = float(np.abs(torque[-1] - torque[-2]).max() / max(np.abs(torque[-1]).max(), 1e-300))
        if change < SETTLED or cycles >= CYCLES:
            break
        cycles *= 4
    first, third = (_harmonic(torque[-1], n) for n in (1, 3))  # (F40)
    return Describing(first / A, abs(third) / max(abs(first), 1e-300), change < SETTLED)  # (F40)


def _harmonic(torque: NDArray[np.float64], n: int) -> complex:
    """Complex amplitude of sin(n omega t) of a cycle whose samples end the straight lines between the points."""
    phase = 2.0 * np.pi * np.arange(1, torque.size + 1) / torque.size
    return complex(2.0 * np.mean(torque * np.exp(-1j * n * phase)) * 1j)
