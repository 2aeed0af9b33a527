"""The study of the car split at the rack, and the report of an external vehicle that is the exported chassis."""

import json
import math
import shutil

import pytest

from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import report
from steer_env.experiments.reports.report_results import Scope
from steer_env.experiments.studies import coupling
from steer_env.experiments.studies.common import coupling_runs as runs
from steer_env.experiments.studies.common.coupling_runs import FREQUENCY, KINDS
from steer_env.friction import make
from steer_env.vehicle import cars
from tests.experiments.faked_times import NONE
from tests.experiments.first_screen import sentence

pytest.importorskip("fmpy", reason="the extra fmu is not installed")
if shutil.which("cc") is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

pytestmark = pytest.mark.whole

SERIAL, PARALLEL, HELD = KINDS


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The page of one law, its numbers, and the unit."""
    out = tmp_path_factory.mktemp("made") / "coupling"
    assert main(["study", "coupling", "--friction", "lugre", "--out", str(out)]) == 0
    return out, json.loads((out / "coupling.json").read_text())


def test_a_delay_is_seen_in_phase_energy_and_motion(made):
    costs = made[1]["laws"]["lugre"]["costs"]
    turn = 2.0 * math.pi * FREQUENCY * 1e-3  # of a delay of a millisecond [rad]
    assert abs(costs[SERIAL]["1 ms"]["phase"]) < 0.02 * turn
    assert costs[PARALLEL]["1 ms"]["phase"] == pytest.approx(-turn, rel=0.02)
    assert costs[HELD]["1 ms"]["phase"] == pytest.approx(-1.5 * turn, rel=0.02)  # a held force is half a step late
    for step, ratio in (("1 ms", 1e-3), ("5 ms", 1e-2)):
        serial, parallel, held = (costs[kind][step] for kind in KINDS)
        assert abs(serial["energy"]) < ratio * abs(parallel["energy"]) < ratio * abs(held["energy"])
        assert abs(serial["swing"]) < 10 * ratio * parallel["swing"] < 10 * ratio * held["swing"]
        assert parallel["energy"] < 0.0  # the steering receives energy that the vehicle does not give
    for kind in (PARALLEL, HELD):
        assert costs[kind]["5 ms"]["swing"] == pytest.approx(5.0 * costs[kind]["1 ms"]["swing"], rel=0.1)
    longest = made[1]["laws"]["lugre"]["longest_step_ms"]
    assert longest[SERIAL] >= longest[PARALLEL] >= longest[HELD] >= 20


def test_page_begins_with_the_verdict_and_every_way_gives_the_same(made):
    out, data = made
    page = (out / "index.html").read_text()
    assert sentence(page).startswith("A 1 ms split at the rack changes metrics by at most ")
    assert page.index("costs nothing that counts") < page.index("Largest change of a metric of the weave")
    assert data["transports"] == {name: {"equal": True} for name in data["transports"]}
    assert list(data["transports"]) == ["FMU", "FMU in its own process", "UDP, from another process"]


def test_report_of_the_imported_chassis_is_that_of_the_whole_car(made, tmp_path):
    """The metrics of the weave agree to the error that the study states."""
    stated = max(abs(share) for share in made[1]["laws"]["lugre"]["costs"][SERIAL]["1 ms"]["metrics"].values())
    assert stated < 1e-5
    path = tmp_path / "chassis.fmu"
    path.write_bytes(runs.exported(cars.load()))
    scope = Scope(tests={"weave": {}}, vehicle=False, widths=(), steps=(1e-3,), speeds_kph=(0.0,))
    laws = {"lugre": make("lugre")}
    whole = report.build(tmp_path / "whole", laws, scope).drives["weave"]["lugre"].values
    report.build(tmp_path / "divided", laws, scope._replace(chassis=str(path)))
    metrics = json.loads((tmp_path / "divided" / "metrics.json").read_text())
    for name, value in whole.items():
        assert metrics["metrics"]["lugre"][name]["value"] == pytest.approx(value.value, rel=1.1 * stated)
    assert metrics["provenance"]["external_vehicle"]["name"] == str(path)
    assert str(path) in (tmp_path / "divided" / "index.html").read_text()


def test_verdict_tells_what_is_not_the_same(made):
    car = cars.load()
    cost = runs.Cost({"yaw_lag": 0.1, "loop_area": -0.2}, -0.01, -0.5, 0.3)
    law = runs.LawCost({kind: {1: cost, 5: cost} for kind in KINDS}, {SERIAL: 200, PARALLEL: 5, HELD: None})
    ways = [runs.Transport("FMU", True), runs.Transport("UDP", False)]
    results = coupling.Results(car, {"lugre": law, "masing": law}, ways, NONE.measured)
    found = coupling.of_coupling(results, SERIAL, 1)
    assert (found.law, found.metric) == ("lugre", "loop_area")
    assert found.share == pytest.approx(0.2)
    assert found.share > coupling.COUNTS
    assert coupling.longest_steps(results) == {SERIAL: 200, PARALLEL: 5, HELD: None}
    page, data = coupling.build(results)
    assert "by at most 20 %" in sentence(page.html())
    assert data["transports"]["UDP"] == {"equal": False}
