"""Cross-validation of our two-track car against CommonRoad's multi-body model: comparison and limits.

Our car has the parameters of CommonRoad's and gets the same road-wheel angle and torques. CommonRoad's results are a
stored reference, which ``commonroad_model`` computes: ``published`` is the CommonRoad model as it is, ``reconciled``
the same without the peculiarities that are named there.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from steer_env.friction import make as make_law
from steer_env.friction.numerics.kernel import record
from steer_env.recording.recording import Recording
from steer_env.vehicle import cars, commonroad
from steer_env.vehicle.chassis import two_track
from steer_env.vehicle.chassis.common.interface import BRAKE, COAST, INPUTS, THROTTLE
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.suspension import kinematics_table
from steer_env.vehicle.suspension.macpherson import MacPherson
from tests.verification.common.commonroad_manoeuvres import (
    FREQUENCY,
    MANOEUVRES,
    Manoeuvre,
    acceleration,
    longest_step,
    recording_of,
    road_wheel_angle,
    sample_times,
)
from tests.verification.common.commonroad_reference import Reference, interval, load

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
    """Drive our two-track car with their parameters; the channels are those of ``commonroad_model.drive``.

    Parameters
    ----------
    parameters, manoeuvre, dt
        As in ``commonroad_model.drive``.
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
    start = np.zeros(size + 1)
    two_track.begin(car, strut, tyre, start[:size])
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


MOST_STEADY, MOST_RMS = 0.02, 0.01  # limits of the differences: of steady values, and of histories over their peak [1]


def difference(one: Recording, other: Recording, channel: str) -> float:
    """RMS of the difference over the peak of ``other`` [1]."""
    gap = one[channel] - other[channel]
    return float(np.sqrt(np.mean(gap * gap)) / np.abs(other[channel]).max())


def steady(run: Recording, parameters: Any) -> dict[str, float]:
    """Values at the end of a run; of a sine, half the span over its last two cycles.

    Yaw rate [rad/s], lateral acceleration [m/s2], roll and side-slip angle at the sprung centre of gravity [rad], wheel
    loads [N]; of a circle also its road-wheel angle over that of a neutral car, (a + b) r/v [1].
    """
    loads = [f"wheel_load_{wheel}" for wheel in two_track.WHEELS]
    values = {name: run[name] for name in ("yaw_rate", "lateral_acceleration", "roll_angle")}
    values |= {"sideslip_angle": np.arctan2(run["lateral_speed"], run["speed"])} | {name: run[name] for name in loads}
    if run.meta["manoeuvre"] == "sine":
        last = run.time > run.time[-1] - 2.0 / FREQUENCY
        return {name: 0.5 * float(np.ptp(value[last])) for name, value in values.items()}
    ends = {name: float(value[-1]) for name, value in values.items()}
    if run.meta["manoeuvre"] == "circle":
        neutral = (parameters.a + parameters.b) * run["yaw_rate"][-1] / run["speed"][-1]
        ends["understeer"] = float(run["road_wheel_angle"][-1] / neutral)
    return ends


class Comparison(NamedTuple):
    """One manoeuvre on both models."""

    ours: Recording
    theirs: Recording
    steady: dict[str, tuple[float, float, float]]  # ours and theirs as in :func:`steady`, and the difference [1]
    rms: dict[str, float]  # of yaw rate and lateral acceleration, over the peak [1]

    @property
    def passed(self) -> bool:
        """Whether all differences are within the limits."""
        worst = max(abs(gap) for _, _, gap in self.steady.values())
        return worst <= MOST_STEADY and max(self.rms.values()) <= MOST_RMS


def comparison(ours: Recording, theirs: Recording, parameters: Any) -> Comparison:
    """Compare two recordings of one manoeuvre; their parameters give the neutral car of a circle."""
    one, other = steady(ours, parameters), steady(theirs, parameters)
    # A side-slip angle passes through zero as the speed rises; where it is small, its difference is relative to the
    # road-wheel angle.
    floor = {"sideslip_angle": float(np.abs(theirs["road_wheel_angle"]).max())}
    values = {
        name: (one[name], value, (one[name] - value) / max(abs(value), floor.get(name, 0.0)))
        for name, value in other.items()
    }
    rms = {channel: difference(ours, theirs, channel) for channel in ("yaw_rate", "lateral_acceleration")}
    return Comparison(ours, theirs, values, rms)


def compare(name: str, reference: Reference | None = None) -> dict[str, Comparison]:
    """Drive our two tracks in one of ``MANOEUVRES`` and compare with both cases of the (packaged) reference."""
    reference = reference or load()
    manoeuvre = MANOEUVRES[name]
    ours = drive_two_track(reference.parameters, manoeuvre, dt=interval(manoeuvre))
    return {case: comparison(ours, run, reference.parameters) for case, run in reference.histories[name].items()}
