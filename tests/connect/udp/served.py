"""A server in a process of its own, and a client whose packets suffer faults."""

import json
import random
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

from steer_env.connect.udp import Client, Layout, layout_of
from steer_env.vehicle import cars, subsystems

ROOT = Path(__file__).parents[3]
COMMAND = [sys.executable, "-m", "steer_env.experiments.cli.main", "serve", "--json"]


def part_of(name="car", speed=100.0 / 3.6, **options):
    """A part of the default car as the command line makes it."""
    return subsystems.make(name, cars.load("compact").plant(speed=speed, **options), speed)


def _heeds_ctrl_c():
    """As in a terminal; what a shell starts in the background ignores the signal, and so would the process."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def serving(*options, end=signal.SIGINT):
    """A process of ``steer-env serve``; yields it with its address, and sets its counts and exit code at the end."""
    process = subprocess.Popen(
        [*COMMAND, *options],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=_heeds_ctrl_c,
    )
    try:
        told = json.loads(process.stdout.readline())
        process.told, process.address = told, (told["address"], told["port"])
        yield process
        process.send_signal(end)
        said, _ = process.communicate(timeout=60)
        process.counts = json.loads(said)["counts"]
    finally:
        process.kill()
        process.communicate()


class FaultyClient(Client):
    """A client on a bad network, the same in every run.

    A share ``faults`` of its requests is lost, and of its answers; as many are doubled, and as many are joined each by
    bytes at random, a cut packet, a packet with a wrong bit, a request of long ago, and another client's.
    """

    def __init__(self, layout: Layout, address: tuple[str, int], faults: float, seed: int = 0) -> None:
        self.draw, self.faults = random.Random(seed), faults
        self.lost = False
        self.former = b""
        self.injected = dict.fromkeys(("lost", "unheard", "doubled", "foreign", "truncated", "damaged", "late"), 0)
        self.injected["strange"] = 0
        self.stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        super().__init__(layout, address)

    def __exit__(self, *error):
        self.stranger.close()
        super().__exit__(*error)

    def _happens(self, fault):
        happens = self.draw.random() < self.faults
        self.injected[fault] += happens
        return happens

    def _send(self, packet):
        self.lost = self._happens("lost")
        if self.lost:
            return
        if self._happens("foreign"):
            self._socket.send(self.draw.randbytes(8 * self.draw.randrange(10, 70)))
        if self._happens("truncated"):
            self._socket.send(packet[: self.draw.randrange(64)])
        if self._happens("damaged"):
            wrong = bytearray(packet)
            wrong[self.draw.randrange(8, len(packet))] ^= 1 << self.draw.randrange(8)
            self._socket.send(wrong)
        if self.former and self.sequence % 100 > 1 and self._happens("late"):
            self._socket.send(self.former)
        if self._happens("strange"):
            self.stranger.sendto(packet, self.address)
        self._socket.send(packet)
        if self._happens("doubled"):
            self._socket.send(packet)
        if self.sequence and self.sequence % 100 == 0:
            self.former = packet  # which is late from the next but one on

    def _receive(self):
        if self.lost:
            self.lost = False
            raise TimeoutError
        packet = super()._receive()
        if self._happens("unheard"):
            raise TimeoutError
        return packet


def layout(name="car", **options):
    """The layout of a part."""
    return layout_of(part_of(name, **options))
