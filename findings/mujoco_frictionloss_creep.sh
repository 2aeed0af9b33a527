#!/usr/bin/env bash
# In MuJoCo 4.0.0 a joint with `frictionloss` creeps under any load, at a speed that does not depend on its friction.
#
# Friction is a soft constraint: under a load below its limit the joint creeps at a speed that depends on the load, the
# inertia and solreffriction, and not on the friction, so that a larger `frictionloss` does not help. One iteration of
# the noslip solver ends it.
# Seen: the same speed to 1e-6 for a friction of 1, 10 and 1000 N m under 0.3 N m; none with noslip_iterations="1".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet mujoco==4.0.0
"$folder/venv/bin/python" - <<'PYTHON'
import mujoco

MODEL = """<mujoco><option timestep="0.001" noslip_iterations="{noslip}"/><worldbody><body>
<joint name="elbow" axis="0 0 1" frictionloss="{friction}"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body></worldbody></mujoco>"""


def speed(friction, noslip):
    """Speed after a second under 0.3 N m [rad/s]."""
    model = mujoco.MjModel.from_xml_string(MODEL.format(friction=friction, noslip=noslip))
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = 0.3
    for _ in range(1000):
        mujoco.mj_step(model, data)
    return data.qvel[0]


creeping, held = [speed(friction, 0) for friction in (1, 10, 1000)], speed(1, 1)
print(f"mujoco {mujoco.__version__}: {creeping} rad/s, with noslip {held:.1e} rad/s")
assert creeping[0] > 0.01
assert max(creeping) - min(creeping) < 1e-6 * creeping[0]
assert abs(held) < 1e-9
PYTHON
