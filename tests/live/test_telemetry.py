"""Telemetry in the packets of Live for Speed: its numbers, read by another decoder, and its faults."""

import math
import socket
import struct
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest

from steer_env.experiments.cli.main import main
from steer_env.live.telemetry import Telemetry, outgauge, outsim, receiver
from steer_env.vehicle import cars, subsystems

# As LFS/docs/InSim.txt declares OutSimPack and OutGaugePack, without the numbers that are optional.
OUTSIM = "<I 3f fff 3f 3f 3i"
OUTGAUGE = "<I 4s H B B f f f f f f f I I f f f 16s 16s"


def driven(chassis="two_track"):
    """Times and named channels at every 10 ms of a left turn, in which the car brakes at last."""
    car = subsystems.make("car", cars.load("compact").plant(speed=25.0, chassis=chassis, robot=True), 25.0)
    names = [signal.name for signal in car.given]
    state, given = car.start.copy(), np.zeros(car.given_size)
    inputs, outputs = np.zeros((1, car.inputs)), np.zeros((1, len(car.outputs)))
    found = []
    for i in range(1, 201):
        t = 0.01 * i
        given[names.index("hand_angle")] = 1.0 * math.sin(0.5 * math.pi * min(t, 1.0)) ** 2
        if "brake_request" in names and t > 1.5:
            given[names.index("brake_request")] = 0.2
        assert subsystems.advance(subsystems.Car(car.parameters), state, given, inputs, outputs, 10)
        found.append((t, dict(zip((signal.name for signal in car.outputs), outputs[0].tolist()))))
    return found


def outsim_read(packet):
    """An OutSimPack in its own axes: X to the right, Y ahead, Z upwards."""
    values = struct.unpack(OUTSIM, packet)
    assert len(packet) == 64
    names = ("time", "turn", "angles", "acceleration", "velocity", "position")
    pieces = (values[0], values[1:4], values[4:7], values[7:10], values[10:13], np.array(values[13:16]) / 65536.0)
    return dict(zip(names, pieces))


def test_outsim_has_the_motion_in_its_own_axes_and_signs():
    samples = driven()
    for n in (100, 140, 199):
        t, now = samples[n]
        found = outsim_read(outsim(samples[n - 2 : n + 1]))
        assert found["time"] == round(1e3 * t)
        assert found["turn"] == pytest.approx((0.0, 0.0, now["yaw_rate"]), rel=1e-6)
        # Its angles turn anticlockwise about Z, X and Y: to the left, with the nose up, and leaning to the right.
        assert found["angles"] == pytest.approx((now["yaw_angle"], -now["pitch_angle"], now["roll_angle"]), rel=1e-6)
        assert found["position"] == pytest.approx((-now["y"], now["x"], now["height"]), abs=1.0 / 65536.0)
        ahead = np.array([-math.sin(now["yaw_angle"]), math.cos(now["yaw_angle"])])
        left = np.array([-ahead[1], ahead[0]])
        velocity, acceleration = (np.array(found[name][:2]) for name in ("velocity", "acceleration"))
        # Those are means of the last 10 and 20 ms, with 5 and 10 ms of delay.
        assert velocity @ ahead == pytest.approx(now["longitudinal_speed"], abs=0.05)
        assert velocity @ left == pytest.approx(now["lateral_speed"], abs=0.08)
        assert acceleration @ left == pytest.approx(now["lateral_acceleration"], abs=0.25)
        assert acceleration @ ahead == pytest.approx(now["longitudinal_acceleration"], abs=0.25)
        assert found["velocity"][2] == found["acceleration"][2] == 0.0
    assert found["angles"][0] > 0.3  # to the left, where the car is by then
    assert found["position"][0] < -5.0
    assert found["angles"][1] < -0.005  # braking, the nose goes down
    assert found["angles"][2] > 0.01  # and in a left turn the body leans to the right
    assert acceleration @ left > 3.0
    assert acceleration @ ahead < -1.0


def test_outgauge_has_speed_gear_and_pedals():
    samples = driven()
    t, now = samples[-1]
    values = struct.unpack(OUTGAUGE, outgauge(samples[-3:]))
    assert struct.calcsize(OUTGAUGE) == 92
    assert values[:5] == (round(1e3 * t), b"\0\0\0\0", 16384 + 32768, round(now["gear"]) + 1, 0)
    assert values[5] == pytest.approx(math.hypot(now["longitudinal_speed"], now["lateral_speed"]), abs=0.05)
    assert values[6:14] == (0.0,) * 8
    assert values[14:17] == pytest.approx((now["throttle"], now["brake_pedal"], 0.0), rel=1e-6)
    assert values[15] > 0.1
    assert values[17:] == (bytes(16), bytes(16))


def test_what_a_chassis_does_not_have_is_zero():
    samples = driven("single_track")
    found = outsim_read(outsim(samples[-3:]))
    assert found["angles"][1] == found["position"][2] == 0.0
    assert math.hypot(*found["velocity"]) == pytest.approx(25.0, abs=0.2)
    values = struct.unpack(OUTGAUGE, outgauge(samples[-3:]))
    assert values[3] == 1  # neutral
    assert values[14:17] == (0.0, 0.0, 0.0)


def test_numbers_that_no_packet_holds_do_not_raise():
    name = ("x", "y", "yaw_angle", "yaw_rate", "roll_angle", "pitch_angle")
    samples = [(0.01 * i, dict.fromkeys(name, 1e300 * i)) for i in range(3)]
    outsim_read(outsim(samples)), outgauge(samples)
    far = [(50_000.0 + 0.01 * i, dict.fromkeys(name, 40_000.0 + i)) for i in range(3)]
    x = outsim_read(outsim(far))["position"][1]
    assert x == pytest.approx(40_002.0 - 65_536.0)  # as the 32 bits wrap
    assert abs(outsim_read(outsim(far))["angles"][0]) <= math.pi


@contextmanager
def listening():
    """A socket that receives telemetry, with its port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(20.0)
        yield made, made.getsockname()[1]


def test_nobody_listens_and_a_source_pauses_or_begins_again():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        closed = made.getsockname()
    samples = driven("single_track")[:40]
    given = iter([None, *samples[:20], samples[19], None, *samples[:20]])
    with (
        listening() as (heard, port),
        Telemetry(lambda: next(given, None), outsim=("127.0.0.1", port), outgauge=closed),
    ):
        times = [outsim_read(heard.recv(4096))["time"] for _ in range(36)]
    once = [10 * i for i in range(3, 21)]
    assert times == once + once


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("70000", "must be a whole number of at least 1 and at most 65535, got '70000'"),
        ("0", "at least 1"),
        ("", "at least 1"),
        ("127.0.0.1:", "at least 1"),
        ("192.0.2.1:4123", "goes to programs on this machine only, 127.0.0.1, got '192.0.2.1'"),
        ("0.0.0.0:4123", "this machine only"),
        ("example.org:4123", "this machine only"),
        ("::1:4123", "this machine only"),
    ],
)
def test_where_telemetry_may_go(text, message, capsys):
    with pytest.raises(ValueError, match=message.replace(".", r"\.")):
        receiver(text)
    for command in ("drive", "serve"):
        with pytest.raises(SystemExit):
            main([command, "--outsim", text])
        assert message in capsys.readouterr().err


def test_receivers():
    assert receiver("4123") == receiver("127.0.0.1:4123") == receiver("localhost:4123") == ("127.0.0.1", 4123)
    with pytest.raises(ValueError, match="this machine only"):
        Telemetry(lambda: None, outsim=("192.0.2.1", 4123))


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux")
def test_a_drive_tells_where_it_is_while_a_closed_port_refuses(tmp_path, capsys):
    with listening() as (heard, port):
        options = ["--device", "fake", "--headless", "--seconds", "1.5", "--out", str(tmp_path)]
        code = main(["drive", *options, "--outsim", str(port), "--outgauge", "1"])
        heard.setblocking(False)
        packets = []
        while True:
            try:
                packets.append(outsim_read(heard.recv(4096)))
            except BlockingIOError:
                break
    assert code == 0
    assert len(packets) > 50  # 100 in a second, on a machine that may be busy
    times = np.array([packet["time"] for packet in packets])
    assert (np.diff(times) > 0).all()
    speeds = np.array([packet["velocity"][1] for packet in packets])
    np.testing.assert_allclose(speeds, 100.0 / 3.6, rtol=0.02)
    assert np.abs([packet["acceleration"] for packet in packets]).max() < 15.0  # no sample with the time of another
    travelled = np.diff([packet["position"][1] for packet in packets])
    np.testing.assert_allclose(travelled, 1e-3 * np.diff(times) * 100.0 / 3.6, rtol=0.05)


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux")
@pytest.mark.parametrize("mode", ["lockstep", "free-running"])
def test_a_server_tells_what_its_client_is_told(mode):
    from steer_env.connect.udp import Client, Server, Stream

    car = subsystems.make("car", cars.load("compact").plant(speed=25.0), 25.0)
    inputs = [2.0, *[0.0] * (len(car.given) - 1)]
    with listening() as (heard, port), Server(car, mode=mode) as server:
        assert server.shown() is None
        with Telemetry(server.shown, outsim=("127.0.0.1", port)):  # ends behind the session
            with (Client if mode == "lockstep" else Stream)(server.layout, server.address) as client:
                told = {}
                for _ in range(100 if mode == "lockstep" else 600):
                    if mode == "lockstep":
                        outputs = client.step(inputs, 5)
                        told[round(1e3 * client.time)] = outputs
                        time.sleep(0.005)
                    else:
                        client.put(inputs)
                        answer = client.get(0.01)
                        if answer is not None:
                            told[round(1e3 * answer.time)] = answer.outputs
            packets = {}
            heard.settimeout(0.2)
            try:
                while True:
                    packet = outsim_read(heard.recv(4096))
                    packets[packet["time"]] = packet
            except TimeoutError:
                pass
    names = [signal.name for signal in car.outputs]
    both = set(packets) & set(told)
    assert len(packets) > 10
    assert len(both) > 5
    for at in both:
        assert packets[at]["angles"][0] == pytest.approx(told[at][names.index("yaw_angle")], rel=1e-6)
        assert packets[at]["position"][1] == pytest.approx(told[at][names.index("x")], abs=1.0 / 65536.0)


def test_the_steering_alone_has_no_motion_to_tell(capsys):
    assert main(["serve", "--subsystem", "steering", "--outsim", "4123"]) == 2
    assert "--outsim: the steering alone does not move: serve the car or the chassis" in capsys.readouterr().err
