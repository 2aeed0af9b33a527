"""The loop in real time: a sample of 1 ms at every deadline, a device on one side and the plant on the other.

The loop is compiled and runs in a thread without the GIL. Its deadlines are absolute; one that is missed is counted and
left out, never made up, so that the time of the simulation then stays behind. A device is a ``NamedTuple`` with two
kernels, which its class selects: :func:`read` and :func:`write`.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.live.real_time import safety
from steer_env.live.real_time.configurations import CarConfigurations
from steer_env.live.real_time.model import implausible, jumps, make_model, running_subsystem, step, take_inputs
from steer_env.live.real_time.recorder import NO_RING, Recorder, Ring, keep
from steer_env.live.real_time.safety import (
    PHASE_FADING,
    SAFETY,
    TRIPS,
    Limits,
    checked,
    end_torque,
    limit_torque,
    supervise,
)
from steer_env.live.real_time.system import Worker, clock, sleep_until
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Subsystem

PERIOD = 1_000_000  # [ns]
NEVER = -1  # time of an input that never arrived
BINS = 50_000  # of a histogram; what is larger counts in the last
LATENESS_BIN, WORK_BIN = 1_000, 100  # widths [ns]
ENDLESS_SAMPLES = 2**62  # samples, which no loop reaches
COUNTS = {
    "ticks": "deadlines at which a sample was computed",
    "missed": "deadlines left out",
}
TICKS, MISSED = range(len(COUNTS))

_DEVICES: dict[tuple[type, str], Callable] = {}  # class and name of the kernel -> kernel


def read(device, model, now):
    """Let a device fill ``model.wanted``; the time of its last input [ns], NEVER where there is none."""
    return _DEVICES[type(device), "read"](device, model, now)


def write(device, model, s, torque, now):
    """Give a device the torque of the motor [N m], and the outputs in ``model.outputs``; whether it took them."""
    return _DEVICES[type(device), "write"](device, model, s, torque, now)


for _point in (read, write):
    dispatch(_point, lambda kind, name: _DEVICES.get((kind, name)))


def register(kind: type, read: Callable, write: Callable) -> None:
    """Make a class of devices known, by its kernels as in :func:`read` and :func:`write`."""
    _DEVICES[kind, "read"], _DEVICES[kind, "write"] = read, write


class Loop(NamedTuple):
    """What the loop has beside model and device."""

    limits: Limits
    ring: Ring
    safety: Any  # (1,) of SAFETY
    counts: NDArray[np.int64]  # (N,) in the order of COUNTS
    lateness: NDArray[np.int64]  # (BINS,) histogram of the lateness at the deadlines
    work: NDArray[np.int64]  # (BINS,) histogram of the time that a sample takes
    worst: NDArray[np.int64]  # (2,) largest lateness and time [ns]
    time: NDArray[np.int64]  # (2,) of the clock
    stop: NDArray[np.int64]  # (1,) not 0 where the loop is to end
    most: int  # samples after which it ends


def make_loop_memory(limits: Limits, most: int = ENDLESS_SAMPLES, ring: Ring = NO_RING) -> Loop:
    """The memory of a loop that ends after so many samples at the latest, and keeps samples in a ring.

    Raises
    ------
    ValueError
        As :func:`steer_env.live.real_time.safety.checked`.
    """
    memory = np.zeros(1, SAFETY).view(np.recarray)
    memory.input_gain, memory.heard = 1.0, NEVER
    histograms = np.zeros(BINS, np.int64), np.zeros(BINS, np.int64)
    counts, worst, time, stop = (np.zeros(n, np.int64) for n in (len(COUNTS), 2, 2, 1))
    return Loop(checked(limits), ring, memory, counts, *histograms, worst, time, stop, most)


@kernel
def tick(model, loop, device, now, missed):
    """Compute one sample at a time ``now`` [ns], before which so many deadlines were left out; the torque [N m]."""
    s = loop.safety[0]
    elapsed = (1 + missed) * SAMPLE_TIME
    heard = read(device, model, now)
    if s.begun != model.begun[0]:
        s.begun = model.begun[0]
        safety.begin(s)
    # A time to come is no time of this clock; an input that arrives while a sample is computed is up to one ahead.
    age = 1e-9 * (now - heard) if heard != NEVER and heard <= now + PERIOD else math.inf
    supervise(loop.limits, s, elapsed, age, missed, model.released[0] != 0)
    torque = 0.0
    since = 1e-9 * (heard - s.heard) if heard != NEVER and s.heard != NEVER else math.inf
    # Behind a pause without torque the angle may be another one, as where the user has set it anew.
    sound = implausible(model, model.wanted) < 0 and not (s.gain > 0.0 and jumps(model, max(since, elapsed)))
    s.heard = heard
    if sound:
        take_inputs(model, s.input_gain, age <= loop.limits.hold)
        sound = step(model, 1)
    if not sound:
        end_torque(s)
    elif model.torque >= 0:
        # The torsion bar pulls at the handwheel with the opposite of what it gives to the column.
        bar, speed = model.outputs[0, model.torque], model.outputs[0, model.speed]
        torque = limit_torque(loop.limits, s, -loop.limits.share * bar, speed)
    if not write(device, model, s, torque, now):
        s.failed = 1
    keep(loop.ring, model, s, now, missed, age, torque)
    return torque


@kernel
def note(histogram, width, worst, place, value):
    """Count a duration [ns] in a histogram, and keep the largest."""
    histogram[min(max(value, 0) // width, histogram.size - 1)] += 1
    worst[place] = max(worst[place], value)


@kernel
def wake(deadline, time, lateness, worst):
    """Sleep until a deadline [ns] and note the lateness; the time then."""
    sleep_until(deadline, time)
    now = clock(time)
    note(lateness, LATENESS_BIN, worst, 0, now - deadline)
    return now


@kernel
def at_deadline(model, loop, device, deadline):
    """Compute a sample at a deadline [ns]; the next deadline."""
    now = wake(deadline, loop.time, loop.lateness, loop.worst)
    missed = max(now - deadline, 0) // PERIOD
    tick(model, loop, device, now, missed)
    note(loop.work, WORK_BIN, loop.worst, 1, clock(loop.time) - now)
    loop.counts[TICKS] += 1
    loop.counts[MISSED] += missed
    return deadline + (1 + missed) * PERIOD


@kernel
def run(model, loop, device):
    """Compute samples at their deadlines until ``loop.stop`` is set, or as many as there may be; then fade out."""
    s = loop.safety[0]
    deadline = clock(loop.time) + PERIOD
    while True:
        if loop.stop[0] != 0 or loop.counts[TICKS] >= loop.most:
            if s.gain == 0.0:
                break
            s.phase = PHASE_FADING
        deadline = at_deadline(model, loop, device, deadline)
    write(device, model, s, 0.0, clock(loop.time))


class RealTime(Worker):
    """A subsystem in real time in a thread; used in a ``with`` block, at whose end its torque fades out.

    Parameters
    ----------
    source : Subsystem or CarConfigurations
        From :func:`steer_env.vehicle.subsystems.make`, or several of those.
    device : NamedTuple
        Of a class given to :func:`register`.
    limits : Limits
        Of the torque, and times of the watchdog.
    most : int
        Samples after which it ends by itself.
    priority : int
        As of :class:`steer_env.live.real_time.system.Worker`.
    recorded : float
        Time of which ``recorder`` keeps every sample until its ``drain`` takes them; 0 for no recorder [s].

    Raises
    ------
    ValueError
        Another system than Linux, kernels that are not compiled, limits that are not positive and finite, or a recorded
        time outside its range.
    """

    def __init__(
        self,
        source: Subsystem | CarConfigurations,
        device: Any,
        limits: Limits | None = None,
        most: int = ENDLESS_SAMPLES,
        priority: int = 0,
        recorded: float = 10.0,
    ) -> None:
        self.recorder = Recorder(running_subsystem(source), recorded)
        self.loop = make_loop_memory(limits or Limits(), most, self.recorder.ring)
        self._model = make_model(source)
        super().__init__(run, (self._model, self.loop, device), self.loop.stop, priority)

    def resume(self) -> None:
        """Forget a failure: the torque starts softly again where inputs arrive. The car stays as it is."""
        self._model.begun[0] += 1

    def counts(self) -> dict[str, int]:
        """What happened so far, by the names of ``COUNTS`` and ``TRIPS``."""
        return counts(self.loop)


def counts(loop: Loop) -> dict[str, int]:
    """What happened in a loop so far, by the names of ``COUNTS`` and ``TRIPS``."""
    return {**dict(zip(COUNTS, loop.counts.tolist())), **{name: int(loop.safety[0][name]) for name in TRIPS}}
