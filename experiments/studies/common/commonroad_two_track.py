"""Our two-track car with CommonRoad's parameters and the road-wheel angle and acceleration of their model."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from steer_env.experiments.studies.common.commonroad_manoeuvres import (
    Manoeuvre,
    acceleration,
    longest_step,
    recording_of,
    road_wheel_angle,
    sample_times,
)
from steer_env.friction import make as make_law
from steer_env.friction.numerics.kernel import record
from steer_env.recording.recording import Recording
from steer_env.vehicle import cars, commonroad
from steer_env.vehicle.chassis import two_track
from steer_env.vehicle.chassis.common.interface import BRAKE, COAST, INPUTS, THROTTLE
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.suspension import kinematics_table
from steer_env.vehicle.suspension.macpherson import MacPherson

Array = NDArray[np.float64]

_PER_RACK = 6.0  # road-wheel angle for each metre of rack; any value does, as the angle is given [rad/m]
_FULL = 12.0  # acceleration of full throttle and full pedal; any value above what is commanded does [m/s2]


def _two_track(
    p: Any, speed: float, relaxation_length: float
) -> tuple[two_track.TwoTrack, kinematics_table.KinematicsTable, Any]:
    """Chassis, suspension and tyre of our car with their parameters; what their model has no counterpart of is off.

    Their heights do not count the static compression of the tyres, by which their car sinks: h_s and, for each axle,
    the wheel centres and the roll centre. R_w remains the lever of torques and slip.
    """
    L, torque = p.a + p.b, p.m * p.R_w * _FULL
    gearbox: dict[str, Any] = {
        **{"speeds": (1.0, 1000.0), "full_load": (torque, torque), "drag": (0.0, 0.0), "inertia": 0.0},
        **{"ratios": (1.0,), "final_drive": 1.0, "efficiency": 1.0, "up_shift": (1e3, 1e3), "down_shift": (1.0, 1.0)},
    }
    sections: dict[str, dict[str, Any]] = {
        "steering": {"pinion_radius": 0.008, "compliance": 1e4, "friction_load": 0.0, "rack_limit": 0.07},
        "drivetrain": gearbox,
        "brakes": {"front": 0.5 * p.T_sb * torque, "rear": 0.5 * (1.0 - p.T_sb) * torque},
    }
    data = commonroad.car_data(p, "commonroad", description="oracle", source="CommonRoad", sections=sections)
    car = cars.from_data(data)
    sunk_f, sunk_r = (
        0.5 * GRAVITY * (p.m_s * other / L + m_u) / p.K_zt for other, m_u in ((p.b, p.m_uf), (p.a, p.m_ur))
    )
    sunk = (sunk_f * p.b + sunk_r * p.a) / L
    plant = car._replace(
        tyre=commonroad.tyre(p),
        strut=MacPherson(car.strut.points, p.R_w - sunk),
        chassis=car.chassis
        | {"sprung_height": p.h_s - sunk, "rear_roll_centre": p.h_rar - sunk_r, "wheel_inertia": 1.0},
    ).plant(speed=speed, chassis="two_track")
    body = two_track.Body(*plant.chassis.body[0].tolist())
    body = body._replace(
        # values that the fixed step of the plant would refuse, and a variable step can follow
        I_w=p.I_y_w,
        sigma_x=relaxation_length,
        sigma_y=relaxation_length,
        R_e=p.R_w,
        # a suspension without the kinematics of a strut
        S_f=body.F_zf - body.m_f * GRAVITY,
        K_f=p.K_sf,
        C_f=p.K_sdf,
        K_stop=0.0,
        K_rack=1e12,
        d_x=0.0,
        d_y=0.0,
        drag=0.0,
        lift_f=0.0,
        lift_r=0.0,
    )
    bore_friction = make_law("dahl", sigma_0=1e-4, F_c=1e-6)  # negligible, at the usual bore friction
    strut = kinematics_table.linear(_PER_RACK, -p.D_f, 2.0 * (p.h_raf - sunk_f) / p.T_f)
    return plant.chassis._replace(body=record(body), bore_friction=bore_friction), strut, plant.tyre[0]


def drive_two_track(
    parameters: Any,
    manoeuvre: Manoeuvre,
    relaxation_length: float = 0.03,
    dt: float = 0.005,
    tolerance: float = 1e-6,
) -> Recording:
    """Drive our two-track car with their parameters; the channels are those of ``commonroad.drive``.

    Parameters
    ----------
    parameters, manoeuvre, dt
        As in :func:`steer_env.experiments.studies.commonroad.drive`.
    relaxation_length : float
        Relaxation length of our tyres, short, because those of the CommonRoad model have none [m].
    tolerance : float
        Relative tolerance of the integration (LSODA); the absolute one is a hundredth of it.

    Raises
    ------
    RuntimeError
        If the integration fails, with the reason of the solver.
    """
    p = parameters
    car, strut, tyre = _two_track(p, manoeuvre.speed, relaxation_length)
    x_s = -2.0 * (car.body.m_f[0] * car.body.a[0] - car.body.m_r[0] * car.body.b[0]) / p.m_s
    z_s = float((p.m - p.m_s) / p.m * (p.h_s - p.R_w))  # of the sprung mass [m]
    size = len(two_track.STATES)
    dx, out, u = np.zeros(size), np.zeros(len(two_track.OUTPUTS)), np.zeros(len(INPUTS))
    u[COAST] = 1.0

    def derivative(t: float, x: Array) -> Array:
        angle, rate = road_wheel_angle(manoeuvre, t)
        a = acceleration(manoeuvre, t, x[two_track.U], x[size])
        u[THROTTLE], u[BRAKE] = max(a, 0.0) / _FULL, max(-a, 0.0) / _FULL
        two_track.derivative(car, strut, tyre, x[:size], float(angle) / _PER_RACK, float(rate) / _PER_RACK, u, dx, out)
        return np.append(dx, manoeuvre.speed - x[two_track.U])

    times = sample_times(manoeuvre, dt)
    start = [*two_track.start(car), 0.0]
    start[two_track.SHIFT_TIME] = -1.0  # engaged, however the solver rounds
    run = solve_ivp(
        derivative,
        (0.0, times[-1]),
        start,
        "LSODA",
        times,
        max_step=longest_step(manoeuvre),
        rtol=tolerance,
        atol=0.01 * tolerance,
    )
    if not run.success:
        raise RuntimeError(f"{manoeuvre} on two tracks ends after {run.t[-1]:g} s: {run.message}")
    x, names = run.y, [name for name, _ in two_track.OUTPUTS]
    rates, outputs = zip(*((derivative(t, state), out.copy()) for t, state in zip(times, np.ascontiguousarray(x.T))))
    rate, given = np.array(rates).T, dict(zip(names, np.array(outputs).T))
    sideways = rate[two_track.V] + rate[two_track.R] * x_s - rate[two_track.P] * z_s
    v_x, r = x[two_track.U], given["yaw_rate"]
    values = [
        road_wheel_angle(manoeuvre, times)[0],
        np.array([acceleration(manoeuvre, t, v, lost) for t, v, lost in zip(times, v_x, x[size])]),
        *(v_x, given["lateral_speed"] + r * x_s - x[two_track.P] * z_s, r),
        *(given["longitudinal_acceleration"], given["lateral_acceleration"], sideways + v_x * r),
        *(x[two_track.ROLL], x[two_track.PITCH]),
        *(given[f"wheel_load_{wheel}"] for wheel in two_track.WHEELS),
        *x[two_track.OMEGA : two_track.OMEGA + 4],
        *(x[two_track.X], x[two_track.Y], x[two_track.YAW]),
    ]
    return recording_of(times, values, manoeuvre)
