"""Cars that contradict themselves are refused, unusual ones warned about, and a key takes what is declared of it."""

import copy
import math
import re
import warnings
from inspect import signature

import numpy as np
import pytest

from steer_env.experiments.cli.main import main
from steer_env.friction.numerics import check
from steer_env.vehicle import cars, keys
from steer_env.vehicle.cars import contradictions, plausible
from steer_env.vehicle.cars import keys as sections
from tests.tools.glossary import default

DATA = cars.every_key("ford_escort")
CAR = cars.load("ford_escort")


def changed(section, **values):
    data = copy.deepcopy(DATA)
    data[section].update(values)
    return data


@pytest.fixture(autouse=True)
def _nothing_told(monkeypatch):
    monkeypatch.setattr(check, "_WARNED", set())


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"sprung_mass": 1200.0}, r"chassis\.mass must be above 1287\.6 and below 1462\.8 kg \(.*, got 1225\.9"),
        ({"front_axle": 0.12, "rear_axle": 2.273}, r"chassis\.front_axle must be above 0\.128\d+ and below 2\.26\d+ m"),
        ({"length": 2.3}, r"chassis\.length must be above 2\.393 m \(the wheelbase .*, got 2\.3"),
        ({"width": 1.4}, r"chassis\.width must be above 1\.423 m \(.*rear_track.*, got 1\.4"),
        ({"pitch_inertia": 13.42e3}, r"chassis\.pitch_inertia must be .* and below 5298\.62 kg m2 \(.*, got 13420"),
        ({"roll_inertia": 2e3, "pitch_inertia": 1e3}, r"chassis\.pitch_inertia must be above 1233\.\d+ and below"),
        (
            {"yaw_inertia": 153.9},
            r"chassis\.yaw_inertia must be above 1365\.48 and below 1853\.48 kg m2 \(.*, got 153\.9",
        ),
        ({"wheel_inertia": 9.0}, r"chassis\.wheel_inertia must be above 0 and below 3\.218\d+ kg m2 \(.*, got 9$"),
        (
            {"front_spring": 1e3, "rear_spring": 1e3, "front_anti_roll": 0.0},
            r"the roll stiffness by front_spring, .* must be above 5546\.19 N m/rad \(.*, got 1978\.5",
        ),
    ],
)
def test_contradictions_are_refused(values, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        cars.from_data(changed("chassis", **values))


def test_a_tyre_smaller_than_the_height_of_the_wheel_centre_is_refused():
    tyre = CAR.tyre.coefficients._replace(UNLOADED_RADIUS=0.29)
    small = CAR._replace(tyre=type(CAR.tyre)("small", "", tyre))
    with pytest.raises(ValueError, match=r"^UNLOADED_RADIUS of the tyre must be above 0\.298 m \(.*, got 0\.29$"):
        contradictions.check(small)


def body_of_points(seed):
    """A car whose sprung mass is a set of mass points within the outline."""
    draw = np.random.default_rng(seed)
    c = dict(CAR.chassis)
    ends = 0.5 * np.array([c["length"], c["width"], 2.0 * c["sprung_height"]])
    points = draw.uniform(-ends, ends, (40, 3)) * draw.uniform(0.01, 1.0, 3)
    points -= points.mean(axis=0)
    xx, yy, zz = c["sprung_mass"] * (points**2).mean(axis=0)
    a, b, m_s = c["front_axle"], c["rear_axle"], c["sprung_mass"]
    unsprung = c["front_unsprung_mass"], c["mass"] - m_s - c["front_unsprung_mass"]
    track = c["front_track"], c["rear_track"]
    wheels = sum(m * (x**2 + (0.5 * t) ** 2) for m, x, t in zip(unsprung, (a, b), track))
    ahead = (unsprung[1] * b - unsprung[0] * a) / m_s
    c |= {"roll_inertia": yy + zz, "pitch_inertia": xx + zz, "yaw_inertia": xx + yy + wheels + m_s * ahead**2}
    return CAR._replace(chassis=c)


def test_bodies_of_mass_points_pass():
    for seed in range(200):
        contradictions.check(body_of_points(seed))


def test_the_least_yaw_inertia_is_that_of_a_flat_body():
    """Without extent along y, I_zs = I_ys - I_xs."""
    c = body_of_points(0).chassis
    flat = wheels_of(c) + c["pitch_inertia"] - c["roll_inertia"]
    contradictions.check(CAR._replace(chassis={**c, "yaw_inertia": 1.001 * flat}))
    with pytest.raises(ValueError, match=r"^chassis\.yaw_inertia must be above"):
        contradictions.check(CAR._replace(chassis={**c, "yaw_inertia": 0.999 * flat}))


def wheels_of(c):
    """Yaw inertia of the unsprung masses and of the distance of the sprung one from the common centre of gravity."""
    b = CAR._replace(chassis=c).plant(chassis="two_track").chassis.body[0]
    x = 2.0 * (b.m_f * b.a - b.m_r * b.b) / c["sprung_mass"]
    return 2.0 * (b.m_f * (b.a**2 + 0.25 * b.t_f**2) + b.m_r * (b.b**2 + 0.25 * b.t_r**2)) + c["sprung_mass"] * x**2


@pytest.mark.parametrize("name", cars.available())
def test_packaged_cars_are_usual(name):
    assert plausible.unusual(cars.load(name)) == []


# A change that takes a quantity out of its usual range, and what the warning says.
UNUSUAL = {
    "wheelbase": ("chassis", {"front_axle": 1.9, "rear_axle": 2.0, "length": 6.0, "yaw_inertia": 1853.0}, "3.9 m;"),
    "front ride frequency": ("chassis", {"front_spring": 7000.0}, "0.708"),
    "roll gradient": ("chassis", {"front_anti_roll": 0.0, "sprung_height": 0.9}, "deg/g; usual is 1.5 to 10 deg/g"),
    "chassis.rear_cornering_stiffness_factor": ("chassis", {"rear_cornering_stiffness_factor": 1.8}, "usual is 0.8 to"),
    "steering ratio": ("steering", {"pinion_radius": 0.0043}, "26.73; usual is 10 to 25"),
    "column.K_tb": ("column", {"K_tb": 1e4}, "1e+04 N m/rad; usual is 50 to 300 N m/rad"),
    "greatest boost over the limit of the motor": ("assist", {"limit": 30.0}, "1.898;"),
}


@pytest.mark.parametrize("name", UNUSUAL)
def test_unusual_cars_are_warned_about_once(name):
    section, values, message = UNUSUAL[name]
    data = changed(section, **values)
    with pytest.warns(cars.UnusualCar) as caught:
        cars.from_data(data)
    texts = [str(warning.message) for warning in caught]
    assert any(f"{name} is " in text and message in text and text.startswith("car ford_escort: ") for text in texts)
    assert {warning.filename for warning in caught} == {__file__}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cars.from_data(data)


def test_quantities_by_hand():
    """Closed forms of the Escort: two wheels carry 707.3 kg in front, 4000 N and less on each tyre."""
    value = {q.name: q.value(CAR) for q in plausible.USUAL}
    assert value["front ride frequency"] == pytest.approx(math.sqrt(2 * 21898.0 / 707.34) / (2 * math.pi), rel=1e-4)
    assert value["front damping ratio"] == pytest.approx(2 * 1459.0 / (2 * math.sqrt(2 * 21898.0 * 707.34)), rel=1e-4)
    assert value["dynamic index k^2/(a b) of yaw"] == pytest.approx(1539.0 / (1225.9 * 0.884 * 1.509))
    assert value["share of the weight on the front axle"] == pytest.approx(1.509 / 2.393)
    slope = abs(
        float(CAR.tyre.forces(0.0, 1e-4, 0.0, 3790.0, 20.0)[1] - CAR.tyre.forces(0.0, -1e-4, 0.0, 3790.0, 20.0)[1])
    )
    assert value["cornering stiffness over load of a front tyre"] == pytest.approx(slope / 2e-4 / 3790.0, rel=5e-3)
    assert value["static deflection of the more loaded tyres"] == pytest.approx(3790.0 / 200e3, rel=1e-3)


CAR_FILE = """base = "ford_escort"
[chassis]
front_spring = 7000.0
[column]
K_tb = 30.0
"""


@pytest.mark.filterwarnings("default")
def test_the_command_line_warns_in_one_line(tmp_path, capsys):
    path = tmp_path / "soft.toml"
    path.write_text(CAR_FILE, encoding="utf-8")
    assert main(["car", str(path)]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith(f"steer-env car: warning: {path}:3: front_spring, ")
    assert lines[1].startswith(f"steer-env car: warning: {path}:5: column.K_tb is 30 N m/rad; usual is 50 to 300")


def test_the_line_of_the_first_key_that_a_message_names(tmp_path):
    """Also in JSON, where a section looks like a key."""
    path = tmp_path / "car.json"
    text = '{\n"base": "ford_escort",\n"chassis": {\n"mass": 1226.0,\n"yaw_inertia": 90.0\n}\n}\n'
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=rf"^{re.escape(str(path))}:5: chassis\.yaw_inertia must be above"):
        cars.load(path)


SECTIONS = ("chassis", "steering", *sections.CONSTRUCTORS)
NUMBERS = [
    (section, key)
    for section in SECTIONS
    for key, about in keys.declared_keys()[section].items()
    if re.match(r"above |at least |[-\d]", about.allowed) and np.size(default(section, key)) == 1
]


@pytest.mark.parametrize("section", SECTIONS)
def test_every_key_is_declared(section):
    known = keys.declared_keys()[section]
    assert set(known) == set(cars.load().data()[section])
    if section in sections.CONSTRUCTORS:
        assert set(known) == set(signature(sections.CONSTRUCTORS[section]).parameters)


CURVE = {"motor_speeds": [0.0, 100.0], "motor_torques": [1000.0, 0.0]}  # which the other limits of the motor need


def accepts(section, key, value):
    try:
        if section in sections.CONSTRUCTORS:
            curve = CURVE if key.startswith("motor_") else {}
            sections.CONSTRUCTORS[section](**curve | {key: value})
        else:
            sections.numbers(section, {key: value}, required=False)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize(("section", "key"), NUMBERS)
def test_what_is_declared_is_allowed(section, key):
    about = keys.declared_keys()[section][key]
    form = re.fullmatch(r"(?:(above|at least) (\S+?)|(\S+))(?:(?:, at most| to) (\S+))?", about.allowed)
    above, low, start, high = form.groups()
    low, high = float(low or start), 1e6 if high is None else float(high)
    assert accepts(section, key, low + 1e-9 if above == "above" else low)
    assert accepts(section, key, high)
    assert not accepts(section, key, math.nan)
    assert not accepts(section, key, low if above == "above" else math.nextafter(low, -math.inf))
    if high < 1e6:
        assert not accepts(section, key, math.nextafter(high, math.inf))
