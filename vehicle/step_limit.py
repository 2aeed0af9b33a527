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


def equations(c: Column, h: float) -> tuple[float, float, float]:
    """a, S and K of the step equations (F43) of a column over a step of ``h`` [s], in N m s/rad."""
    K = c.C_tb + 0.5 * h * c.K_tb  # (C4)
    a = 2.0 * (c.I1 + c.I_arm) / h + c.C1 + c.C_arm + 0.5 * h * c.K_arm + K  # (C4)
    return a, 2.0 * c.I2 / h + c.C2 + K, K


def least_slope(c: Column, h: float) -> float:
    """The smallest S of the step equation of a column, over a step of ``h`` [s], in N m s/rad."""
    a, S, K = equations(c, h)
    return S - K * K / a  # (C5)


def checked(p: Plant) -> Plant:
    """The plant itself, if its step equations have one solution.

    Raises
    ------
    ValueError
        They may have several, with the slope that is allowed, the longest step and what helps.
    """
    level = p.friction_torque_scale
    largest = p.level, level, LARGEST_RACK_FORCE, p.assist.limit

    def falls(h: float) -> tuple[float, float]:
        return sites.falls(p.friction, *largest, h)

    def single(h: float) -> bool:
        (above, below), (a, S, K) = falls(h), equations(p.column, h)
        return above < a and below < S and (a - above) * (S - below) > K * K  # (F13)

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
    (above, below), (a, S, K) = falls(SAMPLE_TIME), equations(p.column, SAMPLE_TIME)
    upper = above * S > below * a  # of the torsion bar, where the limit is nearer
    # What the fall on the other side leaves. (F13)
    fall, slope = (
        (above, a - K * K / max(S - below, K * K / a)) if upper else (below, S - K * K / max(a - above, K * K / S))
    )
    law = repr(law_of(p.friction).name)
    if isinstance(p.friction, sites.Sites):
        of_site, side = sites.falls_by_site(p.friction, *largest, SAMPLE_TIME), "above" if upper else "below"
        names = [name for name in ((sites.ABOVE,) if upper else sites.BELOW) if of_site[name] > 0.0]
        law = " and ".join(f"{law_of(getattr(p.friction, name).law).name!r} at {name}" for name in names)
        law += f", {side} the torsion bar"
    raise ValueError(
        f"friction law {law}: its torque falls with the speed by up to {fall:.3g} N m s/rad at the"
        f" largest friction scale (level {level:g}, rack force {1e-3 * LARGEST_RACK_FORCE:g} kN); at the step of"
        f" {1e3 * SAMPLE_TIME:g} ms the column allows less than {slope:.3g}, beyond which"
        f" the speed is not determined ({steps}). Raise the law's Stribeck speed, or lower its break-away torque"
        " towards its sliding torque, its damping of the bristles or the friction level"
    )
