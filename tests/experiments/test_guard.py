"""The guard around a trained assist: it lets slow steering with hands pass, and nothing without hands."""

import gymnasium as gym
import numpy as np
import pytest
import stable_baselines3  # noqa: F401, which the guard takes

from steer_env.experiments.learning.guard import Guard, GuardedVecEnv
from steer_env.sb3 import SteerVecEnv
from steer_env.tasks.assist_release import RELEASE_TIME

WEAVE, RELEASE = "steer_env/AssistWeave-v3", "steer_env/AssistRelease-v4"


def shares(env_id, seconds, action=0.2, friction=None, **options):
    """Share of a constant action that the guard lets act, at every step (T,)."""
    env = gym.make(env_id, friction=friction).unwrapped
    guard = Guard(env.batch, env.observation_scale, 1.0)
    observation, _ = env.reset(seed=0, options=options)
    given = np.full((1, 1), action, np.float32)
    found = []
    for _ in range(round(seconds / env.control_dt)):
        limited = guard.limited(observation[None], given)
        found.append(float(limited[0, 0]) / action)
        observation, *_ = env.step(limited[0])
    return np.array(found)


def test_slow_steering_with_hands_passes():
    assert shares(WEAVE, 10.0)[500:].mean() > 0.8


@pytest.mark.parametrize("friction", ["lugre", None], ids=["below the bar", "above it too"])
def test_without_hands_nothing_acts(friction):
    """The friction above the bar, 0.09 N m, twists it as light hands would."""
    # a release, which the controller is not told
    share = shares("steer_env/AssistAllRound-v3", 8.5, friction=friction, scenario=1)
    assert share.max() > 0.5  # while the robot holds the handwheel
    assert share[-200:].max() < 0.02
    assert (share >= 0.0).all()
    assert (share <= 1.0).all()


def test_the_guard_ends_where_a_return_is_asked_for():
    share = shares(RELEASE, 4.5)
    assert share[:100].min() < 0.1
    np.testing.assert_allclose(share[round(RELEASE_TIME / 0.01) + 1 :], 1.0, rtol=1e-6)


def test_the_training_steps_with_what_the_policy_will_do_later():
    """The environment of the training executes the guarded action, also after episodes that ended."""
    env = GuardedVecEnv(SteerVecEnv(WEAVE, 2, max_episode_steps=40), 1.0)
    alone = SteerVecEnv(WEAVE, 2, max_episode_steps=40)
    batch = alone.vector.unwrapped.batch
    guard = Guard(batch, alone.vector.unwrapped.observation_scale, 1.0)
    place = [quantity.name for quantity in batch.observed].index("last_action")
    for each in (env, alone):
        each.seed(3)
    one, two = env.reset(), alone.reset()
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(100):
        action = rng.uniform(-1.5, 1.5, (2, 1)).astype(np.float32)
        limited = guard.limited(two, action)
        assert (np.abs(limited) <= 1.0).all()
        one, _, done, _ = env.step(action)
        two, _, other, _ = alone.step(limited)
        guard.reset(other)
        assert np.array_equal(one, two)
        assert np.array_equal(done, other)
        ended += done.sum()
        if not done.any():
            assert np.array_equal(one[:, place], limited[:, 0])
    assert ended == 4
