"""Cars: the permitted contents of a data file, the numbers that follow from it, and errors for everything else."""

import copy
import json
import math
import pickle
from dataclasses import replace
from importlib.resources import files

import pytest

from steer_env import friction
from steer_env.friction.numerics import check
from steer_env.vehicle import cars, road, tyre

CAR = cars.load()
DATA = json.loads(files("steer_env.vehicle").joinpath("data", "cars", "compact.json").read_text(encoding="utf-8"))


def changed(section, **values):
    data = copy.deepcopy(DATA)
    (data if section is None else data[section]).update(values)
    return data


def without(section, key):
    data = copy.deepcopy(DATA)
    del (data if section is None else data[section])[key]
    return data


def test_steering_ratio_and_arm():
    """43.1 mm of rack per turn on a 6.86 mm pinion; 0.4986 deg/mm is an arm of 114.9 mm, and 114.9/6.86 is 16.75."""
    assert CAR.steering_ratio() == pytest.approx(17.22, abs=0.01)
    per_metre = float(CAR.strut.solve(0.0, 0.0).per_rack.rotation[2])
    assert math.degrees(per_metre) / 1e3 == pytest.approx(0.4851, abs=1e-4)
    assert 1.0 / per_metre == pytest.approx(0.1181, abs=1e-4)
    assert 2.0 * math.pi * CAR.steering["pinion_radius"] == pytest.approx(0.0431, abs=1e-4)


def test_friction_by_name_or_by_parameters():
    p = friction.make("coulomb", F_c=1.5)
    assert CAR.plant(p).friction is p
    assert CAR.plant(robot=True).robot == 1.0
    assert CAR.plant().robot == 0.0


def test_packaged_cars_load_once():
    assert cars.load("compact") is cars.load("compact")
    assert {"compact", "bmw_320i", "ford_escort", "vw_vanagon"} < {*cars.available()}
    assert cars.from_data(DATA).chassis == CAR.chassis


@pytest.mark.parametrize("name", cars.available())
def test_every_car_stands_on_its_wheels(name):
    """Loads sum to the weight, springs carry them in the design position, and the file names what has no source."""
    car = cars.load(name)
    b = car.plant(chassis="two_track").chassis.body[0]
    assert 2.0 * (b.F_zf + b.F_zr) == pytest.approx(b.m * 9.80665, rel=1e-12)
    slope = -float(car.strut.solve(0.0, 0.0).per_travel.strut_length)
    assert b.S_f * slope + b.m_f * 9.80665 == pytest.approx(b.F_zf, rel=1e-12)
    data = car.data()
    assert set(data["assumed"]) <= {*data, *data["chassis"], *data["steering"]}


def test_two_track_parameters_by_hand():
    b = CAR.plant(chassis="two_track").chassis.body[0]
    h = (1245.0 * 0.57 + 155.0 * 0.298) / 1400.0
    assert b.h == pytest.approx(h)
    assert (b.m_f, b.m_r) == pytest.approx((40.0, 37.5))
    # the roll axis of a free body: the wheels add their mass at its height, not at its width
    assert b.I_x == pytest.approx(410.0 + 1245.0 * (0.57 - h) ** 2 + 155.0 * (0.298 - h) ** 2)
    assert (b.B_f, b.B_r) == pytest.approx((34000.0 / 1.55**2, 8000.0 / 1.54**2))
    assert b.contact_y_r == pytest.approx(0.12 / 0.77)
    assert (b.steer_r, b.camber_r, b.compliance_steer_r) == (-0.065, 0.39, 0.17e-6)
    assert (b.stiffness_f, b.stiffness_r) == (1.6, 1.47)
    uphill = CAR.plant(chassis="two_track", road=road.make_road(grade=0.1, bank=-0.05)).chassis.body[0]
    assert (uphill.g_x, uphill.g_y, uphill.g_z) == pytest.approx((-0.97902, 0.48768, -9.74546), abs=1e-4)


def test_two_tracks_refuse_what_the_chassis_step_cannot_follow():
    for key, factor, message in (
        ("longitudinal_relaxation_length", 0.4, "wheel_inertia times the tyre's longitudinal relaxation length"),
        ("relaxation_length", 0.2, "the tyre's lateral relaxation length"),
        ("vertical_stiffness", 10.0, "the inverse of the tyre's vertical stiffness"),
    ):
        tyre = replace(CAR.tyre, **{key: factor * getattr(CAR.tyre, key)})
        CAR._replace(tyre=tyre).plant()
        with pytest.raises(ValueError, match=rf"^{message} .* on two tracks must be finite and at least"):
            CAR._replace(tyre=tyre).plant(chassis="two_track")


def test_chassis_and_road():
    with pytest.raises(ValueError, match=r"^chassis must be one of single_track, two_track, got 'bicycle'$"):
        CAR.plant(chassis="bicycle")
    with pytest.raises(ValueError, match=r"^road needs chassis='two_track'"):
        CAR.plant(road=road.flat())
    with pytest.raises(ValueError, match=r"^speed \[m/s\] must be .*at least 0 .*got -1"):
        CAR.plant(speed=-1.0, chassis="two_track")


TOML = """base = "compact"
description = "heavier"

[chassis]
mass = 1420.0
roll_inertia = 430

[column]
K_tb = 140.0
"""


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def test_car_from_a_file(tmp_path):
    car = cars.load(written(tmp_path / "mine.toml", TOML))
    assert (car.name, car.description) == ("mine", "heavier")
    assert car.chassis == {**CAR.chassis, "mass": 1420.0, "roll_inertia": 430.0}
    assert car.column == CAR.column._replace(K_tb=140.0)
    assert car.source == f"not told of what the file gives itself; of the rest: {CAR.source}"
    named = cars.load(written(tmp_path / "named.toml", 'base = "compact"\nsource = "the same"'))
    assert (named.source, cars.load(written(tmp_path / "as.toml", 'base = "compact"')).source) == (
        "the same",
        CAR.source,
    )
    whole = cars.load(str(written(tmp_path / "whole.json", json.dumps(DATA))))
    assert whole.chassis == CAR.chassis


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "mass = 1420.0",
            "mass = -1.0",
            ":5: chassis.mass must be finite and at least 100 and at most 10000, got -1.0",
        ),
        ("mass = 1420.0", "mass = 'much'", ":5: chassis.mass must be a number, got 'much'"),
        ("mass = 1420.0", "wheels = 4", ":5: chassis has no key 'wheels'; it takes: mass, "),
        ("K_tb = 140.0", "K_tb = 0.0", ":9: column.K_tb must be finite and greater than 0, got 0.0"),
        ("K_tb = 140.0", "K_tb = = 0.0", ": Invalid value (at line 9, column 8)"),
        ('base = "compact"', 'base = "tram"', ":1: base must be one of bmw_320i, "),
        ('base = "compact"', 'bass = "compact"', ":1: car has no key 'bass'; it takes: base, name, "),
        ('base = "compact"', "", ": car lacks name, source, "),
        ("[chassis]", "[name]\nfirst = 1\n[chassis]", ":5: name must be text, got {{'first': 1}}"),
        ("[chassis]", "[tyre]\nname = 1\n[chassis]", ":5: tyre.name must be text, got 1"),
        ("heavier", 'heavier"\ntyre = "none.tir', ":3: tyre file {folder}/none.tir: No such file or directory"),
    ],
)
def test_bad_file(tmp_path, old, new, message):
    path = written(tmp_path / "bad.toml", TOML.replace(old, new))
    with pytest.raises(ValueError) as caught:  # noqa: PT011, the whole message is compared
        cars.load(path)
    assert str(caught.value).startswith(f"{path}{message.format(folder=tmp_path)}")


def test_cornering_stiffness_factors_are_one_where_a_file_lacks_them():
    front, rear = "front_cornering_stiffness_factor", "rear_cornering_stiffness_factor"
    data = changed("chassis", **{front: 1.2})
    data["chassis"].pop(rear, None)
    assert [cars.from_data(data).chassis[key] for key in (front, rear)] == [1.2, 1.0]
    assert {front, rear} <= set(cars.every_key("bmw_320i")["chassis"])
    for value in (0.29, 3.1, math.nan):
        with pytest.raises(ValueError, match=f"^chassis.{front} must be finite and at least 0.3 and at most 3, got"):
            cars.from_data(changed("chassis", **{front: value}))


def test_sections_of_column_and_assist_take_part_of_the_keys():
    car = cars.from_data(changed("column", K_tb=143.0))
    assert car.column.K_tb == 143.0
    assert car.column.I1 == CAR.column.I1
    assert cars.from_data(changed("assist", delay=1e-3)).assist.delay == 1


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (changed(None, engine=1.0), "car has no key 'engine'; it takes: name, "),
        (changed("assist", gain=1.0), "assist has no key 'gain'; it takes: speeds, "),
        (without(None, "tyre"), "car lacks the key 'tyre'"),
        (without("chassis", "yaw_inertia"), "chassis lacks the key 'yaw_inertia'"),
        (changed(None, chassis=None), "chassis must hold keys and values, got None"),
        (changed("chassis", front_spring=math.nan), "chassis.front_spring must be finite"),
        (changed("chassis", mass=True), "chassis.mass must be a number, got True"),
        (changed(None, assumed=["luck"]), "assumed names 'luck', which is neither"),
        (changed("column", K_tb=True), "column.K_tb must hold numbers only, got True"),
        (
            changed("assist", boost=[[0.0, 1.0], [0.0]]),
            "assist.boost must hold numbers, in rows of one length, got [[0.0,",
        ),
        (changed("assist", damping=[[3.0], [2.0, 1.0]]), "assist.damping must be a list of numbers, got [[3.0], "),
        (changed("assist", boost=[[[0.0]]]), "assist.boost must be a list of rows, each a list of numbers, got [[["),
        (changed(None, tyre={"name": "mine"}), "tyre lacks 'source'; it takes: name, source, coefficients"),
        (changed(None, tyre=3), "tyre must be text, got 3"),
        (changed(None, assumed="mass"), "assumed must be a list of keys, got 'mass'"),
        (changed(None, tyre="slick"), "tyre must be "),
        (changed(None, strut="s3"), "no strut named 's3'; packaged: s1, s2"),
        ("compact", "car must hold keys and values, got 'compact'"),
    ],
)
def test_bad_data(data, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011, the whole message is compared
        cars.from_data(data)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("speed", [2.9, 70.1, -20.0, 0.0, math.nan, math.inf, "fast"])
def test_bad_speed(speed):
    with pytest.raises(ValueError, match=r"^speed \[m/s\] must be .*got"):
        CAR.plant(speed=speed)


@pytest.mark.parametrize("road_friction", [0.0, 0.09, 1.3, math.nan])
def test_bad_road_friction(road_friction):
    with pytest.raises(ValueError, match=r"^road_friction must be .*got"):
        CAR.plant(road_friction=road_friction)


def test_unknown_car_and_law():
    with pytest.raises(
        ValueError, match=r"^vehicle must be a .toml or .json file or one of bmw_320i, compact, .*, got 'van'$"
    ):
        cars.load("van")
    with pytest.raises(ValueError, match="unknown friction law 'glue'; available: "):
        CAR.plant("glue")
    with pytest.raises(ValueError, match="is not a set of friction parameters"):
        CAR.plant(3.0)


def test_speeds_at_the_ends_are_taken():
    assert CAR.plant(speed=cars.SPEED_MIN).chassis.v_x == 3.0
    assert CAR.plant(speed=cars.SPEED_MAX).chassis.v_x == 70.0


def same(one, other):
    """Whether two cars are equal to the bit, by what the plant takes from them."""
    a, b = (pickle.dumps(car.plant(chassis="two_track")) for car in (one, other))
    return a == b and (one.name, one.source, one.chassis) == (other.name, other.source, other.chassis)


def own_car(tmp_path):
    """A car with a tyre file, a torsion bar and a boost table of its own."""
    tyre.save(tyre.load("example_mf61"), tmp_path / "mine.tir")
    text = 'tyre = "mine.tir"\n[assist]\nboost = [[0, 10], [0, 4.5]]\ndamping = [1, 2]\nspeeds = [0, 30]\n'
    text += "torques = [0, 5]\n"
    return cars.load(written(tmp_path / "mine.toml", TOML.replace("\n[chassis]", f"{text}[chassis]")))


@pytest.mark.parametrize("suffix", ["toml", "json"])
@pytest.mark.parametrize("name", [*cars.available(), "own"])
def test_there_is_a_way_back_to_a_car_file(name, suffix, tmp_path):
    car = own_car(tmp_path) if name == "own" else cars.load(name)
    data = car.data()
    assert json.loads(json.dumps(data)) == data
    assert {"C1", "I1"} <= set(data["column"])
    cars.write(car, tmp_path / f"written.{suffix}")
    (tmp_path / "mine.tir").unlink(missing_ok=True)  # the written file needs no other
    for again in (cars.load(data), cars.load(tmp_path / f"written.{suffix}")):
        assert same(again, car)
        assert again.data() == data


def test_data_follow_what_was_replaced():
    boost = 1.2 * CAR.assist.boost
    changed_car = CAR._replace(tyre=tyre.load("example_mf52"), assist=CAR.assist._replace(boost=boost)).loaded(100.0)
    data = changed_car.data()
    assert (data["tyre"], data["chassis"]["mass"]) == ("example_mf52", CAR.chassis["mass"] + 100.0)
    assert data["assist"]["boost"] == boost.tolist()
    assert same(cars.load(data), changed_car)
    for wrong in (CAR._replace(assist=CAR.assist._replace(bandwidth=1.0)), CAR._replace(strut=CAR.strut.at_track(1.4))):
        with pytest.raises(ValueError, match="was replaced in the car by what no car file gives"):
            wrong.data()


def test_a_written_file_ends_in_toml_or_json(tmp_path):
    with pytest.raises(ValueError, match=r"must end in \.toml or \.json, got .*car\.yaml"):
        cars.write(CAR, tmp_path / "car.yaml")
    assert not list(tmp_path.iterdir())


def test_changes_set_keys():
    car = cars.load("compact", changes={"column.K_tb": 143.0, "tyre": "example_mf52", "name": "stiff"})
    assert (car.column.K_tb, car.tyre.name, car.name) == (143.0, "example_mf52", "stiff")
    assert same(car, cars.load({**CAR.data(), "name": "stiff", "tyre": "example_mf52", "column": {"K_tb": 143.0}}))
    assert cars.load("compact") is cars.load(CAR) is CAR
    assert same(car, cars.load(CAR, {"column.K_tb": 143.0, "tyre": "example_mf52", "name": "stiff"}))
    assert car.kinematics_table is CAR.kinematics_table  # which takes long to solve
    for changes, message in (
        ({"column.K": 1.0}, "column has no key 'K'; it takes: I1, I2, K_tb"),
        ({"colum.K_tb": 1.0}, r"a car has no 'colum\.K_tb'; it has chassis\.KEY, .*, name, "),
        ({"chassis": 1.0}, "a car has no 'chassis'; it has chassis.KEY, "),
        ({"column.K_tb": 0.0}, r"column\.K_tb must be finite and greater than 0, got 0\.0"),
    ):
        with pytest.raises(ValueError, match=f"^{message}"):
            cars.load("compact", changes=changes)


def test_changes_warn_only_of_what_they_make_unusual(monkeypatch, recwarn):
    monkeypatch.setattr(check, "_WARNED", set())
    heavy = cars.load("compact", changes={"column.K_tb": 400.0})
    assert [str(w.message).partition(" (")[0] for w in recwarn] == [
        "car compact: column.K_tb is 400 N m/rad; usual is 50 to 300 N m/rad"
    ]
    cars.load(heavy.data(), changes={"name": "other"})
    assert len(recwarn) == 1
