"""RLlib: what its runner of environments gives. Its pin of Gymnasium excludes ours, so that it has its own environment.

pip install torch 'ray[rllib]==2.60.0' pytest numba scipy control lazy_loader jinja2 plotly rich platformdirs joblib
"""

import numpy as np
import pytest

from tests.integrations.recorded import STEPS, check_both_ends, columns, episodes, made
from tests.needs import needs

pytestmark = needs("ray")


@pytest.mark.filterwarnings("ignore")
def test_collected():
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.env.single_agent_env_runner import SingleAgentEnvRunner
    from ray.tune.registry import register_env

    kept = []

    def make(_):
        kept.append(made())
        return kept[-1]

    register_env("steering", make)
    config = PPOConfig().environment("steering").framework("torch")
    config = config.env_runners(num_env_runners=0, num_envs_per_env_runner=2, rollout_fragment_length=STEPS // 2)
    found = SingleAgentEnvRunner(config=config).sample(num_timesteps=STEPS, random_actions=True)
    true = [columns(episode) for env in kept for episode in episodes(env.kept)]
    assert sum(len(episode) for episode in found) == sum(len(env.kept) for env in kept) >= STEPS
    for stored in found:
        (seen,) = (each for each in true if np.array_equal(each.reward, stored.get_rewards()))
        np.testing.assert_array_equal(stored.get_observations()[:-1], seen.observation)
        np.testing.assert_array_equal(stored.get_observations()[-1], seen.next_observation[-1])
        np.testing.assert_array_equal(stored.get_actions(), seen.action)
        np.testing.assert_array_equal([info["cost"] for info in stored.get_infos()[1:]], seen.cost)
        assert (stored.is_terminated, stored.is_truncated) == (seen.terminated[-1], seen.truncated[-1])
    check_both_ends([transition for env in kept for transition in env.kept])
