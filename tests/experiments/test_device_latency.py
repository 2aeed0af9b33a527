"""The latency through devices and whether a person can drive, from made-up times and counts."""

import numpy as np
import pytest

from steer_env.experiments.studies.common.device_latency import Jumps
from steer_env.experiments.studies.common.real_time_loop import Results, Row
from steer_env.experiments.studies.common.real_time_page import drivable
from steer_env.live.real_time.measure import Measured

MS = 1_000_000  # [ns]


@pytest.fixture
def jumps():
    """Jumps of the angle at 40, 80 and 120 ms."""
    made = Jumps(0.1)
    made.times = 40 * MS * np.arange(1, 4)
    return made


def test_latency_is_from_a_jump_to_the_first_torque_that_jumps(jumps):
    """The torque jumps 4 ms behind the first and 5 ms behind the last."""
    found = jumps.latency([(t, 2.0 if 43 * MS < t < 125 * MS else 0.0) for t in range(0, 200 * MS, MS)], 0.25)
    assert found.durations.histogram.sum() == 2
    assert found.durations.percentile(50.0) == pytest.approx(4e-3, abs=2e-5)
    assert found.durations.worst == pytest.approx(5e-3)
    assert (found.lost, found.clipping) == (1, 0.25)


def test_no_torque_at_all_is_told(jumps):
    with pytest.raises(ValueError, match="no torque followed the angle"):
        jumps.latency([(t, 0.0) for t in range(0, 200 * MS, MS)], 0.0)


@pytest.mark.parametrize(
    ("missed", "preferred", "priority", "able", "remedy"),
    [
        (3, None, 0, True, ""),
        (100, 2, 0, False, "Give --priority,"),
        (100, 100, 0, False, "allow SCHED_FIFO"),
        (100, 2, 50, False, "To drive, end other programs (docs"),
    ],
)
def test_a_person_can_drive_where_one_deadline_in_a_hundred_is_missed(missed, preferred, priority, able, remedy):
    def measured(count):
        return Measured(None, None, None, {"ticks": 1000, "missed": count})

    conditions = {} if preferred is None else {"SCHED_FIFO": measured(preferred)}
    found = drivable(Results([Row("two_track", "lugre", measured(missed))], conditions, {}, 50), priority)
    assert found[0].startswith("A person can drive") == able
    assert remedy in found[1]
    assert bool(found[1]) != able
