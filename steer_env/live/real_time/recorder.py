"""A ring that keeps every sample of the loop until Python takes it, without a lock between the two.

The loop alone counts what it has written, and Python alone what it has read. Where the ring is full, samples are left
out and counted; those in it stay. This needs a processor that keeps the order of writes, as those of x86-64 do.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import kernel
from steer_env.live.real_time.system import fence
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Subsystem

# What stands before inputs and outputs in a row.
RECORD_HEAD = {
    "time": "monotonic clock when the sample began [s]",
    "missed": "deadlines left out before it",
    "input_age": "age of the last input then, infinite where there is none [s]",
    "set": "configuration that acts, 0 where there is one only",
    "next_set": "configuration that is to take over, -1 where none is",
    "share": "of the configuration that is to take over, in what is shown [1]",
    "motor_torque": "of the motor [N m]",
    "phase": "of the watchdog, place in PHASES",
    "gain": "of the watchdog [1]",
}


class Ring(NamedTuple):
    """Memory of N samples with K numbers each."""

    rows: NDArray[np.float64]  # (N, K)
    written: NDArray[np.int64]  # (1,) samples that the loop has written
    read: NDArray[np.int64]  # (1,) samples that Python has taken
    lost: NDArray[np.int64]  # (1,) samples for which there was no room


def make_ring(rows: int, columns: int) -> Ring:
    """An empty ring."""
    return Ring(np.zeros((rows, columns)), *(np.zeros(1, np.int64) for _ in range(3)))


NO_RING = make_ring(0, 0)  # keeps nothing


@kernel
def keep(ring, model, s, now, missed, age, torque):
    """Write a sample, where there is room: see ``RECORD_HEAD``."""
    if ring.rows.shape[0] == 0:
        return
    written = ring.written[0]
    if written - ring.read[0] >= ring.rows.shape[0]:
        ring.lost[0] += 1
        return
    row = ring.rows[written % ring.rows.shape[0]]
    row[0], row[1], row[2] = 1e-9 * now, missed, age
    row[3], row[4], row[5] = model.now[0], model.now[1], model.now[2]
    row[6], row[7], row[8] = torque, s.phase, s.gain
    first = 9
    inputs = row.size - first - model.outputs.shape[1]
    for i in range(inputs):
        row[first + i] = model.given[i]
    for i in range(model.outputs.shape[1]):
        row[first + inputs + i] = model.outputs[0, i]
    fence()  # the row stands before it counts
    ring.written[0] = written + 1


class Recorder:
    """Python's side of a ring, for one thread.

    Parameters
    ----------
    subsystem : Subsystem
        The subsystem that the loop runs.
    seconds : float
        That the ring holds, 0 for no ring [s].

    Raises
    ------
    ValueError
        A time outside 0 to 3600 s.
    """

    def __init__(self, subsystem: Subsystem, seconds: float) -> None:
        held = number("recorded seconds", seconds, minimum=0.0, maximum=3600.0)
        signals = [signal.name for signal in (*subsystem.given, *subsystem.outputs)]
        self.columns = (*RECORD_HEAD, *signals)  # names of the numbers in a row
        self.ring = make_ring(round(held / SAMPLE_TIME), len(self.columns)) if held else NO_RING
        self._lost = 0

    def drain(self) -> tuple[NDArray[np.float64], int]:
        """The samples since the last call, (N, K) in the order of ``columns``, and how many more were lost."""
        lost = int(self.ring.lost[0])  # before `written`: what is lost from here on follows these samples
        rows, written, read = self.ring.rows, int(self.ring.written[0]), int(self.ring.read[0])
        places = np.arange(read, written) % max(len(rows), 1)
        taken = rows[places]  # a copy
        self.ring.read[0] = written
        new, self._lost = lost - self._lost, lost
        return taken, new
