"""The shipped example of a measured recording: what its script makes, and what the metrics read through its mapping."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from experiments.synthetic import bridged, delayed
from steer_env import manoeuvres, metrics
from steer_env.recording import DEGREE, Recording
from vehicle import cars
from vehicle.single_track import GRAVITY as G

try:
    import tomllib
except ModuleNotFoundError:  # before Python 3.11
    import tomli as tomllib

FOLDER = Path(__file__).parents[2] / "examples"
SHIPPED = (FOLDER / "weave_example.csv").read_bytes()
SI = {"deg": DEGREE, "deg/s": DEGREE, "N m": 1.0, "g": G, "km/h": 1 / 3.6}


def mapped():
    """The file as its mapping says, gaps bridged."""
    mapping = tomllib.loads((FOLDER / "weave_example.toml").read_text(encoding="utf-8"))
    header, *rows = (line for line in SHIPPED.decode().splitlines() if not line.startswith("#"))
    table = dict(zip(header.split(";"), np.array([row.split(";") for row in rows], dtype=float).T))
    entries = {name: entry for name, entry in mapping["channels"].items() if name != "time"}
    channels = {n: e["sign"] * (table[e["from"]] - e["offset"]) * SI[e["unit"]] for n, e in entries.items()}
    units = {name: metrics.CHANNELS[name] for name in channels}
    found = bridged(Recording(table["Time [s]"], channels, units, mapping["meta"]))
    for name, entry in entries.items():
        if entry["delay_ms"]:
            found = delayed(found, name, -entry["delay_ms"] / 1e3)
    return found


def test_the_script_makes_the_shipped_file():
    made = runpy.run_path(str(FOLDER / "make_example_recording.py"))["text"]()
    assert made.encode() == SHIPPED
    assert len(SHIPPED) < 600_000
    assert SHIPPED.startswith(b"# origin: SYNTHETIC")
    assert SHIPPED.count(b"NaN") == 5  # 60 ms and 40 ms at 50 Hz


def test_the_metrics_of_the_file_are_those_of_the_car():
    """Every interval, wider by a hundredth of the value, holds what the simulation's own recording gives."""
    true = metrics.evaluate(manoeuvres.drive(cars.load(), manoeuvres.make("weave"), "lugre"))
    found = metrics.evaluate(mapped())
    for name, value in found.items():
        slack = 0.01 * abs(true[name].value)
        assert value.reason == ""
        assert value.low - slack <= true[name].value <= value.high + slack, name


def test_an_undeclared_delay_shows_in_the_lag():
    late = delayed(mapped(), "lateral_acceleration", 0.010)
    lag = (
        metrics.evaluate(late)["lateral_acceleration_lag"].value
        - metrics.evaluate(mapped())["lateral_acceleration_lag"].value
    )
    assert lag == pytest.approx(10.0, abs=0.1)
