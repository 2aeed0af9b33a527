"""How heavy is parking, and what does the assist take off the hands?

A robot turns the handwheel of the standing car from lock to lock in 15 s: with the car's own boost, with half of it,
and with a fifth.
"""

import matplotlib.pyplot as plt
import numpy as np

from steer_env import manoeuvres
from steer_env.vehicle import cars

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout="constrained")
for boost in (0.2, 0.5, 1.0):
    car = cars.load("compact", changes={"assist.boost_scale": boost})
    cycle = manoeuvres.drive(car, manoeuvres.make("parking"), "lugre").between(30.0, 60.0)
    axes.plot(np.degrees(cycle["handwheel_angle"]), cycle["handwheel_torque"], label=f"boost × {boost}")
axes.set(xlabel="handwheel angle [deg]", ylabel="hand torque [N m]")
figure.legend(loc="outside upper center", ncols=3)
figure.savefig("parking_torque.svg")
