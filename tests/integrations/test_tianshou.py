"""tianshou: its vector of environments, what its collector stores, its returns, and a few updates by its PPO."""

import gymnasium as gym
import numpy as np
import pytest

from tests.integrations.recorded import GAMMA, LAMBDA, STEPS, check_both_ends, columns, made, returns

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


N = 2


def made_ppo(envs, **options):
    """PPO and a collector with a buffer, for a vector of single environments."""
    space, shape = envs.action_space[0], envs.observation_space[0].shape
    actor = ContinuousActorProbabilistic(
        preprocess_net=Net(state_shape=shape, hidden_sizes=(16,)), action_shape=space.shape, unbounded=True
    )
    policy = ProbabilisticActorPolicy(
        actor=actor,
        dist_fn=lambda of: torch.distributions.Independent(torch.distributions.Normal(*of), 1),
        action_space=space,
        action_scaling=False,  # from [-1, 1] to [-1, 1], which rounds
        action_bound_method="clip",
    )
    critic = ContinuousCritic(preprocess_net=Net(state_shape=shape, hidden_sizes=(16,)))
    algorithm = PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory(lr=1e-3), **options)
    collector = Collector(algorithm, envs, VectorReplayBuffer(1000, N))
    collector.reset()
    return algorithm, actor, collector


@pytest.mark.filterwarnings("ignore:action_scaling and action_bound_method")
def test_collected():
    torch.manual_seed(0)
    single = [made() for _ in range(N)]
    algorithm, actor, collector = made_ppo(
        DummyVectorEnv([lambda each=each: each for each in single]), gamma=GAMMA, gae_lambda=LAMBDA
    )
    with torch.no_grad():
        actor.sigma_param += 0.7
    collector.collect(n_step=STEPS)
    for buffer, env in zip(collector.buffer.buffers, single):
        kept, seen = buffer[:], columns(env.kept)
        np.testing.assert_array_equal(kept.obs, seen.observation)
        np.testing.assert_array_equal(np.clip(kept.act, -1.0, 1.0), seen.action)
        assert (np.abs(kept.act) > 1.0).any()
        np.testing.assert_array_equal(kept.rew, seen.reward)
        np.testing.assert_array_equal(kept.obs_next, seen.next_observation)
        np.testing.assert_array_equal(kept.terminated, seen.terminated)
        np.testing.assert_array_equal(kept.truncated, seen.truncated)
        np.testing.assert_array_equal(kept.info.cost, seen.cost)
    batch, rows = collector.buffer.sample(0)
    found = algorithm._add_returns_and_advantages(batch, collector.buffer, rows).returns.numpy()
    critic = lambda seen: algorithm.critic(seen).detach().numpy()[:, 0]  # noqa: E731
    np.testing.assert_allclose(found, np.concatenate([returns(env.kept, critic) for env in single]), atol=1e-5)
    check_both_ends([t for env in single for t in env.kept])


@pytest.mark.filterwarnings("ignore:action_scaling and action_bound_method")
def test_ppo():
    envs = DummyVectorEnv([lambda: gym.make(WEAVE, control_dt=0.1)] * N)
    algorithm, actor, collector = made_ppo(envs)
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
