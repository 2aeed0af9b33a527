"""Friction laws."""

from collections.abc import Iterator

from tests.friction.oracles import ORACLES
from tests.verification.common.rows import Row, at_most


def rows() -> Iterator[Row]:
    """Friction laws against their closed forms."""
    for oracle in ORACLES.values():
        yield at_most(oracle.what, list(oracle.errors()), oracle.limit, oracle.unit)
