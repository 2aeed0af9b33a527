"""What a motor does whose program is killed or stopped: a wheel in this process, the loop in another, a bus between."""

import math
import os
import random
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from steer_env.live.devices.fake import Rim, WheelModel, make_hands
from tests.live.devices.stages import DBC, TIMEOUT

if sys.platform != "linux":
    pytest.skip("the loop needs Linux", allow_module_level=True)
import can


class Node:
    """A wheel with a clock and a timeout of its own, which knows of the program only by frames."""

    def __init__(self, channel):
        self.bus = can.Bus(interface="udp_multicast", channel=channel)
        self.wheel = WheelModel(Rim(), make_hands("weave", 30.0, 0.5), 1e-3 * TIMEOUT, time.monotonic_ns())
        self.times, self.motor, self.heard = [], [], 0  # clock [ns], torque that acts, time of the last torque frame

    def run(self, seconds, until=lambda: False):
        """Send the angle in every 2 ms and take what arrives, for so long or until something holds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not until():
            self.wheel.advance(time.monotonic_ns())
            while (frame := self.bus.recv(0)) is not None:
                if frame.arbitration_id == 512:
                    self.heard = time.monotonic_ns()
                    self.wheel.command(0.001 * struct.unpack_from("<h", frame.data)[0], self.heard)
            self.times.append(self.wheel.now)
            self.motor.append(self.wheel.motor)
            raw = round(math.degrees(self.wheel.angle) / 0.02), round(math.degrees(self.wheel.speed) / 0.1)
            data = struct.pack("<hhxxxx", *raw)
            self.bus.send(can.Message(arbitration_id=256, data=data, is_extended_id=False))
            time.sleep(0.002)

    def last_torque(self):
        """Time at which the motor gave a torque last [ns]."""
        return self.times[int(np.flatnonzero(self.motor)[-1])]


@pytest.fixture
def driven(tmp_path):
    """A wheel on a bus, and the program that drives it, with some torque at the motor."""
    (tmp_path / "wheel.dbc").write_text(DBC)
    channel = f"239.74.163.{random.SystemRandom().randrange(100, 250)}"
    try:
        node = Node(channel)
    except Exception as error:  # of python-can or the operating system
        pytest.skip(f"no multicast here: {error}")
    program = Path(__file__).parent / "on_bus.py"
    child = subprocess.Popen([sys.executable, program, str(tmp_path / "wheel.dbc"), channel])
    try:
        node.run(120.0, until=lambda: node.heard and abs(node.wheel.motor) > 1.0)
        node.run(2.0)
        node.run(5.0, until=lambda: abs(node.wheel.motor) > 1.0)
        assert abs(node.wheel.motor) > 1.0, f"the program drives nothing, and has ended with {child.poll()}"
        yield node, child
    finally:
        child.kill()
        child.wait()
        node.bus.shutdown()


@pytest.mark.whole
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_the_motor_ends_by_its_own_timeout(driven, how, capsys):
    node, child = driven
    os.kill(child.pid, how)
    if how == signal.SIGSTOP:
        os.waitpid(child.pid, os.WUNTRACED)
    else:
        child.wait()
    ended = time.monotonic_ns()
    node.run(0.5)
    last = 1e-6 * (node.last_torque() - ended)
    with capsys.disabled():
        print(f"\n{how.name}: last frame {1e-6 * (node.heard - ended):.1f} ms, last torque {last:.1f} ms behind")
    assert node.last_torque() - node.heard <= (TIMEOUT + 5) * 1_000_000  # a pass of the node, which sees it so late
    assert node.heard - ended < 200_000_000  # what was on its way
    assert node.wheel.motor == 0.0
    if how == signal.SIGSTOP:
        before = max(map(abs, node.motor))
        os.kill(child.pid, signal.SIGCONT)
        node.run(0.3)
        behind = np.abs(node.motor[-60:])
        assert np.abs(node.motor).max() <= before + 0.1  # nothing is made up for
        assert behind.max() < before  # it begins softly
