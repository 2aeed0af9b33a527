"""The vector environments of the tuning ids beside Gymnasium's own of the single ones, and rewards in components."""

import json
import os
import pickle
import signal
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode
from joblib.externals.loky import get_reusable_executor

from steer_env import manoeuvres, metrics
from steer_env.recording.recording import Recording
from steer_env.registration import TUNED
from steer_env.tuning import reward
from steer_env.vehicle import cars
from tests.steer_env.test_state import equal

ALL_ROUND, ON_CENTRE = TUNED
DRAWN = {"load": (0, 300), "speed": (20, 40), "friction": {"F_c": (0.6, 1.2)}}
MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED]


def run(vector, steps, mask=None):
    """Everything that a seeded run gives."""
    rng = np.random.default_rng(0)
    found = [vector.reset(seed=3)]
    for _ in range(steps):
        actions = rng.uniform(-0.5, 0.5, vector.action_space.shape).astype(np.float32)
        found.append(vector.step(actions))
        ended = found[-1][3]
        if mask is not None and ended.any():
            found.append(vector.reset(options={"reset_mask": ended & mask}))
            found.append(vector.reset(options={"reset_mask": ~mask}))
    return tuple(found)


@pytest.mark.whole
@pytest.mark.parametrize("mode", MODES)
def test_equals_gymnasiums_own_vector_of_single_ones(mode):
    mask = np.array([True, False, False]) if mode == AutoresetMode.DISABLED else None
    own = gym.make_vec(ON_CENTRE, 3, autoreset_mode=mode, workers=1, sets=2, randomise=DRAWN)
    sync = gym.make_vec(ON_CENTRE, 3, "sync", vector_kwargs={"autoreset_mode": mode}, sets=2, randomise=DRAWN)
    assert type(own).__name__ == "TuneOnCentreVector"
    for one, other in zip(run(own, 5, mask), run(sync, 5, mask), strict=True):
        assert equal(one, other)
    assert own.metadata["autoreset_mode"] is mode
    assert [g.bit_generator.state for g in own.np_random] == [g.bit_generator.state for g in sync.np_random]


def processes():
    """Process ids of the workers."""
    return list(get_reusable_executor(reuse=True)._processes)


@pytest.mark.whole
def test_worker_processes_give_the_same_also_after_one_is_killed():
    one, two = (gym.make_vec(ON_CENTRE, 4, workers=n, sets=2, randomise=DRAWN) for n in (1, 2))
    first, other = run(one, 2), run(two, 2)
    assert equal(first, other)
    for process in processes():
        os.kill(process, signal.SIGKILL)
    actions = np.full(two.action_space.shape, 0.1, np.float32)
    for _ in range(2):  # a reset, and a set in the contexts that new workers prepare again
        assert equal(one.step(actions), two.step(actions))
    assert len(processes()) == 2
    two.close()
    assert not processes()


def test_sub_environments_that_draw_nothing_share_one_context():
    vector = gym.make_vec(ALL_ROUND, 3, workers=1, detuning=0.0)
    vector.reset(seed=0)
    assert len({id(each) for each in vector._contexts}) == 1
    assert len(vector._workers._kept) == 1
    *_, info = vector.step(np.zeros(vector.action_space.shape, np.float32))
    assert len(set(info["margins"]["phase_deg"].tolist())) == 1
    assert np.array_equal(vector.envs[1].best_action, np.zeros(7, np.float32))
    assert vector.envs[2].tuned_car(vector.envs[2].best_action).name == "compact_tuned"


def test_number_of_sets_is_an_argument():
    env = gym.make(ON_CENTRE, sets=None).unwrapped
    env.reset(seed=0)
    assert not any(env.step(env.baseline_action)[3] for _ in range(10))
    for arguments in ({"sets": 1}, {"max_episode_steps": 1}, {"sets": None, "max_episode_steps": 1}):
        vector = gym.make_vec(ON_CENTRE, 2, workers=1, **arguments)
        vector.reset(seed=0)
        assert vector.step(np.zeros((2, 8), np.float32))[3].all(), arguments
    for wrong in (0, -1, 2.5):
        with pytest.raises(ValueError, match="sets must be a whole number"):
            gym.make(ON_CENTRE, sets=wrong)


def test_make_vec_has_no_warning_and_its_specification_makes_it_again():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        vector = gym.make_vec(ON_CENTRE, 2, workers=1, randomise=DRAWN, sets=3, max_episode_steps=50)
    text = vector.spec.to_json()
    assert json.loads(text)["kwargs"]["sets"] == 3
    again = gym.make_vec(EnvSpec.from_json(text))
    copied = pickle.loads(pickle.dumps(vector))
    assert equal(run(vector, 2), run(again, 2))
    assert equal(vector.step(np.zeros((2, 8), np.float32)), again.step(np.zeros((2, 8), np.float32)))
    assert equal(run(vector, 2), run(copied, 2))


@pytest.mark.parametrize(
    "arguments", [{"num_envs": 0}, {"num_envs": 2, "workers": 0}, {"num_envs": 2, "max_episode_steps": 0}]
)
def test_bad_arguments(arguments):
    with pytest.raises(ValueError, match=f"{[*arguments][-1]} must be a whole number of at least 1"):
        gym.make_vec(ON_CENTRE, **arguments)


def test_bad_calls():
    vector = gym.make_vec(ON_CENTRE, 2, workers=1, sets=1, autoreset_mode="Disabled")
    zero = np.zeros((2, 8), np.float32)
    with pytest.raises(RuntimeError, match="an episode is over or has not begun: call reset"):
        vector.step(zero)
    with pytest.raises(ValueError, match=r"seed must be a number or 2 of them, got 3"):
        vector.reset(seed=[1, 2, 3])
    with pytest.raises(ValueError, match="reset_mask must be a boolean array"):
        vector.reset(options={"reset_mask": np.zeros(2, bool)})
    with pytest.raises(ValueError, match="unknown reset option 'sensor_noise'"):
        vector.reset(options={"sensor_noise": 1.0})
    vector.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions must be an array of shape \(2, 8\)"):
        vector.step(zero[0])
    with pytest.raises(ValueError, match="got nan"):
        vector.step(zero + np.nan)
    vector.step(zero)
    with pytest.raises(RuntimeError, match="call reset"):
        vector.step(zero)


def test_rewards_in_components_add_up_to_the_reward():
    """In the form of MO-Gymnasium: an array of float32 in ``reward_space``, (num_envs, reward_dim) of a vector."""
    env = gym.make(ON_CENTRE, vector_reward=True, disable_env_checker=True, weights={"yaw_lag": 2.0}, detuning=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # as of Gymnasium's checker
        env.reset(seed=0)
        env.step(env.unwrapped.baseline_action)
    env = env.unwrapped
    plain = gym.make(ON_CENTRE, weights={"yaw_lag": 2.0}, detuning=0.0).unwrapped
    assert not hasattr(plain, "reward_space")
    assert env.reward_components == (*(name for name in env.terms if env.terms[name].weight), *reward.MARGIN_TERMS)
    assert "yaw_lag" in env.reward_components
    assert "yaw_rate_gain" not in env.reward_components  # weighs nothing
    tried = np.full(8, 0.1, np.float32)
    for each in (env, plain):
        each.reset(seed=0)
    given, (_, total, *_, info) = env.step(tried)[1], plain.step(tried)
    assert given.shape == (env.reward_dim,) == env.reward_space.shape
    assert env.reward_space.contains(given)
    assert given.tolist() == [np.float32(info["reward_terms"][name]) for name in env.reward_components]
    assert given.sum() == pytest.approx(total, rel=1e-6)
    assert 0.0 in given
    assert not np.signbit(given[given == 0.0]).any()
    assert not any(np.signbit(x) for x in info["reward_terms"].values() if x == 0.0)
    vector = gym.make_vec(ON_CENTRE, 2, workers=1, vector_reward=True, weights={"yaw_lag": 2.0}, detuning=0.0)
    vector.reset(seed=0)
    _, rewards, *_ = vector.step(np.tile(tried, (2, 1)))
    assert rewards.dtype == np.float32
    assert np.array_equal(rewards, [given, given])
    assert vector.reward_space == env.reward_space
    assert vector.reward_components == env.reward_components


@pytest.mark.parametrize("test", ["weave", "step-steer"])
def test_without_intervals_a_metric_is_the_same(test):
    recording: Recording = manoeuvres.drive(cars.load(), manoeuvres.make(test))
    whole, quick = metrics.evaluate(recording), metrics.evaluate(recording, intervals=False)
    assert {name: value[0] for name, value in whole.items()} == {name: value[0] for name, value in quick.items()}
    assert [value.reason for value in whole.values()] == [value.reason for value in quick.values()]
    assert all(np.isnan(value.low) and np.isnan(value.high) for value in quick.values())
    assert not np.isnan(whole["torque_at_0g" if test == "weave" else "steady_step_torque"].low)
