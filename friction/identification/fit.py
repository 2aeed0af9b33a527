"""``friction.fit``: parameters of a law from a record (F12)."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.identification.branches import BAND as SWING
from steer_env.friction.identification.branches import Branches, find_branches, reversal_stiffness, weighed_samples
from steer_env.friction.identification.determined import (
    Estimate,
    determined,
    far_slide,
    half_widths_of_level,
    level_row,
    parameter_intervals,
    widths,
)
from steer_env.friction.identification.displacement import BAND, displacement_noise, smoothed_motion
from steer_env.friction.identification.elements import at_ends, find_sliders, stroke_ends, yields_late
from steer_env.friction.identification.position import FITTED, Position, describe_position, judged, with_position
from steer_env.friction.identification.problem import Problem, searched, weakened
from steer_env.friction.identification.quality import MATTERS, by_noise, noisy_again, own_noise, refuse
from steer_env.friction.identification.record import Record, checked
from steer_env.friction.identification.remarks import remarks, told_of_load
from steer_env.friction.identification.scales import Scales, scaled
from steer_env.friction.identification.space import (
    WIDEST,
    Sought,
    Space,
    checked_space,
    make_space,
    sought_parameters,
    within_law,
)
from steer_env.friction.law import Law, Sliders, law_of, make
from steer_env.friction.level import Level
from steer_env.friction.numerics import shown
from steer_env.friction.numerics.check import number, positive, whole

DERIVATIVE_STEP = 1e-5  # of a coordinate, for the derivative of the saturated torque [1]
NEGLIGIBLE_LOAD_GROWTH = 1e-4  # growth of the level that is none [1]
HEAVIEST = 20.0  # growth of the level with the load, over the level without, at the mean load [1]
LOAD = Sought("load", False, None, 0.5, 0.0, HEAVIEST, 0.0, of_level=True)  # c_F of (F38), over the mean load

Bound = float | NDArray[np.float64]  # an array for a curve


class Slider(NamedTuple):
    """One of the sliders in parallel that a record shows."""

    k: float  # stiffness [N m/rad]
    y: float  # yield [rad]
    k_interval: tuple[float, float] | None  # 95 %; None where the record does not determine it [N m/rad]
    y_interval: tuple[float, float] | None  # [rad]


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
    sliders: tuple[Slider, ...] = ()  # in parallel
    saturated: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # far one way, and its interval [N m]
    asymmetry: tuple[float, float, float] = (
        math.nan,
        math.nan,
        math.nan,
    )  # in place of the offset, and its interval [1]
    record: Record | None = None  # that was given to :func:`fit`

    def __repr__(self) -> str:
        found = self.parameters._asdict()
        values = [
            f"{key} {np.shape(value)}" if np.ndim(value) else f"{key}={value:.4g}" for key, value in found.items()
        ]
        told = f"; warnings: {len(self.warnings)}" if self.warnings else ""
        return f"<Fit of {self.law}: {', '.join(values)}; residual {self.residual:.3g}{told}>"

    def _rows(self) -> list[dict[str, Any]]:
        units = dict(law_of(self.parameters).units) | {"offset": "N m", "inertia": "kg m2", "saturated": "N m"}
        saturated, *ends = self.saturated
        found = self.parameters._asdict() | {"offset": self.offset, "inertia": self.inertia, "saturated": saturated}
        found |= {name: getattr(self.level, name) for name in self.intervals if hasattr(self.level, name)}
        intervals = self.intervals | {"saturated": tuple(ends)}
        rows = []
        for name, value in found.items():
            low, high = intervals.get(name, (math.nan, math.nan))
            row = {"parameter": name, "value": value, "low": low, "high": high, "unit": units.get(name, "")}
            rows.append(row | {"determined": name not in self.undetermined})
        return rows

    def _repr_html_(self) -> str:
        return shown.html("; ".join((repr(self), *self.warnings)), self._rows())

    def to_frame(self) -> Any:
        """A ``pandas.DataFrame`` of value, 95 % interval, unit and whether the record determines it, by parameter.

        ImportError without pandas.
        """
        return shown.frame(self._rows()).set_index("parameter")

    def plot(self, record: Record | None = None, axes: Any = None) -> Any:
        """Draw the torque of a record and that of the law over the displacement.

        Parameters
        ----------
        record : Record, optional
            By default the one that was given to :func:`fit`.
        axes : matplotlib.axes.Axes, optional
            By default in a new figure of pyplot.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            Neither is there a record here, as in a fit of :func:`steer_env.friction.compare`, nor is one given.
        """
        from steer_env.friction.identification.compare import remainder  # here, as that module imports this one

        record = self.record if record is None else record
        if record is None:
            raise ValueError("this fit does not hold the record that it is of: give it, fit.plot(record)")
        axes = shown.new_axes() if axes is None else axes
        axes.plot(record.x, record.torque, color="0.7", linewidth=3.0, label="record")
        axes.plot(record.x, record.torque + remainder(record, self), label=self.law.replace("_", " "))
        axes.set(xlabel="displacement [unit of the record]", ylabel="torque [unit of the record]")
        axes.legend()
        return axes


class Options(NamedTuple):
    """How :func:`fit` goes about it."""

    fixed: Mapping[str, float] = {}  # in the units of the record
    starts: int = 3
    global_search: bool = False
    seed: int = 0
    order: float | str | None = None  # of the level over the position, FITTED, or None for a level that is the same [1]


class Prepared(NamedTuple):
    """A record made ready for every law."""

    record: Record  # with x freed of its noise, and the torque of the inertia subtracted
    inertia: float | None  # None: to be estimated [kg m2]
    noise: float  # of x [rad]
    again: list[NDArray[np.float64]]  # x (T,), with such noise and smoothed once more; none where x is left alone
    by_noise: float  # what that noise leaves of the torque; 0 where it is too small to matter [N m]
    own_noise: float  # of the torque: what even the true law leaves [N m]
    branches: Branches
    scales: Scales

    @property
    def hides(self) -> bool:
        """Whether noise of x leaves more of the torque than its own noise does, and so much that it matters."""
        return self.by_noise > max(MATTERS * self.scales.torque, math.sqrt(0.5) * self.own_noise)


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
        The intervals cover noise of torque and displacement, not a law that does not fit. Those of ``"load"``,
        ``"position"``, ``"order"`` and ``"peak"`` are of fields of ``level``. ``asymmetry`` is the one that has the
        place of ``offset`` if the zero of the sensor is true. The interval of ``F_c`` is open above where the weighed
        torque never saturates; those of Masing are of ``F_c`` and of the ``virgin_torque`` at its yields. They end
        where the law does (``limits``). ``sliders`` are those in parallel that the record asks for, and ``saturated``
        is the friction after a long way at the record's median speed, both with intervals by the delta method.

    Raises
    ------
    ValueError
        For an unknown law or one whose units are not told, a parameter to fix that it does not have, values that are
        not finite, arrays of unequal length, ``dt`` not positive, no motion, no reversal, too few samples, torque of
        the wrong sign, or a search that does not converge.
    """
    usual = make(law)
    for name in fixed or ():
        if name not in usual._fields:
            names = ", ".join(usual._fields)
            raise ValueError(f"fixed: friction law {law!r} has no parameter {name!r}; it has {names}")
    held = {name: number(f"fixed {name}", value) for name, value in (fixed or {}).items()}
    options = Options(
        held, whole("starts", starts, 1), global_search, whole("seed", seed, 0), checked_order(order, load)
    )
    record = checked(x, torque, dt, load)
    return fitted(prepared(record, inertia), law_of(usual), options)._replace(record=record)


def checked_order(order: float | str | None, load: ArrayLike | None) -> float | str | None:
    """An order that is known, to be sought or not there; ValueError where it is not positive or beside a load."""
    if order is not None and load is not None:
        raise ValueError(
            "order and load are not sought together, as the load often grows with x: leave one of them out"
        )
    return order if order in (None, FITTED) else positive("order", order)


def prepared(record: Record, inertia: float | None = 0.0) -> Prepared:
    """The noise of x removed, torque of inertia subtracted, branches and scales found; see :func:`fit`."""
    noise = displacement_noise(record.x)
    refuse(record.x, record.torque, noise)
    clean = cleaned(record, noise, inertia)
    path, T = clean.x, clean.torque
    branches = find_branches(path, T, max(SWING * float(np.ptp(path)), BAND * noise))
    level = 0.5 * branches.swing  # (F30)
    steps = np.abs(np.diff(path))
    moving = steps[steps > 0.0]
    length = max(2.0 * level / reversal_stiffness(branches), 0.1 * float(np.median(moving)))
    speed = float(np.mean(moving)) / record.dt
    again = [] if path is record.x else noisy_again(path, noise)
    by_x = by_noise(path, again[0], record.dt, level, length) if again else 0.0
    own = own_noise(path, T, branches, by_x)
    return Prepared(clean, inertia, noise, again, by_x, own, branches, Scales(level, length, length / speed))


def cleaned(record: Record, noise: float, inertia: float | None) -> Record:
    """The record with x freed of noise of this deviation [rad], and without the torque of the inertia."""
    path = smoothed_motion(record.x, noise)
    mass = 0.0 if inertia is None else number("inertia", inertia, minimum=0.0)
    T = record.torque - mass * _acceleration(path, record.dt) if mass else record.torque
    return record._replace(x=path, torque=T)


def _acceleration(x: NDArray, dt: float) -> NDArray[np.float64]:
    return np.gradient(np.gradient(x, dt), dt)


def fitted(ready: Prepared, law: Law, options: Options) -> Fit:
    """One law on a record that is ready; see :func:`fit`."""
    problem, position = _problem(ready, law), None

    def estimated(of_level: tuple[Sought, ...], given: Level) -> Estimate:
        there = problem.at(given._replace(**{s.name: s.start for s in of_level}))
        space = _space(there, law, scaled(law, options.fixed, ready.scales)).beside(of_level, given)
        optimum = searched(problem, space, options.starts, options.seed, options.global_search)
        return determined(problem, space, optimum)

    estimate = estimated((LOAD,) if np.any(problem.load) else (), Level())
    if estimate.level.load and estimate.space.sliders:  # as many as there are at the level that was found
        estimate = estimated((LOAD._replace(start=estimate.level.load),), Level())
    if options.order is not None and not estimate.space.sloped:
        order = None if options.order == FITTED else float(options.order) * ready.scales.displacement
        estimate, position = with_position(problem, law, order, estimate, estimated)
    return _in_record_units(ready, law, problem, _unbiased(ready, law, problem, estimate), position)


def _unbiased(ready: Prepared, law: Law, problem: Problem, estimate: Estimate) -> Estimate:
    """The estimate freed of what noise of x, smoothed, makes of it (F33).

    A record of the law that was found, whose motion gets such noise once more and is smoothed once more, gives other
    parameters in a step of the search. What they differ by is subtracted, and intervals allow for as much.
    """
    if not ready.again:
        return estimate
    end, n = estimate.optimum, estimate.space.size

    def torque_of(x: NDArray) -> NDArray[np.float64]:
        moved = problem._replace(x=_rounded((x - ready.record.x[0]) / ready.scales.displacement))
        return moved.at(estimate.level).response(law, estimate.parameters)[problem.weighed]

    here = torque_of(ready.record.x)
    left = np.mean([weakened(torque_of(x) - here, end.loss_scale) for x in ready.again], axis=0)
    shift = np.linalg.lstsq(end.jacobian, left, rcond=1e-9)[0]
    q = end.q + shift
    q[:n] = estimate.space.nearest(q[:n])
    return estimate._replace(parameters=estimate.space.made(q[:n])[0], optimum=end._replace(q=q), shift=q - end.q)


def _problem(ready: Prepared, law: Law) -> Problem:
    """The record in its own scales (F30), with the samples that count for this law."""
    record, scales = ready.record, ready.scales
    remembers = law.memory_size(law.make()) > 0
    x = _rounded((record.x - record.x[0]) / scales.displacement)
    dt = float(f"{record.dt / scales.time:.10g}")
    load = np.zeros(x.size) if record.load is None or not np.ptp(np.abs(record.load)) > 0.0 else np.abs(record.load)
    columns = [] if ready.branches.one_way else [np.ones(x.size)]  # one way, friction is an offset too
    if ready.inertia is None:
        columns.append(_acceleration(x, dt))
    return Problem(
        x,
        _rounded(record.torque / scales.torque),
        dt,
        load / (float(np.mean(load)) or 1.0),
        np.ones(x.size),
        weighed_samples(record.x, ready.branches, remembers),
        np.column_stack(columns) if columns else np.zeros((x.size, 0)),
        ready.own_noise / scales.torque if ready.hides and remembers else 0.0,
    )


def _rounded(values: NDArray) -> NDArray[np.float64]:
    """To 2^-30: what a change of units does to the last digits then does not reach the search."""
    return np.round(values * 2.0**30) / 2.0**30


def _space(problem: Problem, law: Law, held: Mapping[str, float]) -> Space:
    """The space of a law, with where the search begins."""
    return _of_sliders(problem, law, held) if isinstance(law.fitted, Sliders) else make_space(law, held)


def _of_sliders(problem: Problem, law: Law, held: Mapping[str, float]) -> Space:
    """The space of sliders in parallel, whose search begins where a regression ends (F32)."""
    declared = law.fitted
    assert isinstance(declared, Sliders)
    found = find_sliders(problem, law)
    if not found.y.size:
        raise ValueError(f"no slider of {law.name!r} describes the record: its torque has no part that slides")
    sought = sought_parameters(law, {**held, "F_c": None})  # the sum of the levels
    space = Space(law, sought, held, {}, np.array([s.start for s in sought]), np.empty(0))
    if declared.one is not None:
        excess, v_s, C = (found.stribeck[0], *np.exp(found.stribeck[1:])) if found.stribeck.size else (0.0, 1.0, 1.0)
        one = space.coordinates(declared.one(1.0, float(excess), float(v_s), float(C)))
        space = space._replace(start=np.clip(one, space.lowest, space.highest))
    factors = found.factors if found.factors.size > problem.columns.shape[1] else [0.0]  # of the viscous part, first
    start = [factors[0] if s.name == declared.viscous else q for s, q in zip(sought, space.start)]
    stroke = stroke_ends(problem)
    rows = [np.log(found.F), np.log(found.y)] + ([found.slope] if declared.by_position else [])
    q = np.concatenate([start, *rows])
    return checked_space(space._replace(start=q, inside=q, sliders=found.y.size, stroke=stroke))


def _in_record_units(
    ready: Prepared,
    law: Law,
    problem: Problem,
    estimate: Estimate,
    position: Position | None,
) -> Fit:
    """The estimate in the units of the record, with intervals and warnings."""
    scales, branches = ready.scales, ready.branches
    parameters = law.make(**scaled(law, estimate.parameters._asdict(), scales, back=True))
    intervals: dict[str, tuple[Bound, Bound]] = {}
    for name, (low, high) in parameter_intervals(problem, estimate).items():
        scale = scales.of(law.units[name])
        intervals[name] = low * scale, high * scale
    sliders: tuple[Slider, ...] = ()
    saturates = branches.saturates
    if estimate.space.sliders:
        level, curve, sliders = _slid(problem, estimate, scales)
        intervals |= {"virgin_torque": curve} | ({} if "F_c" in estimate.space.held else {"F_c": level})
        saturates = saturates and not yields_late(problem, *estimate.slid[:2])
    if "F_c" in intervals and not saturates:
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
    result = Fit(
        law.name,
        parameters,
        intervals,
        factors.get("offset", 0.0),
        residual,
        (),
        undetermined=tuple(name for name in estimate.undetermined if name in law.units),
        explained=1.0 - residual**2 / variance if variance else 0.0,
        inertia=factors.get("inertia", 0.0) * scales.time**2 / scales.displacement + (ready.inertia or 0.0),
        limits=limits,
        sliders=sliders,
        saturated=_saturated(ready, law, problem, estimate, saturates),
    )
    result = result._replace(
        asymmetry=(math.nan,) * 3 if branches.one_way else _asymmetry(ready, problem, estimate, result),
        warnings=(
            *(at_ends(problem, *estimate.slid[:2]) if estimate.space.sliders else []),
            *remarks(result, ready, law, estimate.optimum),
        ),
    )
    return _with_level(ready, problem, estimate, position, result)


def _asymmetry(ready: Prepared, problem: Problem, estimate: Estimate, found: Fit) -> tuple[float, float, float]:
    """The asymmetry of the level that has the place of the offset, and its interval by the offset's [1]."""
    end, level = estimate.optimum, found.saturated[0]
    row = np.eye(end.q.size)[estimate.space.size][None]
    half = float(widths(problem, estimate, row)[0]) * ready.scales.torque
    if not level > 0.0:
        return math.nan, math.nan, math.nan
    return found.offset / level, (found.offset - half) / level, (found.offset + half) / level


def _with_level(ready: Prepared, problem: Problem, estimate: Estimate, position: Position | None, found: Fit) -> Fit:
    """A fit with what it tells of its level, in the units of the record."""
    level, x, first = estimate.level, ready.scales.displacement, float(ready.record.x[0])
    mean = 1.0 if ready.record.load is None else float(np.mean(np.abs(ready.record.load)))

    def back(each: Level) -> Level:
        if position is None:
            return Level(load=each.load / mean)
        return Level(position=each.position, order=each.order / x, peak=first + each.peak * x)

    own = {name: (max(level.load - h, 0.0), level.load + h) for name, h in half_widths_of_level(estimate).items()}
    undetermined = tuple(name for name in estimate.undetermined if name in Level._fields)
    warnings = told_of_load(problem, estimate) if np.any(problem.load) else []
    if position is not None:
        own, undetermined = judged(position, level)
        warnings = describe_position(position, level, undetermined)
    for name, ends in own.items():
        low, high = (float(getattr(back(level._replace(**{name: end})), name)) for end in ends)
        found.intervals[name] = low, high
    return found._replace(
        level=back(level) if level.load > NEGLIGIBLE_LOAD_GROWTH or level.position else None,
        undetermined=found.undetermined + undetermined,
        warnings=(*found.warnings, *warnings),
    )


def _slid(
    problem: Problem, estimate: Estimate, scales: Scales
) -> tuple[tuple[float, float], tuple[NDArray, NDArray], tuple[Slider, ...]]:
    """Intervals of the level of all sliders and of the virgin torque at their yields, and the sliders."""
    F, y = estimate.slid[:2]
    order = np.argsort(y)
    F, y, N = F[order], y[order], y.size
    level, first = level_row(estimate), len(estimate.space.sought)
    at_F, at_y = (np.eye(level.size)[first + k * N : first + (k + 1) * N][order] for k in (0, 1))
    reached = np.minimum(y[:, None] / y, 1.0) * F  # (at a yield, of a slider)
    curve = reached @ at_F - (np.where(y[:, None] < y, reached, 0.0)) @ at_y
    half = widths(problem, estimate, np.vstack([level, curve, at_F - at_y, at_y]))
    half_k, half_y = half[1 + N : 1 + 2 * N], half[1 + 2 * N :]
    virgin = reached.sum(axis=1)
    sliders = []
    for k, each, h_k, h_y in zip(F / y * scales.torque / scales.displacement, y * scales.displacement, half_k, half_y):
        ends = [
            (float(v * math.exp(-h)), float(v * math.exp(h))) if max(h_k, h_y) < WIDEST else None
            for v, h in ((k, h_k), (each, h_y))
        ]
        sliders.append(Slider(float(k), float(each), ends[0], ends[1]))
    total = float(F.sum()) * scales.torque
    low, high = scales.torque * np.maximum(virgin - half[1 : 1 + N], 0.0), scales.torque * (virgin + half[1 : 1 + N])
    return (total * math.exp(-half[0]), total * math.exp(half[0])), (low, high), tuple(sliders)


def _saturated(
    ready: Prepared, law: Law, problem: Problem, estimate: Estimate, saturates: bool
) -> tuple[float, float, float]:
    """Friction after a long way one way at the record's median speed, and its interval by the delta method [N m].

    It has the scatter of the parameters (F37), also of those that are not determined one by one: parts of a law side
    by side may exchange theirs. Where the friction depends on the position, it is that of the middle of the stroke.
    """
    space, end = estimate.space, estimate.optimum
    far = far_slide(problem)
    value = float(far.response(law, estimate.parameters)[-1])
    row, n = np.zeros((1, end.q.size)), space.size
    if space.sloped:
        value = float(np.sum(estimate.slid[0]))
        row[0] = value * level_row(estimate)
    else:
        for i in range(n):
            ends = [end.q[:n] + side * DERIVATIVE_STEP * max(1.0, abs(end.q[i])) * np.eye(n)[i] for side in (-1.0, 1.0)]
            inside = [q if space.made(q)[1] == 0.0 else end.q[:n] for q in ends]
            low, high = (far.response(law, space.made(q)[0])[-1] for q in inside)
            row[0, i] = (high - low) / max(inside[1][i] - inside[0][i], DERIVATIVE_STEP)
    half = float(widths(problem, estimate, row)[0])
    low, high = max(value - half, 0.0), value + half
    torque = ready.scales.torque
    return value * torque, low * torque, high * torque if saturates else math.inf
