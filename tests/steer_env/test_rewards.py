"""Rewards, costs and failures against docs/make_a_task.md: bounds by the declared terms, and against what pays."""

import functools
import itertools

import gymnasium as gym
import numba
import numpy as np
import pytest
from scipy import signal

from steer_env import friction, tasks
from steer_env.experiments.learning import assist_drives
from steer_env.registration import DRIVEN, id_of
from steer_env.tasks import assist_release
from steer_env.tasks.common import definition, terms
from steer_env.tasks.common.definition import DEPARTED, FAILURE, FINISHED, GOES_ON, StepContext
from steer_env.tasks.common.reference_feel import reference_torque
from steer_env.vehicle.plant import CHANNEL

NAMES = tasks.available()
SEED = 5


def made(name, n=8, **arguments):
    return gym.make_vec(id_of(name), num_envs=n, **arguments).unwrapped


def episode(env, act, seed=SEED):
    """Reward, time, terms, failure of each episode under ``act(observation, step)``."""
    observation, _ = env.reset(seed=seed)
    n, dt = env.num_envs, env.batch.control_dt
    reward, time, going, failure = np.zeros(n), np.zeros(n), np.ones(n, bool), np.zeros(n, int)
    steps = []
    while going.any():
        observation, r, terminated, truncated, _ = env.step(act(observation, len(steps)))
        failed = env.batch.episodes["failure"].copy()
        steps.append(np.where(going, r, 0.0))
        reward += steps[-1]
        time += dt * going
        failure = np.where(going, failed, failure)
        going &= ~(terminated | truncated)
    return reward, time, failure, np.array(steps)


def records(task, *values):
    """Arrays of a task's rewards, costs and metrics as the records that its kernels take."""
    groups = (task.rewards, task.costs, task.metrics)
    return [definition.by_name(each[None], group)[0] for each, group in zip(values, groups)]


@pytest.mark.parametrize("name", NAMES)
def test_no_way_to_fail_is_worth_more_than_to_go_on(name):
    """By bound: every term but the failure lies between 0 and its weight per second, the weights add up to 1."""
    *own, last = tasks.task(name).rewards
    assert last == FAILURE
    assert -1.0 <= last.weight <= 0.0
    assert all(term.weight > 0.0 for term in own)
    assert sum(term.weight for term in own) <= 1.0 + 1e-12


@pytest.mark.parametrize("name", NAMES)
def test_qualities_stay_between_zero_and_one_whatever_the_car_does(name):
    task, rng = tasks.task(name), np.random.default_rng(SEED)
    env = made(name, 4)
    env.reset(seed=SEED)
    a, episodes = env.batch.arrays, env.batch.episodes
    for k in range(200):
        row = k % 4
        channels = a.channels[row] * rng.normal(1.0, 10.0, a.channels.shape[1]) + rng.normal(
            0.0, 10.0, a.channels.shape[1]
        )
        dt = 0.01
        step = StepContext(
            0.01 * (k + 1), dt, abs(rng.normal(0.0, 30.0)), max(float(episodes["held_speed"][row]), 3.0),
            rng.uniform(-1.0, 1.0), rng.normal(0.0, 200.0), 1.0
        )  # fmt: skip
        data = a.task_data[row, : episodes["data_size"][row]]
        path = a.paths[row, : episodes["path_points"][row]]
        observed, memory = a.task_observations[row], a.task_memory[row]
        rewards, costs, metrics = (np.zeros(len(each)) for each in (task.rewards, task.costs, task.metrics))
        definition.observe(task.parameters, channels, path, data, step, memory, observed)
        outcome = definition.evaluate_step(
            task.parameters, channels, observed, data, step, memory, *records(task, rewards, costs, metrics)
        )
        assert outcome in (FINISHED, GOES_ON, DEPARTED)
        assert (rewards[:-1] >= 0.0).all()
        assert (rewards[:-1] <= dt * (1.0 + 1e-12)).all()
        assert rewards[-1] == 0.0  # the engine counts failures
        assert (costs >= 0.0).all()


@pytest.mark.parametrize(
    "name",
    [n for n in NAMES if n.startswith("Driver") and "lateral_offset" in [q.name for q in tasks.task(n).observed]],
)
def test_leaving_the_road_never_pays(name):
    """Full lock into the ditch is worth less than doing nothing."""
    env = made(name)
    ditch, _, failed, steps = episode(env, lambda o, k: np.ones((8, 1), np.float32))
    nothing, *_ = episode(env, lambda o, k: np.zeros((8, 1), np.float32))
    assert (failed == DEPARTED).all()
    assert (ditch < nothing).all()
    assert steps.min() <= -1.0 + env.batch.control_dt
    assert (steps[steps < 0.0] >= -1.0).all()


def test_dawdling_and_turning_back_gain_nothing():
    """Way that is gained twice counts once: the reward of a path is bounded by its length over the held speed."""
    env = made("DriverDoubleLaneChange", 1)
    task = env.batch.task
    env.reset(seed=SEED)
    a = env.batch.arrays
    memory, total = a.task_memory[0].copy(), 0.0
    speed = float(env.batch.episodes["held_speed"][0])
    channels, data, path = a.channels[0].copy(), a.task_data[0], a.paths[0, : env.batch.episodes["path_points"][0]]
    observed = a.task_observations[0].copy()
    rewards, costs, metrics = (np.zeros(len(each)) for each in (task.rewards, task.costs, task.metrics))
    scores = records(task, rewards, costs, metrics)
    x0 = channels[CHANNEL["x"]]
    for k in range(400):  # back and forth over the same 20 m
        channels[CHANNEL["x"]] = x0 + 10.0 - 10.0 * np.cos(0.1 * k)
        step = StepContext(0.01 * (k + 1), 0.01, speed, speed, 0.0, 0.0, 0.0)
        definition.observe(task.parameters, channels, path, data, step, memory, observed)
        definition.evaluate_step(task.parameters, channels, observed, data, step, memory, *scores)
        total = sum(rewards)
    assert 0.0 < total <= (20.0 / speed) * len(rewards)
    assert rewards.max() <= 20.0 / speed + 1e-9


@pytest.mark.parametrize("dt", [0.001, 0.01])
def test_ripple_is_a_second_order_butterworth_high_pass(dt):
    t = dt * np.arange(1, 400)
    torque = 2.0 + np.sin(2.0 * np.pi * 3.0 * t) + 0.3 * np.sin(2.0 * np.pi * 20.0 * t)
    b, a = signal.butter(2, terms.RIPPLE_FREQUENCY, "high", fs=1.0 / dt)
    expected, _ = signal.lfilter(b, a, torque, zi=signal.lfilter_zi(b, a) * torque[0])
    memory = np.zeros(terms.COMMON_MEMORY)
    found = [terms._ripple(x, dt, k > 0, memory) for k, x in enumerate(torque)]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_larger_gain_that_makes_the_hands_vibrate_does_not_pay_in_parking():
    env = made("DriverParking", control_dt=0.01)
    place = {metric.name: k for k, metric in enumerate(env.batch.task.metrics)}
    error = [quantity.name for quantity in env.batch.observed].index("target_0.0s")
    score, ripple = {}, {}
    for gain in (10.0, 20.0, 30.0, 45.0, 60.0, 80.0, 150.0):  # [N m/rad]
        scale = gain * env.observation_scale[error] / env.batch.task.action.scale
        reward, *_ = episode(env, lambda o, k: np.clip(scale * o[:, [error]], -1.0, 1.0))  # noqa: B023 (used at once)
        score[gain] = reward.mean()
        ripple[gain] = env.batch.arrays.metrics[0, 2, place["rms_ripple"]]
    best = max(score, key=lambda gain: score[gain])
    assert ripple[best] < 0.1, (score, ripple)
    vibrating = [gain for gain in score if ripple[gain] > 0.1]
    assert len(vibrating) >= 2
    assert max(score[gain] for gain in vibrating) < score[best] - 0.3, (score, ripple)


@pytest.mark.parametrize("env_id", DRIVEN)
def test_the_reward_of_zero_action_is_not_saturated(env_id):
    """The task's own terms leave room above zero action, and zero action is not at their floor."""
    env = gym.make_vec(env_id, num_envs=8).unwrapped
    env.reset(seed=SEED)
    own = np.zeros(len(env.batch.task.rewards))
    time = 0.0
    for _ in range(round(5.0 / env.batch.control_dt)):
        if env.batch.over.any():
            break
        env.step(np.zeros((8, 1), np.float32))
        own += env.batch.arrays.terms[:, : own.size].sum(axis=0)
        time += 8 * env.batch.control_dt
    quality = own[0] / time / env.batch.task.rewards[0].weight
    assert 0.05 < quality < 0.97, quality


RELEASE = tasks.task("AssistRelease")
# Largest return of an episode [s]
SCALE = assist_release.HELD_SHARE * assist_release.RELEASE_TIME + assist_release.FREE_TIME
RELEASED_CARS = ("compact", *assist_drives.OTHER_CARS)
# Pairs of a law and a car in a test that every change needs: the extremes of a table of all.
RELEASED = (("lugre", "compact"), ("viscous", "compact"), ("coulomb", "rear_drive_saloon"))


def released(act, n=16, law="lugre", car="compact"):
    """Mean return of episodes of AssistRelease over the largest; ``act(seen, k)`` gives torques (n,) [N m]."""
    env = made("AssistRelease", n, friction=law, vehicle=car, normalise=False)
    names = [quantity.name for quantity in env.batch.observed]

    def action(observation, k):
        seen = dict(zip(names, observation.astype(float).T))
        return np.clip(act(seen, k) / RELEASE.action.scale, -1.0, 1.0).astype(np.float32)[:, None]

    found, *_ = episode(env, action)
    env.close()
    return found.mean() / SCALE


class Clean:
    """The best known of what knows observations alone: integral control of the feel, then of the return.

    The gains were searched for, on three pairs of car and law together.
    """

    def __init__(self):
        self.sum = 0.0

    def __call__(self, seen, k):
        error = seen["return_error"]
        off = seen["torsion_bar_torque"] - np.vectorize(reference_torque)(
            seen["lateral_acceleration"], seen["handwheel_speed"]
        )
        self.sum = np.clip(self.sum + 0.01 * np.where(seen["released"] > 0.5, 1100.0 * error, 40.0 * off), -10.0, 10.0)
        slow = seen["return_speed_error"] + seen["handwheel_speed"] - seen["column_speed"]  # where the torque acts
        pushed = 90.0 * error + 3.0 * slow + 1.5 * seen["lateral_acceleration"]
        return self.sum + np.where(seen["released"] > 0.5, pushed, 0.0)


@pytest.mark.parametrize(
    ("law", "car"),
    [
        *RELEASED,
        *(
            pytest.param(*pair, marks=pytest.mark.whole)
            for pair in zip(friction.available(), itertools.cycle(RELEASED_CARS))
            if pair not in RELEASED
        ),
    ],
)
def test_a_return_earns_most_of_the_scale_more_than_nothing(law, car):
    nothing = released_alone(law, car)
    assert nothing < 0.3
    assert released(Clean(), law=law, car=car) - nothing > 0.6


@functools.cache
def released_alone(law, car="compact"):
    """The return of zero action."""
    return released(lambda seen, k: np.zeros(seen["speed"].size), law=law, car=car)


def along(size, band=0.0):
    """Full torque one way or the other along the wanted return."""

    def act(seen, k):
        off = seen["return_error"] + 0.05 * seen["return_speed_error"]
        return size * np.sign(off) * (np.abs(off) > band) * seen["released"]

    return act


class Locked:
    """Holds the handwheel where it was released, as stiffly as sampling allows."""

    def __init__(self):
        self.held = 0.0

    def __call__(self, seen, k):
        self.held = np.where(seen["released"] > 0.5, self.held, seen["handwheel_angle"])
        return 80.0 * (self.held - seen["handwheel_angle"]) - 3.0 * seen["column_speed"] * seen["released"]


CHEAP = {
    "bang-bang along the wanted return": along(10.0),
    "half of it": along(5.0),
    "half of it, with a dead band": along(5.0, 0.01),
    "bang-bang to the centre": lambda seen, k: -10.0 * np.sign(seen["handwheel_angle"]) * seen["released"],
    "a locked handwheel": Locked(),
    "chatter": lambda seen, k: np.full(seen["speed"].size, 10.0 * (-1.0) ** k),
    "small chatter": lambda seen, k: np.full(seen["speed"].size, 2.0 * (-1.0) ** k),
    "a constant torque": lambda seen, k: np.full(seen["speed"].size, 3.0),
}


@pytest.mark.parametrize("name", CHEAP)
def test_what_nobody_wants_of_a_return_earns_no_more_than_nothing(name):
    for law in ("lugre", "viscous"):
        assert released(CHEAP[name], law=law) < released_alone(law) + 0.02


def test_chatter_on_top_of_a_clean_return_costs_most_of_it():
    clean, shaken = Clean(), Clean()
    found = released(clean)
    assert released(lambda seen, k: shaken(seen, k) + 2.0 * (-1.0) ** k) < 0.5 * found


def test_a_release_is_drawn_from_low_to_high_speed_and_can_be_fixed():
    env = made("AssistRelease", 64)
    _, info = env.reset(seed=SEED)
    low, high = RELEASE.speeds
    speeds = info["conditions"]["speed"]
    assert (speeds >= low).all()
    assert (speeds <= high).all()
    assert np.ptp(speeds) > 0.9 * (high - low)
    angles = np.abs(env.batch.arrays.task_data[:, 0])
    assert angles[speeds < 20.0 / 3.6].min() > 2.0
    assert angles[speeds > 90.0 / 3.6].max() < 0.7
    _, info = env.reset(seed=SEED, options={"speed": 10.0, "amplitude": 0.4})
    assert (info["conditions"]["speed"] == 10.0).all()
    assert (env.batch.arrays.task_data[:, 0] == 0.4).all()
    assert (made("AssistRelease", speed=12.0).reset(seed=SEED)[1]["conditions"]["speed"] == 12.0).all()
    _, info = made("AssistRelease", randomise={"speed": (20.0, 21.0)}).reset(seed=SEED)
    assert (info["conditions"]["speed"] >= 20.0).all()


def test_the_wanted_return_starts_at_rest_at_the_held_angle_and_does_not_overshoot():
    """By its differential equation, T^2 x'' + 2 T x' + x = 0."""
    t, T = np.linspace(0.0, 5.0, 5001), assist_release.RETURN_TIME
    angle, speed = np.array([assist_release.wanted_return(0.7, each) for each in t]).T
    assert (angle[0], speed[0]) == (0.7, 0.0)
    assert (np.diff(angle) < 0.0).all()
    assert angle.min() > 0.0
    np.testing.assert_allclose(np.gradient(angle, t)[1:-1], speed[1:-1], atol=1e-5)
    acceleration = np.gradient(speed, t)
    np.testing.assert_allclose((T * T * acceleration + 2.0 * T * speed + angle)[1:-1], 0.0, atol=1e-5)


def test_the_torque_known_to_the_driver_in_the_loop_is_that_of_the_car():
    """It was ten times too small where the driver's own arms held the handwheel while it was measured."""
    alone, in_loop = made("DriverLaneKeeping", 1), made("AssistLaneKeeping", 1)
    conditions = alone.batch.usual_conditions
    found = in_loop.batch.steering_response(conditions, 0.1, 0.7)
    np.testing.assert_array_equal(found, alone.batch.steering_response(conditions, 0.1, 0.7))


def test_scenarios_of_the_all_round_task_are_those_of_its_parts():
    """A weave of AssistAllRound is the AssistWeave of the same car, speed and amplitude."""
    whole = gym.make("steer_env/AssistAllRound-v3").unwrapped
    whole.reset(seed=SEED, options={"scenario": 0})
    row, data = whole.batch.episodes[0], whole.batch.scripts()[0]
    amplitude = float(np.abs(data[:, 0]).max())
    part = gym.make("steer_env/AssistWeave-v3", chassis="two_track", speed=float(row["held_speed"])).unwrapped
    part.reset(seed=SEED, options={"amplitude": amplitude})
    scale = float(np.abs(part.batch.scripts()[0][:, 0]).max()) / amplitude
    part.reset(seed=SEED, options={"amplitude": amplitude / scale})
    action = np.array([0.05], np.float32)
    for _ in range(300):
        _, _, _, _, one = whole.step(action)
        _, _, _, _, other = part.step(2.0 * action)  # its full scale is half as large
    assert one["handwheel_torque"] == pytest.approx(other["handwheel_torque"], rel=1e-6)


@pytest.mark.parametrize("arguments", [{"speed": 20.0}, {"randomise": {"speed": (10, 20)}}])
def test_the_all_round_task_draws_its_own_speeds(arguments):
    with pytest.raises(ValueError, match="draws its speeds"):
        gym.make("steer_env/AssistAllRound-v3", **arguments)
    env = gym.make("steer_env/AssistAllRound-v3")
    with pytest.raises(ValueError, match="draws its speeds"):
        env.reset(options={"speed": 20.0})


def test_the_driver_holds_the_handwheel_in_lane_changes_alone():
    env = made("AssistAllRound", 32)
    env.reset(seed=SEED)
    scenario, driven = env.batch.arrays.task_data[:, 0], env.batch.episodes["driven"]
    assert set(scenario) == {0.0, 1.0, 2.0, 3.0}
    np.testing.assert_array_equal(driven == 1, scenario == 3.0)
    assert "lateral_offset" not in [quantity.name for quantity in env.batch.observed]


@pytest.mark.parametrize(
    ("name", "cost", "exceeds"),
    [
        ("DriverDoubleLaneChange", "hand_speed", lambda info, action: abs(info["handwheel_speed"]) > 2.0),
        ("AssistWeave", "added_work", lambda info, action: abs(5.0 * action * info["column_speed"])),
        ("AssistAllRound", "added_work", lambda info, action: abs(10.0 * 1.5 * action * info["column_speed"])),
        ("DriverParking", "hand_torque", lambda info, action: abs(info["handwheel_torque"]) > 8.0),
    ],
)
def test_a_cost_is_its_quantity_over_its_budget(name, cost, exceeds):
    env = gym.make(id_of(name), control_dt=0.01).unwrapped
    limit = {each.name: each.limit for each in env.task.costs}[cost]
    env.reset(seed=SEED, options={"action_gain": 1.5} if name == "AssistAllRound" else {})
    rng, beyond, found, over, k = np.random.default_rng(SEED), 0.0, 0.0, False, 0
    while not over and k < 400:
        if k % 40 == 0:
            action = rng.uniform(-1.0, 1.0, 1).astype(np.float32)
        _, _, terminated, truncated, info = env.step(action)
        beyond += 0.01 * exceeds(info, float(action[0]))
        found += info["cost_terms"][cost]
        over, k = terminated or truncated, k + 1
    assert beyond > 0.1
    assert found == pytest.approx(beyond / limit, rel=1e-9)


@pytest.mark.parametrize("weights", [{"feel": -1.0}, {"failure": 0.5}])
def test_weights_by_which_a_failure_would_pay_are_refused(weights):
    (name,) = weights
    with pytest.raises(ValueError, match=rf"weights\['{name}'\] must be"):
        gym.make("steer_env/AssistWeave-v3", weights=weights)


def test_the_scenario_is_told_in_the_info_alone():
    env = gym.make("steer_env/AssistAllRound-v3")
    for scenario in range(4):
        _, info = env.reset(options={"scenario": scenario})
        assert info["conditions"]["scenario"] == scenario
    with pytest.raises(ValueError, match=r"'scenario' must be a whole number from 0 to 3, got 1\.5"):
        env.reset(options={"scenario": 1.5})


def test_the_last_action_is_known_without_delay():
    env = gym.make("steer_env/AssistWeave-v3", randomise={"delay": (0.1, 0.1)}, normalise=False).unwrapped
    place = [quantity.name for quantity in env.batch.observed].index("last_action")
    env.reset(seed=SEED)
    for k in range(20):
        observation, *_ = env.step(np.array([0.01 * k], np.float32))
        assert observation[place] == np.float32(0.01 * k)
    other = gym.make("steer_env/AssistWeave-v3", randomise={"delay": (0.1, 0.1)}, normalise=False).unwrapped
    other.reset(seed=SEED + 1)
    other.set_state(env.get_state())
    assert other.batch.arrays.observations[0, place] == np.float32(0.19)


@pytest.mark.parametrize("dt", [0.01, 0.05])
def test_a_jump_costs_more_smoothness_than_a_slow_change_and_chatter_more_than_both(dt):
    """All change the action by 1 within 2 s: at once, evenly over half a second, or to and fro for half a second."""
    n, moving = round(2.0 / dt), round(0.5 / dt)
    motions = {name: np.zeros(n) for name in ("jump", "slow", "chatter")}
    motions["jump"][0], motions["slow"][:moving] = 1.0, 1.0 / moving
    motions["chatter"][:moving] = np.where(np.arange(moving) % 2 == 0, 1.0, -1.0)
    lost = {}
    for name, changes in motions.items():
        memory, total = np.zeros(terms.COMMON_MEMORY), 0.0
        for k, change in enumerate(changes):
            for _ in range(round(dt / 0.01)):
                step = StepContext(0.01 * k, 0.01, 30.0, 30.0, 0.0, change / dt, 0.0)
                total += 0.01 * (1.0 - terms.quality(terms._rms_rate(step, memory) / terms.RATE_SCALE))
        lost[name] = total
    assert lost["slow"] < 0.5 * lost["jump"]
    assert lost["jump"] < 0.9 * lost["chatter"]


@pytest.mark.parametrize(("dt", "lag"), [(0.05, 0.0), (0.01, 0.0), (0.05, 0.05), (0.005, 0.1)])
def test_a_drivers_torque_goes_on_straight_lines_behind_its_lag(dt, lag):
    env = gym.make("steer_env/DriverLaneKeeping-v3", control_dt=dt).unwrapped
    _, info = env.reset(seed=SEED, options={"action_lag": lag})
    assert info["conditions"]["action_lag"] == lag
    given, last, rng, asked = 0.0, 0.0, np.random.default_rng(SEED), []
    inputs, n = env.batch.arrays.inputs, round(dt / 0.001)
    for _ in range(10):
        action = rng.uniform(-0.1, 0.1, 1).astype(np.float32)
        env.step(action)
        for k in range(n):
            line = 10.0 * (last + (k + 1) / n * (float(action[0]) - last))
            given = line if lag == 0.0 else line + np.exp(-0.001 / lag) * (given - line)
            asked.append(given)
        last = float(action[0])
        rounds = min(n, 10)
        np.testing.assert_allclose(inputs[0, :, env.task.action.input], asked[-rounds:], rtol=1e-9)
    assert np.abs(np.diff(asked)).max() < 2.0 * 0.1 * 10.0 / n + 1e-9


def test_an_assists_torque_is_held_and_its_lag_counts_in_its_work():
    env = gym.make("steer_env/AssistWeave-v3").unwrapped
    inputs = env.batch.arrays.inputs
    for lag, expected in ((0.0, np.full(10, 2.5)), (0.02, 2.5 * (1.0 - np.exp(-np.arange(1, 11) / 20.0)))):
        env.reset(seed=SEED, options={"action_lag": lag})
        env.step(np.array([0.5], np.float32))
        np.testing.assert_allclose(inputs[0, :, env.task.action.input], expected, rtol=1e-12)
        assert env.batch.episodes["asked"][0] == pytest.approx(expected[-1])


def test_numba_takes_no_record_of_a_task_for_that_of_another():
    """A kernel that tasks share is compiled for each of their records, without a conversion and its warning."""
    kinds = set()
    for name in NAMES:
        task = tasks.task(name)
        values = [np.zeros(len(task.rewards) + len(task.costs)), np.zeros(len(task.metrics))]
        kinds |= {
            numba.typeof(definition.by_name(values[0][None], task.rewards)).dtype,
            numba.typeof(definition.by_name(values[0][None], task.costs, len(task.rewards))).dtype,
            numba.typeof(definition.by_name(values[1][None], task.metrics)).dtype,
        }
    assert len(kinds) > 10
    for one, other in itertools.permutations(kinds, 2):
        assert one.can_convert_to(None, other) is None
