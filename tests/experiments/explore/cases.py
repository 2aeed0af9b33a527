"""What the tests of the page run over, and Python's metrics for values of the page."""

from dataclasses import replace
from itertools import cycle

import pytest

from steer_env import friction, metrics
from steer_env.experiments.explore import drives, parameters
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars, chassis
from tests.experiments.explore.chromium import Chromium, chromium_needed
from tests.experiments.explore.firefox import Firefox, firefox_needed

SITES = "masing,efficiency=0.88@gear+coulomb,F_c=0.05@upper_column"
# Laws or sites, and chassis: pairs in every run, every law in the whole suite, with the chassis in turn.
QUICK = [("lugre", "single_track"), ("masing", "two_track"), (SITES, "two_track")]
OTHERS = [
    (law, body)
    for law, body in zip(friction.available(), cycle(chassis.available()))
    if law not in {law for law, _ in QUICK}
]
EACH = [*QUICK, *(pytest.param(*pair, marks=pytest.mark.whole) for pair in OTHERS)]
CHANGED = {
    "friction.F_c": 1.4,
    "column.K_tb": 190.0,
    "assist.boost_scale": 0.8,
    "assist.friction_share": 0.3,
    "steering.pinion_radius": 0.0075,
    "chassis.front_cornering_stiffness_factor": 1.2,
    "load": 250.0,
    "speed_kph": 120.0,
}
BROWSERS = [pytest.param(Chromium, marks=chromium_needed), pytest.param(Firefox, marks=firefox_needed)]
in_both = pytest.mark.parametrize(
    "browser", BROWSERS, indirect=True
)  # other tests run in Chromium, which starts sooner
READY = "typeof steerShown === 'object' && steerShown.answer?.exact && steerShown.answer.id"


def address(page, law="lugre", body="single_track", **values):
    """The address of a page from disk with a car."""
    pairs = {"law": law, "chassis": body, **values}
    return f"{page.as_uri()}#{'&'.join(f'{key}={value}' for key, value in pairs.items())}"


def driven(law, body, values, name="weave", vehicle="compact"):
    """Python's recording of a standard manoeuvre with values of the page."""
    car, made = cars.load(vehicle), drives.made(name)
    made = replace(made, speed=values.get("speed_kph", made.speed * 3.6) / 3.6, chassis=body)
    p = parameters.plant(car, law, body, values) if values else driving.build_plant(car, made, law)
    return driving.drive_plant(car, p, made)


def evaluated(law, body, values, name="weave"):
    """Python's metrics of the standard manoeuvre with values of the page."""
    return metrics.evaluate(driven(law, body, values, name), intervals=False)
