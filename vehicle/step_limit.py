"""Whether the step equation of a plant has one solution: refused where it may have several.

    S > steepest fall of the law's mean torque with the speed          (F13)

S is that of the column under a given hand torque (C5), where it is smallest. Arms on the handwheel and a shorter step
raise it. The fall grows with the friction scale (F11), which is taken at the largest rack force, and at the position
and in the direction in which it is largest. The numbers of the equations are those of docs/model.md.
"""

from steer_env.friction import sites
from steer_env.friction.law import law_of
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.steering.column import Column
from steer_env.vehicle.steering.eps import SAMPLE_TIME

# Assumed. Hands of 25 N m and the full boost of the packaged cars hold 8 to 12 kN against an end stop.
LARGEST_RACK_FORCE = 15e3  # [N]
SHORTEST_STEP = 1e-7  # below which no step is looked for, assumed [s]


def least_slopes(c: Column, h: float) -> tuple[float, float]:
    """The smallest S of the step equation above and below the bar, over a step of ``h`` [s], in N m s/rad."""
    K = c.C_tb + 0.5 * h * c.K_tb  # (C4)
    above = 2.0 * (c.I1 + c.I_arm) / h + c.C1 + c.C_arm + 0.5 * h * c.K_arm + K  # (C4)
    below = 2.0 * c.I2 / h + c.C2 + K
    return above - K * K / below, below - K * K / above  # (C5)


def checked(p: Plant) -> Plant:
    """The plant itself, if its step equation has one solution.

    Raises
    ------
    ValueError
        It may have several, with the slope that is allowed, the longest step and what helps.
    """
    law, level = law_of(p.friction), p.friction_torque_scale

    def fall_and_slope(h: float) -> tuple[float, float]:
        """Of the site that is nearer to its limit."""
        loads = LARGEST_RACK_FORCE, p.assist.limit
        pairs = zip(sites.falls(p.friction, p.level, level, *loads, h), least_slopes(p.column, h))
        return max(pairs, key=lambda pair: pair[0] / pair[1])

    def single(h: float) -> bool:
        fall, slope = fall_and_slope(h)
        return fall < slope  # (F13)

    if single(SAMPLE_TIME):
        return p
    low, high = SHORTEST_STEP, SAMPLE_TIME
    if single(low):
        while high > 1.001 * low:
            h = (low * high) ** 0.5
            low, high = (h, high) if single(h) else (low, h)
        steps = f"steps of up to {1e3 * low:.3g} ms would do"
    else:
        steps = "no shorter step helps"
    fall, slope = fall_and_slope(SAMPLE_TIME)
    raise ValueError(
        f"friction law {law.name!r}: its torque falls with the speed by up to {fall:.3g} N m s/rad at the largest"
        f" friction scale (level {level:g}, rack force {1e-3 * LARGEST_RACK_FORCE:g} kN); at the step of"
        f" {1e3 * SAMPLE_TIME:g} ms the column allows less than {slope:.3g}, beyond which"
        f" the speed is not determined ({steps}). Raise the law's Stribeck speed, or lower its break-away torque"
        " towards its sliding torque, its damping of the bristles or the friction level"
    )
