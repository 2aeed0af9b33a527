"""Measured records: what is said of them is what their samples show."""

from pathlib import Path

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction import records
from steer_env.recording import files, friction_record

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", records.available())
def test_what_is_said_of_a_record(name):
    about, record = records.about(name), records.read(name)
    assert np.ptp(record.x) == pytest.approx(about.stroke, rel=0.02)
    n = 40  # steps of the sensor are a tenth of the way between two samples
    speeds = np.abs(record.x[n:] - record.x[:-n]) / (n * record.dt)
    moves = speeds > 0.5 * max(about.speeds)
    assert float(np.median(speeds[moves])) == pytest.approx(float(np.median(about.speeds)), rel=0.05)
    assert float(np.mean(record.load)) == pytest.approx(about.load, rel=0.01)
    assert np.sum(record.torque[1:] * np.diff(record.x)) > 0.0  # friction takes work


def test_the_rig_is_that_of_fit_friction():
    other = friction_record.from_recording(files.read(ROOT / "friction" / "data" / "rig.csv.gz"))
    record = friction.records.read("rig")
    np.testing.assert_allclose(record.x, other.x, rtol=1e-12)
    np.testing.assert_allclose(record.torque, other.friction, rtol=1e-12)
    assert record.dt == pytest.approx(other.dt)


def test_an_unknown_record():
    with pytest.raises(ValueError, match=r"record.*rig.*got 'road'"):
        records.read("road")
