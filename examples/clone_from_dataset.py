"""Learn from a recorded data set alone, by behaviour cloning, then drive what was learned in the recovered environment.

steer-env policy record --env steer_env/DriverLaneKeeping-v3 --policy preview --episodes 20 --out dataset
python examples/clone_from_dataset.py dataset     takes some seconds; needs the extras datasets and train
"""

import sys
from pathlib import Path

import gymnasium as gym
import minari
import numpy as np
import torch

EPISODES = 4  # that are driven


def clone(dataset: minari.MinariDataset, steps: int = 3000) -> torch.nn.Module:
    """A network that acts as the recorded controller did: the least mean square of the difference of the actions."""
    torch.manual_seed(0)
    torch.set_num_threads(1)  # more threads are slower with networks of this size
    recorded = list(dataset.iterate_episodes())
    seen = torch.from_numpy(np.concatenate([episode.observations[:-1] for episode in recorded]))
    action = torch.from_numpy(np.concatenate([episode.actions for episode in recorded]))
    scale = torch.nn.BatchNorm1d(seen.shape[1], affine=False)  # to zero mean and unit variance
    network = torch.nn.Sequential(
        scale, torch.nn.Linear(seen.shape[1], 64), torch.nn.Tanh(), torch.nn.Linear(64, action.shape[1])
    )
    optimizer = torch.optim.Adam(network.parameters(), 3e-3)
    schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.01, steps)
    for _ in range(steps):
        rows = torch.randint(len(seen), (512,))
        optimizer.zero_grad()
        torch.nn.functional.mse_loss(network(seen[rows]), action[rows]).backward()
        optimizer.step()
        schedule.step()
    return network.eval()


def drive(env: gym.Env, act, first_seed: int = 1_000_000) -> float:
    """Mean return of some episodes that no data set holds."""
    returns = []
    for seed in range(first_seed, first_seed + EPISODES):
        observation, _ = env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            observation, reward, terminated, truncated, _ = env.step(act(observation))
            total, over = total + float(reward), terminated or truncated
        returns.append(total)
    return float(np.mean(returns))


def main(folder: Path) -> dict[str, float]:
    """Mean returns: of the recorded episodes, of the clone, and of zero action."""
    dataset = minari.MinariDataset(folder / "data")
    network = clone(dataset)
    env = dataset.recover_environment()

    @torch.inference_mode()
    def act(observation: np.ndarray) -> np.ndarray:
        return network(torch.from_numpy(observation)[None])[0].numpy()

    return {
        "recorded": float(np.mean([episode.rewards.sum() for episode in dataset.iterate_episodes()])),
        "clone": drive(env, act),
        "zero action": drive(env, lambda observation: np.zeros(1, np.float32)),
    }


if __name__ == "__main__":
    for name, value in main(Path(sys.argv[1] if len(sys.argv) > 1 else "dataset")).items():
        print(f"{name:12s} mean return {value:.2f}")
