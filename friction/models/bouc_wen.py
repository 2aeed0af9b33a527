"""Bouc-Wen friction: an exponential spring whose way into saturation and stiffness after a reversal can be chosen.

    T = sigma_0 z                                                                              (F16)
    dz/dt = v (1 - |zeta|^n) where v and z have one sign                                       (F16)
    dz/dt = v (1 + (2 beta - 1) |zeta|^n) otherwise,    zeta = sigma_0 z/(L F_c)               (F16)

These are the usual equations, dz/dt = A v - beta' |v| |z|^(n-1) z - gamma' v |z|^n, with the scale of z chosen so that
A = 1 and the saturated torque is F_c; beta = beta'/(beta' + gamma'). With n = 1 and beta = 1 the law is Dahl's. With
beta = 1/2 a reversal is elastic. A large n makes a corner of the way into saturation.

The law is passive with the energy sigma_0 z^2/2 of its spring for beta >= 1/2 (-beta' <= gamma' <= beta'), because the
power that is lost is T v |zeta|^n towards saturation and (2 beta - 1) |T v| |zeta|^n away from it. For a general n the
equation has no closed form in elementary functions, so that :mod:`steer_env.friction.ode` integrates it, for n = 1 and
n = 2 too. L is ``torque_scale``.

Source: Bouc, 4th Conf. on Nonlinear Oscillation, Prague 1967; Wen, J. Engineering Mechanics Division ASCE 102 (1976)
249-263; the condition: Erlicher, Point, Comptes Rendus Mécanique 332 (2004) 51-57. Deviation: a memory beyond
saturation is cut back to it. The numbers of the equations are those of docs/model.md.
"""

from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.bristle import limit_deflection
from steer_env.friction.law import register
from steer_env.friction.numerics.check import number, positive
from steer_env.friction.numerics.kernel import kernel


class BoucWen(NamedTuple):
    """Parameters, which ``friction.make("bouc_wen", ...)`` checks and this class does not."""

    sigma_0: float  # stiffness at zero torque [N m/rad]
    F_c: float  # saturated torque [N m]
    n: float  # exponent of the way into saturation [1]
    beta: float  # half the stiffness after a reversal from saturation, over sigma_0 [1]


def make(*, sigma_0: float = defaults.SIGMA_0, F_c: float = defaults.F_C, n: float = 2.0, beta: float = 0.5) -> BoucWen:
    """Checked Bouc-Wen parameters; the default shape is assumed, and elastic after a reversal.

    Raises
    ------
    ValueError
        For a value out of range: ``n`` below 1, where the equation has several solutions, or ``beta`` below 1/2, where
        the law creates more energy than its spring holds.
    """
    return BoucWen(
        positive("sigma_0", sigma_0),
        positive("F_c", F_c),
        number("n", n, minimum=1.0),
        number("beta", beta, minimum=0.5),
    )


@kernel
def torque(p, torque_scale, memory, w):
    return p.sigma_0 * memory[0]  # (F16)


@kernel
def rate(p, torque_scale, memory, w, out):
    z_c = torque_scale * p.F_c / p.sigma_0
    z = limit_deflection(memory[0], z_c)  # a trial beyond saturation, which the power would make enormous, stays there
    zeta = abs(z) / z_c
    level = zeta * zeta if p.n == 2.0 else zeta**p.n  # a power takes longer than all the rest
    out[0] = w * (1.0 - level if w * z > 0.0 else 1.0 + (2.0 * p.beta - 1.0) * level)  # (F16)


@kernel
def cut_back(p, torque_scale, memory):
    memory[0] = limit_deflection(memory[0], torque_scale * p.F_c / p.sigma_0)


@kernel
def stored_energy(p, memory):
    return 0.5 * p.sigma_0 * memory[0] ** 2


register(
    "bouc_wen",
    BoucWen,
    make=make,
    memory_size=lambda p: 1,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    cut_back=cut_back,
    fitted=("sigma_0", "F_c"),
    units={"sigma_0": "N m/rad", "F_c": "N m", "n": "1", "beta": "1"},
)
