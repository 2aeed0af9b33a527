"""Straight running with fixed hands in crosswind: gusts from strips of side wind, or random wind."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import positive
from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.vehicle.chassis.common.interface import WIND_FORCE, WIND_MOMENT
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

# Side force of a compact car, 1/2 rho A c_Y beta v_res^2 at an angle of attack beta; all values assumed.
AIR, AREA, SIDE_FORCE_SLOPE = 1.2, 2.0, 2.3  # density [kg/m3], frontal area [m2], dc_Y/dbeta [1/rad]
ARM = 0.3  # distance of the centre of pressure ahead of the centre of gravity, assumed [m]
CAR_LENGTH = 4.0  # length of the car, over which the wind force builds up, assumed [m]
START, EVENT = 2.0, 8.0  # start of the first gust, and time from one gust to the next, assumed [s]
CORRELATION = 1.0  # correlation time of random wind, assumed [s]


def side_force(wind: Array, speed: float) -> Array:
    """Side force of a wind across the road [m/s] on a car with a speed [m/s], in N."""
    return 0.5 * AIR * AREA * SIDE_FORCE_SLOPE * np.arctan2(wind, speed) * (speed**2 + wind**2)


def _gusts(t: Array, wind: float, length: float, events: int, speed: float) -> Array:
    """Side force over time from strips of wind, alternately to the left and to the right [N]."""
    event, s = np.divmod(t - START, EVENT)
    rise = np.clip(s * speed / CAR_LENGTH, 0.0, 1.0)
    fall = np.clip((s * speed - length) / CAR_LENGTH, 0.0, 1.0)
    shape = rise * rise * (3.0 - 2.0 * rise) - fall * fall * (3.0 - 2.0 * fall)
    blowing = (event >= 0.0) & (event < events)
    return np.where(blowing, shape * (1.0 - 2.0 * (event % 2.0)), 0.0) * side_force(np.array(wind), speed)


def _random(t: Array, wind: float, seed: int, speed: float) -> Array:
    """Side force over time from random wind [N]: first-order noise with the standard deviation ``wind``, from zero."""
    keep = np.exp(-SAMPLE_TIME / CORRELATION)
    drawn = np.random.default_rng(seed).standard_normal(t.size)
    from scipy import signal  # here, because its import takes longer than the start of an environment

    return side_force(signal.lfilter([wind * np.sqrt(1.0 - keep**2)], [1.0, -keep], drawn), speed)


@register("crosswind")
def crosswind(
    wind: float | None = None,
    length: float = 25.0,
    events: int = 4,
    speed: float = 100.0 / 3.6,
    seed: int | None = None,
    duration: float = 60.0,
) -> Manoeuvre:
    """Crosswind, hands fixed: the car runs straight through strips of side wind, or in random wind.

    Parameters
    ----------
    wind : float, optional
        Wind speed in a strip, 20 by default, or standard deviation of random wind, 5 by default; assumed [m/s].
    length : float
        Length of a strip [m].
    events : int
        Number of strips.
    speed : float
        [m/s].
    seed : int, optional
        Seed of random wind; without a seed the wind blows in strips.
    duration : float
        Duration in random wind [s].

    Raises
    ------
    ValueError
        If the wind is not positive, or a strip is too long for the time from one gust to the next.
    """
    strength = positive("wind", (20.0 if seed is None else 5.0) if wind is None else wind)
    if seed is None and (length + CAR_LENGTH) / speed > 0.5 * EVENT:
        raise ValueError(f"length is {length:g} m: at {3.6 * speed:.0f} km/h a gust must be over in {0.5 * EVENT:g} s")
    profile: Callable[[Array], Array]
    if seed is None:
        profile = partial(_gusts, wind=strength, length=length, events=events, speed=speed)
        what = f"strips of {length:g} m with {strength:g} m/s of side wind, left and right in turn, {events} times"
        meta = {"gust_start_s": START, "gust_interval_s": EVENT, "gust_count": events, "gust_length_m": length}
    else:
        profile = partial(_random, wind=strength, seed=seed, speed=speed)
        what = f"random side wind of {strength:g} m/s standard deviation, seed {seed}"
        meta = {"wind_seed": seed}
    return Manoeuvre(
        name="crosswind",
        hands=f"Handwheel held straight, {what}",
        source="after ISO 12021; wind and the car's aerodynamics assumed",
        speed=speed,
        duration=START + events * EVENT if seed is None else duration,
        hand=lambda t, amplitude: (np.zeros_like(t), np.zeros_like(t)),
        amplitude=0.0,
        others={WIND_FORCE: profile, WIND_MOMENT: lambda t: ARM * profile(t)},
        meta={**meta, "wind_m_s": strength},
    )
