"""Manoeuvres of the cross-validation against CommonRoad: the road-wheel angle and acceleration of both models."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.manoeuvres.common.shapes import ramp_and_hold, sine
from steer_env.recording.recording import Recording
from steer_env.vehicle.chassis import two_track

Array = NDArray[np.float64]

START = 1.0  # straight ahead until then, as their initial state is not quite at rest [s]
STEER_RATE = 0.3  # peak rate of the front wheels in a step [rad/s]
FREQUENCY = 0.5  # of the sine [Hz]
BRAKE_TIME, BRAKE_RISE = 6.0, 0.2  # start and rise of braking [s]
K_P, K_I = 2.0, 1.0  # of the speed hold [1/s], [1/s2]


class Manoeuvre(NamedTuple):
    """One run at a held speed; :func:`road_wheel_angle` and :func:`acceleration` are its inputs."""

    kind: str  # step, sine, circle or brake
    speed: float  # forward, along the body [m/s]
    amplitude: float  # of the angle of both front wheels [rad]
    duration: float  # [s]
    braking: float = 0.0  # from BRAKE_TIME on, in a brake run [m/s2]


# The amplitudes give 4 m/s2 (circle: 6 m/s2 at its end) with CommonRoad's parameters of the BMW 320i. At 30 m/s braking
# raises that to 5.7 m/s2; from 3 m/s2 of braking on it locks the inner wheels.
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


def road_wheel_angle(manoeuvre: Manoeuvre, t: ArrayLike) -> tuple[Array, Array]:
    """Angle [rad] and rate [rad/s] of the front wheels over time [s], left positive.

    Step and brake: a smooth rise with a peak rate of ``STEER_RATE``. Sine: the amplitude grows over the first cycle.
    Circle: a ramp so slow that each instant is a steady state. ValueError for another kind.
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
    """Commanded acceleration [m/s2]: a PI speed hold; in a brake run a fixed deceleration from ``BRAKE_TIME`` on.

    K_P (v_set - v_x) + K_I lost,   lost = integral of v_set - v_x from t = 0 [m]

    Their model turns it into torques m R_w a. A positive one acts on the driven axle, with a share of (1 - T_se)/2 for
    each rear wheel; a negative one on all brakes, T_sb/2 for each front wheel and (1 - T_sb)/2 for each rear wheel.
    """
    held = K_P * (manoeuvre.speed - speed) + K_I * lost
    if manoeuvre.kind != "brake":
        return held
    share = float(ramp_and_hold(np.array(t - BRAKE_TIME), 1.0, BRAKE_RISE)[0])
    return (1.0 - share) * held - share * manoeuvre.braking


UNITS = {
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


def sample_times(manoeuvre: Manoeuvre, dt: float) -> Array:
    """Instants from zero to the end of the manoeuvre [s]."""
    return dt * np.arange(0.0, round(manoeuvre.duration / dt) + 1.0)


def longest_step(manoeuvre: Manoeuvre) -> float:
    """Longest step of the integration, short enough not to step over the start of the manoeuvre [s]."""
    return 0.1 if manoeuvre.kind == "circle" else 0.02


def meta(manoeuvre: Manoeuvre) -> dict[str, Any]:
    """Meta of a recording of the manoeuvre."""
    return {"manoeuvre": manoeuvre.kind, "speed_m_s": manoeuvre.speed}


def recording_of(times: Array, values: Iterable[Array], manoeuvre: Manoeuvre) -> Recording:
    """A recording of the channels of ``UNITS``, in that order."""
    return Recording(times, dict(zip(UNITS, values)), UNITS, meta(manoeuvre))
