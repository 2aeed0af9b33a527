"""The chassis of this project as an external vehicle: as a unit of FMI 2.0 and 3.0, and over UDP."""

import json
import shutil
from dataclasses import replace

import fmpy
import numpy as np
import pytest

from steer_env import manoeuvres, metrics
from steer_env.connect import fmu
from steer_env.connect.external import Coupled, Coupling, CouplingError, FmuVehicle, UdpVehicle, mapping, opened
from steer_env.connect.udp import Server
from steer_env.experiments.reports import report
from steer_env.experiments.reports.report_results import Scope
from steer_env.friction import make
from steer_env.vehicle import cars, plant, subsystems

if shutil.which("cc") is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

pytestmark = pytest.mark.whole

CAR = cars.load("compact")
SPEED = 100.0 / 3.6


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    return fmu.export(tmp_path_factory.mktemp("unit") / "chassis.fmu", subsystem="chassis", speed=SPEED)


@pytest.fixture(scope="module")
def standing(tmp_path_factory):
    """A mapping of a unit at standstill that does not set the speed to start at."""
    path = tmp_path_factory.mktemp("standing") / "chassis.fmu"
    fmu.export(path, subsystem="chassis", chassis="two_track", speed=0.0)
    mapped = mapping.load(path, {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables})
    assert mapped.inputs.pop("start_speed").variable == "chassis.body.speed"
    entries = (("inputs", mapped.inputs), ("outputs", mapped.outputs))
    lines = [f"[{kind}.{name}]\nvariable = '{e.variable}'" for kind, of in entries for name, e in of.items()]
    toml = path.with_suffix(".toml")
    toml.write_text("\n".join([f"fmu = '{path.name}'", *lines]))
    return toml


def hard_sine(samples=4000):
    """Inputs (T, I) with wind and a disturbance of the rack."""
    t = 1e-3 * np.arange(1.0, samples + 1.0)
    u = np.zeros((samples, len(plant.INPUTS)))
    u[:, plant.HAND] = 4.0 * np.sin(4.0 * t)
    u[:, 2], u[:, 3], u[:, 5] = 0.5 * np.sin(9.0 * t), 200.0 * np.sin(2.0 * t), 100.0 * np.sin(5.0 * t)
    return u


def coupled_run(vehicle, law, coupling):
    """Channels (T, C) of our steering with a vehicle."""
    p = CAR.plant(law, SPEED, chassis="two_track")
    coupled = Coupled(vehicle, SPEED, coupling)
    state, row = coupled.settled(p)
    u = hard_sine()
    record = np.zeros((len(u), row.size))
    coupled.run(p, state, u[:1234], record[:1234], 1)  # a run goes on from where the last one ended
    coupled.run(p, state, u[1234:], record[1234:], 1)
    vehicle.close()
    return record[:, : len(plant.CHANNELS)]


def divided_drive(manoeuvre, unit):
    """A manoeuvre of our steering with a unit."""
    with opened(unit, manoeuvre.speed) as simulator:
        return manoeuvres.drive(CAR, manoeuvre, simulator=simulator)


@pytest.mark.parametrize("law", ["lugre", "masing", "coulomb"])
def test_the_divided_car_converges_to_the_whole_one(law, unit):
    p = CAR.plant(law, SPEED)
    whole = np.zeros((4000, len(plant.CHANNELS)))
    plant.run(p, plant.initial_state(p), hard_sine(), whole, 1)
    span = np.ptp(whole, axis=0)
    seen = span > 0.0
    seen[plant.CHANNEL["friction_torque"]] = False  # Coulomb's jumps, so that a shift of microseconds is a large error
    errors = [
        (np.abs(coupled_run(FmuVehicle(unit), law, coupling) - whole).max(axis=0)[seen] / span[seen]).max()
        for coupling in (Coupling(), Coupling(extrapolated=False), Coupling(delay=True))
    ]
    assert errors[0] < 1e-4
    assert errors[0] < 0.1 * errors[1]
    assert errors[0] < 0.1 * errors[2]


def test_every_way_to_the_vehicle_gives_the_same_bits(unit, tmp_path):
    third = fmu.export(tmp_path / "third.fmu", subsystem="chassis", speed=SPEED, fmi=3)
    reference = coupled_run(FmuVehicle(unit, own_process=False), "lugre", Coupling())
    assert np.array_equal(coupled_run(FmuVehicle(unit), "lugre", Coupling()), reference)
    assert np.array_equal(coupled_run(FmuVehicle(third), "lugre", Coupling()), reference)
    with Server(subsystems.make("chassis", CAR.plant("lugre", SPEED), SPEED)) as server:
        assert np.array_equal(
            coupled_run(UdpVehicle(server.layout, server.address, SPEED), "lugre", Coupling()), reference
        )
        with pytest.raises(CouplingError, match="does not report its speed"):
            UdpVehicle(server.layout, server.address)


def test_a_vehicle_behind_a_silent_port_is_told(unit):
    with Server(subsystems.make("chassis", CAR.plant("lugre", SPEED), SPEED)) as server:
        vehicle = UdpVehicle(server.layout, server.address, SPEED)
        vehicle.start(SPEED)
        first = vehicle.step(np.array([1e-3, 0.0, 0.0, 0.0]), 1)
        assert first[vehicle.gives.index("vehicle_speed")] == SPEED
        with pytest.raises(CouplingError, match=r"must be finite|refused"):
            vehicle.step(np.array([np.nan, 0.0, 0.0, 0.0]), 1)
        vehicle.close()
        with pytest.raises(CouplingError, match="was not started"):
            vehicle.step(np.zeros(4), 1)


@pytest.mark.parametrize("name", ["step-steer", "hold", "double-lane-change", "obstacle-avoidance", "rig"])
def test_a_chassis_that_stands_is_brought_to_the_speed_of_the_manoeuvre(name, standing):
    """It then drives what the whole car drives, as far as the held speeds agree, which do to half a percent."""
    manoeuvre = manoeuvres.make(name)
    whole = metrics.evaluate(manoeuvres.drive(CAR, replace(manoeuvre, chassis="two_track")))
    divided = metrics.evaluate(divided_drive(manoeuvre, standing))
    for metric, value in whole.items():
        assert bool(divided[metric].reason) == bool(value.reason), divided[metric].reason
        if not value.reason:
            assert divided[metric].value == pytest.approx(value.value, rel=0.05, abs=1e-6)


def test_parking_and_a_change_of_speed_that_a_manoeuvre_asks_for(standing):
    for name, options, channel, error in (
        ("parking", {}, "rack_force", 1e-5),
        ("steady-circle", {"climb": 1.5, "highest": 0.3}, "longitudinal_speed", 3e-3),
    ):
        manoeuvre = manoeuvres.make(name, **options)
        whole = manoeuvres.drive(CAR, manoeuvre)
        divided = divided_drive(manoeuvre, standing)
        assert np.abs(divided[channel] - whole[channel]).max() < error * np.ptp(whole[channel])


def test_report_of_the_chassis_is_that_of_the_whole_car(unit, tmp_path):
    scope = Scope(tests={"weave": {}}, vehicle=False, widths=(), steps=(1e-3,), speeds_kph=(0.0,))
    laws = {"lugre": make("lugre")}
    whole = report.build_report(tmp_path / "whole", laws, scope).drives["weave"]["lugre"].values
    report.build_report(tmp_path / "divided", laws, scope._replace(chassis=str(unit)))
    divided = json.loads((tmp_path / "divided" / "metrics.json").read_text())
    for name, value in whole.items():
        assert divided["metrics"]["lugre"][name]["value"] == pytest.approx(value.value, rel=2e-6)
    assert divided["provenance"]["external_vehicle"]["name"] == str(unit)
    assert str(unit) in (tmp_path / "divided" / "index.html").read_text()
