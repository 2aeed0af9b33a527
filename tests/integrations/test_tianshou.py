"""tianshou: its vector of environments, its collector, and a few updates by its PPO."""

import gymnasium as gym
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("tianshou")

from tianshou.algorithm import PPO  # noqa: E402
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy  # noqa: E402
from tianshou.algorithm.optim import AdamOptimizerFactory  # noqa: E402
from tianshou.data import Collector, VectorReplayBuffer  # noqa: E402
from tianshou.env import DummyVectorEnv  # noqa: E402
from tianshou.trainer import OnPolicyTrainerParams  # noqa: E402
from tianshou.utils.net.common import Net  # noqa: E402
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic  # noqa: E402

WEAVE = "steer_env/AssistWeave-v3"


@pytest.mark.filterwarnings("ignore:action_scaling and action_bound_method")
def test_ppo():
    envs = DummyVectorEnv([lambda: gym.make(WEAVE, control_dt=0.1)] * 2)
    space, shape = envs.action_space[0], envs.observation_space[0].shape
    actor = ContinuousActorProbabilistic(
        preprocess_net=Net(state_shape=shape, hidden_sizes=(16,)), action_shape=space.shape, unbounded=True
    )
    policy = ProbabilisticActorPolicy(
        actor=actor,
        dist_fn=lambda of: torch.distributions.Independent(torch.distributions.Normal(*of), 1),
        action_space=space,
        action_bound_method="clip",
    )
    critic = ContinuousCritic(preprocess_net=Net(state_shape=shape, hidden_sizes=(16,)))
    algorithm = PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory(lr=1e-3))
    collector = Collector(algorithm, envs, VectorReplayBuffer(1000, 2))
    collector.reset()
    before = [parameter.clone() for parameter in actor.parameters()]
    params = OnPolicyTrainerParams(
        training_collector=collector,
        test_collector=None,
        max_epochs=1,
        epoch_num_steps=512,
        collection_step_num_env_steps=256,
        update_step_num_repetitions=2,
        batch_size=64,
        test_step_num_episodes=0,
        test_in_training=False,
    )
    found = algorithm.run_training(params)
    assert found.train_step == 512
    assert found.train_episode == 2  # of 20 s, one in each environment
    after = list(actor.parameters())
    assert all(torch.isfinite(parameter).all() for parameter in after)
    assert any((one != other).any() for one, other in zip(before, after))
