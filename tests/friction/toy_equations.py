"""Laws from outside the package that give their equation only, and so are integrated.

* ``toy_lugre``: LuGre, whose closed form the package has.
* ``toy_jenkins_dahl``: a spring with a slider, whose rate jumps, beside an exponential spring.
* ``toy_jump``: a spring whose rate jumps to another one, a trap for what takes a law as steady.
* ``toy_wheel``: a memory that turns for ever, which no law of friction does.
* ``toy_thermal``: a bristle whose sliding torque falls with a temperature, which motion raises and rest lowers.
"""

from typing import NamedTuple

from steer_env.friction.bristle import limit_deflection
from steer_env.friction.law import register
from steer_env.friction.models import lugre
from steer_env.friction.numerics.kernel import kernel


class EquationLuGre(NamedTuple):
    sigma_0: float  # [N m/rad]
    sigma_1: float  # [N m s/rad]
    sigma_2: float  # [N m s/rad]
    F_c: float  # [N m]
    F_s: float  # [N m]
    v_s: float  # [rad/s]


class JenkinsDahl(NamedTuple):
    k: float  # stiffness [N m/rad]
    F_c: float  # sliding torque [N m]
    k_d: float  # stiffness of the exponential spring [N m/rad]
    F_d: float  # its saturated torque [N m]


class Jump(NamedTuple):
    y: float  # where the rate jumps [rad]
    share: float  # to which it jumps [1]


class Wheel(NamedTuple):
    turns: float  # radian per radian of motion [1]


class Thermal(NamedTuple):
    k: float  # stiffness [N m/rad]
    F_c: float  # sliding torque at the temperature of rest [N m]
    softening: float  # of the sliding torque with the temperature [1/K]
    heating: float  # by motion [K/rad]
    tau: float  # time in which the temperature falls [s]
    T_0: float  # temperature at rest [K]


def make_lugre(
    *,
    sigma_0: float = 100.0,
    sigma_1: float = 2.0,
    sigma_2: float = 0.0,
    F_c: float = 0.9,
    F_s: float = 0.9,
    v_s: float = 0.1,
) -> EquationLuGre:
    """Not checked."""
    return EquationLuGre(sigma_0, sigma_1, sigma_2, F_c, F_s, v_s)


def make_jenkins_dahl(*, k: float = 100.0, F_c: float = 0.9, k_d: float = 5.0, F_d: float = 0.2) -> JenkinsDahl:
    """Not checked."""
    return JenkinsDahl(k, F_c, k_d, F_d)


def make_jump(*, y: float = 0.01, share: float = 100.0) -> Jump:
    """Not checked."""
    return Jump(y, share)


def make_wheel(*, turns: float = 1e9) -> Wheel:
    """Not checked."""
    return Wheel(turns)


def make_thermal(
    *,
    k: float = 100.0,
    F_c: float = 0.9,
    softening: float = 0.01,
    heating: float = 100.0,
    tau: float = 0.02,
    T_0: float = 293.0,
) -> Thermal:
    """Not checked."""
    return Thermal(k, F_c, softening, heating, tau, T_0)


@kernel
def torque(p, torque_scale, memory, w):
    return p.k * memory[0] + p.k_d * memory[1]


@kernel
def rate(p, torque_scale, memory, w, out):
    if w * memory[0] < abs(w) * torque_scale * p.F_c / p.k:
        out[0] = w
    out[1] = w - abs(w) * p.k_d * memory[1] / (torque_scale * p.F_d)


@kernel
def cut_back(p, torque_scale, memory):
    memory[0] = limit_deflection(memory[0], torque_scale * p.F_c / p.k)
    memory[1] = limit_deflection(memory[1], torque_scale * p.F_d / p.k_d)


@kernel
def cut_bristle(p, torque_scale, memory):
    memory[0] = limit_deflection(memory[0], torque_scale * p.F_s / p.sigma_0)


@kernel
def stored_energy(p, memory):
    return 0.5 * p.k * memory[0] ** 2 + 0.5 * p.k_d * memory[1] ** 2


@kernel
def jump_torque(p, torque_scale, memory, w):
    return memory[0]


@kernel
def jump_rate(p, torque_scale, memory, w, out):
    out[0] = w if w * memory[0] < abs(w) * p.y else p.share * w


@kernel
def jump_energy(p, memory):
    return 0.5 * memory[0] ** 2


@kernel
def wheel_torque(p, torque_scale, memory, w):
    return memory[0]


@kernel
def wheel_rate(p, torque_scale, memory, w, out):
    out[0] = w - p.turns * abs(w) * memory[1]
    out[1] = p.turns * abs(w) * memory[0]


@kernel
def wheel_energy(p, memory):
    return 0.5 * (memory[0] ** 2 + memory[1] ** 2)


@kernel
def thermal_torque(p, torque_scale, memory, w):
    return p.k * memory[0]


@kernel
def thermal_yield(p, torque_scale, memory):
    return torque_scale * p.F_c / p.k / (1.0 + p.softening * max(memory[1] - p.T_0, 0.0))


@kernel
def thermal_rate(p, torque_scale, memory, w, out):
    out[0] = w - abs(w) * memory[0] / thermal_yield(p, torque_scale, memory)
    out[1] = p.heating * abs(w) - (memory[1] - p.T_0) / p.tau


@kernel
def thermal_energy(p, memory):
    return 0.5 * p.k * memory[0] ** 2


@kernel
def stiffened_torque(p, torque_scale, memory, w):
    return p.k * memory[0] * memory[1] / p.T_0


@kernel
def stiffened_energy(p, memory):
    return 0.5 * p.k * memory[0] ** 2 * memory[1] / p.T_0


@kernel
def thermal_cut(p, torque_scale, memory):
    memory[0] = limit_deflection(memory[0], torque_scale * p.F_c / p.k)


@kernel
def thermal_rest(p, memory):
    memory[1] = p.T_0


def thermal_fall(p, torque_scale, h):
    """Of the yield by the heat, and of a bristle that a fall of the torque scale has left at the yield of rest."""
    hot = p.softening * p.heating * p.tau * 32.0  # at the largest speed of the checks, 10^1.5 rad/s
    return torque_scale * p.F_c * p.softening * p.heating * min(h, p.tau) + 0.5 * p.k * h * hot


THERMAL = {
    "make": make_thermal,
    "memory_size": lambda p: 2,
    "parity": lambda p: ("odd", "even"),
    "rest": thermal_rest,
    "torque": thermal_torque,
    "rate": thermal_rate,
    "stored_energy": thermal_energy,
    "cut_back": thermal_cut,
    "steepest_fall": thermal_fall,
}

register("toy_thermal", Thermal, **THERMAL)
register(
    "toy_lugre",
    EquationLuGre,
    make=make_lugre,
    memory_size=lambda p: 1,
    torque=lugre.torque,
    rate=lugre.rate,
    stored_energy=lugre.stored_energy,
    cut_back=cut_bristle,
    steepest_fall=lugre.steepest_fall,
)
register(
    "toy_jenkins_dahl",
    JenkinsDahl,
    make=make_jenkins_dahl,
    memory_size=lambda p: 2,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    cut_back=cut_back,
)
register(
    "toy_jump",
    Jump,
    make=make_jump,
    memory_size=lambda p: 1,
    torque=jump_torque,
    rate=jump_rate,
    stored_energy=jump_energy,
)
register(
    "toy_wheel",
    Wheel,
    make=make_wheel,
    memory_size=lambda p: 2,
    torque=wheel_torque,
    rate=wheel_rate,
    stored_energy=wheel_energy,
)
