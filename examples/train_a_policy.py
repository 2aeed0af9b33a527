"""Train an assist policy with Stable-Baselines3, compare it with the boost table on held-out seeds, draw a frame.

python examples/train_a_policy.py [STEPS]     half a million take about a minute; needs the extras train and render
"""

import sys

import gymnasium as gym
import matplotlib.image
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import steer_env  # noqa: F401 (registers the ids)
from steer_env.sb3 import SteerVecEnv

ENV = "steer_env/AssistWeave-v0"


def main(steps: int, frame: str = "frame.png") -> dict[str, float]:
    """Feel error [N m] of the policy and of the boost table alone, on eight seeds that the training has not drawn."""
    lanes = VecMonitor(SteerVecEnv(ENV, num_envs=64, randomise={"friction_level": (0.5, 2.0)}))
    model = PPO("MlpPolicy", lanes, n_steps=128, batch_size=2048, gamma=0.98, seed=0, device="cpu").learn(steps)

    found = {}
    for name, act in (
        ("policy", lambda seen: model.predict(seen, deterministic=True)[0]),
        ("boost table", lambda seen: np.zeros((len(seen), 1), np.float32)),
    ):
        trials = gym.make_vec(ENV, num_envs=8)
        observations, _ = trials.reset(seed=1_000_000)
        over = np.zeros(8, bool)
        while not over.all():
            observations, _, terminated, truncated, info = trials.step(act(observations))
            over = terminated | truncated
        found[name] = float(info["metrics"]["rms_feel_error"].mean())

    env = gym.make(ENV, render_mode="rgb_array")
    observation, _ = env.reset(seed=1_000_000)
    for _ in range(800):
        observation, *_ = env.step(model.predict(observation, deterministic=True)[0])
    matplotlib.image.imsave(frame, env.render())
    return found


if __name__ == "__main__":
    for name, error in main(int(sys.argv[1]) if len(sys.argv) > 1 else 500_000).items():
        print(f"{name:12s} feel error {error:.3f} N m")
