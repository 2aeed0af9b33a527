"""Random steering."""

import numpy as np

from steer_env.manoeuvres.common.definition import Array, Manoeuvre, register
from steer_env.manoeuvres.common.shapes import ramp_and_hold

RATE, FADE = 50.0, 2.0  # sampling rate of the noise, between whose samples is a spline [Hz]; smooth start and end [s]


@register("random-steer")
def random_steer(
    seed: int = 0,
    lowest: float = 0.1,
    highest: float = 2.5,
    duration: float = 180.0,
    lateral_acceleration: float = 1.5,
) -> Manoeuvre:
    """Random steering: the handwheel angle is band-limited Gaussian noise with a flat spectrum.

    Parameters
    ----------
    seed : int
    lowest, highest : float
        Band of the noise [Hz]; it is wider than the band of the metrics, 0.2 to 2 Hz.
    duration : float
        [s].
    lateral_acceleration : float
        Amplitude of a sine with the power of the lateral acceleration, assumed; peaks are two to three times as high
        [m/s2].
    """
    samples = round(duration * RATE) + 1
    frequency = np.fft.rfftfreq(samples, 1.0 / RATE)
    rng = np.random.default_rng(seed)
    spectrum = rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size)
    noise = np.fft.irfft(np.where((frequency >= lowest) & (frequency <= highest), spectrum, 0.0), samples)
    from scipy.interpolate import CubicSpline  # here, because its import takes a tenth of the start of an environment

    curve = CubicSpline(np.arange(samples) / RATE, noise / (np.sqrt(2.0) * np.std(noise)))

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        on, off = ramp_and_hold(t, 1.0, FADE), ramp_and_hold(t - duration + FADE, 1.0, FADE)
        fade, change = on[0] - off[0], on[1] - off[1]
        return amplitude * fade * curve(t), amplitude * (change * curve(t) + fade * curve(t, 1))

    return Manoeuvre(
        name="random-steer",
        hands=f"Random handwheel angle, {lowest:g} to {highest:g} Hz, seed {seed}",
        source="after ISO 7401 and ISO/TR 8726",
        speed=80.0 / 3.6,
        duration=duration,
        hand=hand,
        lateral_acceleration=lateral_acceleration,
        reach=lambda acceleration: float(np.sqrt(2.0) * np.std(acceleration)),
        trial=60.0,
    )
