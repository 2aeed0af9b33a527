"""The two-track chassis against a second derivation, closed forms, scipy, and the expected behaviour of a car."""

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import DOP853

from steer_env.vehicle import cars, plant, road, tyre
from steer_env.vehicle.chassis import two_track
from steer_env.vehicle.chassis.common.interface import (
    BRAKE,
    COAST,
    HAND_BRAKE,
    INPUTS,
    THROTTLE,
    WIND_FORCE,
    WIND_MOMENT,
)
from steer_env.vehicle.chassis.two_track import (
    BORE_ANGLE,
    KAPPA,
    OMEGA,
    OUTPUTS,
    PITCH,
    ROLL,
    STATES,
    TAN_ALPHA,
    TRAVEL,
    TRAVEL_RATE,
    WHEELS,
    YAW,
    W,
    Z,
)
from steer_env.vehicle.constants import GRAVITY as G
from steer_env.vehicle.plant import HAND, HAND_SPEED
from steer_env.vehicle.suspension.macpherson import load_coefficients, mirrored
from tests.by_law import EACH_LAW
from tests.vehicle.test_plant import reference, weave

CAR = cars.load()
C = CAR.chassis
TYRE = CAR.tyre.symmetric()
TYRE = replace(TYRE, coefficients=TYRE.coefficients._replace(PHX1=0.0, PHX2=0.0))  # as the plant takes it


def stiffer(factor):
    """The tyre with the factor of an axle in its coefficients, as LKY of a property file."""
    c = TYRE.coefficients
    names = ("PKY1", "QBZ1", "QBZ2", "QBZ3", "QBZ9")
    return replace(TYRE, coefficients=c._replace(**{name: factor * getattr(c, name) for name in names}))


TYRES = [stiffer(C[f"{axle}_cornering_stiffness_factor"]) for axle in ("front", "rear")]
KPH, T = 1.0 / 3.6, 1e-3
PLANT = CAR.plant(chassis="two_track")
CHANNEL = {name: i for i, (name, _) in enumerate(plant.channels(PLANT))}
NAMES = [name for name, _ in plant.state_names(PLANT)]
CHASSIS = slice(NAMES.index("body_speed_x"), NAMES.index("body_speed_x") + len(STATES))
OUT = {name: i for i, (name, _) in enumerate(OUTPUTS)}
D = PLANT.chassis.body[0]
L = D.a + D.b
M = np.array([D.m_f, D.m_f, D.m_r, D.m_r])
AT = np.array([[D.a, D.a, -D.b, -D.b], 0.5 * np.array([D.t_f, -D.t_f, D.t_r, -D.t_r]), np.full(4, D.R_l - D.h)]).T
E_X, E_Y, E_Z = np.eye(3)


def make(speed=100.0 * KPH, law="lugre", robot=True, **rest):
    return CAR.plant(law, speed=speed, robot=robot, chassis="two_track", **rest)


def straight(p):
    """States of straight running in balance."""
    x = np.zeros(len(STATES))
    two_track.begin(p.chassis, p.strut, p.tyre[0], x)
    return x


def changed(p, **values):
    """The plant with changed numbers of the body."""
    body = p.chassis.body.copy()
    for name, value in values.items():
        body[name] = value
    return p._replace(chassis=p.chassis._replace(body=body))


def inputs(n, **values):
    u = np.zeros((n, len(INPUTS)))
    for i, (name, _) in enumerate(INPUTS):
        if name in values:
            u[:, i] = values[name]
    return u


def run(p, u, state=None, last=False, substeps=1):
    """Record and final state; everything is finite."""
    state = plant.initial_state(p) if state is None else state
    record = np.zeros((1 if last else len(u), len(CHANNEL)))
    assert plant.run(p, state, u, record, substeps)
    return record, state


def at(record, name):
    return record[..., CHANNEL[name]]


def each(values, name):
    """A quantity of the four wheels, from outputs or from a record."""
    places = OUT if values.shape[-1] == len(OUT) else CHANNEL
    return np.stack([values[..., places[f"{name}_{wheel}"]] for wheel in WHEELS], -1)


def code(p, x, rack=0.0, rack_rate=0.0, u=None):
    """Derivative, outputs and rack force of the module under test."""
    dx, out = np.zeros(len(STATES)), np.zeros(len(OUTPUTS))
    u = np.zeros(len(INPUTS)) if u is None else u
    force = two_track.derivative(p.chassis, p.strut, p.tyre[0], np.asarray(x, float), rack, rack_rate, u, dx, out)
    return dx, out, force


def ramp(angle, n, seconds=1.0):
    """Robot inputs: a smooth ramp to a handwheel angle, which then holds."""
    u, t = np.zeros((n, len(INPUTS))), np.minimum(np.arange(1, n + 1) * T / seconds, 1.0)
    u[:, HAND] = angle * (t - np.sin(2.0 * math.pi * t) / (2.0 * math.pi))
    u[:, HAND_SPEED] = angle * (1.0 - np.cos(2.0 * math.pi * t)) / seconds
    return u


# Mechanics ----------------------------------------------------------------------------------------------------------


def random_state(rng, v=25.0, size=1.0):
    """A state near straight running in the design position, with every entry disturbed."""
    x = straight(make(v))
    x[W] = x[PITCH] = 0.0
    x[TRAVEL:TRAVEL_RATE], x[Z] = 0.0, D.h
    x[:6] += size * rng.uniform(-1.0, 1.0, 6) * [2.0, 1.0, 0.3, 0.3, 0.3, 0.3]
    x[ROLL:TRAVEL] += size * rng.uniform(-1.0, 1.0, 6) * [0.01, 0.01, 2.0, 5.0, 5.0, 0.005]
    x[TRAVEL:TRAVEL_RATE] += size * rng.uniform(-0.012, 0.012, 4)
    x[TRAVEL_RATE:OMEGA] += size * rng.uniform(-0.5, 0.5, 4)
    x[OMEGA:KAPPA] *= 1.0 + size * rng.uniform(-0.05, 0.05, 4)
    x[KAPPA:BORE_ANGLE] = size * rng.uniform(-0.08, 0.08, 8)
    return x


def axes(x):
    """Body to road frame: pitch after roll."""
    (c_r, c_p), (s_r, s_p) = np.cos(x[[ROLL, PITCH]]), np.sin(x[[ROLL, PITCH]])
    return np.array([[c_p, 0.0, s_p], [0.0, 1.0, 0.0], [-s_p, 0.0, c_p]]) @ [
        [1.0, 0.0, 0.0],
        [0.0, c_r, -s_r],
        [0.0, s_r, c_r],
    ]


def heading(steer):
    """Unit vectors ahead and to the left of a wheel."""
    return math.cos(steer) * E_X + math.sin(steer) * E_Y, math.cos(steer) * E_Y - math.sin(steer) * E_X


def front_poses(x, rack):
    """The exact poses of both front wheels, each at the rack less its own compliance travel."""
    left, right = rack - x[two_track.COMPLIANCE : two_track.COMPLIANCE + 2]
    return CAR.strut.solve(left, x[TRAVEL]), mirrored(CAR.strut.solve(-right, x[TRAVEL + 1]))


def wheels(p, x, rack, rack_rate, u):
    """Forces by vectors, exact strut and checked tyre: F, N about O on car and wheels, along travels, and the power.

    All in the road frame. A spin takes -R_e F_x of the moment that the contact makes about the axle: what remains is
    that the tyre is R_l high and rolls on R_e.
    """
    d, R = p.chassis.body[0], axes(x)
    V, W = R @ x[:3], R @ x[3:6]
    ground = np.array([road.height(p.chassis.road, i % 2, x[two_track.DISTANCE] + AT[i, 0])[0] for i in range(4)])
    poses = front_poses(x, rack)
    _, out, _ = code(p, x, rack, rack_rate, u)
    drive = 0.5 * np.repeat([out[OUT["front_drive_torque"]], out[OUT["rear_drive_torque"]]], 2)
    pedal = out[OUT["brake_pedal"]]
    brakes = p.chassis.brakes
    brake = np.repeat([pedal * brakes.front, pedal * brakes.rear + u[HAND_BRAKE] * brakes.hand], 2)
    brake = np.copysign(brake, x[OMEGA:KAPPA])
    F, N, Q, power, spin, loads, slips = np.zeros(3), np.zeros(3), np.zeros(4), 0.0, np.zeros(4), np.zeros(4), []
    for i in range(4):
        side, s, s_rate = (1.0, -1.0)[i % 2], x[TRAVEL + i], x[TRAVEL_RATE + i]
        if i < 2:
            up, steer, camber = poses[i].per_travel, float(poses[i].steer_angle), float(poses[i].inclination)
            path = up.wheel_centre[0] * E_X, up.contact[1] * E_Y, float(up.rotation[1])
            slope = -float(up.strut_length)
            length = float(CAR.strut.solve(0.0, 0.0).strut_length - poses[i].strut_length)
            spring, damper = slope * (d.S_f + d.K_f * length), slope**2 * d.C_f * s_rate
            bar, stop = d.B_f, d.clearance_f
        else:
            steer, camber, path = (
                side * d.steer_r * s,
                side * d.camber_r * s,
                (0.0 * E_X, side * d.contact_y_r * E_Y, 0.0),
            )
            spring, damper, bar, stop = d.S_r + d.K_r * s, d.C_r * s_rate, d.B_r, d.clearance_r
        beyond = max(abs(s) - stop, 0.0)
        spring += math.copysign(d.K_stop * beyond**2 / (beyond + 0.01), s)
        spring += bar * (s - x[TRAVEL + i + (1 if side > 0.0 else -1)])
        r = R @ (AT[i] + s * E_Z)
        foot = np.array([r[0], r[1], ground[i] - x[two_track.Z]])
        radius = r[2] - foot[2]
        camber_gain = float(poses[i].per_travel.rotation[0]) if i < 2 else side * d.camber_r
        camber += x[ROLL]
        offset, longer = radius * camber * E_Y, 1.0 + 0.5 * camber**2  # a cambered wheel meets the road in its plane
        r, foot = r + offset, foot + offset
        load = max((d.F_zf, d.F_zf, d.F_zr, d.F_zr)[i] + d.K_t * (d.R_l - radius * longer), 0.0) * longer
        # where the wheel centre goes, and the contact: turned back by the carrier's pitch where F_y has a share along x
        centre = V + np.cross(W, r) + (R @ E_Z + path[0]) * s_rate
        contact = V + np.cross(W, foot) + (R @ E_Z + path[0] + path[1] - path[2] * radius * E_X) * s_rate
        mu = road.friction(p.chassis.road, i % 2, x[two_track.DISTANCE] + AT[i, 0])
        ahead, left = heading(steer)
        rolling = centre @ E_X * ahead[0] + contact @ E_Y * ahead[1]
        values = (x[KAPPA + i], math.atan(x[TAN_ALPHA + i]), camber, load, rolling, mu)
        F_x, F_y, M_x, M_y, M_z = (float(value) for value in TYRES[i // 2].forces(*values))
        if i >= 2:
            ahead, left = heading(steer + d.compliance_steer_r * F_y)
            rolling = centre @ E_X * ahead[0] + contact @ E_Y * ahead[1]
        slip_x, slip_y = rolling - d.R_e * x[OMEGA + i], contact @ left
        slips.append(
            [(-slip_x - rolling * x[KAPPA + i]) / d.sigma_x, (slip_y - rolling * x[TAN_ALPHA + i]) / d.sigma_y]
        )
        force = F_x * ahead + F_y * left + load * E_Z
        moment = M_x * ahead + M_z * E_Z
        held = np.array([F_x * ahead[0], 0.0, 0.0])  # at the wheel's centre, the rest at the contact
        F += force
        N += np.cross(r, held) + np.cross(foot, force - held) + moment + (brake[i] - drive[i]) * E_Y
        carrier = path[0] - path[2] * radius * E_X
        Q[i] = force @ (R @ E_Z + path[1]) + held @ path[0] + (force - held) @ E_X * carrier[0]
        Q[i] += camber_gain * (offset[1] * load + M_x) + path[2] * brake[i] - spring - damper + M[i] * d.g_z
        spin[i] = M_y - d.R_e * F_x + drive[i] - brake[i]
        power += (
            F_x * slip_x + F_y * slip_y + moment @ W + M_x * camber_gain * s_rate + M_y * x[OMEGA + i] - damper * s_rate
        )
        power += drive[i] * (x[OMEGA + i] - W[1]) - brake[i] * (x[OMEGA + i] - W[1] - path[2] * s_rate)
        loads[i] = load
    return {"F": F, "N": N, "Q": Q, "power": power, "spin": spin, "loads": loads, "slips": np.array(slips)}


def external(p, x, w, u):
    """Force and moment about O of everything outside the car, road frame."""
    d, V = p.chassis.body[0], axes(x) @ x[:3]
    c, s = math.cos(x[YAW]), math.sin(x[YAW])
    air = np.array([-d.drag * V[0] * abs(V[0]), u[WIND_FORCE], (d.lift_f + d.lift_r) * V[0] ** 2])
    F = w["F"] + air + d.m * np.array([d.g_x * c + d.g_y * s, d.g_y * c - d.g_x * s, d.g_z])
    N = w["N"] + [0.0, (d.b * d.lift_r - d.a * d.lift_f) * V[0] ** 2, u[WIND_MOMENT]]
    return F, N, air


def momenta(x):
    """Linear momentum and angular momentum about O with the inertia of the design position, in body axes."""
    inertia = np.diag([D.I_x, D.I_y, D.I_z]) + np.diag([(M * AT[:, 1] ** 2).sum(), (M * AT[:, 0] ** 2).sum(), 0.0])
    inertia[0, 2] = inertia[2, 0] = -D.I_xz
    rising = M[:, None] * x[TRAVEL_RATE:OMEGA, None] * E_Z
    H = inertia @ x[3:6] + np.cross(AT, rising).sum(axis=0) + D.I_w * x[OMEGA:KAPPA].sum() * E_Y
    return D.m * x[:3] + rising.sum(axis=0), H


def energy(p, x, rack=0.0):
    """Kinetic energy, and the energy of weight, springs, anti-roll bars, bump stops and tyres."""
    d, (P, H), s = p.chassis.body[0], momenta(x), x[TRAVEL:TRAVEL_RATE]
    spins = x[OMEGA:KAPPA]
    kinetic = 0.5 * (x[:3] @ P + x[3:6] @ (H - d.I_w * spins.sum() * E_Y) + (M * x[TRAVEL_RATE:OMEGA] ** 2).sum())
    kinetic += 0.5 * (M * x[TRAVEL_RATE:OMEGA]) @ (x[2] + x[3] * AT[:, 1] - x[4] * AT[:, 0])
    kinetic += 0.5 * d.I_w * (spins**2).sum()
    weight = d.m * (d.g_x * x[two_track.X] + d.g_y * x[two_track.Y] + d.g_z * x[two_track.Z]) + d.g_z * M @ s
    poses = front_poses(x, rack)
    length = np.array([float(CAR.strut.solve(0.0, 0.0).strut_length - pose.strut_length) for pose in poses])
    springs = (d.S_f * length + 0.5 * d.K_f * length**2).sum() + (d.S_r * s[2:] + 0.5 * d.K_r * s[2:] ** 2).sum()
    bars = 0.5 * (d.B_f * (s[0] - s[1]) ** 2 + d.B_r * (s[2] - s[3]) ** 2)
    e = 0.01
    beyond = np.maximum(np.abs(s) - [d.clearance_f, d.clearance_f, d.clearance_r, d.clearance_r], 0.0)
    stops = d.K_stop * (0.5 * beyond**2 - e * beyond + e * e * np.log1p(beyond / e)).sum()
    height = x[two_track.Z] + (AT + s[:, None] * E_Z) @ axes(x)[2]
    camber = x[ROLL] + np.append([float(pose.inclination) for pose in poses], d.camber_r * s[2:] * [1.0, -1.0])
    pressed = d.R_l - height * (1.0 + 0.5 * camber**2)
    loads = np.maximum([d.F_zf, d.F_zf, d.F_zr, d.F_zr] + d.K_t * pressed, 0.0)
    return kinetic - weight + springs + bars + stops + (loads**2).sum() / (2.0 * d.K_t)


def exact(x, F, N, Q):
    """Accelerations of a rigid body and four masses that move in it, by Newton and Euler; forces in body axes."""
    m_s, z_w = D.m - M.sum(), D.R_l - D.h
    centre = np.array([-(M * AT[:, 0]).sum() / m_s, 0.0, -M.sum() * z_w / m_s])
    yaw = D.I_z - (M * (AT[:, 0] ** 2 + AT[:, 1] ** 2)).sum() - m_s * centre[0] ** 2
    inertia = np.diag([C["roll_inertia"], C["pitch_inertia"], yaw])
    v, w, s, s_rate = x[:3], x[3:6], x[TRAVEL:TRAVEL_RATE], x[TRAVEL_RATE:OMEGA]
    A, b = np.zeros((10, 10)), np.concatenate([F, N, Q])
    A[3:6, 3:6] += inertia
    b[3:6] -= np.cross(w, inertia @ w + D.I_w * x[OMEGA:KAPPA].sum() * E_Y)
    for i in range(-1, 4):
        mass, r = (m_s, centre) if i < 0 else (M[i], AT[i] + s[i] * E_Z)
        lever = np.cross(np.eye(3), r)  # rows: e_k x r
        J = np.concatenate([np.eye(3), lever.T, np.zeros((3, 4))], axis=1)
        a = np.cross(w, v + np.cross(w, r))
        if i >= 0:
            J[2, 6 + i] = 1.0
            a = a + 2.0 * np.cross(w, s_rate[i] * E_Z)
            A[6 + i] += mass * J[2]
            b[6 + i] -= mass * a[2]
        A[:3] += mass * J
        A[3:6] += mass * lever @ J
        b[:6] -= mass * np.concatenate([a, lever @ a])
    return np.linalg.solve(A, b)


def along(f, x, dx, step=1e-5):
    """Derivative of f along dx."""
    return (f(x + step * dx) - f(x - step * dx)) / (2.0 * step)


def stirred(u_seed, size=1.0, v=25.0, **rest):
    """Plant without engine inertia at a random state, its inputs and derivative, and the forces of both derivations."""
    rng = np.random.default_rng(u_seed)
    p = make(v, **rest)
    p = p._replace(chassis=p.chassis._replace(drive=p.chassis.drive._replace(inertia=0.0)))
    p = changed(p, clearance_f=0.005, clearance_r=0.005, steer_r=0.3, camber_r=-0.2, compliance_steer_r=1e-6)
    x, rack = random_state(rng, v, size), size * rng.uniform(-0.04, 0.04)
    u = np.zeros(len(INPUTS))
    u[[WIND_FORCE, WIND_MOMENT, BRAKE, HAND_BRAKE, COAST]] = [
        *rng.uniform(-500.0, 500.0, 2),
        *rng.uniform(0, 1, 2),
        1.0,
    ]
    u[:] *= size
    return p, x, rack, u, code(p, x, rack, 0.0, u), wheels(p, x, rack, 0.0, u)


SLOPING = {"road": road.make_road(grade=0.1, bank=-0.05)}


@pytest.mark.parametrize("seed", range(20))
def test_forces_momentum_and_power(seed):
    """Second derivation of the forces; then P' = F, H' = N about O, and E' = power of the non-conservative forces."""
    p, x, rack, u, (dx, out, _), w = stirred(seed, **SLOPING)
    np.testing.assert_allclose(each(out, "wheel_load"), w["loads"], rtol=1e-7)  # the strut is a table
    np.testing.assert_allclose(sum(each(out, f"force_{k}").sum() for k in "xy"), w["F"][:2].sum(), rtol=1e-6, atol=0.1)
    np.testing.assert_allclose(dx[OMEGA:KAPPA], w["spin"] / D.I_w, rtol=1e-6, atol=0.01)
    np.testing.assert_allclose(
        np.stack([dx[KAPPA:TAN_ALPHA], dx[TAN_ALPHA:BORE_ANGLE]], 1), w["slips"], rtol=1e-6, atol=1e-5
    )
    F, N, air = external(p, x, w, u)

    def in_world(k):
        def f(x):
            c, s = math.cos(x[YAW]), math.sin(x[YAW])
            return np.array([[c, -s, 0.0], [s, c, 0.0], E_Z]) @ axes(x) @ momenta(x)[k]

        return f

    c, s = math.cos(x[YAW]), math.sin(x[YAW])
    yaw = np.array([[c, -s, 0.0], [s, c, 0.0], E_Z])
    np.testing.assert_allclose(along(in_world(0), x, dx), yaw @ F, rtol=1e-6, atol=0.1)
    np.testing.assert_allclose(
        along(in_world(1), x, dx), yaw @ (N + w["spin"].sum() * axes(x) @ E_Y), rtol=1e-6, atol=0.5
    )
    V, W = axes(x) @ x[:3], axes(x) @ x[3:6]
    power = w["power"] + air @ V + (N - w["N"]) @ W
    held = changed(p, T_rack=1e12)  # a compliance that moves stores and takes energy of its own
    dx, _, _ = code(held, x, rack, 0.0, u)
    assert along(lambda x: energy(held, x, rack), x, dx) == pytest.approx(power, rel=1e-6, abs=2.0)


def test_accelerations_are_those_of_moving_masses_to_first_order():
    """The inertia is constant: against masses that move in the body the error is of second order in the motion."""
    errors = []
    for size in (0.04, 0.01):
        worst = 0.0
        for seed in range(10):
            p, x, _, u, (dx, _, _), w = stirred(seed, size)
            F, N, _ = external(p, x, w, u)
            R = axes(x)
            expected = exact(x, R.T @ F, R.T @ N, w["Q"])
            found = np.concatenate([dx[:6], dx[TRAVEL_RATE:OMEGA]])
            worst = max(worst, np.abs(found - expected).max())
        errors.append(worst)
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.4)


def test_engine_speeding_up_is_carried_by_the_body():
    """In first gear at full throttle the body receives the opposite of the torque of the wheels, not of the engine."""
    p = make(5.0)
    x = plant.initial_state(p)[CHASSIS]
    # Without toe and what it does to the tyres, all forces ahead are at the wheel centres.
    x[two_track.COMPLIANCE : two_track.COMPLIANCE + 2], x[TAN_ALPHA:BORE_ANGLE] = 0.0, 0.0
    dx, out, _ = code(p, x, u=inputs(1, throttle=1.0, coast=1.0)[0])
    F = each(out, "force_x")
    shaft = (D.I_w * dx[OMEGA:KAPPA] - each(out, "road_torque"))[:2].sum()
    assert shaft < 0.8 * out[OUT["front_drive_torque"]]  # the rest speeds up the engine
    _, H = momenta(x)
    change = along(lambda x: momenta(x)[1], x, dx)[1] + np.cross(x[3:6], H)[1] - (D.I_w * dx[OMEGA:KAPPA]).sum()
    r = (AT + x[TRAVEL:TRAVEL_RATE, None] * E_Z) @ axes(x).T
    expected = (r[:, 2] * F - r[:, 0] * each(out, "wheel_load")).sum() - shaft
    expected += (D.b * D.lift_r - D.a * D.lift_f) * (axes(x) @ x[:3])[0] ** 2
    assert change == pytest.approx(expected, rel=1e-6)


def tossed():
    """A car without friction, dampers and air."""
    p = changed(
        make(15.0), C_f=0.0, C_r=0.0, drag=0.0, lift_f=0.0, lift_r=0.0, clearance_f=0.01, clearance_r=0.01, T_rack=1e12
    )
    gone = {key: 0.0 for key in TYRE.coefficients._fields if key[0] in "PQRS"} | {"PKY1": -1e-12, "PDX1": 1e-12}
    gone |= {key: getattr(TYRE.coefficients, key) for key in ("PCX1", "PCY1", "PKY2", "PKY4", "PDY1")}
    return p._replace(tyre=tyre.record(TYRE.coefficients._replace(**gone)))


def test_energy_is_conserved_without_losses():
    """A car in the air by DOP853 with 150 kJ of energy; of the tyres only the load remains."""
    p, rng = tossed(), np.random.default_rng(3)
    x, u = random_state(rng, 15.0), inputs(1, coast=1.0)[0]
    x[KAPPA:BORE_ANGLE], x[two_track.SHIFT_TIME], rack = 0.0, 1.0, 0.02  # a running shift opens the clutch

    def f(t, x):
        dx = code(p, x, rack, 0.0, u)[0]
        dx[OMEGA:] = 0.0  # spins and slips are left out: they neither store nor take
        return dx

    solver, ends = DOP853(f, 0.0, x, 1.0, rtol=1e-11, atol=1e-12), [energy(p, x, rack)]
    while solver.status == "running":
        solver.step()
        ends.append(energy(p, solver.y, rack))
    assert np.ptp(ends) < 0.2  # the turning of the tyres' feet in roll is work to second order only
    assert np.abs(solver.y[TRAVEL:OMEGA] - x[TRAVEL:OMEGA]).max() > 0.01


# Of the springs along the travel; the ratio of the front strut changes.
RATES = np.array([C["front_spring"], C["rear_spring"]])
RATES[0] += D.S_f * np.diff([float(CAR.strut.solve(0.0, s).per_travel.strut_length) for s in (1e-3, -1e-3)])[0] / 2e-3

# Loads --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("v", [0.0, 10.0, 30.0])
def test_loads_carry_weight_and_lift(v):
    """The settled car: static loads by lever arms on a level road, the normal part of the weight on grade and bank."""
    for ground in (road.make_road(), road.make_road(grade=0.05, bank=0.04)):
        record, _ = run(make(v, road=ground), ramp(0.0, 60_000), last=True)
        loads, speed = each(record[0], "wheel_load"), at(record, "longitudinal_speed")[0]
        lift = (D.lift_f + D.lift_r) * speed**2
        normal = C["mass"] * G * math.cos(ground.grade) * math.cos(ground.bank)
        assert loads.sum() == pytest.approx(normal - lift, rel=1e-9 if ground.grade == 0.0 else 2e-5)
        if v == 0.0 and ground.grade == 0.0:
            np.testing.assert_allclose(loads, [D.F_zf, D.F_zf, D.F_zr, D.F_zr], rtol=1e-9)


@pytest.fixture(scope="module")
def circle():
    """The car settled on a circle at 4 m/s2 and 80 km/h."""
    p = make(80.0 * KPH)
    record, state = run(p, ramp(0.67, 30_000, 2.0), last=True)
    return p, record[0], state[CHASSIS]


def test_roll_and_load_transfer_by_closed_form(circle):
    """Springs and roll centres of each axle in series with its tyres; the moment of all loads about the ground."""
    p, row, x = circle
    a_y, phi, loads = at(row, "lateral_acceleration"), at(row, "roll_angle"), each(row, "wheel_load")
    track, lateral = np.array([D.t_f, D.t_r]), np.array([at(row, f"{k}_lateral_force") for k in ("front", "rear")])
    assert a_y == pytest.approx(4.0, abs=0.05)
    assert a_y == pytest.approx(at(row, "longitudinal_speed") * at(row, "yaw_rate"), rel=1e-3)
    assert lateral.sum() == pytest.approx(C["mass"] * a_y, rel=1e-9)
    assert loads.sum() == pytest.approx(
        C["mass"] * G - (D.lift_f + D.lift_r) * at(row, "longitudinal_speed") ** 2, rel=1e-7
    )
    springs = 0.5 * RATES * track**2 + [C["front_anti_roll"], C["rear_anti_roll"]]
    tyres = 0.5 * D.K_t * track**2
    centres = np.array([float(CAR.strut.solve(0.0, 0.0).roll_centre_height), C["rear_roll_centre"]])
    gyroscopic = D.I_w * x[OMEGA:KAPPA].sum() * x[two_track.R]  # the wheels' spin, turned: 46 N m
    turned_over = each(code(p, x, p.pinion_radius * at(row, "column_angle"))[1], "moment_x").sum()
    assert turned_over == pytest.approx(-gyroscopic, abs=1.0)
    series = tyres / (tyres + springs)
    # sum of series (springs phi + Y centre) = m a h + m g h phi: masses move sideways over the contacts
    overturning = C["mass"] * a_y * D.h + gyroscopic
    expected = (overturning - (series * lateral * centres).sum()) / ((series * springs).sum() - C["mass"] * G * D.h)
    moments = series * (springs * expected + lateral * centres)
    found = 0.5 * track * [loads[1] - loads[0], loads[3] - loads[2]]
    assert phi == pytest.approx(expected, rel=0.04)
    np.testing.assert_allclose(found, moments, rtol=0.05)


@pytest.mark.parametrize(("pedal", "throttle"), [(0.25, 0.0), (0.0, 0.9)])
def test_pitch_under_drive_and_braking_by_closed_form(pedal, throttle):
    """Load transfer m a h/L; pitch from springs and tyres, less the part that the brakes support (anti-dive)."""
    p = make(120.0 * KPH if pedal else 10.0)
    record, state = run(p, inputs(4000, coast=1.0, brake=pedal, throttle=throttle), last=True)
    row, x = record[0], state[CHASSIS]
    loads, phi = each(row, "wheel_load"), at(row, "pitch_angle")
    u = inputs(1, coast=1.0, brake=pedal, throttle=throttle)[0]
    dx, out, _ = code(p, x, u=u)
    X = each(out, "force_x")
    lift = np.array([D.lift_f, D.lift_r]) * at(row, "longitudinal_speed") ** 2
    arm = D.h + D.R_e - D.R_l  # a spin takes R_e F_x of the moment
    transfer = (-X.sum() * arm - D.I_w * dx[OMEGA:KAPPA].sum() + C["mass"] * G * (D.h - D.R_l) * phi) / L
    gain = 2.0 * loads[[0, 2]] - 2.0 * np.array([D.F_zf, D.F_zr])
    np.testing.assert_allclose(gain + lift, [transfer, -transfer], rtol=0.03)
    up = CAR.strut.solve(0.0, x[TRAVEL]).per_travel
    taken = up.wheel_centre[0] * X[0] + up.rotation[1] * pedal * p.chassis.brakes.front  # by one front strut's path
    jacked = up.contact[1] * each(out, "force_y")[0]  # drive gives way to toe-in, against which the tyres push
    travel = (0.5 * gain + [taken + jacked, 0.0]) / RATES
    sunk = travel + 0.5 * gain / D.K_t

    assert phi == pytest.approx((sunk[0] - sunk[1]) / L, rel=0.04)
    assert np.sign(taken) == -np.sign(gain[0]) if pedal else abs(taken) < 0.03 * abs(gain[0])


def derivatives():
    """Derivatives and outputs at random states of a moving and of a standing car."""
    rng, rows = np.random.default_rng(2), []
    for v in (20.0, 0.0):
        p = make(v)
        for _ in range(3):
            x = straight(p)
            x[:6] += rng.normal(size=6) * 0.1
            x[TRAVEL : TRAVEL + 24] += rng.normal(size=24) * 0.01
            rows.append(np.concatenate(code(p, x, 0.01, 0.1)[:2]))
    return np.array(rows)


def test_plain_python_equals_compiled():
    script = "import json; from tests.vehicle import test_two_track as t; print(json.dumps(t.derivatives().tolist()))"
    root = str(Path(__file__).parents[2])
    run = subprocess.run(
        [sys.executable, "-c", script],
        cwd=root,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": root},
        capture_output=True,
        text=True,
        check=True,
    )
    compiled = derivatives()
    np.testing.assert_allclose(json.loads(run.stdout), compiled, rtol=1e-9, atol=1e-11 * np.abs(compiled).max())


# The plant ----------------------------------------------------------------------------------------------------------


def disturbed(n, seed=6):
    """Inputs that excite everything, smooth from sample to sample."""
    t, rng = T * np.arange(n), np.random.default_rng(seed)
    waves = np.sin(2.0 * math.pi * np.outer(t, rng.uniform(0.3, 4.0, len(INPUTS))) + rng.uniform(0.0, 6.0, len(INPUTS)))
    u = waves * [2.0, 0.0, 1.0, 300.0, 100.0, 60.0, 1.0, 0.2, 0.2, 0.2, 0.0]
    u[:, THROTTLE:COAST] = np.maximum(u[:, THROTTLE:COAST], 0.0)
    return u


@pytest.mark.parametrize("law", EACH_LAW)
def test_every_law_mirrors_exactly(law):
    """Mirrored inputs on a mirrored rough road of uneven grip give the mirrored run to the last bit."""
    rough = road.iso8608(1, "C", friction=(0.9, 0.6), length=400.0, bank=0.02)
    other = rough._replace(heights=rough.heights[::-1].copy(), friction=rough.friction[::-1].copy(), bank=-rough.bank)
    swap = [name.replace("left", "LEFT").replace("right", "left").replace("LEFT", "right") for name in CHANNEL]
    odd = ("handwheel", "column", "torsion", "motor", "friction", "rack", "lateral", "yaw", "roll", "y", "road_wheel")
    odd += ("front_lateral", "rear_lateral", "tan_alpha", "aligning")
    even = ("roll_ing",)
    sign = np.array([-1.0 if name.startswith(odd) and not name.startswith(even) else 1.0 for name in CHANNEL])
    flip = np.array([-1.0] * 6 + [1.0] * (len(INPUTS) - 6))
    for robot in (False, True):
        u = disturbed(1500)
        u[:, :2] = weave(robot, 1500)[:, :2]
        record, _ = run(make(20.0, law, robot, road=rough), u)
        mirrored, _ = run(make(20.0, law, robot, road=other), flip * u)
        assert np.abs(at(record, "lateral_acceleration")).max() > 1.0
        assert np.ptp(each(record, "wheel_load")[:, 0]) > 1000.0
        np.testing.assert_array_equal(mirrored, sign * record[:, [CHANNEL[name] for name in swap]])


def errors(p, u, substeps, state=None):
    """Largest error in % of the peak of each channel, and its rms, for each number of substeps."""
    exact = reference(p, u, True, state)
    peak = np.maximum(np.abs(exact).max(axis=0), 1e-12)
    found = [run(p, u, None if state is None else state.copy(), substeps=n)[0] - exact for n in substeps]
    return [100.0 * np.abs(e).max(axis=0) / peak for e in found], [np.sqrt((e**2).mean(axis=0)) / peak for e in found]


# Largest error of the motor torque in % of its peak: at 3 N m the boost multiplies that of the torsion bar by five.
STEEP = 0.036


def test_weave_against_scipy():
    """Two seconds at 100 km/h under the speed hold: every channel at 1 ms, and second order as the step is halved."""
    largest, rms = errors(make(), weave(True), (1, 2, 4))
    for name, i in CHANNEL.items():
        assert largest[0][i] <= {"friction_torque": 1.1, "motor_torque": STEEP}.get(name, 0.03), name
        # friction has its kink at reversals; what the robot needs is measured by the samples' cubic
        if rms[0][i] > 1e-9 and name not in ("friction_torque", "handwheel_torque", "column_speed"):
            assert math.log2(rms[0][i] / rms[2][i]) / 2.0 > 1.8, name
            assert math.log2(rms[1][i] / rms[2][i]) == pytest.approx(2.0, abs=0.2), name


def test_braked_weave_against_scipy():
    """0.35 g on and off again: a moving pedal costs no accuracy, although a chassis step spans two rows of inputs."""
    p, u, t = make(), weave(True), np.arange(2000) * T
    _, state = run(p, inputs(1000, coast=1.0))
    u[:, BRAKE], u[:, COAST] = 0.3 * np.sin(np.pi * np.clip((t - 0.2) / 1.6, 0.0, 1.0)) ** 2, 1.0
    largest, rms = errors(p, u, (1, 2, 4), state)
    for name, i in CHANNEL.items():
        assert largest[0][i] <= {"friction_torque": 1.1, "motor_torque": STEEP}.get(name, 0.03), name
        # in slips, at 1e-5, the pedal's steps from row to row show, which the continuous brake torque does not smooth;
        # so they do in the toe of the front wheels, which gives way to their brakes
        if name.startswith("road_wheel_angle") or name.endswith(("front_left", "front_right")):
            assert max(rms[k][i] for k in range(3)) < 1e-4, name
        elif rms[0][i] > 1.1e-5 and name not in ("friction_torque", "handwheel_torque", "column_speed"):
            assert math.log2(rms[0][i] / rms[2][i]) / 2.0 > 1.8, name


def test_a_step_of_an_input_has_its_whole_effect():
    """A gust of one row or more, from any row on, at any step has its impulse on the car, before the tyres respond.

    Over a gust that ends, half the change of (N3) cancels: one that lasts to the end of the run shows it.
    """
    p = make(road_friction=0.1)
    p = p._replace(tyre=tyre.record(TYRE.coefficients._replace(PKY1=1e-6 * TYRE.coefficients.PKY1)))
    for substeps in (1, 2, 3):
        calm, _ = run(p, inputs(30, coast=1.0), substeps=substeps)
        for start in (10, 11):
            for rows in (1, 2, 5, 30 - start):
                u = inputs(30, coast=1.0)
                u[start : start + rows, WIND_FORCE] = 1000.0
                blown, _ = run(p, u, substeps=substeps)
                gain = (at(blown, "lateral_speed") - at(calm, "lateral_speed"))[-1]
                assert gain == pytest.approx(1000.0 * rows * T / C["mass"], rel=0.02), (substeps, start, rows)


# What a car must do -------------------------------------------------------------------------------------------------


LATERAL = ("handwheel", "column", "torsion_bar", "motor", "rack", "lateral_speed", "yaw", "roll", "lateral_acc")


@pytest.mark.parametrize("v", [100.0 * KPH, 0.0])
def test_ten_minutes_straight_or_at_rest(v):
    """No lateral motion, to the last bit, and no creep at rest."""
    p = make(v, robot=False)
    state = plant.initial_state(p)
    for _ in range(10):
        record, _ = run(p, inputs(60_000), state, last=True)
    row = record[0]
    assert max(abs(at(row, name)) for name in CHANNEL if name.startswith(LATERAL) or name == "y") <= 1e-12
    assert at(row, "longitudinal_speed") == pytest.approx(v, abs=1e-3)
    if v == 0.0:
        assert abs(at(row, "x")) < 1e-9


def test_hand_brake_holds_on_a_grade():
    """On a grade of 15 % the settled car does not move for ten minutes, and the rear wheels are at rest."""
    p = make(0.0, robot=False, road=road.make_road(grade=math.atan(0.15)))
    state = plant.initial_state(p)
    u = inputs(60_000, hand_brake=1.0, coast=1.0)
    places = [run(p, u, state, last=True)[0][0] for _ in range(11)]
    assert abs(at(places[-1], "x") - at(places[0], "x")) < 1e-6
    assert np.all(each(places[-1], "wheel_angular_velocity")[2:] == 0.0)
    rear = each(places[-1], "longitudinal_force").sum()
    assert rear == pytest.approx(C["mass"] * G * math.sin(math.atan(0.15)), rel=1e-3)


@pytest.mark.parametrize("held", [{"brake": 1.0}, {"hand_brake": 1.0}])
def test_a_ramp_shifts_load_by_the_height_of_the_mass(held):
    """At rest on a road that rises, by statics: the mass is behind where it is on level ground by h times the pitch."""
    slope = 0.05
    heights = slope * np.interp(np.arange(0.0, 40.0, 0.05), [0.0, 10.0, 30.0, 40.0], [0.0, 10.0, -10.0, 0.0])
    p = make(0.0, robot=False, road=road.make_road(heights=[heights, heights]))
    record, _ = run(p, inputs(20_000, coast=1.0, **held), last=True)
    loads, pitch = each(record[0], "wheel_load"), -at(record[0], "pitch_angle")
    assert pitch == pytest.approx(slope, rel=0.1)
    assert loads[2:].sum() / loads.sum() - D.F_zr / (D.F_zf + D.F_zr) == pytest.approx(D.h * pitch / L, rel=0.01)


def test_a_stopped_car_rocks_and_rests():
    """Wheels locked from 30 km/h: mu g, a rebound of at most 5 cm and 0.7 m/s, then rest; no energy is gained."""
    p = make(30.0 * KPH)
    brakes = p.chassis.brakes._replace(rear=700.0)  # those of the car lock its front wheels only
    record, _ = run(p._replace(chassis=p.chassis._replace(brakes=brakes)), inputs(6000, coast=1.0, brake=1.0))
    v, x = at(record, "longitudinal_speed"), at(record, "x")
    assert v.min() > -0.7
    assert x.max() - x[-1] < 0.05
    assert np.abs(v[-500:]).max() < 1e-3
    assert np.all(each(record, "wheel_angular_velocity")[600:900] == 0.0)


def test_down_the_hill_backwards_and_stop():
    """The car coasts up a grade, stops, rolls back and brakes: no force jumps except that of the brakes."""
    p = make(5.0, road=road.make_road(grade=0.1))
    u = inputs(12_000, coast=1.0)
    u[9000:, BRAKE] = 0.3
    record, _ = run(p, u)
    v, F = at(record, "longitudinal_speed"), each(record, "longitudinal_force")
    crossing = np.flatnonzero((v[:-1] > 0.0) & (v[1:] <= 0.0))[0]
    assert np.abs(np.diff(F[crossing - 500 : crossing + 500], axis=0)).max() < 5.0
    assert v[8999] < -2.0
    height = np.sin(0.1) * at(record, "x") + 0.5 * v**2 / G  # energy over weight, wheels and engine left out
    assert np.diff(height[100:9000:100]).max() < 2e-3
    assert np.abs(np.diff(F, axis=0)).max() < 800.0
    assert np.abs(v[-300:]).max() < 0.02


@pytest.mark.parametrize(("angle", "hand"), [(0.0, 800.0), (1.0, 1200.0)])
def test_hand_brake_locks_the_rear(angle, hand):
    """From 60 km/h the rear wheels lock exactly; a straight run stays straight, in a left turn the rear swings out."""
    p = make(60.0 * KPH)
    p = p._replace(chassis=p.chassis._replace(brakes=p.chassis.brakes._replace(hand=hand)))
    u = ramp(angle, 4000)
    u[2000:, HAND_BRAKE] = u[2000:, COAST] = 1.0
    record, _ = run(p, u)
    assert np.all(each(record, "wheel_angular_velocity")[2700:, 2:] == 0.0)
    yaw, drift = at(record, "yaw_angle"), at(record, "lateral_speed")
    if angle == 0.0:
        assert np.all(yaw == 0.0)
        assert at(record, "longitudinal_acceleration")[3000] == pytest.approx(-2.5, abs=0.4)
    else:
        assert np.degrees(yaw[3500] - yaw[2000]) > 30.0
        assert drift[2500] < drift[2000]


@pytest.mark.parametrize("mu", [1.0, 0.5])
def test_emergency_braking(mu):
    """Front wheels locked: between 0.7 and 1 times mu g, and straight."""
    u = inputs(3000, coast=1.0)
    u[500:, BRAKE] = 1.0
    record, _ = run(make(100.0 * KPH, road_friction=mu), u)
    assert np.all(each(record, "wheel_angular_velocity")[2000:, :2] == 0.0)
    a_x = -at(record, "longitudinal_acceleration")[2000:] / (mu * G)
    assert 0.7 < a_x.min() <= a_x.max() < 1.0
    assert np.all(at(record, "y") == 0.0)


def test_one_sided_road_signs():
    """Ice on the left yaws the braked car to the right; a bump on the left loads and lifts that side first."""
    u = inputs(1500, coast=1.0)
    u[500:, BRAKE] = 0.5
    record, _ = run(make(80.0 * KPH, road=road.make_road(friction=(0.1, 1.0))), u)
    assert np.degrees(at(record, "yaw_angle")[1000]) < -3.0
    F = each(record, "longitudinal_force")[600]
    assert F[1] < F[0] < 0.0
    # The right wheel pulls back outside of the king-pin axis: the rack is driven to the right, as virtual work has it.
    work = float(load_coefficients(CAR.strut.solve(0.0, 0.0)).F_x_contact)
    assert np.sign(at(record, "rack_force")[520]) == np.sign(work * (F[1] - F[0]))
    p = make(60.0 * KPH, road=road.bump(0.03, 1.0, 10.0, side="left"))
    record, _ = run(p, inputs(700))
    rise = np.flatnonzero(each(record, "wheel_load")[:, 0] > 1.2 * D.F_zf)[0]
    loads, travel = each(record, "wheel_load")[rise], each(record, "travel")[rise + 20]
    assert abs(loads[1] - D.F_zf) < 200.0
    assert travel[0] > 0.003 > abs(travel[1])
    assert at(record, "roll_angle").max() > 0.23 * 0.03 / D.t_f  # left side up rolls right


@pytest.mark.parametrize(("boost", "low", "high"), [(True, 3.0, 4.5), (False, 22.0, 33.0)])
def test_parking(boost, low, high):
    """Lock to lock at up to 60 deg/s at rest: rack force against the turn, hand torque with and without assist."""
    p = make(0.0)
    if not boost:
        p = p._replace(assist=p.assist._replace(boost=np.zeros_like(p.assist.boost)))
    lock, w = 0.95 * p.rack_limit / p.pinion_radius, math.radians(60.0)
    n = round(1.75 * 2.0 * math.pi * lock / w / T)
    t = np.arange(1, n + 1) * T
    u = inputs(n)
    u[:, HAND], u[:, HAND_SPEED] = lock * np.sin(w / lock * t), w * np.cos(w / lock * t)
    record, _ = run(p, u)
    angle, force, hands = (at(record, name) for name in ("handwheel_angle", "rack_force", "handwheel_torque"))
    crossing = np.flatnonzero((angle[:-1] < 0.0) != (angle[1:] < 0.0))[1:]
    way = np.sign(angle[crossing + 1] - angle[crossing])
    assert np.all((way * force[crossing] > 2400.0) & (way * force[crossing] < 4000.0))
    assert np.all((way * hands[crossing] > low) & (way * hands[crossing] < high))
    assert np.abs(force).max() < 5000.0
    assert np.abs(at(record, "x")).max() < 0.15


@pytest.mark.parametrize("law", EACH_LAW)
def test_abuse_stays_finite(law):
    """Any combination of speed and inputs, on a road too slippery to roll over."""
    rng = np.random.default_rng(1)
    for k in range(12):
        n, robot = 3000, bool(k % 2)
        p = make(rng.uniform(0.0, 70.0), law, robot, road_friction=rng.uniform(0.1, 0.9))
        u, t, w = inputs(n), np.arange(1, n + 1) * T, 4.0 * math.pi
        steps = np.repeat(rng.uniform(-1.0, 1.0, (5, n // 500)), 500, axis=1)
        if robot:
            u[:, HAND], u[:, HAND_SPEED] = math.radians(500.0) * np.sin(w * t), math.radians(500.0) * w * np.cos(w * t)
        else:
            u[:, HAND] = 10.0 * steps[0]
        u[:, [THROTTLE, BRAKE, HAND_BRAKE]] = np.maximum(steps[1:4], 0.0).T
        u[:, COAST] = steps[4] > 0.0
        state, record = plant.initial_state(p), np.zeros((n, len(CHANNEL)))
        assert plant.run(p, state, u, record, 1), plant.first_non_finite(p, plant.initial_state(p), u)
        assert np.isfinite(record).all()
        assert np.abs(at(record, "roll_angle")).max() < 0.5
        assert np.abs(each(record, "wheel_load")).max() < 30e3
