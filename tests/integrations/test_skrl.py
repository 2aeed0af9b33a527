"""skrl: its wrappers, and a few updates by its PPO."""

import gymnasium as gym
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("skrl")

from skrl.agents.torch.ppo import PPO, PPO_CFG  # noqa: E402
from skrl.envs.wrappers.torch import wrap_env  # noqa: E402
from skrl.memories.torch import RandomMemory  # noqa: E402
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model  # noqa: E402
from skrl.trainers.torch import SequentialTrainer  # noqa: E402

WEAVE = "steer_env/AssistWeave-v3"


class Policy(GaussianMixin, Model):
    def __init__(self, **spaces):
        Model.__init__(self, **spaces)
        GaussianMixin.__init__(self)
        self.network = torch.nn.Linear(self.num_observations, self.num_actions)
        self.log_std = torch.nn.Parameter(torch.zeros(self.num_actions))

    def compute(self, inputs, role):
        return self.network(inputs["observations"]), {"log_std": self.log_std}


class Value(DeterministicMixin, Model):
    def __init__(self, **spaces):
        Model.__init__(self, **spaces)
        DeterministicMixin.__init__(self)
        self.network = torch.nn.Linear(self.num_observations, 1)

    def compute(self, inputs, role):
        return self.network(inputs["observations"]), {}


@pytest.mark.parametrize("kind", ["single", "vector"])
def test_ppo(kind, tmp_path):
    # A vector environment's kind is named, as skrl recognises those of Gymnasium's own classes alone.
    made = gym.make(WEAVE) if kind == "single" else gym.make_vec(WEAVE, num_envs=3)
    env = wrap_env(made, wrapper="auto" if kind == "single" else "gymnasium")
    assert env.num_envs == (1 if kind == "single" else 3)
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space, "device": env.device}
    models = {"policy": Policy(**spaces), "value": Value(**spaces)}
    cfg = PPO_CFG(rollouts=16)
    cfg.experiment.directory, cfg.experiment.write_interval, cfg.experiment.checkpoint_interval = str(tmp_path), 0, 0
    agent = PPO(models=models, memory=RandomMemory(memory_size=16, num_envs=env.num_envs), cfg=cfg, **spaces)
    before = models["policy"].network.weight.clone()
    trained = {"timesteps": 48, "headless": True, "disable_progressbar": True, "close_environment_at_exit": False}
    SequentialTrainer(env=env, agents=agent, cfg=trained).train()
    assert torch.isfinite(models["policy"].network.weight).all()
    assert (models["policy"].network.weight != before).any()
    env.close()
