"""What Gymnasium's own tests ask of its environments (test_envs), asked of ours."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

from steer_env.registration import DRIVEN, REGISTERED
from tests.steer_env.test_state import equal

IDS = tuple(REGISTERED)
SEED, STEPS = 0, 50


@pytest.mark.parametrize("name", IDS)
def test_the_checker_has_no_warning(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gym.spec(name).make(disable_env_checker=True).unwrapped
        check_env(env, skip_render_check=True)  # which tests/steer_env/test_render.py has
        env.close()


@pytest.mark.parametrize("name", IDS)
def test_two_rollouts_of_a_seed_are_the_same(name):
    """Observations, rewards, ends and infos with their types; sampled actions; membership in the space."""
    one, two = (gym.spec(name).make(disable_env_checker=True) for _ in range(2))
    first, again = one.reset(seed=SEED), two.reset(seed=SEED)
    assert equal(first, again)
    one.action_space.seed(SEED)
    for _ in range(STEPS if name in DRIVEN else 3):
        action = one.action_space.sample()
        a, b = one.step(action), two.step(action)
        assert equal(a, b)
        assert one.observation_space.contains(a[0])
        assert a[0].dtype == one.observation_space.dtype == np.float32
        assert [type(part) for part in a[1:4]] == [float, bool, bool]
        if name in DRIVEN or a[4]["margins"]["gain_db"] > 0.0:  # an unstable set of parameters has metrics of NaN
            assert data_equivalence(a[4], b[4], exact=True)
        if a[2] or a[3]:
            one.reset(seed=SEED)
            two.reset(seed=SEED)
