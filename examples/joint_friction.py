"""A joint of a MuJoCo model that holds a load by friction: laws of this package and MuJoCo's own ``frictionloss``.

A joint with an inertia of 0.01 kg m² and friction of 1 N m carries 0.3 N m, constant or with 0.2 N m at 4 Hz on top of
it, at steps of 1 ms. The table has the mean speed of the last half of a second, after half a second to settle. Its last
column is the same joint with a damping d of 1 N m s/rad and no load, 20 ms after 5 rad/s. Under Coulomb friction it
rests after (I/d) ln(1 + d v/F_c) = 18 ms; elastic laws still swing.

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
      <joint name="elbow" axis="0 0 1" damping="{damping}" {joint}/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
    </body>
  </worldbody>
</mujoco>
"""
LAWS = ("coulomb,F_c=1", "lugre,F_c=1,sigma_0=1000,sigma_1=2", "elasto_plastic,F_c=1,F_ba=0.7,sigma_0=1000,sigma_1=2")
STIFF = 'frictionloss="1" solimpfriction="0.9999 0.9999 0.001" solreffriction="0.002 1"'
NOSLIP = 'noslip_iterations="100" noslip_tolerance="0"'
FRICTIONLOSS = {
    "frictionloss, default": ('frictionloss="1"', ""),
    "frictionloss, stiffest": (STIFF, ""),
    "frictionloss, noslip": ('frictionloss="1"', NOSLIP),
    "frictionloss, stiffest and noslip": (STIFF, NOSLIP),
}


def made(law, joint, option, damping):
    """Data and step of the joint; without a law, with the friction that the model has."""
    model = mujoco.MjModel.from_xml_string(JOINT.format(joint=joint, option=option, damping=damping))
    joints = friction.JointFriction(model, {"elbow": law}) if law else None
    return mujoco.MjData(model), joints.step if joints else lambda data: mujoco.mj_step(model, data)


def creep(law, joint, option, ripple):
    """Mean speed under load in the last half of a second [rad/s]."""
    data, step = made(law, joint, option, 0.0)
    angles = []
    for i in range(1001):
        data.qfrc_applied[0] = 0.3 + ripple * math.sin(2.0 * math.pi * 4.0 * data.time)
        step(data)
        if i % 500 == 0:
            angles.append(data.qpos[0])
    return (angles[2] - angles[1]) / 0.5


def coast(law, joint, option):
    """Speed of the joint with damping 20 ms after 5 rad/s [rad/s]."""
    data, step = made(law, joint, option, 1.0)
    data.qvel[0] = 5.0
    for _ in range(20):
        step(data)
    return data.qvel[0]


def main(laws=LAWS):
    cases = {law: (law, "", "") for law in laws} | {name: (None, *case) for name, case in FRICTIONLOSS.items()}
    found = {name: np.abs([creep(*case, 0.0), creep(*case, 0.2), coast(*case)]) for name, case in cases.items()}
    print("| friction | constant load [rad/s] | oscillating load [rad/s] | coasting [rad/s] |\n|---|---|---|---|")
    for name, values in found.items():
        print(f"| {name} | {' | '.join(f'{value:.1e}' for value in values)} |")
    return found


if __name__ == "__main__":
    main()
