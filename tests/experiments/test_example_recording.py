"""The shipped example of a measured recording: what its script makes, and what the metrics read through its mapping."""

import runpy
from pathlib import Path

from steer_env import manoeuvres, metrics
from steer_env.recording import files
from steer_env.vehicle import cars

FOLDER = Path(__file__).parents[2] / "examples"
SHIPPED = (FOLDER / "weave_example.csv").read_bytes()


def mapped():
    """The file as its mapping says, gaps bridged."""
    return files.read(FOLDER / "weave_example.csv", FOLDER / "weave_example.toml").bridged()


def test_the_script_makes_the_shipped_file():
    made = runpy.run_path(str(FOLDER / "make_example_recording.py"))["text"]()
    assert made.encode() == SHIPPED
    assert SHIPPED.startswith(b"# origin: SYNTHETIC")


def test_the_metrics_of_the_file_are_those_of_the_car():
    """Every interval, wider by a hundredth of the value, holds what the simulation's own recording gives."""
    true = metrics.evaluate(manoeuvres.drive(cars.load(), manoeuvres.make("weave")))
    found = metrics.evaluate(mapped())
    for name, value in found.items():
        slack = 0.01 * abs(true[name].value)
        assert value.reason == ""
        assert value.low - slack <= true[name].value <= value.high + slack, name
