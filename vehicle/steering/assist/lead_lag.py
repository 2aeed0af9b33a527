"""Lead-lag: phase compensation of the torsion bar's torque, in addition to the boost and its own lead (E15).

    T = gain (1 + s/lag_zero)/(1 + s/lag_pole) (1 + s/lead_zero)/(1 + s/lead_pole) T_tb        (E15)

The corners are discretised by the rule of Tustin without pre-warping, so that the filter at 1 ms and that of a slower
controller have the same analogue.
"""

from typing import Any, NamedTuple

import numpy as np

from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.keys import checked
from steer_env.vehicle.steering.assist import first_order
from steer_env.vehicle.steering.assist.first_order import FirstOrder, filtered

LAG, LEAD = (20.0, 20.0), (1.0, 30.0)  # zero and pole [Hz]; the default has no lag


class LeadLag(NamedTuple):
    """Parameters as the kernels take them."""

    gain: float  # torque over the torsion bar's torque at 0 Hz, positive where it assists [1]
    lag: FirstOrder
    lead: FirstOrder


STATES = (("lead_lag_filter_0", "N m"), ("lead_lag_filter_1", "N m"))


def make(dt: float, *, lead_lag_gain: float = 0.0, lead_lag_lag: Any = LAG, lead_lag_lead: Any = LEAD) -> LeadLag:
    """Checked parameters for samples of ``dt`` [s]; a gain of 0 is off.

    Parameters
    ----------
    dt : float
        Sample time [s].
    lead_lag_gain : float
        Gain at 0 Hz, -0.9 to 10; negative for heavier steering [1]. With the default corners the gain at high frequency
        is 30 times as large: the loop of the compact car is unstable below -0.08 with the hands off and below -0.13
        with a held handwheel (at 80 km/h), those of the other packaged cars below -0.05 to -0.13. A gain that is more
        negative needs corners closer together.
    lead_lag_lag, lead_lag_lead : (float, float)
        Zero and pole, above 0 and at most 0.49/dt, at 1 ms 490 Hz [Hz].
    """
    gain = checked("assist", "lead_lag_gain", lead_lag_gain)
    lag, lead = (
        first_order.lead(*_corners(name, pair, 0.49 / dt), dt)
        for name, pair in (("lead_lag_lag", lead_lag_lag), ("lead_lag_lead", lead_lag_lead))
    )
    return LeadLag(gain, lag, lead)


def _corners(name: str, pair: Any, highest: float) -> tuple[float, float]:
    if np.shape(pair) != (2,):
        raise ValueError(f"{name} must be a pair of zero and pole [Hz], got {pair!r}")
    zero, pole = (number(f"{name} [Hz]", f, minimum=0.01, maximum=highest) for f in pair)
    return zero, pole


def keys(p: LeadLag, dt: float) -> dict[str, Any]:
    """The keys of a car file that make these parameters; the corners to twelve digits."""
    lag, lead = ([first_order.zero(f, dt), first_order.pole(f, dt)] for f in (p.lag, p.lead))
    return {"lead_lag_gain": p.gain, "lead_lag_lag": lag, "lead_lag_lead": lead}


@kernel
def torque(p, gain, x, twist):
    """Torque with a torsion-bar torque [N m]; ``x`` (2,) is the function's state, ``gain`` that at 0 Hz [1]."""
    return gain * filtered(p.lead, x, 1, filtered(p.lag, x, 0, twist))  # (E15)
