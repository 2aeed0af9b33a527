"""What a tuning scenario is, and the registry of scenarios: the tests that a parameter set is driven through.

A scenario is one file: its declaration. :mod:`steer_env.tuning.driving` drives the tests.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from steer_env import manoeuvres, metrics
from steer_env.friction.numerics.registry import Registry, camel_case
from steer_env.manoeuvres import Manoeuvre

SPEEDS = (12.0, 50.0)  # at which every packaged car can carry out the tests at the context's speed [m/s]


class Drive(NamedTuple):
    """A test that a parameter set is driven through: the battery's standard one, shortened by its options."""

    manoeuvre: Manoeuvre
    at_context_speed: bool  # otherwise at the test's own speed
    thinning: int  # the metrics use one of this many samples of 1 ms, where that changes no metric by more than 5e-4


@dataclass(frozen=True)
class Scenario:
    """A tuning scenario; :func:`register` makes it an id."""

    name: str  # of the id
    summary: str
    parameters: tuple[str, ...]  # of ``steer_env.tuning.parameters.KNOWN``
    drives: tuple[Drive, ...]
    bounds: dict[str, float]  # observed metrics; the observation space spans +- this [unit of the metric]
    least_road_friction: float  # on which every packaged car reaches the tests' lateral accelerations [1]
    weights: dict[str, float] = field(default_factory=dict)  # of metrics in the reward that do not weigh 1

    @property
    def tests(self) -> tuple[str, ...]:
        """Names of the tests driven."""
        return tuple(drive.manoeuvre.name for drive in self.drives)

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics that the tests give."""
        return tuple(name for test in self.tests for name in metrics.available(test))


SCENARIOS: Registry[Scenario] = Registry("tuning scenario", "steer_env.tuning.scenarios", camel_case)


def register(scenario: Scenario) -> Scenario:
    """Make a scenario known under its name."""
    return SCENARIOS.register(scenario.name, scenario)


def drive(name: str, at_context_speed: bool = False, thinning: int = 1, **options: Any) -> Drive:
    """A test by the name of its manoeuvre, with the manoeuvre's options."""
    return Drive(manoeuvres.make(name, **options), at_context_speed, thinning)
