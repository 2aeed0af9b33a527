"""Several drivers at once: in the loop of environments, or as the environment's controllers."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.courses.preview import PREVIEW_NAMES
from steer_env.drivers.common.definition import (
    MEMORY,
    OWN_MEMORY,
    TORQUE_LIMIT,
    Arm,
    Driver,
    delayed_error,
    muscle_matrices,
    neuromuscular_step,
    preview_gains,
    resolve,
)
from steer_env.drivers.common.known_torque import Response, known_torque
from steer_env.episode.randomise import Conditions
from steer_env.episode.timing import SAMPLES_PER_UPDATE, UPDATE_INTERVAL
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.held import Called, Holder, called, held
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import CHANNEL, Plant

Array = NDArray[np.float64]

_MOTION_NAMES = ("handwheel_angle", "handwheel_speed", "lateral_speed", "yaw_rate")
_ANGLE, _SPEED, _LATERAL_SPEED, _YAW_RATE = (CHANNEL[name] for name in _MOTION_NAMES)
_PATH_NAMES = ("lateral_offset", "heading_error", *PREVIEW_NAMES)
# An informed driver knows load [kg] and road friction [1] to these steps, so that a design serves many episodes.
KNOWN_LOAD, KNOWN_FRICTION = 25.0, 0.05


class DriverArrays(NamedTuple):
    """Gains and memories of the drivers; one row for each driver, except for ``muscles``."""

    gains: Array  # (n, G) of the preview model
    muscles: Array  # (3, 4) as :func:`steer_env.drivers.common.definition.muscle_matrices`
    feed_forward: Array  # (n, 5) hand torque over what ``KnownTorque`` names, with that of the arms' intention [SI]
    memory: Array  # (n, MEMORY + OWN_MEMORY)


@kernel
def _given_torque(feed_forward, intended, lateral_speed, yaw_rate):
    """Hand torque of the intended angle, speed and acceleration: T_need, and the impedance's part of the intention."""
    angle, speed, acceleration = intended
    return (
        feed_forward[0] * angle
        + feed_forward[1] * speed
        + feed_forward[2] * acceleration
        + feed_forward[3] * lateral_speed
        + feed_forward[4] * yaw_rate
    )


@kernel
def write_hand_torque(arguments, what, low, high):
    """Write the next update's hand torque in the driven rows that are at an update, as the first scripted input.

    It is without the arms' impedance to the handwheel, which is in the plant, but limited so that both together are at
    most ``TORQUE_LIMIT`` if the handwheel moves on as it does. ``arguments`` are those of :meth:`DriverBatch.called`.
    """
    preview_model, drivers, arm, episodes, channels, observations, inputs = held(arguments)
    for i in range(low, high):
        sample = episodes[i].sample
        if sample % SAMPLES_PER_UPDATE != 0 or episodes[i].driven == 0:
            continue
        now, memory = channels[i], drivers.memory[i]
        v_y, r = now[_LATERAL_SPEED], now[_YAW_RATE]
        delayed = delayed_error(memory, memory[0] - now[_ANGLE], 1)
        intended = neuromuscular_step(
            preview_model, drivers.gains[i], drivers.muscles, observations[i], v_y, r, memory
        )  # fmt: skip
        update = within(sample // SAMPLES_PER_UPDATE + 1, 0, inputs.shape[1] - 1)
        given = _given_torque(drivers.feed_forward[i], intended, v_y, r) + arm.reflex * delayed
        impedance = arm.stiffness * now[_ANGLE] + arm.damping * now[_SPEED]
        inputs[i, update, 0] = within(given, impedance - TORQUE_LIMIT, impedance + TORQUE_LIMIT)


@kernel
def _hand_torque(preview_model, drivers, arm, motion, paths, updates, torque):
    """Hand torque (n,) some updates from now, with the arms' impedance to the angle that is expected then."""
    for i in range(torque.size):
        angle_now, speed_now, v_y, r = motion[i, 0], motion[i, 1], motion[i, 2], motion[i, 3]
        memory, given = drivers.memory[i], 0.0
        for _ in range(updates):
            delayed = delayed_error(memory, memory[0] - angle_now, 0)
            intended = neuromuscular_step(
                preview_model, drivers.gains[i], drivers.muscles, paths[i], v_y, r, memory
            )  # fmt: skip
            given = _given_torque(drivers.feed_forward[i], intended, v_y, r) + arm.reflex * delayed
        expected = angle_now + updates * UPDATE_INTERVAL * speed_now
        whole = given - arm.stiffness * expected - arm.damping * speed_now
        torque[i] = within(whole, -TORQUE_LIMIT, TORQUE_LIMIT)


class DriverBatch:
    """``n`` drivers of one kind.

    Parameters
    ----------
    driver : Driver
    car : Car
    n : int
    response : Response
        Of the car to a sine of the handwheel angle, from which the drivers know the torque that a motion needs.
    usual : Conditions
        What a driver takes for granted who is not informed.
    updates : int, optional
        As controllers: the number of updates of 10 ms from one decision to the next. The arms are then as firm as
        :func:`decided_arm` allows.

    Attributes
    ----------
    driver : Driver
    arm : Arm
    arrays : DriverArrays
    """

    def __init__(
        self,
        driver: Driver,
        car: Car,
        n: int,
        response: Response,
        usual: Conditions,
        updates: int | None = None,
    ) -> None:
        self.driver, self._car, self._response, self._usual = driver, car, response, usual
        self._updates = updates
        self.arm = driver.arm if updates is None else decided_arm(driver.arm, car, updates * UPDATE_INTERVAL)
        self._designs: dict[tuple[float, float, float], tuple[Array, Array]] = {}  # by speed, load and road friction
        self.arrays = DriverArrays(
            np.zeros((n, 0)), muscle_matrices(), np.zeros((n, 5)), np.zeros((n, MEMORY + OWN_MEMORY))
        )
        self._holder: Holder | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_holder": None, "_held": None}  # addresses stay in their process

    def size_gains(self, size: int) -> None:
        """Make room for the gains of the preview model, whose number the first design tells."""
        if self.arrays.gains.shape[1] != size:
            self.arrays = self.arrays._replace(gains=np.zeros((len(self.arrays.memory), size)))

    def start(self, i: int, drawn: Conditions) -> None:
        """Begin an episode of driver ``i`` in its conditions.

        A driver knows the speed to 1 m/s; an informed one also the load, to ``KNOWN_LOAD``, and the road's friction, to
        ``KNOWN_FRICTION``.
        """
        told = drawn if self.driver.informed else self._usual
        known = (
            max(float(round(drawn.speed)), 3.0),
            KNOWN_LOAD * round(told.load / KNOWN_LOAD),
            KNOWN_FRICTION * round(told.road_friction / KNOWN_FRICTION),
        )
        if known not in self._designs:
            self._designs[known] = self._design(*known)
        gains, feed_forward = self._designs[known]
        self.size_gains(gains.size)
        arrays = self.arrays
        arrays.gains[i], arrays.feed_forward[i], arrays.memory[i] = gains, feed_forward, 0.0

    def _design(self, speed: float, load: float, road_friction: float) -> tuple[Array, Array]:
        """Gains of the preview model, and the row of ``feed_forward``."""
        arm, car = self.arm, self._car.loaded(load)
        gains = preview_gains(self.driver, car, speed, road_friction)
        if arm.stiffness == 0.0:
            return gains, np.zeros(5)
        conditions = self._usual._replace(speed=speed, load=load, road_friction=road_friction)
        needed = np.array(known_torque(car, conditions, self._response))
        # Arms in the loop are part of the plant's inertia; those of a controller are not.
        inertia = arm.inertia if self._updates is None else 0.0
        return gains, needed + np.array([arm.stiffness, arm.damping, inertia, 0.0, 0.0])

    def called(self, episodes: Any, channels: Array, observations: Array, inputs: Array) -> Called:
        """In the loop: what writes hand torques into the scripted ``inputs`` (n, U, M).

        The arrays are those of :class:`steer_env.engine.arrays.BatchArrays`.
        """
        model, own, arm = self.driver.preview_model, self.arrays, self.arm
        arguments = model, own, arm, episodes, channels, observations, inputs
        self._holder = self._holder or Holder(*arguments)
        self._held = self._holder(*arguments)
        return called(write_hand_torque, self._held)

    def torque(self, motion: Array, paths: Array) -> Array:
        """As controllers: the hand torque (n,) at the next decision [N m].

        ``motion`` (n, 4) are handwheel angle and speed, lateral speed and yaw rate, ``paths`` (n, 17) lateral offset,
        heading error and the points ahead.
        """
        torque = np.zeros(len(motion))
        _hand_torque(self.driver.preview_model, self.arrays, self.arm, motion, paths, self._updates or 1, torque)
        return torque


def decided_arm(arm: Arm, car: Car, interval: float) -> Arm:
    """The arms as firm as a torque may imitate that is decided once in an interval h [s] and reached at its end.

    Its stiffness acts on the angle that the present speed leads to, and so has no lag to first order: at most 40 % of
    what would take all damping of column and motor away with the lag h. A damping acts on the handwheel against the
    torsion bar and cannot look ahead: at most I1/(4 h). Both shares were chosen by the double lane change.
    """
    column = car.column
    steering = column.C1 + column.C2 + float(car.assist.damping.min())
    stiffness, damping = steering / (2.5 * interval), column.I1 / (4.0 * interval)
    return arm._replace(stiffness=min(arm.stiffness, stiffness), damping=min(arm.damping, damping))


def with_arms(p: Plant, arm: Arm) -> Plant:
    """The plant with arms on its handwheel."""
    return p._replace(column=p.column._replace(I_arm=arm.inertia, C_arm=arm.damping, K_arm=arm.stiffness), robot=0.0)


class Controller:
    """A driver model that acts in a driver environment, single or vector, from the environment's observations.

    The driver runs at its own 10 ms inside, on the observation that the environment holds, and its torque at the end of
    the control interval is the action, which the hands reach then. An informed driver takes the drawn load from the
    environment itself.

    Parameters
    ----------
    env : gym.Env or gym.vector.VectorEnv
        Of a task that observes a path, with a ``control_dt`` that is a multiple of 10 ms. A torque that is decided so
        often cannot imitate arms of any firmness, as :func:`decided_arm` tells; up to 50 ms drivers follow a path about
        as well as at 10 ms.
    driver : str, mapping or Driver
        In a form of ``steer_env.drivers.resolve``.

    Raises
    ------
    ValueError
        No driver model can act in this environment.
    """

    def __init__(self, env: Any, driver: Any = "preview") -> None:
        self._batch = batch = env.unwrapped.batch
        task, names = batch.task, [quantity.name for quantity in batch.observed]
        if task.driver_in_loop or not {*_MOTION_NAMES, *_PATH_NAMES} <= {*names}:
            raise ValueError(
                f"no driver model can act in {task.name}: a driver needs an observed path, and a hand torque as action"
            )
        updates = round(batch.control_dt / UPDATE_INTERVAL)
        if abs(updates * UPDATE_INTERVAL - batch.control_dt) > 1e-9 or updates < 1:
            raise ValueError(
                "driver models act every 10 ms; make the environment with a multiple of it as control_dt, not"
                f" {batch.control_dt}"
            )
        self._motion, self._path = (
            np.array([names.index(name) for name in wanted]) for wanted in (_MOTION_NAMES, _PATH_NAMES)
        )
        self._observation_scale = getattr(env.unwrapped, "observation_scale", 1.0)
        self._scale = task.action.scale
        self._drivers = DriverBatch(
            resolve(driver), batch.car, batch.n, batch.steering_response, batch.usual_conditions, updates
        )
        self._new = np.ones(batch.n, bool)

    def reset(self, rows: Any = slice(None)) -> None:
        """Forget the episodes of some sub-environments (mask or indices), or of all."""
        self._new[rows] = True

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Action (1,) for an observation (O,), or (n, 1) for (n, O)."""
        seen = np.atleast_2d(observation).astype(float) * self._observation_scale
        for i in np.flatnonzero(self._new).tolist():
            self._drivers.start(i, self._batch.conditions[i])
        self._new[:] = False
        torque = self._drivers.torque(seen[:, self._motion], seen[:, self._path])
        action = np.clip(torque / self._scale, -1.0, 1.0).astype(np.float32)
        return action if observation.ndim == 1 else action[:, None]
