"""Friction at several sites of a column: above the torsion bar, and at four places that turn together below it.

    a w1 + mean T_u(w1) - K w2 = R_1                                  (F43)
    S w2 + sum of mean T_i(w2) - K w1 = R_2                           (F43)

w1 and w2 are the mean speeds of the handwheel and of the column below the bar over a step, T_u is the torque of the
site above it, and the sum goes over the sites below. Coulomb's law and its kind are inclusions here, as in (F7). Every
torque is monotone but for a fall that ``step_limit`` bounds, with which (F43) has one solution. K^2 is small beside
a S, 2e-6 of it at 1 ms and 6e-3 at 10 ms, and the solution is found by solving (F43) for one speed and the other in
turn, with the first equation made linear in w2 while the second is solved.

Each site has a law and a level of its own. That of the car acts below the bar too; above it, only its factor L_0 does.
The friction of a gear grows with the torque T_m that the motor sends through it:

    L_+ = L_+ of the car (F11) times L_+ of the site (F11) + L_0 c |T_m|                               (F44)
    c = c_d where T_m drives the motion, c_b where it is driven back; L_- alike                        (F44)
"""

import functools
import inspect
import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction import defaults, fitted_file, gear, unit
from steer_env.friction import law as laws
from steer_env.friction.law import (
    LAWS,
    Law,
    advance,
    law_of,
    mean_torque,
    newton,
    rate,
    rest_torque,
    solve,
    stored_energy,
    torque,
)
from steer_env.friction.level import Level, Scales, choose_scale, largest, own_scale
from steer_env.friction.level import make as make_level
from steer_env.friction.level import scales as level_scales
from steer_env.friction.numerics import packing, scratch, units
from steer_env.friction.numerics.check import construct, not_negative, one_of
from steer_env.friction.numerics.kernel import COMPILED, dispatch, kernel
from steer_env.friction.numerics.packing import of_row
from steer_env.friction.numerics.simd import all_of, any_of, invert, maximum, where
from steer_env.friction.numerics.units import Part, address_of, table_cell, table_slice
from steer_env.friction.unit import scale_at_rest, step

NOTHING = {"law": "viscous", "sigma_2": 0.0}
ABOVE, BELOW = "upper_column", ("lower_column", "gear", "rack", "motor")
# Also in the options of pages.
SITES_SYNTAX = (
    "LAW[,key=value...]@SITE, several joined by +; @column_eps, @rack_eps and @steer_by_wire are all its sites"
)
MOST_SITES = 1 + len(BELOW)  # sites
MOST_ROUNDS, WITH_SLOPE = 50, 8
LEAST_SLIDING_TORQUE = 1e-6  # sliding torque that can grow, assumed [N m]
CLOSE = 1e-15  # of the torque that an error of w1 adds to the second equation, over its terms [1]


class Site(NamedTuple):
    """A place of friction."""

    law: Any  # parameters of a friction law
    level: Level
    driving: float  # c_d, growth of the level with the motor's torque that drives the motion [1/(N m)]
    driven: float  # c_b, growth with the motor's torque against the motion [1/(N m)]
    start: int  # of its memory in that of all sites
    end: int


class Sites(NamedTuple):
    """Sites of a column; one without friction has a damper of zero."""

    upper_column: Site
    lower_column: Site
    gear: Site
    rack: Site
    motor: Site

    def for_kernels(self) -> "Bound":
        """The sites as kernels of :mod:`steer_env.friction.law` take them."""
        return bound(self)


@units.of_process
class Table(NamedTuple):
    """Where the friction of a :class:`Bound` stands, the sites above the bar first; idle ones are left out."""

    addresses: Any  # (n, F) of the functions of each law; without the compiler the laws themselves
    sizes: NDArray[np.int64]  # (n, 1 + D) of each law, as of a unit
    places: NDArray[np.int64]  # (n, 4) first numbers of law and conditions, first float of the memory and the end
    above: int  # how many sites are above the bar, 0 or 1
    continuous: int  # 1 where the law of every site below the bar is
    wide: int  # 1 where the functions are those of four cars side by side
    alone: int  # 1 where a law is given for the column as a whole, without conditions of its own


class Bound(NamedTuple):
    """Friction as kernels take it, the same type for every law and any mix of them."""

    numbers: NDArray[np.float64]  # (K,) of the law, or of all sites
    at: Table


class Below(NamedTuple):
    """What is below the bar of a :class:`Bound`, as one law, whose torque scale is an array of those of the sites."""

    friction: Bound


class Rest(NamedTuple):
    """The sites below the bar in a step at rest."""

    scales: Any  # (n,) array: of each that with which its memory is loaded [1]
    torques: Any  # (n,) array: of each its mean torque [N m]
    sum: float  # of these [N m]


class Equations(NamedTuple):
    """The two step equations (F43)."""

    a: float  # above the bar [N m s/rad]
    R1: float  # [N m]
    K: float  # of the bar [N m s/rad]
    S: float  # below it [N m s/rad]
    R2: float  # [N m]
    h: float  # [s]


def law_at(p, i):
    """The law of a site of a :class:`Bound`."""
    return of_row(p.at.addresses[i], p.numbers[None, table_cell(p.at.places, i, 0) :], 0)


@kernel
def _law_at(p, i):
    return Part(
        address_of(p.at.addresses, i), address_of(p.numbers, table_cell(p.at.places, i, 0)), address_of(p.at.sizes, i)
    )


dispatch(law_at, lambda kind, _: _law_at)


@kernel
def joint(p, scales, memory, equations, w1, w2, led):
    """One step of (F43): the mean speeds, and the torques above and below the bar.

    Parameters
    ----------
    p : Bound
    scales : (2 n,) array
        As :func:`scales` fills it.
    memory : (M,) array
        Advanced in place.
    equations : Equations
    w1, w2 : float
        Speeds from which the search begins [rad/s]; ``w1`` is the speed itself where it is prescribed.
    led : bool
        Whether the speed above the bar is prescribed, in place of the first equation.

    Returns
    -------
    w1, w2 : float
        Mean speeds [rad/s].
    T_above, T_below : float
        Mean torques, from (F43), so that the energy balance is exact [N m].
    """
    a, R1, K, S, R2, h = equations
    if p.at.alone:
        S -= 0.0 if led else K * K / a  # (C5)
        R2 += K * w1 if led else K / a * R1  # (C5)
        w2, T = step(law_at(p, 0), Scales(scales[0], scales[1]), memory, S, R2, h, w2)
        return w1 if led else (R1 + K * w2) / a, w2, 0.0 * a, T  # (C7)
    holds, torques = scratch.like(memory, MOST_SITES), scratch.like(memory, MOST_SITES)
    L, taken = scratch.like(memory, MOST_SITES), scratch.like(memory, MOST_SITES)
    rest = Rest(holds, torques, _rest_torque_below(p, scales, memory, h, holds, torques))
    for i in range(p.at.above, p.at.places.shape[0]):
        L[i] = holds[i]
    scale, expected, going = 0.0, w1, True
    for i in range(MOST_ROUNDS + 1):
        # Above the bar, at the speed w2 below it
        R = where(led, math.copysign(math.inf, w1), R1 + K * w2)
        w, slope = R / a, 0.0  # (F43) without friction above
        if p.at.above:
            law, own = law_at(p, 0), table_slice(memory, p.at.places, 0, 2)
            scale = where(going, choose_scale(law, Scales(scales[0], scales[1]), own, R, h), scale)  # (F11)
            if not led:
                w = solve(law, scale, own, a, R, h, expected)  # (F43)
        w1 = where(going & (not led), w, w1)
        if i > 0:
            close = K * abs(w1 - expected) <= CLOSE * (S * abs(w2) + abs(R2) + K * (abs(w1) + abs(R1) / a))
            going = going & invert(close)
            if i == MOST_ROUNDS or not any_of(going):
                break
        # Below it, with w1 + slope (w - w2) while the speed w is sought. A slope may lead to and fro across a kink;
        # without it the rounds converge by K^2/(a S).
        if not led:
            whole = a
            if p.at.above:
                whole += mean_torque(law_at(p, 0), scale, table_slice(memory, p.at.places, 0, 2), w1, h)[1]
            slope = where((w1 != 0.0) & (i < WITH_SLOPE), K / whole, 0.0)
        R = R2 + K * (w1 - slope * w2)
        w = _solve_below(p, scales, rest, memory, S - K * slope, R, h, w2, taken)
        expected = w1 + slope * (w - w2)
        for j in range(p.at.above, p.at.places.shape[0]):
            L[j] = where(going, taken[j], L[j])
        w2 = where(going, w, w2)
        if led:
            break
    T_above = 0.0 * a if led else R1 + K * w2 - a * w1
    if p.at.above:
        law, own = law_at(p, 0), table_slice(memory, p.at.places, 0, 2)
        if led:
            T_above, _ = mean_torque(law, scale, own, w1, h)
            if any_of(w1 == 0.0):
                T_above = where(w1 != 0.0, T_above, rest_torque(law, scale, own, h))
        advance(law, scale, own, w1, h)
    for i in range(p.at.above, p.at.places.shape[0]):
        advance(law_at(p, i), L[i], table_slice(memory, p.at.places, i, 2), w2, h)
    return w1, w2, T_above, R2 + K * w1 - S * w2


@kernel
def _rest_torque_below(p, scales, memory, h, holds, torques):
    """The sum of a :class:`Rest`, of which ``holds`` and ``torques`` are filled; memories are cut back."""
    rest = 0.0
    for i in range(p.at.above, p.at.places.shape[0]):
        own, both = table_slice(memory, p.at.places, i, 2), Scales(scales[2 * i], scales[2 * i + 1])
        holds[i], torques[i] = scale_at_rest(law_at(p, i), both, own, h)
        rest += torques[i]
    return rest


@kernel
def _solve_below(p, scales, rest, memory, S, R, h, guess, L):
    """The speed with ``S w`` + the torques below the bar = ``R``; ``L`` receives the scales with which it is so."""
    still = R == rest.sum
    for i in range(p.at.above, p.at.places.shape[0]):
        L[i] = rest.scales[i]
    if all_of(still):
        return R - rest.sum
    side = where(R > rest.sum, 1.0, -1.0)
    for i in range(p.at.above, p.at.places.shape[0]):
        law, own, both = law_at(p, i), table_slice(memory, p.at.places, i, 2), Scales(scales[2 * i], scales[2 * i + 1])
        if not all_of(both.positive == both.negative):  # else the one that holds it
            L[i] = where(still, L[i], own_scale(law, both, L[i], rest.torques[i], own, side, h))
    return where(still, 0.0, _solve_motion(Below(p), L, memory, S, R, h, guess, side, rest.sum))


@kernel
def _solve_motion(p, L, memory, S, R, h, guess, side, rest):
    """The speed of a motion to a side, or rest where a set-valued law holds it."""
    start = rest if p.friction.at.continuous else mean_torque(p, L, memory, side * 0.0, h)[0]
    return newton(p, L, memory, S, where(side * (R - start) > 0.0, R, start), h, guess, start)


@kernel
def _mean_below(p, L, memory, w, h):
    """Sum of the mean torques below the bar [N m], and its derivative by the speed [N m s/rad]."""
    T = slope = 0.0
    for i in range(p.friction.at.above, p.friction.at.places.shape[0]):
        own, steep = mean_torque(law_at(p.friction, i), L[i], table_slice(memory, p.friction.at.places, i, 2), w, h)
        T += own
        slope += steep
    return T, slope


@kernel
def scales(p, conditions, base, load, x, motor, found):
    """Fill ``found`` (2 n,) with the factors on the saturated friction of each site, by the direction of motion.

    Parameters
    ----------
    p : Bound
    conditions : Level
        Of the car, which acts at every site below the bar.
    base : float
        L_0 [1].
    load : float
        Rack force [N].
    x : float
        Position of the column [rad].
    motor : float
        Torque of the motor on the column [N m].
    """
    of_car = level_scales(conditions, base, load, x)  # (F11)
    left, grown = motor >= 0.0, base * abs(motor)
    for i in range(p.at.places.shape[0]):
        at = table_cell(p.at.places, i, 1)
        if p.at.alone:
            found[0], found[1] = of_car
        elif i < p.at.above:
            own = level_scales(_level_at(p, at), 1.0, 0.0, x)  # (F11)
            found[0], found[1] = maximum(base * own.positive, 0.0), maximum(base * own.negative, 0.0)  # (F44)
        else:
            own = level_scales(_level_at(p, at), 1.0, load, x)  # (F11)
            driving, driven = maximum(p.numbers[at + _GROWTH], 0.0), maximum(p.numbers[at + _GROWTH + 1], 0.0)
            # A negative level, as of a parameter of an exported unit, would drive the steering.
            positive = maximum(of_car.positive * own.positive, 0.0)
            negative = maximum(of_car.negative * own.negative, 0.0)
            found[2 * i] = positive + grown * where(left, driving, driven)  # (F44)
            found[2 * i + 1] = negative + grown * where(left, driven, driving)  # (F44)


@kernel
def _level_at(p, at):
    n = p.numbers
    return Level(n[at], n[at + 1], n[at + 2], n[at + 3], n[at + 4], n[at + 5], n[at + 6])


@kernel
def uniform(p, L, found):
    """The same factor everywhere and in both directions, as :func:`scales` gives them."""
    for i in range(2 * p.at.places.shape[0]):
        found[i] = L


# Sites as one law: all of them in one motion, as if the bar were rigid, at one factor and without their own levels.


@kernel
def _same(p, L, found):
    for i in range(p.at.places.shape[0]):
        found[i] = L


@kernel
def _mean_all(p, L, memory, w, h):
    each = scratch.like(memory, MOST_SITES)
    _same(p, L, each)
    T, slope = _mean_below(Below(p), each, memory, w, h)
    if p.at.above:
        above, steep = mean_torque(law_at(p, 0), L, table_slice(memory, p.at.places, 0, 2), w, h)
        return above + T, steep + slope
    return T, slope


@kernel
def _rest_all(p, L, memory, h):
    rest = 0.0
    for i in range(p.at.above, p.at.places.shape[0]):
        rest += rest_torque(law_at(p, i), L, table_slice(memory, p.at.places, i, 2), h)
    return rest_torque(law_at(p, 0), L, table_slice(memory, p.at.places, 0, 2), h) + rest if p.at.above else rest


@kernel
def _advance_all(p, L, memory, w, h):
    for i in range(p.at.places.shape[0]):
        advance(law_at(p, i), L, table_slice(memory, p.at.places, i, 2), w, h)


@kernel
def _solve_all(p, L, memory, S, R, h, w_guess):
    if p.at.alone:
        return solve(law_at(p, 0), L, memory, S, R, h, w_guess)
    rest = _rest_all(p, L, memory, h)
    side = where(R > rest, 1.0, -1.0)
    start, _ = _mean_all(p, L, memory, side * 0.0, h)
    w = newton(p, L, memory, S, where(side * (R - start) > 0.0, R, start), h, w_guess, start)
    return where(R != rest, w, 0.0)


@kernel
def _torque_all(p, L, memory, w):
    T = 0.0
    for i in range(p.at.places.shape[0]):
        T += torque(law_at(p, i), L, table_slice(memory, p.at.places, i, 2), w)
    return T


@kernel
def _rate_all(p, L, memory, w, out):
    for i in range(p.at.places.shape[0]):
        rate(law_at(p, i), L, table_slice(memory, p.at.places, i, 2), w, table_slice(out, p.at.places, i, 2))


def _stored_in_all(p, memory):
    return sum(stored_energy(site.law, memory[site.start : site.end]) for site in p)


def bound(p: Any, wide: bool = False, linked: bool = False) -> Any:
    """A law, or sites, as a :class:`Bound` of this process, which stays as it is.

    ``wide`` is for kernels of four cars side by side, ``linked`` for object code that holds the laws too.
    """
    if isinstance(p, Bound):
        if linked or p.at.wide != wide:  # their types are equal, and one would call the functions of the other
            raise ValueError("friction is bound for another use: bind its parameters")
        return p
    idle = tuple(_idle(site.law) for site in p) if isinstance(p, Sites) else ()
    ends = tuple(site.end for site in p) if isinstance(p, Sites) else law_of(p).memory_size(p)
    key = units.structure(p), ends, idle, wide, linked
    if linked or not COMPILED or key not in _tables:
        _tables[key] = _table(p, idle, wide, linked)
    return Bound(packing.numbers(p), _tables[key])


_tables: dict[Any, Any] = {}  # of this process


def _table(p: Any, idle: tuple[bool, ...], wide: bool, linked: bool) -> Any:
    """The table of a :class:`Bound`; ``idle`` says of each site whether it is left out."""
    found: list[tuple[Any, int, int, int, int]] = []
    above = first = 0
    if not isinstance(p, Sites):
        found.append((p, 0, -1, 0, law_of(p).memory_size(p)))
    for name, site, without in zip(Sites._fields, p, idle):
        own = first + packing.numbers(site.law).size
        if not without:
            found.append((site.law, first, own, site.start, site.end))
            above += name == ABOVE
        first = own + _PER_SITE
    laws_there = [law for law, *_ in found]
    places = np.array([place for _, *place in found], np.int64).reshape(-1, 4)
    continuous = all(law_of(law).continuous for law in laws_there[above:])
    flags = above, int(continuous), int(wide), int(not isinstance(p, Sites))
    if not COMPILED:
        return Table(tuple(laws_there), places, places, *flags)
    codes = [unit.code(law, wide) for law in laws_there]
    sizes, addresses = (_stack([getattr(code, name) for code in codes]) for name in ("sizes", "addresses"))
    if not linked:
        return Table(addresses, sizes, places, *flags)
    functions = tuple(tuple((each or units.ABSENT, law) for each in unit.functions(law)) for law in laws_there)
    return units.Linked.of(Table(functions, sizes, places, *flags))


def _stack(rows: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Rows of different lengths as one array."""
    found = np.zeros((len(rows), max(map(len, rows), default=1)), np.int64)
    for i, row in enumerate(rows):
        found[i, : len(row)] = row
    return found


def active(p: Any) -> int:
    """At how many sites there is friction at all, which a :class:`Bound` counts."""
    return sum(not _idle(site.law) for site in p) if isinstance(p, Sites) else 1


def _idle(law: Any) -> bool:
    """Whether a law gives no torque at all, as the one at a site without friction."""
    return law_of(law).name == NOTHING["law"] and law.sigma_2 == NOTHING["sigma_2"]


_GROWTH = len(Level._fields)  # from the first number of a site's conditions to c_d
_PER_SITE = _GROWTH + 4


def _steepest_fall(p: Sites, torque_scale: float, h: float) -> float:
    return sum(law_of(site.law).steepest_fall(site.law, torque_scale, h) for site in p)


def sliding_torque(p: Any) -> float:
    """F_c of a law; of one without, its steady torque at a speed of nearly zero, after a long way [N m]."""
    if hasattr(p, "F_c"):
        return float(p.F_c)
    memory = np.zeros(law_of(p).memory_size(p))
    advance(p, 1.0, memory, 1e-3, 1e3)
    return float(torque(p, 1.0, memory, 1e-9))


def make_sites(given: Mapping[str, Any]) -> Sites:
    """Sites from a mapping of their names to laws.

    Parameters
    ----------
    given : mapping
        Of names of sites; or of a steering alone, ``{"column_eps": law}`` or ``{"rack_eps": law}``, whose sites take
        their shares of the law from ``steer_env.friction.defaults.SHARES``, the gear with an efficiency. A value is a
        law in a form of :func:`steer_env.friction.law.resolve`, which beside the law's own parameters may have keywords
        of :func:`steer_env.friction.level.make` and, at the gear, ``efficiency``: one number for both directions, two
        for driving and for being driven back, or a mapping of the arguments of :func:`steer_env.friction.gear.worm`;
        or, in its place, ``driving`` and ``driven``, c_d and c_b of (F44).

    Raises
    ------
    ValueError
        An unknown site, a law that cannot sit at one, or a value that is refused, with the name of the site.
    """
    for name in given:
        one_of("a site of friction", name, (ABOVE, *BELOW, *defaults.SHARES))
    given = _split_over_sites(given)
    sites, start = [], 0
    for name in (ABOVE, *BELOW):
        try:
            site = _site(name, given.get(name, NOTHING), start)
        except ValueError as error:
            raise ValueError(f"friction at {name}: {error}") from None
        sites.append(site)
        start = site.end
    return Sites(*sites)


def _split_over_sites(given: Mapping[str, Any]) -> dict[str, Any]:
    """The mapping with the shares of a law at its sites in place of a steering that it names."""
    found = dict(given)
    for steering in [name for name in defaults.SHARES if name in given]:
        shares = defaults.SHARES[steering]
        if other := sorted(given.keys() & {ABOVE, *BELOW, *defaults.SHARES} - {steering}):
            raise ValueError(f"friction at {steering} is that of all its sites: leave it or {other[0]} out")
        try:
            law, keys = laws.parts(found.pop(steering))
            own = {key: keys.pop(key) for key in _OWN_KEYS & keys.keys()}
            of_gear = {key: own.pop(key) for key in _OF_GEAR & own.keys()} or {
                "efficiency": defaults.GEAR_EFFICIENCY[steering]
            }
            p = laws.resolve({"law": law, **keys})
            found |= {site: {**laws.scaled(p, share), **own} for site, share in shares.items()}
        except ValueError as error:
            raise ValueError(f"friction at {steering}: {error}") from None
        found["gear"] |= of_gear
    return found


_OF_GEAR = {"efficiency", "driving", "driven"}
_OWN_KEYS = {*inspect.signature(make_level).parameters, *_OF_GEAR}


def _site(name: str, given: Any, start: int) -> Site:
    law, keys = laws.parts(given)
    own = {key: keys.pop(key) for key in _OWN_KEYS & keys.keys()}
    p = laws.resolve({"law": law, **keys})
    if law_of(p).mean_torque is None:
        raise ValueError(f"the law {law!r} has no mean_torque, which a site needs")
    of_gear = sorted(_OF_GEAR & own.keys())
    if of_gear and name != "gear":
        raise ValueError(f"{of_gear[0]} is that of the gear")
    driving, driven = (not_negative(key, own.pop(key, 0.0)) for key in ("driving", "driven"))
    if "efficiency" in own:
        if driving or driven:
            raise ValueError("give the efficiency, or driving and driven, which follow from it")
        growth = _growth(gear.efficiency(own.pop("efficiency")), p)
        driving, driven = map(not_negative, ("driving", "driven"), growth)
    level = construct("level", make_level, own)
    return Site(p, level, driving, driven, start, start + law_of(p).memory_size(p))


def _growth(efficiency: gear.Efficiency, p: Any) -> tuple[float, float]:
    """c_d and c_b of (F44): a motor torque of 1 N m adds 1 - eta_d where it drives, 1/eta_b - 1 where it is driven."""
    F, lost = sliding_torque(p), (1.0 - efficiency.driving, 1.0 / efficiency.driven - 1.0)
    if any(lost) and not F > LEAST_SLIDING_TORQUE:
        raise ValueError(
            f"friction law {law_of(p).name!r} has no sliding torque that could grow with the load: give efficiency=1"
        )
    return lost[0] / max(F, LEAST_SLIDING_TORQUE), lost[1] / max(F, LEAST_SLIDING_TORQUE)


def _unbound(kernel: Any, p: Any, *arguments: Any) -> Any:
    """A kernel of all sites, for a caller in Python."""
    return kernel(bound(p), *arguments)


_OF_ALL = {
    "advance": _advance_all,
    "torque": _torque_all,
    "rate": _rate_all,
    "mean_torque": _mean_all,
    "solve": _solve_all,
    "rest_torque": _rest_all,
}
_SITES_LAW = Law(
    name="sites",
    parameters=Sites,
    make=make_sites,
    memory_size=lambda p: p.motor.end,
    fitted=(),
    units={},
    steepest_fall=_steepest_fall,
    relaxes=True,  # some of them do
    continuous=False,
    wide=True,  # where all of them are
    modes=lambda p: 0,
    parity=lambda p: sum((law_of(site.law).parity(site.law) for site in p), ()),
    permission=lambda p: {},
    extends="",
    stored_energy=_stored_in_all,
    **{name: functools.partial(_unbound, kernel) for name, kernel in _OF_ALL.items()},
)
LAWS.know(Sites, _SITES_LAW)
LAWS.know(
    Bound,
    _SITES_LAW._replace(parameters=Bound, memory_size=lambda p: int(p.at.places[:, 3].max(initial=0)), **_OF_ALL),
)
LAWS.know(Below, _SITES_LAW._replace(parameters=Below, mean_torque=_mean_below))


def wide(p: Any) -> bool:
    """Whether a law, or those of all sites, have kernels that take vectors of cars too."""
    return all(law_of(site.law).wide for site in p) if isinstance(p, Sites) else law_of(p).wide


def falls(p: Any, conditions: Level, base: float, load: float, motor: float, h: float) -> tuple[float, float]:
    """The largest decrease of the mean torque with the speed, above and below the torsion bar [N m s/rad].

    Of all laws below the bar together, at the largest level of each of them under these loads, which are those of
    :func:`scales`; ``h`` is the step [s].
    """
    if not isinstance(p, Sites):
        return 0.0, law_of(p).steepest_fall(p, largest(conditions, base, load), h)
    found = falls_by_site(p, conditions, base, load, motor, h)
    return found[ABOVE], sum(found[name] for name in BELOW)


def falls_by_site(p: Sites, conditions: Level, base: float, load: float, motor: float, h: float) -> dict[str, float]:
    """The largest decrease of the mean torque of each site with its speed, as in :func:`falls` [N m s/rad]."""
    of_car, found = largest(conditions, base, load), {}
    for name, site in p._asdict().items():
        of_all, pressed = (base, 0.0) if name == ABOVE else (of_car, load)
        scale = of_all * largest(site.level, 1.0, pressed) + base * max(site.driving, site.driven) * motor  # (F44)
        found[name] = law_of(site.law).steepest_fall(site.law, scale, h)
    return found


def resolve(friction: Any) -> Any:
    """Parameters of a law, or sites, from every form in which friction may be given.

    Parameters
    ----------
    friction : str, mapping, parameters or Sites
        A law as :func:`steer_env.friction.law.resolve` takes it, which then sits below the torsion bar; a mapping of
        sites as :func:`make_sites` takes it, or as text, ``"masing,efficiency=0.88@gear+coulomb@upper_column"``, or in
        a file (:mod:`steer_env.friction.fitted_file`); or sites, which are returned unchanged.

    Raises
    ------
    ValueError
        As of these functions.
    """
    if isinstance(friction, Sites):
        return friction
    if isinstance(friction, Mapping) and (friction.keys() & {ABOVE, *BELOW, *defaults.SHARES} or _of_laws(friction)):
        return make_sites(friction)
    if fitted_file.is_file_name(friction) and fitted_file.of_sites(friction):
        held = fitted_file.read(friction)
        try:
            return make_sites(held)
        except ValueError as error:
            raise ValueError(f"{friction}: {error}") from None
    if isinstance(friction, str) and "@" in friction and not fitted_file.is_file_name(friction):
        return make_sites(_of_text(friction))
    return laws.resolve(friction)


def _of_laws(given: Mapping[str, Any]) -> bool:
    """Whether a mapping is meant for sites, whose names may be wrong, and not for the parameters of a law."""
    each = (isinstance(law, str | Mapping) or LAWS.of(type(law)) is not None for law in given.values())
    return "law" not in given and any(each)


def _of_text(text: str) -> dict[str, Any]:
    """Sites from ``LAW[,key=value...]@SITE``, several of them joined by ``+``."""
    pieces = re.findall(r"(?:^|\+)([^@]+)@([a-z_]+)(?=\+|$)", text)
    if "+".join(map("@".join, pieces)) != text or len({site for _, site in pieces}) < len(pieces):
        raise ValueError(f"expected {SITES_SYNTAX}, each site once, got {text!r}")
    return {site: law for law, site in pieces}


def resolve_one(friction: Any, what: str) -> Any:
    """Parameters of a law, as :func:`resolve`; ValueError for several sites, which ``what`` does not know."""
    p = resolve(friction)
    if isinstance(p, Sites):
        raise ValueError(f"{what} knows one site of friction: give one law")
    return p


def as_mapping(p: Any) -> dict[str, Any]:
    """The mapping that :func:`resolve` turns into these parameters again, of what JSON holds without loss."""
    if not isinstance(p, Sites):
        return laws.as_mapping(p)
    found = {}
    for name, site in zip(p._fields, p):
        own = {key: value for key, value in site.level._asdict().items() if value != getattr(Level(), key)}
        growth = {key: getattr(site, key) for key in ("driving", "driven") if getattr(site, key)}
        law = laws.as_mapping(site.law)
        if law != NOTHING:
            found[name] = {**law, **own, **growth}
    return found or {BELOW[0]: dict(NOTHING)}


def below(p: Any) -> Any:
    """The friction below the torsion bar: a law itself, or the sites without the one above."""
    if not isinstance(p, Sites):
        return p
    return make_sites({name: given for name, given in as_mapping(p).items() if name != ABOVE})


def transmissions(p: Any) -> tuple[float, ...]:
    """What the friction of a gear makes of a change of the motor's torque [1] (E25).

    1 at rest; sliding eta_d, where the motor drives, and 1/eta_b, where it is driven back. Without an efficiency 1
    alone. The level of the car is its default one.
    """
    if not isinstance(p, Sites) or not (p.gear.driving or p.gear.driven):
        return (1.0,)
    F = sliding_torque(p.gear.law)
    return 1.0, max(1.0 - p.gear.driving * F, 0.0), 1.0 + p.gear.driven * F  # (F44)


def friction_name(p: Any) -> str:
    """The name of a law; of sites ``LAW@SITE``, joined by ``+``."""
    if not isinstance(p, Sites):
        return law_of(p).name
    return "+".join(f"{given['law']}@{name}" for name, given in as_mapping(p).items())


def acts(p: Sites, name: str, field: str, *fields: str) -> bool:
    """Whether a number of a site, by the names of the fields that lead to it, changes the friction at all."""
    law = getattr(p, name).law
    if laws.as_mapping(law) == NOTHING:
        return False
    if field in ("driving", "driven"):
        return name == "gear" and sliding_torque(law) > LEAST_SLIDING_TORQUE
    return (name, field, *fields) != (ABOVE, "level", "load")  # which the rack force does not press


def varied(friction: Any, values: Mapping[str, float]) -> Any:
    """Friction in a form of :func:`resolve` with other values of its parameters.

    Parameters
    ----------
    values : mapping
        Parameters of the law; of sites ``SITE.PARAMETER``, or without ``SITE.`` where one law is given for all.

    Raises
    ------
    ValueError
        As of :func:`resolve`, and for a site that this friction does not have.
    """
    p = resolve(friction)
    if not isinstance(p, Sites):
        name, given = laws.parts(friction)
        return laws.make(name, **{**given, **values})
    given = as_given(friction)
    for key, value in values.items():
        site, dot, name = str(key).rpartition(".")
        if not dot and len(given) == 1:
            (site,) = given
        if given.keys() & defaults.SHARES and site not in given:
            (kind,) = given
            raise ValueError(
                f"one law stands at all sites of {kind}: name its parameter without a site, as F_c, or give each site "
                f"its law, got {key!r}"
            )
        one_of("the site of friction", site, tuple(given))
        given[site][name] = value
    return make_sites(given)


def as_given(friction: Any) -> dict[str, dict[str, Any]]:
    """Sites from a form of :func:`resolve` as they were given, so that what was left out follows what is changed."""
    if isinstance(friction, Sites):
        friction = as_mapping(friction)
    if fitted_file.is_file_name(friction):
        friction = fitted_file.read(friction)
    found = _of_text(friction) if isinstance(friction, str) else friction
    return {site: {"law": law, **own} for site, (law, own) in ((site, laws.parts(own)) for site, own in found.items())}


def with_defaults(friction: Any) -> dict[str, dict[str, Any]]:
    """Sites as of :func:`as_given`, with the parameters of their laws that were left out, for :func:`varied`."""
    found = as_given(friction)
    for site, given in found.items():
        p = laws.resolve({key: value for key, value in given.items() if key not in _OWN_KEYS})
        usual = {"efficiency": defaults.GEAR_EFFICIENCY[site]} if site in defaults.SHARES else {}
        found[site] = {**laws.as_mapping(p), **({} if _OF_GEAR & given.keys() else usual), **given}
    return found


def as_text(friction: Any) -> str:
    """A law or sites in a form of :func:`resolve` as the text that it turns into them again, without a file."""
    if not isinstance(p := resolve(friction), Sites):
        return _law_as_text(as_mapping(p))
    found = []
    for site, own in as_given(friction).items():
        if isinstance(own.get("efficiency"), Mapping):
            own["efficiency"] = gear.efficiency(own["efficiency"])
        found.append(f"{_law_as_text(own)}@{site}")
    return "+".join(found)


def _law_as_text(given: Mapping[str, Any]) -> str:
    return ",".join([given["law"], *(f"{key}={_word(value)}" for key, value in given.items() if key != "law")])


def _word(value: Any) -> str:
    """A value as text without loss; a list as ``a:b:c``."""
    if np.ndim(value):
        return ":".join(map(_word, value))
    return str(value) if isinstance(value, str | bool) else repr(float(value)).removesuffix(".0")
