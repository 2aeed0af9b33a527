"""Stable-Baselines3: its own check, its wrappers around single environments, and this package's vector adapter."""

import gymnasium as gym
import pytest

from steer_env.registration import DRIVEN

stable_baselines3 = pytest.importorskip("stable_baselines3")

from stable_baselines3.common.env_checker import check_env  # noqa: E402
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize  # noqa: E402

WEAVE = "steer_env/AssistWeave-v3"


@pytest.mark.parametrize("env_id", DRIVEN)
def test_its_check(env_id):
    check_env(gym.make(env_id).unwrapped)


@pytest.mark.parametrize("kind", ["of single ones", "own vector"])
def test_ppo(kind):
    from steer_env.sb3 import SteerVecEnv

    if kind == "own vector":
        envs = SteerVecEnv(WEAVE, 2)
    else:
        envs = DummyVecEnv([lambda: gym.make(WEAVE)] * 2)
    model = stable_baselines3.PPO("MlpPolicy", VecNormalize(VecMonitor(envs)), n_steps=32, batch_size=32, device="cpu")
    before = model.policy.action_net.weight.clone()
    model.learn(128)
    assert (model.policy.action_net.weight != before).any()
    envs.close()
