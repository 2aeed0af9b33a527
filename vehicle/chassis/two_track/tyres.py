"""Forces of the four tyres on relaxed slips, the bore torque at low speed, and the rates of these states.

Each tyre relaxes along both slips (B13). Its bore torque about z is the torque of a friction law over the turning of
the contact patch; rolling relaxes the state of that law (B15). Parking, creeping and driving are therefore one model.
"""

from typing import NamedTuple

from steer_env.friction import law
from steer_env.friction.numerics.kernel import kernel, part
from steer_env.friction.numerics.simd import (
    any_of,
    copysign,
    fabs,
    load,
    maximum,
    minimum,
    pack,
    sqrt,
    store,
    unpack,
    where,
)
from steer_env.vehicle import tyre
from steer_env.vehicle.chassis.two_track.layout import BORE_ANGLE, KAPPA, TAN_ALPHA
from steer_env.vehicle.chassis.two_track.suspension import per_axle

ROLLING_BLEND = 1.0  # rolling speed from which pneumatic trail and rolling resistance act fully, assumed [m/s]
DAMPED_BELOW = 3.0  # rolling speed at which the structural damping of the tyres has faded, assumed [m/s]
LARGEST_SLIP = 2.0  # bound of the relaxed slips of a sliding tyre, assumed [1]
FASTEST_BORE_RATE = 400.0  # bound of the relaxation rate of the bore friction, for steps of 2 ms [1/s]
DECAY_BELOW = 2.0  # rolling speed below which such slip is lost, LARGEST_SLIP times ROLLING_BLEND [m/s]
SLIP_DECAY = 100.0  # rate at which a tyre that comes to rest loses slip that its force cannot hold, assumed [1/s]


class TyreForces(NamedTuple):
    """Forces and moments of the road on the tyres, in the axes of each wheel; each field is a vector of four wheels."""

    F_x: float  # [N]
    F_y: float  # [N]
    M_x: float  # [N m]
    M_y: float  # [N m]
    M_z: float  # with the bore torque [N m]


@kernel
def _fade(v, whole):
    """0 at standstill, 1 from ``whole`` on, odd and smooth in ``v``."""
    s = minimum(maximum(v * (1.0 / whole), -1.0), 1.0)
    return s * (1.5 - 0.5 * s * s)


@kernel
def _bore_torque(p, scale, memory, turning, rate):
    """Bore torque of one tyre; the rate of its memory by the turning alone goes to ``rate``."""
    law.rate(p, scale, memory, turning, rate)
    return law.torque(p, scale, memory, turning)


@part
def bore_torques(p, contact, turning, rolling, x, dx):
    """Bore torques of the tyres (B15); the rates of their memories go to ``dx``.

    Parameters
    ----------
    p : TwoTrack
    contact : Contact
    turning : vector of four
        Angular velocities of the contact patches about z [rad/s].
    rolling : vector of four
        Rolling speeds, without sign [m/s].
    x, dx : (S,) array
        States and their derivatives.
    """
    d, k = p.body[0], BORE_ANGLE
    relative = contact.F_z * (1.0 / d.bore_load)
    scale = maximum(contact.mu * relative * sqrt(relative), 1e-9)  # (B15)
    scale_fl, scale_fr, scale_rl, scale_rr = unpack(scale)
    turning_fl, turning_fr, turning_rl, turning_rr = unpack(turning)
    torque = pack(
        _bore_torque(p.bore_friction, scale_fl, x[k : k + 1], turning_fl, dx[k : k + 1]),
        _bore_torque(p.bore_friction, scale_fr, x[k + 1 : k + 2], turning_fr, dx[k + 1 : k + 2]),
        _bore_torque(p.bore_friction, scale_rl, x[k + 2 : k + 3], turning_rl, dx[k + 2 : k + 3]),
        _bore_torque(p.bore_friction, scale_rr, x[k + 3 : k + 4], turning_rr, dx[k + 3 : k + 4]),
    )
    # Fast rolling, and fast turning under a small load, relax the state faster than the step can follow.
    relaxation = rolling * (1.0 / d.sigma_z)
    fastest = relaxation + fabs(turning) * (p.bore_friction.sigma_0 / p.bore_friction.F_c) / scale
    limited = minimum(FASTEST_BORE_RATE / (fastest + 1e-9), 1.0)
    store(dx, k, (load(dx, k) - relaxation * load(x, k)) * limited)  # (B15)
    return torque


@part
def tyre_forces(p, c, carriers, contact, slip, x, dx):
    """Forces of the tyres at the relaxed slips. The structure of the tyre damps them at standstill, where rolling
    does not (B14).

    Parameters
    ----------
    p : TwoTrack
    c : tyre.MagicFormula
    carriers : Carriers
    contact : Contact
    slip : Slip
    x, dx : (S,) array
        States and their derivatives.
    """
    d = p.body[0]
    kappa, tan_a = load(x, KAPPA), load(x, TAN_ALPHA)
    rolling = fabs(slip.rolling)
    slow = 1.0 - minimum(rolling * (1.0 / DAMPED_BELOW), 1.0)
    slow *= slow
    F_x, F_y, M_x, M_y, M_z = tyre.forces_of_four(
        c,
        kappa - d.d_x * slow * slip.x,  # (B14)
        tan_a + d.d_y * slow * slip.y,  # (B14)
        carriers.camber,
        contact.F_z,
        rolling,
        contact.mu,
        per_axle(d.stiffness_f, d.stiffness_r),
    )
    whole = _fade(slip.rolling, ROLLING_BLEND)
    bore = bore_torques(p, contact, carriers.yaw_rate, rolling, x, dx)
    return TyreForces(F_x, F_y, M_x, M_y * whole, M_z * whole - bore)  # (B15)


@kernel
def _bounded_rate(rate, slip):
    """The rate of a slip, zero where it would increase a slip beyond its bound."""
    return where((fabs(slip) > LARGEST_SLIP) & (rate * slip > 0.0), 0.0, rate)


@kernel
def _slip_decay(slip, force, stiffness, rolling):
    """Rate at which a tyre that comes to rest sliding loses the slip that exceeds the deflection by its force (B17)."""
    beyond = fabs(slip) - maximum(2.0 * fabs(force) / (stiffness + 1.0), rolling / ROLLING_BLEND)
    rate = copysign(SLIP_DECAY * maximum(beyond, 0.0), -slip)  # (B17)
    # From DECAY_BELOW on, rolling/ROLLING_BLEND is at least LARGEST_SLIP, the bound of the slips: no slip is beyond it.
    return where(rolling < DECAY_BELOW, rate, 0.0)


@part
def slip_rates(d, c, forces, F_z, slip, x, dx):
    """Rates of the relaxed slips (B13), (B17) to ``dx``."""
    kappa, tan_a = load(x, KAPPA), load(x, TAN_ALPHA)
    rolling = fabs(slip.rolling)
    kappa_rate = _bounded_rate((-slip.x - rolling * kappa) * (1.0 / d.sigma_x), kappa)  # (B13)
    alpha_rate = _bounded_rate((slip.y - rolling * tan_a) * (1.0 / d.sigma_y), tan_a)  # (B13)
    if any_of(rolling < DECAY_BELOW):
        K_x, K_y = tyre.stiffnesses(c, F_z)
        kappa_rate += _slip_decay(kappa, forces.F_x, K_x, rolling)
        K_y *= per_axle(d.stiffness_f, d.stiffness_r)
        alpha_rate += _slip_decay(tan_a, forces.F_y, K_y, rolling)
    store(dx, KAPPA, kappa_rate)
    store(dx, TAN_ALPHA, alpha_rate)
