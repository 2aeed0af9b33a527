"""What a set of parameters is driven through and judged by; a scenario makes an id."""

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import manoeuvres, metrics
from steer_env.manoeuvres import Manoeuvre
from steer_env.manoeuvres.common.driving import OpenLoop, build_plant, drive_plant, open_loop
from steer_env.metrics import Value
from steer_env.randomise import Conditions
from steer_env.recording.recording import Recording
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.steering.eps import Assist

Array = NDArray[np.float64]

SPEEDS = (12.0, 50.0)  # at which every packaged car carries out the tests at the context's speed [m/s]


class Drive(NamedTuple):
    """A test that a set is driven through: the standard one of the battery, shortened by its options."""

    manoeuvre: Manoeuvre
    held: bool  # at the context's speed, else at the test's own
    every: int  # sample of 1 ms of which the metrics are read, where that changes none of them by over 5e-4


class Ready(NamedTuple):
    """A drive in a context: what is the same for every set."""

    drive: Drive  # with the context's speed and chassis
    car: Car  # with its load
    plant: Plant  # with the car's own assist
    course: OpenLoop  # with which the car's own assist reaches the test's lateral acceleration


@dataclass(frozen=True)
class Scenario:
    """A tuning task."""

    name: str  # of the id
    summary: str
    parameters: tuple[str, ...]  # of ``PARAMETERS``
    drives: tuple[Drive, ...]
    bounds: dict[str, float]  # observed metrics; the space spans +- this [unit of the metric]
    slipperiest: float  # least road friction on which every packaged car reaches the tests' accelerations [1]
    weights: dict[str, float] = field(default_factory=dict)  # of metrics in the reward where it is not one

    @property
    def tests(self) -> tuple[str, ...]:
        """Names of the tests driven."""
        return tuple(drive.manoeuvre.name for drive in self.drives)

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics that the tests give."""
        return tuple(name for test in self.tests for name in metrics.available(test))


def ready(scenario: Scenario, car: Car, chassis: str, drawn: Conditions) -> tuple[Ready, ...]:
    """The drives in a context, amplitudes found with the car's own assist.

    Every set is driven with the same handwheel angles: then sets are compared on one input, and a set costs one run.

    Raises
    ------
    ValueError
        Where the car does not reach the lateral acceleration of a test.
    """
    loaded, found = car.loaded(drawn.load), []
    for drive in scenario.drives:
        m = drive.manoeuvre
        if m.chassis == "single_track":  # else the test needs two tracks
            m = replace(m, chassis=chassis)
        if drive.held:
            m = replace(m, speed=drawn.speed)
        p = build_plant(loaded, m, drawn.friction, drawn.road_friction)._replace(friction_torque_scale=drawn.friction_level)
        found.append(Ready(drive._replace(manoeuvre=m), loaded, p, open_loop(p, m)))
    return tuple(found)


def evaluate(drives: tuple[Ready, ...], assist: Assist) -> dict[str, Value]:
    """Every metric of the drives with an assist; those of a run that diverges or spins are refused."""
    found: dict[str, Value] = {}
    for drive, car, p, prepared in drives:
        try:
            recording = drive_plant(car, p._replace(assist=assist), drive.manoeuvre, prepared)
        except ValueError as error:
            names = metrics.available(drive.manoeuvre.name)
            refused = {n: Value(np.nan, np.nan, np.nan, metrics.definition(n).unit, str(error)) for n in names}
            found |= refused
        else:
            found |= metrics.evaluate(thinned(recording, drive.every))
    return found


def thinned(recording: Recording, every: int) -> Recording:
    """Every so-manieth sample of a recording."""
    kept = {name: values[every - 1 :: every] for name, values in recording.channels.items()}
    return replace(recording, time=recording.time[every - 1 :: every], channels=kept)


def _drive(name: str, held: bool = False, every: int = 1, **options: Any) -> Drive:
    return Drive(manoeuvres.make(name, **options), held, every)


_WEAVE = _drive("weave", held=True, every=10, cycles=5)  # three settled cycles are the fewest that the metrics take
# Tyres and chassis decide these; an assist moves them little, and only by way of the torsion bar's twist.
_GIVEN = dict.fromkeys(
    (
        "steering_sensitivity_at_0p1g",
        "minimum_steering_sensitivity",
        "yaw_rate_gain",
        "yaw_lag",
        "lateral_acceleration_lag",
        "angle_hysteresis",
    ),
    0.0,
)
_ON_CENTRE_BOUNDS = {
    "torque_at_0g": 10.0,
    "torque_at_0p1g": 20.0,
    "torque_gradient_at_0g": 200.0,
    "torque_gradient_at_0p1g": 200.0,
    "torque_gradient_ratio": 5.0,
    "lateral_acceleration_at_0nm": 1.0,
    "angle_deadband": 100.0,
    "torque_deadband": 20.0,
    "steering_stiffness": 5.0,
    "peak_handwheel_torque": 25.0,
}

ON_CENTRE = Scenario(
    name="TuneOnCentre",
    summary=(
        "Tune the assist for on-centre feel: boost, damping and lead are chosen, a robot weaves at 0.2 Hz to 2 m/s2, "
        "and the metrics are held against target bands."
    ),
    parameters=("boost_level", "boost_progression", "damping_level", "lead_zero", "lead_pole"),
    drives=(_WEAVE,),
    bounds=_ON_CENTRE_BOUNDS,
    slipperiest=0.4,
    weights=_GIVEN,
)
ALL_ROUND = Scenario(
    name="TuneAllRound",
    summary=(
        "Tune the assist for a compromise: on-centre feel, free return and its overshoot, return at low speed, torque "
        "in a turn and the effort of parking, each in a test of its own, held against target bands."
    ),
    parameters=(
        "boost_level",
        "boost_progression",
        "boost_low_speed",
        "damping_level",
        "damping_low_speed",
        "lead_zero",
        "lead_pole",
    ),
    drives=(
        _WEAVE,
        _drive("release", held=True, events=2),
        _drive("returnability", events=2),
        _drive("step-steer", right=False, straight=0.0),
        _drive("parking"),
    ),
    bounds=_ON_CENTRE_BOUNDS
    | {
        "free_damping_ratio": 1.0,
        "residual_handwheel_angle": 100.0,
        "yaw_rate_after_1s": 500.0,
        "release_overshoot": 500.0,
        "handwheel_angle_after_1s": 200.0,
        "handwheel_angle_after_3s": 200.0,
        "handwheel_return_rate": 1000.0,
        "steady_step_torque": 25.0,
        "handwheel_torque_mean": 25.0,
        "handwheel_torque_peak": 25.0,
        "motor_torque_peak": 100.0,
    },
    slipperiest=0.7,
    weights=_GIVEN,
)

SCENARIOS = {scenario.name: scenario for scenario in (ON_CENTRE, ALL_ROUND)}
