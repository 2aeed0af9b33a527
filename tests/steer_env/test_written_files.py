"""Files at the default rate and digits of ``steer-env run``: what is lost, and that it does not change the metrics."""

import numpy as np
import pytest

from steer_env import manoeuvres, metrics
from steer_env.experiments.cli.run import FILE_DIGITS, FILE_RATE
from steer_env.recording.files import read, write
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle import cars

# Metrics of a simulation have intervals as narrow as rounding; beside those, the file may change a value by so much.
CHANGE = 5e-4  # of the value [1]
RIPPLE = 0.02  # of the ripple of some 5e-5 N m, part of which is above the low-pass of the file, 80 Hz [1]


def test_digits_are_significant_ones_in_the_unit_of_the_file(tmp_path):
    values = np.array([np.pi, -1234.56789, 1e-9 / 3, 0.0, np.nan, 2.0])
    written = Recording(np.arange(6) / 3, {"force": values, "angle": values * DEGREE}, {"force": "N", "angle": "rad"})
    write(written, tmp_path / "run.csv", digits=4)
    expected = [3.142, -1235.0, 3.333e-10, 0.0, np.nan, 2.0]
    back = read(tmp_path / "run.csv")
    np.testing.assert_array_equal(back["force"], expected)
    np.testing.assert_allclose(back["angle"], np.array(expected) * DEGREE, rtol=1e-15)
    np.testing.assert_allclose(back.time, written.time, atol=0.5e-9)
    assert (tmp_path / "run.csv").read_text().splitlines()[2] == "0.333333333,-1235.0,-1235.0"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "weave" else pytest.mark.whole) for name in metrics.tests()]
)
def test_metrics_of_the_written_file_are_those_of_the_full_rate(tmp_path, name):
    driven = manoeuvres.drive(cars.load(), manoeuvres.make(name), "lugre")
    path = tmp_path / "run.csv"
    write(driven.filtered(0.4 * FILE_RATE).resampled(FILE_RATE), path, digits=FILE_DIGITS)
    if name == "weave":
        assert path.stat().st_size < 5e6  # of 60 s; 30 MB at the full rate
    full, again = metrics.evaluate(driven), metrics.evaluate(read(path))
    assert not all(value.reason for value in full.values())
    for metric, value in full.items():
        found = again[metric]
        assert bool(found.reason) == bool(value.reason), (metric, value.reason, found.reason)
        if not value.reason:
            close = RIPPLE if metric == "torsion_bar_ripple" else CHANGE
            inside = value.low <= found.value <= value.high
            assert inside or found.value == pytest.approx(value.value, rel=close), metric
