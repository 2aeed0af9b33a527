"""The device of programs in Python: two mailboxes without locks, as Python's own lock must not hold the loop up.

One thread of Python writes inputs and reads the torque, while the loop does the opposite. Each mailbox has a counter
that is odd while it is written: who reads takes it as it was only if the counter was even and the same before and
after. This needs a processor that keeps the order of writes, as those of x86-64 do.
"""

import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.kernel import kernel
from steer_env.live.real_time import angle_filter
from steer_env.live.real_time.angle_filter import AngleFilter, estimate, follow
from steer_env.live.real_time.configurations import CarConfigurations
from steer_env.live.real_time.loop import NEVER, PERIOD, register
from steer_env.live.real_time.model import running_subsystem
from steer_env.live.real_time.safety import PHASE_FAILED, PHASES
from steer_env.live.real_time.system import fence
from steer_env.vehicle.subsystems import Subsystem

# Time without a sample behind which the loop counts as dead [ns]. A loop that goes on after so long a pause begins with
# no torque itself, as the fade goes by the time that has passed.
LIFELESS = 30_000_000


class Mailbox(NamedTuple):
    """Inputs on their way in, torque and outputs on their way out."""

    angle: int  # place of the handwheel angle among the inputs, -1 where it is not filtered
    filter: AngleFilter
    needs_dead_man: bool  # whether the torque fades where the dead-man key is not held
    dead_man: NDArray[np.int64]  # (2,) not 0 where it is held, as written and as the loop took it

    count_in: NDArray[np.int64]  # (1,)
    stamp_in: NDArray[np.int64]  # (1,) monotonic clock at which the inputs were written [ns]
    inputs: NDArray[np.float64]  # (G,)
    taken: NDArray[np.float64]  # (G,) inputs as the loop reads them, for its use
    heard: NDArray[np.int64]  # (1,) stamp of the inputs that the loop took last
    count_out: NDArray[np.int64]  # (1,)
    stamp_out: NDArray[np.int64]  # (1,) time of the sample that was written last [ns]
    outputs: NDArray[np.float64]  # (2 + C,) torque of the motor [N m], phase, outputs
    failed: NDArray[np.int64]  # (1,) not 0 where the program in Python has failed


@kernel
def _read_mailbox(device, model, now):
    count = device.count_in[0]
    fence()
    if count % 2 == 0 and count > 0:
        stamp, dead_man = device.stamp_in[0], device.dead_man[0]
        for i in range(device.inputs.size):
            device.taken[i] = device.inputs[i]
        fence()
        if device.count_in[0] == count and stamp <= now + PERIOD:  # a time to come is none of this clock
            device.heard[0], device.dead_man[1] = stamp, dead_man
            for i in range(device.taken.size):
                model.wanted[i] = device.taken[i]
            if device.angle >= 0 and abs(device.taken[device.angle]) < math.inf:
                follow(device.filter, device.taken[device.angle], stamp)
    if device.angle >= 0 and device.heard[0] != NEVER and abs(model.wanted[device.angle]) < math.inf:
        model.wanted[device.angle], model.wanted[device.angle + 1] = estimate(device.filter, now)
    model.released[0] = device.needs_dead_man and device.dead_man[1] == 0
    return device.heard[0]


@kernel
def _write(device, model, s, torque, now):
    device.count_out[0] += 1
    fence()
    device.stamp_out[0], device.outputs[0], device.outputs[1] = now, torque, s.phase
    for i in range(model.outputs.shape[1]):
        device.outputs[2 + i] = model.outputs[0, i]
    fence()
    device.count_out[0] += 1
    return device.failed[0] == 0


register(Mailbox, _read_mailbox, _write)


class Mailboxes:
    """Python's side of a :class:`Mailbox`, for one thread.

    Parameters
    ----------
    source : Subsystem or CarConfigurations
        What the loop runs.
    angle_bandwidth : float, optional
        Bandwidth of a filter of the handwheel angle [Hz], for a wheel whose readings are coarse or slower than 1 kHz
        (:mod:`steer_env.live.real_time.angle_filter`); the filter gives the speed, too, and the one that is left is not
        used. By default there is none.
    dead_man : bool
        Whether the torque fades where the dead-man key is not held.
    clock : callable
        The clock of the loop [ns].

    Raises
    ------
    ValueError
        A bandwidth outside its range, or a filter for a subsystem that takes no handwheel angle.
    """

    def __init__(
        self,
        source: Subsystem | CarConfigurations,
        *,
        angle_bandwidth: float | None = None,
        dead_man: bool = False,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        subsystem = running_subsystem(source)
        self._clock = clock
        self._names = [signal.name for signal in subsystem.given]
        angle = -1
        if angle_bandwidth is not None:
            if "hand_angle" not in self._names:
                raise ValueError(
                    f"a filter of the handwheel angle needs a subsystem that takes it, got {subsystem.title!r}"
                )
            angle = self._names.index("hand_angle")
        self.device = Mailbox(
            angle=angle,
            filter=angle_filter.make(angle_filter.BANDWIDTH if angle_bandwidth is None else angle_bandwidth),
            needs_dead_man=dead_man,
            dead_man=np.zeros(2, np.int64),
            count_in=np.zeros(1, np.int64),
            stamp_in=np.zeros(1, np.int64),
            inputs=np.zeros(subsystem.given_size),
            taken=np.zeros(subsystem.given_size),
            heard=np.full(1, NEVER),
            count_out=np.zeros(1, np.int64),
            stamp_out=np.zeros(1, np.int64),
            outputs=np.zeros(2 + len(subsystem.outputs)),
            failed=np.zeros(1, np.int64),
        )

    def put(self, inputs: ArrayLike, stamp: int | None = None, *, dead_man: bool = False) -> None:
        """Leave inputs (I,) for the loop.

        Parameters
        ----------
        inputs : (I,) array_like
            In the order of the subsystem's ``given``.
        stamp : int, optional
            Time of the inputs on the monotonic clock, by default now [ns].
        dead_man : bool
            Whether the dead-man key is held; counts only where these mailboxes need it.

        Raises
        ------
        ValueError
            Another number of inputs, or something else than numbers; the loop keeps those that it has.
        """
        values = np.asarray(inputs, float)
        if values.shape != (len(self._names),):
            raise ValueError(f"put takes {len(self._names)} inputs ({', '.join(self._names)}), got {values.shape}")
        written = self._clock() if stamp is None else int(stamp)
        box = self.device
        count = int(box.count_in[0]) // 2 * 2  # even also behind a call that an interrupt ended
        box.count_in[0] = count + 1
        box.stamp_in[0], box.dead_man[0] = written, dead_man
        box.inputs[: values.size] = values
        box.count_in[0] = count + 2

    def get(self) -> tuple[float, str, NDArray[np.float64]]:
        """The last torque of the motor [N m], the phase of the watchdog, and the outputs (C,).

        The torque is zero where the loop has written nothing for ``LIFELESS``, and the phase is failed where it has
        ended amid a sample.
        """
        _, values, written = self._last()
        if written is None:
            return 0.0, PHASES[PHASE_FAILED], values[2:]
        torque = float(values[0]) if self._clock() - written <= LIFELESS else 0.0
        return torque, PHASES[int(values[1])], values[2:]

    def _last(self) -> tuple[int, NDArray[np.float64], int | None]:
        """Number, contents and time [ns] of the last sample; None where the loop has ended amid it."""
        box, begun = self.device, time.monotonic_ns()
        while True:
            count = int(box.count_out[0])
            values, written = box.outputs.copy(), int(box.stamp_out[0])
            if count % 2 == 0 and box.count_out[0] == count:
                return count // 2, values, written
            if time.monotonic_ns() - begun > LIFELESS:
                return count // 2, values, None

    def fail(self) -> None:
        """Tell the loop that the motor cannot be reached, so that its torque fades out."""
        self.device.failed[0] = 1
