"""Slow ramps from straight ahead into a turn, found in a recording; the steady circles and the transition use them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.metrics.common import events

Array = NDArray[np.float64]


class Ramp(NamedTuple):
    """Samples ``[start, end)`` in which a channel rises from a small to its largest size, and the side of the turn."""

    start: int
    end: int
    side: float  # 1 to the left, -1 to the right [1]


def find(time: Array, values: Array, part: float = 0.5) -> list[Ramp]:
    """The ramps in a channel (T,): every section on one side of zero that reaches ``part`` of the largest size.

    A ramp begins where the channel was last within 5 % of the largest size. It ends where the channel first reaches
    99.5 % of the highest mean over one second.
    """
    second = max(round(1.0 / (time[1] - time[0])), 1)
    size = np.abs(values).max()
    found = []
    for side in (1.0, -1.0):
        for i, j in events.true_runs(side * values > 0.05 * size, gap=second // 4):
            if j - i < second or (side * values[i:j]).max() < part * size:
                continue
            mean = running_mean(side * values[i:j], second)
            reached = np.flatnonzero(side * values[i:j] >= 0.995 * mean.max())
            if reached.size and reached[0] > 0:
                found.append(Ramp(i, i + int(reached[0]) + 1, side))
    return sorted(found)


def running_mean(values: Array, count: int) -> Array:
    """Mean of every ``count`` consecutive samples of a channel (T,)."""
    total = np.cumsum(np.append(0.0, values))
    return (total[count:] - total[:-count]) / count


def rising_section(values: Array, low: float, high: float) -> slice | None:
    """Samples from where a rising channel (T,) first reaches ``low`` to where it first reaches ``high``.

    None if it does not reach ``high``, or reaches it less than eight samples after ``low``.
    """
    first, last = np.flatnonzero(values >= low), np.flatnonzero(values >= high)
    return slice(int(first[0]), int(last[0]) + 1) if last.size and last[0] - first[0] >= 8 else None
