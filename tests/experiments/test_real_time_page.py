"""The verdict of ``real-time`` and the latency through devices, from made-up durations."""

import numpy as np
import pytest

from steer_env.experiments.studies.common.device_latency import Jumps
from steer_env.experiments.studies.common.real_time_loop import Results, Row
from steer_env.experiments.studies.common.real_time_page import page, verdict
from steer_env.live.real_time.measure import Durations, Measured
from tests.experiments.first_screen import sentence

MS = 1_000_000  # [ns]


def durations(*values):
    """Durations [us]."""
    histogram = np.bincount(np.array(values), minlength=100)
    return Durations(histogram, 1e-6, 1e-6 * max(values))


def row(law, chassis, work, late=10):
    """A law with 1000 samples, all alike, beside a bare loop that is 10 us late."""
    spread = [1] * 10 + [late] * 980 + [99 * late // 10] * 10
    counts = {"ticks": 1000, "missed": 3, "clipped": 20, "stale_trips": 0, "deadline_trips": 1, "failure_trips": 0}
    return Row(
        chassis,
        law,
        Measured(
            durations(*spread),
            durations(*[1] * 10, *[10] * 980, *[99] * 10),
            durations(*[1] * 5, *[work] * 995),
            counts,
        ),
    )


def results(*rows):
    """The results of some rows, without priority or CAN."""
    conditions = {"as every program": rows[0].found, "SCHED_FIFO": "the priority 50 of SCHED_FIFO is not allowed"}
    jumps = Jumps(0.1)
    jumps.times = 40 * MS * np.arange(1, 4)
    heard = [(t, 2.0 if 43 * MS < t < 125 * MS else 0.0) for t in range(0, 200 * MS, MS)]
    latencies = {"fake wheel": jumps.latency(heard, 0.25), "virtual CAN": "CAN needs the packages python-can"}
    return Results(list(rows), conditions, latencies, 50)


def test_marks_are_met_or_missed():
    found = verdict(results(row("lugre", "two_track", 5), row("dahl", "single_track", 90)))
    assert [sentence.endswith(": met.") for sentence in found[:3]] == [True] * 3
    assert "which rests on the 2 latest of 2000 samples" in found[2]
    assert found[3].endswith("mark 20 µs: met by every law, lugre takes longest with 5.0 µs.")
    found = verdict(results(row("lugre", "two_track", 5, late=15), row("bouc_wen", "two_track", 35, late=15)))
    assert all(sentence.endswith("mark 1.2: missed.") for sentence in found[:3])
    assert "mark 20 µs: missed by bouc_wen with 35" in found[3]
    found = verdict(results(row("lugre", "single_track", 5)))
    assert found[3] == "Time of a sample with the car on two tracks: not measured; mark 20 µs."


@pytest.mark.parametrize(
    ("missed", "preferred", "priority", "told"),
    [
        (3, None, 0, "A person can drive here without a priority: 0.30% of the deadlines"),
        (3, None, 50, "A person can drive here with the priority 50: 0.30%"),
        (100, 2, 0, "Give --priority, with which 0.20% were missed."),
        (100, 100, 0, "To drive, end other programs, or allow SCHED_FIFO and give --priority"),
        (100, None, 0, "To drive, end other programs, or allow SCHED_FIFO and give --priority"),
        (100, 2, 50, "A person cannot drive here with the priority 50: 9.1% of the deadlines were missed"),
    ],
)
def test_the_verdict_begins_with_whether_one_can_drive(missed, preferred, priority, told):
    def counted(each, missed):
        return each._replace(counts={**each.counts, "missed": missed})

    one = row("lugre", "two_track", 5)
    found = results(one._replace(found=counted(one.found, missed)))
    if preferred is not None:
        found.conditions["SCHED_FIFO"] = counted(one.found, preferred)
    made = page(found, 1.0, priority, False)
    assert any(said.startswith(told) for said in made.timing)
    assert sentence(made.html()) == made.timing[0]


def test_latency_is_from_a_jump_to_the_first_torque_that_jumps():
    """The jumps are at 40, 80 and 120 ms; the torque jumps 4 ms behind the first and 5 ms behind the last."""
    found = results(row("lugre", "two_track", 5)).latencies["fake wheel"]
    assert found.durations.histogram.sum() == 2
    assert found.durations.percentile(50.0) == pytest.approx(4e-3, abs=2e-5)
    assert found.durations.worst == pytest.approx(5e-3)
    assert (found.lost, found.clipping) == (1, 0.25)


def test_no_torque_at_all_is_told():
    jumps = Jumps(0.1)
    jumps.times = 40 * MS * np.arange(1, 4)
    with pytest.raises(ValueError, match="no torque followed the angle"):
        jumps.latency([(t, 0.0) for t in range(0, 200 * MS, MS)], 0.0)


def test_the_page_tells_what_is_not_allowed_and_what_machine_it_was():
    made = page(results(row("lugre", "two_track", 5)), 12.0, 0, True)
    deadlines, _, conditions, latency = made.values["sections"]
    assert "SCHED_FIFO not allowed" in conditions.verdict
    assert "The memory is locked under every condition" in conditions.limits
    assert "priority of every program, memory locked" in deadlines.limits
    assert conditions.table.note == "The priority 50 of SCHED_FIFO is not allowed."
    assert "virtual CAN not measured" in latency.verdict
    assert latency.table.note.endswith("CAN needs the packages python-can.")
    assert "the loop has the priority 50 of SCHED_FIFO" in latency.evidence
    assert ["fake wheel", "2", "4010", "5000", "5000", "1", "25.0%"] in latency.table.rows
    assert "governor: " in deadlines.limits
    assert made.values["another"] == "A figure of this machine says nothing about another."
