"""Values of the assist that depend on the vehicle speed: one for each speed of the boost table."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.keys import declared_keys


def table(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """``values`` as an array of floats; ValueError where they are no numbers or not in rows of one length."""
    try:
        return np.array(values, float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must hold numbers, in rows of one length, got {values!r}") from None


def by_speed(name: str, values: ArrayLike, count: int) -> NDArray[np.float64]:
    """``values`` (count,) of a key of the assist, one for each speed of the boost table; a lone value counts for all.

    Raises
    ------
    ValueError
        Naming the key, the range and the number of speeds.
    """
    about = declared_keys()["assist"][name]
    given = table(name, values)
    found = np.full(count, given) if given.shape in ((), (1,)) else given
    if found.shape != (count,) or not np.all((found >= about.low) & (found <= about.high)):
        allowed = f"one number, or {count} for as many speeds, from {about.low:g} to {about.high:g}"
        raise ValueError(f"{name} must be {allowed}, got {given.tolist()}")
    return frozen(found)


def shortest(values: NDArray[np.float64]) -> list[float]:
    """The form of a car file: one value where it holds for every speed, else one for each."""
    return values[: 1 if np.all(values == values[0]) else None].tolist()


@kernel
def interpolate_cell(values, i, u):
    """The value in a cell ``i`` of the speeds, at a position ``u`` in it from 0 to 1."""
    return values[i] + u * (values[i + 1] - values[i])
