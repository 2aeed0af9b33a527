"""Which driver model gets through a double lane change without touching a cone?

Three models steer the same car by hand torque through the course of ISO 3888. The legend has the work of the hands, and
how many cones were touched.
"""

import gymnasium as gym
import matplotlib.pyplot as plt

import steer_env  # noqa: F401 (registers the ids)
from steer_env import drivers

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout="constrained")
env = gym.make("steer_env/DriverDoubleLaneChange-v3", friction="lugre")
for model, width in (("preview", 4.0), ("macadam", 1.5), ("two_point", 1.5)):
    driver = drivers.Controller(env, model)
    observation, info = env.reset(seed=0)
    way, over = [], False
    while not over:
        way.append((info["x"], info["y"]))
        observation, _, terminated, truncated, info = env.step(driver.act(observation))
        over = terminated or truncated
    found = info["metrics"]
    label = f"{model}\n{found['steering_work']:.1f} J, {found['cones_hit']:.0f} cones"
    axes.plot(*zip(*way), linewidth=width, label=label)
axes.set(xlabel="distance along the road [m]", ylabel="distance to the left [m]")
figure.legend(loc="outside upper center", ncols=3)
figure.savefig("lane_change.svg")
