"""A law whose torque falls too steeply with the speed for the step equation is refused where a plant is made."""

import gymnasium
import numpy as np
import pytest

import steer_env  # noqa: F401
from steer_env import friction, manoeuvres
from steer_env.friction import law, sites
from steer_env.friction.models.lugre import LuGre
from steer_env.manoeuvres.common.driving import build_plant
from steer_env.vehicle import cars, step_limit
from steer_env.vehicle.steering import column

STEEP = {"law": "lugre", "sigma_0": 1e8, "F_c": 1.0, "F_s": 2.0, "v_s": 1e-3, "sigma_1": 0.0}
MILD = {"law": "lugre", "F_c": 0.9, "F_s": 1.8, "v_s": 1e-3, "sigma_1": 0.0}  # steep, but in far longer steps only
SLOPE = step_limit.least_slope(column.make(), 1e-3)


def rises(p, scale=1.0, h=1e-3):
    """Whether ``S w + mean torque`` rises everywhere with the speed, from a bristle at break-away."""
    memory, w = np.array([scale * p.F_s / p.sigma_0]), np.geomspace(1e-6, 1.0, 4000)
    balance = SLOPE * w + [law.mean_torque(p, scale, memory, each, h)[0] for each in w]
    return np.all(np.diff(balance) > 0.0)


def test_the_step_equation_rises_for_what_is_taken_and_not_for_what_is_refused():
    steep, mild = friction.resolve(STEEP), friction.resolve(MILD)
    assert law.law_of(steep).steepest_fall(steep, 1.0, 1e-3) > SLOPE
    assert not rises(steep)
    assert law.law_of(mild).steepest_fall(mild, 1.0, 1e-3) < SLOPE < law.law_of(mild).steepest_fall(mild, 1.0, 10.0)
    assert rises(mild)
    cars.load().plant(mild)


def test_the_refusal_names_law_slope_step_and_remedy():
    for make in (
        lambda: gymnasium.make("steer_env/AssistWeave-v3", friction=STEEP),
        lambda: build_plant(cars.load(), manoeuvres.make("weave"), STEEP),
        lambda: cars.load().plant(STEEP, robot=True),
    ):
        with pytest.raises(ValueError, match=r"'lugre'.*friction scale.*1 ms.*less than 105.*steps of.*ms.*Raise"):
            make()


def test_the_refusal_names_the_site_that_limits():
    text = ",".join(f"{key}={value}" if key != "law" else value for key, value in STEEP.items())
    car = cars.load()
    with pytest.raises(
        ValueError, match=r"friction law 'lugre' at rack, below the torsion bar: .*less than 105.*steps"
    ):
        car.plant(f"{text}@rack+masing@gear+coulomb@upper_column")
    with pytest.raises(ValueError, match=r"friction law 'lugre' at upper_column, above the torsion bar: .*less than "):
        car.plant(f"{text}@upper_column+masing@gear")


def test_the_longest_step_that_is_told_is_the_longest():
    p = cars.load().plant("coulomb")
    with pytest.raises(ValueError, match="steps of up to") as refused:
        step_limit.checked(p._replace(friction=friction.resolve(STEEP)))
    told = 1e-3 * float(str(refused.value).split("steps of up to ")[1].split(" ms")[0])
    steep, scale = friction.resolve(STEEP), 1.0 + p.level.load * step_limit.LARGEST_RACK_FORCE
    falls = [law.law_of(steep).steepest_fall(steep, scale, h) for h in (0.99 * told, 1.01 * told)]
    slopes = [step_limit.least_slope(p.column, h) for h in (0.99 * told, 1.01 * told)]
    assert falls[0] < slopes[0]
    assert falls[1] > slopes[1]


def test_a_law_that_no_step_helps_is_told_so():
    """The damping of the bristles alone lets the torque fall, in steps of any length."""
    p = cars.load().plant("coulomb")
    active = LuGre(sigma_0=1e5, sigma_1=1e8, sigma_2=0.0, F_c=1.0, F_s=1.5, v_s=1e-3)
    with pytest.raises(ValueError, match="no shorter step helps"):
        step_limit.checked(p._replace(friction=active))


def test_a_range_that_is_too_steep_at_its_end_is_refused_when_the_environment_is_made():
    edge = {**STEEP, "F_s": 1.02}
    gymnasium.make("steer_env/AssistWeave-v3", friction=edge).close()
    with pytest.raises(ValueError, match=r"falls with the speed.*level 5"):
        gymnasium.make("steer_env/AssistWeave-v3", friction=edge, randomise={"friction_level": (1.0, 5.0)})
    with pytest.raises(ValueError, match="falls with the speed"):
        gymnasium.make("steer_env/AssistWeave-v3", friction=edge, randomise={"friction": {"F_s": (1.02, 2.0)}})
    environment = gymnasium.make("steer_env/AssistWeave-v3", friction=edge)
    with pytest.raises(ValueError, match="falls with the speed"):
        environment.reset(seed=1, options={"friction_level": 5.0})


@pytest.mark.parametrize("robot", [False, True])
@pytest.mark.parametrize("arms", [0.0, 0.1])
def test_the_slope_is_the_least_of_the_column(robot, arms):
    """S, read from a step: with viscous friction alone, the load over the speed that it gives is S + sigma_2."""
    c, h = column.make()._replace(I_arm=arms, K_arm=10.0 * arms, C_arm=arms), 1e-3
    p, scales = sites.bound(friction.make("viscous", sigma_2=0.0)), np.ones(column.SCALES)
    _, w2, _, _ = column.step(c, p, scales, np.zeros(4), np.zeros(0), robot, 0.0, 0.0, 1.0, h)
    assert 1.0 / w2 >= SLOPE * (1 - 1e-12)
    if not robot:
        assert 1.0 / w2 == pytest.approx(step_limit.least_slope(c, h), rel=1e-12)


@pytest.mark.parametrize("car", cars.available())
def test_the_largest_rack_force_is_beyond_what_hands_and_boost_hold(car):
    p = cars.load(car).plant("coulomb")
    assert step_limit.LARGEST_RACK_FORCE * p.pinion_radius > 25.0 + p.assist.boost.max()
