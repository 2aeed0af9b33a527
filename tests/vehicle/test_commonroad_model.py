"""CommonRoad's model as an oracle: its signs in ours, closed forms, what is odd, and the stored reference."""

import copy
import zipfile

import numpy as np
import pytest
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from tests.verification.common import commonroad_model as commonroad
from tests.verification.common import commonroad_reference
from tests.verification.common.commonroad_manoeuvres import BRAKE_TIME, MANOEUVRES, Manoeuvre
from tests.verification.common.commonroad_model import CODE, QUIRKS, drive, reconciled
from tests.verification.common.cross_validation import difference, drive_two_track

P = setup_vehicle_parameters(vehicle_id=2)
STEP = MANOEUVRES["step_20"]._replace(duration=4.0)


@pytest.fixture(scope="module")
def turn():
    return drive(P, STEP)


def members(path):
    """The files in an archive; what the archive says of itself depends on the version of Python."""
    with zipfile.ZipFile(path) as file:
        return [(name, file.read(name)) for name in file.namelist()]


def last(run, name):
    return run[name][-1]


def test_a_left_turn_in_our_signs(turn):
    assert last(turn, "yaw_rate") > 0.1
    assert last(turn, "lateral_acceleration") == pytest.approx(4.0, abs=0.02)
    assert last(turn, "roll_angle") == pytest.approx(0.064, abs=0.002)  # to the right
    for axle in ("front", "rear"):
        assert last(turn, f"wheel_load_{axle}_right") > 1.9 * last(turn, f"wheel_load_{axle}_left")
        assert last(turn, f"wheel_speed_{axle}_right") > last(turn, f"wheel_speed_{axle}_left")
    assert last(turn, "y") > 1.0
    assert last(turn, "yaw_angle") > 0.4
    loads = sum(last(turn, name) for name in turn.channels if name.startswith("wheel_load"))
    assert loads == pytest.approx(9.81 * P.m, rel=1e-3)


def test_channels_agree_with_each_other(turn):
    t, v_x, v_y, yaw = turn.time, turn["speed"], turn["lateral_speed"], turn["yaw_angle"]
    inner = slice(2, -2)
    np.testing.assert_allclose(np.gradient(yaw, t)[inner], turn["yaw_rate"][inner], atol=2e-4)
    across = v_x * np.sin(yaw) + v_y * np.cos(yaw)
    np.testing.assert_allclose(np.gradient(turn["y"], t)[inner], across[inner], atol=1e-3)
    body = np.gradient(v_y, t) + v_x * turn["yaw_rate"]
    np.testing.assert_allclose(body[inner], turn["sprung_lateral_acceleration"][inner], atol=0.05)
    assert last(turn, "sprung_lateral_acceleration") == pytest.approx(last(turn, "lateral_acceleration"), rel=1e-3)


def test_a_right_turn_mirrors_a_left_one_without_what_tells_them_apart():
    p = reconciled(P)
    left, right = drive(p, STEP), drive(p, STEP._replace(amplitude=-STEP.amplitude))
    for name in ("yaw_rate", "lateral_acceleration", "roll_angle", "y"):
        np.testing.assert_allclose(right[name], -left[name], atol=1e-5 * abs(left[name]).max())
    np.testing.assert_allclose(right["wheel_load_front_left"], left["wheel_load_front_right"], rtol=1e-5)


def test_braking_dives_and_slows():
    brake = MANOEUVRES["brake_20"]
    run = drive(P, brake)
    assert last(run, "pitch_angle") > 0.01  # nose down
    before = run.time < BRAKE_TIME
    assert np.abs(run["speed"][before] - 20.0).max() < 0.15
    assert last(run, "acceleration_command") == -brake.braking
    # the wheels' inertia, 4 I_y_w/R_w^2, has its share of the torque
    a = np.mean(run["longitudinal_acceleration"][run.time > 8.0])
    assert a == pytest.approx(-brake.braking * P.m / (P.m + 4.0 * P.I_y_w / P.R_w**2), rel=0.02)


@pytest.mark.parametrize(
    ("name", "reached"), [("step_20", 4.0), ("step_30", 4.0), ("sine_20", 4.0), ("sine_30", 4.0), ("circle_30", 6.0)]
)
def test_manoeuvres_reach_what_they_are_for(name, reached):
    run = drive(P, MANOEUVRES[name], dt=0.02, tolerance=1e-6)
    a = run["lateral_acceleration"]
    peak = 0.5 * np.ptp(a[run.time > 5.0]) if name.startswith("sine") else a[-1]
    assert peak == pytest.approx(reached, rel=0.01)


def without_camber(p):
    p = copy.deepcopy(p)
    p.tire.p_hy3 = p.tire.p_vy3 = p.tire.p_dy3 = p.tire.r_vy3 = 0.0
    return p


@pytest.mark.parametrize("own_centres", [True, False])
@pytest.mark.parametrize("speed", [20.0, 30.0])
def test_small_steady_circle_is_the_linear_single_track(own_centres, speed):
    """r = v delta/(L + K v^2) with K = (F_yf/C_f - F_yr/C_r)/a_y, where C = |p_ky1| F_z of the axle's static load.

    Balanced about the whole car's centre of gravity the forces are in proportion to the loads, so the car is neutral;
    they balance yaw about the sprung one, where F_yf/F_yr = b/a.
    """
    p, angle = without_camber(reconciled(P)), 1e-3
    run = drive(p, Manoeuvre("step", speed, angle, 8.0), ["centres"] if own_centres else [], dt=0.02)
    L = p.a + p.b
    C_f, C_r = (abs(p.tire.p_ky1) * 9.81 * load for load in (p.m_s * p.b / L + p.m_uf, p.m_s * p.a / L + p.m_ur))
    ahead = (p.m_uf * p.a - p.m_ur * p.b) / p.m if own_centres else 0.0
    K = p.m * ((p.b + ahead) / C_f - (p.a - ahead) / C_r) / L
    assert (abs(K) < 1e-9) == own_centres
    expected = speed * angle / (L + K * speed**2)
    assert last(run, "yaw_rate") == pytest.approx(expected, rel=2e-3)


def test_quirks_one_by_one_and_the_parameters_are_left_alone():
    before = copy.deepcopy(P)
    assert reconciled(P, []) == P
    for quirk in QUIRKS:
        assert reconciled(P, [quirk]) != P
    p = reconciled(P)
    assert p.tire.p_hy1 == p.K_lt == 0.0
    assert before == P
    with pytest.raises(KeyError):
        reconciled(P, ["wings"])


def test_slip_of_the_axles_matters_while_the_body_rolls_only():
    """Steady values stay; under a sine the lateral acceleration differs by m_s h roll''/m, 6 % of its peak."""
    p, sine = reconciled(P), MANOEUVRES["sine_20"]
    plain, own = drive(p, sine), drive(p, sine, ["axle slip"])
    assert 0.05 < difference(own, plain, "lateral_acceleration") < 0.08
    assert difference(own, plain, "yaw_rate") < 0.005
    plain, own = drive(p, STEP), drive(p, STEP, ["axle slip"])
    assert last(own, "yaw_rate") == pytest.approx(last(plain, "yaw_rate"), rel=1e-3)


def test_integration_is_tight_enough():
    loose, tight = drive(P, STEP, tolerance=1e-7), drive(P, STEP, tolerance=1e-10)
    assert difference(loose, tight, "lateral_acceleration") < 1e-4


def test_a_locking_wheel_ends_the_run():
    with pytest.raises(RuntimeError, match=r"ends after [67]\.[0-9]* s: a wheel locks$"):
        drive(P, MANOEUVRES["brake_30"]._replace(braking=6.0))


def test_unknown_kind():
    with pytest.raises(ValueError, match=r"^kind must be step, sine, circle or brake, got 'loop'$"):
        drive(P, STEP._replace(kind="loop"))


def test_spin_is_the_wheels_inertia():
    """With a tenth of it the models agree without the momentum of spin, which else is worth 4 % here.

    A tenth of that, and 1 % between the models even with it.
    """
    light, sine = copy.deepcopy(P), MANOEUVRES["sine_30"]
    light.I_y_w *= 0.1
    theirs = drive(reconciled(light), sine, [name for name in CODE if name != "spin"], dt=0.02)
    assert difference(drive_two_track(light, sine, dt=0.02), theirs, "yaw_rate") < 0.014


def test_another_version_of_their_code_is_noticed(monkeypatch):
    monkeypatch.setitem(CODE, "other", {"no such line": ""})
    with pytest.raises(RuntimeError, match=r"is not that of version 3\.0\.2: no line with 'no such line'$"):
        drive(P, STEP, ["other"])


@pytest.mark.whole
@pytest.mark.parametrize("name", MANOEUVRES)
def test_the_stored_reference_is_what_their_model_gives(name):
    """To what single precision and the integration leave; the table shows 1e-4."""
    for case, run in commonroad.histories(name, P).items():
        stored = commonroad_reference.load().histories[name][case]
        assert set(stored.channels) == {*commonroad_reference.STORED, "road_wheel_angle"}
        np.testing.assert_array_equal(stored.time, run.time)
        for channel, values in stored.channels.items():
            np.testing.assert_allclose(values, run[channel], rtol=0.0, atol=1e-5 * np.abs(run[channel]).max())


def test_the_reference_has_their_parameters_and_names_what_reconciling_changes(tmp_path, monkeypatch):
    monkeypatch.setattr(commonroad, "histories", lambda name, p: commonroad_reference.load().histories[name])
    commonroad.write(tmp_path / "again.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["again.npz"]
    again, stored = commonroad_reference.load(tmp_path / "again.npz"), commonroad_reference.load()
    assert again[:2] == stored[:2]
    assert members(tmp_path / "again.npz") == members(commonroad_reference.FILE)
    assert stored.about["version"] == "3.0.2"
    assert list(commonroad_reference.PECULIARITIES) == [*QUIRKS, *CODE]
