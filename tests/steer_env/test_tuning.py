"""The tuning environments: Gymnasium's checks, the car's own set, physical sense, bad input, documentation."""

import math

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

from steer_env import friction, manoeuvres, metrics
from steer_env.metrics import Value
from steer_env.registration import TUNED
from steer_env.tuning import driving, parameters, reward
from steer_env.tuning import env as tuning_env
from steer_env.tuning.scenarios.common.definition import SCENARIOS
from steer_env.vehicle import cars
from steer_env.vehicle.steering import eps
from steer_env.vehicle.steering.margins import Margins
from tests.steer_env.test_infos import structure

IDS = tuple(TUNED)
ALL_ROUND, ON_CENTRE = IDS
EVERYTHING = {"load": (0, 300), "road_friction": (0.8, 1.0), "friction_level": (0.5, 2), "speed": (20, 40)}
AS_TARGETS = {"detuning": 0.0, "tolerance": 1.0}  # from the car's own set to the target bands


def make(name, **arguments):
    return gym.make(name, **arguments).unwrapped


def leaves(value):
    """The numbers and arrays in a tuple of tuples."""
    return [leaf for v in value for leaf in leaves(v)] if isinstance(value, tuple) else [value]


def action(env, **wanted):
    """The car's own set but for some parameters in [-1, 1]."""
    found = env.baseline_action
    for name, value in wanted.items():
        found[env.scenario.parameters.index(name)] = value
    return found


@pytest.fixture(scope="module")
def tried():
    """Metrics by set of the all-round scenario at its defaults."""
    env = make(ALL_ROUND, **AS_TARGETS)
    sets = {"own": {}, "boosted": {"boost_level": 0.5}, "weak": {"boost_level": -0.5}, "damped": {"damping_level": 1.0}}
    sets |= {"late": {"boost_progression": 0.5}, "light parking": {"boost_low_speed": 1.0}}
    env.reset(seed=0)
    found = {}
    for name, wanted in sets.items():
        *_, info = env.step(action(env, **wanted))
        found[name] = info["evaluated"] | info["margins"]
    return found


def test_own_set_gives_the_cars_metrics():
    """To the rounding of the lead's corners, as the battery drives and reads them; the weave thinned to 100 Hz."""
    env = make(ALL_ROUND, detuning=0.0)
    env.reset(seed=0)
    *_, info = env.step(env.baseline_action)
    found = info["evaluated"]
    for drive in env.scenario.drives:
        recording = manoeuvres.drive(cars.load(), drive.manoeuvre)
        thinned = metrics.evaluate(driving.thin_out(recording, drive.thinning))
        for name, value in thinned.items():
            assert found[name] == pytest.approx(value.value, rel=1e-8, abs=1e-8), name
        for name, value in metrics.evaluate(recording).items():  # what the thinning costs
            assert found[name] == pytest.approx(value.value, rel=5e-4), name
    assert set(found) == set(env.scenario.metrics)
    assert len(env.scenario.metrics) == len(set(env.scenario.metrics))
    whole = metrics.evaluate(manoeuvres.drive(cars.load(), manoeuvres.make("weave")))  # twelve cycles, not five
    for name, value in whole.items():
        assert found[name] == pytest.approx(value.value, rel=6e-3), name


@pytest.mark.parametrize("car", cars.available())
def test_own_set_is_the_cars_assist(car):
    own = cars.load(car).assist
    for scenario in SCENARIOS.all().values():
        zero = np.zeros(len(scenario.parameters))
        same = parameters.make_assist(own, parameters.values(own, scenario.parameters, zero))
        assert len(leaves(own)) == len(leaves(same))
        for a, b in zip(leaves(own), leaves(same)):
            assert np.allclose(a, b, rtol=1e-14, atol=1e-16)


def test_factors_at_standstill_end_at_100_kph():
    a = cars.load().assist
    own = {name: p.own(a) for name, p in parameters.PARAMETERS.items()}
    changed = parameters.keys(a, own | {"boost_low_speed": 1.5, "damping_low_speed": 3.0})
    fast = a.speeds >= parameters.HIGH_SPEED
    assert fast.sum() > 2
    assert np.array_equal(changed["boost"][fast], a.boost[fast])
    assert np.array_equal(changed["damping"][fast], a.damping[fast])
    assert changed["boost"][0] == pytest.approx(1.5 * a.boost[0])
    assert changed["damping"][0] == pytest.approx(3.0 * a.damping[0])


def test_more_boost_is_lighter(tried):
    for name in ("torque_gradient_at_0p1g", "torque_at_0p1g", "steady_step_torque", "handwheel_torque_peak"):
        assert tried["boosted"][name] < tried["own"][name] < tried["weak"][name], name
    assert tried["boosted"]["gain_db"] < tried["own"]["gain_db"] < tried["weak"]["gain_db"]


def test_later_boost_is_heavier_on_centre(tried):
    assert tried["late"]["torque_at_0p1g"] > tried["own"]["torque_at_0p1g"]


def test_more_damping_overshoots_less_or_is_slower(tried):
    own, damped = tried["own"], tried["damped"]
    assert damped["yaw_rate_time_to_half"] > own["yaw_rate_time_to_half"]
    assert damped["yaw_rate_after_1s"] > own["yaw_rate_after_1s"] + 5.0
    assert damped["handwheel_return_rate"] < own["handwheel_return_rate"]


def test_boost_at_standstill_leaves_100_kph_alone(tried):
    own, light = tried["own"], tried["light parking"]
    assert light["handwheel_torque_peak"] < own["handwheel_torque_peak"]
    # The row of the table for 100 km/h is 2e-5 m/s faster: a share of 4e-6 of the row for 80 km/h is read too.
    assert light["torque_at_0p1g"] == pytest.approx(own["torque_at_0p1g"], rel=1e-6)


@pytest.mark.parametrize("name", IDS)
def test_every_action_makes_an_assist(name):
    env, rng = make(name), np.random.default_rng(0)
    n = env.action_space.shape[0]
    corners = np.array(np.meshgrid(*[(-2.0, 2.0)] * n)).reshape(n, -1).T  # of an action and the largest detuning
    for tried in (*corners, *rng.uniform(-2.0, 2.0, (50, n))):
        a = parameters.make_assist(env.car.assist, parameters.values(env.car.assist, env.scenario.parameters, tried))
        assert (np.diff(a.boost, axis=1) >= 0.0).all()
        assert a.boost.flags.writeable == env.car.assist.boost.flags.writeable  # else the plant compiles anew
    # A corner that would leave what the lead can be stays at its end.
    high = eps.make(lead_pole=400.0)
    assert parameters.PARAMETERS["lead_pole"].value(high, 1.0) == parameters.HIGHEST_CORNER


def test_reward_is_the_distance_to_the_bands():
    env = make(ON_CENTRE, **AS_TARGETS)
    env.reset(seed=0)
    _, total, _, _, info = env.step(action(env, boost_level=0.5))
    assert total == pytest.approx(sum(info["reward_terms"].values()))
    low, high = env.targets.bands["weave"]["torque_at_0p1g"].good
    torque = info["evaluated"]["torque_at_0p1g"]
    assert torque < low
    off = (low - torque) / (high - low)
    assert info["reward_terms"]["torque_at_0p1g"] == pytest.approx(-off / (1.0 + off / reward.MAX_DISTANCE))
    assert info["reward_terms"]["lateral_acceleration_at_0nm"] == 0.0
    assert info["cost"] == sum(info["cost_terms"].values()) == 0.0
    doubled = make(ON_CENTRE, weights={"torque_at_0p1g": 2.0}, **AS_TARGETS)
    doubled.reset(seed=0)
    *_, other = doubled.step(action(env, boost_level=0.5))
    assert other["reward_terms"]["torque_at_0p1g"] == 2.0 * info["reward_terms"]["torque_at_0p1g"]


def test_lost_margins_cost():
    env = make(ALL_ROUND, detuning=0.0)
    env.reset(seed=0)
    wild = action(env, boost_level=1.0, boost_low_speed=1.0, lead_zero=1.0)
    *_, info = env.step(wild)
    assert info["cost_terms"] == {"phase_margin": 1.0, "gain_margin": 1.0}  # unstable at standstill
    assert info["reward_terms"]["gain_margin"] == -reward.MARGIN_WEIGHT
    half = reward.margin_shortfall(Margins(10.0 ** (7.5 / 20.0), math.radians(15.0), 0.01, 0.5, 20.0, True))
    assert half == {"phase_margin": pytest.approx(0.5), "gain_margin": 0.0}


def test_refused_metrics_cost_most_and_are_observed_as_zero():
    env = make(ALL_ROUND, detuning=0.0)
    env.reset(seed=0, options={"friction_level": 5.0})
    observation, _, _, _, info = env.step(env.baseline_action)
    assert "turn further" in env.refused["handwheel_return_rate"]
    assert env.units["handwheel_return_rate"] == "deg/s"
    assert math.isnan(info["evaluated"]["handwheel_return_rate"])
    assert math.isnan(info["metrics"]["handwheel_return_rate"])
    assert env.observation_space.contains(observation)
    names = [quantity.name for quantity in tuning_env.observed_quantities(env.scenario)]
    assert observation[names.index("handwheel_return_rate")] == 0.0
    assert 0.0 < observation[names.index("refused")] < 1.0
    band = env.terms["torque_at_0g"].band
    assert reward.distance(Value(math.nan, math.nan, math.nan, "N m", "why"), band) == reward.MAX_DISTANCE
    far = [reward.distance(Value(x, math.nan, math.nan, "N m"), band) for x in (1.0, 5.0, 100.0, 1e4)]
    assert far[0] == 0.0 < far[1] < far[2] < far[3] < reward.MAX_DISTANCE
    # Where the car's own set has no value, the whole target band is wanted.
    assert env.wanted["handwheel_angle_after_3s"].band.good != env.terms["handwheel_angle_after_3s"].band.good
    assert reward.wanted_terms(env.terms, dict.fromkeys(env.terms, Value(0.0, 0.0, 0.0, "", "why")), 0.1) == env.terms


def test_a_run_that_fails_is_refused(monkeypatch):
    def diverges(*_):
        raise ValueError("weave diverged: handwheel_angle [rad] first")

    env = make(ON_CENTRE)
    env.reset(seed=0)
    monkeypatch.setattr(driving, "drive_plant", diverges)
    observation, total, terminated, _, info = env.step(env.baseline_action)
    assert set(env.refused.values()) == {"weave diverged: handwheel_angle [rad] first"}
    assert all(map(math.isnan, info["evaluated"].values()))
    assert total == -reward.MAX_DISTANCE * sum(term.weight for term in env.terms.values())
    assert env.observation_space.contains(observation)
    assert not terminated


def episode(env, seed):
    rng, seen = np.random.default_rng(0), []
    observation, info = env.reset(seed=seed)
    seen.append(observation)
    truncated = False
    while not truncated:
        tried = rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        observation, total, terminated, truncated, info = env.step(tried)
        assert not terminated
        seen += [observation, [total]]
    return np.concatenate(seen), info


def test_an_episode_ends_with_its_best_set():
    env = make(ON_CENTRE)
    seen, info = episode(env, 0)
    rewards = seen[env.observation_space.shape[0] :].reshape(tuning_env.SETS, -1)[:, -1]
    assert info["best"]["reward"] == pytest.approx(rewards.max(), rel=1e-6)
    assert set(info["metrics"]) == set(env.scenario.metrics)
    best = env.best_action
    assert best is not None
    with pytest.raises(RuntimeError, match="call reset"):
        env.step(env.baseline_action)
    env.reset(seed=0)
    assert env.best_action is None
    _, total, *_, again = env.step(best)
    assert total == info["best"]["reward"]
    assert again["metrics"] == again["evaluated"] == info["metrics"]
    assert again["parameters"] == {key: value for key, value in info["best"].items() if key != "reward"}


@pytest.mark.parametrize("name", IDS)
def test_infos_have_the_same_keys_and_floats_after_every_step_and_at_a_reset_those_that_are_known(name):
    env = make(name)
    _, info = env.reset(seed=0)
    assert data_equivalence(info, env.reset(seed=0)[1])
    *_, later = env.step(env.baseline_action)
    expected = structure(later)
    assert later.keys() - info.keys() == {"evaluated", "margins", "best", "metrics"}
    assert structure(info) == [each for each in expected if each[0] in info]
    assert {type(value) for value in info.values()} == {dict, float}
    assert all(type(value) is float for each in info.values() if isinstance(each, dict) for value in each.values())
    assert info["cost"] == sum(info["reward_terms"].values()) == sum(info["cost_terms"].values()) == 0.0
    for _ in range(1 if name == ALL_ROUND else tuning_env.SETS - 1):
        *_, info = env.step(env.baseline_action)
        assert structure(info) == expected
        assert info["best"]["reward"] == sum(info["reward_terms"].values())


def test_context_is_observed():
    env = make(ON_CENTRE, randomise=EVERYTHING)
    aims = len(tuning_env.wanted_metrics(env.scenario))
    fixed = {"load": 200.0, "road_friction": 0.9, "friction_level": 2.0, "speed": 30.0}
    observation, info = env.reset(seed=1, options=fixed)
    context = info["context"]
    assert observation[:6] == pytest.approx(list(context.values()), rel=1e-6)
    assert observation[6 : 6 + aims] == pytest.approx(
        [info["wanted"][n] for n in tuning_env.wanted_metrics(env.scenario)]
    )
    assert not observation[6 + aims :].any()
    assert context["mass"] == pytest.approx(cars.load().chassis["mass"] + 200.0)
    assert context["speed"] == 30.0
    assert context["friction_torque"] == pytest.approx(1.8, rel=1e-4)  # F_c 0.9 N m at twice the level
    _, info = make(ON_CENTRE, friction=friction.make("coulomb", F_c=0.5)).reset(seed=0)
    assert info["context"]["friction_torque"] == pytest.approx(0.5)
    assert info["context"]["friction_stiffness"] == pytest.approx(500.0)  # all of it in the first mrad


def test_parameters_are_physical():
    env = make(ALL_ROUND, detuning=0.0)
    assert env.parameters["lead_zero"] == ("Hz", pytest.approx(17.0 / 3.0), pytest.approx(17.0), pytest.approx(51.0))
    env.reset(seed=0)
    for _, low, own, high in env.parameters.values():
        assert low < own < high
    *_, info = env.step(action(env, damping_level=0.5))
    assert info["parameters"]["damping_level"] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"speed": 5.0}, r"speed \[m/s\] must be finite and at least 12 and at most 50, got 5"),
        ({"detuning": 1.5}, "detuning must be finite and at least 0 and at most 1, got 1.5"),
        ({"tolerance": 0.0}, "tolerance must be finite and greater than 0 and at most 1, got 0"),
        ({"targets": "sedan"}, "no targets 'sedan'; there are compact, saloon, small, suv"),
        (
            {"targets": {"torque_at_0g": (1, 2)}},
            "targets must be one of compact, saloon, small, suv, or a .toml file",
        ),
        ({"weights": {"torque": 1.0}}, "has no reward term 'torque'; there are torque_at_0g"),
        ({"weights": {"torque_at_0g": -1.0}}, r"weights\['torque_at_0g'\] must be finite and at least 0"),
        ({"randomise": {"delay": (0, 0.1)}}, "randomise has no 'delay'; it takes: load, road_friction"),
        ({"randomise": {"road_friction": (0.1, 1)}}, r"randomise\['road_friction'\] must be .*at least 0"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        gym.make(ON_CENTRE, **arguments)


def test_nothing_is_drawn():
    with pytest.raises(ValueError, match="render_mode must be None, got 'rgb_array'"):
        type(make(ON_CENTRE))(render_mode="rgb_array")


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (np.array([np.nan, *[0] * 7], np.float32), "got nan"),
        (np.zeros(4, np.float32), r"shape \(8,\)"),
    ],
)
def test_bad_actions(bad, message):
    env = make(ON_CENTRE)
    with pytest.raises(RuntimeError, match="call reset"):
        env.step(env.baseline_action)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(bad)


def test_bad_options():
    env = make(ON_CENTRE)
    with pytest.raises(ValueError, match="unknown reset option 'sensor_noise'; TuneOnCentre takes: load, road"):
        env.reset(options={"sensor_noise": 1.0})
    with pytest.raises(ValueError, match="reset option 'load' must be finite and at least 0 and at most 500, got 900"):
        env.reset(options={"load": 900})


def test_targets_of_ones_own(tmp_path):
    head = 'name = "mine"\ndescription = "d"\nsource = "s"\n'
    path = tmp_path / "mine.toml"
    path.write_text(head + '[weave]\nloop_area = {unit="J", good=[0.1, 0.2], fair=[0, 0.3]}\n', encoding="utf-8")
    env = make(ON_CENTRE, targets=str(path), **AS_TARGETS)
    assert set(env.terms) == {"loop_area"}
    env.reset(seed=0)
    _, total, *_, info = env.step(env.baseline_action)
    off = (info["evaluated"]["loop_area"] - 0.2) / 0.1
    assert total == pytest.approx(-off / (1.0 + off / reward.MAX_DISTANCE))
    path.write_text(head + '[pulse]\npulse_overshoot = {unit="%", good=[1, 2], fair=[0, 3]}\n', encoding="utf-8")
    with pytest.raises(ValueError, match="targets 'mine' have no band for weave"):
        make(ON_CENTRE, targets=str(path))


def test_a_tuned_set_becomes_a_car_file(tmp_path):
    env = make(ON_CENTRE)
    chosen = action(env, boost_level=0.1, lead_zero=-0.3)
    env.reset(seed=0)
    chosen = env.own_action + chosen
    tried, car = env.assist(chosen), env.tuned_car(chosen)
    cars.write(car, tmp_path / "tuned.toml")
    for found in (car, cars.load(tmp_path / "tuned.toml")):
        assert all(np.array_equal(one, other) for one, other in zip(leaves(found.assist), leaves(tried), strict=True))
        assert (found.name, found.chassis, found.tyre) == ("compact_tuned", env.car.chassis, env.car.tyre)


@pytest.mark.whole
def test_functions_of_the_assist_can_be_tuned(tmp_path):
    """A strength is off at -1 and the car's own at 0; the best set becomes a car file."""
    names = ["damping_level", "return_gain", "friction_share", "lead_lag_gain"]
    own = {"base": "compact", "assist": {"friction_share": [0.2] * 4 + [0.4] * 4, "friction_law": "dahl"}}
    env = gym.make("steer_env/TuneOnCentre-v3", vehicle=own, parameters=names, **AS_TARGETS).unwrapped
    assert env.parameters["friction_share"] == ("1", 0.0, 0.4, 1.0)
    assert env.parameters["return_gain"] == ("N m/rad", 0.0, 0.0, 10.0)
    env.reset(seed=0)
    _, _, _, _, first = env.step(np.zeros(4, np.float32))
    observation, _, _, _, info = env.step(np.array([0.0, 0.5, -0.5, 0.1], np.float32))
    assert env.observation_space.contains(observation)
    assert info["parameters"]["friction_share"] == pytest.approx(0.2)
    assert info["parameters"]["return_gain"] == pytest.approx(5.0)
    assert info["evaluated"]["torque_deadband"] > first["evaluated"]["torque_deadband"] + 0.02
    assert info["margins"]["phase_deg"] < first["margins"]["phase_deg"]
    car = env.tuned_car(np.array([0.0, 0.5, -0.5, 0.1], np.float32))
    cars.write(car, tmp_path / "tuned.toml")
    again = cars.load(tmp_path / "tuned.toml").assist.functions
    assert again.friction_compensation.gain.tolist() == pytest.approx([0.1] * 4 + [0.2] * 4)
    assert type(again.friction_compensation.law) is type(friction.make("dahl"))
    for wrong in (["boost"], "return_gain", ["return_gain"] * 2, []):
        with pytest.raises(ValueError, match=r"parameters must be a list of boost_level, .* each once, got"):
            gym.make("steer_env/TuneOnCentre-v3", parameters=wrong)
