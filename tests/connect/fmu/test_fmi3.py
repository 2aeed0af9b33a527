"""The unit of FMI 3.0: the same run as Python's, and the same refusals as with 2.0, whose core it shares."""

import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import validation
from lxml import etree

from steer_env import manoeuvres
from steer_env.connect import fmu
from steer_env.connect.fmu import description
from steer_env.connect.variables import variables, with_road
from steer_env.vehicle import cars, plant, subsystems
from steer_env.vehicle.chassis.common.interface import WHEELS
from steer_env.vehicle.subsystems.poses import with_poses
from tests.connect.fmu.runs import STEP, bits

if shutil.which("cc") is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

pytestmark = pytest.mark.whole


@pytest.fixture(scope="module", params=["single_track", "two_track"])
def exported(request, tmp_path_factory):
    """The chassis, and a unit for this processor, whose handwheel angle is prescribed."""
    path = tmp_path_factory.mktemp("fmi3") / "car.fmu"
    return request.param, fmu.export(path, friction="lugre", chassis=request.param, robot=True, cpu="native", fmi=3)


@pytest.fixture
def opened(exported, tmp_path):
    """An instance, the references of the variables, and what the unit says."""
    from fmpy.fmi3 import FMU3Slave

    _, path = exported
    about = fmpy.read_model_description(str(path))
    fmpy.extract(str(path), str(tmp_path))
    said = []
    unit = FMU3Slave(
        guid=about.guid,
        unzipDirectory=str(tmp_path),
        modelIdentifier=about.coSimulation.modelIdentifier,
        instanceName="unit",
    )
    unit.instantiate(logMessage=lambda environment, status, kind, text: said.append(text.decode()))
    yield unit, {v.name: v.valueReference for v in about.modelVariables}, said
    unit.freeInstance()


def begin(unit, **times):
    """From instantiation to step mode."""
    unit.enterInitializationMode(**times)
    unit.exitInitializationMode()


def test_validation_has_no_remark(exported):
    assert validation.validate_fmu(str(exported[1])) == []
    with zipfile.ZipFile(exported[1]) as archive:
        assert {"terminalsAndIcons/icon.png", "terminalsAndIcons/terminalsAndIcons.xml"} <= set(archive.namelist())


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
def test_terminals_are_those_of_the_schema_and_fit_one_another(chassis):
    """Steering and chassis give and take the same at the rack; every variable of a terminal exists."""
    schema = etree.XMLSchema(etree.parse(f"{fmpy.__path__[0]}/schema/fmi3/fmi3TerminalsAndIcons.xsd"))
    found = {}
    for part in ("car", "steering", "chassis"):
        p = cars.load("compact").plant("lugre", 20.0, chassis=chassis)
        listed = variables(with_poses(with_road(subsystems.make(part, p, 20.0))), 3)  # as in an export
        root = etree.fromstring(description.terminals(listed))
        assert schema.validate(root), schema.error_log
        causality = {v.name: v.use.lower() for v in listed}
        found[part] = {
            terminal.get("name"): {m.get("memberName"): causality[m.get("variableName")] for m in terminal}
            for terminal in root.iter("Terminal")
        }
    assert {"hands", "rack", "wheel_front_left", "wheel_rear_right"} <= set(found["car"])
    pose = dict.fromkeys(("x", "y", "z", "heading", "inclination"), "output") if chassis == "two_track" else {}
    assert all(pose.items() <= found[part][f"wheel_{w}"].items() for part in ("car", "chassis") for w in WHEELS)
    assert found["steering"]["rack"] == {"travel": "output", "speed": "output", "force": "input"}
    assert found["chassis"]["rack"] == {"travel": "input", "speed": "input", "force": "output"}
    assert "hands" not in found["chassis"]


def test_weave_is_that_of_python_to_the_bit(exported, opened):
    chassis, (unit, references, said) = exported[0], opened
    m = manoeuvres.make("weave")
    p = cars.load("compact").plant("lugre", m.speed, robot=True, chassis=chassis)
    u = manoeuvres.inputs(m, 0.2, 10.0)
    names = [name for name, _ in plant.channels(p)]
    expected, found = np.zeros((len(u), len(names))), np.zeros((len(u), len(names)))
    plant.run(p, plant.initial_state(p), u, expected, 1)
    begin(unit)
    hands, outputs = [references["hand_angle"], references["hand_speed"]], [references[name] for name in names]
    for k, row in enumerate(u):
        unit.setFloat64(hands, row[:2].tolist())
        unit.doStep(k * STEP, STEP)
        found[k] = unit.getFloat64(outputs)
    assert not said
    assert np.array_equal(bits(expected), bits(found))
    assert unit.getFloat64([references["time"]]) == [pytest.approx(10.0)]


def test_bad_calls_are_refused(opened):
    from fmpy.fmi1 import FMICallException

    unit, references, said = opened

    def refused(call, *values):
        before = len(said)
        with pytest.raises(FMICallException):
            call(*values)
        assert len(said) == before + 1
        return said[-1]

    assert "fmi3DoStep is not allowed before initialization" in refused(unit.doStep, 0.0, STEP)
    robot, other = references["robot"], references["yaw_rate"]
    (before,) = unit.getBoolean([robot])
    assert "that of no boolean variable" in refused(unit.setBoolean, [robot, other], [not before, True])
    assert unit.getBoolean([robot]) == [before]  # nothing of a bad call is taken
    begin(unit)
    torque = [references["hand_torque"]]
    assert "hand_torque must be finite" in refused(unit.setFloat64, torque, [np.nan])
    wind = [references["wind_force"]]
    unit.setFloat64(wind, [5.0])
    assert "hand_torque must be at most 200, got 250" in refused(unit.setFloat64, [*wind, *torque], [1.0, 250.0])
    assert unit.getFloat64(wind) == [5.0]
    assert "time is the independent one" in refused(unit.setFloat64, [references["time"]], [1.0])
    assert "1 value references but 2 values" in refused(unit.setFloat64, torque, [1.0, 2.0])
    assert "value reference 99999" in refused(unit.getFloat64, [99999])
    assert "no variables of this type" in refused(unit.getInt32, torque)
    assert "whole number of milliseconds" in refused(unit.doStep, 0.0, 1.5e-3)
    assert "does not offer fmi3EnterEventMode" in refused(unit.enterEventMode)
    kept = unit.getFMUState()
    stored = unit.serializeFMUState(kept)
    assert "this unit's have" in refused(unit.deserializeFMUState, stored[:-8])
    unit.setFMUState(kept)
    unit.doStep(0.0, STEP)  # after all of this, it runs
    unit.freeFMUState(kept)
    unit.terminate()
    assert "after termination" in refused(unit.doStep, STEP, STEP)


def test_it_starts_at_the_speed_that_is_set(exported, opened):
    """The state after a second of a pull is that of the plant in Python at the speed, to the bit."""
    chassis, (unit, references, _) = exported[0], opened
    p = cars.load("compact").plant("lugre", 15.0, chassis=chassis)
    names = [name for name, _ in plant.channels(p)]
    u, record = np.zeros((1000, len(plant.INPUTS))), np.zeros((1000, len(names)))
    u[:, plant.HAND] = 2.0
    plant.run(p, plant.initial_state(p), u, record, 1)
    held = {"single_track": "chassis.v_x", "two_track": "chassis.body.speed"}[chassis]
    unit.setFloat64([references[held]], [15.0])
    unit.setBoolean([references["robot"]], [False])
    begin(unit)
    unit.setFloat64([references["hand_torque"]], [2.0])
    unit.doStep(0.0, 1.0)
    found = np.array(unit.getFloat64([references[name] for name in names]))
    assert np.array_equal(bits(found), bits(record[-1]))


def test_a_c_importer_and_valgrind_find_nothing(tmp_path):
    if shutil.which("valgrind") is None:
        pytest.skip("valgrind is not installed")
    path = fmu.export(tmp_path / "car.fmu", fmi=3)  # valgrind knows no AVX-512, which this processor may have
    fmpy.extract(str(path), str(tmp_path / "unit"))
    (binary,) = (tmp_path / "unit" / "binaries" / "x86_64-linux").iterdir()
    program, source = tmp_path / "harness3", Path(__file__).with_name("harness3.c")
    include = f"-I{fmpy.__path__[0]}/c-code"
    strict = ["-std=gnu11", "-g", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["cc", *strict, include, source, "-o", program, "-ldl", "-lm"], check=True)
    token = fmpy.read_model_description(str(path)).instantiationToken
    command = ["valgrind", "--error-exitcode=9", "--leak-check=full", "--quiet", program, binary, token, "50", "20"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
