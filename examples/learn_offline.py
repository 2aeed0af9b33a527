"""Learn from a recorded data set alone, by cloning, TD3+BC and CQL of tianshou, and enter each in the benchmark.

steer-env policy record --env steer_env/AssistWeave-v3 --quality medium --episodes 40 --out dataset
python examples/learn_offline.py dataset     takes a few minutes; needs the extras datasets and integrations
steer-env benchmark examples/learn_offline.py:CQL --suite assists

What is learned goes into the folder `learned`. An entry gives zero action in the ids of which it has learned nothing.
"""

import sys
import time
from pathlib import Path

import minari
import numpy as np
import torch
from tianshou import algorithm
from tianshou.algorithm.algorithm_base import policy_within_training_step
from tianshou.algorithm.imitation.imitation_base import ImitationPolicy, OfflineImitationLearning
from tianshou.algorithm.modelfree.ddpg import ContinuousDeterministicPolicy
from tianshou.algorithm.modelfree.sac import SACPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Batch, ReplayBuffer
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorDeterministic, ContinuousActorProbabilistic, ContinuousCritic

FOLDER = Path("learned")
STEPS = 3000  # of gradient descent
ADAM = AdamOptimizerFactory(lr=1e-3)


def net(inputs: int, **more) -> Net:
    """The hidden layers of every network."""
    return Net(state_shape=(inputs,), hidden_sizes=(64, 64), **more)


def actor(inputs: int) -> ContinuousActorDeterministic:
    """An actor that gives an action."""
    return ContinuousActorDeterministic(preprocess_net=net(inputs), action_shape=(1,))


def critics(inputs: int) -> dict:
    """Two critics: tianshou 2.0.0 would make the second as a copy of the first, which has its values for ever."""
    of = [ContinuousCritic(preprocess_net=net(inputs, action_shape=(1,), concat=True)) for _ in range(2)]
    return {"critic": of[0], "critic2": of[1], "critic_optim": ADAM, "policy_optim": ADAM}


class Learned:
    """The policy that was learned for an id, in a vector environment of the benchmark."""

    tuning = "learned from a data set"

    def __init__(self, env) -> None:
        path = FOLDER / f"{type(self).__name__}-{env.unwrapped.task.name}.pt"
        self.learned = torch.load(path, weights_only=False) if path.is_file() else None

    def reset(self, sub_environments=None) -> None:
        """It remembers nothing."""

    @torch.inference_mode()
    def act(self, observation: np.ndarray) -> np.ndarray:
        """Actions (N, 1) for observations (N, O)."""
        if self.learned is None:
            return np.zeros((len(observation), 1))
        policy, mean, deviation = self.learned
        return policy(Batch(obs=(observation - mean) / deviation, info={})).act.numpy()


class Cloning(Learned):
    """The observations."""

    @staticmethod
    def learner(inputs: int, space):
        """Act as was recorded, in the least mean square."""
        return OfflineImitationLearning(policy=ImitationPolicy(actor=actor(inputs), action_space=space), optim=ADAM)


class TD3BC(Learned):
    """The observations."""

    @staticmethod
    def learner(inputs: int, space):
        """Fujimoto and Gu (2021): the action of the largest value, drawn towards the recorded one."""
        policy = ContinuousDeterministicPolicy(actor=actor(inputs), action_space=space)
        return algorithm.TD3BC(policy=policy, **critics(inputs))


class CQL(Learned):
    """The observations."""

    @staticmethod
    def learner(inputs: int, space):
        """Kumar and others (2020): values are pressed down where nothing is recorded."""
        drawing = ContinuousActorProbabilistic(
            preprocess_net=net(inputs), action_shape=(1,), unbounded=True, conditioned_sigma=True
        )
        policy = SACPolicy(actor=drawing, action_space=space)
        # tianshou 2.0.0 draws random actions between -min_action and max_action: with -1 all would be 1. It compares
        # the repeated ones with their own row alone, so that more than one for a state brings nothing.
        more = {"min_action": 1.0, "num_repeat_actions": 1, "with_lagrange": False, "calibrated": False}
        return algorithm.CQL(policy=policy, **critics(inputs), **more)


def transitions(dataset: minari.MinariDataset) -> tuple[ReplayBuffer, np.ndarray, np.ndarray]:
    """All steps of a set, with rewards in units of their deviation, and mean and deviation of the observations."""
    episodes = list(dataset.iterate_episodes())
    before, after = (np.concatenate([e.observations[part] for e in episodes]) for part in (np.s_[:-1], np.s_[1:]))
    action, reward, ended = (
        np.concatenate([getattr(e, name) for e in episodes]) for name in ("actions", "rewards", "terminations")
    )
    mean, deviation = before.mean(0), before.std(0) + 1e-3
    buffer = ReplayBuffer.from_data(
        obs=(before - mean) / deviation,
        obs_next=(after - mean) / deviation,
        act=action,
        rew=(reward / reward.std()).astype(np.float32),
        terminated=ended,
        truncated=np.zeros_like(ended),
        done=ended,  # the value of the state in which time is up goes on
    )
    return buffer, mean, deviation


def main(folder: Path, steps: int = STEPS, seed: int = 0) -> None:
    """Learn by each algorithm and write what was learned."""
    torch.set_num_threads(1)  # more threads are slower with networks of this size
    dataset = minari.MinariDataset(folder / "data")
    task = dataset.env_spec.id.split("/")[1].rpartition("-")[0]
    buffer, mean, deviation = transitions(dataset)
    FOLDER.mkdir(exist_ok=True)
    for kind in (Cloning, TD3BC, CQL):
        begun = time.perf_counter()
        torch.manual_seed(seed)
        learner = kind.learner(len(mean), dataset.action_space)
        with policy_within_training_step(learner.policy):
            for _ in range(steps):
                learner.update(buffer, 256)
        path = FOLDER / f"{kind.__name__}-{task}.pt"
        torch.save((learner.policy.eval(), mean, deviation), path)
        print(f"{path}: {steps} steps in {(time.perf_counter() - begun) / 60.0:.1f} min")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "dataset"), *map(int, sys.argv[2:]))
