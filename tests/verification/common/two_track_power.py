"""Power balance of the two-track chassis at states of a run.

    rack + engine + brakes + tyres + dampers + air = change of the kinetic and of the stored energy + rest

The rack force contains the work of the tyre forces as the steered wheels move over the road, and the slip speeds do not
(section 11 of docs/model.md, "left out"). :func:`steering_work` is that part of the rest. Source: (B1) to (B12) and
(S7), derived here.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.vehicle.chassis.two_track.layout import (
    COMPLIANCE,
    F_X,
    F_Y,
    FORCE_Y,
    LOAD,
    M_Z,
    MOMENT_X,
    OMEGA,
    PEDAL,
    PITCH,
    ROAD_TORQUE,
    ROLL,
    STEER_LEFT,
    STEER_RIGHT,
    TRAVEL,
    TRAVEL_RATE,
    P,
    U,
    Z,
)
from steer_env.vehicle.chassis.two_track.suspension import STOP_SOFTNESS
from steer_env.vehicle.suspension import kinematics_table

Array = NDArray[np.float64]

SIDE = np.array([1.0, -1.0, 1.0, -1.0])  # left, right


def _turned(x: Array) -> Array:
    """Matrices (N, 3, 3) from the body frame to the road frame."""
    (c_r, c_p), (s_r, s_p) = np.cos(x[:, [ROLL, PITCH]].T), np.sin(x[:, [ROLL, PITCH]].T)
    zero = np.zeros(len(x))
    rows = [[c_p, s_p * s_r, s_p * c_r], [zero, c_r, -s_r], [-s_p, c_p * s_r, c_p * c_r]]
    return np.moveaxis(np.array(rows), 2, 0)


def _places(d: Any, x: Array) -> tuple[Array, Array]:
    """Wheel centres from O in the body frame (N, 4, 3) [m], and unsprung masses (4,) [kg]."""
    arm, half = np.array([d.a, d.a, -d.b, -d.b]), 0.5 * SIDE * [d.t_f, d.t_f, d.t_r, d.t_r]
    z = d.R_l - d.h + x[:, TRAVEL : TRAVEL + 4]
    return np.stack([*np.broadcast_arrays(arm, half, z)], -1), np.array([d.m_f, d.m_f, d.m_r, d.m_r])


def _knuckles(strut: Any, x: Array, tie_rods: Array) -> tuple[Array, Array]:
    """``Knuckle`` and ``Travel`` of both front wheels, as left wheels: (N, 2, 8), (N, 2, 6)."""
    places = [((q[0], s[0]), (-q[1], s[1])) for q, s in zip(tie_rods, x[:, TRAVEL : TRAVEL + 2])]
    return tuple(  # type: ignore[return-value]
        np.array([[read(strut, *place) for place in pair] for pair in places])
        for read in (kinematics_table.left_knuckle, kinematics_table.left_travel)
    )


def _all_four(front: Any, rear: Any, n: int) -> Array:
    return np.hstack([np.broadcast_to(front, (n, 2)), np.broadcast_to(rear, (n, 2))])


def energies(d: Any, strut: Any, x: Array, tie_rods: Array) -> dict[str, Array]:
    """Kinetic energy without the engine, and what weight, springs, bars, stops and tyres store (N,), level road [J].

    Parameters
    ----------
    d : Body
    strut : kinematics_table.KinematicsTable
    x : (N, S) array
        States.
    tie_rods : (N, 2) array
        Rack coordinate less the compliance travel of the left and of the right wheel [m].
    """
    v, w, s, s_rate = x[:, U : U + 3], x[:, P : P + 3], x[:, TRAVEL : TRAVEL + 4], x[:, TRAVEL_RATE : TRAVEL_RATE + 4]
    r, m = _places(d, x)
    knuckle, up = _knuckles(strut, x, tie_rods)
    I_xx, I_yy = d.I_x + (m * r[0, :, 1] ** 2).sum(), d.I_y + (m * r[0, :, 0] ** 2).sum()
    carried = v[:, 2:] + w[:, :1] * r[..., 1] - w[:, 1:2] * r[..., 0]
    # (B1)
    kinetic = d.m * (v**2).sum(1) + w**2 @ [I_xx, I_yy, d.I_z] - 2.0 * d.I_xz * w[:, 0] * w[:, 2]
    kinetic += (m * s_rate * (2.0 * carried + s_rate)).sum(1) + d.I_w * (x[:, OMEGA : OMEGA + 4] ** 2).sum(1)
    length = np.hstack([up[..., 4], s[:, 2:]])
    beyond = np.maximum(np.abs(s) - [d.clearance_f, d.clearance_f, d.clearance_r, d.clearance_r], 0.0)
    stop = 0.5 * beyond**2 - STOP_SOFTNESS * beyond + STOP_SOFTNESS**2 * np.log1p(beyond / STOP_SOFTNESS)
    height = x[:, Z, None] + (r @ _turned(x)[:, 2, :, None])[..., 0]
    camber = SIDE * np.hstack([knuckle[..., 1], d.camber_r * s[:, 2:]]) + x[:, ROLL, None]
    pressed = np.array([d.F_zf, d.F_zf, d.F_zr, d.F_zr]) + d.K_t * (d.R_l - height * (1.0 + 0.5 * camber**2))
    return {
        "kinetic energy": 0.5 * kinetic,
        "weight": -d.g_z * (d.m * x[:, Z] + s @ m),
        "springs": length @ [d.S_f, d.S_f, d.S_r, d.S_r] + 0.5 * length**2 @ [d.K_f, d.K_f, d.K_r, d.K_r],
        "anti-roll bars": 0.5 * (d.B_f * (s[:, 0] - s[:, 1]) ** 2 + d.B_r * (s[:, 2] - s[:, 3]) ** 2),
        "bump stops": d.K_stop * stop.sum(1),
        "tyre deflection": 0.5 / d.K_t * (np.maximum(pressed, 0.0) ** 2).sum(1),
    }


def at_tie_rods(d: Any, x: Array, dx: Array, rack: Array) -> tuple[Array, Array]:
    """Rack coordinate at the left and the right tie rod and its rate (N, 2, 2), and the force on each (N, 2) [N].

    ``rack`` (N, 2) holds the coordinate of the rack and its rate. The force is that of the spring with its lag (P6).
    """
    give, rate = x[:, COMPLIANCE : COMPLIANCE + 2], dx[:, COMPLIANCE : COMPLIANCE + 2]
    force = 0.5 * d.K_rack * (give + d.T_rack * rate) + d.F_toe * SIDE[:2]
    return rack[:, None, :] - np.stack([give, rate], -1), force


def powers(p: Any, strut: Any, x: Array, dx: Array, out: Array, rack: Array) -> dict[str, Array]:
    """Power that acts on body and wheels, but for that of the rack, on a level road without wind (N,) [W].

    Parameters
    ----------
    p : TwoTrack
    strut : kinematics_table.KinematicsTable
    x, dx, out : (N, S), (N, S), (N, O) arrays
        States, their derivatives and the outputs of ``derivative``.
    rack : (N, 2, 2) array
        Rack coordinate at the left and the right tie rod [m], and their rates [m/s].

    Returns
    -------
    dict
        Of the shafts of engine and differential, the brakes, the tyres by force and moment, the dampers and the air,
        and last ``steering of the contacts``, which the rack does and no slip speed shows.
    """
    d, turn, (r, _) = p.body[0], _turned(x), _places(p.body[0], x)
    n, s, s_rate, omega = (
        len(x),
        x[:, TRAVEL : TRAVEL + 4],
        x[:, TRAVEL_RATE : TRAVEL_RATE + 4],
        x[:, OMEGA : OMEGA + 4],
    )
    knuckle, up = _knuckles(strut, x, rack[..., 0])
    V, W = (np.moveaxis(turn @ x[:, i : i + 3, None], 1, 0) for i in (U, P))  # each component (N, 1)
    C = np.moveaxis(r @ np.swapaxes(turn, 1, 2), 2, 0)  # wheel centres in the road frame, (3, N, 4)
    height = x[:, Z, None] + C[2]
    F_x, F_y, F_z, Y, M_z = (out[:, i : i + 4] for i in (F_X, F_Y, LOAD, FORCE_Y, M_Z))
    road, roll_moment = out[:, ROAD_TORQUE : ROAD_TORQUE + 4], out[:, MOMENT_X : MOMENT_X + 4]
    camber = SIDE * np.hstack([knuckle[..., 1], d.camber_r * s[:, 2:]]) + x[:, ROLL, None]
    offset, camber_gain = height * camber, SIDE * _all_four(up[..., 2], d.camber_r, n)
    rear = SIDE[2:] * d.steer_r * s[:, 2:] + d.compliance_steer_r * F_y[:, 2:]
    steer = np.hstack([out[:, [STEER_LEFT, STEER_RIGHT]], rear])
    c, s_ = np.cos(steer), np.sin(steer)
    tilt = W[1] + _all_four(up[..., 3], 0.0, n) * s_rate
    # (B7)
    centre = (
        V[0] + W[1] * C[2] - W[2] * (C[1] + offset) + (turn[:, 0, 2, None] + _all_four(up[..., 0], 0.0, n)) * s_rate
    )
    across = V[1] + W[2] * C[0] - W[0] * (C[2] - height)
    across += (turn[:, 1, 2, None] + SIDE * _all_four(up[..., 1], d.contact_y_r, n)) * s_rate
    rolling = centre * c + across * s_
    slip_x, slip_y = rolling - d.R_e * omega, across * c - (centre - height * tilt) * s_
    M_x = (roll_moment - (C[1] + offset) * F_z + (C[2] - height) * Y) / c  # from (B8)
    capacity = out[:, PEDAL, None] * [p.brakes.front, p.brakes.front, p.brakes.rear, p.brakes.rear]
    brake = np.copysign(capacity, omega)
    shaft = d.I_w * dx[:, OMEGA : OMEGA + 4] - road + brake  # (B5)
    strut_rate = _all_four(up[..., 5], 1.0, n) * s_rate
    speed_2 = V[0][:, 0] ** 2
    heave = (d.lift_f + d.lift_r) * V[2][:, 0] + (d.b * d.lift_r - d.a * d.lift_f) * W[1][:, 0]
    k = np.moveaxis(knuckle, 2, 0)  # as ``Knuckle``: 3 F_x at the centre, 4 F_y, 6 M_x, 7 M_z
    held = SIDE[:2] * k[3] * F_x[:, :2] + k[4] * F_y[:, :2] + k[6] * M_x[:, :2] + k[7] * M_z[:, :2]
    return {
        "engine": (shaft * (omega - W[1])).sum(1),
        "brakes": -(brake * (omega - tilt)).sum(1),
        "longitudinal slip": (F_x * slip_x).sum(1),
        "lateral slip": (F_y * slip_y).sum(1),
        "rolling resistance": ((road + d.R_e * F_x) * omega).sum(1),
        "aligning torque": (M_z * W[2]).sum(1),
        "overturning moment": (M_x * (c * W[0] + s_ * W[1] + camber_gain * s_rate)).sum(1),
        "dampers": -(strut_rate**2) @ [d.C_f, d.C_f, d.C_r, d.C_r],
        "air": speed_2 * (heave - d.drag * np.abs(V[0][:, 0])),
        "steering of the contacts": (held * rack[..., 1]).sum(1),
    }
