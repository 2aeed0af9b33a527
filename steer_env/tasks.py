"""Tasks: what the action means, what is observed, how a step is rewarded and when an episode ends.

The environment owns the plant and the clock; a task owns only its episode's case: path, disturbances, amplitude.
Each task declares its observations once, with unit and bound; the environment clips to the bounds.
"""

import math
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from friction.check import number
from friction.kernel import bind, kernel
from steer_env import manoeuvres, path
from steer_env.targets import ReferenceFeel
from vehicle.assist import SAMPLE_TIME
from vehicle.chassis import ASSIST_REQUEST, HAND, INPUTS, RACK_DISTURBANCE, WIND_FORCE, WIND_MOMENT

Array = NDArray[np.float64]


class Observation(NamedTuple):
    """One observed quantity."""

    name: str
    unit: str
    bound: float  # the space spans +- this


class Task(Protocol):
    """What :class:`steer_env.env.SteerEnv` asks of a task."""

    robot: ClassVar[bool]  # handwheel angle prescribed, or hand torque
    action_input: ClassVar[int]  # the plant input that the action drives
    action_scale: ClassVar[float]  # its value at action 1
    channels: ClassVar[tuple[Observation, ...]]  # observed plant channels
    situation: ClassVar[tuple[Observation, ...]]  # observed besides, filled by ``locate``
    duration: float  # of an episode [s]

    def start(self, rng: np.random.Generator, speed: float, options: dict[str, Any]) -> Array:
        """Draw a case; rows of plant inputs for the whole episode, one a millisecond."""

    def locate(self, channels: dict[str, float], situation: Array) -> None:
        """Fill the situation in SI from the plant channels."""

    def judge(
        self, channels: dict[str, float], situation: Array, action: float, change: float, dt: float
    ) -> tuple[dict[str, float], bool]:
        """Terms of the reward for a step of ``dt`` [s], and whether the episode ends, from channels and action."""


def _allowed(options: dict[str, Any], keys: tuple[str, ...]) -> None:
    for key in options:
        if key not in keys:
            raise ValueError(f"unknown reset option {key!r}; this task takes: {', '.join(keys) or 'none'}")


@kernel
def _low_pass(noise, deviation, pole):
    """White noise of unit variance to first-order noise with a standard deviation, in place, from zero."""
    # Eight lines here save every start of an environment the 0.7 s of importing scipy.signal.
    gain = deviation * math.sqrt(1.0 - pole * pole)
    value = 0.0
    for i in range(noise.size):
        value = pole * value + gain * noise[i]
        noise[i] = value


_STEERING = (
    Observation("handwheel_angle", "rad", 12.0),
    Observation("handwheel_speed", "rad/s", 40.0),
    Observation("torsion_bar_torque", "N m", 25.0),
    Observation("lateral_acceleration", "m/s2", 20.0),
    Observation("yaw_rate", "rad/s", 3.0),
)


class LaneKeeping:
    """Drive along a winding road in crosswind and over a rough surface, by hand torque."""

    robot: ClassVar[bool] = False
    action_input: ClassVar[int] = HAND
    action_scale: ClassVar[float] = 10.0  # [N m]
    previews: ClassVar[tuple[float, ...]] = (0.0, 0.3, 0.6, 1.0, 1.5)  # [s]
    channels: ClassVar[tuple[Observation, ...]] = (*_STEERING, Observation("lateral_speed", "m/s", 30.0))
    situation: ClassVar[tuple[Observation, ...]] = (
        Observation("lateral_offset", "m", 5.0),
        Observation("heading_error", "rad", math.pi),
        *(Observation(f"curvature_{t:g}s", "1/m", 0.05) for t in previews),
    )
    lane_half_width: ClassVar[float] = 1.75  # [m]
    peak_lateral_acceleration: ClassVar[float] = 2.5  # of the road at the held speed [m/s2]
    wind_force: ClassVar[float] = 300.0  # standard deviation [N], assumed; correlated over 1 s
    wind_arm: ClassVar[float] = 0.3  # centre of pressure ahead of the centre of gravity [m], assumed
    rack_force: ClassVar[float] = 60.0  # of the road, standard deviation [N], assumed; correlated over 20 ms

    def __init__(self) -> None:
        self.duration = 30.0
        self.path: Array | None = None

    def start(self, rng: np.random.Generator, speed: float, options: dict[str, Any]) -> Array:
        _allowed(options, ())
        n = round(self.duration / SAMPLE_TIME)
        self._position = 0.0
        self._preview = speed * np.array(self.previews)
        self.path = path.winding(
            rng, speed * (self.duration + self.previews[-1]), self.peak_lateral_acceleration / speed**2
        )
        u = np.zeros((n, len(INPUTS)))
        u[:, WIND_FORCE] = self._noise(rng, n, self.wind_force, 1.0)
        u[:, WIND_MOMENT] = self.wind_arm * u[:, WIND_FORCE]
        u[:, RACK_DISTURBANCE] = self._noise(rng, n, self.rack_force, 0.02)
        out = np.zeros(len(self.situation))
        self._locate = bind(path.locate, self.path, 0.0, 0.0, 0.0, 0.0, self._preview, out)
        return u

    @staticmethod
    def _noise(rng: np.random.Generator, n: int, deviation: float, correlation: float) -> Array:
        """First-order low-pass of white noise with a given standard deviation and correlation time [s], from zero."""
        noise = rng.standard_normal(n)
        _low_pass(noise, deviation, math.exp(-SAMPLE_TIME / correlation))
        return noise

    def locate(self, channels: dict[str, float], situation: Array) -> None:
        self._position = self._locate(
            self.path, channels["x"], channels["y"], channels["yaw_angle"], self._position, self._preview, situation
        )

    def judge(
        self, channels: dict[str, float], situation: Array, action: float, change: float, dt: float
    ) -> tuple[dict[str, float], bool]:
        offset, heading = situation.item(0), situation.item(1)
        out_of_lane = abs(offset) > self.lane_half_width or abs(heading) > 0.5 * math.pi
        terms = {
            "progress": dt,
            "offset": -dt * offset * offset / 0.5**2,
            "heading": -dt * heading * heading / 0.1**2,
            "effort": -dt * 0.1 * action * action,
            "smoothness": -0.1 * change * change / (dt * 10.0**2),
            "departure": -10.0 if out_of_lane else 0.0,
        }
        return terms, out_of_lane


class Weave:
    """Shape the hand torque of an on-centre weave: a robot steers, the action adds to the boost curve."""

    robot: ClassVar[bool] = True
    action_input: ClassVar[int] = ASSIST_REQUEST
    action_scale: ClassVar[float] = 5.0  # [N m]
    channels: ClassVar[tuple[Observation, ...]] = (
        *_STEERING,
        Observation("column_speed", "rad/s", 40.0),
        Observation("motor_torque", "N m", 80.0),
    )
    situation: ClassVar[tuple[Observation, ...]] = ()
    nominal_amplitude: ClassVar[float] = math.radians(15.0)  # 2 m/s2 at 100 km/h on the compact car

    def __init__(self) -> None:
        self.duration = 20.0
        self.reference = ReferenceFeel()
        self._manoeuvre = manoeuvres.make("weave")

    def start(self, rng: np.random.Generator, speed: float, options: dict[str, Any]) -> Array:
        _allowed(options, ("amplitude",))
        drawn = self.nominal_amplitude * rng.uniform(0.8, 1.2)  # drawn either way: the same stream of numbers
        amplitude = drawn
        if "amplitude" in options:
            amplitude = number("amplitude [rad]", options["amplitude"], minimum=0.0, maximum=2.0)
        return manoeuvres.inputs(self._manoeuvre, amplitude, self.duration)

    def locate(self, channels: dict[str, float], situation: Array) -> None:
        pass

    def judge(
        self, channels: dict[str, float], situation: Array, action: float, change: float, dt: float
    ) -> tuple[dict[str, float], bool]:
        wanted = self.reference.torque(channels["lateral_acceleration"], channels["handwheel_speed"])
        terms = {
            "feel": -dt * (channels["handwheel_torque"] - wanted) ** 2,
            "effort": -dt * 0.01 * action**2,
            "smoothness": -dt * 0.01 * (change / (dt * 10.0)) ** 2,
        }
        return terms, False
