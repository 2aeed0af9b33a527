"""Which friction laws remember a turn and close a small loop inside a large one?

The displacement turns back ten times between 0.3 and 0.5 deg on its way up, and then makes one large loop. Masing
friction closes every small loop and goes on where it left. The torque of LuGre sinks from one small loop to the next,
and its micro-damping makes a small step at every turn. Coulomb friction has no memory and jumps.
"""

import matplotlib.pyplot as plt
import numpy as np

from steer_env import friction

turns = np.radians([0.0, *(0.5, 0.3) * 5, 1.0, -1.0, 1.0])  # [rad]
way = np.insert(np.cumsum(np.abs(np.diff(turns))), 0, 0.0)
displacement = np.interp(np.linspace(0.0, way[-1], 4000), way, turns)  # at one speed, to and fro

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout="constrained")
for law in ("coulomb", "lugre", "masing"):
    torque = friction.response(law, displacement, dt=1e-3)  # [N m]
    axes.plot(np.degrees(displacement), torque, label=law)
axes.set(xlabel="displacement [deg]", ylabel="friction torque [N m]")
figure.legend(loc="outside upper center", ncols=3)
figure.savefig("friction_loops.svg")
