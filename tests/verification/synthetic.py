"""Metrics of synthetic recordings with known answers."""

from collections.abc import Iterator
from functools import partial

from steer_env.experiments.pages.words import label
from steer_env.experiments.sweep import Where, run
from tests.synthetic.coverage import collect
from tests.synthetic.faults import FAULTS, TOGETHER
from tests.verification.common.rows import Row, verdict

TRIALS = 200  # of each test and fault
WIDEST = 10.0  # width of an interval over the answer, above which the answer is about zero [1]
COVERED = 0.9  # least share of the trials whose interval holds the known answer


def rows(trials: int = TRIALS) -> Iterator[Row]:
    """Known answers behind faults: share of the trials whose 95 % interval holds the answer, of the worst metric.

    Behind all faults of a measurement at once there is a row for every metric.
    """
    for case, of_fault in collect(trials, partial(run, where=Where.parse())).items():
        for fault, of_metric in of_fault.items():
            name, least = min(of_metric.items(), key=lambda item: item[1].kept)
            why = FAULTS[fault].refused
            if why:
                found, aim, passed = why if least.kept == 1.0 else "not refused", "refused, and why", least.kept == 1.0
            else:
                found = f"{100 * least.kept:.1f} %, {label(name)}" + (" (refused)" if least.refused == 1.0 else "")
                aim, passed = f">= {100 * COVERED:.0f} %", least.kept >= COVERED
            yield Row(f"{case}: {fault}", found, aim, verdict(passed))
        for name, entry in of_fault.get(TOGETHER, {}).items():
            width = f", width {100 * entry.width:.2g} % of the value" if entry.width < WIDEST else ""
            share = f"{100 * entry.kept:.1f} %{width}"
            aim = f">= {100 * COVERED:.0f} %"
            yield Row(f"{case}: {TOGETHER}, {label(name)}", share, aim, verdict(entry.kept >= COVERED))
