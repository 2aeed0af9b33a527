"""What the scripts of the page compute, against Python: channels, metrics, packed numbers, stability."""

import numpy as np
import pytest
from py_mini_racer import MiniRacer

from steer_env import friction, manoeuvres, metrics
from steer_env.experiments.explore import characteristics, drives, parameters, writing
from steer_env.friction.numerics.packing import numbers
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars, plant
from steer_env.vehicle.steering import stability
from tests.experiments.explore.cases import CHANGED, EACH, QUICK, driven, evaluated
from tests.experiments.explore.engine import engine

AMPLITUDE, CYCLES, THIN = 0.3, 2, 50
# As the worker of the page drives and reads a whole manoeuvre.
ANSWER = """{
  const m = drives.manoeuvres[name], numbers = simulation.packed(structure, values);
  const amplitude = whole(simulation.findAmplitude(car, numbers, m, 0.2));
  const own = ["lateral_speed", "longitudinal_speed"].filter((each) => structure.channels.includes(each));
  const channels = whole(simulation.drive(car, numbers, m.whole, amplitude, [...new Set([...m.channels, ...own])]));
  const held = new Float64Array(m.whole.samples).fill(values.speed_kph / 3.6);
  channels.vehicle_speed = channels.longitudinal_speed ?? held;
  const thin = ([name, all]) => [name, all.filter((_, i) => i % THIN === THIN - 1)];
  return { amplitude, channels: Object.fromEntries(Object.entries(channels).map(thin)),
           values: metrics.evaluate(readers[m.reader], channels, m.whole, m.metrics).values };
}""".replace("THIN", str(THIN))
# A manoeuvre with a law on a chassis; of every other law the channels of a weave are compared.
DRIVEN = [
    (name, *pair)
    for pair in QUICK
    for name in drives.SHOWN_MANOEUVRES
    if drives.made(name).speed or pair[1] == drives.made(name).chassis
]


@pytest.mark.parametrize(("law", "body"), EACH)
def test_channels_are_those_of_the_native_plant(law, body):
    p, weave = cars.load("compact").plant(law, robot=True, chassis=body), manoeuvres.make("weave")
    names = [name for name, _ in plant.channels(p)]
    u = driving.inputs(weave, AMPLITUDE, CYCLES / weave.frequency)
    native = driving.run(p, weave, u)
    drive = """whole(simulation.drive(car, Float64Array.from(structure.numbers), drives.manoeuvres.weave.whole,
      amplitude, names, samples))"""
    found = engine(law, body).value(drive, amplitude=AMPLITUDE, samples=len(u), names=names)
    assert np.ptp(native[:, plant.CHANNEL["handwheel_torque"]]) > 1.0
    for name, values in zip(names, native.T):
        assert np.abs(np.array(found[name]) - values).max() <= 1e-10 * np.ptp(values), name


@pytest.mark.parametrize("name", drives.SHOWN_MANOEUVRES)
@pytest.mark.parametrize("course", ["whole", "moving"])
def test_hands_move_as_those_of_python(name, course):
    made = drives.made(name, moving=course == "moving")
    found = engine(*QUICK[1]).value(f"simulation.motion(drives.manoeuvres['{name}'].{course})")
    u = driving.inputs(made, 1.0, made.duration)
    for key, column in (("angle", plant.HAND), ("speed", plant.HAND_SPEED)):
        np.testing.assert_allclose(found[key], u[:, column], rtol=0.0, atol=1e-12 * np.abs(u[:, column]).max())
    held = np.diff(u[:, plant.HAND]) == 0.0  # to the bit, where friction that jumps at rest is above the torsion bar
    assert not np.diff(found["angle"])[held].any()


@pytest.mark.parametrize(("name", "law", "body"), DRIVEN)
def test_manoeuvres_are_those_of_python(name, law, body):
    """The amplitude, every channel that is drawn, and every metric."""
    made, expected = engine(law, body), driven(law, body, {}, name)
    values = {q["name"]: q["value"] for q in made.structure["parameters"]}
    values |= {"speed_kph": 3.6 * drives.made(name).speed}
    found = made.value(ANSWER, values=values, name=name)
    assert found["amplitude"] == pytest.approx(expected.meta["amplitude_rad"], rel=1e-9)
    for channel, record in found["channels"].items():
        off = np.abs(np.array(record) - expected[channel][THIN - 1 :: THIN])
        assert off.max() <= 1e-9 * np.ptp(expected[channel]), channel
    require_equal(found["values"], metrics.evaluate(expected, intervals=False))


@pytest.mark.whole
@pytest.mark.parametrize("name", ["weave", "parking"])
def test_a_car_by_wire_is_that_of_python(name):
    """With another feel; the lock of the handwheel is that of the ratio of a standing car."""
    by_wire, values = ("lugre@steer_by_wire", "two_track"), {"steer_by_wire.feel_scale": 1.3}
    values |= {"speed_kph": 3.6 * drives.made(name).speed}
    made = engine(*by_wire, "compact_steer_by_wire")
    own = {q["name"]: q["value"] for q in made.structure["parameters"]}
    found, expected = made.value(ANSWER, values=own | values, name=name), driven(*by_wire, values, name, made.vehicle)
    assert found["amplitude"] == pytest.approx(expected.meta["amplitude_rad"], rel=1e-9)
    require_equal(found["values"], metrics.evaluate(expected, intervals=False))


@pytest.mark.parametrize(("law", "body"), QUICK)
def test_modules_import_nothing(law, body):
    assert engine(law, body).value("imports") == []


@pytest.mark.parametrize(
    "name",
    ["weave", *(pytest.param(name, marks=pytest.mark.whole) for name in drives.SHOWN_MANOEUVRES if name != "weave")],
)
def test_metrics_of_a_changed_car_are_those_of_python(name):
    made = drives.made(name)
    changed = CHANGED | {"speed_kph": CHANGED["speed_kph"] if made.speed else 0.0}
    require_equal(read("lugre", made.chassis, name, changed), evaluated("lugre", made.chassis, changed, name))


def read(law, body, name, changed):
    """Every metric of the page for a manoeuvre with changed values."""
    made = engine(law, body)
    values = {q["name"]: q["value"] for q in made.structure["parameters"]} | changed
    return made.value(ANSWER, values=values, name=name)["values"]


def require_equal(found, expected):
    """Every metric of the page is that of Python but for rounding, and refused where that is refused.

    A release begins between two samples, where the friction then stops the handwheel depends on the last digits, and
    its oscillation is fitted by a search of another kind. A step steer is read in windows whose ends the last digits
    may move by a sample, and settles where a curve that is nearly flat crosses a limit.
    """
    assert set(found) == set(expected) - set(drives.LEFT_OUT)
    for name in found:
        value = expected[name]
        shown = np.nan if found[name] is None else found[name]
        rel = {"release": 1e-4, "step-steer": 1e-6}.get(metrics.definition(name).tests[0], 1e-9)
        assert shown == pytest.approx(value.value, rel=rel, nan_ok=True), name


@pytest.mark.parametrize(("law", "body"), EACH)
def test_a_law_alone_is_that_of_python(law, body):
    """Its loop and its torque in steady sliding, with a factor on the friction."""
    made, p = engine(law, body), parameters.plant(cars.load("compact"), law, body, {"friction_scale": 1.3})
    found = made.value(
        "simulation.characteristics(car, Float64Array.from(packed), declared.characteristics)",
        packed=numbers(p).tolist(),
    )
    loop = friction.response(p.friction, *characteristics.loop(), 1.3)
    sliding = [friction.response(p.friction, *characteristics.slide(v), 1.3)[-1] for v in characteristics.SPEEDS]
    for name, expected in (("loop", loop), ("sliding", np.array(sliding))):
        assert np.ptp(loop) > 0.01
        np.testing.assert_allclose(found[name]["y"], expected, rtol=0.0, atol=1e-12 * np.ptp(loop))


@pytest.mark.parametrize(("law", "body"), QUICK)
def test_responses_to_sines_are_those_of_python(law, body):
    p = parameters.plant(cars.load("compact"), law, body, {})
    found = engine(law, body).value(
        "whole(simulation.responses(car, Float64Array.from(packed), declared.characteristics))",
        packed=numbers(p).tolist(),
    )
    amplitude, frequencies = characteristics.AMPLITUDE, characteristics.FREQUENCIES
    torque, _, yaw = np.array([driving.sine_response(p, amplitude, f) for f in frequencies]).T
    for name, expected in (("yaw_gain", abs(yaw)), ("yaw_phase", np.angle(yaw)), ("torque_gain", abs(torque))):
        np.testing.assert_allclose(found[name], expected, rtol=1e-8, err_msg=name)


@pytest.mark.parametrize(("law", "body"), EACH)
def test_packed_numbers_are_those_of_python(law, body):
    car, rng = cars.load("compact"), np.random.default_rng(1)
    for _ in range(3):
        values = {q.name: q.low + rng.random() * (q.high - q.low) for q in parameters.every(car, law, body)}
        found = engine(law, body).value("simulation.packed(structure, values)", values=values)
        expected = numbers(parameters.plant(car, law, body, values))
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("free", [False, True])
def test_an_unstable_assist_loop_is_told_in_the_words_of_python(free):
    """Over 200 cars that are drawn: which of them are unstable, and why."""
    car, rng, told = cars.load("compact"), np.random.default_rng(3), []
    fields = parameters.every(car, "lugre", "single_track")
    for _ in range(200):
        values = {q.name: q.low + rng.random() * (q.high - q.low) for q in fields}
        values["assist.handwheel_damping"] *= 8.0  # which is the cause in some of them with free hands
        p, speed = parameters.plant(car, "lugre", "single_track", values), values["speed_kph"] / 3.6
        told.append(stability.reason(p.column, p.assist, speed, free=free))
        reason = "stability.reason(structure.places, Float64Array.from(packed), speed, free)"
        found = engine("lugre", "single_track").value(reason, packed=numbers(p).tolist(), speed=speed, free=free)
        assert found == told[-1]
    assert 20 <= sum(map(bool, told)) <= 180


def test_a_text_is_the_number_that_it_is_for_python():
    context = MiniRacer()
    context.eval((writing.PAGE_FOLDER / "numbers.js").read_text(encoding="utf-8"))
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
