"""How far do the cars of one production differ in the hands of their drivers?

Three hundred cars drive the same weave at once, each with a friction and a load of its own, drawn evenly from their
tolerances: a vector environment is a test bench for a whole production. The line is the car as designed, empty.
"""

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

import steer_env  # noqa: F401 (registers the ids)

CARS, TOLERANCES = 300, {"friction": {"F_c": (0.6, 1.2)}, "load": (0.0, 300.0)}  # [N m], [kg]


def effort(cars, **drawn):
    """Hand torque of every car, rms over the weave [N m]."""
    env = gym.make_vec("steer_env/AssistWeave-v3", num_envs=cars, friction="lugre", info_level="metrics", **drawn)
    env.reset(seed=0, options={"amplitude": np.radians(15.0)})
    over = np.zeros(cars, bool)
    while not over.all():
        *_, truncated, info = env.step(np.zeros((cars, 1), np.float32))
        over |= truncated
    return info["metrics"]["rms_hand_torque"]


figure, axes = plt.subplots(figsize=(5.0, 3.5), layout="constrained")
axes.hist(effort(CARS, randomise=TOLERANCES), bins=20, label="cars of the production")
axes.axvline(effort(1)[0], color="black", label="as designed")
axes.set(xlabel="rms hand torque in a weave [N m]", ylabel="number of cars [1]")
figure.legend(loc="outside upper center", ncols=2)
figure.savefig("production_spread.svg")
