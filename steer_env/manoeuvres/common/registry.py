"""The manoeuvres by name. Listing them imports none of them."""

from typing import Any

from steer_env.friction.numerics.registry import Registry, dashed

# Functions that return a ``Manoeuvre``; the class is not imported, because its module imports the plant.
MANOEUVRES: Registry[Any] = Registry("manoeuvre", "steer_env.manoeuvres", dashed)


def available() -> tuple[str, ...]:
    """Names of the manoeuvres, in alphabetical order."""
    return MANOEUVRES.available()
