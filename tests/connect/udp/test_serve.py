"""A server over UDP: the numbers of Python to the bit, faults, the rate, the command and clients in other languages."""

import importlib.util
import json
import math
import shutil
import signal
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from steer_env.connect.udp import Client, Server, Stream, layout_of
from steer_env.experiments.cli.main import main
from steer_env.live.real_time.system import Worker
from steer_env.vehicle import plant
from steer_env.vehicle.subsystems import CLASSES, advance
from tests.connect.udp.served import ROOT, FaultyClient, layout, part_of, serving

if sys.platform != "linux":
    pytest.skip("the server needs Linux", allow_module_level=True)

EXAMPLES = ROOT / "examples" / "cosimulation"


def inputs_of(part, n):
    """Inputs (n, I) of a part: the plant's in a lively drive, those of the others like them."""
    t = 1e-3 * np.arange(1.0, n + 1.0)
    known = {
        "hand_torque": 3.0 * np.sin(4.0 * t),
        "hand_angle": 0.4 * np.sin(4.0 * t),
        "hand_speed": 1.6 * np.cos(4.0 * t),
        "assist_request": 0.5 * np.sin(9.0 * t),
        "wind_force": 200.0 * np.sin(2.0 * t),
        "rack_force": 900.0 * np.sin(3.0 * t),
        "vehicle_speed": 20.0 + np.sin(t),
        "rack_travel": 0.01 * np.sin(4.0 * t),
        "rack_speed": 0.04 * np.cos(4.0 * t),
        "brake_request": np.where((t > 0.5) & (t < 0.7), 0.1, 0.0),
    }
    zero = np.zeros(n)
    return np.column_stack([known.get(signal.name, zero) for signal in part.given])


def driven(part, given):
    """Outputs (T, C) of a part under inputs (T, I) as the plant computes them in Python."""
    record = np.zeros((len(given), len(part.outputs)))
    if part.name == "car":
        p = part.parameters
        hands = [1, 2] if p.robot else [0]
        u = np.zeros((len(given), len(plant.INPUTS)))
        u[:, : len(hands)] = given[:, hands]
        u[:, 2 : given.shape[1] - 1] = given[:, 3:]
        assert plant.run(p, part.start.copy(), u, record, 1)
        return record
    state, full, row = part.start.copy(), np.zeros(part.given_size), np.zeros((1, part.inputs))
    for i, values in enumerate(given):
        full[: len(values)] = values
        advance(CLASSES[part.name](part.parameters), state, full, row, record[i : i + 1], 1)
    return record


@pytest.mark.whole
@pytest.mark.parametrize(
    ("name", "law", "chassis", "robot"),
    [
        ("car", "masing", "two_track", True),
        ("steering", "masing", "single_track", False),
        ("steering", "lugre", "single_track", True),
        ("chassis", "lugre", "two_track", False),
        ("chassis", "lugre", "single_track", False),
    ],
)
def test_every_part_over_udp_equals_python_to_the_bit(name, law, chassis, robot):
    """What a client receives is what Python computes."""
    part = part_of(name, friction=law, chassis=chassis, robot=robot)
    given = inputs_of(part, 3000)
    found = np.zeros((len(given), len(part.outputs)))
    with Server(part) as server, Client(server.layout, server.address) as client:
        assert np.array_equal(client.outputs, part.shown)
        for i in range(len(given)):
            found[i] = client.step(given[i])
        assert client.time == pytest.approx(1e-3 * len(given))
    assert server.counts()["samples"] == len(given)
    assert np.ptp(found, axis=0).max() > 1.0
    assert found.tobytes() == driven(part, given).tobytes()


@pytest.mark.parametrize("mode", ["lockstep", "free-running"])
def test_a_client_tunes_parameters_of_the_fmu(mode):
    part = part_of("steering", friction="lugre")
    inputs = [signal.start for signal in part.given]
    with (
        Server(part, mode=mode) as server,
        {"lockstep": Client, "free-running": Stream}[mode](server.layout, server.address) as client,
    ):
        assert client.layout.fingerprint == layout_of(part)._replace(parameters=()).fingerprint  # as before
        with pytest.raises(ValueError, match=r"column\.K_tb must be finite, at least 0, got -1"):
            client.tune("column.K_tb", -1.0)
        with pytest.raises(ValueError, match=r"parameter must be one of column\.I1, .*, got 'column\.K'"):
            client.tune("column.K", 1.0)
        client.tune("friction.F_c", 3.0)
        for i in range(1, 4):
            if mode == "lockstep":
                client.step(inputs, 10)
            else:
                client.put(inputs)
                assert client.get(1.0) is not None
            client.tune("friction.F_s", 3.0 + i)
        names = [parameter.name for parameter in client.layout.parameters]
        places = [client.layout.parameters[names.index(name)].place for name in ("friction.F_c", "friction.F_s")]
        assert server._link.numbers[places].tolist() == [3.0, 6.0]
    assert server.counts()["refused"] == 1


def resident(process):
    """Memory of a process [MB]."""
    told = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
    fields = dict(line.split(":", 1) for line in told.splitlines())
    return float(fields["VmRSS"].split()[0]) / 1024.0


def test_faults_of_the_network_change_nothing():
    """Nor does the server grow, after the first tenth of the exchanges."""
    part, n = part_of("car"), 25_000
    given = inputs_of(part, n)
    names = [signal.name for signal in part.outputs]
    torques = [names.index(name) for name in ("handwheel_torque", "torsion_bar_torque", "motor_torque")]
    largest, before = np.zeros(len(torques)), 0.0
    with serving() as process, FaultyClient(layout(), process.address, 0.02) as client:
        for i in range(n):
            found = client.step(given[i])
            assert math.isfinite(found.sum())
            largest = np.maximum(largest, np.abs(found[torques]))
            if i == n // 10:
                before = resident(process)
        growth = resident(process) - before
        injected = client.injected
    expected = driven(part, given)
    assert found.tobytes() == expected[-1].tobytes()
    assert np.array_equal(largest, np.abs(expected[:, torques]).max(axis=0))
    assert (largest < 50.0).all()
    counts = process.counts
    assert counts["steps"] == n
    for name in ("foreign", "truncated", "damaged", "late"):
        assert counts[name] == injected[name] > 0
    assert counts["refused"] == injected["strange"] > 0
    assert counts["repeated"] >= injected["doubled"] > 0
    print(counts, f"grown by {growth:.3f} MB")
    assert growth < 0.5  # 22 bytes of an exchange, less than an object of Python


def test_ends_on_sigterm_too_and_refuses_in_words(capsys):
    with serving(end=signal.SIGTERM) as process:
        with Client(layout(), process.address) as client:
            with pytest.raises(ValueError, match=r"a step takes 7 inputs \(hand_torque, "):
                client.step([0.0])
            with pytest.raises(ValueError, match=r"an input is not finite or .* \(hand_torque\)"):
                client.step([math.nan] * 7)
        with pytest.raises(ValueError, match="another subsystem"):
            Client(layout("chassis"), process.address)
        port = str(process.address[1])
        assert main(["serve", "--port", port]) == 2
        assert f"port {port}: Address already in use; give" in capsys.readouterr().err
    assert process.returncode == 0
    assert process.counts["refused"] == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--address", "192.0.2.1"], "cannot receive at address 192.0.2.1, port 0: Cannot assign requested address"),
        (["--address", "no.such.host.invalid"], "cannot receive at address no.such.host.invalid"),
        (["--wheel", "0.04,0.5,8", "--torque-limit", "3"], "--torque-limit, --wheel: only with --free-running"),
        (["--free-running", "--wheel", "0.04,0.5,8"], "with hands that give the angle"),
        (["--free-running", "--wheel", "0.04,0,8"], "damping of the wheel [N m s/rad] must be finite and greater"),
        (["--silence", "0"], "--silence must be finite and greater than 0"),
        (
            ["--subsystem", "chassis", "--speed-kph", "500"],
            "speed [km/h] must be finite and at least 10.8 and at most 252",
        ),
    ],
)
def test_a_bad_option_is_one_line(options, message, capsys):
    assert main(["serve", *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_only_loopback_unless_another_address_is_named():
    with Server(part_of()) as made:
        assert made.address[0] == "127.0.0.1"


def test_a_client_without_a_server_is_told():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        with pytest.raises(TimeoutError, match=r"no answer from 127\.0\.0\.1, port .* is 'steer-env serve' there\?"):
            Client(layout(), free.getsockname(), patience=0.01, tries=3)


def sine():
    """Handwheel angle and torsion-bar torque (1000, 2) in the drive of the examples."""
    part = part_of("car")
    given = np.zeros((1000, len(part.given)))
    # as the C library computes it, where numpy's vectors may differ in the last bit
    given[:, 0] = [3.0 * math.sin(2.0 * math.pi * 1e-3 * i) for i in range(1, 1001)]
    return driven(part, given)[:, [plant.CHANNEL["handwheel_angle"], plant.CHANNEL["torsion_bar_torque"]]]


@pytest.fixture
def port():
    """A port that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def test_a_client_that_is_started_before_its_server_waits_for_it(port):
    part = part_of("steering")
    with ThreadPoolExecutor(1) as pool:
        early = pool.submit(Client, layout_of(part), ("127.0.0.1", port), tries=1000)
        with Server(part, port=port) as server, early.result() as client:
            found = client.step([3.0, 0.0, 0.0, 0.0, 500.0, 20.0])
            assert server.counts()["sessions"] == 1
    assert np.isfinite(found).all()


def test_a_client_at_a_port_of_nobody_is_told_to_wait_for_ready(port):
    with pytest.raises(
        TimeoutError, match=rf"nothing receives at 127\.0\.0\.1, port {port}: .* wait for its line 'ready'"
    ):
        Client(layout("steering"), ("127.0.0.1", port), patience=0.01, tries=2)


def test_a_client_is_told_when_the_session_of_another_ends():
    part = part_of("steering")
    busy = pytest.raises(ValueError, match=r"busy: .* ends in 30 s if that stays silent")
    with Server(part, silence=30.0) as server, Client(server.layout, server.address), busy:
        Client(server.layout, server.address)


def test_a_server_takes_its_port_when_it_has_compiled(monkeypatch, port):
    """A client is not kept waiting at a port behind which nothing answers yet."""
    taken = []
    real = Worker.__init__

    def compiling(self, *arguments):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.bind(("127.0.0.1", port))
            taken.append(port)
        real(self, *arguments)

    monkeypatch.setattr(Worker, "__init__", compiling)
    with Server(part_of("steering"), port=port) as server:
        assert server.address == ("127.0.0.1", port)
    assert taken


def test_the_example_in_python(capsys):
    spec = importlib.util.spec_from_file_location("cosimulation_client", EXAMPLES / "client.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    assert main(["serve", "--describe", "json"]) == 0
    described = json.loads(capsys.readouterr().out)
    with Server(part_of("car")) as server:
        found = example.main(described, server.address)
    columns = [[row["handwheel_angle"], row["torsion_bar_torque"]] for row in found]
    assert np.array(columns).tobytes() == np.ascontiguousarray(sine()).tobytes()
    assert found[-1]["time"] == pytest.approx(1.0)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_the_example_in_c(tmp_path, capsys):
    assert main(["serve", "--describe", "c"]) == 0
    (tmp_path / "packets.h").write_text(capsys.readouterr().out)
    program = tmp_path / "client"
    flags = ["-std=gnu11", "-Wall", "-Wextra", "-Werror", f"-I{tmp_path}", "-o", str(program)]
    subprocess.run(["cc", *flags, str(EXAMPLES / "client.c"), "-lm"], check=True)
    with Server(part_of("car")) as server:
        done = subprocess.run([program, *map(str, server.address)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = np.array([line.split() for line in done.stdout.splitlines()], float)
    assert found[:, 1:].tobytes() == np.ascontiguousarray(sine()).tobytes()
