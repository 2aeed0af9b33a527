"""A vehicle of somebody else, with units and signs of its own, drives the steering; what cannot be used is refused."""

import re
import shutil
import stat
import zipfile
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from steer_env import manoeuvres, metrics
from steer_env.connect import external as coupling
from steer_env.connect.external.fmu_vehicle import FmuVehicle
from steer_env.experiments.cli.main import main
from steer_env.manoeuvres.common.driving import WholeCar
from steer_env.vehicle import cars, plant, road
from tests.connect.external import foreign

if shutil.which("cc") is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

CAR = cars.load("compact")
G = 9.80665


@pytest.fixture(scope="module")
def binary(tmp_path_factory):
    return foreign.library(tmp_path_factory.mktemp("binary"))


@pytest.fixture
def vehicle(tmp_path, binary):
    """The mapping of a whole unit."""
    return foreign.write(tmp_path, {"modelDescription.xml": foreign.description(), foreign.BINARY: binary})


def changed(path, *pairs):
    """The mapping with some of its text replaced."""
    text = path.read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return str(path)


def driven(chassis, name="weave", **options):
    manoeuvre = manoeuvres.make(name, **options)
    with coupling.opened(chassis, manoeuvre.speed) as simulator:
        return manoeuvres.drive(CAR, manoeuvre, simulator=simulator)


def test_units_and_signs_of_the_mapping(vehicle):
    """What the vehicle computes from the rack travel in millimetres to the right arrives in SI, left positive."""
    found = driven(vehicle, cycles=4)
    rack = CAR.plant().pinion_radius * found["column_angle"]
    assert np.ptp(rack) > 1e-3
    np.testing.assert_allclose(found["rack_force"], 20e3 * rack, rtol=1e-12)
    np.testing.assert_allclose(found["lateral_acceleration"], 62.5 * G * rack, rtol=1e-12)
    np.testing.assert_allclose(found["yaw_rate"], np.radians(1200.0) * rack, rtol=1e-12)
    np.testing.assert_allclose(found["vehicle_speed"], 100.0 / 3.6, rtol=1e-12)
    np.testing.assert_allclose(found["x"], 100.0 / 3.6 * found.time, rtol=1e-9)  # from the start
    assert found["lateral_acceleration"].max() == pytest.approx(2.0, rel=1e-4)  # that of the weave
    assert found.meta["external_vehicle"] == "foreign.fmu"


def test_a_channel_that_the_vehicle_does_not_give_is_absent(vehicle):
    path = changed(vehicle, ('yaw_rate = {variable = "Body.yaw", unit = "deg/s"}\n', ""))
    found = driven(path)
    assert "yaw_rate" not in found.channels
    assert "roll_angle" not in found.channels
    values = metrics.evaluate(found)
    assert "yaw_rate" in values["yaw_rate_gain"].reason
    assert np.isnan(values["yaw_rate_gain"].value)
    assert values["torque_at_0g"].reason == ""
    assert "wheelbase_m" not in found.meta


def test_the_geometry_of_the_mapping_is_that_of_the_recording(vehicle):
    path = changed(vehicle, ("[inputs]", "meta = {wheelbase_m = 2.5}\n[inputs]"))
    assert driven(path, "pulse").meta["wheelbase_m"] == 2.5


def test_speed_is_set_before_the_start(vehicle):
    assert driven(vehicle, "sine")["vehicle_speed"][0] == pytest.approx(80.0 / 3.6)
    path = changed(vehicle, ('start_speed = {variable = "Init.speed"}\n', ""))
    with pytest.raises(ValueError, match=r"foreign.fmu starts at 100 km/h and does not reach the 80 km/h"):
        driven(path, "sine")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("crosswind", "crosswind needs the input wind_force, which foreign.fmu does not take"),
        ("obstacle-avoidance", "needs the input coast"),
        ("double-lane-change", "the driver gives no number, as foreign.fmu does not give lateral_speed"),
    ],
)
def test_a_manoeuvre_that_needs_more_is_refused(name, reason, vehicle):
    with pytest.raises(ValueError, match=reason):
        driven(vehicle, name)


def test_a_run_that_the_vehicle_ends_tells_who_and_when(vehicle):
    path = changed(vehicle, ("[outputs]", "[parameters]\nbreaks = 1.2345\nends = 9.0\n[outputs]"))
    with pytest.raises(coupling.CouplingError, match=r"foreign.fmu gave Body.yaw = nan at 1\.235 s"):
        driven(path)
    changed(vehicle, ("breaks = 1.2345", "breaks = 100"), ("ends = 9.0", "ends = 0.5"))
    with pytest.raises(coupling.CouplingError, match=r"foreign.fmu refused a step at 0\.5 s: it ran out of road at"):
        driven(path)


def test_two_vehicles_do_not_meet(vehicle):
    """Each start is a new instance, and two of them run side by side."""
    one, other = FmuVehicle(vehicle), FmuVehicle(vehicle)
    for each in (one, other):
        each.start(20.0)
    a, b = one.step(np.array([1e-3]), 1), other.step(np.array([-2e-3]), 1)
    force = one.gives.index("rack_force")
    assert (a[force], b[force]) == pytest.approx((20.0, -40.0))
    assert one.start(20.0)[force] == 0.0
    for each in (one, other):
        each.close()


# Name of a fault -> files of the unit, and what the message has to say.
FAULTS = {
    "climbs": ({"../evil.txt": b""}, r"'\.\./evil\.txt', which climbs out of the folder"),
    "climbs within": ({"binaries/../../evil.txt": b""}, "climbs out of the folder"),
    "climbs by Windows": ({"..\\evil.txt": b""}, "climbs out of the folder"),
    "absolute": ({"/tmp/evil.txt": b""}, "climbs out of the folder"),
    "drive": ({"C:\\evil.txt": b""}, "climbs out of the folder"),
    "version": ({"modelDescription.xml": foreign.description("1.0")}, r"is of FMI 1\.0; 2\.0 and 3\.0 can be loaded"),
    "no version": ({"modelDescription.xml": "<fmiModelDescription/>"}, "is of FMI no version"),
    "no XML": ({"modelDescription.xml": "no XML"}, "modelDescription.xml is not valid"),
    "another XML": ({"modelDescription.xml": '<other fmiVersion="2.0"/>'}, "modelDescription.xml is not valid"),
    "exchange": (
        {"modelDescription.xml": foreign.description(kind="ModelExchange")},
        "is for model exchange only, which needs a solver",
    ),
    "identifier": (
        {"modelDescription.xml": foreign.description(identifier="../../foreign")},
        "modelIdentifier must be a C identifier",
    ),
    "platform": ({foreign.BINARY: None, "binaries/mac/foreign.dylib": b""}, "it has binaries for mac: export it for"),
    "no binary": ({foreign.BINARY: None}, "it has binaries for none"),
    "description": ({"modelDescription.xml": None}, "is no FMU: it holds no modelDescription.xml"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_unit_that_cannot_be_used_is_refused_before_its_code_runs(fault, tmp_path, binary, monkeypatch):
    marker = tmp_path / "loaded"
    monkeypatch.setenv("STEER_LOADED", str(marker))
    files = {"modelDescription.xml": foreign.description(), foreign.BINARY: binary, **FAULTS[fault][0]}
    path = foreign.write(tmp_path, {name: contents for name, contents in files.items() if contents is not None})
    with pytest.raises(ValueError, match=FAULTS[fault][1]):
        FmuVehicle(path)
    assert not marker.exists()


def test_the_code_of_a_good_unit_runs(vehicle, monkeypatch, tmp_path):
    """The marker of the test above is one that a loaded unit leaves."""
    monkeypatch.setenv("STEER_LOADED", str(tmp_path / "loaded"))
    FmuVehicle(vehicle).close()
    assert (tmp_path / "loaded").exists()


def test_a_link_and_a_file_that_is_no_archive_are_refused(vehicle):
    unit = vehicle.with_name("foreign.fmu")
    with zipfile.ZipFile(unit, "a") as archive:
        link = zipfile.ZipInfo("resources/link")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, "/etc")
    with pytest.raises(ValueError, match="holds the link 'resources/link'"):
        FmuVehicle(vehicle)
    unit.write_bytes(b"no archive")
    with pytest.raises(ValueError, match=f"{re.escape(str(unit))} is no FMU, which is a zip archive"):
        FmuVehicle(vehicle)


def test_a_lateral_acceleration_that_stays_zero_is_refused(vehicle):
    """As an integrator's first unit has it."""

    class Still(WholeCar):
        def run(self, p, state, inputs, record, substeps):
            fine = super().run(p, state, inputs, record, substeps)
            record[:, plant.CHANNEL["lateral_acceleration"]] = 0.0
            return fine

    with pytest.raises(ValueError, match="weave: no handwheel amplitude reaches"):
        manoeuvres.drive(CAR, manoeuvres.make("weave"), simulator=Still())


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('"Rack.q"', '"Rack.p"', "inputs.rack_travel: there is no variable 'Rack.p', did you mean Rack.q or"),
        ('variable = "Rack.q"', 'variable = "Rack.force"', "Rack.force is of causality output, which cannot be set"),
        ("rack_travel =", "rack_speed =", "has no input rack_travel, which an external vehicle needs: add it"),
        ("rack_force =", "front_lateral_force =", "has no output rack_force"),
        ("vehicle_speed =", "longitudinal_speed =", "comes either from the output vehicle_speed or from speed_m_s"),
        ("yaw_rate =", "yaw_speed =", "outputs.yaw_speed: nothing is known as 'yaw_speed', did you mean"),
        (', unit = "deg/s"', "", "outputs.yaw_rate has no unit: give one"),
        ('"deg/s"', '"deg"', "outputs.yaw_rate.unit 'deg' does not fit a quantity that is kept in 'rad/s'"),
        ('"deg/s"', '"furlong"', "outputs.yaw_rate.unit 'furlong' is not known"),
        ("sign = -1", "sign = 2", "sign must be 1 or -1, got 2"),
        ("sign = -1", "factor = -1", "has no key 'factor'"),
        ("[inputs]", "step_ms = 0\n[inputs]", "step_ms must be a whole number of at least 1, got 0"),
        ("[inputs]", "step_ms = 1.5\n[inputs]", "step_ms must be a whole number"),
        ("[inputs]", "step_ms = 1000\n[inputs]", "step_ms must be finite and at most 100"),
        ("[inputs]", "meta = {wheels = 4}\n[inputs]", "meta has no key 'wheels'"),
        ("[inputs]", "parameters = {mass = 4}\n[inputs]", "parameters.mass: there is no variable 'mass'"),
        ("[inputs]", "unit = 1\n[inputs]", "a mapping has no key 'unit'"),
        ("[inputs]", "time_limit_s = 0\n[inputs]", "time_limit_s must be finite and greater than 0"),
        ("[inputs]", "own_process = false\ntime_limit_s = 9\n[inputs]", "time_limit_s needs own_process = true"),
        ('fmu = "foreign.fmu"', "", "a mapping names its unit"),
        ('{variable = "Body.ay"}', '"Body.ay"', "outputs.lateral_acceleration must name a variable"),
        ("[inputs]", "[inputs", "vehicle.toml"),
    ],
)
def test_a_mapping_that_cannot_be_used_is_refused(old, new, reason, vehicle):
    with pytest.raises(ValueError, match=re.escape(reason)):
        FmuVehicle(changed(vehicle, (old, new)))


def test_a_unit_with_other_names_needs_a_mapping(vehicle):
    with pytest.raises(ValueError, match=r"has no input rack_travel, .*: write a mapping \(docs/fmu.md\)"):
        FmuVehicle(vehicle.with_name("foreign.fmu"))


def test_where_no_external_vehicle_can_be(vehicle):
    weave = manoeuvres.make("weave")
    for refused in (
        lambda: gymnasium.make("steer_env/AssistWeave-v3", chassis=str(vehicle)),
        lambda: gymnasium.make("steer_env/TuneOnCentre-v3", chassis=str(vehicle)),
        lambda: CAR.plant(chassis=str(vehicle)),
        lambda: manoeuvres.drive(CAR, replace(weave, chassis=str(vehicle))),
    ):
        with pytest.raises(ValueError, match="is an external vehicle, which drives in manoeuvres only"):
            refused()
    with (
        coupling.opened(vehicle, weave.speed) as simulator,
        pytest.raises(ValueError, match="has a road of its own: leave out that of weave"),
    ):
        manoeuvres.drive(CAR, replace(weave, road=road.iso8608(0, "C")), simulator=simulator)


@pytest.mark.whole
def test_command_line(vehicle, tmp_path, capsys):
    assert main(["run", "weave", "--chassis", str(vehicle), "--out", str(tmp_path)]) == 0
    assert main(["rerun", str(tmp_path / "weave.csv")]) == 0
    for word in ("three_track", str(tmp_path / "missing.fmu")):
        with pytest.raises(SystemExit):
            main(["run", "weave", "--chassis", word])
    assert "there is no file" in capsys.readouterr().err
