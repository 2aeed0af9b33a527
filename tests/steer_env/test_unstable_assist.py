"""An assist loop that is unstable in a manoeuvre is refused before it is driven, with its cause and a stable value."""

import re

import pytest

from steer_env import manoeuvres
from steer_env.vehicle import cars
from steer_env.vehicle.steering import stability

pytestmark = pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")  # that is the subject
CAR = cars.load()


def changed(**changes):
    return cars.load("compact", changes={f"assist.{key}": value for key, value in changes.items()})


@pytest.mark.parametrize("stiffness", [1e3, 1e4, 1e5])
def test_a_torsion_bar_too_stiff_is_named(stiffness):
    stiff = CAR._replace(column=CAR.column._replace(K_tb=stiffness))
    what = rf"^weave: the assist loop is unstable at 100 km/h .*: K_tb {stiffness:g} N m/rad is too stiff .* K_tb \d+"
    with pytest.raises(ValueError, match=what):
        manoeuvres.drive(stiff, manoeuvres.make("weave"))


@pytest.mark.whole
@pytest.mark.parametrize(
    ("test", "key", "value"),
    [
        ("weave", "inertia_compensation", 0.05),
        ("parking", "inertia_compensation", 0.03),
        ("weave", "lead_lag_gain", -0.3),
        ("weave", "lead_lag_gain", 3.0),
        ("release", "lead_lag_gain", -0.15),  # stable as long as the handwheel is held
        ("release", "handwheel_damping", 10.0),
        ("returnability", "return_gain", 200.0),
    ],
)
def test_the_function_that_makes_it_unstable_is_named(test, key, value):
    """With the value that the message proposes the loop is stable, and with little more than that it is not."""
    car, m = changed(**{key: value}), manoeuvres.make(test)
    with pytest.raises(ValueError, match=rf"^{test}: the assist loop is unstable") as caught:
        manoeuvres.drive(car, m)
    found = re.search(rf"assist\.{key} is {value:g}.*; it is stable with (-?[\d.]+)", str(caught.value))
    proposed, free = float(found[1]), "hands off" in str(caught.value)
    calm, worse = changed(**{key: proposed}), changed(**{key: proposed + 0.02 * value})
    assert stability.stable(calm.column, calm.assist, m.speed, free=free)
    assert not stability.stable(worse.column, worse.assist, m.speed, free=free)


def test_a_loop_unstable_at_standstill_drives_at_speed():
    car = changed(inertia_compensation=0.03)
    assert manoeuvres.drive(car, manoeuvres.make("weave", cycles=3))["motor_torque"].std() > 0.1


def test_a_boost_too_steep_and_two_functions_together():
    with pytest.raises(ValueError, match=r"K_tb 130 N m/rad is too stiff .* stable with .*times the boost"):
        manoeuvres.drive(changed(boost_scale=3.0), manoeuvres.make("parking"))
    both = changed(inertia_compensation=0.05, lead_lag_gain=-0.5)
    with pytest.raises(ValueError, match=r"inertia_compensation is .*, assist\.lead_lag_gain is -0\.5; "):
        manoeuvres.drive(both, manoeuvres.make("weave"))


@pytest.mark.whole
def test_a_speed_that_the_run_reaches_counts():
    """The inertia compensation is too strong above 20 m/s only, which the steady circle reaches from 7 m/s on."""
    speeds = CAR.assist.speeds
    car = changed(inertia_compensation=[0.05 * (v > 15.0) for v in speeds])
    m = manoeuvres.make("steady-circle")
    assert stability.stable(car.column, car.assist, m.speed, free=False)
    with pytest.raises(ValueError, match=r"^steady-circle: the assist loop is unstable at .*inertia_compensation"):
        manoeuvres.drive(car, m)


@pytest.mark.parametrize("name", cars.available())
def test_packaged_cars_are_stable_in_every_manoeuvre(name):
    car = cars.load(name)
    for speed in {*car.assist.speeds, *(manoeuvres.make(test).speed for test in manoeuvres.available())}:
        for free in (False, True):
            assert stability.growth(car.column, car.assist, speed, free) < 0.995


def test_a_stiff_bar_without_assist_drives():
    stiff = CAR._replace(
        column=CAR.column._replace(K_tb=1e4), assist=manoeuvres.common.driving.without_assist(CAR.assist)
    )
    manoeuvres.drive(stiff, manoeuvres.make("weave", cycles=3))


@pytest.mark.parametrize("changes", [{"lead_lag_gain": -0.07}, {"inertia_compensation": 0.025}, {"return_gain": 50.0}])
def test_loading_warns_of_functions_near_their_limit(changes):
    with pytest.warns(cars.UnusualCar, match="strength of the functions at which the loop becomes unstable") as caught:
        car = changed(**changes)
    found = float(re.search(r"theirs is ([\d.]+)", str(caught[0].message))[1])
    assert 1.0 <= found < 1.6
    assert stability.functions_to_the_limit(car.column, car.assist) == pytest.approx(found, rel=1e-3)
