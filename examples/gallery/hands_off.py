"""Does the car straighten up by itself after a pulse of the hands at high speed?

The hands give 3 N m for 0.3 s at 50 m/s and let go. Without friction the car still swings after ten seconds. Friction
ends it within four, and both laws do so alike.
"""

import matplotlib.pyplot as plt
import numpy as np

from steer_env import friction
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import free_control
from steer_env.vehicle.plant import CHANNEL

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout="constrained")
laws = {"no friction": friction.make("viscous", sigma_2=0.0), "lugre": "lugre", "masing": "masing"}
for (name, law), width in zip(laws.items(), (1.5, 4.0, 1.5)):
    found = free_control.pulse(cars.load("compact").plant(law, speed=50.0), torque=3.0, duration=0.3)
    yaw_rate = np.degrees(found.record[::10, CHANNEL["yaw_rate"]])
    axes.plot(0.01 * np.arange(yaw_rate.size), yaw_rate, linewidth=width, label=name)
axes.set(xlabel="time since the pulse began [s]", ylabel="yaw rate [deg/s]")
figure.legend(loc="outside upper center", ncols=3)
figure.savefig("hands_off.svg")
