"""The adapter for Stable-Baselines3: what its wrappers, callbacks and algorithms expect."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import EvalCallback
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecCheckNan, VecFrameStack, VecMonitor, VecNormalize, VecVideoRecorder

from steer_env import sb3
from steer_env.sb3 import SteerVecEnv
from tests.steer_env.test_state import equal

WEAVE = "steer_env/AssistWeave-v3"
TUNE = "steer_env/TuneOnCentre-v3"


def to_the_end(env, action):
    """Steps until an episode ends: the last observations before, and what that step gave."""
    env.reset()
    for _ in range(10_000):
        result = env.step(action)
        if result[2].any():
            return result
    raise AssertionError


def test_a_truncated_episode_tells_its_last_observation_and_the_time_limit():
    env = SteerVecEnv(WEAVE, 2, control_dt=0.1)
    env.seed(3)
    observations, _, done, infos = to_the_end(env, np.zeros((2, 1), np.float32))
    assert done.all()
    single = gym.make(WEAVE, control_dt=0.1)
    single.reset(seed=4)
    for _ in range(200):
        last, *_, info = single.step(np.zeros(1, np.float32))
    assert np.array_equal(infos[1]["terminal_observation"], last)
    assert infos[1]["TimeLimit.truncated"] is True
    assert {key: infos[1][key] for key in info} == info
    assert set(infos[1]) - set(info) == {"terminal_observation", "TimeLimit.truncated"}
    assert np.array_equal(observations[1], single.reset()[0])


def test_a_terminated_episode_is_no_time_limit():
    env = SteerVecEnv("steer_env/DriverLaneKeeping-v3", 1)
    *_, infos = to_the_end(env, np.full((1, 1), 0.5, np.float32))
    assert infos[0]["TimeLimit.truncated"] is False


def test_every_info_has_cost_and_failure_and_that_of_a_reset_is_whole():
    env = SteerVecEnv("steer_env/DriverLaneKeeping-v3", 2)
    env.seed(3)
    env.reset()
    single = gym.make("steer_env/DriverLaneKeeping-v3")
    assert equal(env.reset_infos[1], single.reset(seed=4)[1])
    for _ in range(10):
        *_, infos = env.step(np.zeros((2, 1), np.float32))
        *_, info = single.step(np.zeros(1, np.float32))
        assert infos[1] == {key: info[key] for key in ("cost", "failure")}
    *_, infos = to_the_end(env, np.full((2, 1), 0.5, np.float32))
    failures = [info["failure"] for info in infos]
    assert max(failures) == 1
    assert env.get_attr("cost_limit") == [1.0, 1.0]


def test_pictures_reach_its_video_recorder(tmp_path):
    env = SteerVecEnv(WEAVE, 3, render_mode="rgb_array")
    env.reset()
    frames = env.get_images()
    assert [frame.shape for frame in frames] == [(540, 960, 3)] * 3
    assert env.render().shape == (2 * 540, 2 * 960, 3)  # a mosaic
    assert env.metadata["render_fps"] == 100.0
    pytest.importorskip("moviepy")
    recorded = VecVideoRecorder(env, str(tmp_path), lambda step: step == 0, video_length=20)
    recorded.reset()
    for _ in range(21):
        recorded.step(np.zeros((3, 1), np.float32))
    assert recorded.frames_per_sec == 100.0
    assert list(tmp_path.glob("*.mp4"))


def test_reset_options_reach_every_sub_environment():
    env = SteerVecEnv(WEAVE, 2)
    env.set_options({"amplitude": 0.1})
    env.reset()
    for _ in range(1000):
        env.step(np.zeros((2, 1), np.float32))
    assert np.abs(env.vector.batch.arrays.channels[:, 0]).max() <= 0.1 + 1e-9
    env.set_options([{"amplitude": 0.1}, {"amplitude": 0.2}])
    with pytest.raises(ValueError, match="share their reset options"):
        env.reset()


def test_what_is_refused():
    with pytest.raises(ValueError, match=r"env_id must be one of .*got 'CartPole-v1'"):
        SteerVecEnv("CartPole-v1", 2)
    with pytest.raises(ValueError, match="vector_reward must be False for Stable-Baselines3"):
        SteerVecEnv(TUNE, 2, vector_reward=True)
    for level in ("metrics", "none"):
        with pytest.raises(ValueError, match=f"info_level must be 'full' for Stable-Baselines3, .*, got '{level}'"):
            SteerVecEnv(WEAVE, 2, info_level=level)


def test_wrappers_callbacks_and_an_algorithm_work_around_it(tmp_path):
    """A short PPO with every usual wrapper; the monitor's returns are the environment's."""
    env = VecNormalize(VecMonitor(VecCheckNan(SteerVecEnv(WEAVE, 4, control_dt=0.1), raise_exception=True)))
    trial = VecNormalize(
        VecMonitor(VecCheckNan(SteerVecEnv(WEAVE, 2, control_dt=0.1))), training=False, norm_reward=False
    )
    watched = EvalCallback(trial, eval_freq=100, n_eval_episodes=2, log_path=str(tmp_path), verbose=0)
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=1, device="cpu", seed=0)
    model.learn(512, callback=watched)
    assert np.isfinite(watched.last_mean_reward)
    rewards, lengths = evaluate_policy(model, trial, n_eval_episodes=2, return_episode_rewards=True)
    assert lengths == [200, 200]
    assert all(np.isfinite(rewards))
    stacked = VecFrameStack(SteerVecEnv(WEAVE, 2), 3)
    assert stacked.reset().shape == (2, 3 * 9)


def test_what_sub_environments_cannot_do_is_refused():
    env = SteerVecEnv(WEAVE, 2)
    assert env.get_attr("control_dt") == [0.01, 0.01]
    assert env.env_is_wrapped(gym.Wrapper) == [False, False]
    with pytest.raises(NotImplementedError, match="no method 'shout'"):
        env.env_method("shout")
    with pytest.raises(ValueError, match="share 'control_dt'"):
        env.set_attr("control_dt", 0.02, indices=[0])
    with pytest.raises(ValueError, match="must be finite"):
        env.step(np.array([[np.nan], [0.0]], np.float32))
    env.close()


@pytest.mark.parametrize(("times", "told"), [((0.1, 0.001), True), ((0.002, 0.001), False)])
def test_threads_that_starve_a_small_network_are_told_once(times, told, monkeypatch):
    left = iter(times)
    monkeypatch.setattr(sb3, "_layers_time", lambda: next(left))
    sb3._look_at_threads.cache_clear()
    threads = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            env = SteerVecEnv(WEAVE, 1)
            env.reset()
            for _ in range(2):
                env.step(np.zeros((1, 1), np.float32))
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)
    found = [str(each.message) for each in caught if "torch.set_num_threads(1)" in str(each.message)]
    assert len(found) == told
    assert all("in 2 threads" in text and "100 ms" in text for text in found)


def test_a_look_at_the_threads_draws_nothing_and_takes_a_time():
    before = torch.get_rng_state()
    assert 0.0 < sb3._layers_time() < 10.0
    assert torch.equal(before, torch.get_rng_state())
