"""Units as FMI defines them: products of powers of kg, m, s, K and rad. All units of the project are SI units."""

import re

# Unit -> powers of the base units.
_KNOWN: dict[str, dict[str, int]] = {
    "1": {},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
    "K": {"K": 1},
}


def base_unit(unit: str) -> dict[str, int] | None:
    """Powers of the base units in a unit such as ``"N m s/rad"`` or ``"m/s2"``; None where a part of it is unknown.

    Parameters
    ----------
    unit : str
        Products with spaces, powers as digits behind a symbol, and at most one stroke, behind which everything divides.
    """
    powers: dict[str, int] = {}
    over, _, under = unit.partition("/")
    for text, sign in ((over, 1), (under.strip("() "), -1)):
        for word in text.split():
            match = re.fullmatch(r"([A-Za-z]+|1)(\d?)", word)
            if match is None or match[1] not in _KNOWN:
                return None
            for base, power in _KNOWN[match[1]].items():
                powers[base] = powers.get(base, 0) + sign * power * int(match[2] or 1)
    return {base: power for base, power in powers.items() if power}
