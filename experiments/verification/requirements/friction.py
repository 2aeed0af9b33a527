"""Friction laws."""

from collections.abc import Iterator

from steer_env.experiments.verification.requirements.common.rows import Row, at_most
from steer_env.friction.oracles import ORACLES


def rows() -> Iterator[Row]:
    """Friction laws against their closed forms."""
    for oracle in ORACLES.values():
        yield at_most(oracle.what, list(oracle.errors()), oracle.limit, oracle.unit)
