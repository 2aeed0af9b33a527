"""The parameters of a law that are sought, and the coordinates in which the search moves (F31)."""

import inspect
import math
from collections.abc import Callable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.law import Law, Sliders
from steer_env.friction.level import Level

LOG_SEARCH_RANGE = math.log(1e6)  # of a logarithm about its start [1]
# The same of torques and displacements: beyond it a record tells none from zero, and the equation of a law grows stiff.
LOG_SCALE_RANGE = math.log(1e3)
EDGE = 1e-3  # distance of a coordinate from the end of its range, within which it is at it [1]
BOUND_PROBE = 1e-3  # change of a coordinate that shows an edge of what the law allows [1]
HALVINGS = 60  # of a way to a bound of the law
DETERMINED_SHARE = 0.5  # half the width of the interval of a coordinate that counts as determined, of its value [1] ...
DETERMINED_SCALE_SHARE = 0.05  # ... or, where it is small, of its scale [1]
WIDEST = math.log(2.0)  # of a logarithm [1]
LARGEST = 9.0  # relative excess: a break-away of ten times the sliding torque; assumed [1]


class Sought(NamedTuple):
    """A parameter that is sought, by its coordinate q in scaled units [1].

    The coordinate is the logarithm where the law allows positive values only, the relative excess over another
    parameter (``base``) where it allows none below that, as ``F_s`` over ``F_c``, and the value else.
    """

    name: str
    logarithmic: bool
    base: str | None
    start: float  # of the coordinate [1]
    lowest: float  # of the coordinate: 0 where it may not be negative [1]
    highest: float  # of the coordinate [1]
    neutral: float | None  # coordinate without effect; None: the law derives the parameter from the others [1]
    of_level: bool = False  # whether it is a field of the level and no parameter of the law
    # Half the width of its interval that counts as determined, whatever its value [1]
    small: float = DETERMINED_SCALE_SHARE

    @property
    def bounded(self) -> bool:
        """Whether the coordinate may not be negative."""
        return self.lowest == 0.0

    @property
    def spare(self) -> bool:
        """Whether the law does without it."""
        return self.neutral is None or (self.neutral == 0.0 and not self.logarithmic)

    def excess(self, q: float, half: float) -> float:
        """Half the width of an interval over the largest that counts as determined [1]."""
        return half / WIDEST if self.logarithmic else half / max(DETERMINED_SHARE * abs(q), self.small)


def sought_parameters(law: Law, given: Mapping[str, Any]) -> tuple[Sought, ...]:
    """The scalar parameters of a law except those that are given; the law's constructor tells which may be zero."""
    default = law.make()._asdict()
    scalars = {name: v for name, v in default.items() if np.ndim(v) == 0 and isinstance(v, float)}
    signature = inspect.signature(law.make).parameters
    result = []
    for name, value in scalars.items():
        if name in given:
            continue
        pure = law.units.get(name) == "1"
        base = next((other for other in scalars if _at_least(law, scalars, name, other)), None)
        if base is not None:
            result.append(Sought(name, False, base, 0.2, 0.0, LARGEST, 0.0))
        elif _allowed(law, {name: 0.0}):
            start = value or 0.1 if pure else 0.1
            lowest = -math.inf if _allowed(law, {name: -1e-6}) else 0.0
            result.append(Sought(name, False, None, start, lowest, math.inf, 0.0))
        else:
            start = math.log(value) if pure else 0.0
            reach = LOG_SCALE_RANGE if law.units.get(name) in ("N m", "rad") else LOG_SEARCH_RANGE
            lowest = _lowest(law, name, start) if pure else start - reach
            start = max(start, lowest + 0.1)
            derived = signature[name].default is None
            result.append(Sought(name, True, None, start, lowest, start + reach, None if derived else start))
    return tuple(result)


def _at_least(law: Law, scalars: Mapping[str, float], name: str, other: str) -> bool:
    """Whether the law refuses a parameter below another one of the same unit."""
    if name == other or law.units.get(name) != law.units.get(other) or scalars[other] <= 0.0:
        return False
    value = scalars[other]
    zeros = {each: 0.0 for each in scalars if _allowed(law, {each: 0.0})}  # so that no third parameter is in the way
    return _allowed(law, zeros | {other: value, name: value}) and not _allowed(
        law, zeros | {other: value, name: 0.99 * value}
    )


def _lowest(law: Law, name: str, start: float) -> float:
    """The least logarithm of a pure number that the law allows, within ``LOG_SEARCH_RANGE`` of its default."""
    low, high = start - LOG_SEARCH_RANGE, start
    if _allowed(law, {name: math.exp(low)}):
        return low
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _allowed(law, {name: math.exp(middle)}) else (middle, high)
    return high + 1e-12


def _allowed(law: Law, values: Mapping[str, Any]) -> bool:
    try:
        law.make(**values)
    except (ValueError, OverflowError):
        return False
    return True


def within_law(
    law: Law, parameters: Any, intervals: Mapping[str, tuple[Any, Any]], tied: Mapping[str, tuple[str, float]]
) -> tuple[dict[str, tuple[Any, Any]], dict[str, tuple[bool, bool]]]:
    """Intervals of single parameters cut to what the law allows, and which of their ends are bounds of the law.

    An end is beyond the law where its constructor refuses it beside all others, be they at their estimates or at ends
    of their own intervals: the end of one may need another one that is not at its estimate. ``tied`` are as in
    :class:`Space`.
    """
    values = parameters._asdict() | dict(law.permission(parameters))
    single = {
        name: ends for name, ends in intervals.items() if np.ndim(values.get(name, ())) == 0 and name in law.units
    }
    result, limits = dict(intervals), {}
    for name, ends in single.items():
        others = [[(other, end) for end in both if math.isfinite(end)] for other, both in single.items()]
        others = [pairs for pairs in others if pairs and pairs[0][0] != name]
        sets = [values, *(values | dict(corner) for corner in product(*others))]

        def allowed(value: float, name: str = name, sets: list[dict[str, Any]] = sets) -> bool:
            given = [each | {name: value} for each in sets]
            follow = [{one: each[base] * (1.0 + excess) for one, (base, excess) in tied.items()} for each in given]
            return any(_allowed(law, each | others) for each, others in zip(given, follow))

        cut, at = zip(*(_cut(values[name], end, allowed) for end in ends))
        result[name] = cut
        if any(at):
            limits[name] = at
    return result, limits


def _cut(value: float, end: float, allowed: Callable[[float], bool]) -> tuple[float, bool]:
    """The end of an interval, or the last allowed value on the way to it, and whether that is a bound."""
    if not math.isfinite(end):
        return end, False
    if allowed(end):
        step = 1e-9 * abs(end) or math.ulp(0.0)
        sides = [math.copysign(step, end - value)] if end != value else [-step, step]
        return end, not all(allowed(end + side) for side in sides)
    low, high = value, end
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if allowed(middle) else (low, middle)
    return low, True


class Space(NamedTuple):
    """Coordinates of what is sought, and the rest of the law's parameters."""

    law: Law
    sought: tuple[Sought, ...]
    held: Mapping[str, Any]  # other parameters; what is nowhere is left to the law's constructor
    tied: Mapping[str, tuple[str, float]]  # others, as a relative excess over their base
    start: NDArray[np.float64]  # (N,) about the record's own scales
    inside: NDArray[np.float64]  # (N,) a set that the law allows
    relaxed: bool = False  # whether sets count that the kernels take and the constructor refuses
    sliders: int = 0  # in parallel, whose coordinates stand after those of ``sought``: see :meth:`slid`
    stroke: NDArray[np.float64] | None = None  # (2,) its ends, of sliders [1]
    given: Level = Level()  # fields of the level that are not sought, in the record's scales

    @property
    def lowest(self) -> NDArray[np.float64]:
        """Least values of the coordinates (n,)."""
        return self._ends([s.lowest for s in self.sought], [-LOG_SEARCH_RANGE, -LOG_SEARCH_RANGE, -1.0])

    @property
    def highest(self) -> NDArray[np.float64]:
        """Largest values of the coordinates (n,)."""
        # Yield that a stroke shows
        last = LOG_SEARCH_RANGE if self.stroke is None else math.log(0.5 * np.ptp(self.stroke))
        return self._ends([s.highest for s in self.sought], [LOG_SEARCH_RANGE, last, 1.0])

    def _ends(self, sought: list[float], of_slider: list[float]) -> NDArray[np.float64]:
        return np.append(sought, np.repeat(of_slider[: 2 + self.sloped], self.sliders))

    @property
    def sloped(self) -> bool:
        """Whether the levels of sliders have slopes over the stroke."""
        return isinstance(self.law.fitted, Sliders) and self.law.fitted.by_position

    def slid(self, q: NDArray) -> list[NDArray[np.float64]]:
        """Levels (N,) and yields (N,) of sliders, of which q has the logarithms, and slopes (N,) if they have them."""
        rows = q[len(self.sought) :].reshape(-1, max(self.sliders, 1))
        return [np.exp(rows[0]), np.exp(rows[1]), *rows[2:]]

    def values(self, q: NDArray) -> dict[str, Any]:
        """Keywords of the law's constructor."""
        values = dict(self.held)
        if self.sliders:
            ends = (self.stroke,) if self.sloped else ()
            values = {**self.law.fitted.made(*self.slid(q), *ends)._asdict(), **values}  # type: ignore[union-attr]
        pairs = [(s, v) for s, v in zip(self.sought, q.tolist()) if not s.of_level]
        values |= {s.name: math.exp(min(v, 300.0)) if s.logarithmic else v for s, v in pairs if s.base is None}
        excesses = {s.name: (s.base, v) for s, v in pairs if s.base is not None} | dict(self.tied)
        return values | {name: values[base] * (1.0 + v) for name, (base, v) in excesses.items()}

    def level(self, q: NDArray) -> Level:
        """The level, in the record's scales."""
        return self.given._replace(**{s.name: v for s, v in zip(self.sought, q.tolist()) if s.of_level})

    def beside(self, of_level: tuple[Sought, ...], given: Level) -> "Space":
        """The space with fields of the level that are sought too, before the others; they change no set of the law."""
        start, inside = (np.append([s.start for s in of_level], each) for each in (self.start, self.inside))
        return self._replace(sought=(*of_level, *self.sought), start=start, inside=inside, given=given)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.lowest.size

    def nearest(self, q: NDArray) -> NDArray[np.float64]:
        """The coordinates of a set near q that the law allows; q itself where it allows that.

        Coordinates are cut to their bounds. Then the one coordinate is moved towards ``inside`` that
        has the shortest way, or else all of them together.
        """
        cut = np.clip(q, self.lowest, self.highest)
        if (self.relaxed and self._whole(self.values(cut))) or _allowed(self.law, self.values(cut)):
            return cut
        ends = [end for end in (self._moved(cut, axis) for axis in np.eye(q.size)) if end is not None]
        everywhere = self._moved(cut, np.ones(q.size))
        return min(ends, key=lambda end: float(np.linalg.norm(end - cut)), default=everywhere)

    def _whole(self, values: Mapping[str, Any]) -> bool:
        """Whether values are all fields of the parameters, so that no constructor is needed."""
        return set(values) == set(getattr(self.law.parameters, "_fields", ()))

    def made(self, q: NDArray) -> tuple[Any, float]:
        """Parameters at ``q``, or at a set nearby that the law allows, and how far off that is."""
        edge = self.nearest(q)
        values, apart = self.values(edge), float(np.linalg.norm(q - edge))
        return (self.law.parameters if self.relaxed and self._whole(values) else self.law.make)(**values), apart

    def _moved(self, q: NDArray, along: NDArray) -> Any:
        """The first allowed set on the way to ``inside`` along some coordinates, None if there is none."""
        end = np.where(along > 0.0, self.inside, q)
        way = end - q
        if not _allowed(self.law, self.values(end)):
            return None
        low, high = 0.0, 1.0
        for _ in range(40):
            middle = 0.5 * (low + high)
            if _allowed(self.law, self.values(q + middle * way)):
                high = middle
            else:
                low = middle
        return q + high * way if high < 1.0 else end

    def edges(self, q: NDArray) -> list[str]:
        """Parameters that the law refuses slightly beyond ``q``, where they are within their own bounds."""
        names = []
        for s, each, axis in zip(self.sought, q.tolist(), np.eye(q.size)):
            step = BOUND_PROBE * max(1.0, abs(each))
            ends = (end for end in (-step, step) if s.lowest <= each + end <= s.highest)
            if not all(_allowed(self.law, self.values(q + end * axis)) for end in ends):
                names.append(s.name)
        return names

    def coordinates(self, parameters: Any) -> NDArray[np.float64]:
        """The coordinates of what is sought, without those of sliders, in a set of parameters."""
        values, found = parameters._asdict(), []
        for s in self.sought:
            value = values[s.name]
            found.append(math.log(value) if s.logarithmic else value / values[s.base] - 1.0 if s.base else value)
        return np.array(found)

    def without(self, name: str, q: NDArray, coordinate: float | None) -> "Space":
        """The space with one coordinate held, or its parameter left to the constructor (None).

        Raises
        ------
        ValueError
            Where the law does not allow that beside the others.
        """
        i = [s.name for s in self.sought].index(name)
        s, held, tied = self.sought[i], dict(self.held), dict(self.tied)
        if coordinate is not None and s.base is not None:
            tied[name] = (s.base, coordinate)
        elif coordinate is not None and not s.of_level:
            held[name] = math.exp(coordinate) if s.logarithmic else coordinate
        keep = np.delete(np.arange(q.size), i)
        near = np.where((self.lowest == 0.0)[keep], np.maximum(q[keep], 0.01), q[keep])
        sought = (*self.sought[:i], *self.sought[i + 1 :])
        return checked_space(self._replace(sought=sought, held=held, tied=tied, start=self.start[keep], inside=near))


def make_space(law: Law, held: Mapping[str, Any]) -> Space:
    """The space of all scalar parameters that are not held, about the record's own scales.

    Raises
    ------
    ValueError
        If no set near them is allowed.
    """
    sought = sought_parameters(law, held)
    q = np.array([s.start for s in sought])
    return checked_space(Space(law, sought, held, {}, q, q))


def checked_space(space: Space) -> Space:
    """The space with ``inside`` moved to a set near it that the law allows, by drawing ever wider about it."""
    rng, drawn = np.random.default_rng(0), space.inside
    for i in range(400):
        if _allowed(space.law, space.values(drawn)):
            return space._replace(inside=drawn)
        drawn = space.inside + rng.normal(0.0, 0.02 * (1 + i) ** 0.75, drawn.size)
    raise ValueError(f"friction law {space.law.name!r} allows no parameters near those that the record suggests")
