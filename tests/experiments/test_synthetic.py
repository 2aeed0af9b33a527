"""Synthetic recordings: every metric finds its answer behind every fault, or is refused for the right reason."""

import numpy as np
import pytest
from scipy import stats

from experiments import marks, synthetic
from experiments.synthetic import CASES, DELAY, FAULTS, Fault, bridged, coverage, delayed, linear_car
from steer_env import metrics
from steer_env.metrics import definitions

TRIALS = 24
# An exact interval misses this in one run of a hundred, though there are some four hundred shares.
COVERED = float(stats.binom.ppf(0.01 / 400, TRIALS, 0.95) / TRIALS)


def test_mark():
    rows = list(marks.synthetic_rows(TRIALS, COVERED))
    assert not [row for row in rows if row.verdict == "FAIL"]
    assert {row.what.partition(":")[0] for row in rows} == {"faults", *CASES}


def test_an_interval_that_is_too_narrow_is_found(monkeypatch):
    """Half the width covers two thirds."""
    inner = definitions.interval

    def halved(values):
        low, high = inner(values)
        return (3 * low + high) / 4, (3 * high + low) / 4

    monkeypatch.setattr(definitions, "interval", halved)
    found = coverage(*CASES["weave, linear car"](50.0), Fault(), 40)
    assert np.mean([entry.covered for entry in found.values()]) < 0.85


def test_a_bias_is_found():
    clean, answers = CASES["weave, linear car"](50.0)
    found = coverage(clean, {name: 1.1 * value for name, value in answers.items()}, Fault(), 10)
    assert max(entry.covered for name, entry in found.items() if name != "angle_deadband") < 0.5


def test_an_unknown_delay_needs_the_timing():
    """10 ms of the lateral acceleration is a bias without it; with it, the lag's interval reaches to the truth."""
    late = delayed(CASES["weave, linear car"](100.0)[0], "lateral_acceleration", DELAY)
    sure, unsure = metrics.evaluate(late), metrics.evaluate(late, timing=DELAY)
    assert sure["lateral_acceleration_lag"].low == pytest.approx(160.0, abs=0.2)
    assert unsure["lateral_acceleration_lag"].value == sure["lateral_acceleration_lag"].value
    assert (unsure["lateral_acceleration_lag"].low, unsure["lateral_acceleration_lag"].high) == pytest.approx(
        (150.0, 170.0), abs=0.2
    )
    # torque and acceleration each move the phase between them
    half = (unsure["torque_at_0g"].high - unsure["torque_at_0g"].low) / 2
    phase = synthetic.LEAD + 0.4 * np.pi * (synthetic.AY_LAG + DELAY)
    change = synthetic.TORQUE_PEAK * (np.sin(phase) - np.sin(phase - 0.4 * np.pi * DELAY))
    assert half == pytest.approx(2 * change, rel=0.02)
    # nothing but the handwheel angle
    assert unsure["peak_handwheel_angle"].high == pytest.approx(sure["peak_handwheel_angle"].high)


def test_timing_gives_one_repeat_an_interval(monkeypatch):
    monkeypatch.setattr(definitions, "_metrics", dict(definitions._metrics))

    @metrics.metric("ms", "weave", source="here")
    def mean_lag(loops):
        """Mean lag of the yaw rate."""
        return loops.lag("yaw_rate").mean()

    clean = CASES["weave, linear car"](100.0)[0]
    assert np.isnan(metrics.evaluate(clean)["mean_lag"].low)
    found = metrics.evaluate(clean, timing=0.005)["mean_lag"]
    assert (found.low, found.high) == pytest.approx((75.0, 85.0), abs=0.1)
    with pytest.raises(ValueError, match="timing"):
        metrics.evaluate(clean, timing=-0.01)


def test_a_metric_that_the_timing_may_refuse_is_refused(monkeypatch):
    monkeypatch.setattr(definitions, "_metrics", dict(definitions._metrics))

    @metrics.metric("ms", "weave", source="here")
    def short_lag(loops):
        """Lag of the yaw rate, up to 82 ms."""
        if loops.lag("yaw_rate").mean() > 0.082:
            raise metrics.RefusedError("too late")
        return loops.lag("yaw_rate")

    clean = CASES["weave, linear car"](100.0)[0]
    assert metrics.evaluate(clean, timing=0.001)["short_lag"].reason == ""
    assert "align the channels" in metrics.evaluate(clean, timing=0.005)["short_lag"].reason


def test_faults_do_what_they_say():
    clean, rng = linear_car(cycles=5), np.random.default_rng(1)
    holes = synthetic.drop_outs(clean, rng)
    lost = {name: np.count_nonzero(np.isnan(values)) for name, values in holes.channels.items()}
    assert all(5 <= count <= 30 for count in lost.values())
    assert bridged(holes)["yaw_rate"] == pytest.approx(clean["yaw_rate"], abs=1e-4)
    with pytest.raises(ValueError, match=r"gap from .* s: 2 s, allowed is longest=0.1 s; cut the recording there"):
        bridged(synthetic.long_drop_out(clean, rng))
    fast = linear_car(cycles=5, rate=200.0)
    slow = synthetic.logged_at_50_hz(fast, rng)
    assert slow.rate == pytest.approx(50.0)
    drifting = synthetic.drifting(clean, rng)["handwheel_torque"] - clean["handwheel_torque"]
    assert abs(drifting[-1] - drifting[0]) == pytest.approx(0.1)
    late = synthetic.late(clean, rng)
    moved = [name for name in clean.channels if not np.allclose(late[name], clean[name][-late.time.size :])]
    assert len(moved) == 1
    assert FAULTS["drop-outs"].declared == "lateral_acceleration"
