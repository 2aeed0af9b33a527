"""What a comparison of a simulation with a measurement would have shown: its power.

The simulation is driven again with one parameter of its car changed at a time, and takes the place of the measurement.
A change is shown where the comparison then fails, with a part to spare for the noise of a measurement. A simulation
that agrees says no more of its parameters than that.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from steer_env import friction, manoeuvres
from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.words import percent
from steer_env.experiments.studies.common import simulation_vs_measurement
from steer_env.experiments.studies.common.scaling import scale_record
from steer_env.experiments.studies.common.simulation_vs_measurement import ENOUGH, Tolerance
from steer_env.friction.law import as_mapping, law_of
from steer_env.friction.sites import LEAST_SLIDING_TORQUE, NOTHING, Sites, sliding_torque
from steer_env.metrics import RefusedError
from steer_env.recording.recording import Recording
from steer_env.vehicle import cars
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.kinds import common as kinds

FACTORS = (1.1, 1.2, 1.35, 1.5, 2.0, 3.0)  # by which a parameter is multiplied and divided, assumed [1]
_BELOW = tuple(1.0 / factor for factor in FACTORS)
SPARE = 0.04  # share of the points that has to be outside beyond what is allowed: a measurement has noise, assumed [1]
SAME = 0.1  # distance up to which the simulation that is driven again is the one that was given, assumed [tolerances]
STEERED = "steered_as_measured"  # key of the meta of a simulation with the handwheel angle of a measurement
WORKERS = 4  # threads; the kernels run without Python's lock

Change = Callable[[Car, Any, float], tuple[Car, Any]]


class Simulated(NamedTuple):
    """What a simulation was made with."""

    car: Car
    law: Any  # parameters
    manoeuvre: manoeuvres.Manoeuvre


class ShownFactors(NamedTuple):
    """From which change on the comparison would have failed."""

    parameter: str  # in words
    below: float | None  # greatest factor below 1 that is shown; None where none of those that were tried is [1]
    above: float | None  # least factor above 1 [1]


class Power(NamedTuple):
    """What a comparison would have shown, and what not."""

    parameters: tuple[ShownFactors, ...]
    laws: Mapping[str, bool]  # every other law with its defaults -> whether it is shown
    unknown: str = ""  # why nothing is known, in words


def _level(car: Car, law: Any, factor: float) -> tuple[Car, Any]:
    return car, scale_record(law, factor, 1.0)


def key_times(name: str, car: Car, law: Any, factor: float) -> tuple[Car, Any]:
    """The car with a number of its file, or all of a list, times a factor; ValueError where a car cannot have it."""
    section, _, key = name.partition(".")
    if name in kinds.follows(car.kind):  # no key of its file
        made = getattr(car, section)
        return car._replace(**{section: made._replace(**{key: factor * getattr(made, key)})}), law
    own = car.data()[section].get(key, 1.0)
    changed = [factor * value for value in own] if isinstance(own, list) else factor * own
    return cars.load(car.data(), changes={name: changed}), law


CHANGES: Mapping[str, Change] = {
    "friction": _level,
    "torsion bar (K_tb)": partial(key_times, "column.K_tb"),
    "inertia below it (I2)": partial(key_times, "column.I2"),
    "boost": partial(key_times, "assist.boost_scale"),
    "delay of the assist": partial(key_times, "assist.delay"),
    "cornering stiffness in front": partial(key_times, "chassis.front_cornering_stiffness_factor"),
    "cornering stiffness behind": partial(key_times, "chassis.rear_cornering_stiffness_factor"),
}


def simulation_of(recording: Recording) -> Simulated:
    """What a recording was simulated with, by its trace.

    Raises
    ------
    ValueError
        In words, where the recording is none of this project's own car.
    """
    trace = recording.meta.get("trace") or {}
    laws = [*trace.get("friction", {}).values()]
    if "car" not in trace or len(laws) != 1:
        raise ValueError("its trace names no car and law that could be driven again")
    try:
        law = friction.resolve(provenance.friction_from_trace(laws[0]))
        made = manoeuvres.make(recording.meta["manoeuvre"])
        manoeuvre = replace(made, speed=recording.meta["speed_m_s"], chassis=recording.meta["chassis"])
        if recording.meta.get(STEERED):
            manoeuvre = replace(manoeuvre, amplitude=recording.meta["amplitude_rad"], lateral_acceleration=None)
        return Simulated(cars.load(trace["car"]), law, manoeuvre)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"the car or the law of its trace is not known here: {error}") from None


def power(
    recording: Recording, test: str, allowed: Mapping[str, Tolerance], channels: frozenset[str], **given: Any
) -> Power:
    """What the comparison with a simulation would have shown.

    Parameters
    ----------
    recording : Recording
        The simulation.
    test : str
    allowed : mapping
        Tolerances by channel.
    channels : set of str
        Those that the measurement has, too.
    given
        Conditions as for :func:`simulation_vs_measurement.compare`.
    """
    kept = recording.without(*(recording.channels.keys() - channels))

    def inside(car: Car, law: Any) -> tuple[float, float]:
        """Least share of points inside over the cross plots, and the largest distance [tolerances]."""
        driven = manoeuvres.drive(car, own.manoeuvre, law)
        driven = driven.without(*(driven.channels.keys() - channels))
        pairs = simulation_vs_measurement.compare(driven, kept, test, allowed, **given)
        return min(pair.inside for pair in pairs), max(pair.worst for pair in pairs)

    def shows(car: Car, law: Any) -> bool | None:
        """Whether a change is shown; None where it cannot be driven or read."""
        try:
            return inside(car, law)[0] < ENOUGH - SPARE
        except (ValueError, RefusedError):
            return None

    def first(cases: list[tuple[float, Car, Any]]) -> float | None:
        """The first factor that is shown, where all before it could be driven."""
        for factor, car, law in cases:
            shown = shows(car, law)
            if shown is not False:
                return factor if shown else None
        return None

    try:
        own = simulation_of(recording)
        if inside(own.car, own.law)[1] > SAME:
            raise ValueError("driven again by its trace it is another one")
    except (ValueError, RefusedError) as error:
        return Power((), {}, str(error))
    others = other_laws(own.car, own.law)
    sides = [(change, factors) for change in CHANGES.values() for factors in (_BELOW, FACTORS)]
    with ThreadPoolExecutor(WORKERS) as pool:
        ends = list(pool.map(first, [_change(own, change, factors) for change, factors in sides]))
        laws = dict(zip(others, pool.map(lambda p: bool(shows(own.car, p)), others.values())))
    return Power(tuple(map(ShownFactors, CHANGES, ends[::2], ends[1::2])), laws)


def other_laws(car: Car, own: Any) -> dict[str, Any]:
    """The other laws with their defaults, at one site or, as the own friction, at those of the car's steering."""
    if not isinstance(own, Sites):
        return {law: friction.make(law) for law in friction.available() if law != law_of(own).name}
    used = {law_of(site.law).name for site in own if as_mapping(site.law) != NOTHING}
    found = {}
    for law in friction.available():
        made = friction.make(law)
        if {law} != used and law_of(made).mean_torque is not None:  # which a site needs
            # Of a gear, no load makes it grow
            without = "" if sliding_torque(made) > LEAST_SLIDING_TORQUE else ",efficiency=1"
            found[law] = friction.resolve(f"{law}{without}@{car.kind}")
    return found


def _change(own: Simulated, change: Change, factors: Sequence[float]) -> list[tuple[float, Car, Any]]:
    """Car and law with a parameter times each factor, up to the first that car file or law do not allow."""
    cases = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cars.UnusualCar)
        for factor in factors:
            try:
                cases.append((factor, *change(own.car, own.law, factor)))
            except ValueError:
                break
    return cases


def both_ways(power: Power) -> dict[str, float]:
    """Parameters that are shown both less and more -> the factor by which they are [1]."""
    ends = {each.parameter: (each.below, each.above) for each in power.parameters}
    return {name: max(1.0 / below, above) for name, (below, above) in ends.items() if below and above}


def rows(power: Power) -> list[tuple[str, str, str]]:
    """What was changed, from which change on it would have been shown, and what would not, in words."""

    def of(factor: float | None) -> str:
        return "" if factor is None else f"{percent(abs(factor - 1.0))} {'more' if factor > 1.0 else 'less'}"

    found = []
    for each in power.parameters:
        ends = [text for text in map(of, (each.below, each.above)) if text]
        hidden = [side for side, end in (("less", each.below), ("more", each.above)) if end is None]
        found.append((each.parameter, " or ".join(ends), " or ".join(hidden)))
    told, hidden = ([law for law, shown in power.laws.items() if shown is wanted] for wanted in (True, False))
    return [*found, ("another friction law, with its defaults", ", ".join(told), ", ".join(hidden))]


def in_words(power: Power) -> str:
    """What the comparison would have shown, in one or two sentences."""
    if power.unknown:
        return f"What differences of the car this would have shown is unknown: {power.unknown}."
    *parameters, laws = rows(power)
    shown = [f"{name} {ends}" for name, ends, _ in parameters if ends] + [f"the law {laws[1]}"] * bool(laws[1])
    hidden = [f"{name} {side}" if ends else name for name, ends, side in parameters if side]
    hidden += [f"the law {laws[2]}"] * bool(laws[2])
    said = f"It would have shown a difference of {', '.join(shown)}" if shown else "It would have shown nothing"
    return f"{said}, but not {', '.join(hidden)}." if hidden else f"{said}."


def as_json(power: Power) -> dict[str, Any]:
    """The power as JSON; null where no factor that was tried is shown."""
    return {
        "parameters": {each.parameter: [each.below, each.above] for each in power.parameters},
        "laws": dict(power.laws),
        "unknown": power.unknown or None,
    }
