"""Two friction laws of one's own: one with closed forms, one that gives its differential equation only.

Put such a file where Python finds it, import it before an environment is made (the command line: ``--import
own_friction_laws``), and use the laws by name. ``python -c "import own_friction_laws as laws; laws.main()"`` checks
both; run as a script the file cannot be imported by the other process in which a check runs.
"""

import math
from typing import NamedTuple

from steer_env import friction
from steer_env.friction.numerics.check import number, positive
from steer_env.friction.numerics.kernel import kernel

# A spring with a slider: T = k e, e' = v, but 0 where |e| = L F_c/k and v drives it on. Exact at constant speed.


class SpringSlider(NamedTuple):
    """Parameters: what the kernels read."""

    k: float  # stiffness [N m/rad]
    F_c: float  # sliding torque [N m]


def make_spring_slider(*, k: float = 100.0, F_c: float = 0.9) -> SpringSlider:
    """Checked parameters; raises ValueError for a value out of range."""
    return SpringSlider(positive("k", k), positive("F_c", F_c))


@kernel
def slider_advance(p, torque_scale, memory, w, h):
    y = torque_scale * p.F_c / p.k
    e = min(max(memory[0], -y), y)  # the torque scale may have fallen since the last step
    memory[0] = min(max(e + w * h, -y), y)


@kernel
def slider_torque(p, torque_scale, memory, w):
    F = torque_scale * p.F_c
    return min(max(p.k * memory[0], -F), F)


@kernel
def slider_rate(p, torque_scale, memory, w, out):
    out[0] = w if w * memory[0] < abs(w) * torque_scale * p.F_c / p.k else 0.0


@kernel
def slider_energy(p, memory):
    return 0.5 * p.k * memory[0] ** 2


@kernel
def slider_mean_torque(p, torque_scale, memory, w, h):
    side = math.copysign(1.0, w)
    F = torque_scale * p.F_c
    start = min(max(side * p.k * memory[0], -F), F)
    gap = F - start
    load = p.k * abs(w) * h  # that the spring alone would gain
    if load < gap:
        return side * (start + 0.5 * load), 0.5 * p.k * h
    share = gap / load if load > 0.0 else 0.0  # of the step, before it slides
    return side * (F - 0.5 * gap * share), 0.5 * share**2 * p.k * h


friction.register(
    "spring_slider",
    SpringSlider,
    make=make_spring_slider,
    memory_size=lambda p: 1,
    advance=slider_advance,
    torque=slider_torque,
    rate=slider_rate,
    stored_energy=slider_energy,
    mean_torque=slider_mean_torque,
    fitted=("k", "F_c"),
    units={"k": "N m/rad", "F_c": "N m"},
)

# Dahl's law with its exponent: T = sigma_0 z, z' = v (1 - zeta sgn v)^i, zeta = sigma_0 z/(L F_c). The equation alone.


class DahlExponent(NamedTuple):
    """Parameters: what the kernels read."""

    sigma_0: float  # stiffness at zero torque [N m/rad]
    F_c: float  # saturated torque [N m]
    i: float  # exponent [1]


def make_dahl_exponent(*, sigma_0: float = 100.0, F_c: float = 0.9, i: float = 1.5) -> DahlExponent:
    """Checked parameters; raises ValueError for a value out of range."""
    return DahlExponent(positive("sigma_0", sigma_0), positive("F_c", F_c), number("i", i, minimum=1.0))


@kernel
def dahl_torque(p, torque_scale, memory, w):
    return p.sigma_0 * memory[0]


@kernel
def dahl_rate(p, torque_scale, memory, w, out):
    zeta = p.sigma_0 * memory[0] / (torque_scale * p.F_c)
    out[0] = w * max(1.0 - math.copysign(zeta, zeta * w), 0.0) ** p.i


@kernel
def dahl_energy(p, memory):
    return 0.5 * p.sigma_0 * memory[0] ** 2


@kernel
def dahl_cut_back(p, torque_scale, memory):
    z_c = torque_scale * p.F_c / p.sigma_0
    memory[0] = min(max(memory[0], -z_c), z_c)


friction.register(
    "dahl_exponent",
    DahlExponent,
    make=make_dahl_exponent,
    memory_size=lambda p: 1,
    torque=dahl_torque,
    rate=dahl_rate,
    stored_energy=dahl_energy,
    cut_back=dahl_cut_back,
    fitted=("sigma_0", "F_c"),
    units={"sigma_0": "N m/rad", "F_c": "N m", "i": "1"},
)


def main() -> None:
    """Check both laws; an AssertionError names what a law does not keep."""
    from steer_env.testing import check_friction_law  # needs hypothesis

    for name in ("spring_slider", "dahl_exponent"):
        check_friction_law(name)
        print(f"{name} keeps every contract")


if __name__ == "__main__":
    raise SystemExit('python -c "import own_friction_laws; own_friction_laws.main()"')
