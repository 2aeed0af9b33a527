"""CommonRoad's multi-body model as an oracle: the manoeuvres of the comparison, and its answers in our signs.

``vehiclemodels.vehicle_dynamics_mb`` has 29 states: body, two axles joined to it by springs, and four wheels, on
steady-state Magic Formula tyres. Its axes are SAE (y right, z down, nose up positive); everything here is ISO 8855.

    python -m experiments.commonroad

prints what each peculiarity of the model (``QUIRKS``, and the slip of the axles) does to each manoeuvre.

Source: commonroad-vehicle-models 3.0.2 (BSD). Its bounds of 0.4 rad/s of steering and 11.5 m/s2 are not reached here.
"""

import copy
import inspect
import sys
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from vehiclemodels.init_mb import init_mb
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from steer_env.manoeuvres import ramp_and_hold, sine
from steer_env.recording import Recording

Array = NDArray[np.float64]

START = 1.0  # straight ahead until then: their initial state is not quite at rest [s]
STEER_RATE = 0.3  # peak, of the front wheels in a step [rad/s]
FREQUENCY = 0.5  # of the sine [Hz]
BRAKE_TIME, BRAKE_RISE = 6.0, 0.2  # start and rise of braking [s]
K_P, K_I = 2.0, 1.0  # of the speed hold [1/s], [1/s2]


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


def _centres(p: Any) -> None:
    """Yaw is balanced about the sprung centre of gravity, which is not the whole car's unless the axles weigh so."""
    unsprung = p.m - p.m_s
    p.m_uf = unsprung * p.b / (p.a + p.b)
    p.m_ur = unsprung - p.m_uf


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
    "centres": _centres,
    "load point": _load_point,
    "joint": _joint,
}


def reconciled(parameters: Any, quirks: Iterable[str] = tuple(QUIRKS)) -> Any:
    """A copy of their parameters without the named peculiarities, all of ``QUIRKS`` by default.

    What values cannot remove: camber thrust against the lean (``vehicle.commonroad.tyre`` has it too), the axles' slip
    taken with the body's lateral speed (see :func:`drive`), and a pitch moment of the whole F_x at the sprung height.
    KeyError for an unknown name.
    """
    p = copy.deepcopy(parameters)
    for name in quirks:
        QUIRKS[name](p)
    return p


# Their slip angles take the lateral speed of the sprung centre of gravity for that of the axle, without the roll rate
# times the height between them; states 16 and 21 are the axles' own.
_AXLE_SLIP = {
    "(x[10] + p.a*x[5] - x[14]*(p.R_w - x[16]))": "(x[15] - x[14]*(p.R_w - x[16]))",
    "(x[10] - p.b*x[5] - x[19]*(p.R_w - x[21]))": "(x[20] - x[19]*(p.R_w - x[21]))",
}


@lru_cache
def _dynamics(axle_slip: bool) -> Callable[[list[float], list[float], Any], list[float]]:
    if not axle_slip:
        return vehicle_dynamics_mb
    source = inspect.getsource(sys.modules[vehicle_dynamics_mb.__module__])
    for theirs, own in _AXLE_SLIP.items():
        if source.count(theirs) != 2:
            raise RuntimeError(f"vehicle_dynamics_mb is not that of version 3.0.2: no two lines with {theirs}")
        source = source.replace(theirs, own)
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


_WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
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
    **{f"wheel_load_{wheel}": "N" for wheel in _WHEELS},
    **{f"wheel_speed_{wheel}": "rad/s" for wheel in _WHEELS},
    "x": "m",
    "y": "m",
    "yaw_angle": "rad",
}


def drive(
    parameters: Any, manoeuvre: Manoeuvre, axle_slip: bool = False, dt: float = 0.005, tolerance: float = 1e-8
) -> Recording:
    """Drive their multi-body model.

    Parameters
    ----------
    parameters : vehiclemodels.vehicle_parameters.VehicleParameters
        Of vehicle 1, 2 or 3.
    manoeuvre : Manoeuvre
    axle_slip : bool
        Whether slip angles take the axles' own lateral speed. That is not their model, but their code with four lines
        changed: it shows what the body's speed at its centre of gravity, which they take, amounts to.
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
    RuntimeError
        A wheel locks, or the integration fails, with the solver's reason.
    """
    p, dynamics = parameters, _dynamics(axle_slip)

    def derivative(t: float, state: Any) -> list[float]:
        x = state.tolist()
        lost = x.pop()
        angle, rate = road_wheel_angle(manoeuvre, t)
        x[2] = -float(angle)
        u = [-float(rate), acceleration(manoeuvre, t, x[3], lost)]
        return [*dynamics(x, u, p), manoeuvre.speed - x[3]]

    times: Array = dt * np.arange(0.0, round(manoeuvre.duration / dt) + 1.0)
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
        max_step=0.02,  # short enough to see the manoeuvre begin
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
    return Recording(
        times, dict(zip(_UNITS, values)), _UNITS, {"manoeuvre": manoeuvre.kind, "speed_m_s": manoeuvre.speed}
    )


def difference(one: Recording, other: Recording, channel: str) -> float:
    """RMS of the difference over the peak of ``other`` [1]."""
    gap = one[channel] - other[channel]
    return float(np.sqrt(np.mean(gap * gap)) / np.abs(other[channel]).max())


def main() -> None:
    """Print, for every manoeuvre, what each peculiarity adds to yaw rate and lateral acceleration."""
    p = setup_vehicle_parameters(vehicle_id=2)
    print("RMS over peak of yaw rate and lateral acceleration, against the reconciled model [%]")
    for name, manoeuvre in MANOEUVRES.items():
        plain = drive(reconciled(p), manoeuvre)
        runs = {quirk: drive(reconciled(p, set(QUIRKS) - {quirk}), manoeuvre) for quirk in QUIRKS}
        runs |= {"axle slip": drive(reconciled(p), manoeuvre, axle_slip=True), "as it is": drive(p, manoeuvre)}
        for quirk, run in runs.items():
            gaps = (100.0 * difference(run, plain, channel) for channel in ("yaw_rate", "lateral_acceleration"))
            print(f"{name:10s} {quirk:10s}", *(f"{gap:6.2f}" for gap in gaps))


if __name__ == "__main__":
    main()
