"""CommonRoad's multi-body model as an oracle for our two tracks: manoeuvres, both models' answers, what parts them.

``vehiclemodels.vehicle_dynamics_mb`` has 29 states: body, two axles joined to it by springs, and four wheels, on
steady-state Magic Formula tyres. Its axes are SAE (y right, z down, nose up positive); everything here is ISO 8855.
Ours is driven by the same road-wheel angle and torques, with its parameters. Every difference beyond the marks has a
name and a switch on their side: a value (``QUIRKS``) or a few lines of code (``CODE``).

    python -m experiments.commonroad

prints both comparisons, their model as published and with all switches thrown, and what each switch does by itself.

Source: commonroad-vehicle-models 3.0.2 (BSD). Its bounds of 0.4 rad/s of steering and 11.5 m/s2 are not reached here.
"""

import copy
import inspect
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from vehiclemodels.init_mb import init_mb
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from experiments.figures import STYLE
from friction import make as make_law
from friction.kernel import record
from steer_env.manoeuvres import ramp_and_hold, sine
from steer_env.recording import DEGREE, Recording
from vehicle import cars, commonroad, strut_map, two_track
from vehicle.chassis import BRAKE, COAST, INPUTS, THROTTLE
from vehicle.single_track import GRAVITY
from vehicle.suspension import MacPherson

Array = NDArray[np.float64]

START = 1.0  # straight ahead until then: their initial state is not quite at rest [s]
STEER_RATE = 0.3  # peak, of the front wheels in a step [rad/s]
FREQUENCY = 0.5  # of the sine [Hz]
BRAKE_TIME, BRAKE_RISE = 6.0, 0.2  # start and rise of braking [s]
K_P, K_I = 2.0, 1.0  # of the speed hold [1/s], [1/s2]

MARK_STEADY, MARK_RMS = 0.03, 0.05  # of the comparison: of steady values, and of histories over their peak [1]


class Manoeuvre(NamedTuple):
    """One run at a held speed; :func:`road_wheel_angle` and :func:`acceleration` are its inputs."""

    kind: str  # step, sine, circle or brake
    speed: float  # forward, along the body [m/s]
    amplitude: float  # of the front wheels' angle, both alike [rad]
    duration: float  # [s]
    braking: float = 0.0  # from BRAKE_TIME on, in a brake run [m/s2]


# For 4 m/s2 (circle: 6 m/s2 at its end) of the BMW 320i as their parameters have it. At 30 m/s braking raises that to
# 5.7 m/s2 by itself, and from 3 m/s2 on it locks the inner wheels.
MANOEUVRES = {
    "step_20": Manoeuvre("step", 20.0, 0.0255, 6.0),
    "step_30": Manoeuvre("step", 30.0, 0.0112, 6.0),
    "sine_20": Manoeuvre("sine", 20.0, 0.0295, 9.0),
    "sine_30": Manoeuvre("sine", 30.0, 0.0146, 9.0),
    "circle_20": Manoeuvre("circle", 20.0, 0.0388, 61.0),
    "circle_30": Manoeuvre("circle", 30.0, 0.0174, 61.0),
    "brake_20": Manoeuvre("brake", 20.0, 0.0255, 9.0, 3.5),
    "brake_30": Manoeuvre("brake", 30.0, 0.0112, 9.0, 2.0),
}


def _jump(p: Any) -> None:
    """p_hy1 and p_vy1 times sign(gamma): 2 % of the load, one way or the other, where a wheel passes upright."""
    p.tire.p_hy1 = p.tire.p_vy1 = 0.0


def _drag(p: Any) -> None:
    """p_hx1, and p_vx1 inside the sine: a drag at zero slip of 1 % of the load."""
    p.tire.p_hx1 = p.tire.p_vx1 = 0.0


def _one_sided(p: Any) -> None:
    """Shifts of combined slip, the same on both sides: they tell left from right, and give F_y at alpha = 0."""
    p.tire.r_hx1 = p.tire.r_hy1 = p.tire.r_by3 = p.tire.r_vy1 = 0.0


def _load_point(p: Any) -> None:
    """K_lt shifts the wheel load sideways by K_lt F_y."""
    p.K_lt = 0.0


def _joint(p: Any) -> None:
    """Body and axles are joined sideways by a spring and damper, which follow the tyres' force after some 0.06 s."""
    p.K_ras *= 100.0
    p.K_rad *= 10.0


QUIRKS: dict[str, Callable[[Any], None]] = {
    "jump": _jump,
    "drag": _drag,
    "one-sided": _one_sided,
    "load point": _load_point,
    "joint": _joint,
}


def reconciled(parameters: Any, quirks: Iterable[str] = tuple(QUIRKS)) -> Any:
    """A copy of their parameters without the named peculiarities, all of ``QUIRKS`` by default.

    What takes more than values is in ``CODE``; camber thrust against the lean stays, ``vehicle.commonroad.tyre`` has it
    too. KeyError for an unknown name.
    """
    p = copy.deepcopy(parameters)
    for name in quirks:
        QUIRKS[name](p)
    return p


_BALANCE = "    #dynamics common with single-track model\n"


def _before_balance(*lines: str) -> dict[str, str]:
    """Lines to run when all forces are known; SAE axes."""
    return {_BALANCE: "".join(f"    {line}\n" for line in lines) + _BALANCE}


# Lines of their code and what to put there: what their model lacks, or has otherwise than ours.
CODE: dict[str, Mapping[str, str]] = {
    # Their slip angles take the lateral speed of the sprung centre of gravity for that of the axle, without the roll
    # rate times the height between them; states 16 and 21 are the axles' own.
    "axle slip": {
        "(x[10] + p.a*x[5] - x[14]*(p.R_w - x[16]))": "(x[15] - x[14]*(p.R_w - x[16]))",
        "(x[10] - p.b*x[5] - x[19]*(p.R_w - x[21]))": "(x[20] - x[19]*(p.R_w - x[21]))",
    },
    # Yaw is balanced about the sprung centre of gravity: here about the whole car's.
    "centres": _before_balance(
        "sumY = (F_y_LF + F_y_RF)*math.cos(x[2]) + (F_x_LF + F_x_RF)*math.sin(x[2]) + F_y_LR + F_y_RR",
        "sumN -= (p.m_uf*p.a - p.m_ur*p.b)/p.m*sumY",
    ),
    # The lean of the body carries the centre of gravity out of the middle of the tracks, where F_x turns the car.
    "lean": _before_balance("sumN += sumX*math.sin(x[6])*p.m_s/p.m*(p.h_s - p.R_w)"),
    # Their wheels have no momentum of spin.
    "spin": _before_balance(
        "momentum = p.I_y_w*(x[23] + x[24] + x[25] + x[26])",
        "sumL -= x[5]*momentum",
        "sumN += x[7]*momentum",
    ),
    # Their axles are beams with a roll centre fixed in the middle. Independent wheels hand all roll moments to the
    # body, except for the load (and its shift), the springs, and what the links, along the body's y, put on the wheels.
    "beams": _before_balance(
        "Y_f = (F_y_LF + F_y_RF)*math.cos(x[2]) + (F_x_LF + F_x_RF)*math.sin(x[2])",
        "link_f = 0.5*p.T_f*math.sin(x[6])*(F_y_LF - F_y_RF) - (p.h_raf - x[16])*Y_f",
        "link_r = 0.5*p.T_r*math.sin(x[6])*(F_y_LR - F_y_RR) - (p.h_rar - x[21])*(F_y_LR + F_y_RR)",
        "shift_f = p.K_lt*(F_z_LF*F_y_LF + F_z_RF*F_y_RF)",
        "shift_r = p.K_lt*(F_z_LR*F_y_LR + F_z_RR*F_y_RR)",
        "sumL_uf = 0.5*p.T_f*(F_SRF - F_SLF + F_z_LF - F_z_RF) + link_f - shift_f",
        "sumL_ur = 0.5*p.T_r*(F_SRR - F_SLR + F_z_LR - F_z_RR) + link_r - shift_r",
        "sumL += F_RAF*(p.R_w - p.h_raf) - Y_f*(p.R_w - x[16]) - link_f",
        "sumL += F_RAR*(p.R_w - p.h_rar) - (F_y_LR + F_y_RR)*(p.R_w - x[21]) - link_r",
    ),
    # The whole F_x pitches the body at the sprung height: here the sprung share at the wheel centres, and the torques.
    "pitch": _before_balance(
        "sumM_s += p.m*p.R_w*u[1] - sumX*(p.m_s/p.m*(p.R_w - x[16]) + (1 - p.m_s/p.m)*(p.h_s - x[11]))"
    ),
}


@lru_cache
def _dynamics(code: tuple[str, ...]) -> Callable[[list[float], list[float], Any], list[float]]:
    if not code:
        return vehicle_dynamics_mb
    source = inspect.getsource(sys.modules[vehicle_dynamics_mb.__module__])
    for name in code:
        for theirs, new in CODE[name].items():
            if theirs not in source:
                raise RuntimeError(f"vehicle_dynamics_mb is not that of version 3.0.2: no line with {theirs!r}")
            source = source.replace(theirs, new)
    scope: dict[str, Any] = {}
    exec(source, scope)
    return scope["vehicle_dynamics_mb"]


def road_wheel_angle(manoeuvre: Manoeuvre, t: ArrayLike) -> tuple[Array, Array]:
    """Angle [rad] and rate [rad/s] of the front wheels over time [s], left positive.

    Step and brake: a smooth rise with a peak rate of ``STEER_RATE``; sine: grown over its first cycle; circle: a ramp
    so slow that each instant is a steady state. ValueError for another kind.
    """
    after: Array = np.maximum(np.asarray(t, float) - START, 0.0)
    if manoeuvre.kind in ("step", "brake"):
        return ramp_and_hold(after, manoeuvre.amplitude, 1.5 * abs(manoeuvre.amplitude) / STEER_RATE)
    if manoeuvre.kind == "sine":
        return sine(after, manoeuvre.amplitude, FREQUENCY)
    if manoeuvre.kind == "circle":
        slope = manoeuvre.amplitude / (manoeuvre.duration - START)
        return slope * after, np.where(after > 0.0, slope, 0.0)
    raise ValueError(f"kind must be step, sine, circle or brake, got {manoeuvre.kind!r}")


def acceleration(manoeuvre: Manoeuvre, t: float, speed: float, lost: float) -> float:
    """Commanded acceleration [m/s2]: a PI speed hold, from ``BRAKE_TIME`` on in a brake run a fixed deceleration.

    K_P (v_set - v_x) + K_I lost,   lost = integral of v_set - v_x from t = 0 [m]

    Their model turns it into torques m R_w a: if positive, on the driven axle, (1 - T_se)/2 a rear wheel; if negative,
    on all brakes, T_sb/2 a front wheel and (1 - T_sb)/2 a rear one.
    """
    held = K_P * (manoeuvre.speed - speed) + K_I * lost
    if manoeuvre.kind != "brake":
        return held
    share = float(ramp_and_hold(np.array(t - BRAKE_TIME), 1.0, BRAKE_RISE)[0])
    return (1.0 - share) * held - share * manoeuvre.braking


def _wheel_loads(p: Any, x: Array) -> Array:
    """(4, T) loads from the axles' heights and roll, as the model has them [N]."""
    loads = []
    for roll, height, track in ((x[13], x[16], p.T_f), (x[18], x[21], p.T_r)):
        middle, side = height + p.R_w * (np.cos(roll) - 1.0), 0.5 * track * np.sin(roll)
        loads += [p.K_zt * (middle - side), p.K_zt * (middle + side)]
    return np.array(loads)


_UNITS = {
    "road_wheel_angle": "rad",
    "acceleration_command": "m/s2",
    "speed": "m/s",
    "lateral_speed": "m/s",
    "yaw_rate": "rad/s",
    "longitudinal_acceleration": "m/s2",
    "lateral_acceleration": "m/s2",
    "sprung_lateral_acceleration": "m/s2",
    "roll_angle": "rad",
    "pitch_angle": "rad",
    **{f"wheel_load_{wheel}": "N" for wheel in two_track.WHEELS},
    **{f"wheel_speed_{wheel}": "rad/s" for wheel in two_track.WHEELS},
    "x": "m",
    "y": "m",
    "yaw_angle": "rad",
}


def _times(manoeuvre: Manoeuvre, dt: float) -> Array:
    return dt * np.arange(0.0, round(manoeuvre.duration / dt) + 1.0)


def _longest_step(manoeuvre: Manoeuvre) -> float:
    """Short enough to see the manoeuvre begin [s]."""
    return 0.1 if manoeuvre.kind == "circle" else 0.02


def _recording(times: Array, values: Iterable[Array], manoeuvre: Manoeuvre) -> Recording:
    meta = {"manoeuvre": manoeuvre.kind, "speed_m_s": manoeuvre.speed}
    return Recording(times, dict(zip(_UNITS, values)), _UNITS, meta)


def drive(
    parameters: Any, manoeuvre: Manoeuvre, code: Iterable[str] = (), dt: float = 0.005, tolerance: float = 1e-8
) -> Recording:
    """Drive their multi-body model.

    Parameters
    ----------
    parameters : vehiclemodels.vehicle_parameters.VehicleParameters
        Of vehicle 1, 2 or 3.
    manoeuvre : Manoeuvre
    code : iterable of str
        Names from ``CODE``: not their model, but their code with lines changed, to show what these amount to.
    dt : float
        Between the samples of the recording [s].
    tolerance : float
        Relative, of the integration (LSODA); absolute it is a hundredth of it.

    Returns
    -------
    Recording
        Channels in SI and ISO 8855, as ``_UNITS`` names them. ``speed`` and ``lateral_speed`` belong to the sprung
        centre of gravity, along the body's x and y. ``lateral_acceleration`` is the sum of the tyres' forces along y
        over the whole mass; ``sprung_lateral_acceleration`` is v_y' + v_x r. Roll is positive to the right, pitch nose
        down.

    Raises
    ------
    KeyError
        An unknown name of code.
    RuntimeError
        A wheel locks, or the integration fails, with the solver's reason.
    """
    p, dynamics = parameters, _dynamics(tuple(code))

    def derivative(t: float, state: Any) -> list[float]:
        x = state.tolist()
        lost = x.pop()
        angle, rate = road_wheel_angle(manoeuvre, t)
        x[2] = -float(angle)
        u = [-float(rate), acceleration(manoeuvre, t, x[3], lost)]
        return [*dynamics(x, u, p), manoeuvre.speed - x[3]]

    times = _times(manoeuvre, dt)
    start = [*init_mb([0.0, 0.0, 0.0, manoeuvre.speed, 0.0, 0.0, 0.0], p), 0.0]

    def grip(t: float, x: Any) -> float:
        return p.R_w * min(x[23:27]) - 0.5 * x[3]

    grip.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        derivative,
        (0.0, times[-1]),
        start,
        "LSODA",
        times,
        events=grip,
        max_step=_longest_step(manoeuvre),
        rtol=tolerance,
        atol=0.01 * tolerance,
    )
    if run.t.size < times.size:
        reason = "a wheel locks" if run.success else run.message
        raise RuntimeError(f"{manoeuvre} on CommonRoad's model ends after {run.t[-1]:g} s: {reason}")
    x = run.y
    rates = np.array([derivative(t, state) for t, state in zip(times, x.T)]).T
    angle = road_wheel_angle(manoeuvre, times)[0]
    # The forces of joints and springs are internal: what the masses gain is what the tyres give.
    v_x, r = x[3], x[5]
    sideways = [m * (rates[i] + v_x * r) for m, i in ((p.m_s, 10), (p.m_uf, 15), (p.m_ur, 20))]
    command = [acceleration(manoeuvre, t, v, lost) for t, v, lost in zip(times, v_x, x[29])]
    values = [
        *(angle, command, v_x, -x[10], -r),
        *(rates[3] - r * x[10], -sum(sideways) / p.m, -(rates[10] + v_x * r)),
        *(x[6], -x[8]),
        *_wheel_loads(p, x),
        *x[23:27],
        *(x[0], -x[1], -x[4]),
    ]
    return _recording(times, values, manoeuvre)


_PER_RACK = 6.0  # road-wheel angle by rack, any [rad/m]
_FULL = 12.0  # acceleration that full throttle and full pedal stand for, any beyond what is commanded [m/s2]


def _two_track(p: Any, speed: float, relaxation_length: float) -> tuple[two_track.TwoTrack, strut_map.StrutMap, Any]:
    """Our car with their parameters, its tyre as a record last; what their model has no counterpart of is off.

    Their car sinks by the static compression of its tyres, which the heights do not count: h_s, the wheel centres and
    the roll centres with them, each axle's its own. The wheels' R_w stays the lever of torques and slip.
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
        tyre=commonroad.tyre(p, relaxation_length),
        strut=MacPherson(car.strut.points, p.R_w - sunk),
        chassis=car.chassis | {"sprung_height": p.h_s - sunk, "rear_roll_centre": p.h_rar - sunk_r},
    ).plant(speed=speed, chassis="two_track")
    body = two_track.Body(*plant.chassis.body[0].tolist())
    body = body._replace(
        R_e=p.R_w,
        # a strut that is the travel itself, instead of the solved one
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
    torsion = make_law("dahl", sigma_0=1e-4, F_c=1e-6)  # nothing, with the usual twist
    strut = strut_map.linear(_PER_RACK, -p.D_f, 2.0 * (p.h_raf - sunk_f) / p.T_f)
    return plant.chassis._replace(body=record(body), torsion=torsion), strut, plant.tyre[0]


def drive_two_track(
    parameters: Any,
    manoeuvre: Manoeuvre,
    relaxation_length: float = 0.03,
    dt: float = 0.005,
    tolerance: float = 1e-6,
) -> Recording:
    """Drive our two tracks with their parameters; channels as in :func:`drive`.

    Parameters
    ----------
    parameters, manoeuvre, dt
        As in :func:`drive`.
    relaxation_length : float
        Of our tyres, short: theirs have none [m].
    tolerance : float
        Relative, of the integration (LSODA); absolute it is a hundredth of it.

    Raises
    ------
    RuntimeError
        The integration fails, with the solver's reason.
    """
    p = parameters
    car, strut, tyre = _two_track(p, manoeuvre.speed, relaxation_length)
    x_s = -2.0 * (car.body.m_f[0] * car.body.a[0] - car.body.m_r[0] * car.body.b[0]) / p.m_s
    z_s = float((p.m - p.m_s) / p.m * (p.h_s - p.R_w))  # of the sprung centre of gravity over the whole car's
    size = len(two_track.STATES)
    dx, out, u = np.zeros(size), np.zeros(len(two_track.OUTPUTS)), np.zeros(len(INPUTS))
    u[COAST] = 1.0

    def derivative(t: float, x: Array) -> Array:
        angle, rate = road_wheel_angle(manoeuvre, t)
        a = acceleration(manoeuvre, t, x[two_track.U], x[size])
        u[THROTTLE], u[BRAKE] = max(a, 0.0) / _FULL, max(-a, 0.0) / _FULL
        two_track.derivative(car, strut, tyre, x[:size], float(angle) / _PER_RACK, float(rate) / _PER_RACK, u, dx, out)
        return np.append(dx, manoeuvre.speed - x[two_track.U])

    times = _times(manoeuvre, dt)
    start = [*two_track.start(car), 0.0]
    start[two_track.SHIFT] = -1.0  # engaged, whatever the solver rounds
    run = solve_ivp(
        derivative,
        (0.0, times[-1]),
        start,
        "LSODA",
        times,
        max_step=_longest_step(manoeuvre),
        rtol=tolerance,
        atol=0.01 * tolerance,
    )
    if not run.success:
        raise RuntimeError(f"{manoeuvre} on two tracks ends after {run.t[-1]:g} s: {run.message}")
    x, names = run.y, [name for name, _ in two_track.OUTPUTS]
    rates, outputs = zip(*((derivative(t, state), out.copy()) for t, state in zip(times, x.T)))
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
        *x[two_track.SPIN : two_track.SPIN + 4],
        *(x[two_track.X], x[two_track.Y], x[two_track.YAW]),
    ]
    return _recording(times, values, manoeuvre)


def difference(one: Recording, other: Recording, channel: str) -> float:
    """RMS of the difference over the peak of ``other`` [1]."""
    gap = one[channel] - other[channel]
    return float(np.sqrt(np.mean(gap * gap)) / np.abs(other[channel]).max())


def steady(run: Recording, parameters: Any) -> dict[str, float]:
    """Values at the end of a run; of a sine, half the span over its last two cycles.

    Yaw rate [rad/s], lateral acceleration [m/s2], roll and side-slip angle at the sprung centre of gravity [rad], wheel
    loads [N]; of a circle, its road-wheel angle over that of a neutral car, (a + b) r/v, as well [1].
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
        """Whether all marks are kept."""
        worst = max(abs(gap) for _, _, gap in self.steady.values())
        return worst <= MARK_STEADY and max(self.rms.values()) <= MARK_RMS


def _comparison(ours: Recording, theirs: Recording, parameters: Any) -> Comparison:
    one, other = steady(ours, parameters), steady(theirs, parameters)
    # A side-slip angle passes through zero as the speed rises; its difference counts by the road-wheel angle then.
    floor = {"sideslip_angle": float(np.abs(theirs["road_wheel_angle"]).max())}
    values = {
        name: (one[name], value, (one[name] - value) / max(abs(value), floor.get(name, 0.0)))
        for name, value in other.items()
    }
    rms = {channel: difference(ours, theirs, channel) for channel in ("yaw_rate", "lateral_acceleration")}
    return Comparison(ours, theirs, values, rms)


def compare(manoeuvre: Manoeuvre, parameters: Any = None, dt: float = 0.01) -> dict[str, Comparison]:
    """Our two tracks with their parameters (of vehicle 2 unless given) against their model.

    Returns
    -------
    dict of str to Comparison
        ``published``: their model as it is. ``reconciled``: with all of ``QUIRKS`` and ``CODE``. Ours is the same run.
    """
    p = setup_vehicle_parameters(vehicle_id=2) if parameters is None else parameters
    ours = drive_two_track(p, manoeuvre, dt=dt)
    return {
        "published": _comparison(ours, drive(p, manoeuvre, dt=dt), p),
        "reconciled": _comparison(ours, drive(reconciled(p), manoeuvre, CODE, dt), p),
    }


def alone(manoeuvre: Manoeuvre, parameters: Any, dt: float = 0.01) -> dict[str, tuple[float, float, float]]:
    """What each switch does by itself, put back into the reconciled model.

    Returns
    -------
    dict of str to (float, float, float)
        RMS over peak of the change in yaw rate and lateral acceleration, and the largest relative change of the steady
        values, side-slip apart [1].
    """
    plain = drive(reconciled(parameters), manoeuvre, CODE, dt)
    base = steady(plain, parameters)
    changes = {}
    for name in (*QUIRKS, *CODE):
        p = reconciled(parameters, [quirk for quirk in QUIRKS if quirk != name])
        run = drive(p, manoeuvre, [code for code in CODE if code != name], dt)
        ends = steady(run, parameters)
        moved = max(abs(value / base[key] - 1.0) for key, value in ends.items() if key != "sideslip_angle")
        changes[name] = (difference(run, plain, "yaw_rate"), difference(run, plain, "lateral_acceleration"), moved)
    return changes


@matplotlib.rc_context(STYLE)
def figure(results: Mapping[str, dict[str, Comparison]]) -> Figure:
    """Yaw rate and lateral acceleration of both models, a row each and speed, a column a manoeuvre of ``results``."""
    names = sorted(results, key=list(MANOEUVRES).index)
    kinds = list(dict.fromkeys(MANOEUVRES[name].kind for name in names))
    speeds = sorted({MANOEUVRES[name].speed for name in names})
    drawing = Figure(figsize=(9.6, 3.6 * len(speeds)), layout="constrained")
    grid = drawing.subplots(2 * len(speeds), len(kinds), sharex="col", sharey="row", squeeze=False)
    for name in names:
        manoeuvre, result = MANOEUVRES[name], results[name]
        lines = (
            (result["published"].theirs, "CommonRoad as published", {"color": "#D55E00", "linewidth": 1.0}),
            (result["reconciled"].theirs, "CommonRoad reconciled", {"color": "#000000", "linewidth": 1.0}),
            (result["published"].ours, "two tracks", {"color": "#0072B2", "linestyle": (0, (3, 2)), "linewidth": 2.0}),
        )
        row, column = 2 * speeds.index(manoeuvre.speed), kinds.index(manoeuvre.kind)
        over_angle = manoeuvre.kind == "circle"
        for run, label, style in lines:
            x = run["road_wheel_angle"] / DEGREE if over_angle else run.time
            grid[row, column].plot(x, run["yaw_rate"] / DEGREE, label=label, **style)
            grid[row + 1, column].plot(x, run["lateral_acceleration"], label=label, **style)
        grid[row, column].set_title(f"{manoeuvre.kind}, {manoeuvre.speed:g} m/s")
        grid[-1, column].set_xlabel("road-wheel angle [deg]" if over_angle else "time [s]")
        grid[row, 0].set_ylabel("yaw rate [deg/s]")
        grid[row + 1, 0].set_ylabel("lateral acc. [m/s²]")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside upper center", ncols=3)
    return drawing


def _rows(name: str, result: Mapping[str, Comparison]) -> Iterator[str]:
    for which, comparison in result.items():
        verdict = "pass" if comparison.passed else "explained" if result["reconciled"].passed else "FAIL"
        gaps = {key: gap for key, (*_, gap) in comparison.steady.items()}
        loads = [gaps.pop(f"wheel_load_{wheel}") for wheel in two_track.WHEELS]
        gaps.pop("understeer", None)  # that of the yaw rate, turned over
        cells = [f"{100.0 * gap:.2f}" for gap in comparison.rms.values()]
        cells += [f"{100.0 * gap:+.2f}" for gap in (*gaps.values(), max(loads, key=abs))]
        yield f"| {name} | {which} | {' | '.join(cells)} | {verdict} |"


def main() -> int:
    """Print both comparisons, then what each difference does by itself; exit code 1 where a mark is missed."""
    p = setup_vehicle_parameters(vehicle_id=2)
    results = {name: compare(manoeuvre, p) for name, manoeuvre in MANOEUVRES.items()}
    print(f"Two tracks against CommonRoad [%]; marks: {100 * MARK_RMS:g} RMS, {100 * MARK_STEADY:g} steady values\n")
    print("| manoeuvre | theirs | RMS yaw rate | RMS a_y | yaw rate | a_y | roll | side-slip | wheel loads | |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, result in results.items():
        print(*_rows(name, result), sep="\n")
    print("\nEach difference alone [%]: RMS of yaw rate / of a_y / largest change of a steady value but side-slip\n")
    print(f"| manoeuvre | {' | '.join((*QUIRKS, *CODE))} |")
    print("|---" * (1 + len(QUIRKS) + len(CODE)) + "|")
    for name, manoeuvre in MANOEUVRES.items():
        cells = (" / ".join(f"{100.0 * value:.1f}" for value in values) for values in alone(manoeuvre, p).values())
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
    return 0 if all(result["reconciled"].passed for result in results.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
