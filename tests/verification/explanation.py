"""Nearest explanations of `validate`, of made pairs whose difference is known."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from steer_env import friction, manoeuvres
from steer_env.experiments.pages import provenance
from steer_env.experiments.studies.common import explanation, simulation_vs_measurement
from steer_env.experiments.studies.common.explanation import ASSIST_LATE, LATE, PARAMETERS, Explanation, Fit, Setting
from steer_env.experiments.studies.common.scaling import scale_record
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle import cars
from tests.synthetic.faults import noisy
from tests.synthetic.recordings import changed
from tests.verification.common.rows import Row, verdict

PAIRS = 60
SEED = 7600  # of the judged pairs; none of them was looked at before
TESTS = ("weave", "step-steer", "sine")
LOGGED = {ANGLE, TORQUE, AY, "yaw_rate", "vehicle_speed"}
RATE = 100.0  # of the logger [Hz]
HELD = 0.9  # least share of the pairs
NO_CAUSE = 3  # every so many pairs have a difference that no named parameter makes
# Sizes of the differences: of a factor, up or down [1]; of a delay [s]; of an offset, either way [SI].
FACTORS = {
    "friction": (1.25, 1.6), "boost": (1.2, 1.5), "torsion bar (K_tb)": (1.2, 1.5), "steering ratio": (1.05, 1.12),
    "inertia of the handwheel (I1)": (1.3, 1.6), "inertia below it (I2)": (1.3, 1.6),
    "cornering stiffness in front": (1.08, 1.25), "cornering stiffness behind": (1.08, 1.25),
}  # fmt: skip
DELAYS = {ASSIST_LATE: (1e-3, 3e-3), LATE: (8e-3, 25e-3)}
OFFSETS = {TORQUE: (0.1, 0.3), ANGLE: (1.0 * DEGREE, 3.0 * DEGREE)}
LAWS = ("masing", "dahl", "coulomb", "stribeck", "gms")


class Pair(NamedTuple):
    """A measurement that was made, and the simulation that differs from it."""

    measured: Recording
    simulated: Recording
    test: str
    values: Mapping[str, float]  # named parameter -> factor [1], delay [s] or offset [SI]; empty: none makes it
    about: str  # the difference in words


def simulated(test: str, at: Setting) -> Recording:
    """What ``steer-env run`` records of a test."""
    found = manoeuvres.drive(at.car, manoeuvres.make(test), at.law)
    found = found.without(*(found.channels.keys() - LOGGED))
    trace = provenance.trace(car=at.car, friction={"own": at.law})
    return replace(found, meta={**found.meta, "trace": trace}).filtered(80.0).resampled(200.0)


def logged(test: str, at: Setting, offsets: Mapping[str, float], rng: np.random.Generator) -> Recording:
    """What a logger with noise records of a test, and no trace."""
    found = manoeuvres.drive(at.car, manoeuvres.make(test), at.law)
    found = found.without(*(found.channels.keys() - LOGGED))
    torque = np.interp(found.time - at.late, found.time, found[TORQUE])
    found = changed(found, **{TORQUE: torque}).filtered(0.4 * RATE).resampled(RATE)
    found = changed(found, **{name: found[name] + size for name, size in offsets.items()})
    return noisy(replace(found, meta={k: v for k, v in found.meta.items() if k != "trace"}), rng)


def own() -> Setting:
    """The default car with its friction."""
    car = cars.load()
    return Setting(car, friction.resolve(car.friction))


def _caused(rng: np.random.Generator) -> tuple[Setting, dict[str, float], dict[str, float]]:
    """A setting that differs in one or two named parameters, with the offsets of sensors and all differences."""
    names = [*FACTORS, *DELAYS, *OFFSETS, "law"]
    chosen = [str(name) for name in rng.choice(names, rng.integers(1, 3), replace=False)]
    at, values, by_name = own(), {}, {each.name: each for each in PARAMETERS}
    for name in sorted(chosen, key=lambda each: each != "law"):
        if name == "law":
            law = str(rng.choice(LAWS))
            level = math.exp(rng.uniform(-0.3, 0.3))
            at = at._replace(law=scale_record(friction.resolve(f"{law}@{at.car.kind}"), level, 1.0))
            values[f"law {law}"] = level
            continue
        low, high = {**FACTORS, **DELAYS, **OFFSETS}[name]
        size = rng.uniform(low, high)
        if name in FACTORS:
            size = size ** rng.choice([-1.0, 1.0])
            at = by_name[name].change(at, math.log(size))
        elif name in DELAYS:
            at = by_name[name].change(at, size)
        else:
            size *= rng.choice([-1.0, 1.0])
        values[name] = size
    return at, {name: size for name, size in values.items() if name in OFFSETS}, values


def _torque_scale(at: Setting, found: Recording, rng: np.random.Generator) -> Recording:
    return changed(found, **{TORQUE: found[TORQUE] * rng.uniform(1.15, 1.35) ** rng.choice([-1.0, 1.0])})


def _acceleration_scale(at: Setting, found: Recording, rng: np.random.Generator) -> Recording:
    return changed(found, **{AY: found[AY] * rng.uniform(1.12, 1.25) ** rng.choice([-1.0, 1.0])})


def _play(at: Setting, found: Recording, rng: np.random.Generator) -> Recording:
    """A torque sensor that shows nothing of small torques."""
    play = rng.uniform(0.3, 0.6)
    return changed(found, **{TORQUE: np.sign(found[TORQUE]) * np.maximum(np.abs(found[TORQUE]) - play, 0.0)})


def _without_boost_shape(at: Setting, rng: np.random.Generator) -> Setting:
    """A boost that grows in proportion to the torque."""
    torques = np.array(at.car.assist.torques)
    rows = [(torques * rng.uniform(1.0, 1.8)).tolist() for _ in at.car.assist.speeds]
    return at._replace(car=cars.load(at.car, changes={"assist.boost": rows}))


def _active_return(at: Setting, rng: np.random.Generator) -> Setting:
    return at._replace(car=cars.load(at.car, changes={"assist.return_gain": float(rng.uniform(3.0, 8.0))}))


def _three(at: Setting, rng: np.random.Generator) -> Setting:
    by_name = {each.name: each for each in PARAMETERS}
    for name in ("friction", "boost", "cornering stiffness in front"):
        at = by_name[name].change(at, math.log(rng.uniform(*FACTORS[name])) * rng.choice([-1.0, 1.0]))
    return at


SENSORS: tuple[Callable[..., Recording], ...] = (_torque_scale, _acceleration_scale, _play)
OTHER: tuple[Callable[..., Setting], ...] = (_without_boost_shape, _active_return, _three)


def make(rng: np.random.Generator, caused: bool) -> Pair:
    """A pair that does not agree; ``caused`` by named parameters, or by what has no name among them."""
    clean = {test: simulated(test, own()) for test in TESTS}
    while True:
        test, at = str(rng.choice(TESTS)), own()
        offsets, values = dict[str, float](), dict[str, float]()
        if caused:
            at, offsets, values = _caused(rng)
            measured, about = logged(test, at, offsets, rng), ", ".join(values)
        else:
            kind = (*SENSORS, *OTHER)[rng.integers(len(SENSORS) + len(OTHER))]
            about = kind.__name__.strip("_").replace("_", " ")
            at = kind(at, rng) if kind in OTHER else at
            measured = logged(test, at, offsets, rng)
            measured = kind(at, measured, rng) if kind in SENSORS else measured
        if not simulation_vs_measurement.passes(simulation_vs_measurement.compare(measured, clean[test])):
            return Pair(measured, clean[test], test, values, about)


class Judged(NamedTuple):
    """What was found of a pair."""

    pair: Pair
    found: Explanation

    @property
    def naming(self) -> Fit | None:
        """The fit that changes what differs, but for what is said to be hidden; None where none does."""
        wanted = self.pair.values.keys() - {*self.found.hidden, *OFFSETS}
        offsets = self.pair.values.keys() & OFFSETS.keys()
        if not self.found.explained or not offsets <= self.found.offsets.keys():
            return None
        return next((fit for fit in (self.found.best, *self.found.equal) if {*fit.names} == wanted), None)

    @property
    def held(self) -> list[bool]:
        """Whether the interval of each named parameter that differs holds its value."""
        if self.naming is None:
            return []
        ends = {change.name: change for change in self.naming.changes} | dict(self.found.offsets)
        values = {"friction" if name.startswith("law ") else name: x for name, x in self.pair.values.items()}
        return [bool(ends[name].low <= x <= ends[name].high) for name, x in values.items() if name in ends]


def judge(pairs: int, seed: int) -> Iterator[Judged]:
    """Made pairs and their nearest explanations."""
    for k in range(pairs):
        pair = make(np.random.default_rng([seed, k]), caused=k % NO_CAUSE != NO_CAUSE - 1)
        allowed = simulation_vs_measurement.tolerances()
        yield Judged(pair, explanation.explain(pair.measured, pair.simulated, pair.test, allowed))


def rows(pairs: int = PAIRS, seed: int = SEED) -> Iterator[Row]:
    """Made pairs that do not agree: whether the cause is named, its interval holds it, and where none is named."""
    found = [*judge(pairs, seed)]
    caused, other = ([each for each in found if bool(each.pair.values) is wanted] for wanted in (True, False))
    held = [holds for each in caused for holds in each.held]
    for what, each in (
        ("the cause is named first or as equally good", [each.naming is not None for each in caused]),
        ("its interval holds the truth", held),
        ("that no named parameter explains it is said", [not each.found.explained for each in other]),
    ):
        share = sum(each) / max(len(each), 1)
        yield Row(what, f"{sum(each)} of {len(each)}", f">= {100 * HELD:.0f} %", verdict(share >= HELD))
