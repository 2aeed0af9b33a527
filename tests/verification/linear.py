"""Metrics against linear analysis."""

from collections.abc import Iterator

from tests.verification.common import linear_car
from tests.verification.common.rows import Row, at_most


def rows() -> Iterator[Row]:
    """Metrics of the linear car at 80 km/h, driven by our manoeuvres at 1 kHz, against those of python-control."""
    for what, error in linear_car.errors():
        yield at_most(what, error, 0.01)
