"""Rate-and-state friction behind a contact spring: a law of two states, of which one is odd and one is even.

    T = k z,    z' = v - u,    theta' = 1 - |u| theta/D_c
    T = L a asinh(u/(2 v_0) exp((F_0 + b ln(v_0 theta/D_c))/a))

The spring's deflection z is odd. The contact slips with the speed u, which follows from T. The age theta of the contact
is even, and it grows at rest; theta_0 is that with which a motion starts. Steady sliding has theta = D_c/v and

    T = L (F_0 + (a - b) ln(v/v_0)),

but for the regularisation of v -> 0. A jump of the speed changes the torque by a times its logarithm at once, and over
the distance D_c by -b times it; a hold makes the contact stronger with the logarithm of its time. The numbers below are
assumed, with a and b near 0.02 of F_0, as they are of rock.

Sources: J. H. Dieterich, J. Geophys. Res. 84 (1979) 2161 (ageing law); A. Ruina, J. Geophys. Res. 88 (1983) 10359
(state, stiffness of stable sliding); J. R. Rice, N. Lapusta, K. Ranjith, J. Mech. Phys. Solids 49 (2001) 1865
(regularisation). Deviations: the speed of the slip ends at e^10 v_0, so that the integration of a load, however far the
torque scale L has fallen below it, stays within numbers.
"""

import math
from typing import NamedTuple

from steer_env import friction
from steer_env.friction.numerics.check import not_negative, positive
from steer_env.friction.numerics.kernel import kernel

FASTEST = 10.0  # logarithm of the speed of the slip over v_0, assumed [1]


class RateAndState(NamedTuple):
    """Parameters: what the kernels read."""

    k: float  # stiffness of the contact [N m/rad]
    F_0: float  # steady sliding torque at the speed v_0 [N m]
    a: float  # direct effect [N m]
    b: float  # evolution effect [N m]
    D_c: float  # distance over which the contact is renewed [rad]
    v_0: float  # reference speed [rad/s]
    theta_0: float  # age of the contact at the start [s]


def make(
    *,
    k: float = 100.0,
    F_0: float = 0.9,
    a: float = 0.02,
    b: float = 0.025,
    D_c: float = 0.02,
    v_0: float = 0.1,
    theta_0: float = 1.0,
) -> RateAndState:
    """Checked parameters; raises ValueError for a value out of range."""
    p = RateAndState(
        positive("k", k),
        positive("F_0", F_0),
        positive("a", a),
        not_negative("b", b),
        positive("D_c", D_c),
        positive("v_0", v_0),
        positive("theta_0", theta_0),
    )
    if p.b >= p.k * p.D_c:
        raise ValueError(f"b must be less than k D_c = {p.k * p.D_c:g}, or the spring does not hold it, got {p.b:g}")
    return p


@kernel
def torque(p, torque_scale, memory, w):
    return p.k * memory[0]


@kernel
def rate(p, torque_scale, memory, w, out):
    theta = max(memory[1], 1e-300)  # an age below zero may be tried, never kept
    strength = (p.F_0 + p.b * math.log(p.v_0 * theta / p.D_c)) / p.a
    load = p.k * memory[0] / (torque_scale * p.a)
    # 2 v_0 exp(-strength) sinh(load)
    u = p.v_0 * (math.exp(min(load - strength, FASTEST)) - math.exp(min(-load - strength, FASTEST)))
    out[0] = w - u
    out[1] = 1.0 - abs(u) * memory[1] / p.D_c


@kernel
def rest(p, memory):
    memory[1] = p.theta_0


@kernel
def stored_energy(p, memory):
    return 0.5 * p.k * memory[0] ** 2


def steepest_fall(p: RateAndState, torque_scale: float, h: float) -> float:
    """A faster motion by dw has an age that is smaller by at most |u| t dw/D_c; the spring adds what it has slipped."""
    b = torque_scale * p.b
    return 0.5 * b * h / (p.D_c - b / p.k) if b < p.k * p.D_c else math.inf


friction.register(
    "rate_and_state",
    RateAndState,
    make=make,
    memory_size=lambda p: 2,
    parity=lambda p: ("odd", "even"),
    rest=rest,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    steepest_fall=steepest_fall,
    relaxes=True,
    fitted=("k", "F_0"),
    units={"k": "N m/rad", "F_0": "N m", "a": "N m", "b": "N m", "D_c": "rad", "v_0": "rad/s", "theta_0": "s"},
)
