"""A law in one file from outside the package: a single Jenkins element, a spring with a slider.

    T = k e,    de/dt = v unless |e| = y and v drives it on,    y = F_c/k

It brings ``mean_torque`` only, so the shared Newton iteration has to cope with its kink. Source: Jenkin, 1922.
"""

import math
from typing import NamedTuple

from steer_env.friction.law import register
from steer_env.friction.numerics.check import positive
from steer_env.friction.numerics.kernel import kernel


class Jenkins(NamedTuple):
    k: float  # stiffness [N m/rad]
    F_c: float  # sliding torque [N m]


def make(*, k: float = 100.0, F_c: float = 0.9) -> Jenkins:
    """Checked parameters; ValueError on a value out of range."""
    return Jenkins(positive("k", k), positive("F_c", F_c))


@kernel
def advance(p, torque_scale, memory, w, h):
    y = torque_scale * p.F_c / p.k
    e = min(max(memory[0], -y), y)
    memory[0] = min(max(e + w * h, -y), y)


@kernel
def torque(p, torque_scale, memory, w):
    F = torque_scale * p.F_c
    return min(max(p.k * memory[0], -F), F)


@kernel
def rate(p, torque_scale, memory, w, out):
    out[0] = w if w * memory[0] < abs(w) * torque_scale * p.F_c / p.k else 0.0


@kernel
def stored_energy(p, memory):
    return 0.5 * p.k * memory[0] ** 2


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    side = math.copysign(1.0, w)
    F = torque_scale * p.F_c
    start = min(max(side * p.k * memory[0], -F), F)
    gap = F - start
    D = p.k * abs(w) * h  # how far the spring alone would load
    if D < gap:
        return side * (start + 0.5 * D), 0.5 * p.k * h
    share = gap / D if D > 0.0 else 0.0  # of the step, before it slides
    return side * (F - 0.5 * gap * share), 0.5 * share**2 * p.k * h


register(
    "toy_jenkins",
    Jenkins,
    make=make,
    memory_size=lambda p: 1,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    mean_torque=mean_torque,
    units={"k": "N m/rad", "F_c": "N m"},
)
