"""``friction.fit``: parameters of a law from a record (F12)."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.identification.branches import BAND as SWING
from steer_env.friction.identification.branches import Branches, branches_of, stiffness_of, weighed_of
from steer_env.friction.identification.determined import (
    Estimate,
    bootstrapped,
    by_periods,
    determined,
    far_slide,
    half_widths,
    linear,
    profiled,
)
from steer_env.friction.identification.displacement import BAND, deviation_of, motion_of
from steer_env.friction.identification.elements import Elements, SliderSet, at_ends, beside, fitted_sliders
from steer_env.friction.identification.position import FITTED, NAMES, Position, with_position
from steer_env.friction.identification.position import joint as joint_with_position
from steer_env.friction.identification.position import told as told_of_position
from steer_env.friction.identification.problem import Problem, searched
from steer_env.friction.identification.quality import by_noise, own_noise, refuse
from steer_env.friction.identification.rate import Rate, joint, told, with_rate
from steer_env.friction.identification.record import Record, checked
from steer_env.friction.identification.remarks import remarks
from steer_env.friction.identification.scales import Scales, scaled
from steer_env.friction.identification.space import space_of, within_law
from steer_env.friction.law import Law, Sliders, law_of, make
from steer_env.friction.level import Level
from steer_env.friction.numerics.check import number, one_of, positive, whole

STEP = 1e-5  # of a coordinate, for the derivative of the saturated torque [1]
INTERVALS = ("periods", "linear", "bootstrap", "profile")

Bound = float | NDArray[np.float64]  # an array for a curve


class Fit(NamedTuple):
    """What :func:`fit` found.

    The record is ``steer_env.friction.response(parameters, x, dt) + offset + inertia x''`` and a residual, with ``x``
    freed of its noise.
    """

    law: str
    parameters: Any  # as from friction.make
    intervals: dict[str, tuple[Bound, Bound]]  # name -> (low, high), 95 %, in the parameter's unit
    offset: float  # constant part of the measured torque [N m]
    residual: float  # RMS over the weighed samples [N m]
    warnings: tuple[str, ...]
    level: Any = None  # steer_env.friction.level.Level, where load or position change the friction
    undetermined: tuple[str, ...] = ()  # names of the parameters that the record does not determine
    explained: float = 0.0  # share of the variance of the weighed torque [1]
    inertia: float = 0.0  # that the torque sensor moves along, given or estimated [kg m2]
    limits: Mapping[str, tuple[bool, bool]] = {}  # name -> whether the low and the high end are bounds of the law
    sets: tuple[SliderSet, ...] = ()  # of sliders in parallel, that the record tells from each other
    saturated: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # far one way, and its interval [N m]
    asymmetry: tuple[float, float, float] = (
        math.nan,
        math.nan,
        math.nan,
    )  # in place of the offset, and its interval [1]


class Options(NamedTuple):
    """How :func:`fit` goes about it."""

    fixed: Mapping[str, float] = {}  # in the units of the record
    starts: int = 3
    intervals: str = "periods"
    global_search: bool = False
    seed: int = 0
    order: float | str | None = None  # of the level over the position, FITTED, or None for a level that is the same [1]


class Prepared(NamedTuple):
    """A record made ready for every law."""

    record: Record  # with x freed of its noise, and the torque of the inertia subtracted
    inertia: float | None  # None: to be estimated [kg m2]
    noise: float  # of x [rad]
    by_noise: float  # what that noise leaves of the torque; 0 where it is too small to matter [N m]
    own_noise: float  # of the torque: what even the true law leaves [N m]
    branches: Branches
    scales: Scales


def fit(
    x: ArrayLike,
    torque: ArrayLike,
    law: str = "lugre",
    *,
    dt: float,
    load: ArrayLike | None = None,
    inertia: float | None = 0.0,
    fixed: Mapping[str, float] | None = None,
    starts: int = 3,
    intervals: str = "periods",
    global_search: bool = False,
    seed: int = 0,
    order: float | str | None = None,
) -> Fit:
    """Identify a law from displacement and torque.

    The memory at the start is unknown. The samples before the first reversal from saturation (before the first reversal
    at all, if none is) therefore drive the law but are not weighed. A constant offset is estimated too. The fit takes
    place in the record's own scales, so that the same record in other units gives the same answer.

    Parameters
    ----------
    x : (T,) array_like
        Displacement [rad].
    torque : (T,) array_like
        Torque that resists positive motion [N m].
    law : str
        Name of a law that tells the units of its parameters.
    dt : float
        Time between samples [s].
    load : (T,) array_like, optional
        Load on the contact [N]. The level then grows with it in proportion, ``fit.level.load``, and the parameters are
        those without load.
    inertia : float or None
        Inertia between the friction and the torque sensor, whose torque is subtracted [kg m2]; None estimates it.
    fixed : mapping, optional
        Parameters that are known, in the units of the record.
    starts : int
        Number of starting points of the search.
    intervals : str
        ``"periods"``: from the scatter of the record's periods, which holds for the same contact later; ``"linear"``:
        from the derivatives at the optimum; ``"bootstrap"``: from blocks of samples drawn anew; ``"profile"``: from the
        growth of the loss about the optimum, which shows bounds that are far from symmetric.
    global_search : bool
        Whether differential evolution looks for a better optimum.
    seed : int
        Of the draws.
    order : float or "fitted", optional
        Lets the level change over the position (F42), as ``fit.level`` tells: with so many periods in a turn of x, or
        as many as fit best. A law whose own levels depend on the position takes no other.

    Returns
    -------
    Fit
        The intervals cover noise of the torque, not a law that does not fit. Those of ``"load"``, ``"position"``,
        ``"order"`` and ``"peak"`` are of fields of ``level``. ``asymmetry`` is the one that has the place of ``offset``
        if the zero of the sensor is true. The interval of ``F_c`` is open above where the weighed torque never
        saturates; those of Masing are of ``F_c`` and of the ``virgin_torque`` at its yields. They end where the law
        does (``limits``). ``sets`` are the sliders in parallel that the record tells from each other, and ``saturated``
        is the friction after a long way at the record's median speed, both with intervals by the delta method.

    Raises
    ------
    ValueError
        For an unknown law or one whose units are not told, a parameter to fix that it does not have, values that are
        not finite, arrays of unequal length, ``dt`` not positive, no motion, no reversal, too few samples, torque of
        the wrong sign, or a search that does not converge.
    """
    usual = make(law)
    one_of("intervals", intervals, INTERVALS)
    for name in fixed or ():
        if name not in usual._fields:
            names = ", ".join(usual._fields)
            raise ValueError(f"fixed: friction law {law!r} has no parameter {name!r}; it has {names}")
    held = {name: number(f"fixed {name}", value) for name, value in (fixed or {}).items()}
    options = Options(
        held, whole("starts", starts, 1), intervals, global_search, whole("seed", seed, 0), checked_order(order, load)
    )
    return fitted(prepared(checked(x, torque, dt, load), inertia), law_of(usual), options)


def checked_order(order: float | str | None, load: ArrayLike | None) -> float | str | None:
    """An order that is known, to be sought or not there; ValueError where it is not positive or beside a load."""
    if order is not None and load is not None:
        raise ValueError(
            "order and load are not sought together, as the load often grows with x: leave one of them out"
        )
    return order if order in (None, FITTED) else positive("order", order)


def prepared(record: Record, inertia: float | None = 0.0) -> Prepared:
    """The noise of x removed, torque of inertia subtracted, branches and scales found; see :func:`fit`."""
    noise = deviation_of(record.x)
    refuse(record.x, record.torque, noise)
    clean = cleaned(record, noise, inertia)
    path, T = clean.x, clean.torque
    branches = branches_of(path, T, max(SWING * float(np.ptp(path)), BAND * noise))
    level = 0.5 * branches.swing  # (F30)
    steps = np.abs(np.diff(path))
    moving = steps[steps > 0.0]
    length = max(2.0 * level / stiffness_of(branches), 0.1 * float(np.median(moving)))
    speed = float(np.mean(moving)) / record.dt
    smoothed = path is not record.x
    by_x = by_noise(path, noise, record.dt, level, length) if smoothed else 0.0
    own = own_noise(path, T, branches, by_x)
    return Prepared(clean, inertia, noise, by_x, own, branches, Scales(level, length, length / speed))


def cleaned(record: Record, noise: float, inertia: float | None) -> Record:
    """The record with x freed of noise of this deviation [rad], and without the torque of the inertia."""
    path = motion_of(record.x, noise)
    mass = 0.0 if inertia is None else number("inertia", inertia, minimum=0.0)
    T = record.torque - mass * _acceleration(path, record.dt) if mass else record.torque
    return record._replace(x=path, torque=T)


def _acceleration(x: NDArray, dt: float) -> NDArray[np.float64]:
    return np.gradient(np.gradient(x, dt), dt)


def fitted(ready: Prepared, law: Law, options: Options) -> Fit:
    """One law on a record that is ready; see :func:`fit`."""
    problem = _problem(ready, law)
    load, rate = None if ready.record.load is None else np.abs(ready.record.load), Rate()
    few, position = options._replace(starts=1, global_search=False), None
    if load is not None and np.ptp(load) > 0.0:
        load = load / float(np.mean(load))
        problem, rate = with_rate(problem, law, load, lambda each: _estimated(ready, law, each, few)[0])
    elif options.order is not None and not (isinstance(law.fitted, Sliders) and law.fitted.by_position):
        order = None if options.order == FITTED else float(options.order) * ready.scales.displacement
        problem, position = with_position(problem, law, order, lambda each: _whole(ready, law, each, few))
    estimate, elements = _estimated(ready, law, problem, options)
    if load is not None and rate.joint:
        problem, estimate = joint(problem, law, load, rate, estimate)
    if elements is not None:
        problem, estimate = beside(problem, estimate, elements)
    if position is not None and position.b:
        problem, estimate = joint_with_position(problem, law, position, estimate)
    return _told(ready, law, problem, estimate, elements, options, rate, position)


def _whole(ready: Prepared, law: Law, problem: Problem, options: Options) -> tuple[Problem, Estimate]:
    """Problem and estimate of a law with the columns of its elements."""
    estimate, elements = _estimated(ready, law, problem, options)
    return (problem, estimate) if elements is None else beside(problem, estimate, elements)


def _problem(ready: Prepared, law: Law) -> Problem:
    """The record in its own scales (F30), with the samples that count for this law."""
    record, scales = ready.record, ready.scales
    remembers = law.memory_size(law.make()) > 0
    x = _rounded((record.x - record.x[0]) / scales.displacement)
    dt = float(f"{record.dt / scales.time:.10g}")
    columns = [] if ready.branches.one_way else [np.ones(x.size)]  # one way, friction is an offset too
    if ready.inertia is None:
        columns.append(_acceleration(x, dt))
    return Problem(
        x,
        _rounded(record.torque / scales.torque),
        dt,
        np.ones(x.size),
        weighed_of(record.x, ready.branches, remembers),
        np.column_stack(columns) if columns else np.zeros((x.size, 0)),
        ready.own_noise / scales.torque if ready.by_noise else 0.0,
    )


def _rounded(values: NDArray) -> NDArray[np.float64]:
    """To 2^-30: what a change of units does to the last digits then does not reach the search."""
    return np.round(values * 2.0**30) / 2.0**30


def _estimated(ready: Prepared, law: Law, problem: Problem, options: Options) -> tuple[Estimate, Elements | None]:
    """What a law makes of a problem."""
    held, elements = dict(scaled(law, options.fixed, ready.scales)), None
    if isinstance(law.fitted, Sliders):
        arrays, elements = fitted_sliders(problem, law)
        held |= {name: value for name, value in arrays._asdict().items() if np.ndim(value)}
    space = space_of(law, held)
    optimum = searched(problem, space, options.starts, options.seed, options.global_search)
    return determined(problem, space, optimum), elements


def _told(
    ready: Prepared,
    law: Law,
    problem: Problem,
    estimate: Estimate,
    elements: Elements | None,
    options: Options,
    rate: Rate,
    position: Position | None,
) -> Fit:
    """The estimate in the units of the record, with intervals and warnings."""
    scales, branches = ready.scales, ready.branches
    parameters = law.make(**scaled(law, estimate.parameters._asdict(), scales, back=True))
    if options.intervals == "bootstrap":
        bounds = bootstrapped(estimate, options.seed)
    elif options.intervals == "periods":
        bounds = by_periods(problem, estimate)
    else:
        bounds = profiled(problem, estimate) if options.intervals == "profile" else linear(estimate)
    intervals: dict[str, tuple[Bound, Bound]] = {}
    for name, (low, high) in bounds.items():
        scale = scales.of(law.units[name])
        intervals[name] = low * scale, high * scale
    if elements is not None:
        for name, (least, most) in elements.intervals.items():
            if name not in law.units:
                intervals[name] = least * scales.torque, most * scales.torque
            elif name in intervals:
                own = intervals[name]  # at these yields; other yields that describe the record as well widen it
                intervals[name] = min(own[0], least * scales.torque), max(own[1], most * scales.torque)
    if "F_c" in intervals and not branches.saturates:
        intervals["F_c"] = intervals["F_c"][0], math.inf
    intervals, limits = within_law(law, parameters, intervals, estimate.space.tied)
    e = estimate.optimum.residual * scales.torque  # (F12)
    residual = math.sqrt(np.mean(e**2))
    variance = float(np.var(ready.record.torque[problem.weighed]))
    factors = dict(
        zip(
            ["offset"] * (not branches.one_way) + ["inertia"] * (ready.inertia is None),
            (estimate.factors * scales.torque).tolist(),
        )
    )
    mean = 1.0 if ready.record.load is None else float(np.mean(np.abs(ready.record.load)))
    if not math.isnan(rate.half) and (rate.joint or not rate.undetermined):
        intervals["load"] = max(rate.value - rate.half, 0.0) / mean, (rate.value + rate.half) / mean
    result = Fit(
        law.name,
        parameters,
        intervals,
        factors.get("offset", 0.0),
        residual,
        (),
        level=Level(load=rate.value / mean) if rate.value else None,
        undetermined=tuple(estimate.undetermined),
        explained=1.0 - residual**2 / variance if variance else 0.0,
        inertia=factors.get("inertia", 0.0) * scales.time**2 / scales.displacement + (ready.inertia or 0.0),
        limits=limits,
        sets=() if elements is None else tuple(_in_units(each, scales) for each in elements.sets),
        saturated=_saturated(ready, law, problem, estimate, elements),
    )
    result = result._replace(
        asymmetry=(math.nan,) * 3 if branches.one_way else _asymmetry(ready, estimate, result),
        warnings=(
            *([] if elements is None else at_ends(problem, elements)),
            *remarks(result, ready, law, estimate.optimum),
            *told(rate),
        ),
        undetermined=result.undetermined + ("load",) * rate.undetermined,
    )
    return result if position is None else _by_position(ready, position, result)


def _asymmetry(ready: Prepared, estimate: Estimate, found: Fit) -> tuple[float, float, float]:
    """The asymmetry of the level that has the place of the offset, and its interval by the offset's [1]."""
    end, level = estimate.optimum, found.saturated[0]
    row = np.eye(end.q.size)[len(estimate.space.sought)][None]
    half = float(half_widths(end.jacobian, end.residual, row)[0]) * ready.scales.torque
    if not level > 0.0:
        return math.nan, math.nan, math.nan
    return found.offset / level, (found.offset - half) / level, (found.offset + half) / level


def _by_position(ready: Prepared, position: Position, found: Fit) -> Fit:
    """A fit with its level over the position, in the units of the record."""
    warnings = (*found.warnings, *told_of_position(position))
    if not position.b:
        return found._replace(warnings=warnings)
    x, first = ready.scales.displacement, float(ready.record.x[0])
    units = {"position": (1.0, 0.0), "peak": (x, first), "order": (1.0 / x, 0.0)}
    ends = zip(NAMES, position.intervals)
    return found._replace(
        level=Level(position=position.b, order=position.order / x, peak=first + position.peak * x),
        intervals=found.intervals
        | {
            name: (units[name][0] * low + units[name][1], units[name][0] * high + units[name][1])
            for name, (low, high) in ends
        },
        undetermined=found.undetermined + position.undetermined,
        warnings=warnings,
    )


def _in_units(found: SliderSet, scales: Scales) -> SliderSet:
    """A set of sliders in the units of the record."""
    stiffness = scales.torque / scales.displacement
    k_ends = found.k_interval and (found.k_interval[0] * stiffness, found.k_interval[1] * stiffness)
    y_ends = found.y_interval and (
        found.y_interval[0] * scales.displacement,
        found.y_interval[1] * scales.displacement,
    )
    return SliderSet(found.sliders, found.k * stiffness, found.y * scales.displacement, k_ends, y_ends)


def _saturated(
    ready: Prepared, law: Law, problem: Problem, estimate: Estimate, elements: Elements | None
) -> tuple[float, float, float]:
    """Friction after a long way one way at the record's median speed, and its interval by the delta method [N m].

    It has the covariance of the parameters (F35), also of those that are not determined one by one: parts of a law side
    by side may exchange theirs. Of sliders it holds what all grids say that are nearly as good. Where the friction
    depends on the position, it is that of the middle of the stroke.
    """
    space, end = estimate.wide or (estimate.space, estimate.optimum)
    far = far_slide(problem)
    value = float(far.response(law, estimate.parameters)[-1])
    if elements is not None and np.any(elements.slope):
        value = float(np.sum(elements.F))
    row, n = np.zeros((1, end.q.size)), len(space.sought)
    for i in range(n):
        ends = [end.q[:n] + side * STEP * max(1.0, abs(end.q[i])) * np.eye(n)[i] for side in (-1.0, 1.0)]
        inside = [q if space.made(q)[1] == 0.0 else end.q[:n] for q in ends]
        low, high = (far.response(law, space.made(q)[0])[-1] for q in inside)
        row[0, i] = (high - low) / max(inside[1][i] - inside[0][i], STEP)
    if elements is not None and not hasattr(estimate.parameters, "F_c"):
        row[0, -elements.F.size :] = 1.0  # the columns that stand beside the parameters
    half = float(half_widths(end.jacobian, end.residual, row)[0])
    low, high = max(value - half, 0.0), value + half
    if elements is not None:
        least, most = elements.intervals["F_c"]
        low, high = min(low, least), max(high, most)
    torque = ready.scales.torque
    return value * torque, low * torque, high * torque if ready.branches.saturates else math.inf
