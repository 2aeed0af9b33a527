"""What a metric is, what the evaluation of a test is, and how both are registered.

A test is a manoeuvre as it is evaluated. Its evaluation consists of a class that reads a recording of the test and of
conditions that the recording's meta may override. A metric is a function that takes an object of that class and returns
one value for each repeat (a cycle, a step, ...) in SI units. The docstring of the function is the metric's definition;
the documentation and the report's glossary are made from it.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics import shown
from steer_env.friction.numerics.check import did_you_mean
from steer_env.metrics.common.registry import EVALUATIONS, tests
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G

Array = NDArray[np.float64]

# Unit of the reports -> how many of it make one SI unit.
UNITS = dict.fromkeys(("1", "s", "Hz", "N", "N m", "J", "W", "m", "m/s", "m/s2", "1/s", "dB", "kg"), 1.0)
UNITS |= {"ms": 1e3, "g": 1 / G, "N m/g": G, "deg": 1 / DEGREE, "deg/s": 1 / DEGREE, "deg/g": G / DEGREE, "km/h": 3.6}
UNITS |= {"deg s": 1 / DEGREE, "1/min": 60.0}
UNITS |= {"N m/deg": DEGREE, "g/100 deg": 100 * DEGREE / G, "g/(100 N m deg)": 100 * DEGREE / G, "%": 100.0}

_HISTORY_CHANNELS = ("handwheel_angle", "handwheel_torque", "yaw_rate", "lateral_acceleration")
HISTORIES = tuple(("time", name) for name in _HISTORY_CHANNELS)
SPEED_SPREAD = 0.03  # largest deviation of the mean speed from the required speed, as a fraction of it [1]


class RefusedError(ValueError):
    """A metric has no meaning for this recording. The text says why, and what would give the metric a meaning."""


class Bounded(NamedTuple):
    """Repeats of a metric that share an error which their scatter does not show."""

    values: Array  # (n,) [SI]
    below: float  # how far the truth may lie below the mean of the values because of that error [SI]
    above: float  # how far it may lie above [SI]


class Doubt(NamedTuple):
    """What a recording leaves open: other readings of it that may be the true one."""

    about: str  # what is in doubt
    remedy: str  # what would remove the doubt
    others: tuple[Any, ...]  # objects that the test's metrics take, or the RefusedError instead of one


class Value(NamedTuple):
    """A metric of a recording: the mean over the repeats and its 95 % interval; NaN with a reason if refused."""

    value: float  # mean over the repeats [unit]
    low: float  # lower end of the interval; NaN where there is one repeat and no bound [unit]
    high: float  # upper end of the interval [unit]
    unit: str
    reason: str = ""
    repeats: tuple[float, ...] = ()  # the values of which `value` is the mean [unit]
    notes: tuple[str, ...] = ()  # what was corrected or allowed for, and what would be better, in sentences


class Metrics(dict[str, Value]):
    """The metrics of a recording by name, which a notebook shows as a table; a KeyError tells similar names."""

    def __missing__(self, name: str) -> Value:
        raise KeyError(f"no metric {name!r} here, {did_you_mean(name, self)}")

    def __repr__(self) -> str:
        refused = sum(bool(value.reason) for value in self.values())
        return f"<Metrics: {len(self)} metrics{f', {refused} of them refused' if refused else ''}>"

    def _rows(self) -> list[dict[str, Any]]:
        columns = ("value", "low", "high", "unit", "reason")
        return [{"metric": name} | {key: getattr(value, key) for key in columns} for name, value in self.items()]

    def _repr_html_(self) -> str:
        return shown.html(repr(self), self._rows())

    def to_frame(self) -> Any:
        """A ``pandas.DataFrame`` of value, interval, unit and reason, a row for each metric; ImportError without it."""
        return shown.frame(self._rows()).set_index("metric")


@dataclass(frozen=True)
class Metric:
    """One metric; :func:`metric` declares it above the function that computes it, :func:`declare` one of several."""

    name: str
    unit: str  # of the reported value, a key of UNITS
    definition: str
    source: str
    usual: tuple[float, float] | None  # range of passenger cars [unit]
    validity: tuple[float, float] | None  # range of peak lateral acceleration in which it is valid [g]; None: any
    tests: tuple[str, ...]  # tests that report it
    read: Callable[[Any], Any]  # object that the test's `read` returns -> values (n,) of the repeats, or Bounded [SI]


@dataclass(frozen=True)
class ManoeuvreEvaluation:
    """How a recording of a test is evaluated; :func:`register_evaluation` describes the fields."""

    name: str
    read: Callable[..., Any]
    conditions: Mapping[str, Any]
    constant_speed: bool
    plots: tuple[tuple[str, str], ...]
    steered: bool = False
    gaps: bool = False


_metrics: dict[str, Metric] = {}


def register_evaluation(
    name: str,
    read: Callable[..., Any],
    *,
    constant_speed: bool = True,
    plots: tuple[tuple[str, str], ...] = HISTORIES,
    steered: bool = False,
    gaps: bool = False,
    **conditions: Any,
) -> ManoeuvreEvaluation:
    """Register how recordings of a test are evaluated.

    Parameters
    ----------
    name : str
        Name of the test, which is the name of the manoeuvre.
    read : callable
        ``read(recording, conditions)`` returns the object that the metrics of the test take. It raises
        :class:`RefusedError` where no metric can be computed. The object may have a method ``doubts()``, which returns
        what the recording leaves open as a list of :class:`Doubt`, and a method ``notes()``, which returns sentences
        for the reader of the results.
    constant_speed : bool
        Whether the mean of ``vehicle_speed`` must be within 3 % of the condition ``speed_m_s``.
    plots : tuple of (str, str)
        Pairs (x, y) of channels whose plots show the test; x may be "time". By default four channels over time.
    steered : bool
        Whether the handwheel alone moves the car, so that the sizes of its motion and of the handwheel angle tell
        whether their units are right.
    gaps : bool
        Whether ``read`` takes uneven steps and leaves gaps out, so that none has to be bridged or refused before.
    conditions
        What the test prescribes, with the unit in the name: ``speed_m_s``, ``frequency_hz``, ... A value in the
        recording's meta replaces the value given here.

    Raises
    ------
    ValueError
        If another evaluation has that name.
    """
    return EVALUATIONS.register(name, ManoeuvreEvaluation(name, read, conditions, constant_speed, plots, steered, gaps))


def declare(
    name: str,
    unit: str,
    definition: str,
    read: Callable[[Any], Any],
    *tests: str,
    usual: tuple[float, float] | None = None,
    validity: tuple[float, float] | None = None,
    source: str,
) -> None:
    """Register a metric; the arguments are fields of :class:`Metric`.

    Raises
    ------
    ValueError
        If the name is taken, there is no definition, or the unit is not in ``UNITS``.
    """
    if name in _metrics or not definition or unit not in UNITS:
        raise ValueError(
            f"metric {name!r} needs a name that no other metric has, a definition, and a unit out of {list(UNITS)}"
        )
    _metrics[name] = Metric(name, unit, definition, source, usual, validity, tests, read)


def metric(unit: str, *tests: str, **more: Any) -> Callable[[Callable[[Any], Any]], Callable[[Any], Any]]:
    """Register the decorated function as a metric under its own name, with its docstring as the definition.

    The arguments are those of :func:`declare`.
    """

    def register(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
        text = " ".join((inspect.getdoc(function) or "").split())
        declare(function.__name__, unit, text, function, *tests, **more)
        return function

    return register


def conditions(test: str) -> dict[str, Any]:
    """Conditions that a test prescribes, with the unit in each name; ValueError for an unknown test."""
    return dict(evaluation_by_name(test).conditions)


def available(test: str | None = None) -> tuple[str, ...]:
    """Names of the metrics of a test, or of all tests; ValueError for an unknown test."""
    if test is None:
        return tuple(dict.fromkeys(name for each in tests() for name in available(each)))
    evaluation_by_name(test)
    return tuple(name for name, entry in _metrics.items() if test in entry.tests)


def definition(name: str) -> Metric:
    """Unit, definition, source, usual range and validity of a metric; ValueError for an unknown name."""
    if name not in _metrics:
        EVALUATIONS.all()
    if name not in _metrics:
        raise ValueError(f"no metric {name!r}; there are {', '.join(available())}")
    return _metrics[name]


def evaluation_of(recording: Recording, test: str | None = None) -> ManoeuvreEvaluation:
    """The evaluation of a test, by default of the manoeuvre that the recording's meta names.

    Raises
    ------
    ValueError
        If the test is unknown, or if neither the argument nor the meta names one.
    """
    name = test or recording.meta.get("manoeuvre")
    if not name:
        raise ValueError(f"the recording's meta names no manoeuvre; say which test it is: {', '.join(tests())}")
    return evaluation_by_name(str(name))


def evaluation_by_name(test: str) -> ManoeuvreEvaluation:
    """The evaluation of a test; ValueError for an unknown test."""
    return EVALUATIONS[test]
