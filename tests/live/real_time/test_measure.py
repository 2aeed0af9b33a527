"""The measurement of the loop on this machine; times are printed and not judged, as this machine is shared."""

import json
import sys

import numpy as np
import pytest

from steer_env.experiments.cli.main import main
from steer_env.live.real_time import Mailboxes, RealTime
from steer_env.live.real_time.loop import BINS
from steer_env.live.real_time.measure import Durations, measure
from steer_env.vehicle import cars, subsystems

if sys.platform != "linux":
    pytest.skip("the loop needs Linux", allow_module_level=True)


def part(name="car"):
    """The default car, or a part of it, with a prescribed handwheel angle."""
    return subsystems.make(name, cars.load("compact").plant("lugre", robot=True), 100.0 / 3.6)


def test_durations_against_the_values_themselves():
    values = np.random.default_rng(2).exponential(3e-4, 20_000)
    histogram = np.bincount((values / 1e-6).astype(int), minlength=BINS)
    found = Durations(histogram, 1e-6, float(values.max()))
    for percent in (50.0, 99.0, 99.9):
        assert found.percentile(percent) == pytest.approx(np.percentile(values, percent), rel=0.01)
    assert found.percentile(100.0) == found.worst
    assert (found + found).percentile(50.0) == found.percentile(50.0)
    long = np.zeros(BINS, np.int64)
    long[-1] = 1
    assert Durations(long, 1e-6, 2.0).percentile(50.0) == 2.0


def test_both_loops_wake_in_every_millisecond():
    found = measure(part(), 0.5)
    assert found.counts["ticks"] == found.lateness.histogram.sum() == found.work.histogram.sum() == 500
    assert abs(found.bare.histogram.sum() - 500) <= 1 + found.counts["missed"]
    assert found.lateness.worst > 0.0
    assert 1e-7 < found.work.percentile(50.0) < 1e-3
    with pytest.raises(ValueError, match="a subsystem with a handwheel is measured, got chassis"):
        measure(part("chassis"), 0.5)


def test_a_program_in_python_through_mailboxes():
    """The loop runs beside Python, which leaves inputs and takes outputs; at the end the torque is zero."""
    made = part()
    mail = Mailboxes(made)
    inputs = np.zeros(len(made.given))
    with RealTime(made, mail.device, most=10_000) as running:
        seen = 0.0
        while seen == 0.0 and running.counts()["ticks"] < 5000:
            inputs[1] = 0.2
            mail.put(inputs)
            seen = mail.get()[0]
        assert seen < 0.0  # the torsion bar pulls the handwheel back
    torque, _, outputs = mail.get()
    assert torque == 0.0
    assert np.isfinite(outputs).all()


def test_what_a_thread_fails_with_is_raised_at_the_end():
    made = part()
    with (
        pytest.raises(OSError, match="Invalid argument"),
        RealTime(made, Mailboxes(made).device, most=10, priority=1000) as running,
    ):
        running.wait()


@pytest.mark.whole
def test_the_command_writes_a_page(tmp_path, capsys):
    out = tmp_path / "page"
    assert main(["real-time", "--seconds", "4", "--friction", "lugre", "--out", str(out)]) == 0
    found = json.loads((out / "real_time.json").read_text())["real_time"]
    assert [row["chassis"] for row in found["rows"]] == ["single_track", "two_track"]
    assert set(found["over_bare"]) == {"50", "99", "99.9"}
    assert len(found["conditions"]) == 5
    assert set(found["latency"]) == {"fake wheel", "virtual CAN", "UDP"}
    assert (out / "index.html").exists()
    assert main(["real-time", "--seconds", "0.5", "--out", str(out)]) == 2
    assert "--seconds must be finite and at least 1" in capsys.readouterr().err
