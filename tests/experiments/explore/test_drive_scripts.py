"""The scripts of the driving page without a page, against the native drive: exchange, hands, recording, blind test."""

import numpy as np
import pytest

from steer_env.experiments.explore import drive_page, parameters
from steer_env.friction.numerics.packing import numbers
from steer_env.live.drive.hands import WANTED_LAG
from steer_env.live.drive.log import Log, new_file, recorded_columns
from steer_env.live.real_time import CarConfiguration, CarConfigurations
from steer_env.live.real_time.model import make_model, step
from steer_env.live.real_time.recorder import RECORD_HEAD, Recorder
from steer_env.recording import driven, read
from steer_env.vehicle import cars, plant, subsystems
from tests.experiments.explore.cases import QUICK
from tests.experiments.explore.engine import engine

SWITCHED, LENGTH = 700, 1500  # samples
CHANGED = {"friction_scale": 2.0, "column.K_tb": 150.0}
DRIVE = """{
  const fresh = (key, place) => {
    const at = `${key} ${place}`;
    if (!cars.has(at)) cars.set(at, new simulation.Car(structure, modules[0], begun, shared));
    return cars.get(at);
  };
  const cars = new Map(), exchange = new exchanging.Exchange(fresh);
  both.forEach((values, k) => {
    const numbers = simulation.packed(structure, values), one = fresh("", 2);
    one.begin(numbers);
    exchange.configurations[k] = { label: "", key: "", numbers, start: one.state.slice(), shown: one.outputs.slice() };
  });
  exchange.begin(0);
  return angles.map(([angle, speed], k) => {
    if (k === switched) exchange.choose(1);
    exchange.sample({ torque: 0, angle, speed, others: [] });
    return [...exchange.shown, exchange.acting, exchange.share];
  });
}"""


@pytest.mark.parametrize(("law", "body"), QUICK)
def test_another_car_takes_over_as_in_the_native_drive(law, body):
    car, made = cars.load("compact"), engine(law, body)
    both = [{q["name"]: q["value"] for q in made.structure["parameters"]} | each for each in ({}, CHANGED)]
    t = 1e-3 * np.arange(1, LENGTH + 1)
    angles = np.column_stack([0.3 * np.sin(3.0 * t) * np.minimum(t, 1.0), np.zeros(LENGTH)])
    angles[:, 1] = np.gradient(angles[:, 0], 1e-3)
    configurations = CarConfigurations(
        [
            CarConfiguration(str(k), subsystems.make("car", parameters.plant(car, law, body, values), 100.0 / 3.6))
            for k, values in enumerate(both)
        ]
    )
    model, native = make_model(configurations), []
    for k, (angle, speed) in enumerate(angles):
        if k == SWITCHED:
            configurations.choose(1)
        model.given[1:3] = angle, speed
        assert step(model, 1)
        native.append([*model.outputs[0], model.now[0], model.now[2]])
    found = made.value(DRIVE, both=both, angles=angles.tolist(), switched=SWITCHED)
    assert native[-1][-2] == 1.0
    for name, a, b in zip([*plant.CHANNEL, "acting", "share"], np.array(found).T, np.array(native).T):
        assert np.abs(a - b).max() <= 1e-9 * max(np.ptp(b), 1e-6), name


def test_a_wheel_that_is_let_go_has_no_hand_torque_and_returns():
    drive = DRIVE.replace("if (k === switched) exchange.choose(1);", "exchange.grip(k < 500);")
    angles = [[0.3 * min(k / 400, 1.0), 0.3 / 0.4 if k < 400 else 0.0] for k in range(1, 1001)]
    rows = np.array(
        engine("lugre", "single_track").value(drive, both=[base()], angles=angles, switched=0),
    )
    torque, angle = (rows[:, plant.CHANNEL[name]] for name in ("handwheel_torque", "handwheel_angle"))
    assert np.abs(torque[400:499]).min() > 0.5
    assert np.abs(torque[505:]).max() < 1e-9
    assert abs(angle[-1]) < 0.5 * angle[499]  # it has returned towards the middle


def base():
    return {q["name"]: q["value"] for q in engine("lugre", "single_track").structure["parameters"]}


HANDS = """{
  const hands = new handing.Hands();
  return held.map((each) => {
    hands.take({ ...hands.held, ...each });
    if (each.grip !== undefined) hands.grip(each.grip, 0);
    if (each.drag) hands.drag(each.drag);
    hands.step();
    return [hands.wanted, hands.angle, hands.speed];
  });
}"""


def hands(held):
    return np.array(engine("lugre", "single_track").value(HANDS, held=held)).T


def test_keys_turn_the_wheel_at_the_rates_of_the_native_keyboard():
    wanted, angle, speed = hands([{"left": True}] * 1000 + [{"left": False}] * 1500)
    assert np.degrees(wanted[999]) == pytest.approx(60.0)
    assert np.degrees(wanted[1249]) == pytest.approx(30.0)
    assert wanted[-1] == 0.0
    assert np.degrees(speed[900]) == pytest.approx(60.0, rel=1e-3)
    delay = np.degrees(wanted[900] - angle[900]) / 60.0
    assert delay == pytest.approx(WANTED_LAG, abs=1e-3)
    np.testing.assert_allclose(np.cumsum(speed) * 1e-3, angle, atol=2e-3)


def test_pad_and_wheel_have_range_dead_zone_and_inversion():
    pad = {"device": "gamepad", "range": 180.0, "deadZone": 0.1}
    assert np.degrees(hands([pad | {"axis": -1.0}] * 2000)[0, -1]) == pytest.approx(180.0)
    assert np.degrees(hands([pad | {"axis": 1.0, "invert": True}] * 2000)[0, -1]) == pytest.approx(180.0)
    assert hands([pad | {"axis": 0.09}] * 100)[0, -1] == 0.0
    assert np.degrees(hands([pad | {"axis": -0.55}] * 2000)[0, -1]) == pytest.approx(180.0 * 0.5**2)
    wheel = {"device": "wheel", "range": 900.0, "deadZone": 0.0}
    assert np.degrees(hands([wheel, wheel | {"axis": -0.2}])[0, -1]) == pytest.approx(90.0, abs=0.1)


def test_a_wheel_that_is_gripped_again_goes_smoothly_to_its_own_angle():
    wheel = {"device": "wheel", "range": 900.0, "deadZone": 0.0, "axis": -0.2}
    wanted, angle, speed = hands([wheel | {"grip": 0.4}, *[wheel] * 4000])
    assert angle[0] == pytest.approx(0.4, abs=1e-3)
    assert np.abs(speed).max() <= 0.5 + 1e-9  # the native rate at which straight ahead moves
    assert np.degrees(wanted[-1]) == pytest.approx(90.0)


def test_a_recording_is_that_of_the_native_log(tmp_path):
    car = cars.load("compact")
    made = subsystems.make("car", parameters.plant(car, "lugre", "two_track", {}), 100.0 / 3.6)
    configurations = CarConfigurations([CarConfiguration("one", made)])
    recorder = Recorder(configurations.subsystem, 1.0)
    columns = recorded_columns(configurations.subsystem, recorder)
    samples = np.random.default_rng(5).normal(size=(203, len(recorder.columns)))
    samples[:, list(RECORD_HEAD).index("set")] = 0.0
    path, file = new_file(tmp_path, columns, {"manoeuvre": "weave", "speed_m_s": 27.5, "sets": [{"label": "a"}]})
    log = Log(columns, file)
    log.add(samples, 0)
    log.close()
    names = [column.name for column in columns]
    engine_ = engine("lugre", "single_track")
    assert engine_.value("logging.names") == names
    rows = samples[:, [column.place for column in columns]]
    rows[:, names.index("chosen_set")] += 1.0
    write = "{ const log = new logging.Log(); log.add(Float64Array.from(rows)); return log.text(meta, false); }"
    meta = {"manoeuvre": "weave", "speed_m_s": 27.5, "sets": [{"label": "a"}]}
    (tmp_path / "page.csv").write_text(engine_.value(write, rows=rows.ravel().tolist(), meta=meta))
    found, native = read(tmp_path / "page.csv"), read(path)
    assert {key: found.meta[key] for key in meta} == meta
    assert list(found.channels) == list(native.channels)
    np.testing.assert_array_equal(found.time, native.time)
    for name in native.channels:
        np.testing.assert_allclose(found[name], native[name], rtol=2e-7, atol=1e-12, err_msg=name)


OBSERVED = """observers.map(({ threshold, slope, seed }) => {
  let state = seed;
  const random = () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 4294967296;
  };
  const stairs = new staircases.Staircase();
  while (!stairs.over()) {
    stairs.answer(random() < 1 - 0.5 * 2 ** -((stairs.level / threshold) ** slope));
  }
  return { ...stairs.threshold(), trials: stairs.answers.length };
})"""


def test_the_interval_of_a_threshold_covers_as_often_as_it_says():
    """Simulated observers whose thresholds and slopes are spread as widely as those that the test thinks of."""
    rng = np.random.default_rng(11)
    observers = [
        {"threshold": t, "slope": s, "seed": int(seed)}
        for t, s, seed in zip(
            np.geomspace(0.01, 0.8, 600), rng.choice([1.0, 2.0, 3.5], 600), rng.integers(0, 2**32, 600)
        )
    ]
    found = engine("lugre", "single_track").value(OBSERVED, observers=observers)
    inside = [each["low"] <= observer["threshold"] <= each["high"] for observer, each in zip(observers, found)]
    confidence = drive_page.BLIND["confidence"]
    assert abs(np.mean(inside) - confidence) <= 3.0 * np.sqrt(confidence * (1.0 - confidence) / len(inside)) + 0.01
    off = np.log([each["middle"] / observer["threshold"] for observer, each in zip(observers, found)])
    assert abs(np.median(off)) < 0.1
    assert np.median([each["high"] / each["low"] for each in found]) < 5.0
    assert max(each["trials"] for each in found) <= drive_page.BLIND["trials"]


def test_packed_numbers_say_whether_hands_hold_the_wheel():
    car = cars.load("compact")
    p = parameters.plant(car, "masing", "two_track", {})
    at, end = engine("masing", "two_track").structure["drive"]["fields"]["robot"]
    held, free = numbers(p), numbers(p._replace(robot=0.0))
    assert end == at + 1
    assert np.flatnonzero(held != free).tolist() == [at]


PACED = """{
  let clock = 0, next = null;
  globalThis.performance = { now: () => clock, timeOrigin: 0 };
  globalThis.clearTimeout = () => {};
  globalThis.setTimeout = (work) => { next = work; };
  const told = [], scope = { postMessage: (data) => told.push(data) };
  steerPace(scope, declared.drive, simulation, exchanging, handing, policies);
  const send = (data) => scope.onmessage({ data });
  const module = { structure, wasm: Uint8Array.from(wasm), beginning: Uint8Array.from(beginning), tables: shared };
  const values = Object.fromEntries(structure.parameters.map((q) => [q.name, q.value]));
  send({ module });
  send({ configuration: { index: 0, label: "", key: `${structure.law} ${structure.chassis}`, values } });
  send({ begin: { index: 0, speed: 100 / 3.6 } });
  send({ go: true });
  turns.forEach((turn, k) => {
    clock += turn;
    if (k === goes) send({ go: true });
    else next();
  });
  return told.map(({ stands, samples, largest }) =>
    ({ stands, largest, missed: samples && Array.from(samples).filter((_, k) => k % logging.width === 0) }));
}"""


def test_a_drive_does_every_sample_that_is_due_and_stands_where_it_comes_too_late():
    """Turns of a clock of our own [ms]: two in time, one late, one too late, and one on which the drive goes on."""
    late, halt = driven.STOOD * 1e3 - 1.0, driven.STOOD * 1e3 + 1.0
    told = engine("lugre", "single_track").value(PACED, turns=[4.0, 4.5, late, halt, 300.0, 4.0], goes=4)
    assert [len(each.get("missed") or []) for each in told] == [4, 4, 99, 0, 4]
    assert [each.get("stands") for each in told] == [None, None, None, "slow", None]
    assert told[2]["largest"] == pytest.approx(late + 0.5)
    assert told[-1]["missed"] == [300.0, 0.0, 0.0, 0.0]
