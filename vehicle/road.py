"""The road under the wheels: heights and friction of the left and right track over distance, grade and bank.

Both tracks are uniform grids over the travelled distance of each wheel, and repeat beyond their length. Heights are
Catmull-Rom splines through the values of the grid, with a continuous slope (R1); friction is linear between the values
of its grid (R2).

A random road has the displacement spectrum of ISO 8608 (R3), and its tracks are coherent as on an isotropic surface
(R4):

    G(n) = G(n_0) (n_0/n)^2,  n_0 = 0.1 cycle/m,  0.01 <= n <= 10 cycle/m            one-sided [m3]
    G_lr(n)/G(n) = x K_1(x),  x = 2 pi n track                                    coherency, K_1 a Bessel function

An isotropic surface with the spectrum C (n_x^2 + n_y^2)^(-3/2) has 2 C/n_x^2 along any line; the same integral over n_y
weighted by cos(2 pi n_y track) is the cross spectrum of two lines; their ratio is the integral of Basset for x K_1.
Source: ISO 8608, geometric means of its classes; isotropy after Dodds and Robson, J. Sound Vib. 31 (1973). Deviations:
none within the band; outside the band the spectrum is zero.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics import packing
from steer_env.friction.numerics.check import construct, number, one_of, positive
from steer_env.friction.numerics.interpolation import hermite
from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.friction.numerics.simd import broadcast, pack

LEFT_TRACK, RIGHT_TRACK = 0, 1
HEIGHT, FRICTION = (-10.0, 10.0), (0.01, 2.0)  # bounds of heights [m] and of factors on the friction [1]
ROUGHNESS = {name: 16e-6 * 4.0**i for i, name in enumerate("ABCDEFGH")}  # G(n_0) of the classes [m3]
REFERENCE_WAVE_NUMBER = 0.1  # n_0 [cycle/m]
LOWEST_WAVE_NUMBER, HIGHEST_WAVE_NUMBER = 0.01, 10.0  # [cycle/m]
LEVEL_START, RUN_IN = 5.0, 20.0  # at either end of a random road: exactly level, then rising to full height [m]


@packing.mark_as_tables
class Road(NamedTuple):
    """Road as the kernels take it; the functions below make and check it. Rows of arrays: left, right."""

    level: bool  # whether all heights are zero
    heights: NDArray[np.float64]  # (2, N) of the tracks above the plane of grade and bank [m]
    friction: NDArray[np.float64]  # (2, M) factors on the tyre's friction [1]
    spacing: float  # of both grids [m]
    grade: float  # uphill positive [rad]
    bank: float  # left side up positive [rad]


class WheelRoad(NamedTuple):
    """Road that is given anew for each wheel, in place of the tracks of a :class:`Road`."""

    height_front_left: float = 0.0  # front left wheel: height of the road above its plane, positive upwards [m]
    height_front_right: float = 0.0  # front right wheel: height of the road above its plane, positive upwards [m]
    height_rear_left: float = 0.0  # rear left wheel: height of the road above its plane, positive upwards [m]
    height_rear_right: float = 0.0  # rear right wheel: height of the road above its plane, positive upwards [m]
    slope_front_left: float = 0.0  # front left wheel: slope of the road along the car, positive uphill [1]
    slope_front_right: float = 0.0  # front right wheel: slope of the road along the car, positive uphill [1]
    slope_rear_left: float = 0.0  # rear left wheel: slope of the road along the car, positive uphill [1]
    slope_rear_right: float = 0.0  # rear right wheel: slope of the road along the car, positive uphill [1]
    friction_front_left: float = 1.0  # front left wheel: friction of the road, a factor on that of the tyre [1]
    friction_front_right: float = 1.0  # front right wheel: friction of the road, a factor on that of the tyre [1]
    friction_rear_left: float = 1.0  # rear left wheel: friction of the road, a factor on that of the tyre [1]
    friction_rear_right: float = 1.0  # rear right wheel: friction of the road, a factor on that of the tyre [1]


def _tracks(name: str, values: ArrayLike, minimum: float, maximum: float) -> NDArray[np.float64]:
    """(2, N) read-only array of both tracks, from one value, one value for each side, or an array of that shape."""
    try:
        given = np.asarray(values, float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be numbers of one shape for left and right, got {values!r}") from None
    tracks = np.full((2, 1), given) if given.ndim == 0 else given.reshape(2, -1) if given.shape == (2,) else given
    if tracks.ndim != 2 or len(tracks) != 2 or tracks.size == 0:
        raise ValueError(f"{name} must be a number, or of shape (2,) or (2, N) for left and right, got {given.shape}")
    bad = tracks[~((tracks >= minimum) & (tracks <= maximum))]
    if bad.size:
        raise ValueError(f"{name} must be finite, at least {minimum:g} and at most {maximum:g}, got {bad[0]}")
    tracks = tracks.copy()
    tracks.flags.writeable = False
    return tracks


def make_road(
    *,
    heights: ArrayLike = 0.0,
    friction: ArrayLike = 1.0,
    spacing: float = 0.05,
    grade: float = 0.0,
    bank: float = 0.0,
) -> Road:
    """Checked road; the default is level and dry.

    Parameters
    ----------
    heights : float, (2,) or (2, N) array_like
        Heights of the left and the right track over distance, within 10 m [m]. They repeat after N values, and the
        step from the last to the first may not exceed the largest step between two values.
    friction : float, (2,) or (2, M) array_like
        Factors on the friction of the tyre, one for both sides, one for each, or over distance, within 0.01 to 2 [1];
        they repeat after M values.
    spacing : float
        Spacing of both grids [m].
    grade, bank : float
        Inclination of the plane that the heights stand on, uphill and left side up positive, within 0.5 [rad].

    Raises
    ------
    ValueError
        Naming the parameter, the value and what is allowed.
    """
    z = _tracks("heights", heights, *HEIGHT)
    seam = float(np.max(np.abs(z[:, -1] - z[:, 0])))
    widest = float(np.max(np.abs(np.diff(z)), initial=0.0))
    if seam > widest:
        raise ValueError(
            f"heights must end where they start, within their widest step of {widest:g} m, got {seam:g} m between the"
            " last and the first; fade the ends to a common height"
        )
    return Road(
        level=not z.any(),
        heights=z,
        friction=_tracks("friction", friction, *FRICTION),
        spacing=positive("spacing", spacing),
        grade=number("grade", grade, minimum=-0.5, maximum=0.5),
        bank=number("bank", bank, minimum=-0.5, maximum=0.5),
    )


def flat() -> Road:
    """Level, dry road."""
    return make_road()


def bump(
    height: float,
    length: float,
    at: float,
    *,
    side: str = "both",
    period: float = 1000.0,
    friction: ArrayLike = 1.0,
    grade: float = 0.0,
    bank: float = 0.0,
) -> Road:
    """Level road with one bump, ``height cos^2(pi (s - at)/length)`` for ``|s - at| < length/2``.

    Parameters
    ----------
    height : float
        Negative for a hole, within 1 m [m].
    length : float
        From 0.1 m; sampled 40 times, or every 5 cm if that is finer [m].
    at : float
        Distance to the middle of the bump, at least half its length, at most 5 km [m].
    side : {"both", "left", "right"}
    period : float
        Distance after which the bump repeats, at most 10 km, rounded up to the grid [m].
    friction, grade, bank
        As in :func:`make_road`.

    Raises
    ------
    ValueError
        Naming the parameter, the value and what is allowed.
    """
    if side not in ("both", "left", "right"):
        raise ValueError(f"side must be 'both', 'left' or 'right', got {side!r}")
    length = number("length", length, minimum=0.1, maximum=1000.0)
    at = number("at", at, minimum=0.5 * length, maximum=5e3)
    spacing = min(0.05, length / 40.0)
    period = number("period", period, minimum=at + 0.5 * length, maximum=1e4)
    s = (np.arange(math.ceil(period / spacing)) * spacing - at) / length
    shape = np.where(np.abs(s) < 0.5, np.cos(np.pi * s) ** 2, 0.0)
    shape *= number("height", height, minimum=-1.0, maximum=1.0)
    sides = np.array([[side != "right"], [side != "left"]])
    return make_road(heights=sides * shape, friction=friction, spacing=spacing, grade=grade, bank=bank)


def iso8608(
    seed: int | np.random.Generator,
    road_class: str = "B",
    *,
    length: float = 2000.0,
    spacing: float = 0.05,
    track: float = 1.4,
    friction: ArrayLike = 1.0,
    grade: float = 0.0,
    bank: float = 0.0,
) -> Road:
    """Random road of an ISO 8608 class: an inverse FFT of the class's amplitudes with random phases.

    The sum and the difference of the tracks are independent and share the variance of each wave number by the
    coherency. The same seed gives the same road to the bit. The road starts and ends level for 5 m and reaches its full
    height after another 20 m, so that a car placed at distance 0 stands on a level road.

    Parameters
    ----------
    seed : int or numpy Generator
    road_class : {"A", ..., "H"}
        Very good to very poor.
    length : float
        Length after which the road repeats, rounded to the grid, 200 m to 100 km [m].
    spacing : float
        Spacing of the grid, 0.01 to 1 m [m]; waves shorter than two spacings are missing.
    track : float
        Distance between the left and the right track, 0 for equal tracks [m].
    friction, grade, bank
        As in :func:`make_road`.

    Raises
    ------
    ValueError
        Naming the parameter, the value and what is allowed.
    """
    from scipy.special import k1  # here, because its import is slow

    if not isinstance(seed, np.random.Generator) and (not isinstance(seed, int | np.integer) or seed < 0):
        raise ValueError(f"seed must be a whole number of at least 0 or a numpy Generator, got {seed!r}")
    one_of("road_class", road_class, ROUGHNESS)
    spacing = number("spacing", spacing, minimum=0.01, maximum=1.0)
    size = round(number("length", length, minimum=200.0, maximum=1e5) / spacing)
    n = np.fft.rfftfreq(size, spacing)
    x = 2.0 * np.pi * number("track", track, minimum=0.0, maximum=10.0) * n
    band = (n >= LOWEST_WAVE_NUMBER) & (n <= HIGHEST_WAVE_NUMBER) & (n < 0.5 / spacing)
    power, coherency = np.zeros(n.size), np.ones(n.size)
    # (R3), variance of each wave [m2]
    power[band] = ROUGHNESS[road_class] * (REFERENCE_WAVE_NUMBER / n[band]) ** 2 / (size * spacing)
    coherency[x > 0.0] = np.minimum(x[x > 0.0] * k1(x[x > 0.0]), 1.0)  # (R4); rounding may exceed 1 near x = 0
    phases = np.exp(2j * np.pi * np.random.default_rng(seed).random((2, n.size)))
    amplitudes = np.sqrt(power * np.array([1.0 + coherency, 1.0 - coherency]))  # of half the sum and difference
    half_sum, half_difference = np.fft.irfft(0.5 * size * amplitudes * phases, size)
    s = np.arange(size) * spacing
    ramp = np.clip((np.minimum(s, size * spacing - s) - LEVEL_START) / RUN_IN, 0.0, 1.0)
    heights = np.sin(0.5 * np.pi * ramp) ** 2 * np.array([half_sum + half_difference, half_sum - half_difference])
    return make_road(heights=heights, friction=friction, spacing=spacing, grade=grade, bank=bank)


_MAKERS = {make.__name__: make for make in (make_road, flat, bump, iso8608)}


def resolve(road: Any) -> Road | None:
    """A road from every form in which it may be given.

    Parameters
    ----------
    road : mapping, Road or None
        A mapping has a function of this module under "road" and its arguments beside it, as in
        ``{"road": "iso8608", "seed": 1, "road_class": "C"}``; a Road and None are returned unchanged.

    Raises
    ------
    ValueError
        For another form, an unknown function or argument, or a value out of range.
    """
    if road is None or isinstance(road, Road):
        return road
    given = dict(road) if isinstance(road, Mapping) else {}
    name = given.pop("road", None)
    if not isinstance(name, str) or name not in _MAKERS:
        raise ValueError(
            f"road must be a mapping as {{'road': 'iso8608', 'seed': 1}}, with one of {', '.join(_MAKERS)}, or a Road"
            f" from these functions of steer_env.vehicle.road, got {road!r}"
        )
    return construct(f"road {name!r}", _MAKERS[name], given)


def as_mapping(road: Road) -> dict[str, Any]:
    """The mapping that :func:`resolve` turns into this road again, of what JSON holds without loss: all its heights."""
    values = {key: np.asarray(value).tolist() for key, value in road._asdict().items() if key != "level"}
    return {"road": make_road.__name__, **values}


@kernel
def height(r, side, distance):
    """Height of a track above the plane of the road [m] and its slope [1]; ``side`` is 0 left, 1 right (R1)."""
    if r.level:
        return 0.0, 0.0
    z, size = r.heights, r.heights.shape[1]
    place = distance / r.spacing
    cell = math.floor(place)
    s = place - cell
    i = int(cell) % size
    j = i + 1 if i + 1 < size else 0
    k = j + 1 if j + 1 < size else 0
    start, end = z[side, i], z[side, j]
    # Catmull-Rom: the slope at a grid point is half the difference of its neighbours (R1).
    value, slope = hermite(s, start, end, 0.5 * (end - z[side, i - 1]), 0.5 * (z[side, k] - start))
    return value, slope / r.spacing


@kernel
def friction(r, side, distance):
    """Factor on the friction of the tyre [1]; ``side`` is 0 left, 1 right (R2)."""
    mu, size = r.friction, r.friction.shape[1]
    if size == 1:
        return mu[side, 0]
    place = distance / r.spacing
    cell = math.floor(place)
    i = int(cell) % size
    j = i + 1 if i + 1 < size else 0
    return mu[side, i] + (place - cell) * (mu[side, j] - mu[side, i])  # (R2)


@kernel
def _under_tracks(r, front, rear):
    heights = slopes = broadcast(0.0)
    if not r.level:
        (z_fl, s_fl), (z_fr, s_fr) = height(r, LEFT_TRACK, front), height(r, RIGHT_TRACK, front)
        (z_rl, s_rl), (z_rr, s_rr) = height(r, LEFT_TRACK, rear), height(r, RIGHT_TRACK, rear)
        heights, slopes = pack(z_fl, z_fr, z_rl, z_rr), pack(s_fl, s_fr, s_rl, s_rr)
    if r.friction.shape[1] == 1:
        left, right = r.friction[LEFT_TRACK, 0], r.friction[RIGHT_TRACK, 0]
        return heights, slopes, pack(left, right, left, right)
    left, right = friction(r, LEFT_TRACK, front), friction(r, RIGHT_TRACK, front)
    return heights, slopes, pack(left, right, friction(r, LEFT_TRACK, rear), friction(r, RIGHT_TRACK, rear))


@kernel
def _under_given(r, front, rear):
    return (
        pack(r.height_front_left, r.height_front_right, r.height_rear_left, r.height_rear_right),
        pack(r.slope_front_left, r.slope_front_right, r.slope_rear_left, r.slope_rear_right),
        pack(r.friction_front_left, r.friction_front_right, r.friction_rear_left, r.friction_rear_right),
    )


_UNDER_WHEELS = {Road: _under_tracks, WheelRoad: _under_given}


def under_wheels(r, front, rear):
    """Height, slope and friction under four wheels, by the distances of both axles."""
    return _UNDER_WHEELS[type(r)](r, front, rear)


dispatch(under_wheels, lambda kind, _: _UNDER_WHEELS.get(kind))
