"""The tests that have metrics, by name. Listing them imports none of them."""

from typing import Any

from steer_env.friction.numerics.registry import Registry, with_dashes

# Of ``ManoeuvreEvaluation``; the class is not imported, because its module imports the readers of recordings.
EVALUATIONS: Registry[Any] = Registry("test", "steer_env.metrics", with_dashes)


def tests() -> tuple[str, ...]:
    """Names of the tests that have metrics, in alphabetical order."""
    return EVALUATIONS.available()
