"""Straight running in crosswind with free hands."""

from dataclasses import replace

from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.manoeuvres.crosswind import crosswind


@register("crosswind-free")
def crosswind_free(
    wind: float | None = None,
    length: float = 25.0,
    events: int = 4,
    speed: float = 100.0 / 3.6,
    seed: int | None = None,
    duration: float = 60.0,
) -> Manoeuvre:
    """Crosswind, hands free: the wind of the manoeuvre crosswind, with the hands off the handwheel."""
    fixed = crosswind(wind, length, events, speed, seed, duration)
    hands = fixed.hands.replace("Handwheel held straight", "Hands off")
    return replace(fixed, name="crosswind-free", hands=hands, robot=False)
