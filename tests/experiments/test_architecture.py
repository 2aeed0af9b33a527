"""The study of architectures: what it says of the steering is what the steering does."""

import pytest

from steer_env.experiments.pages import pictures
from steer_env.experiments.studies import architecture
from steer_env.experiments.studies.common import battery

COLUMN, MAP, FORCE = "column EPS", "by wire, map", "by wire, rack force"


@pytest.fixture(scope="module")
def found():
    return architecture.collect((COLUMN, MAP, FORCE), ("viscous", "dahl"), ("slow-ramp",))


def test_the_hand_feels_the_law_through_a_column_and_hardly_by_a_map(found):
    """A damper in place of dry friction takes the dead band of a column; by the map the handwheel's tenth alone."""
    seen = found["slow-ramp: torque dead band"]
    assert {seen[name].law for name in (COLUMN, MAP, FORCE)} == {"viscous"}
    assert seen[COLUMN].share < -0.25
    assert 0.05 < seen[MAP].share / seen[COLUMN].share < 0.25
    assert seen[COLUMN].laws == 1  # Dahl's law is LuGre without damping
    assert "Of 15 metrics" in architecture.verdict(found)
    assert pictures.architecture(found).startswith("<?xml")


def test_the_map_knows_nothing_of_the_rack():
    """With a law at the rack alone no torque depends on it, to the closeness of an amplitude; a column's does."""
    differ = {}
    for name in (MAP, COLUMN):
        car = architecture.architecture(name)
        drives = [battery.drive(car, {"rack": law}, "slow-ramp") for law in ("dahl", "viscous")]
        differ[name] = abs(drives[1].values["torque_at_0g"].value / drives[0].values["torque_at_0g"].value - 1.0)
    assert differ[MAP] < 1e-4
    assert differ[COLUMN] > 0.2
