"""The exported car against the plant in Python, the standard's rules and a C importer."""

import dataclasses
import json
import math
import re
import shutil
import subprocess
import sys
import zipfile
from itertools import product
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import validation

from steer_env import friction, manoeuvres
from steer_env.connect import fmu
from steer_env.connect.variables import variables
from steer_env.friction.numerics.frozen import frozen
from steer_env.vehicle import cars, plant, subsystems
from tests.connect.fmu.runs import STEP, begin, bits, hand_names, opened, replay
from tests.needs import needs

if shutil.which("cc") is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

HARNESS = Path(__file__).with_name("harness.c")
ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def weave(tmp_path_factory):
    """A unit for the weave on one track, for this processor."""
    m = manoeuvres.make("weave")
    path = tmp_path_factory.mktemp("weave") / "weave.fmu"
    return m, fmu.export(path, friction="lugre", speed=m.speed, robot=True, cpu="native")


def in_python(p, u, names):
    """Channels (T, C) of the plant in Python, and those of its start."""
    record = np.zeros((len(u), len(names)))
    state, row = plant.settled(p)
    plant.run(p, state, u, record, 1)
    return record, row


def compared(m, path, folder, law, duration):
    """Channels of a unit and of Python over part of a manoeuvre with a steering robot."""
    p = manoeuvres.build_plant(cars.load("compact"), m, law)
    u = manoeuvres.inputs(m, 0.2, duration)
    names = [name for name, _ in plant.channels(p)]
    expected, start = in_python(p, u, names)
    with opened(path, folder) as (unit, references, said):
        begin(unit)
        first = unit.getReal([references[name] for name in names])
        assert np.array_equal(bits(np.array(first)), bits(start))
        found = replay(unit, references, u, hand_names(m.robot), names)
        assert not said
    return expected, found


def test_weave_is_that_of_python_to_the_bit(weave, tmp_path):
    m, path = weave
    expected, found = compared(m, path, tmp_path, "lugre", 20.0)
    assert np.ptp(expected[:, plant.CHANNEL["lateral_acceleration"]]) > 3.0  # the car does turn
    assert np.array_equal(bits(expected), bits(found))


CHASSIS = ("single_track", "two_track")
# Each law on one chassis, by turns, and two laws on both.
CARS = {*zip(friction.available(), CHASSIS * len(friction.available())), *product(("lugre", "masing"), CHASSIS)}
# A worm gear with friction above the bar.
WORM = "masing,efficiency=0.88@gear"
SITES = {*zip((f"{WORM}+lugre,F_c=0.1@upper_column", f"{WORM}+coulomb,F_c=0.1@upper_column"), CHASSIS)}


@pytest.mark.whole
@pytest.mark.parametrize(("law", "chassis"), sorted(CARS | SITES))
def test_a_whole_weave_with_every_law(law, chassis, tmp_path):
    m = dataclasses.replace(manoeuvres.make("weave"), chassis=chassis)
    path = fmu.export(tmp_path / "car.fmu", friction=law, chassis=chassis, speed=m.speed, robot=True, cpu="native")
    assert path.stat().st_size < 2e6
    assert validation.validate_fmu(str(path)) == []
    expected, found = compared(m, path, tmp_path / "unit", law, m.duration)
    assert np.array_equal(bits(expected), bits(found))


def test_validation_has_no_remark(weave):
    assert validation.validate_fmu(str(weave[1])) == []


def test_description_has_units_and_the_start_values_of_python(weave):
    m, path = weave
    p = manoeuvres.build_plant(cars.load("compact"), m, "lugre")
    listed = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    assert all(v.unit and v.description for v in listed.values() if v.type == "Real")
    assert (listed["column.K_tb"].unit, listed["friction.sigma_0"].unit) == ("N m/rad", "N m/rad")
    starts = {
        "column.I2": p.column.I2,
        "assist.boost[2,3]": p.assist.boost[1, 2],
        "assist.damping[6]": p.assist.damping[5],
        "friction.F_c": p.friction.F_c,
        "chassis.m": p.chassis.m,
        "chassis.v_x": m.speed,
        "tyre.PKY1": p.tyre[0].PKY1,
        "pinion_radius": p.pinion_radius,
        "level.load": p.level.load,
    }
    assert {name: float(listed[name].start) for name in starts} == starts
    assert {name: listed[name].variability for name in ("column.I2", "friction.F_c", "chassis.m", "chassis.v_x")} == {
        "column.I2": "tunable",
        "friction.F_c": "tunable",
        "chassis.m": "fixed",
        "chassis.v_x": "fixed",
    }


SIGNED = re.compile("positive|increase|decrease")  # words that say which sign means what


@pytest.mark.parametrize("chassis", CHASSIS)
@pytest.mark.parametrize("subsystem", ["car", "chassis"])
def test_every_variable_says_where_it_is_positive(subsystem, chassis):
    """And no two parameters of a part have the same description."""
    listed = variables(subsystems.make(subsystem, cars.load("compact").plant("lugre", 20.0, chassis=chassis), 20.0), 3)
    for v in listed:
        if v.low < 0.0 and (v.use in ("INPUT", "OUTPUT") or math.isfinite(v.low)):
            assert SIGNED.search(v.description) or "temperature" in v.description, v
        assert v.boolean or v.low <= v.start <= v.high, v
    told = [v.description for v in listed if v.array == "NUMBERS" and not v.name.startswith(("tyre.", "friction."))]
    assert len(set(told)) == len(told)


ACTING = {  # so that every parameter matters
    "upper_column": {
        **{"law": "lugre", "F_c": 0.1, "F_s": 0.12, "sigma_1": 0.02, "sigma_2": 0.01},
        **{"position": 0.2, "temperature_rate": 0.01, "temperature_rise": 10.0},
    },
    "gear": {"law": "masing", "efficiency": 0.88, "position": 0.2, "temperature_rate": 0.01, "temperature_rise": 10.0},
}


def test_every_parameter_of_a_site_acts_and_none_lets_friction_shrink_with_its_load():
    p = cars.load("compact").plant(ACTING, 20.0)
    u = np.zeros((400, len(plant.INPUTS)))
    u[:, plant.HAND] = 4.0 * np.sin(2.0 * math.pi * 2.5e-3 * np.arange(400))
    names = [name for name, _ in plant.channels(p)]

    def motion(changed):
        return in_python(p._replace(friction=changed), u, names)[0]

    listed = [v for v in variables(subsystems.make("car", p, 20.0), 2) if v.name.startswith("friction.")]
    expected = motion(p.friction)
    for v in listed:
        site, *path = v.name.removeprefix("friction.").split(".")
        field, _, place = path[-1].partition("[")
        owner = getattr(getattr(p.friction, site), path[0]) if path[1:] else getattr(p.friction, site)
        value = np.array(getattr(owner, field), float)
        value[int(place[:-1]) - 1 if place else ()] += max(0.1 * v.start, 1e-3)
        owner = owner._replace(**{field: frozen(value) if place else float(value)})
        of_site = getattr(p.friction, site)._replace(**{path[0]: owner}) if path[1:] else owner
        assert not np.array_equal(motion(p.friction._replace(**{site: of_site})), expected), v.name
    told = {v.name: v for v in listed}
    assert {v.split(".")[1] for v in told} == {"upper_column", "gear"}
    assert [told[f"friction.gear.{key}"].low for key in ("driving", "driven", "level.load")] == [0.0] * 3


def test_bounds_are_enforced_and_a_refused_call_takes_nothing(weave, tmp_path):
    """Every bound that the description has, on every variable that can be set, alone and behind a good value."""
    from fmpy.fmi1 import FMICallException

    listed = fmpy.read_model_description(str(weave[1])).modelVariables
    beyond = [
        (v.name, bound, np.nextafter(bound, away), word)
        for v in listed
        if v.causality in ("input", "parameter")
        for bound, away, word in ((v.min, -np.inf, "least"), (v.max, np.inf, "most"))
        if bound is not None
        for bound in (float(bound),)
    ]
    assert {"hand_torque", "chassis.v_x", "chassis.mu", "column.K_tb", "rack_limit"} <= {name for name, *_ in beyond}
    with opened(weave[1], tmp_path) as (unit, references, said):
        other = references["wind_force"]
        for name, bound, value, word in beyond:
            before = unit.getReal([other, references[name]])
            with pytest.raises(FMICallException):
                unit.setReal([other, references[name]], [123.0, value])
            assert f"{name} must be at {word} {bound:.9g}, got {value:.17g}" in said[-1]
            assert unit.getReal([other, references[name]]) == before
            unit.setReal([references[name]], [bound])
            unit.setReal([references[name]], before[1:])


def test_types_have_quantities_and_what_a_driver_reads(weave):
    description = fmpy.read_model_description(str(weave[1]))
    listed = {v.name: v for v in description.modelVariables}
    named = {name: v.declaredType for name, v in listed.items() if v.declaredType is not None}
    assert all(
        kind.quantity and float(kind.nominal) > 0.0 and kind.unit == listed[name].unit for name, kind in named.items()
    )
    shown = {"handwheel_angle": "deg", "yaw_rate": "deg/s", "chassis.v_x": "km/h"}
    assert {name: named[name].displayUnit for name in shown} == shown
    factors = {each.name: float(each.factor) for unit in description.unitDefinitions for each in unit.displayUnits}
    assert factors == {"deg": pytest.approx(180.0 / math.pi), "deg/s": factors["deg"], "km/h": 3.6, "mm": 1000.0}


def test_the_same_export_gives_the_same_bytes(tmp_path, monkeypatch):
    """With the date from outside."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    first, again = (
        fmu.export(tmp_path / name, subsystem="steering", platforms=["linux64", "source"], fmi=3)
        for name in ("first.fmu", "again.fmu")
    )
    assert first.read_bytes() == again.read_bytes()
    about = fmpy.read_model_description(str(first))
    assert about.generationDateAndTime == "1970-01-02T00:00:00Z"
    assert about.copyright in (ROOT / "LICENSE").read_text()
    assert about.author in (ROOT / "CITATION.cff").read_text()
    assert (about.license, about.generationTool) == ("MIT", f"steer-env {about.version}")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(ValueError, match="SOURCE_DATE_EPOCH must be a whole number of seconds"):
        fmu.export(tmp_path / "car.fmu", subsystem="steering")


def test_units_are_products_of_base_units():
    from steer_env.connect.fmu.description import base_unit

    assert base_unit("N m s/rad") == {"kg": 1, "m": 2, "s": -1, "rad": -1}
    assert base_unit("m/s2") == {"m": 1, "s": -2}
    assert base_unit("1") == {}
    assert base_unit("furlong/s") is None


def test_the_unit_tells_what_it_is_made_of(weave):
    """The car and the law in the archive make the same plant again."""
    m, path = weave
    with zipfile.ZipFile(path) as archive:
        found = json.loads(archive.read("resources/made_of.json"))
        assert b"handwheel angle" in archive.read("documentation/index.html")
        assert archive.read("model.png")[1:4] == b"PNG"
    again = cars.load(found["car"]).plant(found["friction"], found["speed_m_s"], found["robot"])
    assert repr(again) == repr(manoeuvres.build_plant(cars.load("compact"), m, "lugre"))


def test_longer_steps_end_where_steps_of_a_millisecond_do(weave, tmp_path):
    _, path = weave
    with opened(path, tmp_path) as (unit, references, _):
        begin(unit)
        wanted = [references["handwheel_angle"], references["handwheel_speed"], references["yaw_rate"]]
        hands = [references["hand_angle"], references["hand_speed"]]
        unit.setReal(hands, [0.1, 0.5])
        unit.doStep(0.0, 0.02)
        assert unit.getReal(wanted)[:2] == [0.1, 0.5]
        unit.reset()
        begin(unit)
        # The cubic that meets 0 rad at rest and 0.1 rad at 0.5 rad/s, 20 ms later.
        for k in range(20):
            s = (k + 1) / 20
            angle = 0.1 * s * s * (3 - 2 * s) + 0.02 * 0.5 * s * s * (s - 1)
            speed = (0.6 * s * (1 - s) + 0.01 * s * (3 * s - 2)) / 0.02
            unit.setReal(hands, [angle, speed])
            unit.doStep(k * STEP, STEP)
        steps = unit.getReal(wanted)
    with opened(path, tmp_path) as (unit, references, _):
        begin(unit)
        unit.setReal(hands, [0.1, 0.5])
        unit.doStep(0.0, 0.02)
        assert unit.getReal(wanted) == pytest.approx(steps, rel=1e-12)


def test_parameters_settle_and_act_as_in_python(weave, tmp_path):
    """Changed parameters give the run of a plant with these numbers, from its own straight running."""
    m, path = weave
    p = manoeuvres.build_plant(cars.load("compact"), m, "lugre")
    p = p._replace(
        column=p.column._replace(K_tb=110.0),
        friction=p.friction._replace(F_c=1.3, F_s=1.3),
        chassis=p.chassis._replace(m=1300.0, mu=0.8),
        robot=0.0,
    )
    u = np.zeros((500, len(plant.INPUTS)))
    u[:, plant.HAND] = 1.5
    names = [name for name, _ in plant.channels(p)]
    expected, start = in_python(p, u, names)
    changed = {"column.K_tb": 110.0, "friction.F_c": 1.3, "friction.F_s": 1.3, "chassis.m": 1300.0, "chassis.mu": 0.8}
    with opened(path, tmp_path) as (unit, references, _):
        unit.setupExperiment()
        unit.setReal([references[name] for name in changed], list(changed.values()))
        unit.enterInitializationMode()
        unit.setBoolean([references["robot"]], [False])
        first = unit.getReal([references[name] for name in names])
        assert np.array_equal(bits(np.array(first)), bits(start))
        unit.exitInitializationMode()
        found = replay(unit, references, u, hand_names(False), names)
    assert np.array_equal(bits(expected), bits(found))


def test_what_may_be_set_when(weave, tmp_path):
    from fmpy.fmi1 import FMICallException

    with opened(weave[1], tmp_path) as (unit, references, said):

        def refused(name, value):
            with pytest.raises(FMICallException):
                unit.setReal([references[name]], [value])
            return said[-1]

        assert "yaw_rate is an output" in refused("yaw_rate", 0.0)
        robot, other = references["robot"], references["yaw_rate"]
        (before,) = unit.getBoolean([robot])
        with pytest.raises(FMICallException):  # nothing of a bad call is taken
            unit.setBoolean([robot, other], [not before, True])
        assert unit.getBoolean([robot]) == [before]
        begin(unit)
        assert "chassis.m is fixed" in refused("chassis.m", 1300.0)
        assert "chassis.v_x is fixed" in refused("chassis.v_x", 20.0)
        unit.setReal([references["friction.F_c"]], [1.5])
        assert unit.getReal([references["friction.F_c"]]) == [1.5]


def test_a_run_that_diverges_names_the_state_and_goes_back(weave, tmp_path):
    from fmpy.fmi1 import FMICallException

    with opened(weave[1], tmp_path) as (unit, references, said):
        begin(unit)
        unit.setBoolean([references["robot"]], [False])
        names = [references[name] for name in ("handwheel_speed", "column_angle", "yaw_rate", "handwheel_torque")]
        torque = [references["hand_torque"]]
        unit.setReal(torque, [2.0])
        unit.doStep(0.0, 0.1)
        before = unit.getReal(names)
        damping = [references["column.C_tb"]]
        (usual,) = unit.getReal(damping)
        unit.setReal(damping, [1e308])
        with pytest.raises(FMICallException):
            unit.doStep(0.1, 0.1)
        assert "is no longer finite in the step from 0.1 s" in said[-1]
        assert "the state handwheel_" in said[-1]
        assert unit.getReal(names) == before
        unit.setReal(damping, [usual])
        unit.doStep(0.1, 0.1)
        after = unit.getReal(names)
        unit.reset()
        begin(unit)
        unit.setBoolean([references["robot"]], [False])
        unit.setReal(torque, [2.0])
        unit.doStep(0.0, 0.2)
        assert unit.getReal(names) == after  # as if nothing had happened


def test_two_instances_do_not_know_of_each_other(weave, tmp_path):
    with opened(weave[1], tmp_path / "a") as (a, references, _), opened(weave[1], tmp_path / "a") as (b, _, _):
        begin(a)
        begin(b)
        names = [references["hand_angle"]], [references["lateral_acceleration"]]
        a.setReal(names[0], [0.3])
        for k in range(50):
            a.doStep(k * STEP, STEP)
            b.doStep(k * STEP, STEP)
        assert abs(a.getReal(names[1])[0]) > 0.01
        assert b.getReal(names[1]) == [0.0]


@needs("libcosimpy")
def test_libcosimpy_runs_it_alike(weave, tmp_path):
    """An importer that shares no code with fmpy."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    _, path = weave
    execution = CosimExecution.from_step_size(1_000_000)
    index = execution.add_local_slave(CosimLocalSlave(fmu_path=str(path), instance_name="car"))
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    assert execution.add_observer(observer)
    assert execution.add_manipulator(manipulator)
    with opened(path, tmp_path) as (unit, references, _):
        begin(unit)
        hands = [references["hand_angle"], references["hand_speed"]]
        outputs = [references[name] for name in ("handwheel_torque", "yaw_rate", "lateral_acceleration")]
        for k in range(300):
            t = (k + 1) * STEP
            values = [0.2 * (1.0 - np.cos(3.0 * t)), 0.6 * np.sin(3.0 * t)]
            manipulator.slave_real_values(index, hands, values)
            unit.setReal(hands, values)
            execution.step()
            unit.doStep(k * STEP, STEP)
            assert list(observer.last_real_values(index, outputs)) == pytest.approx(unit.getReal(outputs), rel=1e-9)
        assert abs(unit.getReal(outputs)[2]) > 0.1


def built_harness(folder):
    """The C importer, compiled."""
    include = f"-I{fmpy.__path__[0]}/c-code"
    program = folder / "harness"
    strict = ["-std=gnu11", "-O1", "-g", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["cc", *strict, include, HARNESS, "-o", program, "-ldl", "-lm"], check=True)
    return program


def unpacked(path, folder):
    """Binary of a unit for Linux, and its token."""
    fmpy.extract(str(path), str(folder))
    (binary,) = (folder / "binaries" / "linux64").iterdir()
    return binary, fmpy.read_model_description(str(path)).guid


@pytest.fixture(scope="module")
def harness(weave, tmp_path_factory):
    """Command of the C importer with the unit of the weave."""
    folder = tmp_path_factory.mktemp("harness")
    return [built_harness(folder), *unpacked(weave[1], folder)]


def test_bad_calls_are_refused_and_harmless(harness):
    done = subprocess.run([*harness, "check", "1000", "100"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


SPEEDS = (12.5, 31.0)  # [m/s]


@pytest.mark.parametrize(("chassis", "held"), [("single_track", "chassis.v_x"), ("two_track", "chassis.body.speed")])
def test_the_importer_in_c_drives_a_weave_at_two_speeds_from_one_unit(chassis, held, tmp_path):
    """Each weave is, to the bit and from the first output on, that of a unit which was exported at its speed."""
    program = built_harness(tmp_path)

    def weaves(driven):
        """Outputs at these speeds, by a unit that was exported at the first."""
        path = fmu.export(
            tmp_path / "car.fmu", friction="lugre", chassis=chassis, speed=driven[0], robot=True, cpu="native"
        )
        folder = tmp_path / f"{driven[0]:g}"
        variables = fmpy.read_model_description(str(path)).modelVariables
        references = {v.name: str(v.valueReference) for v in variables}
        inputs = [references[name] for name in ("hand_angle", "hand_speed", held)]
        outputs = [references[v.name] for v in variables if v.causality == "output"]
        speeds = ",".join(map(repr, driven))
        command = [program, *unpacked(path, folder), "weave", "2000", *inputs, speeds, *outputs]
        lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
        return [lines[i : i + 2001] for i in range(0, len(lines), 2001)]

    slow, fast = weaves(SPEEDS)
    assert len(slow) == len(fast) == 2001
    assert slow[-1] != fast[-1]
    assert [fast, slow] == weaves(SPEEDS[::-1])


@pytest.mark.whole
def test_memory_does_not_grow(harness):
    done = subprocess.run([*harness, "check", "1000000", "1000"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert int(done.stdout) < 1_000_000  # one state kept per instance would be 3 MB, one per step 3 GB


@pytest.mark.whole
def test_valgrind_finds_nothing(tmp_path):
    if shutil.which("valgrind") is None:
        pytest.skip("valgrind is not installed")
    path = fmu.export(tmp_path / "car.fmu", friction="lugre")  # valgrind knows no AVX-512, which the processor may have
    command = ["valgrind", "--error-exitcode=9", "--leak-check=full", "--quiet", built_harness(tmp_path)]
    done = subprocess.run([*command, *unpacked(path, tmp_path), "check", "200", "20"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.whole
def test_a_processor_that_lacks_something_is_refused(tmp_path, monkeypatch):
    """The C layer asks the processor before any code for it runs; here for a bit that is reserved, and never set."""
    from steer_env.connect.fmu import object_code

    monkeypatch.setitem(object_code.FEATURES, "cx16", (7, "d", 0))
    path = fmu.export(tmp_path / "car.fmu", cpu="x86-64-v2")
    said = []
    with pytest.raises(Exception, match="instantiate"), opened(path, tmp_path / "unit", log=said):
        pass
    assert "made for processors of level x86-64-v2" in said[0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"subsystem": "engine"}, "subsystem must be one of"),
        ({"cpu": "pentium"}, "cpu must be one of"),
        ({"platforms": ["darwin64"]}, "platform must be one of"),
        ({"platforms": []}, "needs a platform"),
        ({"friction": "glue"}, "unknown friction law"),
        ({"speed": 500.0}, "speed"),
    ],
)
def test_bad_values_are_refused(options, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        fmu.export(tmp_path / "car.fmu", **options)


def test_a_missing_compiler_is_told(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(ValueError, match="apt install gcc"):
        fmu.export(tmp_path / "car.fmu")


@pytest.mark.whole
def test_command_line(tmp_path):
    from steer_env.experiments.cli.main import main

    out = tmp_path / "car.fmu"
    assert main(["export-fmu", "--friction", "masing,elements=4", "--out", str(out)]) == 0
    names = {v.name for v in fmpy.read_model_description(str(out)).modelVariables}
    assert {"friction.k[1]", "friction.k[4]", "assist.boost[6,9]", "hand_torque", "wind_force"} <= names
    assert "throttle_request" not in names  # the speed of a single track is held
    assert main(["export-fmu", "--out", str(tmp_path / "car.zip")]) == 2


def test_help_names_what_there_is():
    from steer_env.connect.fmu import exporter, object_code
    from steer_env.experiments.cli import export_fmu
    from steer_env.experiments.cli.common import options

    assert options.SUBSYSTEMS == subsystems.SUBSYSTEMS
    assert export_fmu.VERSIONS == exporter.VERSIONS
    assert export_fmu.PLATFORMS == (*object_code.PLATFORMS, object_code.SOURCE)
    assert export_fmu.PROCESSORS == object_code.PROCESSOR_NAMES
    assert sys.byteorder == "little"  # of every platform that units are made for


@pytest.mark.parametrize("name", ["car", "chassis"])
def test_a_subsystem_at_another_speed_than_its_plant_is_refused(name):
    p = cars.load("compact").plant(speed=20.0)
    assert subsystems.make(name, p, 20.0).name == name
    with pytest.raises(ValueError, match=f"plant of the {name} drives at 20 m/s, not at 25 m/s"):
        subsystems.make(name, p, 25.0)
