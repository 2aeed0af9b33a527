"""A hostile unit (FMU) in a process of its own: a sentence, and nothing is left behind."""

import fcntl
import os
import shutil
import signal
import subprocess
import sys
import time
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

from steer_env import manoeuvres
from steer_env.connect import external
from steer_env.connect.external import CouplingError, FmuVehicle
from steer_env.connect.external.fmu_vehicle import FOLDER
from steer_env.experiments.cli.main import main
from steer_env.vehicle import cars
from tests.connect.external import foreign

if shutil.which("cc") is None or sys.platform != "linux":
    pytest.skip("there is no C compiler, or no /proc", allow_module_level=True)

PLACES = {
    "load": "loading",
    "instantiate": "its start",
    "setup": "its start",
    "step": "a step",
    "terminate": "its end",
    "free": "its end",
}
QUICK, SLOW = "time_limit_s = 60", "time_limit_s = 4"  # a process starts within it on a busy machine
# What a unit does -> the limit of time, and what the message has to say.
DEEDS = {
    "exit 0": (QUICK, "ended its process in {} with exit code 0"),
    "exit 1": (QUICK, "ended its process in {} with exit code 1"),
    "abort": (QUICK, r"ended its process in {} with signal 6 \(Aborted\)"),
    "segfault": (QUICK, r"ended its process in {} with signal 11 \(Segmentation fault\)"),
    "allocate": (QUICK, r"ended its process in {} .* takes more than 0.5 GB"),
    "leave a child and exit": (QUICK, "ended its process in {} with exit code 0"),
    "close": (QUICK, "ended its process in {} with exit code 1"),
    "scribble": (QUICK, "damaged the answer to {}"),
    "loop": (SLOW, r"did not return from {} at .* s: it may take 4 s"),
    "stop": (SLOW, "did not return from {}"),
    "fork 32": (SLOW, "did not return from {}"),
}
OFTEN = [("step", "exit 0"), ("load", "segfault"), ("terminate", "exit 0"), ("step", "loop")]
# Where it ends and how are told apart from each other: every end in a step and at one more place, one end everywhere.
EACH = [*(("step", deed) for deed in DEEDS), *((place, "exit 0") for place in PLACES), *zip(cycle(PLACES), DEEDS)]
CASES = [*OFTEN, *(pytest.param(*case, marks=pytest.mark.whole) for case in dict.fromkeys(EACH) if case not in OFTEN)]


@pytest.fixture(scope="module")
def binary(tmp_path_factory):
    return foreign.library(tmp_path_factory.mktemp("binary"))


@pytest.fixture
def vehicle(tmp_path, binary, monkeypatch):
    """The mapping of a unit, whose processes this test can tell and whose temporary folders it can see."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("STEER_LOADED", str(tmp_path / "loaded"))
    return written(tmp_path, binary)


def written(folder, binary, limit=QUICK):
    path = foreign.write(folder, {"modelDescription.xml": foreign.description(), foreign.BINARY: binary})
    path.write_text(f"memory_limit_gb = 0.5\n{limit}\n{path.read_text()}")
    return path


def processes(folder):
    """Processes of a test, by its folder in their environment."""
    found = []
    for each in Path("/proc").glob("[0-9]*/environ"):
        try:
            if f"STEER_LOADED={folder}/loaded".encode() in each.read_bytes() and int(each.parent.name) != os.getpid():
                found.append(int(each.parent.name))
        except OSError:  # it has ended, or is not ours
            pass
    return found


def assert_nothing_is_left(folder):
    """Neither a process nor a temporary folder, after at most ten seconds."""
    until = time.monotonic() + 10.0
    while time.monotonic() < until and (processes(folder) or list(folder.glob(f"{FOLDER}*"))):
        time.sleep(0.05)
    assert processes(folder) == []
    assert list(folder.glob(f"{FOLDER}*")) == []


def used(path):
    """One step of a vehicle."""
    vehicle = FmuVehicle(path)
    try:
        vehicle.start(20.0)
        vehicle.step(np.array([1e-3]), 1)
    finally:
        vehicle.close()


@pytest.mark.parametrize(("place", "deed"), CASES)
def test_a_fault_is_a_sentence_and_leaves_nothing(place, deed, vehicle, binary, monkeypatch):
    monkeypatch.setenv("STEER_FAULT", f"{place} {deed}")
    limit, message = DEEDS[deed]
    written(vehicle.parent, binary, limit)
    with pytest.raises(CouplingError, match=f"^foreign.fmu {message.format(PLACES[place])}"):
        used(vehicle)
    assert_nothing_is_left(vehicle.parent)


@pytest.mark.whole
@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_library_that_is_cut_off(share, vehicle, binary):
    written(vehicle.parent, binary[: int(share * len(binary))])
    with pytest.raises(CouplingError, match=r"refused to load|ended its process in loading"):
        used(vehicle)
    assert_nothing_is_left(vehicle.parent)


def test_a_child_that_a_good_unit_leaves_is_ended(vehicle, monkeypatch):
    monkeypatch.setenv("STEER_FAULT", "step leave a child")
    used(vehicle)
    assert_nothing_is_left(vehicle.parent)


@pytest.mark.whole
def test_an_end_of_the_library_that_does_not_return(vehicle, binary, monkeypatch):
    monkeypatch.setenv("STEER_FAULT", "unload loop")
    written(vehicle.parent, binary, SLOW)
    with pytest.raises(CouplingError, match="did not return from its end"):
        used(vehicle)
    assert_nothing_is_left(vehicle.parent)


@pytest.mark.parametrize("killed", ["parent", pytest.param("keeper", marks=pytest.mark.whole)])
def test_a_process_that_is_killed_leaves_nothing(killed, vehicle, monkeypatch):
    """While the unit is in a step without an end."""
    monkeypatch.setenv("STEER_FAULT", "step loop")
    program = f"""
import sys, tempfile, numpy
tempfile.tempdir = {str(vehicle.parent)!r}
from steer_env.connect.external import FmuVehicle
vehicle = FmuVehicle({str(vehicle)!r})
vehicle.start(20.0)
print(vehicle._fmu._process.pid, flush=True)
try:
    vehicle.step(numpy.zeros(1), 1)
finally:
    vehicle.close()
"""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", program], text=True, **pipes) as process:
        keeper = int(process.stdout.readline())
        assert len(processes(vehicle.parent)) == 3
        os.kill(process.pid if killed == "parent" else keeper, signal.SIGKILL)
        said = process.communicate()[1]
    if killed == "keeper":
        assert "foreign.fmu ended its process in a step with signal 9 (Killed)" in said
    assert_nothing_is_left(vehicle.parent)


def test_folders_of_dead_processes_are_removed(vehicle):
    dead, alive = (vehicle.parent / f"{FOLDER}{name}" for name in ("dead", "alive"))
    for folder in (dead, alive):
        folder.mkdir()
        (folder / "file").touch()
    lock = os.open(alive, os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    used(vehicle)
    assert (dead.exists(), alive.exists()) == (False, True)
    os.close(lock)
    used(vehicle)
    assert_nothing_is_left(vehicle.parent)


@pytest.mark.whole
def test_the_same_bits_in_this_process(vehicle):
    """Numbers, meta, and what the unit says."""
    here, there = driven(vehicle, False), driven(vehicle, True)
    assert there.meta == here.meta
    for name, values in here.channels.items():
        assert np.array_equal(there[name], values)
    vehicle.write_text(vehicle.read_text().replace("[outputs]", "[parameters]\nends = 0.5\nbreaks = 9.0\n[outputs]"))
    told = []
    for own_process in (False, True):
        with pytest.raises(CouplingError, match=r"refused a step at 0\.5 s: it ran out of road") as error:
            driven(vehicle, own_process)
        told.append(str(error.value))
    assert told[0] == told[1]


def driven(path, own_process):
    pulse, opened = manoeuvres.make("pulse"), FmuVehicle(path, own_process)
    simulator = external.Coupled(opened, pulse.speed, external.Coupling())
    try:
        return manoeuvres.drive(cars.load("compact"), pulse, simulator=simulator)
    finally:
        opened.close()


@pytest.mark.whole
@pytest.mark.parametrize("fault", ["step exit 0", "step loop", "free exit 0"])
def test_the_exit_code_of_a_command(fault, vehicle, binary, monkeypatch, capsys):
    monkeypatch.setenv("STEER_FAULT", fault)
    written(vehicle.parent, binary, SLOW)
    assert main(["run", "pulse", "--chassis", str(vehicle), "--out", str(vehicle.parent)]) == 2
    assert "foreign.fmu" in capsys.readouterr().err
    assert not (vehicle.parent / "pulse.csv").exists()
    assert_nothing_is_left(vehicle.parent)
