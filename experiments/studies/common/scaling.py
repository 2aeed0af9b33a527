"""A friction law in other units of torque and displacement, by the units that the law declares."""

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from steer_env.friction.law import law_of
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.sites import Sites

_POWERS = {"N": (1, 0), "m": (0, 0), "rad": (0, 1), "s": (0, 0), "1": (0, 0)}  # word -> powers of torque, displacement


def scale_record(p: Any, torque: float, displacement: float) -> Any:
    """The same law with every torque and every displacement multiplied, at the same times.

    Parameters
    ----------
    p : parameters
        Of a law, or of sites, whose gear keeps its efficiency.
    torque, displacement : float
        Factors, above 0 [1].

    Raises
    ------
    ValueError
        For a law that does not declare the unit of a parameter.
    """
    if isinstance(p, Sites):
        return frozen(
            Sites(
                *(
                    site._replace(
                        law=scale_record(site.law, torque, displacement),
                        driving=site.driving / torque,
                        driven=site.driven / torque,
                    )
                    for site in p
                )
            )
        )
    law = law_of(p)
    found = {}
    for name, value in p._asdict().items():
        if name not in law.units:
            raise ValueError(f"friction law {law.name!r} declares no unit of {name}; give units= in its register")
        a, b = powers(law.units[name])
        found[name] = value if isinstance(value, int) else np.multiply(value, torque**a * displacement**b)
    return frozen(p._replace(**{k: v if np.ndim(v) or isinstance(v, int) else float(v) for k, v in found.items()}))


def check(laws: Iterable[Any]) -> None:
    """ValueError for the first of some laws that cannot be scaled: to be asked before hours of work that scale it."""
    for p in laws:
        scale_record(p, 1.0, 1.0)


def powers(unit: str) -> tuple[int, int]:
    """Powers of torque and of displacement in a unit such as ``N m s/rad``; ValueError for an unknown one."""
    above, _, below = unit.partition("/")
    total = [0, 0]
    for part, sign in ((above, 1), (below, -1)):
        for word in part.split():
            found = re.fullmatch(r"([A-Za-z]+|1)(\d*)", word)
            if not found or found[1] not in _POWERS:
                raise ValueError(f"unit {unit!r}: expected words out of {', '.join(_POWERS)}, got {word!r}")
            for i in (0, 1):
                total[i] += sign * int(found[2] or 1) * _POWERS[found[1]][i]
    return total[0], total[1]
