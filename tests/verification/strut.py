"""Kinematics of the MacPherson strut."""

from collections.abc import Iterator

from tests.vehicle.oracles import STRUT_S1, STRUT_S1_DEVIATIONS, strut_s1
from tests.verification.common.rows import Row, as_printed


def rows() -> Iterator[Row]:
    """Strut S1 against its table, to the last digit. Its points, rounded to 0.1 mm, give 0.1968 deg at -60 mm."""
    for name, values in strut_s1().items():
        yield as_printed(name, values, STRUT_S1[name], STRUT_S1_DEVIATIONS.get(name, ""))
