"""What the scripts of the page compute, against Python: channels, metrics, packed numbers, stability."""

import numpy as np
import pytest
from py_mini_racer import MiniRacer

from steer_env import manoeuvres
from steer_env.experiments.explore import parameters, writing
from steer_env.friction.numerics.packing import numbers
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars, plant
from steer_env.vehicle.steering import stability
from tests.experiments.explore.cases import CHANGED, EACH, QUICK, evaluated
from tests.experiments.explore.engine import engine

AMPLITUDE, CYCLES = 0.3, 2
# As the worker of the page drives and reads the whole weave.
ANSWER = """{
  const numbers = simulation.packed(structure, values);
  const amplitude = whole(simulation.findAmplitude(car, numbers, weave, 0.2));
  const channels = whole(simulation.drive(car, numbers, weave, amplitude, weave.cycles, weave.channels));
  return metrics.evaluate(channels, weave.frequency, weave.fewest, declared.metrics).values;
}"""


@pytest.mark.parametrize(("law", "body"), EACH)
def test_channels_are_those_of_the_native_plant(law, body):
    p, weave = cars.load("compact").plant(law, robot=True, chassis=body), manoeuvres.make("weave")
    names = [name for name, _ in plant.channels(p)]
    u = driving.inputs(weave, AMPLITUDE, CYCLES / weave.frequency)
    native = driving.run(p, weave, u)
    drive = "whole(simulation.drive(car, Float64Array.from(structure.numbers), weave, amplitude, cycles, names))"
    found = engine(law, body).value(drive, amplitude=AMPLITUDE, cycles=CYCLES, names=names)
    assert np.ptp(native[:, plant.CHANNEL["handwheel_torque"]]) > 1.0
    for name, values in zip(names, native.T):
        assert np.abs(np.array(found[name]) - values).max() <= 1e-10 * np.ptp(values), name


@pytest.mark.parametrize(("law", "body"), QUICK)
def test_modules_import_nothing(law, body):
    assert engine(law, body).value("imports") == []


@pytest.mark.parametrize(("law", "body"), EACH)
def test_metrics_are_those_of_python(law, body):
    require_equal(law, body, {})


def test_metrics_of_a_changed_car_are_those_of_python():
    require_equal("lugre", "single_track", CHANGED)


def require_equal(law, body, changed):
    """Every metric of the page is that of Python but for rounding, and refused where that is refused."""
    made = engine(law, body)
    values = {q["name"]: q["value"] for q in made.structure["parameters"]} | changed
    found, expected = made.value(ANSWER, values=values), evaluated(law, body, changed)
    assert set(found) == set(expected)
    for name, value in expected.items():
        shown = np.nan if found[name] is None else found[name]
        assert shown == pytest.approx(value.value, rel=1e-9, nan_ok=True), name


@pytest.mark.parametrize(("law", "body"), QUICK)
def test_packed_numbers_are_those_of_python(law, body):
    car, rng = cars.load("compact"), np.random.default_rng(1)
    for _ in range(3):
        values = {q.name: q.low + rng.random() * (q.high - q.low) for q in parameters.every(car, law, body)}
        found = engine(law, body).value("simulation.packed(structure, values)", values=values)
        expected = numbers(parameters.plant(car, law, body, values))
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


def test_an_unstable_assist_loop_is_told_in_the_words_of_python():
    """Over sets of values: which of them are unstable, and why."""
    car, rng, told = cars.load("compact"), np.random.default_rng(3), []
    fields = parameters.every(car, "lugre", "single_track")
    for _ in range(40):
        values = {q.name: q.low + rng.random() * (q.high - q.low) for q in fields}
        p, speed = parameters.plant(car, "lugre", "single_track", values), values["speed_kph"] / 3.6
        told.append(stability.reason(p.column, p.assist, speed, free=False))
        reason = "stability.reason(structure.places, Float64Array.from(packed), speed)"
        found = engine("lugre", "single_track").value(reason, packed=numbers(p).tolist(), speed=speed)
        assert found == told[-1]
    assert 4 <= sum(map(bool, told)) <= 36


def test_a_text_is_the_number_that_it_is_for_python():
    context = MiniRacer()
    context.eval((writing.PAGE / "numbers.js").read_text(encoding="utf-8"))
    texts = (
        "1",
        " 5 ",
        "+.5",
        "5.",
        "-1e-3",
        "1E5",
        "1_000",
        "1__0",
        "_1",
        "1e400",
        "-inf",
        "Infinity",
        "NaN",
        "",
        " ",
    )
    for text in (*texts, "0x10", "0b1", "5,5", "1e", ".", "1 2", "--1", "much", "\u22121", "1n", "1\n"):
        try:
            expected = float(text)
        except ValueError:
            expected = np.nan
        assert context.eval(f"steerNumbers.read({text!r})") == pytest.approx(expected, nan_ok=True, rel=0), text
    assert [context.eval(f"steerNumbers.typed({text!r})") for text in ("1,5", "\u22122.5")] == [1.5, -2.5]
