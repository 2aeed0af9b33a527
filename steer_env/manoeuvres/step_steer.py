"""Step steer."""

import numpy as np

from steer_env.manoeuvres.common.definition import Array, Manoeuvre, last_second, register
from steer_env.manoeuvres.common.shapes import excursion

BACK = 1.0  # time of the return to straight ahead [s]


@register("step-steer")
def step_steer(
    start: float = 1.0,
    rise: float = 0.2,
    hold: float = 4.8,
    straight: float = 4.0,
    left: bool = True,
    right: bool = True,
    repeats: int = 1,
) -> Manoeuvre:
    """Step steer: the handwheel turns as fast as people turn it and is held, then returns; left and right alternate.

    Parameters
    ----------
    start : float
        Time straight ahead before the first step [s].
    rise, hold, straight : float
        Times in which the handwheel turns, is held, and is straight before the next step [s].
    left, right : bool
        Sides of the steps; left comes first.
    repeats : int
        Number of steps to each side.

    Raises
    ------
    ValueError
        If there is no side or no repeat.
    """
    sides = ([1.0] * left + [-1.0] * right) * repeats
    if not sides:
        raise ValueError(
            f"step-steer: no step with left={left}, right={right}, repeats={repeats}: ask for at least one"
        )
    each = rise + hold + BACK + straight

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        steps = [excursion(t - start - i * each, side * amplitude, rise, hold, BACK) for i, side in enumerate(sides)]
        return np.sum([step[0] for step in steps], axis=0), np.sum([step[1] for step in steps], axis=0)

    return Manoeuvre(
        name="step-steer",
        hands=f"Handwheel angle rises in {rise:g} s and stays for {hold:g} s, {len(sides)} steps",
        source="after ISO 7401",
        speed=80.0 / 3.6,
        duration=start + len(sides) * each,
        hand=hand,
        lateral_acceleration=4.0,
        reach=lambda acceleration: sides[0] * last_second(acceleration),
        trial=start + rise + hold,
    )
