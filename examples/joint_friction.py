"""One joint and its loads with the friction of this package, of MuJoCo and of Drake.

The joint has an inertia of 0.01 kg m² and friction of 1 N m; steps are of 1 ms. The columns of the table:

* constant load: mean speed under 0.3 N m in the last half of a second, after half a second to settle.
* oscillating load: the same with 0.2 N m at 4 Hz on top.
* coasting: speed 20 ms after 5 rad/s, with a damping d of 1 N m s/rad and no load. Under Coulomb friction the joint
  rests after (I/d) ln(1 + d v/F_c) = 18 ms; elastic laws still swing.
* small cycle: work of a load of 0.5 N m at 1 Hz in its second period. A joint that is stuck takes none.
* step: processor time of a step under the constant load, the least of three means over 500 steps.

What is installed runs, and what is not is named: ``pip install mujoco drake``.

Run: python examples/joint_friction.py [mujoco] [drake]
"""

import math
import sys
import time
from importlib.metadata import PackageNotFoundError, version

import numpy as np

STEP = 1e-3
LAWS = (
    "coulomb,F_c=1",
    "lugre,F_c=1,sigma_0=1000,sigma_1=2",
    "elasto_plastic,F_c=1,F_ba=0.7,sigma_0=1000,sigma_1=2",
)

MODEL = """
<mujoco model="joint">
  <compiler angle="radian"/>
  <option timestep="0.001" gravity="0 0 0" {option}/>
  <worldbody>
    <body>
      <joint name="elbow" axis="0 0 1" damping="{damping}" {joint}/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
    </body>
  </worldbody>
  {actuator}
</mujoco>
"""
LOSS = 'frictionloss="1"'
STIFF = f'{LOSS} solimpfriction="0.9999 0.9999 0.001" solreffriction="0.002 1"'
# Elastic to 1 mrad, 1 N m; without damping it would swing for ever, so that it has that of the coasting always.
YIELD = 'stiffness="1000" springyield="0.001"'
# A motor that does nothing but carry the bristle: sigma_0, sigma_1, F_c, F_s and v_s.
MOTOR = '<actuator><dcmotor joint="elbow" motorconst="1e-6" resistance="1" lugre="1000 2 1 1 0.01"/></actuator>'
MUJOCO = {
    "frictionloss, default": {"joint": LOSS},
    "frictionloss, one noslip iteration": {"joint": LOSS, "option": 'noslip_iterations="1"'},
    "frictionloss, stiffest": {"joint": STIFF},
    "frictionloss, stiffest and noslip": {"joint": STIFF, "option": 'noslip_iterations="1"'},
    "springyield": {"joint": YIELD, "least_damping": 1.0},
    "dcmotor": {"actuator": MOTOR},
}


class OfMujoco:
    """The joint in MuJoCo, with a law of this package or MuJoCo's own friction."""

    def __init__(self, damping, law=None, least_damping=0.0, **parts):
        import mujoco

        parts = {"joint": "", "option": "", "actuator": "", "damping": max(damping, least_damping)} | parts
        model = mujoco.MjModel.from_xml_string(MODEL.format(**parts))
        self.data = mujoco.MjData(model)
        self.advance = lambda data: mujoco.mj_step(model, data)
        if law:
            from steer_env import friction

            self.advance = friction.JointFriction(model, {"elbow": law}).step

    def start(self, speed):
        self.data.qvel[0] = speed

    def step(self, load):
        self.data.qfrc_applied[0] = load
        self.advance(self.data)
        return self.data.qvel[0]


class OfDrake:
    """The joint in Drake, of the same file."""

    def __init__(self, damping):
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant
        from pydrake.systems.analysis import Simulator

        self.plant = MultibodyPlant(STEP)
        text = MODEL.format(joint=LOSS, damping=damping, option="", actuator="")
        Parser(self.plant).AddModelsFromString(text, "xml")
        self.plant.Finalize()
        self.simulator, self.steps = Simulator(self.plant), 0
        self.context = self.simulator.get_mutable_context()

    def start(self, speed):
        self.plant.SetVelocities(self.context, [speed])

    def step(self, load):
        self.plant.get_applied_generalized_force_input_port().FixValue(self.context, [load])
        self.steps += 1
        self.simulator.AdvanceTo(self.steps * STEP)
        return self.plant.GetVelocities(self.context)[0]


def creep(joint, ripple):
    """Mean speed under load in the last half of a second [rad/s]."""
    joint.start(0.0)
    speeds = [joint.step(0.3 + ripple * math.sin(2.0 * math.pi * 4.0 * i * STEP)) for i in range(1000)]
    return float(np.mean(speeds[500:]))


def coast(joint):
    """Speed of the joint with damping 20 ms after 5 rad/s [rad/s]."""
    joint.start(5.0)
    return [joint.step(0.0) for _ in range(20)][-1]


def small_cycle(joint):
    """Work of a load of 0.5 N m in the second of two periods [J]."""
    joint.start(0.0)
    loads = 0.5 * np.sin(2.0 * math.pi * STEP * np.arange(2000))
    work = [load * joint.step(load) * STEP for load in loads]
    return sum(work[1000:])


def step_time(joint):
    """Processor time of a step [µs]."""
    joint.start(0.0)
    means = []
    for _ in range(3):
        begun = time.process_time()
        for _ in range(500):
            joint.step(0.3)
        means.append((time.process_time() - begun) / 500)
    return 1e6 * min(means)


def measure(make):
    """The columns of a row."""
    return [
        abs(creep(make(0.0), 0.0)),
        abs(creep(make(0.0), 0.2)),
        abs(coast(make(1.0))),
        small_cycle(make(0.0)),
        step_time(make(0.0)),
    ]


def rows(laws=LAWS):
    """Name -> package of it and what makes its joint."""
    found = {f"here: {law}": ("mujoco", lambda d, law=law: OfMujoco(d, law=law)) for law in laws}
    found |= {f"MuJoCo: {n}": ("mujoco", lambda d, parts=parts: OfMujoco(d, **parts)) for n, parts in MUJOCO.items()}
    return found | {"Drake": ("drake", OfDrake)}


def installed(package):
    """Its version, or None."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def main(*packages, laws=LAWS):
    """The rows of some packages, or of all."""
    packages = {name: installed(name) for name in packages or ("mujoco", "drake")}
    print(", ".join(f"{name} {found or 'is not installed: left out'}" for name, found in packages.items()))
    heads = ("constant load [rad/s]", "oscillating load [rad/s]", "coasting [rad/s]", "small cycle [J]", "step [µs]")
    print(f"| friction | {' | '.join(heads)} |\n|---|---|---|---|---|---|")
    table = {}
    for name, (package, make) in rows(laws).items():
        if packages.get(package):
            table[name] = measure(make)
            print(f"| {name} | {' | '.join(f'{value:.1e}' for value in table[name][:-1])} | {table[name][-1]:.0f} |")
    return table


if __name__ == "__main__":
    main(*sys.argv[1:])
