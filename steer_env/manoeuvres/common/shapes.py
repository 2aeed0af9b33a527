"""Shapes of hand motion over time: values and rates that start and end smoothly."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sine(t: Array, amplitude: float, frequency: float) -> tuple[Array, Array]:
    """Value and rate of a sine whose amplitude grows over the first cycle, so that the handwheel starts smoothly."""
    (envelope, rate), (wave, _) = sine_factors(t, frequency)
    return amplitude * envelope * wave, amplitude * rate


def sine_factors(t: Array, frequency: float) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Factors that :func:`sine` multiplies an amplitude by, those of the value and of the rate: first ones, then ones.

    In this order, so that a script that is made of them is that of the manoeuvre to the bit.
    """
    omega = 2.0 * np.pi * frequency
    s = np.clip(t * frequency, 0.0, 1.0)
    envelope = s * s * (3.0 - 2.0 * s)
    growth = 6.0 * s * (1.0 - s) * frequency
    wave = np.sin(omega * t)
    return (envelope, envelope * omega * np.cos(omega * t) + growth * wave), (wave, np.ones(t.size))


def ramp_and_hold(t: Array, amplitude: float, rise: float) -> tuple[Array, Array]:
    """Value and rate of a smooth rise to a level that is held."""
    s = np.clip(t / rise, 0.0, 1.0)
    return amplitude * s * s * (3.0 - 2.0 * s), amplitude * 6.0 * s * (1.0 - s) / rise


def triangle(t: Array, amplitude: float, frequency: float) -> tuple[Array, Array]:
    """Value and rate of a triangle wave with rounded corners, whose speed is nearly constant from end to end."""
    omega, blunt = 2.0 * np.pi * frequency, 0.995
    s, scale = blunt * np.sin(omega * t), amplitude / np.arcsin(blunt)
    return scale * np.arcsin(s), scale * blunt * omega * np.cos(omega * t) / np.sqrt(1.0 - s * s)


def triangle_from_rest(t: Array, amplitude: float, frequency: float) -> tuple[Array, Array]:
    """Value and rate of a triangle wave whose first quarter is a smooth rise, so that the handwheel starts smoothly."""
    quarter = 0.25 / frequency
    first, then = ramp_and_hold(t, amplitude, quarter), triangle(t, amplitude, frequency)
    return np.where(t < quarter, first[0], then[0]), np.where(t < quarter, first[1], then[1])


def ease_clock(t: Array, duration: float, ease: float) -> tuple[Array, Array]:
    """Value and rate of a clock that starts and stops smoothly.

    The rate rises to 1 and falls to 0 within ``ease`` [s]; at the end the clock shows ``duration`` [s].
    """

    def elapsed(s: Array) -> Array:  # integral of the smooth rise of the rate
        x = np.clip(s / ease, 0.0, 1.0)
        rising = (0.0 < x) & (x < 1.0)  # elsewhere all powers of x are x itself, and a power takes long
        cube, fourth = (np.power(x, n, out=x.copy(), where=rising) for n in (3, 4))
        return ease * (cube - 0.5 * fourth) + np.maximum(s - ease, 0.0)

    up, down = np.clip(t / ease, 0.0, 1.0), np.clip((t - duration) / ease, 0.0, 1.0)
    return elapsed(t) - elapsed(t - duration), up * up * (3.0 - 2.0 * up) - down * down * (3.0 - 2.0 * down)


def excursion(t: Array, amplitude: float, rise: float, hold: float, back: float) -> tuple[Array, Array]:
    """Value and rate of a smooth rise from zero at t = 0, a hold and a smooth return."""
    out, home = ramp_and_hold(t, amplitude, rise), ramp_and_hold(t - rise - hold, amplitude, back)
    return out[0] - home[0], out[1] - home[1]


def straight_ramp(t: Array, amplitude: float, rise: float, ease: float = 0.5) -> tuple[Array, Array]:
    """Value and rate of a linear ramp from zero to a level that is held; the corners are rounded over ``ease`` [s]."""
    clock, rate = ease_clock(t, rise, ease)
    return amplitude * clock / rise, amplitude * rate / rise
