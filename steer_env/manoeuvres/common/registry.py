"""The manoeuvres by name. Listing them imports none of them."""

from typing import Any

from steer_env.friction.numerics.registry import Registry, with_dashes

# Functions that return a ``Manoeuvre``; the class is not imported, because its module imports the plant.
MANOEUVRES: Registry[Any] = Registry("manoeuvre", "steer_env.manoeuvres", with_dashes)


def available() -> tuple[str, ...]:
    """Names of the manoeuvres, in alphabetical order."""
    return MANOEUVRES.available()
