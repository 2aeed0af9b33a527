"""Scales of a record, in which every law has parameters of the order of one: fits then do not depend on units (F30)."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from steer_env.friction.law import Law

# Exponents of (torque, displacement, time); "N m" is one word, because the user may as well record forces.
UNIT_EXPONENTS = {"N m": (1, 0, 0), "rad": (0, 1, 0), "s": (0, 0, 1), "1": (0, 0, 0)}


class Scales(NamedTuple):
    """What counts as one, in the units of the record."""

    torque: float  # half the width of the plateau [N m]
    displacement: float  # over which the torque follows a reversal, about F_c/sigma_0 [rad]
    time: float  # for that displacement at the record's speed [s]

    def of(self, unit: str) -> float:
        """The scale of a quantity in this unit; raises ValueError for a word that is none of ``UNIT_EXPONENTS``."""
        torque, displacement, time = exponents(unit)
        return self.torque**torque * self.displacement**displacement * self.time**time


def exponents(unit: str) -> tuple[int, int, int]:
    """Exponents of torque, displacement and time in a unit such as ``"N m s/rad"`` or ``"rad/s2"``.

    Raises
    ------
    ValueError
        For a word that is not known.
    """
    above, _, below = unit.partition("/")
    total = [0, 0, 0]
    for part, sign in ((above, 1), (below, -1)):
        for word, power in re.findall(r"(N m|[^\W\d]+|1)\^?(\d*)", part):
            if word not in UNIT_EXPONENTS:
                raise ValueError(f"a unit must be made of {', '.join(UNIT_EXPONENTS)}, got {unit!r}")
            for i, exponent in enumerate(UNIT_EXPONENTS[word]):
                total[i] += sign * exponent * int(power or 1)
    return total[0], total[1], total[2]


def scaled(law: Law, values: Mapping[str, Any], scales: Scales, *, back: bool = False) -> dict[str, Any]:
    """Parameters of a law in the scales of a record, or from there back in its units (F30).

    Raises
    ------
    ValueError
        If the law does not tell the unit of one of them.
    """
    result = {}
    for name, value in values.items():
        if name not in law.units:
            raise ValueError(
                f"friction law {law.name!r} does not tell the unit of {name!r}: register it with units="
                f'{{"{name}": "N m"}} or its like, from which its scale in a record follows'
            )
        scale = scales.of(law.units[name])
        result[name] = value * scale if back else value / scale  # (F30)
    return result
