"""Records of friction: one record in every unit, the sign is found, faults are told, a car's column is separated."""

from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest

from steer_env import friction, manoeuvres
from steer_env.friction.identification import periods
from steer_env.recording import Recording, column_balance, files, friction_checks, friction_record
from steer_env.recording.channel_mapping import FRICTION, Mapping, from_data, parse_entry
from steer_env.vehicle import cars
from tests.friction.test_bad_input import refused

DT = 0.01  # [s]
T = np.arange(0.0, 60.0, DT)
X = 0.05 * np.sin(2.0 * np.pi * 0.1 * T)  # [rad]
DAHL = friction.make("dahl", sigma_0=150.0, F_c=0.9)
F = friction.response(DAHL, X, DT)  # [N m]
NOISE = np.random.default_rng(1).normal(0.0, 0.01, T.size)  # [N m]


def rig(x=X, torque=F, units=("rad", "N m"), time=T, **more):
    names = {"displacement": (x, units[0]), "friction": (torque, units[1]), **more}
    return Recording(time, {k: v for k, (v, _) in names.items()}, {k: unit for k, (_, unit) in names.items()})


def read(text, tmp_path, mapping=None, name="record.csv"):
    (tmp_path / name).write_text(text)
    return friction_record.from_recording(files.read(tmp_path / name, mapping))


def table(header, *columns):
    return header + "\n" + "\n".join(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())


FORMS = [
    ("time_s,displacement_deg,friction_Nm", 1.0, np.degrees(X), F),
    ("time [ms],column angle [rad],torque [mNm]", 1e3, X, 1e3 * F),
    ("t [s],Drehwinkel [mrad],Reibmoment [Ncm]", 1.0, 1e3 * X, 1e2 * F),
]
TRAVELS = [
    ("time_s,displacement_mm,friction force_N", 1.0, 1e3 * X, F),
    ("time [s],Weg [um],Kraft [mN]", 1.0, 1e6 * X, 1e3 * F),
    ("time [s],position (m),force (kN)", 1.0, X, 1e-3 * F),
]


@pytest.mark.parametrize(("header", "ticks", "x", "torque"), [*FORMS, *TRAVELS], ids=lambda each: str(each)[:40])
def test_every_unit_gives_the_same_record(header, ticks, x, torque, tmp_path):
    record = read(table(header, ticks * T, x, torque), tmp_path)
    assert tuple(record.units.values()) == (("rad", "N m") if "m]" in header[-4:] or "_Nm" in header else ("m", "N"))
    np.testing.assert_allclose(record.x, X, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(record.friction, F, rtol=0.0, atol=1e-14)
    assert record.dt == pytest.approx(DT)


def test_speed_in_place_of_the_displacement():
    speed = np.gradient(X, DT)
    recording = Recording(
        T, {"displacement_speed": speed, "friction": F}, {"displacement_speed": "rad/s", "friction": "N m"}
    )
    record = friction_record.from_recording(recording)
    np.testing.assert_allclose(record.x, X, atol=2e-5)
    assert "integral of 'displacement_speed'" in record.notes[-1]


@pytest.mark.parametrize("law", friction.available())
def test_the_sign_is_found_for_every_law(law):
    torque = friction.response(law, X, DT) + 0.2
    for sign in (1.0, -1.0):
        assert friction_checks.sign(X, sign * torque) == sign
    record = friction_record.from_recording(rig(torque=-torque))
    np.testing.assert_array_equal(record.friction, torque)
    assert "other sign" in record.notes[-1]


STROKE = np.where(T < 30.0, 0.002 * T, 0.002 * (60.0 - T))  # [rad]


@pytest.mark.parametrize(
    ("law", "x"), list(zip(friction.available(), cycle([X, STROKE, np.maximum(0.002 * (T - 2.0), 0.0)])))
)
def test_noise_neither_hides_the_sign_nor_makes_a_fault(law, x):
    """0.02 deg, many times the way from one sample to the next, and 0.02 N m."""
    torque = friction.response(law, x, DT) - 0.3 + 2.0 * NOISE
    noisy = x + np.radians(np.random.default_rng(3).normal(0.0, 0.02, T.size))
    record = friction_record.from_recording(rig(noisy, -torque))
    np.testing.assert_array_equal(record.friction, torque)
    assert len(record.notes) == 1  # of the sign


def test_the_sign_of_one_way_motion_is_found():
    x = np.maximum(np.linspace(-0.02, 0.06, 4000), 0.0)
    assert friction_checks.sign(x, 0.3 - friction.response(DAHL, x, DT)) == -1.0


def test_a_sign_that_is_given_stands():
    record = friction_record.from_recording(rig(torque=-F), sign=-1)
    np.testing.assert_array_equal(record.friction, F)
    with refused(["exchanged"]):  # turned the wrong way, the branches become steeper
        friction_record.from_recording(rig(x=F, torque=X, units=("m", "N")), sign=-1)


REFUSED = [
    (rig(torque=20.0 * X), ["takes no work", "--sign"]),
    (rig(x=F, torque=X, units=("rad", "N m")), ["exchanged", "--map displacement="]),
    (rig(x=np.full(T.size, 0.3)), ["displacement does not vary"]),
    (Recording(T, {"friction": F}, {"friction": "N m"}), ["displacement [rad or m]", "'friction' [N m]", "--map"]),
    (rig(time=np.where(T < 30.0, T, T + 0.5)), ["rows are missing", "0.5 s", "between"]),
    (rig(time=T + 0.006 * (np.arange(T.size) % 2)), ["not uniform", "resample"]),
]


@pytest.mark.parametrize(("recording", "contains"), REFUSED, ids=lambda each: str(each)[:30])
def test_what_is_no_record_is_refused_with_the_remedy(recording, contains):
    with refused(contains):
        friction_record.from_recording(recording)


def test_units_that_only_a_lever_joins():
    record = friction_record.from_recording(rig(torque=F / 0.008, units=("rad", "N")))
    with refused(["in rad", "in N", "--lever"]):
        friction_record.check_units(record)
    found = record.with_lever(0.008)
    assert found.of_a_column
    np.testing.assert_allclose(found.friction, F, rtol=1e-15)
    rack = friction_record.from_recording(rig(x=0.008 * X, torque=F / 0.008, units=("m", "N"))).with_lever(0.008)
    np.testing.assert_allclose([rack.x, rack.friction], [X, F], rtol=1e-15)


def test_a_stretched_record_has_the_scales_that_are_asked_for():
    given = friction_record.from_recording(rig(x=3e-3 * X, torque=40.0 * F, units=("m", "N")))
    found = given.to_column(1.2, 0.01)
    assert found.of_a_column
    assert friction_checks.scales(found.x, found.friction) == pytest.approx((1.2, 0.01))
    assert found.dt == given.dt
    own = friction_checks.scales(X, F)  # of Dahl, whose branch after a reversal is 1 - 2 exp(-x/x_c)
    assert own == pytest.approx((0.9, 0.9 / 150.0), rel=0.02)


def test_the_torque_of_an_inertia_is_subtracted():
    acceleration = -((2.0 * np.pi * 0.1) ** 2) * X
    for sign in (1.0, -1.0):
        recording = rig(torque=sign * (F + 20.0 * acceleration))
        record = friction_record.from_recording(recording, inertia=20.0)
        inside = slice(50, -50)  # the low-pass begins and ends
        np.testing.assert_allclose(record.friction[inside], F[inside], atol=2e-3)
    assert "20 kg m2 is subtracted" in record.notes[0]


def test_a_sensor_at_its_end_and_a_drifting_zero_are_told():
    noisy = F + NOISE
    assert friction_record.from_recording(rig(torque=noisy)).notes == ()
    ends = friction_record.from_recording(rig(torque=np.clip(noisy, -0.85, 0.85)))
    assert "largest value, 0.85" in ends.notes[0]
    moved = friction_record.from_recording(rig(torque=noisy + 0.003 * T))
    assert "drifts by 20" in moved.notes[0]
    still = friction_record.from_recording(rig(torque=noisy + 0.003 * T), without_drift=True)
    assert np.polyfit(T, still.friction - noisy, 1)[0] == pytest.approx(0.0, abs=2e-4)


@pytest.mark.parametrize(
    ("x", "torque", "told"),
    [
        (X, F, []),
        (1e3 * X, F, ["half the travel is 50 rad", "unit of the displacement"]),
        (1e-4 * X, F, ["half the travel is 5e-06 rad"]),
        (X, 1e3 * F, ["the mean friction is", "unit of the friction"]),
        (X, 1e-4 * F, ["the mean friction is"]),
    ],
)
def test_a_unit_that_is_wrong_by_a_thousand_is_told(x, torque, told):
    notes = [note for note in friction_record.from_recording(rig(x, torque)).notes if "contacts of steerings" in note]
    assert len(notes) == (1 if told else 0)
    assert all(part in notes[0] for part in told)


def test_the_period_and_what_repeats():
    assert periods.period(X) == 1000
    assert periods.repeatability(X, F + NOISE, 2000) == pytest.approx(0.01 * np.sqrt(2.0), rel=0.05)
    assert periods.period(X[:1500]) is None


def test_mappings_name_the_channels_of_a_record(tmp_path):
    text = table("time_s,a,b", T, np.degrees(X), -F)
    entries = [parse_entry("displacement=a[deg]"), parse_entry("friction=b[Nm],sign=-1")]
    record = read(text, tmp_path, Mapping().with_entries(entries))
    np.testing.assert_allclose(record.friction, F, rtol=1e-12)
    for name, units in FRICTION.items():
        with refused([f"channels.{name}.unit", *map(repr, units)]):
            from_data({"channels": {name: {"unit": "A"}}})


@pytest.fixture(scope="module")
def weave():
    return manoeuvres.drive(cars.load(), manoeuvres.make("weave"), "masing")


@pytest.mark.parametrize("without", [(), ("torsion_bar_torque", "column_angle")])
def test_the_friction_of_a_column_is_separated_from_the_rest(weave, without):
    """Assist and rack force are 5 N m and more; what remains is the friction within 1 % of its level."""
    record = column_balance.separated(weave.without("friction_torque", *without), cars.load())
    error = record.friction - weave["friction_torque"]
    assert np.sqrt(np.mean(error**2)) < 0.01
    assert np.ptp(weave["motor_torque"]) > 5.0
    np.testing.assert_array_equal(record.load, np.abs(weave["rack_force"]))
    np.testing.assert_allclose(record.x, weave["column_angle"], atol=1e-4)


@pytest.mark.parametrize(
    ("without", "share", "told"), [("handwheel_torque", 0.0, False), ("torsion_bar_torque", 1.0, True)]
)
def test_friction_above_the_bar_is_in_the_torque_of_the_hands(weave, without, share, told):
    """It is in the friction where the bar's torque was not recorded, and a note tells that."""
    above = friction.response("coulomb,F_c=0.3", weave["handwheel_angle"], 1e-3)  # of a led handwheel, (F43)
    channels = {**weave.channels, "handwheel_torque": weave["handwheel_torque"] + above}
    record = column_balance.separated(
        replace(weave, channels=channels).without("friction_torque", without), cars.load()
    )
    error = record.friction - weave["friction_torque"] - share * above
    assert np.sqrt(np.mean(error**2)) < 0.01
    assert any("friction above the bar cannot be told from friction below it" in note for note in record.notes) == told


def test_what_a_car_has_to_measure_is_told(weave):
    car = cars.load()
    for name, contains in {
        "rack_force": ["rack_force [N] is missing", "tie rods", "--zero rack_force"],
        "motor_torque": ["motor_torque at the column [N m] is missing", "--zero motor_torque"],
    }.items():
        with refused(contains):
            column_balance.separated(weave.without(name), car)
    with refused(["torsion_bar_torque", "handwheel_torque with handwheel_angle"]):
        column_balance.separated(weave.without("torsion_bar_torque", "handwheel_torque"), car)
    with refused(["motor_torque and rack_force", "'yaw_rate'"]):
        column_balance.separated(weave, car, zero=["yaw_rate"])
    with refused(["give --vehicle NAME", "separated"]):
        friction_record.from_recording(weave.without("friction_torque"))


ERRORS = {
    "none": (0.0, 1.0, 0.002, 0.005),
    "angle in steps, noise": (0.1, 1.0, 0.02, 0.2),
    "motor 5 % too large": (0.1, 1.05, 0.06, 0.4),
}


@pytest.mark.parametrize(("step", "motor", "level", "stiffness"), ERRORS.values(), ids=ERRORS)
def test_the_level_survives_the_errors_of_a_car(step, motor, level, stiffness):
    """The table of docs/friction_measurement.md: errors of F_c and sigma_0 by those of the channels."""
    car, true = cars.load("compact", changes={"steering.friction_load": 0.0}), friction.make("dahl", sigma_0=120.0)
    run = manoeuvres.drive(car, manoeuvres.make("weave"), true).resampled(100.0).without("column_angle")
    noise = np.random.default_rng(0)
    channels = dict(run.channels)
    if step:
        for name, size in {"torsion_bar_torque": 0.02, "motor_torque": 0.1, "rack_force": 20.0}.items():
            channels[name] = channels[name] + noise.normal(0.0, size, run.time.size)
        channels["handwheel_angle"] = np.radians(step * np.round(np.degrees(channels["handwheel_angle"]) / step))
    channels["motor_torque"] = motor * channels["motor_torque"]
    record = column_balance.separated(replace(run, channels=channels), car)
    found = friction.fit(record.x, record.friction, "dahl", dt=record.dt).parameters
    assert found.F_c == pytest.approx(true.F_c, rel=level)
    assert found.sigma_0 == pytest.approx(true.sigma_0, rel=stiffness)
