"""The device of programs in Python: two mailboxes without locks, as Python's own lock must not hold the loop up.

One thread of Python writes inputs and reads the torque, while the loop does the opposite. Each mailbox has a counter
that is odd while it is written: who reads takes it as it was only if the counter was even and the same before and
after. This needs a processor that keeps the order of writes, as those of x86-64 do.
"""

import time
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.fmu.part import Part
from steer_env.friction.numerics.kernel import kernel
from steer_env.real_time.loop import NEVER, register
from steer_env.real_time.safety import PHASES


class Mailbox(NamedTuple):
    """Inputs on their way in, torque and outputs on their way out."""

    count_in: NDArray[np.int64]  # (1,)
    stamp_in: NDArray[np.int64]  # (1,) monotonic clock at which the inputs were written [ns]
    inputs: NDArray[np.float64]  # (G,)
    taken: NDArray[np.float64]  # (G,) inputs as the loop reads them, for its use
    heard: NDArray[np.int64]  # (1,) stamp of the inputs that the loop took last
    count_out: NDArray[np.int64]  # (1,)
    outputs: NDArray[np.float64]  # (2 + C,) torque of the motor [N m], phase, outputs
    failed: NDArray[np.int64]  # (1,) not 0 where the program in Python has failed


@kernel
def _read(device, model, now):
    count = device.count_in[0]
    if count % 2 == 1 or count == 0:
        return device.heard[0]
    stamp = device.stamp_in[0]
    for i in range(device.inputs.size):
        device.taken[i] = device.inputs[i]
    if device.count_in[0] == count:
        device.heard[0] = stamp
        for i in range(device.taken.size):
            model.wanted[i] = device.taken[i]
    return device.heard[0]


@kernel
def _write(device, model, s, torque, now):
    device.count_out[0] += 1
    device.outputs[0], device.outputs[1] = torque, s.phase
    for i in range(model.outputs.shape[1]):
        device.outputs[2 + i] = model.outputs[0, i]
    device.count_out[0] += 1
    return device.failed[0] == 0


register(Mailbox, _read, _write)


class Mailboxes:
    """Python's side of a :class:`Mailbox`, for one thread.

    Parameters
    ----------
    part : Part
        The part that the loop runs.
    """

    def __init__(self, part: Part) -> None:
        self._names = [signal.name for signal in part.given]
        self.device = Mailbox(
            count_in=np.zeros(1, np.int64),
            stamp_in=np.zeros(1, np.int64),
            inputs=np.zeros(part.given_size),
            taken=np.zeros(part.given_size),
            heard=np.full(1, NEVER),
            count_out=np.zeros(1, np.int64),
            outputs=np.zeros(2 + len(part.outputs)),
            failed=np.zeros(1, np.int64),
        )

    def put(self, inputs: ArrayLike, stamp: int | None = None) -> None:
        """Leave inputs (I,) for the loop, of a time of the monotonic clock, by default now [ns].

        Raises
        ------
        ValueError
            Another number of inputs, or something else than numbers; the loop keeps those that it has.
        """
        values = np.asarray(inputs, float)
        if values.shape != (len(self._names),):
            raise ValueError(f"put takes {len(self._names)} inputs ({', '.join(self._names)}), got {values.shape}")
        written = time.monotonic_ns() if stamp is None else int(stamp)
        box = self.device
        count = int(box.count_in[0]) // 2 * 2  # even also behind a call that an interrupt ended
        box.count_in[0] = count + 1
        box.stamp_in[0] = written
        box.inputs[: values.size] = values
        box.count_in[0] = count + 2

    def get(self) -> tuple[float, str, NDArray[np.float64]]:
        """The last torque of the motor [N m], the phase of the watchdog, and the outputs (C,)."""
        box = self.device
        while True:
            count = int(box.count_out[0])
            values = box.outputs.copy()
            if count % 2 == 0 and box.count_out[0] == count:
                return float(values[0]), PHASES[int(values[1])], values[2:]

    def fail(self) -> None:
        """Tell the loop that the motor cannot be reached, so that its torque fades out."""
        self.device.failed[0] = 1
