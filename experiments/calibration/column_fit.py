"""Boost, motor damping and friction of a car, found by driving its column and chassis through drives.

    B(T) = s max(|T| - T_d, 0) sgn(T)                                                       (H3)

is the boost that replaces the table of the car: gradient s beyond a dead band T_d of the torsion-bar torque. With the
factor D on the motor damping, and the level F_c and the pre-sliding distance x_c of the friction at the column, it is
fitted by least squares to the parts of the drives that do not judge. The car follows handwheel angle and speed, and the
bank of (H2), whose b is fitted for each drive in which the speed varies, pulls at its centre of gravity; the torque of
a drive is only compared, less the offset T_0 that leaves least, which is added to that of the car.

Rack force, ratio and everything else are those of the car, so that a car with twice the rack force has twice 1 + s.

Friction above the torsion bar adds to the torque of the hands and to nothing else that follows a handwheel angle: not
to the torque of the bar, which is below it, and not to that of the motor, which follows the bar's. Where one of these
was recorded beside that of the hands, the car is compared with all of them, and friction F_u with a pre-sliding
distance x_u of its own sits above the bar. With the motor's torque rack force and boost are told apart too, by a factor
n on the pneumatic trail. Errors of the channels are alike, as they come from the same road: each is weighted by the
inverse of their covariance, which is that of the residuals of a first fit.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares, lsq_linear

from steer_env import friction
from steer_env.friction.identification.blocks import drawn_means, percentile_interval, redrawn, widened
from steer_env.friction.numerics.thread_pool import one_blas_thread
from steer_env.hand_torque import Drive, Identified
from steer_env.hand_torque.drive import SLOWEST
from steer_env.hand_torque.drive import TORQUES as RECORDED
from steer_env.hand_torque.fit import X_C, blocks
from steer_env.hand_torque.model import RATE, bends, has_distance, stretched
from steer_env.manoeuvres import Manoeuvre
from steer_env.manoeuvres.common.driving import build_plant, drive_plant, open_loop
from steer_env.manoeuvres.common.shapes import ramp_and_hold
from steer_env.vehicle import cars
from steer_env.vehicle.chassis.common.interface import SPEED_MAX, TARGET_SPEED, WIND_FORCE
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.steering import eps
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

FADE = 2.0  # from straight ahead to the angle of the drive ...
RUN_IN = 10.0  # ... and from there to the first sample that is compared, so that the car follows; both assumed [s]
LONGEST = 300.0  # of either part that the car is driven through, next to where judging begins; assumed [s]
TORQUES = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0)  # of a row [N m]
ROUNDS = 25  # of least squares, at most
PASSES = 2  # of least squares where several torques are compared, the second with the covariance of the first
SETTLED = 1e-3  # least deviation of a torque that a covariance knows, assumed [N m]
LEVEL_MIN = 1e-3  # of a law, which has no level of zero [N m]
# What the intervals of levels add: of two, for a boost that is not (H3), which moves one level against the other; and
# for noise of the angle, which takes away from friction that builds up at once. Both as drives of known friction show.
MISFIT_TORQUE, LOST_SHARE = 0.05, 0.2  # [N m], [1]
NO_LAW = "no dry law was fitted, so that nothing is told of friction above the torsion bar or below it"
VARIED = 0.05  # deviation of the speed over its mean from which on the bank is told from the car's lag, assumed [1]
ADDED = {"F_u", "x_u"}  # terms with which the car moves alike
FEWEST = {"fitted": 45.0, "judging": 10.0}  # seconds of either part of a drive that must be compared, assumed [s]


class Term(NamedTuple):
    """A number that is fitted, in ``unit``."""

    start: float  # of the search [unit]
    least: float  # far beyond usual cars, as the largest is [unit]
    largest: float  # [unit]
    step: float  # of slopes [unit]
    unit: str
    meaning: str


TERMS = {
    "s": Term(3.0, 0.0, 15.0, 0.05, "1", "gradient of the boost"),
    "T_d": Term(0.1, 0.0, 1.0, 0.01, "N m", "dead band of the boost"),
    "D": Term(1.0, 0.0, 20.0, 0.05, "1", "factor on the motor damping"),
    "F_c": Term(0.5, 0.0, 6.0, 0.02, "N m", "level of the friction at the column, below the torsion bar"),
    "x_c": Term(math.radians(0.3), X_C[0], X_C[-1], 4e-4, "rad", "its pre-sliding distance"),
    "F_u": Term(0.1, 0.0, 6.0, 0.02, "N m", "level of the friction above the torsion bar"),
    "x_u": Term(math.radians(0.3), X_C[0], X_C[-1], 4e-4, "rad", "its pre-sliding distance"),
    "b": Term(100.0, 0.0, 1500.0, 10.0, "m2/s2", "square of the speed at which the bank leads the car through bends"),
    "n": Term(1.0, 0.0, 10.0, 0.02, "1", "factor on the pneumatic trail, and so on most of the rack force"),
}


class ColumnFit(NamedTuple):
    """A car that was fitted to a drive, and what it leaves of the part that judges."""

    car: cars.Car
    friction: Any  # parameters of the law at its column, or sites; without a dry law viscous friction of zero
    speed: float  # at which the boost is that of the terms, the mean of the fitted part [m/s]
    terms: Mapping[str, float]  # of ``TERMS``; b of a second drive is b2
    intervals: Mapping[str, tuple[float, float]]  # 95 %, from blocks drawn anew about the linearised car
    offsets: tuple[Mapping[str, float], ...]  # of each drive, by its torque, T_0 first [N m]
    residual: float  # root mean square that is left of the hand torque, or the bar's, that was not fitted [N m]
    adds: float  # by how much it leaves less than the same car fitted without dry friction [N m]
    adds_interval: tuple[float, float]  # 95 % [N m]
    limited: tuple[str, ...]  # terms that ended at a limit of the search, with dry friction or without
    one_site: str  # why the friction is that of one site, a sentence; empty where it is told above the bar from below

    @property
    def shown(self) -> dict[str, bool]:
        """Whether the friction of each level is shown: whether its interval is above zero."""
        return {name: self.intervals[name][0] > 0.0 for name in ("F_u", "F_c") if name in self.terms}


def fit_column(
    found: Identified, base: cars.Car, seed: int = 0, notify: Callable[[float, str], None] = lambda part, text: None
) -> ColumnFit:
    """Fit boost, motor damping and friction of a car to drives, with the law that leaves least of their fitted parts.

    Parameters
    ----------
    found : Identified
        The drive, the part that judges, and the law.
    base : Car
        Everything that is not fitted.
    seed : int
        Of the draws of the intervals.
    notify : callable
        Told the part that is done and what comes next.

    Raises
    ------
    ValueError
        If the car cannot be driven through the drive, for example as its assist loop is unstable, or if too little of a
        part can be compared.
    """
    drives, law = found.drives, found.best.name if found.dry else None
    car = cars.load(base.data(), {"steering.friction_load": 0.0})  # the level is that of whole drives
    early = [slice(max(first - round(LONGEST * RATE), 0), first) for first in found.firsts]
    late = [slice(max(first - round(RUN_IN * RATE), 0), first + round(LONGEST * RATE)) for first in found.firsts]
    _check(drives, early, late)
    speed = float(np.concatenate([d.speed[part][_used(d, part)] for d, part in zip(drives, early)]).mean())
    squares: dict[str | None, Array] = {}
    terms: dict[str, float] = {}
    limited: list[str] = []
    offsets: list[Array] = []
    with one_blas_thread():
        for each in dict.fromkeys((None, law)):
            notify(0.3 * len(squares), f"column and chassis with {each or 'no dry friction'}")
            ways = [_part(car, d, part, i, speed, each) for i, (d, part) in enumerate(zip(drives, early))]
            terms, intervals = _fitted(ways, terms, seed)
            limited += _at_limits({name: terms[name] for name in terms if intervals[name] != (X_C[0], X_C[-1])})
            offsets = [-_errors(way, terms).mean(axis=0) for way in ways]
            unseen = [_part(car, d, part, i, speed, each) for i, (d, part) in enumerate(zip(drives, late))]
            left = [(_errors(way, terms) + offset)[:, 0] ** 2 for way, offset in zip(unseen, offsets)]
            squares[each] = np.concatenate(left)
    if stuck := [name for name in ("F_c", "F_u") if name in limited]:
        raise ValueError(
            f"no friction of a car describes the drive: {', '.join(stuck)} ends at the limit of the search, "
            f"{TERMS['F_c'].largest:g} N m; are channels exchanged, or is a torque not in N m?"
        )
    drawn = {each: np.sqrt(drawn_means(of, blocks(of.size), seed)) for each, of in squares.items()}
    residual = {each: float(np.sqrt(of.mean())) for each, of in squares.items()}
    assist = {f"assist.{key}": value for key, value in changes(car, terms, speed).items()}
    sites = {"lower_column": _below(law, terms), "upper_column": _above(law, terms)}
    return ColumnFit(
        _with_trail(cars.load(car.data(), assist), terms.get("n", 1.0)),
        friction.resolve(sites if "F_u" in terms else sites["lower_column"]),
        speed,
        terms,
        intervals,
        tuple(dict(zip(_compared(d), map(float, each))) for d, each in zip(drives, offsets)),
        residual=residual[law],
        adds=residual[None] - residual[law],
        adds_interval=percentile_interval(drawn[None] - drawn[law]),
        limited=tuple(dict.fromkeys(limited)),
        one_site=one_site(drives[0]) or ("" if law else NO_LAW),
    )


def _check(drives: Sequence[Drive], early: Sequence[slice], late: Sequence[slice]) -> None:
    """ValueError where a car cannot be compared with the drives."""
    for name, parts in (("fitted", early), ("judging", late)):
        for i, (d, part) in enumerate(zip(drives, parts)):
            if (seconds := _used(d, part).sum() / RATE) < FEWEST[name]:
                whose = f" of drive {i + 1}" if len(drives) > 1 else ""
                raise ValueError(
                    f"{seconds:.3g} s of the {name} part{whose} can be compared with a car, and {FEWEST[name]:g} s are "
                    "needed"
                )
    if (fastest := max(d.speed.max() for d in drives)) > SPEED_MAX:
        raise ValueError(f"the drive reaches {3.6 * fastest:.4g} km/h, and cars drive up to {3.6 * SPEED_MAX:.4g}")
    if len({tuple(_compared(d)) for d in drives}) > 1:
        kept = " and ".join(", ".join(_compared(d)) for d in drives)
        raise ValueError(
            f"the drives have other torques, {kept}, and a car is fitted to drives with the same ones: leave out what "
            "another one lacks, --without NAME"
        )


def one_site(d: Drive) -> str:
    """Why a drive cannot tell friction above the torsion bar from friction below it; empty where it can."""
    if "handwheel_torque" not in d.torques:
        return (
            "the drive cannot tell friction above the torsion bar from friction below it: it has no handwheel_torque, "
            "and no other torque contains what is above the bar"
        )
    if len(d.torques) == 1:
        return (
            "the drive cannot tell friction above the torsion bar from friction below it: handwheel_torque has both, "
            "and it has no motor_torque or torsion_bar_torque beside it"
        )
    return ""


def changes(car: cars.Car, terms: Mapping[str, float], speed: float) -> dict[str, Any]:
    """The keys of the assist that hold the boost (H3) and the motor damping of ``terms``.

    The boost is that at ``speed`` [m/s]; at other speeds it is larger or smaller as the boost of the car is at the last
    torque of its table. ValueError where that is zero at ``speed``.
    """
    assist = car.data()["assist"]
    most = np.array(assist["boost"])[:, -1] * assist["boost_scale"]
    there = np.interp(speed, assist["speeds"], most)
    if not there > 0.0:
        raise ValueError(f"{car.name} has no boost at {3.6 * speed:.3g} km/h, of which the drive could tell the size")
    share = most / there
    row = terms["s"] * np.maximum(np.array(TORQUES) - terms["T_d"], 0.0)  # (H3)
    return {
        "torques": list(TORQUES),
        "boost": np.outer(share, row).tolist(),
        "boost_scale": 1.0,
        "damping": (terms["D"] * np.array(assist["damping"])).tolist(),
    }


class _Part(NamedTuple):
    """A part of a drive that a car is driven through."""

    car: cars.Car
    law: str | None  # None: no dry friction
    balance: str  # name of its b among the terms; empty where the speed hardly varies, and the road is taken as level
    plant: Plant  # of the car, with its own assist
    manoeuvre: Manoeuvre
    bends: Array  # (T,) kappa_s of (H2) [1/m]
    speed: float  # of the boost (H3) [m/s]
    time: Array  # (T,) from its start [s]
    torques: Mapping[str, Array]  # channel of the car -> (T,) measured, that of the hands or the bar first [N m]
    used: NDArray[np.bool_]  # (T,) that are compared


def _compared(d: Drive) -> dict[str, Array]:
    """The torques of a drive with which a car is compared, (T,) each [N m]."""
    if one_site(d):
        return {"torsion_bar_torque": d.torque}
    return {name: d.torques[name] for name in RECORDED if name in d.torques}


def _part(car: cars.Car, d: Drive, part: slice, i: int, boosted: float, law: str | None) -> _Part:
    time, speed = d.time[part] - d.time[part.start], np.clip(d.speed[part], SLOWEST, SPEED_MAX)
    curve = CubicSpline(time, d.angle[part])

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        on, change = ramp_and_hold(t, 1.0, FADE)
        return amplitude * on * curve(t), amplitude * (change * curve(t) + on * curve(t, 1))

    manoeuvre = Manoeuvre(
        name="drive",
        hands="the handwheel angle of a drive",
        source="the drive",
        speed=float(speed[0]),
        duration=float(time[-1]),
        hand=hand,
        amplitude=1.0,
        chassis="two_track",
        others={TARGET_SPEED: lambda t: np.interp(t, time, speed) - speed[0]},
    )
    p = build_plant(car, manoeuvre, _below(law, {name: term.start for name, term in TERMS.items()}))
    measured = {name: values[part] for name, values in _compared(d).items()}
    kappa = bends(d.prior, d.angle, d.speed, d.dt)[part]
    name = ("b" if i == 0 else f"b{i + 1}") if np.std(d.speed) > VARIED * np.mean(d.speed) else ""
    return _Part(car, law, name, p, manoeuvre, kappa, boosted, time, measured, _used(d, part))


def _used(d: Drive, part: slice) -> NDArray[np.bool_]:
    """Samples of a part that are compared."""
    return (d.weight[part] > 0.0) & (d.time[part] - d.time[part.start] >= RUN_IN)


def _law(law: str | None, level: float, distance: float) -> Any:
    if law is None:
        return friction.make("viscous", sigma_2=0.0)
    return stretched(law, max(level, LEVEL_MIN), distance)


def _below(law: str | None, terms: Mapping[str, float]) -> Any:
    return _law(law, terms.get("F_c", 0.0), terms.get("x_c", TERMS["x_c"].start))


def _above(law: str | None, terms: Mapping[str, float]) -> Any:
    return _law(law, terms.get("F_u", 0.0), terms.get("x_u", TERMS["x_u"].start))


def _with_trail(car: cars.Car, factor: float) -> cars.Car:
    """The car with a factor on the pneumatic trail of its tyres."""
    if factor == 1.0:
        return car
    given = car.tyre.coefficients
    scaled = given._replace(QDZ1=factor * given.QDZ1, QDZ2=factor * given.QDZ2)
    name, source = f"{car.tyre.name}_trail", f"{car.tyre.source}; QDZ1 and QDZ2 times {factor:.3g}"
    return car._replace(tyre=replace(car.tyre, name=name, source=source, coefficients=scaled))


def _driven(part: _Part, terms: Mapping[str, float]) -> Mapping[str, Array]:
    """Channels of the car with the terms that change how it moves."""
    assist = eps.make(**{**part.car.data()["assist"], **changes(part.car, terms, part.speed)})
    own = part.plant
    if "n" in terms:
        own = build_plant(_with_trail(part.car, terms["n"]), part.manoeuvre, own.friction)
    own = own._replace(assist=assist, friction=_below(part.law, terms))
    pull = terms.get(part.balance, 0.0) * part.bends * part.car.chassis["mass"]  # of (H2), to the inside of the bend
    banked = replace(
        part.manoeuvre, others={**part.manoeuvre.others, WIND_FORCE: lambda t: np.interp(t, part.time, pull)}
    )
    return drive_plant(part.car, own, banked, open_loop(own, banked)).channels


def _errors(part: _Part, terms: Mapping[str, float], made: Mapping[str, Array] | None = None) -> Array:
    """Torques of the car less the measured ones, where they are compared (T, channels) [N m]."""
    made = _driven(part, terms) if made is None else made
    angle, added = made["handwheel_angle"], {}
    if "F_u" in terms:  # a handwheel that is led feels it, and nothing below does (F43)
        added["handwheel_torque"] = friction.response(_above(part.law, terms), angle, SAMPLE_TIME)
    time = SAMPLE_TIME * np.arange(1.0, angle.size + 1.0)
    errors = [
        np.interp(part.time, time, made[name] + added.get(name, 0.0)) - measured
        for name, measured in part.torques.items()
    ]
    return np.column_stack(errors)[part.used]


def make_term(name: str) -> Term:
    """What is known of a term; each drive has a b of its own."""
    return TERMS["b" if name.startswith("b") else name]


def _terms_of(parts: Sequence[_Part]) -> list[str]:
    """Names of the terms that are fitted to parts of drives."""
    part = parts[0]
    lacks = set() if "motor_torque" in part.torques else {"n"}
    lacks |= set() if "handwheel_torque" in part.torques else {"F_u", "x_u"}
    lacks |= {"F_c", "x_c", "F_u", "x_u"} if part.law is None else set()
    lacks |= set() if part.law is None or has_distance(part.law) else {"x_c", "x_u"}
    names = [name for name in TERMS if name not in lacks and name != "b"]
    return names + [each.balance for each in parts if each.balance]


def _fitted(
    parts: Sequence[_Part], start: Mapping[str, float], seed: int
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Terms that leave least of parts of drives, each with the offsets that leave least, and their intervals."""
    names, channels = _terms_of(parts), len(parts[0].torques)
    least, largest, step = (np.array([make_term(name)[i] for name in names]) for i in (1, 2, 3))
    measured = [np.column_stack([each[part.used] for each in part.torques.values()]) for part in parts]
    white = np.diag(1.0 / np.std(np.concatenate([each - each.mean(axis=0) for each in measured]), axis=0))
    bad = np.concatenate([np.tile(10.0 * white @ np.ptp(each, axis=0), len(each)) for each in measured])

    @lru_cache(maxsize=2 * len(names) * len(parts))  # of what is the same for terms that only add to a torque
    def moved(i: int, *moving: tuple[str, float]) -> Mapping[str, Array]:
        return _driven(parts[i], dict(moving))

    def errors(x: Array) -> list[Array]:
        terms = dict(zip(names, map(float, x)))
        found = []
        for i, part in enumerate(parts):
            alike = ADDED | {each.balance for each in parts if each is not part}
            moving = [each for each in terms.items() if each[0] not in alike]
            found.append(_errors(part, terms, moved(i, *moving)))
        return [each - each.mean(axis=0) for each in found]

    def error(x: Array) -> Array:
        return np.concatenate([(each @ white.T).ravel() for each in errors(x)])

    def tried(x: Array) -> Array:
        try:
            return error(x)
        except ValueError:  # the loop is unstable, or the car spins: no good value
            return bad

    def slope(x: Array, here: Array, h: Array) -> Array:
        try:
            return (error(x + h) - here) / h.sum()
        except ValueError:  # of a boundary, on whose other side it is
            return (here - error(x - h)) / h.sum()

    def slopes(x: Array) -> Array:
        here = error(x)
        return np.column_stack([slope(x, here, h) for h in np.diag(np.where(x + step < largest, step, -step))])

    x = np.array([start.get(name, make_term(name).start) for name in names])
    error(x)  # tells why the car cannot be driven
    for k in range(PASSES if channels > 1 else 1):
        if k:
            left = np.concatenate(errors(x))
            covariance = left.T @ left / len(left) + SETTLED**2 * np.eye(channels)
            white = np.linalg.inv(np.linalg.cholesky(covariance))
        best = least_squares(tried, x, slopes, (least, largest), x_scale=20.0 * step, ftol=1e-4, max_nfev=ROUNDS)
        x = best.x
    own, block = 0, []
    for part in parts:
        each = blocks(part.used.sum())
        block.append(np.repeat(own + each, channels))
        own += int(each.max()) + 1
    of = _sums_of(best.jac, best.fun, np.concatenate(block))
    rows = own * channels
    wide = widened(rows, max(rows - len(names) - channels * len(parts), 1))
    bounds = (least - x) / step, (largest - x) / step
    draws = wide * step * np.array([_least(n, of, step, bounds) for n in redrawn(own, seed)])
    ends = np.clip(x + np.array([percentile_interval(values) for values in draws.T]).T, least, largest)
    low, high = np.minimum(ends[0], x), np.maximum(ends[1], x)
    terms = dict(zip(names, map(float, x)))
    intervals = {name: (float(a), float(b)) for name, a, b in zip(names, low, high)}
    misfit = MISFIT_TORQUE if channels > 1 else 0.0
    intervals |= {
        level: _level_interval(terms[level], *intervals[level], misfit) for level in ("F_c", "F_u") if level in terms
    }
    for level, distance in (("F_c", "x_c"), ("F_u", "x_u")):
        if distance in intervals and not intervals[level][0] > 0.0:  # of no friction, nothing tells the distance
            intervals[distance] = (X_C[0], X_C[-1])
    return terms, intervals


def _level_interval(value: float, low: float, high: float, misfit: float) -> tuple[float, float]:
    """The interval of a level, from that of its blocks, with a misfit [N m] and ``LOST_SHARE``."""
    below, above = math.hypot(value - low, misfit), math.hypot(high - value, misfit, LOST_SHARE * value)
    return max(value - below, 0.0), value + above


def _sums_of(J: Array, e: Array, block: NDArray[np.int64]) -> tuple[Array, Array]:
    """Sums by block of products of slopes (n, m) with slopes, (B, m, m), and with errors (n,), (B, m)."""
    parts = [(J[block == b], e[block == b]) for b in range(int(block.max()) + 1)]
    return np.array([K.T @ K for K, _ in parts]), np.array([K.T @ r for K, r in parts])


def _least(times: Array, of: tuple[Array, Array], step: Array, bounds: tuple[Array, Array]) -> Array:
    """Change of the terms, in steps, that leaves least of the linearised car within their bounds.

    ``times`` (B,) says how often a block counts. A term at its bound stays there, as it does in the fit, where without
    bounds the others would give way to it.
    """
    G, h = np.tensordot(times, of[0], 1) * np.outer(step, step), -(times @ of[1]) * step
    values, vectors = np.linalg.eigh(G)
    root = np.sqrt(np.maximum(values, 1e-9 * values[-1]))
    changed: Array = lsq_linear(root[:, None] * vectors.T, vectors.T @ h / root, bounds, method="bvls").x
    return changed


def _at_limits(terms: Mapping[str, float]) -> list[str]:
    """Terms that ended within a hundredth of a limit of the search, other than zero, which limits what there can be."""
    return [
        name
        for name, value in terms.items()
        if any(end and abs(value - end) < max(make_term(name).step, 0.01 * abs(end)) for end in make_term(name)[1:3])
    ]
