"""On-centre feel."""

from collections.abc import Iterator

from steer_env import manoeuvres, metrics, targets
from steer_env.experiments.pages.words import label
from steer_env.vehicle import cars
from tests.verification.common.rows import Row, verdict


def rows() -> Iterator[Row]:
    """On-centre feel of the default car: weave at 100 km/h, 0.2 Hz, 2 m/s2; fair bands of a compact car."""
    found = metrics.evaluate(manoeuvres.drive(cars.load(), manoeuvres.make("weave")))
    for name, band in targets.load("compact").bands["weave"].items():
        value, (low, high) = found[name].value, band.fair
        unit = "" if found[name].unit == "1" else found[name].unit
        aim = f"{low:g} to {high:g} {unit}".strip()
        yield Row(label(name), f"{value:.4g}", aim, verdict(low <= value <= high))
