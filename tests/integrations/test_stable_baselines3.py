"""Stable-Baselines3 and sb3-contrib: the check, and what their buffers hold of single environments and our adapter."""

from copy import deepcopy

import gymnasium as gym
import numpy as np
import pytest

from steer_env.registration import DRIVEN
from tests.integrations.recorded import (
    GAMMA,
    ID,
    LAMBDA,
    MADE,
    STEPS,
    RecordedVector,
    check_both_ends,
    columns,
    made,
    returns,
)

torch = pytest.importorskip("torch")
stable_baselines3 = pytest.importorskip("stable_baselines3")
sb3_contrib = pytest.importorskip("sb3_contrib")

from stable_baselines3.common.callbacks import BaseCallback  # noqa: E402
from stable_baselines3.common.env_checker import check_env  # noqa: E402
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize  # noqa: E402

from steer_env.sb3 import SteerVecEnv  # noqa: E402

N = 2
KINDS = ["of single ones", "own vector"]
ON_POLICY = {"MlpPolicy": stable_baselines3.PPO, "MlpLstmPolicy": sb3_contrib.RecurrentPPO}
OFF_POLICY = [stable_baselines3.SAC, sb3_contrib.TQC]


@pytest.mark.parametrize("env_id", DRIVEN)
def test_its_check(env_id):
    check_env(gym.make(env_id).unwrapped)


def made_vector(kind):
    """The environments, and what keeps the transitions of each."""
    if kind == "own vector":
        envs = SteerVecEnv(ID, N, **MADE)
        envs.vector = RecordedVector(envs.vector)
        return envs, envs.vector.twins
    envs = DummyVecEnv([made] * N)
    return envs, envs.envs


class Filled(BaseCallback):
    """A copy of the buffer when it is full, before the learner reorders it."""

    def _on_rollout_end(self):
        self.buffer = deepcopy(self.model.rollout_buffer)

    def _on_step(self):
        return True


def values_of(policy):
    """Values of the observations of an episode, by the recurrent policy from a state of zeros on."""

    def value(observations):
        given = torch.as_tensor(observations)
        with torch.no_grad():
            if not hasattr(policy, "lstm_critic"):
                return policy.predict_values(given).numpy()[:, 0]
            hidden, _ = policy.lstm_critic(policy.extract_features(given)[:, None])
            return policy.value_net(policy.mlp_extractor.forward_critic(hidden[:, 0])).numpy()[:, 0]

    return value


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ON_POLICY)
def test_rollout_buffer(name, kind):
    envs, kept = made_vector(kind)
    arguments = {"gamma": GAMMA, "gae_lambda": LAMBDA, "learning_rate": 0.0, "n_epochs": 1, "batch_size": 50, "seed": 0}
    model = ON_POLICY[name](name, envs, n_steps=STEPS // N, policy_kwargs={"log_std_init": 0.7}, **arguments)
    filled = Filled()
    model.learn(STEPS, callback=filled)
    for i, transitions in enumerate(each.kept for each in kept):
        buffer, seen = filled.buffer, columns(transitions)
        np.testing.assert_array_equal(buffer.observations[:, i], seen.observation)
        np.testing.assert_array_equal(np.clip(buffer.actions[:, i], -1.0, 1.0), seen.action)
        assert (np.abs(buffer.actions[:, i]) > 1.0).any()
        np.testing.assert_array_equal(buffer.episode_starts[1:, i], (seen.terminated | seen.truncated)[:-1])
        # The reward of a truncated step has the value of the last observation in it, so that the returns are right.
        truncated = seen.truncated & ~seen.terminated
        np.testing.assert_array_equal(buffer.rewards[~truncated, i], seen.reward[~truncated].astype("f4"))
        assert (buffer.rewards[truncated, i] != seen.reward[truncated].astype("f4")).all()
        np.testing.assert_allclose(buffer.returns[:, i], returns(transitions, values_of(model.policy)), atol=1e-5)
    check_both_ends([t for each in kept for t in each.kept])
    envs.close()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_replay_buffer(algorithm, kind):
    envs, kept = made_vector(kind)
    model = algorithm("MlpPolicy", envs, learning_starts=STEPS, seed=0)
    model.learn(STEPS)
    for i, transitions in enumerate(each.kept for each in kept):
        seen, buffer = columns(transitions), model.replay_buffer
        for stored, true in (
            (buffer.observations, seen.observation),
            (buffer.actions, seen.action),
            (buffer.rewards, seen.reward.astype("f4")),
            (buffer.next_observations, seen.next_observation),
            (buffer.dones, seen.terminated | seen.truncated),
            (buffer.timeouts, seen.truncated & ~seen.terminated),
        ):
            np.testing.assert_array_equal(stored[: STEPS // N, i], true)
    check_both_ends([t for each in kept for t in each.kept])
    envs.close()


@pytest.mark.parametrize("clip", [10.0, 0.5])
def test_normalised_observations(clip):
    """``VecNormalize`` clips the last one before the buffer takes it back: by default ten standard deviations away."""
    envs, (kept, _) = made_vector("of single ones")
    model = stable_baselines3.SAC("MlpPolicy", VecNormalize(envs, clip_obs=clip), learning_starts=STEPS, seed=0)
    model.learn(STEPS)
    seen = columns(kept.kept)
    ended = seen.terminated | seen.truncated
    error = np.abs(model.replay_buffer.next_observations[: STEPS // N, 0] - seen.next_observation).max(axis=1)
    assert (error[~ended] == 0.0).all()
    assert (error[ended] < 1e-5).all() if clip == 10.0 else (error[ended] > 0.1).all()


@pytest.mark.parametrize("kind", KINDS)
def test_ppo(kind):
    envs, _ = made_vector(kind)
    model = stable_baselines3.PPO("MlpPolicy", VecNormalize(VecMonitor(envs)), n_steps=32, batch_size=32, device="cpu")
    before = model.policy.action_net.weight.clone()
    model.learn(128)
    assert (model.policy.action_net.weight != before).any()
    envs.close()
