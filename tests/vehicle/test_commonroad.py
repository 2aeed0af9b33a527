"""CommonRoad's parameters: the tyre against CommonRoad's own functions, the resulting car, and errors."""

import copy
import json
from importlib.resources import files
from types import SimpleNamespace

import numpy as np
import pytest
from vehiclemodels.utils import tire_model
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from steer_env.vehicle import cars, commonroad, keys

P = setup_vehicle_parameters(vehicle_id=2)
FILES = {"ford_escort": 1, "bmw_320i": 2, "vw_vanagon": 3}


def their_forces(p, kappa, alpha, camber, F_z):
    """F_x and F_y of CommonRoad's tyre in ISO 8855: y changes sign, inclination does not, slip is 1 - omega R/v."""
    s, a, t = -kappa, -alpha, p.tire
    F_x = tire_model.formula_longitudinal(s, camber, F_z, t)
    F_y, mu_y = tire_model.formula_lateral(a, camber, F_z, t)
    F_x = tire_model.formula_longitudinal_comb(s, a, F_x, t)
    return F_x, -tire_model.formula_lateral_comb(s, a, camber, mu_y, F_z, F_y, t)


def test_tyre_is_theirs_without_the_four_constants():
    p = copy.deepcopy(P)
    p.tire.p_hx1 = p.tire.p_vx1 = p.tire.p_hy1 = p.tire.p_vy1 = 0.0
    grid = np.meshgrid(
        [-0.4, -0.05, 0.0, 0.02, 0.3], np.linspace(-0.25, 0.25, 7), [-0.08, 0.0, 0.03], [200.0, 3000.0, 9000.0]
    )
    points = np.array([axis.ravel() for axis in grid]).T
    theirs = np.array([their_forces(p, *point) for point in points]).T
    ours = commonroad.tyre(P).forces(*points.T, v_x=20.0)
    np.testing.assert_allclose(np.array(ours[:2]) / points[:, 3], theirs / points[:, 3], rtol=1e-7, atol=1e-9)
    assert not np.any(ours[2:])


def test_camber_thrust_opposes_the_inclination_in_commonroad_and_follows_it_in_the_axes_of_the_set():
    tyre = commonroad.tyre(P)
    assert tyre.forces(0.0, 0.0, 0.02, 4000.0, 20.0)[1] > 0.0  # top to the right, force to the left
    own = copy.deepcopy(P)
    own.tire.p_hy3, own.tire.p_vy3 = -P.tire.p_hy3, -P.tire.p_vy3
    assert commonroad.tyre(own).forces(0.0, 0.0, 0.02, 4000.0, 20.0)[1] < 0.0


def test_chassis_by_hand():
    c = commonroad.chassis(P)
    assert c["front_axle"] + c["rear_axle"] == pytest.approx(P.a + P.b)
    # the axles carry what their model lets them carry
    assert c["mass"] * c["rear_axle"] / (P.a + P.b) == pytest.approx(P.m_s * P.b / (P.a + P.b) + P.m_uf)
    assert (c["front_anti_roll"], c["rear_anti_roll"]) == (-P.K_tsf, -P.K_tsr)
    assert c["rear_camber_gain"] == pytest.approx(0.9055, abs=1e-4)  # in bump the top leans inward
    assert set(c) == {name for name, key in keys.declared_keys()["chassis"].items() if key.default is None}


def test_changes_are_taken_and_checked():
    assert commonroad.chassis(P, {"rear_roll_centre": 0.1})["rear_roll_centre"] == 0.1
    with pytest.raises(ValueError, match=r"^changes has no chassis key 'wings'; it takes: mass, "):
        commonroad.chassis(P, {"wings": 2.0})


class Listener:
    """Parameters that record which of them are read."""

    def __init__(self, inner, read, prefix=""):
        self._inner, self._read, self._prefix = inner, read, prefix

    def __getattr__(self, name):
        value, path = getattr(self._inner, name), self._prefix + name
        if not isinstance(value, float | int):
            return Listener(value, self._read, f"{path}.")
        self._read.add(path)
        return value


def read_of(function):
    read = set()
    function(Listener(P, read))
    return sorted(read)


READS = {
    commonroad.chassis: read_of(commonroad.chassis),
    commonroad.tyre: read_of(commonroad.tyre),
}


def test_what_is_read_and_what_is_left_out():
    read = {name for names in READS.values() for name in names}
    tyre = {f"tire.{name}" for name in vars(P.tire)}
    assert tyre - read == {"tire.p_hx1", "tire.p_vx1", "tire.p_hy1", "tire.p_vy1"}
    out = {"I_xz_s", "K_ras", "K_rad", "h_cg", "h_raf", "I_uf", "I_ur", "K_lt", "T_sb", "T_se", "D_f"}
    assert set(vars(P)) - read - {"steering", "longitudinal", "tire", "trailer"} == out | {"E_f", "E_r"}


@pytest.mark.parametrize(("function", "name"), [(commonroad.chassis, "K_tsf"), (commonroad.tyre, "tire.p_ky1")])
def test_missing_or_none(function, name):
    p = copy.deepcopy(P)
    *parents, last = name.split(".")
    owner = getattr(p, parents[0]) if parents else p
    setattr(owner, last, None)
    with pytest.raises(
        ValueError, match=rf"^parameters\.{name} is missing; CommonRoad's multi-body model, so vehicle 1"
    ):
        function(p)
    setattr(owner, last, "much")
    with pytest.raises(ValueError, match=rf"^parameters\.{name} must be a number, got 'much'$"):
        function(p)


def test_vehicle_4_and_strangers_are_refused():
    for p in (setup_vehicle_parameters(vehicle_id=4), SimpleNamespace(), None):
        with pytest.raises(ValueError, match=r"^parameters\.m is missing; "):
            commonroad.chassis(p)


@pytest.mark.parametrize(("name", "vehicle"), FILES.items())
def test_files_hold_their_numbers(name, vehicle):
    """The packaged files are ``car_data`` rounded, with the roll centre and drag area that they list as assumed.

    The Escort's axle distances are those of the sprung mass.
    """
    data = json.loads(files("steer_env.vehicle").joinpath("data", "cars", f"{name}.json").read_text(encoding="utf-8"))
    p = setup_vehicle_parameters(vehicle_id=vehicle)
    own = {key: data["chassis"][key] for key in data["assumed"] if key in data["chassis"]}
    if name == "ford_escort":
        own |= {"front_axle": p.a, "rear_axle": p.b}
    made = commonroad.car_data(
        p,
        name,
        description=data["description"],
        source=data["source"],
        sections={key: data[key] for key in ("steering", "column", "assist", "brakes", "speed_hold")},
        changes=own,
    )
    assert made["chassis"] == pytest.approx(data["chassis"], rel=1e-3)
    assert made["drivetrain"]["front_share"] == cars.load(name).drivetrain.front_share
    assert set(made) == set(data)
    assert set(commonroad.ASSUMED) <= set(data["assumed"])
    assert cars.from_data(made).chassis == {
        **{name: key.default for name, key in keys.declared_keys()["chassis"].items() if key.default},
        **made["chassis"],
    }
