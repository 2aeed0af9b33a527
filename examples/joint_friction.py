"""A joint of a MuJoCo model that holds a load by friction: laws of this package and MuJoCo's own ``frictionloss``.

A joint with an inertia of 0.01 kg m² and friction of 1 N m carries 0.3 N m, constant or with 0.2 N m at 4 Hz on top of
it, at steps of 1 ms. The table has the mean speed of the last half of a second, after half a second to settle.

Run: python examples/joint_friction.py
"""

import math

import mujoco
import numpy as np

from steer_env import friction

JOINT = """
<mujoco>
  <option timestep="0.001" {option}/>
  <worldbody>
    <body>
      <joint name="elbow" axis="0 0 1" {joint}/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
    </body>
  </worldbody>
</mujoco>
"""
LAWS = ("coulomb,F_c=1", "lugre,F_c=1,sigma_0=1000,sigma_1=2", "elasto_plastic,F_c=1,sigma_0=1000,sigma_1=2")
STIFF = 'frictionloss="1" solimpfriction="0.9999 0.9999 0.001" solreffriction="0.002 1"'
NOSLIP = 'noslip_iterations="100" noslip_tolerance="0"'
FRICTIONLOSS = {
    "frictionloss, default": ('frictionloss="1"', ""),
    "frictionloss, stiffest": (STIFF, ""),
    "frictionloss, noslip": ('frictionloss="1"', NOSLIP),
    "frictionloss, stiffest and noslip": (STIFF, NOSLIP),
}


def creep(law, joint, option, ripple):
    """Mean speed under load in the last half of a second [rad/s]; without a law, with what the model has."""
    model = mujoco.MjModel.from_xml_string(JOINT.format(joint=joint, option=option))
    data = mujoco.MjData(model)
    joints = friction.JointFriction(model, {"elbow": law}) if law else None
    angles = []
    for i in range(1001):
        data.qfrc_applied[0] = 0.3 + ripple * math.sin(2.0 * math.pi * 4.0 * data.time)
        if joints:
            joints.step(data)
        else:
            mujoco.mj_step(model, data)
        if i % 500 == 0:
            angles.append(data.qpos[0])
    return (angles[2] - angles[1]) / 0.5


def main(laws=LAWS):
    cases = {law: (law, "", "") for law in laws} | {name: (None, *case) for name, case in FRICTIONLOSS.items()}
    found = {name: np.abs([creep(*case, ripple) for ripple in (0.0, 0.2)]) for name, case in cases.items()}
    print("| friction | constant load [rad/s] | oscillating load [rad/s] |\n|---|---|---|")
    for name, (constant, oscillating) in found.items():
        print(f"| {name} | {constant:.1e} | {oscillating:.1e} |")
    return found


if __name__ == "__main__":
    main()
