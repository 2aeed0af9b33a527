"""How well the loop keeps its deadlines on this machine, beside a bare loop that computes nothing.

In every millisecond one thread wakes twice: at the deadline of the loop, where a sample is computed, and half a
millisecond before, where nothing is. Both sleep by the same call of the C library until an absolute time, leave out the
deadlines that they miss, and meet the same disturbances.
"""

import ctypes
import math
import os
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.kernel import kernel
from steer_env.live.real_time.configurations import CarConfigurations
from steer_env.live.real_time.loop import (
    BINS,
    LATENESS_BIN,
    PERIOD,
    TICKS,
    WORK_BIN,
    Loop,
    at_deadline,
    counts,
    make_loop_memory,
    register,
    wake,
)
from steer_env.live.real_time.model import make_model, running_subsystem
from steer_env.live.real_time.safety import Limits
from steer_env.live.real_time.system import Worker, check, clock
from steer_env.vehicle.subsystems import Subsystem

AMPLITUDE, FREQUENCY = 0.5, 0.5  # of the handwheel's angle [rad], [Hz]
_LOCK_NOW_AND_LATER = 3  # MCL_CURRENT | MCL_FUTURE


class Sine(NamedTuple):
    """A fake wheel: a person turns it to and fro, and its motor takes every torque."""

    angle: int  # place of the handwheel's angle among the inputs
    speed: int  # and of its speed


@kernel
def _read_sine(device, model, now):
    omega = 2.0 * math.pi * FREQUENCY
    phase = omega * 1e-9 * now
    model.wanted[device.angle] = AMPLITUDE * math.sin(phase)
    model.wanted[device.speed] = AMPLITUDE * omega * math.cos(phase)
    return now


@kernel
def _write(device, model, s, torque, now):
    return True


register(Sine, _read_sine, _write)


@kernel
def _loop_and_bare_loop(model, loop, device, lateness, worst):
    """Run the loop, and in the middle between its deadlines a bare one that only notes its lateness."""
    deadline = clock(loop.time) + PERIOD
    bare = deadline - PERIOD // 2
    while loop.stop[0] == 0 and loop.counts[TICKS] < loop.most:
        if bare < deadline:
            late = wake(bare, loop.time, lateness, worst) - bare
            bare += (1 + max(late, 0) // PERIOD) * PERIOD
        else:
            deadline = at_deadline(model, loop, device, deadline)


class Durations(NamedTuple):
    """Many durations [s]; a histogram with bins of a width, in whose last the longer ones are."""

    histogram: NDArray[np.int64]  # (BINS,)
    width: float  # of a bin [s]
    worst: float  # the longest [s]

    def percentile(self, percent: float) -> float:
        """The duration [s] that a share is at most as long as, to a bin; the longest where it is in the last bin."""
        place = int(np.argmax(np.cumsum(self.histogram) >= percent / 100.0 * self.histogram.sum()))
        return self.worst if place == self.histogram.size - 1 else min((place + 1) * self.width, self.worst)

    def __add__(self, other: "Durations") -> "Durations":  # type: ignore[override]
        """The durations of both."""
        return Durations(self.histogram + other.histogram, self.width, max(self.worst, other.worst))


class Measured(NamedTuple):
    """What one run found."""

    lateness: Durations  # at the deadlines of the loop
    bare: Durations  # at those of the bare loop
    work: Durations  # of a sample
    counts: dict[str, int]  # of the loop, as steer_env.live.real_time.loop.counts


def measure(source: Subsystem | CarConfigurations, seconds: float, priority: int = 0) -> Measured:
    """Run a car with a prescribed handwheel angle for so long beside a bare loop.

    Parameters
    ----------
    source : Subsystem or CarConfigurations
        The car or its steering, with ``robot=True``, or configurations.
    seconds : float
        [s]
    priority : int
        As of :class:`steer_env.live.real_time.system.Worker`.

    Raises
    ------
    ValueError
        Another system than Linux, or a subsystem without a handwheel.
    PermissionError
        The priority is not allowed.
    """
    subsystem = running_subsystem(source)
    names = [signal.name for signal in subsystem.given]
    if "hand_angle" not in names:
        raise ValueError(f"a subsystem with a handwheel is measured, got {subsystem.name}")
    loop: Loop = make_loop_memory(Limits(), round(1e9 * seconds / PERIOD))
    device = Sine(names.index("hand_angle"), names.index("hand_speed"))
    lateness, worst = np.zeros(BINS, np.int64), np.zeros(1, np.int64)
    with Worker(
        _loop_and_bare_loop, (make_model(source), loop, device, lateness, worst), loop.stop, priority
    ) as worker:
        worker.wait()
    return Measured(
        Durations(loop.lateness, 1e-9 * LATENESS_BIN, 1e-9 * float(loop.worst[0])),
        Durations(lateness, 1e-9 * LATENESS_BIN, 1e-9 * float(worst[0])),
        Durations(loop.work, 1e-9 * WORK_BIN, 1e-9 * float(loop.worst[1])),
        counts(loop),
    )


def lock_memory() -> None:
    """Keep all memory of the process from being swapped out, now and later.

    Raises
    ------
    ValueError
        Another system than Linux.
    PermissionError
        It is not allowed.
    """
    check()
    if ctypes.CDLL(None, use_errno=True).mlockall(_LOCK_NOW_AND_LATER) != 0:
        raise PermissionError(
            f"the memory cannot be locked ({os.strerror(ctypes.get_errno())}): start it as root, or give the user the "
            "right 'memlock' in /etc/security/limits.conf"
        )
