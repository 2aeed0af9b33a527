"""CommonRoad's model as an oracle: its signs in ours, a closed form, and the stored reference."""

import copy
import zipfile

import numpy as np
import pytest
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from tests.verification.common import commonroad_model as commonroad
from tests.verification.common import commonroad_reference
from tests.verification.common.commonroad_manoeuvres import MANOEUVRES, Manoeuvre
from tests.verification.common.commonroad_model import CODE, drive, reconciled

P = setup_vehicle_parameters(vehicle_id=2)
STEP = MANOEUVRES["step_20"]._replace(duration=4.0)


def members(path):
    """The files in an archive; what the archive says of itself depends on the version of Python."""
    with zipfile.ZipFile(path) as file:
        return [(name, file.read(name)) for name in file.namelist()]


def last(run, name):
    return run[name][-1]


def test_a_left_turn_in_our_signs():
    turn = drive(P, STEP)
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


def without_camber(p):
    p = copy.deepcopy(p)
    p.tire.p_hy3 = p.tire.p_vy3 = p.tire.p_dy3 = p.tire.r_vy3 = 0.0
    return p


@pytest.mark.parametrize(("own_centres", "speed"), [(True, 20.0), (False, 30.0)])
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


def test_the_reference_has_their_parameters(tmp_path, monkeypatch):
    monkeypatch.setattr(commonroad, "histories", lambda name, p: commonroad_reference.load().histories[name])
    commonroad.write(tmp_path / "again.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["again.npz"]
    again, stored = commonroad_reference.load(tmp_path / "again.npz"), commonroad_reference.load()
    assert again[:2] == stored[:2]
    assert members(tmp_path / "again.npz") == members(commonroad_reference.FILE)
    assert stored.about["version"] == "3.0.2"
