"""TorchRL: its wrappers and its own check, what its collector gives, its returns, a few updates by its PPO loss."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from steer_env.registration import REGISTERED
from tests.integrations.recorded import (
    GAMMA,
    LAMBDA,
    STEPS,
    check_both_ends,
    columns,
    made,
    made_vector,
    returns,
)

torch = pytest.importorskip("torch")
pytest.importorskip("torchrl")

from tensordict.nn import TensorDictModule  # noqa: E402
from torchrl.data import LazyTensorStorage, ReplayBuffer  # noqa: E402
from torchrl.envs import GymEnv, GymWrapper, check_env_specs  # noqa: E402
from torchrl.modules import NormalParamExtractor, ProbabilisticActor, TanhNormal, ValueOperator  # noqa: E402
from torchrl.objectives import ClipPPOLoss  # noqa: E402
from torchrl.objectives.value import GAE  # noqa: E402

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # of TorchRL about itself
    from torchrl.collectors import Collector

WEAVE = "steer_env/AssistWeave-v3"


@pytest.mark.parametrize("env_id", REGISTERED)
def test_every_id_passes_the_check(env_id):
    env = GymEnv(env_id)
    check_env_specs(env)
    env.close()


def made_actor(size):
    """A policy of which the tangent hyperbolic keeps the actions within the bounds."""
    network = torch.nn.Sequential(torch.nn.Linear(size, 2), NormalParamExtractor())
    return ProbabilisticActor(
        TensorDictModule(network, in_keys=["observation"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        return_log_prob=True,
    )


def collect(env, twins):
    """What the collector gives of ``STEPS`` steps, as arrays (sub-environment, time, ...) of a replay buffer."""
    torch.manual_seed(0)
    for twin in twins:
        twin.kept.clear()  # of the steps by which TorchRL looks for the infos
    actor = made_actor(env.observation_spec["observation"].shape[-1])
    (data,) = Collector(env, actor, frames_per_batch=STEPS, total_frames=STEPS, auto_register_policy_transforms=False)
    buffer = ReplayBuffer(storage=LazyTensorStorage(STEPS, ndim=data.ndim))
    buffer.extend(data)
    found = buffer[:]
    return found if found.ndim == 2 else found[None]


def check_stored(found, twins):
    """Transitions and returns are the true ones."""
    value = ValueOperator(torch.nn.Linear(found["observation"].shape[-1], 1), in_keys=["observation"])
    with torch.no_grad():
        GAE(gamma=GAMMA, lmbda=LAMBDA, value_network=value)(found)
    for rows, twin in zip(found, twins):
        seen, kept = (
            columns(twin.kept),
            {name: rows[name].numpy() for name in ("observation", "action", "value_target")},
        )
        np.testing.assert_array_equal(kept["observation"], seen.observation)
        np.testing.assert_array_equal(kept["action"], seen.action)
        for name, true in (
            ("reward", seen.reward.astype("f4")),
            ("terminated", seen.terminated),
            ("truncated", seen.truncated),
            ("done", seen.terminated | seen.truncated),
        ):
            np.testing.assert_array_equal(rows["next", name][:, 0].numpy(), true)
        np.testing.assert_array_equal(rows["next", "observation"].numpy(), seen.next_observation)
        target = returns(twin.kept, lambda of: value.module(torch.as_tensor(of)).detach().numpy()[:, 0])
        np.testing.assert_allclose(kept["value_target"][:, 0], target, atol=1e-5)
    check_both_ends([t for twin in twins for t in twin.kept])


def test_collected_of_a_single_environment():
    env = made()
    env.reset(seed=0)
    check_stored(collect(GymWrapper(env), [env]), [env])


@pytest.mark.parametrize(
    ("mode", "infos"), [(AutoresetMode.DISABLED, {}), (AutoresetMode.SAME_STEP, {"info_level": "none"})]
)
def test_collected_of_a_vector_environment(mode, infos):
    envs = made_vector(2, mode, **infos)
    check_stored(collect(GymWrapper(envs), envs.twins), envs.twins)


@pytest.mark.xfail(reason="TorchRL 0.14 makes no specification of infos that hold dictionaries", strict=True)
def test_same_step_mode():
    GymWrapper(gym.make_vec(WEAVE, num_envs=3, autoreset_mode=AutoresetMode.SAME_STEP))


def test_ppo():
    env = GymEnv(WEAVE)
    size = env.observation_spec["observation"].shape[-1]
    actor = made_actor(size)
    value = ValueOperator(torch.nn.Linear(size, 1), in_keys=["observation"])
    loss, advantage = ClipPPOLoss(actor, value), GAE(gamma=0.98, lmbda=0.95, value_network=value)
    optimizer, before = torch.optim.Adam(loss.parameters(), 1e-3), [p.clone() for p in actor.parameters()]
    for _ in range(2):
        with torch.no_grad():
            data = env.rollout(64, actor)
        advantage(data)
        found = loss(data)
        optimizer.zero_grad()
        sum(found[key] for key in ("loss_objective", "loss_critic", "loss_entropy")).backward()
        optimizer.step()
    assert torch.isfinite(found["loss_objective"])
    assert any((one != other).any() for one, other in zip(before, actor.parameters()))
    env.close()
