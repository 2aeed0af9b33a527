"""Which friction laws let the handwheel come back after the hands let it go?

It is held at 90 deg at 35 km/h and let go. The tyres turn it back until friction holds it. The three laws
with a dry part stop it at the same angle; viscous friction makes it slow, and lets it come back.
"""

import matplotlib.pyplot as plt
import numpy as np

from steer_env import manoeuvres
from steer_env.vehicle import cars

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout="constrained")
for law, width in (("lugre", 7.0), ("masing", 4.0), ("coulomb", 1.5), ("viscous", 1.5)):
    free = manoeuvres.drive(cars.load("compact"), manoeuvres.make("returnability"), law).between(4.0, 9.0)
    axes.plot(free.time - 4.0, np.degrees(free["handwheel_angle"]), linewidth=width, label=law)
axes.set(xlabel="time since the hands let go [s]", ylabel="handwheel angle [deg]")
figure.legend(loc="outside upper center", ncols=4)
figure.savefig("released_handwheel.svg")
