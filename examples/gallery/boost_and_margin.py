"""How light may the steering become before its assist loop loses its margin?

The tuning environment drives the weave with one parameter set a step. Here a set is the boost alone, the number beside
each point: more of it takes torque off the hands, and phase from the assist loop, of which at least 30 deg are asked.
"""

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

import steer_env  # noqa: F401 (registers the ids)

env = gym.make("steer_env/TuneOnCentre-v3", friction="lugre", parameters=["boost_level"], detuning=0.0, sets=None)
env.reset(seed=0)
infos = [env.step(np.array([action], np.float32))[-1] for action in np.linspace(-1.0, 1.0, 9)]
torque = [info["evaluated"]["peak_handwheel_torque"] for info in infos]
phase = [info["margins"]["phase_deg"] for info in infos]

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout="constrained")
axes.plot(torque, phase, "o-", label="boost × the number at the point")
for info, *point in list(zip(infos, torque, phase))[::2]:
    axes.annotate(f"{info['parameters']['boost_level']:.2f}", point, xytext=(4, -13), textcoords="offset points")
axes.axhline(30.0, color="tab:red", label="least phase margin")
axes.set(xlabel="largest hand torque in the weave [N m]", ylabel="phase margin [deg]")
axes.set(xlim=(2.0, 3.9), ylim=(0.0, 80.0))
figure.legend(loc="outside upper center")
figure.savefig("boost_and_margin.svg")
