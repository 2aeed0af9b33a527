"""The time that is left of a tuning, told while it runs: within a factor of 1.5 in the second half."""

import optuna  # noqa: F401, which a tuning takes
import pytest

from steer_env.experiments.calibration import tuning
from steer_env.experiments.calibration.pace import Pace
from steer_env.experiments.calibration.tuning import LAST
from steer_env.friction.numerics import cache


def told(set_times, seconds, before=0, confirm=()):
    """Times, and what was told to be left, of a tuning of sets and other work that take so long each [s]."""
    now, found = [0.0], []
    pace = Pace(lambda: now[0])

    def work(took, finished=None):
        for _ in range(5):
            now[0] += took / 5.0
            found.append((now[0], pace.left))
        if finished is not None:
            pace.count(finished)

    def phase(kind, then):
        pace.begin(kind, kind, then)
        work(seconds[kind])

    for kind in ("effect", "check", "map"):
        phase(kind, {})
    for times, more in ((set_times, len(confirm)), (confirm, 0)):
        if times:
            pace.begin("set", "surface", LAST | ({"set": more} if more else {}), before + len(times))
            pace.count(before)
            for k, took in enumerate(times, before + 1):
                work(took, k)
    phase("map", {"check": 1})
    phase("check", {})
    return now[0], found


GROWS = [0.3] * 10 + [0.8 + 0.003 * k for k in range(110)]  # the first sets are unstable, then the model is slower


@pytest.mark.parametrize(
    "case",
    [
        {"set_times": [0.85] * 300, "seconds": {"effect": 6.0, "check": 1.7, "map": 13.0}},
        {"set_times": [0.85] * 300, "seconds": {"effect": 6.0, "check": 1.7, "map": 60.0}},
        {"set_times": GROWS, "seconds": {"effect": 12.0, "check": 1.4, "map": 13.0}},
        {"set_times": [1.0] * 8, "seconds": {"effect": 6.0, "check": 2.0, "map": 13.0}},
        {"set_times": [1.0] * 40, "seconds": {"effect": 6.0, "check": 2.0, "map": 13.0}, "before": 260},
        {"set_times": GROWS, "seconds": {"effect": 6.0, "check": 2.0, "map": 13.0}, "confirm": [0.85] * 120},
    ],
)
def test_the_time_left_is_told_within_a_factor_in_the_second_half(case):
    end, found = told(**case)
    late = [(end - at, left) for at, left in found if at > 0.5 * end and end - at > 0.05 * end]
    assert late
    for left, said in late:
        assert left / 1.5 <= said <= 1.5 * left


def test_what_was_compiled_is_not_compiled_again():
    now = [0.0]
    pace = Pace(lambda: now[0])
    pace.begin("map", "margin map of the starting point", {})
    now[0] = 100.0
    pace.end(compiled=88.0)
    pace.begin("map", "margin map 1", {})
    assert pace.left == 12.0


def test_a_worker_tells_what_it_compiled(monkeypatch):
    spent = [5.0]
    monkeypatch.setattr(cache, "compile_seconds", lambda: spent[0])

    def work(case):
        spent[0] += case
        return -case

    assert tuning._time_compiling((work, 7.0)) == (-7.0, 7.0)


def test_nothing_is_told_before_a_margin_map_was_read():
    pace = Pace(lambda: 1.0)
    pace.begin("effect", "effect", {})
    pace.begin("map", "map", {})
    assert pace.left is None
    assert pace.part == 0.0
