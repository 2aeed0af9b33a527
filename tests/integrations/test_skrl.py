"""skrl: what its memory holds of single and vector environments, its returns, and a few updates by its PPO."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from tests.integrations.recorded import (
    GAMMA,
    LAMBDA,
    STEPS,
    check_both_ends,
    columns,
    episodes,
    made,
    made_vector,
    returns,
)

torch = pytest.importorskip("torch")
pytest.importorskip("skrl")

from skrl.agents.torch.ppo import PPO, PPO_CFG  # noqa: E402
from skrl.agents.torch.sac import SAC, SAC_CFG  # noqa: E402
from skrl.envs.wrappers.torch import wrap_env  # noqa: E402
from skrl.memories.torch import RandomMemory  # noqa: E402
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model  # noqa: E402
from skrl.trainers.torch import SequentialTrainer  # noqa: E402

WEAVE = "steer_env/AssistWeave-v3"
N = 2


class Policy(GaussianMixin, Model):
    def __init__(self, **spaces):
        Model.__init__(self, **spaces)
        GaussianMixin.__init__(self)
        self.network = torch.nn.Linear(self.num_observations, self.num_actions)
        self.log_std = torch.nn.Parameter(0.7 * torch.ones(self.num_actions))

    def compute(self, inputs, role):
        return self.network(inputs["observations"]), {"log_std": self.log_std}


class Value(DeterministicMixin, Model):
    def __init__(self, of_actions=False, **spaces):
        Model.__init__(self, **spaces)
        DeterministicMixin.__init__(self)
        self.network = torch.nn.Linear(self.num_observations + of_actions * self.num_actions, 1)

    def compute(self, inputs, role):
        given = [inputs[key] for key in ("observations", "taken_actions") if inputs.get(key) is not None]
        return self.network(torch.cat(given[: 1 + (self.network.in_features > self.num_observations)], dim=-1)), {}


def settings(cfg, folder):
    cfg.experiment.directory, cfg.experiment.write_interval, cfg.experiment.checkpoint_interval = str(folder), 0, 0
    return cfg


def train(agent, env, steps):
    arguments = {"timesteps": steps, "headless": True, "disable_progressbar": True, "close_environment_at_exit": False}
    SequentialTrainer(env=env, agents=agent, cfg=arguments).train()


def collect_on_policy(made, folder, **options):
    """The memory and the value network of PPO after one rollout, without a step of learning."""
    # The kind of a vector environment is named, as skrl recognises those of Gymnasium's own classes alone.
    env = wrap_env(made, wrapper="gymnasium")
    rollout = STEPS // env.num_envs
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space, "device": env.device}
    torch.manual_seed(0)
    models = {"policy": Policy(**spaces), "value": Value(**spaces)}
    cfg = PPO_CFG(
        rollouts=rollout, learning_rate=0.0, discount_factor=GAMMA, gae_lambda=LAMBDA, value_clip=0.0, **options
    )
    memory = RandomMemory(memory_size=rollout, num_envs=env.num_envs)
    train(PPO(models=models, memory=memory, cfg=settings(cfg, folder), **spaces), env, rollout)
    network = models["value"].network
    return memory, lambda observations: network(torch.as_tensor(observations)).detach().numpy()[:, 0]


def stored(memory, name, i):
    return memory.get_tensor_by_name(name)[:, i].numpy().astype("f8")


def test_rollout_of_a_single_environment(tmp_path):
    env = made()
    memory, value = collect_on_policy(env, tmp_path, time_limit_bootstrap=True)
    seen, actions = columns(env.kept), stored(memory, "actions", 0)
    np.testing.assert_array_equal(stored(memory, "observations", 0), seen.observation)
    np.testing.assert_array_equal(actions, seen.action)  # not clipped, also not for the environment, which does it
    assert (np.abs(actions) > 1.0).any()
    np.testing.assert_array_equal(stored(memory, "terminated", 0)[:, 0], seen.terminated)
    np.testing.assert_array_equal(stored(memory, "truncated", 0)[:, 0], seen.truncated)
    np.testing.assert_allclose(stored(memory, "returns", 0)[:, 0], returns(env.kept, value), atol=1e-5)
    check_both_ends(env.kept)


def test_by_default_a_return_runs_over_a_truncation(tmp_path):
    """The reward of the next episode and its values are in the returns of the one that was truncated."""
    env = made()
    memory, value = collect_on_policy(env, tmp_path)
    error = np.abs(stored(memory, "returns", 0)[:, 0] - returns(env.kept, value))
    runs_on = [episode[-1].truncated for episode in episodes(env.kept) for _ in episode]
    assert error[: len(runs_on)][np.array(runs_on)].min() > 1e-2
    assert np.delete(error, np.flatnonzero(runs_on)).max() < 1e-5


def test_rollout_of_a_vector_environment(tmp_path):
    """In NEXT_STEP mode all is right but one row behind each episode: the step that resets, of reward 0."""
    envs = made_vector(N, AutoresetMode.NEXT_STEP)
    memory, value = collect_on_policy(envs, tmp_path, time_limit_bootstrap=True)
    for i, twin in enumerate(envs.twins):
        ended = (stored(memory, "terminated", i) + stored(memory, "truncated", i))[:, 0] > 0.0
        resets = np.concatenate([[False], ended[:-1]])
        seen = columns(twin.kept)
        assert resets.sum() == len(episodes(twin.kept)) - 1
        assert (stored(memory, "rewards", i)[resets] == 0.0).all()
        np.testing.assert_array_equal(stored(memory, "observations", i)[~resets], seen.observation)
        np.testing.assert_array_equal(stored(memory, "actions", i)[~resets], seen.action)
        np.testing.assert_allclose(stored(memory, "returns", i)[~resets, 0], returns(twin.kept, value), atol=1e-5)
    check_both_ends([t for twin in envs.twins for t in twin.kept])


def test_in_same_step_mode_a_truncation_takes_the_value_of_the_next_episode(tmp_path):
    envs = made_vector(N, AutoresetMode.SAME_STEP)
    memory, value = collect_on_policy(envs, tmp_path, time_limit_bootstrap=True)
    for i, twin in enumerate(envs.twins):
        seen = columns(twin.kept)
        np.testing.assert_array_equal(stored(memory, "observations", i), seen.observation)
        error = np.abs(stored(memory, "returns", i)[:, 0] - returns(twin.kept, value))
        truncated = seen.truncated & ~seen.terminated
        assert (error[truncated] > 1e-3).all()
        assert (error[seen.terminated] < 1e-5).all()


@pytest.mark.parametrize("kind", ["single", "vector"])
def test_replay_memory(kind, tmp_path):
    """Single environments are stored as they are; a vector one with the step that resets, which has no flag."""
    env = made() if kind == "single" else made_vector(N, AutoresetMode.NEXT_STEP)
    twins = [env] if kind == "single" else env.twins
    wrapped = wrap_env(env, wrapper="gymnasium")
    spaces = {key: getattr(wrapped, key) for key in ("observation_space", "action_space", "device")}
    critics = ("critic_1", "critic_2", "target_critic_1", "target_critic_2")
    models = {"policy": Policy(**spaces), **{name: Value(of_actions=True, **spaces) for name in critics}}
    memory = RandomMemory(memory_size=STEPS, num_envs=wrapped.num_envs)
    cfg = settings(SAC_CFG(learning_starts=STEPS), tmp_path)
    steps = STEPS // wrapped.num_envs
    train(SAC(models=models, memory=memory, cfg=cfg, **spaces), wrapped, steps)
    for i, twin in enumerate(twins):
        seen, ended = columns(twin.kept), stored(memory, "terminated", i)[:steps, 0] > 0.0
        following = stored(memory, "next_observations", i)[:steps]
        rows = np.arange(len(seen.reward))
        if kind == "vector":
            over = np.concatenate([[False], (seen.terminated | seen.truncated)[:-1]])
            rows = rows + np.cumsum(over)
            reset = rows[over] - 1
            assert len(reset) == steps - len(rows)
            assert not ended[reset].any()
            np.testing.assert_array_equal(following[reset], seen.observation[over])
        np.testing.assert_array_equal(stored(memory, "observations", i)[rows], seen.observation)
        np.testing.assert_array_equal(stored(memory, "actions", i)[rows], seen.action)
        np.testing.assert_array_equal(stored(memory, "rewards", i)[rows, 0], seen.reward.astype("f4"))
        np.testing.assert_array_equal(following[rows], seen.next_observation)
        np.testing.assert_array_equal(ended[rows], seen.terminated)


@pytest.mark.parametrize("kind", ["single", "vector"])
def test_ppo(kind, tmp_path):
    env = wrap_env(gym.make(WEAVE) if kind == "single" else gym.make_vec(WEAVE, num_envs=3), wrapper="gymnasium")
    assert env.num_envs == (1 if kind == "single" else 3)
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space, "device": env.device}
    models = {"policy": Policy(**spaces), "value": Value(**spaces)}
    cfg = settings(PPO_CFG(rollouts=16, time_limit_bootstrap=True), tmp_path)
    agent = PPO(models=models, memory=RandomMemory(memory_size=16, num_envs=env.num_envs), cfg=cfg, **spaces)
    before = models["policy"].network.weight.clone()
    train(agent, env, 48)
    assert torch.isfinite(models["policy"].network.weight).all()
    assert (models["policy"].network.weight != before).any()
    env.close()
