"""The packaged drive on a road: what its file holds, read by its name."""

import hashlib
from importlib.resources import files

import numpy as np
import pytest

from steer_env.experiments.cli.common import names
from steer_env.recording import read

FOLDER = files("steer_env.experiments").joinpath("data", "road")


@pytest.mark.parametrize("name", names.road_drives())
def test_a_drive_has_its_source_and_its_mapping(name):
    """The text names the file with its digest, and the mapping yields what a hand torque is identified from."""
    text = FOLDER.joinpath("SOURCES.md").read_text(encoding="utf-8")
    path = FOLDER.joinpath(f"{name}.csv.gz")
    assert hashlib.sha256(path.read_bytes()).hexdigest() in text
    assert "MIT License" in text
    drive = read(str(path), str(FOLDER.joinpath(f"{name}.toml")))
    expected = {"handwheel_angle": "rad", "torsion_bar_torque": "N m", "vehicle_speed": "m/s"}
    assert expected.items() <= drive.units.items()


def test_the_drive_is_the_one_that_its_source_describes():
    drive = read(str(FOLDER.joinpath("mkz_2016.csv.gz")), str(FOLDER.joinpath("mkz_2016.toml")))
    assert 129.9 < drive.time[-1] - drive.time[0] < 130.1
    assert 71.0 < 3.6 * drive["vehicle_speed"].min() < 3.6 * drive["vehicle_speed"].max() < 100.0
    torque = drive["torsion_bar_torque"]
    steps = np.abs(torque / 0.0625 - np.rint(torque / 0.0625)) < 1e-3
    assert 0.2 < steps.mean() < 0.4  # the others were interpolated
