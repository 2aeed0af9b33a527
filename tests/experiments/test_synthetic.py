"""Synthetic recordings: every metric finds its answer behind every fault, or is refused for the right reason."""

import functools
import zlib

import numpy as np
import pytest
from scipy import stats

from steer_env import metrics
from steer_env.experiments import sweep
from steer_env.experiments.sweep.where import processors
from steer_env.metrics.common import definitions
from steer_env.metrics.common import evaluate as evaluation
from tests.synthetic import faults, loops
from tests.synthetic.cases import CASES
from tests.synthetic.coverage import collect, coverage, examples
from tests.synthetic.faults import DELAY, FAULTS, TOGETHER, Fault
from tests.synthetic.loops import linear_car

LOOPS = [name for name in CASES if name.startswith(("weave", "slow ramp"))]
TRIALS = 2  # of a case behind a fault; the mark has 200


@pytest.mark.whole
def test_every_case():
    """Trials behind all faults together: exact intervals miss this in one run of a hundred, for some 250 metrics."""
    found = collect(TRIALS, functools.partial(sweep.run, where=sweep.Where(processors())))
    refusing = [name for name, fault in FAULTS.items() if fault.refused]
    pooled = {}
    for case, of_fault in found.items():
        refused = [of_fault[fault] for fault in refusing if fault in of_fault]
        assert all(entry.kept == 1.0 for of_metric in refused for entry in of_metric.values()), case
        for name in of_fault["offset"]:
            pooled[case, name] = [of_fault[fault][name].kept for fault in of_fault if fault not in refusing]
    assert {case.make(200.0)[0].meta["manoeuvre"] for case in CASES.values()} == set(metrics.tests())
    for key, shares in pooled.items():
        trials = TRIALS * len(shares)
        assert np.mean(shares) >= stats.binom.ppf(0.01 / len(pooled), trials, 0.95) / trials, key


def behind_all_faults(case, trials):
    """Coverage of every metric behind an offset, a wrong scale, drifting clocks, drift and noise at once."""
    fault = FAULTS[TOGETHER]
    return coverage(examples(CASES[case], fault.rate), fault, trials, zlib.crc32(case.encode()))


@pytest.mark.parametrize("case", LOOPS)
def test_truth_behind_all_faults_of_a_measurement(case):
    """A quick look: with a coverage of 95 %, three misses or more in five trials are one metric in 900."""
    assert all(entry.kept >= 0.6 and entry.refused == 0.0 for entry in behind_all_faults(case, 5).values())


@pytest.mark.whole
@pytest.mark.parametrize("case", LOOPS)
def test_truth_behind_all_faults_in_60_trials(case):
    found = behind_all_faults(case, 60)
    assert {name: entry.kept for name, entry in found.items() if entry.kept < 0.9} == {}
    assert all(entry.refused == 0.0 for entry in found.values())


def test_an_interval_that_is_too_narrow_is_found(monkeypatch):
    """Half the width covers two thirds."""
    inner = evaluation.interval

    def halved(values):
        low, high = inner(values)
        return (3 * low + high) / 4, (3 * high + low) / 4

    monkeypatch.setattr(evaluation, "interval", halved)
    found = coverage(examples(CASES["weave, linear car"], 50.0), Fault(), 40)
    assert np.mean([entry.kept for entry in found.values()]) < 0.85


def test_a_bias_is_found():
    clean, answers = CASES["weave, linear car"].make(50.0)
    wrong = clean, {name: 1.1 * value for name, value in answers.items()}
    found = coverage(lambda k: wrong, Fault(), 10)
    assert max(entry.kept for name, entry in found.items() if name != "angle_deadband") < 0.5


def test_an_unknown_delay_needs_the_timing():
    """10 ms of the lateral acceleration is a bias without it; with it, the lag's interval reaches to the truth."""
    late = CASES["weave, linear car"].make(100.0)[0].delayed("lateral_acceleration", DELAY)
    sure, unsure = metrics.evaluate(late), metrics.evaluate(late, timing=DELAY)
    assert sure["lateral_acceleration_lag"].low == pytest.approx(160.0, abs=0.2)
    assert unsure["lateral_acceleration_lag"].value == sure["lateral_acceleration_lag"].value
    assert (unsure["lateral_acceleration_lag"].low, unsure["lateral_acceleration_lag"].high) == pytest.approx(
        (150.0, 170.0), abs=0.2
    )
    # torque and acceleration each move the phase between them
    half = (unsure["torque_at_0g"].high - unsure["torque_at_0g"].low) / 2
    phase = loops.LEAD + 0.4 * np.pi * (loops.AY_LAG + DELAY)
    change = loops.TORQUE_PEAK * (np.sin(phase) - np.sin(phase - 0.4 * np.pi * DELAY))
    assert half == pytest.approx(2 * change, rel=0.02)
    # nothing but the handwheel angle
    assert unsure["peak_handwheel_angle"].high == pytest.approx(sure["peak_handwheel_angle"].high)


def test_timing_gives_one_repeat_an_interval(monkeypatch):
    metrics.available()  # imports every test, so that the copy holds their metrics
    monkeypatch.setattr(definitions, "_metrics", dict(definitions._metrics))

    @metrics.metric("ms", "weave", source="here")
    def mean_lag(loops):
        """Mean lag of the yaw rate."""
        return loops.lag("yaw_rate").mean()

    clean = CASES["weave, linear car"].make(100.0)[0]
    assert np.isnan(metrics.evaluate(clean)["mean_lag"].low)
    found = metrics.evaluate(clean, timing=0.005)["mean_lag"]
    assert (found.low, found.high) == pytest.approx((75.0, 85.0), abs=0.1)
    with pytest.raises(ValueError, match="timing"):
        metrics.evaluate(clean, timing=-0.01)


def test_a_metric_that_the_timing_may_refuse_is_refused(monkeypatch):
    metrics.available()  # imports every test, so that the copy holds their metrics
    monkeypatch.setattr(definitions, "_metrics", dict(definitions._metrics))

    @metrics.metric("ms", "weave", source="here")
    def short_lag(loops):
        """Lag of the yaw rate, up to 82 ms."""
        if loops.lag("yaw_rate").mean() > 0.082:
            raise metrics.RefusedError("too late")
        return loops.lag("yaw_rate")

    clean = CASES["weave, linear car"].make(100.0)[0]
    assert metrics.evaluate(clean, timing=0.001)["short_lag"].reason == ""
    assert "align the channels" in metrics.evaluate(clean, timing=0.005)["short_lag"].reason


def test_faults_do_what_they_say():
    clean, rng = linear_car(cycles=5), np.random.default_rng(1)
    holes = faults.drop_outs(clean, rng)
    lost = {name: np.count_nonzero(np.isnan(values)) for name, values in holes.channels.items()}
    assert all(5 <= count <= 30 for count in lost.values())
    assert holes.bridged()["yaw_rate"] == pytest.approx(clean["yaw_rate"], abs=1e-4)
    with pytest.raises(ValueError, match=r"gap from .* s: 2 s, allowed is longest=0.1 s; .*cut the recording there"):
        faults.long_drop_out(clean, rng).bridged()
    fast = linear_car(cycles=5, rate=200.0)
    slow = faults.logged_at_50_hz(fast, rng)
    assert slow.rate == pytest.approx(50.0)
    drifting = faults.drifting(clean, rng)["handwheel_torque"] - clean["handwheel_torque"]
    assert abs(drifting[-1] - drifting[0]) == pytest.approx(0.1)
    turned = faults.angle_drifting(clean, rng)["handwheel_angle"] - clean["handwheel_angle"]
    assert abs(turned[-1] - turned[0]) == pytest.approx(faults.ANGLE_DRIFT)
    late = faults.late(clean, rng)
    moved = [name for name in clean.channels if not np.allclose(late[name], clean[name][-late.time.size :])]
    assert len(moved) == 1
    assert FAULTS["drop-outs"].declared
