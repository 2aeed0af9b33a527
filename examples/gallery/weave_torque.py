"""What does the friction law change in the hand torque of a weave?

A robot steers a sine of 0.2 Hz at 100 km/h. All laws have the same friction torque, and the loops are one but where the
handwheel turns back, which the inset shows: there Coulomb friction jumps, and the other two wind up like a spring.
"""

import matplotlib.pyplot as plt
import numpy as np

from steer_env import manoeuvres
from steer_env.vehicle import cars

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout="constrained")
turn = axes.inset_axes((0.62, 0.08, 0.36, 0.42), xlim=(13.2, 15.2), ylim=(2.2, 2.9), xticks=(), yticks=())
for law, width in (("coulomb", 1.5), ("lugre", 4.0), ("masing", 1.5)):
    cycle = manoeuvres.drive(cars.load("compact"), manoeuvres.make("weave"), law).between(40.0, 45.0)
    for each in (axes, turn):
        each.plot(np.degrees(cycle["handwheel_angle"]), cycle["handwheel_torque"], linewidth=width, label=law)
axes.indicate_inset_zoom(turn)
axes.set(xlabel="handwheel angle [deg]", ylabel="hand torque [N m]")
figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
figure.savefig("weave_torque.svg")
