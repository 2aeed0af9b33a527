"""Which friction law describes a measured record?

A contact that slides to and fro on a rig, a record that comes with the package. Each law is identified from the first
half; the picture is a cycle near the end, which no fit has seen, and the legend has the error over the second half.
"""

import matplotlib.pyplot as plt
import numpy as np

from steer_env import friction

record = friction.records.read("rig")
x, force, dt = record.x[::4], record.torque[::4], 4 * record.dt  # [m], [N], [s]
half, cycle = x.size // 2, slice(-round(8.0 / dt), -round(4.0 / dt))

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout="constrained")
axes.plot(1e3 * x[cycle], force[cycle], color="0.7", linewidth=4.0, label="measured")
for law in ("coulomb", "dahl", "masing"):
    fit = friction.fit(x[:half], force[:half], law, dt=dt)
    simulated = friction.response(fit.parameters, x, dt) + fit.offset
    error = np.std((simulated - force)[half:])
    axes.plot(1e3 * x[cycle], simulated[cycle], label=f"{law}, {error:.2f} N")
axes.set(xlabel="displacement [mm]", ylabel="friction force [N]")
figure.legend(loc="outside upper center", ncols=2)
figure.savefig("fitted_friction.svg")
