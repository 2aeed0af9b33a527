"""What Gymnasium's own tests ask of its environments (test_envs), asked of ours."""

import warnings

import gymnasium as gym
import pytest
from gymnasium.utils.env_checker import check_env

from steer_env.registration import REGISTERED

IDS = tuple(REGISTERED)


@pytest.mark.parametrize("name", IDS)
def test_the_checker_has_no_warning(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gym.spec(name).make(disable_env_checker=True).unwrapped
        check_env(env, skip_render_check=True)  # which tests/steer_env/test_render.py has
        env.close()
