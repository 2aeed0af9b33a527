"""Populations: many cars whose parameters are drawn from tolerances, driven through tests.

Every parameter has a stream of random numbers of its own, of the seed, the number of the car and the parameter's name.
A row is therefore the same whatever the size of the population, its other parameters and the workers are, and two
populations that differ in one tolerance hold the same cars but for that.
"""

import math
import zlib
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from steer_env import friction as laws
from steer_env import manoeuvres, metrics
from steer_env.experiments.calibration import variation
from steer_env.experiments.calibration.problem import Range
from steer_env.experiments.calibration.variation import Block, Output, Outputs, Study, evaluate, unit_of
from steer_env.experiments.sweep import Runner, Where, run
from steer_env.experiments.sweep.sweep import Notify
from steer_env.friction.numerics.check import number, one_of, whole
from steer_env.friction.sites import Sites
from steer_env.vehicle import cars
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

DISTRIBUTIONS = ("uniform", "normal")
SIGMAS = 3.0  # standard deviations of the normal distribution from the middle of a range to its ends, assumed [1]
BLOCK, BLOCKS = 16, 128  # least number of cars of a case of the sweep, each of which has a car of 0.4 MB; most cases
TESTS = ("weave",)


class Population(NamedTuple):
    """A table: one row for each car, with the parameters that were drawn and the outputs of the tests.

    Outputs are ``"TEST.METRIC"`` and the margins of the assist loop, ``"phase_margin"`` and ``"gain_margin"``.
    """

    parameters: dict[str, Array]  # name -> (n,) [its unit]
    outputs: dict[str, Array]  # name -> (n,), NaN where it is refused [its unit]
    units: dict[str, str]  # of every column
    refused: dict[str, dict[int, str]]  # output -> row -> reason; outputs that are refused in some row

    @property
    def columns(self) -> dict[str, Array]:
        """Every column by name, as ``pandas.DataFrame`` takes them."""
        return {**self.parameters, **self.outputs}


def population(
    car: Car | str | Mapping[str, Any],
    n: int,
    ranges: Mapping[str, float | tuple[float, float]],
    manoeuvre: str | Sequence[str] | Mapping[str, Mapping[str, Any]] = TESTS,
    friction: Any = None,
    *,
    distribution: str = "uniform",
    seed: int = 0,
    chassis: str = "single_track",
    workers: int = 1,
    cluster: str | None = None,
) -> Population:
    """Cars with parameters drawn from tolerances, driven through manoeuvres; a row for each.

    Parameters
    ----------
    car : Car, str or mapping
        The nominal car, as ``cars.load`` takes it.
    n : int
        Number of cars.
    ranges : mapping of str to float or (float, float)
        Tolerance of each parameter that is drawn: a share of the car's own value to either side of it, as 0.05, or the
        ends (low, high) in the parameter's unit. Names are those of
        :func:`steer_env.experiments.calibration.variation.quantity`, such as ``"column.K_tb"``, ``"boost_level"`` and
        ``"friction.sigma_0"``, without ``"speed"``.
    manoeuvre : str, sequence of str or mapping
        Tests that have metrics; the motion of the hands is found for each car where a test asks for a lateral
        acceleration. A mapping gives each test options of ``manoeuvres.make``, and those that it leaves out are of the
        standard test: ``{"weave": {"amplitude": 0.26}}`` turns the handwheel of every car by as much.
    friction : str, mapping or parameters, optional
        Law of the nominal car, in a form of ``friction.resolve``; otherwise the car's own friction.
    distribution : {"uniform", "normal"}
        Over a range; normal: about its middle, with three standard deviations to its ends and nothing beyond. The
        parameters are independent.
    seed : int
    chassis : str
        Of manoeuvres that do not need two tracks.
    workers : int
        Processes of this machine. With more than one, a script needs ``if __name__ == "__main__":``.
    cluster : str, optional
        Dask workers in their place: ``"local"``, ``"local:N"`` or the address of a scheduler.

    Raises
    ------
    ValueError
        An unknown parameter, manoeuvre, option, law or distribution; ``n`` below 1; a tolerance that is not above 0, or
        beyond which the car or the law does not allow a value. The message gives the name, the value and what is
        allowed.
    """
    nominal = cars.load(car)
    law = nominal.friction if friction is None else friction
    given = law if isinstance(laws.resolve(law), Sites) else laws.resolve(law)
    tests = (manoeuvre,) if isinstance(manoeuvre, str) else manoeuvre
    study = study_of(nominal, given, chassis, ranges, tests)
    where = Where.parse(workers if cluster is None else None, cluster)
    return collect(study, n, seed, distribution, partial(run, where=where))


def tolerances(texts: Sequence[str]) -> dict[str, float | tuple[float, float]]:
    """Tolerances from words, each ``NAME=P%`` or ``NAME=LOW:HIGH``; ValueError for one of another form or a second."""
    found: dict[str, float | tuple[float, float]] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if name in found:
            raise ValueError(f"--parameters gives {name} twice: give it once")
        try:
            low, colon, high = value.partition(":")
            found[name] = (float(low), float(high)) if colon else 0.01 * float(value.removesuffix("%"))
            if not equals or bool(colon) == value.endswith("%"):
                raise ValueError
        except ValueError:
            raise ValueError(f"--parameters of production takes NAME=P% or NAME=LOW:HIGH, got {text!r}") from None
    return found


def study_of(
    car: Car,
    law: Any,
    chassis: str,
    ranges: Mapping[str, float | tuple[float, float]],
    tests: Sequence[str] | Mapping[str, Mapping[str, Any]],
    what: str = "ranges",
) -> Study:
    """What the rows of a population depend on but draws; errors of tolerances begin with ``what``."""
    one_of("chassis", chassis, tuple(cars.SPEEDS))
    known = [name for name in manoeuvres.available() if name in metrics.tests()]
    if not tests or len(set(tests)) != len(tests):
        raise ValueError(f"manoeuvre must be one or more of {', '.join(known)}, each once, got {', '.join(tests)!r}")
    for test in tests:
        one_of("manoeuvre", test, known)
    options = dict(tests) if isinstance(tests, Mapping) else {}
    for test, chosen in options.items():
        if not isinstance(chosen, Mapping):
            raise ValueError(f"manoeuvre: the options of {test} must be a mapping, got {chosen!r}")
        manoeuvres.make(test, **chosen)
    if not isinstance(ranges, Mapping) or not ranges:
        raise ValueError(f"{what} must map one or more parameters to their tolerances, got {ranges!r}")
    factors = tuple(_range(car, law, name, given, what) for name, given in ranges.items())
    study = Study(car, law, chassis, factors, tuple(tests), options, own_hands=True)
    change = cars.changer(car)
    for f in factors:
        for end in (f.low, f.high):
            try:
                variation.assist_of(variation.change_car(study, {f.name: end}, change)[0], {f.name: end})
            except ValueError as error:
                raise ValueError(f"{what}: {f.name}={end:g} is not allowed: {error}") from None
    return study


def _range(car: Car, law: Any, name: str, given: Any, what: str) -> Range:
    if name == "speed":
        raise ValueError(f"{what} has 'speed', which is the tests' own: leave it out")
    unit, own, limits = variation.quantity(car, law, name, what)
    if isinstance(given, Sequence) and not isinstance(given, str):
        if len(given) != 2:
            raise ValueError(f"{what}: {name} must be a share of its value or (low, high), got {given!r}")
        low, high = (number(f"{what}: {name} [{unit}]", x, minimum=limits[0], maximum=limits[1]) for x in given)
        if not low < high:
            raise ValueError(f"{what}: {name} must be (low, high) with low < high, got ({low:g}, {high:g})")
    else:
        share = number(f"{what}: the tolerance of {name}", given, minimum=0.0, maximum=1.0, above=True)
        if own == 0.0:
            raise ValueError(f"{what}: {name} is 0, of which {share:g} is none: give the ends (low, high) [{unit}]")
        low, high = sorted((own * (1.0 - share), own * (1.0 + share)))
        if not limits[0] <= low < high <= limits[1]:
            raise ValueError(
                f"{what}: {name} goes from {low:g} to {high:g} with a tolerance of {share:g}; it may go from "
                f"{limits[0]:g} to {limits[1]:g} [{unit}]"
            )
    return Range(name, unit, low, high, own, False, limits)


def draw_car(factors: Sequence[Range], seed: int, index: int, distribution: str = "uniform") -> tuple[float, ...]:
    """The parameters of one car [their units]."""
    found = []
    for f in factors:
        x = np.random.default_rng([seed, index, zlib.crc32(f.name.encode())]).random()
        if distribution == "normal":
            edge = ndtr(-SIGMAS)
            x = 0.5 + 0.5 * float(ndtri(edge + x * (1.0 - 2.0 * edge))) / SIGMAS
        found.append(f.low + x * (f.high - f.low))
    return tuple(found)


def column(output: Output) -> str:
    """The name of an output in the table."""
    return ".".join(part for part in output if part)


def collect(
    study: Study,
    n: int,
    seed: int = 0,
    distribution: str = "uniform",
    sweep: Runner = run,
    notify: Notify = lambda *_: None,
) -> Population:
    """Draw and drive the cars of a population."""
    n, seed = whole("n", n, 1), whole("seed", seed, 0)
    one_of("distribution", distribution, DISTRIBUTIONS)
    study = variation.near_nominal(study)
    rows = [draw_car(study.factors, seed, index, distribution) for index in range(n)]
    size = max(BLOCK, math.ceil(n / BLOCKS))
    blocks = [Block(study, tuple(rows[k : k + size]), f"cars {k + 1} to {min(k + size, n)}") for k in range(0, n, size)]
    driven = sweep(evaluate, blocks, notify=notify, words=lambda block: block.label)
    found: list[Outputs] = [each for block in driven for each in block]
    names = {output: column(output) for output in study.outputs}
    refused = {
        name: {row: each.refused[output] for row, each in enumerate(found) if output in each.refused}
        for output, name in names.items()
    }
    return Population(
        {f.name: np.array([row[k] for row in rows]) for k, f in enumerate(study.factors)},
        {name: np.array([each.values.get(output, math.nan) for each in found]) for output, name in names.items()},
        {f.name: f.unit for f in study.factors} | {name: unit_of(output) for output, name in names.items()},
        {name: reasons for name, reasons in refused.items() if reasons},
    )
