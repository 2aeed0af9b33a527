#!/usr/bin/env bash
# Drake 1.51.1 drops the friction of a joint of an SDFormat model without a word, and of a URDF with a warning.
#
# A joint has damping in Drake and no dry friction. Its parser says so for <dynamics friction> of a URDF; for <friction>
# of an SDFormat model, and whatever it says there, the joint turns freely under a torque that the friction would hold.
# Seen: 3 rad/s after 0.1 s under 0.3 N m with 0.01 kg m2 and a friction of 1 N m; no warning for SDFormat, one for URDF.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet drake==1.51.1
"$folder/venv/bin/python" - <<'PYTHON'
import logging
from importlib.metadata import version

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

INERTIA = "<inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia>"
SDF = f"""<sdf version="1.9"><model name="arm">
<link name="base"/><link name="tip"><inertial><mass>1</mass>{INERTIA}</inertial></link>
<joint name="hold" type="fixed"><parent>world</parent><child>base</child></joint>
<joint name="elbow" type="revolute"><parent>base</parent><child>tip</child>
<axis><xyz>0 0 1</xyz><dynamics><damping>0</damping><friction>1</friction></dynamics></axis></joint></model></sdf>"""
URDF = """<robot name="arm"><link name="world"/><link name="tip"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="elbow" type="continuous"><parent link="world"/><child link="tip"/><axis xyz="0 0 1"/>
<dynamics damping="0" friction="1"/></joint></robot>"""


class Told(logging.Handler):
    def __init__(self):
        super().__init__()
        self.texts = []

    def emit(self, record):
        self.texts.append(record.getMessage())


for kind, text, warned in (("sdf", SDF, False), ("urdf", URDF, True)):
    told = Told()
    logging.getLogger("drake").addHandler(told)
    plant = MultibodyPlant(0.001)
    Parser(plant).AddModelsFromString(text, kind)
    logging.getLogger("drake").removeHandler(told)
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.get_applied_generalized_force_input_port().FixValue(context, [0.3])
    simulator.AdvanceTo(0.1)
    speed, words = plant.GetVelocities(context)[0], [text for text in told.texts if "friction" in text]
    print(f"drake {version('drake')}, {kind}: {speed:.3f} rad/s, {len(words)} warnings of friction")
    assert abs(speed - 3.0) < 1e-6, "the joint has friction now"
    assert bool(words) == warned
PYTHON
