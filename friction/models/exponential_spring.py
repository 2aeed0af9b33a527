"""Exponential spring with a Maxwell branch, the friction of steering models after Pfeffer.

    T = sigma_0 z + k_m e                                                                       (F19)
    dz/dt = v - sigma_0 |v| z/(L F_c),    de/dt = v - e/(L tau_m)                               (F19)
    mean T over a step = that of Dahl (F8) + k_m (e p1 + h w p2),   X = h/(L tau_m)             (F20)

z is the exponential spring, which is Dahl's bristle. The Maxwell branch, a spring k_m in series with a damper
k_m L tau_m, stiffens fast motion and relaxes at rest; in sliding it is a viscous friction k_m L tau_m. L is
``torque_scale``: it lengthens the relaxation as it does the pre-sliding distance, so that the whole torque is in
proportion to L at equal speeds. p1(X) and p2(X) are those of :mod:`steer_env.friction.bristle`. Without the branch
(k_m = 0) the law is Dahl's, to the bit.

Source: Pfeffer, Harrer, Johnston, Vehicle System Dynamics 46 (2008) 413-428, for the exponential spring with a Maxwell
branch in steering models, after their description by others; the numbers and the scaling of the branch are assumed. The
numbers of the equations are those of docs/model.md.
"""

from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.bristle import decay, limit_deflection, slide, spring
from steer_env.friction.law import register
from steer_env.friction.numerics.check import not_negative, positive
from steer_env.friction.numerics.kernel import kernel


class ExponentialSpring(NamedTuple):
    """Parameters, which ``friction.make("exponential_spring", ...)`` checks and this class does not."""

    sigma_0: float  # stiffness of the exponential spring at zero torque [N m/rad]
    F_c: float  # saturated torque of the exponential spring [N m]
    k_m: float  # stiffness of the Maxwell branch [N m/rad]
    tau_m: float  # relaxation time of the Maxwell branch [s]


def make(
    *, sigma_0: float = defaults.SIGMA_0, F_c: float = defaults.F_C, k_m: float = 20.0, tau_m: float = 0.01
) -> ExponentialSpring:
    """Checked parameters; the Maxwell branch is assumed: a fifth of the stiffness, above 16 Hz.

    Raises
    ------
    ValueError
        For a value out of range.
    """
    return ExponentialSpring(
        positive("sigma_0", sigma_0), positive("F_c", F_c), not_negative("k_m", k_m), positive("tau_m", tau_m)
    )


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    F, slope = spring(p.sigma_0, torque_scale * p.F_c, memory[0], w, h)
    _, p1, p2, _, _ = decay(h / (torque_scale * p.tau_m))
    return F + p.k_m * (memory[1] * p1 + h * w * p2), slope + p.k_m * h * p2  # (F20)


@kernel
def advance(p, torque_scale, memory, w, h):
    z_g = torque_scale * p.F_c / p.sigma_0
    memory[0] = slide(memory[0], z_g, z_g, w, h)
    E, p1, _, _, _ = decay(h / (torque_scale * p.tau_m))
    memory[1] = memory[1] * E + h * w * p1  # (F20)


@kernel
def torque(p, torque_scale, memory, w):
    return p.sigma_0 * limit_deflection(memory[0], torque_scale * p.F_c / p.sigma_0) + p.k_m * memory[1]  # (F19)


@kernel
def rate(p, torque_scale, memory, w, out):
    out[0] = w - p.sigma_0 * abs(w) * memory[0] / (torque_scale * p.F_c)  # (F19)
    out[1] = w - memory[1] / (torque_scale * p.tau_m)  # (F19)


@kernel
def stored_energy(p, memory):
    return 0.5 * p.sigma_0 * memory[0] ** 2 + 0.5 * p.k_m * memory[1] ** 2


register(
    "exponential_spring",
    ExponentialSpring,
    make=make,
    memory_size=lambda p: 2,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    mean_torque=mean_torque,
    relaxes=True,
    wide=True,
    continuous=True,
    fitted=("sigma_0", "F_c"),
    units={"sigma_0": "N m/rad", "F_c": "N m", "k_m": "N m/rad", "tau_m": "s"},
)
