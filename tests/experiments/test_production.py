"""Populations and production: rows by seed and number alone, shares by closed forms, the page, bad input."""

import gc
import json
import math
import re
import weakref
from functools import partial

import numpy as np
import pytest

import steer_env
from steer_env import manoeuvres, metrics, targets
from steer_env.experiments.calibration import population, production, production_page, variation
from steer_env.experiments.calibration.variation import Outputs
from steer_env.experiments.cli.main import main
from steer_env.tuning import driving
from steer_env.tuning.driving import thin_out
from steer_env.vehicle import cars

RANGES = {"column.K_tb": 0.1, "friction_level": (0.7, 1.3), "boost_level": 0.05}


def fake(block):
    """The torque at 0 g rises with the friction; another metric is refused of some cars; the rest is in its band."""
    bands = targets.load("compact").bands["weave"]
    found = []
    for row in block.rows:
        values = dict.fromkeys(block.study.outputs, 90.0)
        values |= {("weave", name): 0.5 * sum(band.good) for name, band in bands.items()}
        values["weave", "torque_at_0g"] = 2.0 * row[1] - 0.1 + 1e-9 * (row[0] + row[2])
        values["weave", "angle_deadband"] = 0.0
        refused = {("weave", "yaw_lag"): "no crossing"} if row[1] < 0.8 else {}
        found.append(Outputs(values | dict.fromkeys(refused, math.nan), refused))
    return found


@pytest.fixture
def faked(monkeypatch):
    for module in (population, production):
        monkeypatch.setattr(module, "evaluate", fake)


def study(ranges=RANGES, tests=("weave",)):
    return population.study_of(cars.load(), "lugre", "single_track", ranges, tests)


@pytest.mark.parametrize("distribution", population.DISTRIBUTIONS)
def test_a_row_depends_on_the_seed_and_its_number_alone(faked, distribution):
    drawn = partial(population.collect, seed=4, distribution=distribution)
    few, many = drawn(study(), 3), drawn(study(), population.BLOCK + 3)
    others = drawn(study({"load": (0.0, 75.0), **dict(reversed(RANGES.items())), "column.I1": 0.1}), 3)
    for name in RANGES:
        assert few.parameters[name].tolist() == many.parameters[name][:3].tolist()
        assert few.parameters[name].tolist() == others.parameters[name].tolist()
    assert few.outputs["weave.torque_at_0g"].tolist() == many.outputs["weave.torque_at_0g"][:3].tolist()
    assert len({*many.parameters["column.K_tb"]}) == population.BLOCK + 3
    assert (
        few.parameters["column.K_tb"].tolist() != population.collect(study(), 3, 5).parameters["column.K_tb"].tolist()
    )


def test_draws_have_their_distribution():
    """A uniform one has the standard deviation width / sqrt(12); a normal one a sixth of the width, cut at its ends."""
    factors = study().factors
    low, high = factors[1].low, factors[1].high
    of = {
        kind: np.array([population.draw_car(factors, 0, k, kind)[1] for k in range(2000)])
        for kind in ("uniform", "normal")
    }
    assert all(low <= x.min() and x.max() <= high for x in of.values())
    assert np.std(of["uniform"]) == pytest.approx((high - low) / math.sqrt(12.0), rel=0.04)
    cut = math.sqrt(1.0 - 6.0 * math.exp(-4.5) / math.sqrt(2.0 * math.pi) / 0.9973)
    assert np.std(of["normal"]) == pytest.approx(cut * (high - low) / 6.0, rel=0.05)


def test_a_row_is_the_drive_of_the_car_with_its_values():
    found = steer_env.population("compact", 1, {"column.K_tb": 0.1, "friction.sigma_0": (90.0, 110.0)}, "hold", seed=3)
    values = {name: float(column[0]) for name, column in found.parameters.items()}
    car = cars.load("compact", changes={"column.K_tb": values["column.K_tb"]})
    law = steer_env.friction.varied(car.friction, {"sigma_0": values["friction.sigma_0"]})
    driven = metrics.evaluate(manoeuvres.drive(car, manoeuvres.make("hold"), law), intervals=False)
    assert {f"hold.{name}" for name in driven} | {"phase_margin", "gain_margin"} == found.outputs.keys()
    for name, value in driven.items():
        assert found.outputs[f"hold.{name}"][0] == (pytest.approx(value.value, rel=1e-12, nan_ok=True))
    assert found.units["column.K_tb"] == "N m/rad"


def test_a_row_is_the_same_beside_whichever_others():
    """A car that is refused, and one alone, among them."""
    factors = {"column.K_tb": 0.1, "road_friction": (0.1, 1.0)}
    many = steer_env.population("compact", 6, factors, ("weave", "release"), "lugre")
    assert 0 < len(many.refused["weave.torque_at_0g"]) < 6
    posed = variation.near_nominal(study(factors, ("weave", "release")))
    rows = list(zip(*many.parameters.values()))
    for order in ([0, 1], [5, 3, 1, 0], [2, 4, 3]):
        found = population.evaluate(variation.Block(posed, tuple(rows[i] for i in order), "some"))
        for i, each in zip(order, found):
            for output, value in each.values.items():
                name = population.column(output)
                assert value == pytest.approx(many.outputs[name][i], rel=0.0, nan_ok=True)
                assert each.refused.get(output) == many.refused.get(name, {}).get(i)


def test_a_row_with_an_amplitude_is_the_drive_of_the_car_with_it():
    """Every car turns its handwheel by as much; a tenth of the samples is read, as in the tuning environments."""
    options = {"frequency": 0.25, "cycles": 5, "amplitude": 0.26}
    found = steer_env.population("compact", 2, {"load": (0.0, 75.0)}, {"weave": options}, "lugre")
    for row, load in enumerate(found.parameters["load"]):
        driven = manoeuvres.drive(cars.load().loaded(load), manoeuvres.make("weave", **options), "lugre")
        assert driven.meta["amplitude_rad"] == 0.26
        for name, value in metrics.evaluate(thin_out(driven, 10), intervals=False).items():
            assert found.outputs[f"weave.{name}"][row] == pytest.approx(value.value, rel=1e-12), name


def test_one_trace_at_a_time_is_in_memory(monkeypatch):
    """That of a car is freed before the next is driven, also where metrics are refused: 3 cycles are too few."""
    traces, before, evaluate = [], [], metrics.evaluate

    def evaluated(recording, **given):
        before.append(sum(trace() is not None for trace in traces))
        traces.append(weakref.ref(recording))
        return evaluate(recording, **given)

    monkeypatch.setattr(driving.metrics, "evaluate", evaluated)
    given = {"weave": {"frequency": 0.5, "cycles": 3, "amplitude": 0.2}, "hold": {}}
    gc.disable()
    try:
        found = steer_env.population("compact", 3, {"load": (0.0, 75.0)}, given)
    finally:
        gc.enable()
    assert found.refused
    assert before == [0] * 6
    assert not any(trace() for trace in traces)


def test_a_large_population_has_few_cases():
    """Each has a car, so that their number bounds the memory; every car is in one of them."""
    cases = []

    def sweep(function, blocks, **_):
        cases.extend(blocks)
        return [[Outputs({}, {}) for _ in block.rows] for block in blocks]

    assert population.collect(study(), 10_000, sweep=sweep).parameters["column.K_tb"].size == 10_000
    assert len(cases) <= population.BLOCKS
    assert {len(case.rows) for case in cases[:-1]} == {79}


def test_shares_and_intervals_are_those_of_closed_forms():
    """Clopper and Pearson's ends are powers of 0.025 where no car fails, or all do."""
    assert production.Share(20, 20).interval == pytest.approx((0.025 ** (1 / 20), 1.0))
    assert production.Share(0, 20).interval == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 20)))
    assert math.isnan(production.Share(0, 0).value)


def test_the_parameter_that_decides_is_named(faked):
    """Friction above 1.05 misses a band, below 0.8 a metric is refused; no car is in a third; others do nothing."""
    found = production.collect(study(), targets.load("compact"), "lugre", 400, seed=2)
    level = found.cars.parameters["friction_level"]
    assert (found.total.cars, found.held.cars) == (0, np.sum((level >= 0.8) & (level < 1.05)))
    rows = {row.name: row for row in found.judged}
    torque, lag = rows["torque_at_0g"], rows["yaw_lag"]
    assert (torque.below, torque.above, torque.refused) == (0, np.sum(level > 1.05), 0)
    assert (lag.refused, lag.share.cars, lag.reason) == (np.sum(level < 0.8), np.sum(level >= 0.8), "no crossing")
    for row, high in ((torque, True), (lag, False)):
        first, *others = row.drivers
        assert (first.name, first.distance, first.high, first.told) == ("friction_level", 1.0, high, True)
        assert not any(each.told for each in others)
    inner = found.narrowed["friction_level"]
    assert (inner.cars, inner.of) == tuple(np.sum((abs(level - 1.0) <= 0.15) & w) for w in (level < 1.05, level > 0.0))
    assert rows["angle_hysteresis"].drivers == ()
    _, data = production_page.build(found)
    assert len(json.loads(json.dumps(data, allow_nan=False))["cars"]["weave.torque_at_0g"]) == 400


def test_of_many_parameters_without_an_effect_none_is_told():
    """At 5 % each by itself, four of these hundred would be told from none."""
    rng = np.random.default_rng(0)
    values = {f"own_{k}": rng.random(200) for k in range(100)}
    found = production.drivers_of(values, rng.random(200) < 0.3)
    assert len(found) == 100
    assert not any(each.told for each in found)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["--parameters", "column.K_tb=-5%"],
            "the tolerance of column.K_tb must be finite and greater than 0 and at most 1, got -0.05",
        ),
        (["--parameters", "column.K_tb=5"], "of production takes NAME=P% or NAME=LOW:HIGH, got 'column.K_tb=5'"),
        (["--parameters", "load=0:900"], r"load \[kg\] must be finite and at least 0 and at most 500, got 900"),
        (["--parameters", "load=5%"], "load is 0, of which 0.05 is none"),
        (["--parameters", "load=75:0"], r"load must be \(low, high\) with low < high"),
        (["--parameters", "speed=20:30"], "has 'speed', which is the tests' own"),
        (
            ["--parameters", "chassis.mass=20:2000"],
            r"chassis.mass \[kg\] must be finite and at least 100 and at most 10000, got 20",
        ),
        (
            ["--parameters", "friction.F_c=0:1"],
            "friction.F_c=0 is not allowed: .*F_c must be finite and greater than 0",
        ),
        (["--span", "0.5"], "--span has no effect with --method production"),
        (["--manoeuvre", "pulse"], "targets 'compact' have no band for pulse: it has weave, "),
    ],
)
def test_bad_input(words, message, tmp_path, capsys):
    assert main(["sensitivity", "--method", "production", *words, "--out", str(tmp_path)]) == 2
    assert re.search(message, capsys.readouterr().err)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n": 0}, "n must be a whole number of at least 1, got 0"),
        ({"manoeuvre": "slalom"}, "manoeuvre must be one of .*weave.*, got 'slalom'"),
        ({"manoeuvre": ()}, "manoeuvre must be one or more of"),
        ({"manoeuvre": {"weave": {"size": 1}}}, "weave has no option 'size'; there are frequency, cycles, amplitude"),
        ({"manoeuvre": {"weave": {"amplitude": 0.0}}}, "amplitude must be finite and greater than 0, got 0.0"),
        ({"manoeuvre": {"weave": 0.2}}, "manoeuvre: the options of weave must be a mapping, got 0.2"),
        ({"ranges": {}}, "ranges must map one or more parameters"),
        ({"distribution": "beta"}, "distribution must be one of uniform, normal, got 'beta'"),
        ({"seed": -1}, "seed must be a whole number of at least 0, got -1"),
    ],
)
def test_bad_arguments(change, message):
    with pytest.raises(ValueError, match=message):
        steer_env.population(**{"car": "compact", "n": 2, "ranges": RANGES, **change})
