"""The manoeuvres by name. Listing them imports none of them."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from steer_env.friction.numerics.registry import Registry, dashed

if TYPE_CHECKING:
    from steer_env.manoeuvres.common.definition import Manoeuvre

MANOEUVRES: "Registry[Callable[..., Manoeuvre]]" = Registry("manoeuvre", "steer_env.manoeuvres", dashed)


def available() -> tuple[str, ...]:
    """Names of the manoeuvres, in alphabetical order."""
    return MANOEUVRES.available()
