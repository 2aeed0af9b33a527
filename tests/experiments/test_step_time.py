"""The step-time study runs; its figures are for ``python -m experiments.step_time`` to print, not a test to time."""

import tempfile

from experiments import step_time
from steer_env.ids import DRIVEN


def test_ratios_cover_every_environment():
    ratios = step_time.ratios(steps=20, repeats=1)
    assert set(ratios) == set(DRIVEN)
    assert all(ratio > 0.0 for ratio in ratios.values())


def test_first_step_runs_in_a_new_process():
    with tempfile.TemporaryDirectory() as cache:
        assert step_time.first_step("steer_env/AssistWeave-v0", cache) > 0.0


def test_substeps_cover_friction_and_both_chassis():
    times = step_time.substeps(n=200, repeats=1)
    assert set(times) == {"friction", "single_track", "two_track"}
    assert all(seconds > 0.0 for seconds in times.values())
