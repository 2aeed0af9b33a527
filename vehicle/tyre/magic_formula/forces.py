"""Forces and moments at combined slip: the sequence of the steps, for four tyres and for one."""

import math

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.simd import any_of, atan, broadcast, first, where
from steer_env.vehicle.tyre.magic_formula.aligning import equivalent_slip, lever, pneumatic_trail, residual_torque
from steer_env.vehicle.tyre.magic_formula.lateral import combined_slip, lateral_force
from steer_env.vehicle.tyre.magic_formula.longitudinal import longitudinal_force
from steer_env.vehicle.tyre.magic_formula.moments import overturning, rolling_resistance
from steer_env.vehicle.tyre.magic_formula.point import direction, operating_point, turn_slip_factors


@kernel
def _steady(c, kappa, alpha, tan_a, camber, F_z, v_x, mu, stiffness, turn_slip):
    """:func:`forces` of four tyres, for slip angles given by themselves and by their tangents; one turn slip.

    None for ``kappa`` or the turn slip removes at compile time what zeros skip at run time: numba removes a branch
    whose condition asks for None first.
    """
    way = direction(v_x)
    p = operating_point(c, way, kappa, alpha, tan_a, camber, F_z, mu, stiffness)
    slips = kappa is not None and any_of(p.kappa != 0.0)
    spins = turn_slip is not None and turn_slip != 0.0 and c.TURN_SLIP != 0.0
    turn = turn_slip_factors(c, p, turn_slip, spins)

    longitudinal = longitudinal_force(c, p, turn.zeta_1, slips)
    lateral = lateral_force(c, p, turn, turn_slip, spins)
    G_y, S_Vk = combined_slip(c, p, lateral.D, kappa, slips)
    F_x, F_y = longitudinal.F_x, G_y * lateral.F_y + S_Vk  # (T5), (4.E58)

    slip = equivalent_slip(c, p, lateral, longitudinal.K_x, kappa, slips)
    t = pneumatic_trail(c, p, slip.a_t, slip.a_e, turn.zeta_5)
    M_zr = residual_torque(c, p, turn, lateral, G_y, slip.a_r2, turn_slip, spins)
    M_z = M_zr - t * (G_y * lateral.F_t)  # (T6), (4.E72), (4.E74)
    M_z += lever(c, p, F_y) * longitudinal.dF_x  # (T6), (4.E71)

    M_x = overturning(c, p, F_y)
    load, M_y = rolling_resistance(c, p, F_x, v_x)
    way = where(F_z < 1e-6, 0.0, way)
    R_0 = c.UNLOADED_RADIUS
    return way * F_x, way * F_y, way * R_0 * p.F_z * M_x, -way * R_0 * load * M_y, way * way * M_z


@kernel
def forces(c, kappa, alpha, camber, F_z, v_x, mu=1.0, turn_slip=0.0):
    """F_x, F_y [N], M_x, M_y, M_z [N m]: one evaluation of :meth:`tyre.Tyre.forces`, which describes the arguments.

    Unchecked, for any ``v_x`` and ``F_z >= 0``. At standstill the formula is not valid, and the caller must fade the
    result out.
    """
    F_x, F_y, M_x, M_y, M_z = _steady(
        c,
        broadcast(kappa),
        broadcast(alpha),
        broadcast(math.tan(alpha)),
        broadcast(camber),
        broadcast(F_z),
        broadcast(v_x),
        broadcast(mu),
        broadcast(1.0),
        turn_slip,
    )
    return first(F_x), first(F_y), first(M_x), first(M_y), first(M_z)


@kernel
def forces_of_four(c, kappa, tan_alpha, camber, F_z, v_x, mu, stiffness):
    """:func:`forces` of four tyres without turn slip, for the tangents of the slip angles, v_y/|v_x|.

    Relaxed slip angles have these tangents as states. ``stiffness`` multiplies the cornering stiffness [1]. ``kappa``
    None stands for 0 at all four tyres and compiles in half the time.
    """
    return _steady(c, kappa, atan(tan_alpha), tan_alpha, camber, F_z, v_x, mu, stiffness, None)
