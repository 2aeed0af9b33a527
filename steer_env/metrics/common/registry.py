"""The tests that have metrics, by name. Listing them imports none of them."""

from typing import TYPE_CHECKING

from steer_env.friction.numerics.registry import Registry, dashed

if TYPE_CHECKING:
    from steer_env.metrics.common.definitions import ManoeuvreEvaluation

EVALUATIONS: "Registry[ManoeuvreEvaluation]" = Registry("test", "steer_env.metrics", dashed)


def tests() -> tuple[str, ...]:
    """Names of the tests that have metrics, in alphabetical order."""
    return EVALUATIONS.available()
