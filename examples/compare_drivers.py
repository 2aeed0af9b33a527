"""Drive the double lane change with every driver model on every friction law; print touched cones and hand work.

python examples/compare_drivers.py
"""

import gymnasium as gym

import steer_env  # noqa: F401 (registers the ids)
from steer_env import drivers, friction

ENV = "steer_env/DriverDoubleLaneChange-v3"


def main(laws: tuple[str, ...], models: tuple[str, ...]) -> dict[tuple[str, str], dict[str, float]]:
    """Metrics of one run for each law and driver model."""
    results = {}
    for law in laws:
        env = gym.make(ENV, friction=law)
        for model in models:
            driver = drivers.Controller(env, model)
            observation, info = env.reset(seed=0)
            over = False
            while not over:
                observation, _, terminated, truncated, info = env.step(driver.act(observation))
                over = terminated or truncated
            results[law, model] = info["metrics"]
    return results


if __name__ == "__main__":
    for (law, model), metrics in main(friction.available(), ("preview", "macadam", "two_point")).items():
        print(f"{law:8s} {model:10s} cones {metrics['cones_hit']:2.0f}   work {metrics['steering_work']:5.1f} J")
