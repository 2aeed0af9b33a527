"""Train an assist policy with Stable-Baselines3, compare it with the boost table on held-out seeds, save a picture.

python examples/train_a_policy.py [STEPS]     half a million steps take about a minute; needs the extras train, render
"""

import sys

import gymnasium as gym
import matplotlib.image
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import steer_env  # noqa: F401 (registers the ids)
from steer_env.sb3 import SteerVecEnv

ENV = "steer_env/AssistWeave-v3"


def main(steps: int, frame: str = "frame.png") -> dict[str, float]:
    """Feel error [N m] of the policy and of the boost table alone, on eight seeds that were not used in training."""
    environments = VecMonitor(SteerVecEnv(ENV, num_envs=64, randomise={"friction_level": (0.5, 2.0)}))
    model = PPO("MlpPolicy", environments, n_steps=128, batch_size=2048, gamma=0.98, seed=0, device="cpu").learn(steps)

    errors = {}
    for name, act in (
        ("policy", lambda seen: model.predict(seen, deterministic=True)[0]),
        ("boost table", lambda seen: np.zeros((len(seen), 1), np.float32)),
    ):
        held_out = gym.make_vec(ENV, num_envs=8)
        observations, _ = held_out.reset(seed=1_000_000)
        over = np.zeros(8, bool)
        while not over.all():
            observations, _, terminated, truncated, info = held_out.step(act(observations))
            over = terminated | truncated
        errors[name] = float(info["metrics"]["rms_feel_error"].mean())

    env = gym.make(ENV, render_mode="rgb_array")
    observation, _ = env.reset(seed=1_000_000)
    for _ in range(800):
        observation, *_ = env.step(model.predict(observation, deterministic=True)[0])
    matplotlib.image.imsave(frame, env.render())
    return errors


if __name__ == "__main__":
    for name, error in main(int(sys.argv[1]) if len(sys.argv) > 1 else 500_000).items():
        print(f"{name:12s} feel error {error:.3f} N m")
