"""Free driving on a road."""

import numpy as np

from steer_env.manoeuvres.common.definition import Array, Manoeuvre, register
from steer_env.manoeuvres.common.shapes import ramp_and_hold
from steer_env.recording.recording import DEGREE

RATE, FADE = 50.0, 2.0  # sampling rate of the motion, between whose samples is a spline [Hz]; smooth start and end [s]
BENDS = (0.008, 0.04)  # band of the part that follows the road, with a flat spectrum; assumed [Hz]
CORRECTIONS = (0.1, 2.0)  # band of the corrections, whose speed has a flat spectrum; assumed [Hz]


@register("road")
def road(
    seed: int = 0, duration: float = 180.0, bends: float = 5.0 * DEGREE, corrections: float = 1.2 * DEGREE
) -> Manoeuvre:
    """Free driving: bends of a road and a driver's corrections, both as Gaussian noise of the handwheel angle.

    Parameters
    ----------
    seed : int
    duration : float
        [s].
    bends, corrections : float
        Standard deviations, assumed: about those of the packaged drive on a road [rad].
    """
    samples = round(duration * RATE) + 1
    frequency, rng = np.fft.rfftfreq(samples, 1.0 / RATE), np.random.default_rng(seed)

    def noise(band: tuple[float, float], power: float) -> Array:
        inside = (frequency >= band[0]) & (frequency <= band[1])
        spectrum = rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size)
        shape = np.where(inside, np.maximum(frequency, band[0]) ** power, 0.0)
        found: Array = np.fft.irfft(spectrum * shape, samples)
        return found / np.std(found)

    angle = bends * noise(BENDS, 0.0) + corrections * noise(CORRECTIONS, -1.0)
    from scipy.interpolate import CubicSpline  # here, because its import takes a tenth of the start of an environment

    curve = CubicSpline(np.arange(samples) / RATE, angle)

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        on, off = ramp_and_hold(t, 1.0, FADE), ramp_and_hold(t - duration + FADE, 1.0, FADE)
        fade, change = on[0] - off[0], on[1] - off[1]
        return amplitude * fade * curve(t), amplitude * (change * curve(t) + fade * curve(t, 1))

    return Manoeuvre(
        name="road",
        hands=f"Random handwheel angle, {bends / DEGREE:.2g} deg of bends and {corrections / DEGREE:.2g} deg of "
        f"corrections (standard deviations), seed {seed}",
        source="free driving; spectrum assumed, about that of the packaged drive on a road",
        speed=90.0 / 3.6,
        duration=duration,
        hand=hand,
        amplitude=1.0,
    )
