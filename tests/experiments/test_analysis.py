"""The page of the linearised car: its numbers are those of the loop, and it tells what misses the limits."""

import json
import math

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.calibration import constraints, margin_map
from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import analysis, analysis_page
from steer_env.experiments.studies.common.assist_margins import assist_cells
from steer_env.friction.sites import transmissions
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import assist_loop
from steer_env.vehicle.analysis.operating_point import cornering, steady, with_hands
from steer_env.vehicle.steering import margins
from steer_env.vehicle.steering.margins import Margins

WHOLE_MAP = {name: getattr(margin_map, name) for name in ("SPEEDS", "TORQUES")}


@pytest.fixture(autouse=True, scope="module")
def small():
    """A map of four points for each pair of hands and friction."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(margin_map, "SPEEDS", (30.0, 60.0))
        patch.setattr(margin_map, "TORQUES", (0.0, 3.0, 9.0))
        patch.setattr(analysis, "MODES_SPEEDS", np.array([50.0, 100.0]))
        patch.setattr(analysis, "BODE_SPEEDS", (100.0,))
        yield


@pytest.fixture(scope="module")
def compact(tmp_path_factory, small):
    """The numbers of the page of the compact car."""
    out = tmp_path_factory.mktemp("compact") / "page"
    assert main(["analyse", "--vehicle", "compact", "--out", str(out)]) == 0
    return json.loads((out / "analyse.json").read_text(encoding="utf-8"))


@pytest.mark.whole
def test_page_of_a_car(compact):
    """Margins as those of the loop itself; a torque out of reach is told."""
    data = compact
    assert data["missed"] == []
    standing = [cell for cell in data["map"] if cell["speed_kph"] == 0.0]
    assert len(data["map"]) - len(standing) == 36
    assert sum(cell["reached"] for cell in data["map"]) - len(standing) == 24
    own = next(c for c in data["map"] if (c["speed_kph"], c["torque"], c["hands"]) == (60.0, 3.0, "off"))
    car = cars.load("compact")
    point = with_hands(steady(cornering(car, 60.0 / 3.6), torque=3.0), "off")
    passed = transmissions(friction.resolve(car.friction))
    expected = margins.least([assist_loop.margins(assist_loop.transmitted(point, factor)) for factor in passed])
    assert own["friction"] == margin_map.SLIDING
    assert (own["gain"], own["phase"], own["disk"]) == pytest.approx((expected.gain, expected.phase, expected.disk))


@pytest.mark.whole
def test_a_worm_gear_is_told_where_it_takes_margin(tmp_path):
    """20 log(1/0.88) = 1.11 dB, which the test of the gear in the car finds; sliding margins know no other friction."""
    found = {}
    for name, law in (("one", "lugre"), ("gear", "lugre,efficiency=0.88@gear+coulomb,F_c=0.1@upper_column")):
        assert main(["analyse", "--vehicle", "compact", "--friction", law, "--out", str(tmp_path / name)]) == 0
        found[name] = json.loads((tmp_path / name / "analyse.json").read_text(encoding="utf-8"))
    assert found["one"]["driven_back_db"] == 0.0
    assert found["gear"]["driven_back_db"] == pytest.approx(1.11, abs=0.01)
    sliding = [[c for c in each["map"] if c["friction"] == margin_map.SLIDING] for each in found.values()]
    least = [min(20.0 * math.log10(c["gain"] or math.inf) for c in each if c["reached"]) for each in sliding]
    assert least[1] == pytest.approx(least[0] - 1.11, abs=0.02)  # at standstill, with the least motor damping


@pytest.mark.whole
def test_the_compact_keeps_its_margins_with_a_part_of_the_friction_above_the_bar(monkeypatch):
    """At every point of the whole map that the car reaches, with 15 % of the friction there."""
    for name, values in WHOLE_MAP.items():
        monkeypatch.setattr(margin_map, name, values)
    split = {"upper_column": "lugre,F_c=0.135", "gear": "lugre,F_c=0.765"}
    car = cars.load("compact")
    cells = margin_map.standing(car, split) + margin_map.of_car(car, split, (0.0,), "single_track")
    assert sum(cell.margins is not None for cell in cells) > 150
    assert margin_map.cells_below_limits(cells) == []


@pytest.mark.whole
def test_every_page_has_the_margins_of_one_function(compact, tmp_path):
    """At standstill, of pages of the car and of the analysis, of the report, a tuning and the tuning environment."""
    assert main(["car", "compact", "--page", "--out", str(tmp_path / "car")]) == 0
    car, found = cars.load("compact"), list[tuple[float, float]]()
    quantities = json.loads((tmp_path / "car" / "car.json").read_text(encoding="utf-8"))["quantities"]
    found.append((quantities["phase_margin_0"]["value"], quantities["gain_margin_0"]["value"]))
    assert "the column with fixed hands" in quantities["phase_margin_100"]["note"]  # with tyres it is another quantity
    standing = [cell for cell in compact["map"] if cell["speed_kph"] == 0.0]
    phase, gain = min(cell["phase"] for cell in standing), min(cell["gain"] for cell in standing)
    found += [(math.degrees(phase), 20.0 * math.log10(gain)), tuple(compact["least"].values())]
    law = friction.resolve(car.friction)
    cells = assist_cells(car, 0.0, [law])
    found.append((min(cell.phase_deg for cell in cells), min(cell.gain_db for cell in cells)))
    tuned = constraints.margins(car, car.assist, law, 0.0, constraints.reaches(car))
    found.append((tuned["column_phase_0"], tuned["column_gain_0"]))
    worst = margins.worst_margins(car.column, car.assist, 0.0, transmissions=transmissions(law))
    found.append((math.degrees(worst.phase), 20.0 * math.log10(worst.gain)))
    assert len({(round(phase, 9), round(gain, 9)) for phase, gain in found}) == 1, found


@pytest.mark.whole
def test_a_loop_that_misses_the_limits(tmp_path):
    """A later motor and more boost: the points are named."""
    changes = ["--set", "assist.boost_scale=1.3", "--set", "assist.delay=0.004"]
    assert main(["analyse", *changes, "--out", str(tmp_path / "page")]) == 0
    data = json.loads((tmp_path / "page" / "analyse.json").read_text(encoding="utf-8"))
    below = [
        c
        for c in data["map"]
        if c["reached"]
        and (
            math.degrees(c["phase"] or math.inf) < 30.0
            or 20.0 * math.log10(c["gain"] or math.inf) < 6.0
            or not c["stable"]
        )
    ]
    assert below
    assert len(below) == len(data["missed"])


def test_only_the_limit_that_is_missed_is_named():
    kept = Margins(4.0, math.radians(60.0), 1.0, 1.0, 10.0, stable=True)
    found = [margin_map.Cell(20.0, 3.0, "on", margin_map.SLIDING, kept)]
    assert analysis_page.limits(found) == ["30 deg", "6 dB"]
    early = found[0]._replace(margins=kept._replace(phase=math.radians(24.0)))
    assert analysis_page.limits([*found, early]) == ["30 deg"]
    unstable = found[0]._replace(margins=kept._replace(gain=0.9, stable=False))
    assert analysis_page.limits([*found, early, unstable]) == ["stability", "30 deg", "6 dB"]
