"""Drivers of one kind, one for each row of a batch: in the loop of assist environments, or as controllers."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.drivers.common.definition import (
    MEMORY,
    Arm,
    Driver,
    delayed_error,
    gains_of,
    muscle_matrices,
    neuromuscular_step,
    resolve,
)
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.timing import SAMPLES_PER_UPDATE, UPDATE_INTERVAL
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import CHANNEL, Plant

Array = NDArray[np.float64]

_ANGLE, _LATERAL_SPEED, _YAW_RATE = (CHANNEL[name] for name in ("handwheel_angle", "lateral_speed", "yaw_rate"))


class DriverArrays(NamedTuple):
    """Gains and memories of the drivers; one row for each driver, except for ``muscles``."""

    gains: Array  # (n, G) of the preview model
    muscles: Array  # (3, 4) as :func:`steer_env.drivers.common.definition.muscle_matrices`
    feed_forward: Array  # (n, 2) hand torque over intended angle [N m/rad] and speed [N m s/rad]
    memory: Array  # (n, MEMORY + 1)


@kernel
def _write_hand_torque(preview_model, drivers, reflex, episodes, channels, observations, inputs, low, high):
    """Write the next update's hand torque, without the arms' impedance, in the driven rows that are at an update."""
    for i in range(low, high):
        sample = episodes[i].sample
        if sample % SAMPLES_PER_UPDATE != 0 or episodes[i].driven == 0:
            continue
        now, memory = channels[i], drivers.memory[i]
        delayed = delayed_error(memory, memory[0] - now[_ANGLE], 1)
        angle, speed = neuromuscular_step(
            preview_model,
            drivers.gains[i],
            drivers.muscles,
            observations[i],
            now[_LATERAL_SPEED],
            now[_YAW_RATE],
            memory,
        )
        update = within(sample // SAMPLES_PER_UPDATE + 1, 0, inputs.shape[1] - 1)
        inputs[i, update, 0] = (
            drivers.feed_forward[i, 0] * angle + drivers.feed_forward[i, 1] * speed + reflex * delayed
        )


@kernel
def _hand_torque(preview_model, drivers, arm, observations, places, torque):
    """Hand torque (n,) from observations (n, O), with the arms' impedance."""
    for i in range(observations.shape[0]):
        seen, memory = observations[i], drivers.memory[i]
        angle_now, speed_now = seen[places[0]], seen[places[1]]
        delayed = delayed_error(memory, memory[0] - angle_now, 0)
        angle, speed = neuromuscular_step(
            preview_model, drivers.gains[i], drivers.muscles, seen[places[4] :], seen[places[2]], seen[places[3]],
            memory,
        )  # fmt: skip
        torque[i] = (
            drivers.feed_forward[i, 0] * angle
            + drivers.feed_forward[i, 1] * speed
            + arm.reflex * delayed
            - arm.stiffness * angle_now
            - arm.damping * speed_now
        )


class DriverBatch:
    """``n`` drivers of one kind.

    Parameters
    ----------
    driver : Driver
    car : Car
    n : int
    stiffness : speed [m/s] -> steering stiffness [N m/rad]
        Hand torque over handwheel angle in a steady turn, from which the drivers take their feed-forward.

    Attributes
    ----------
    driver : Driver
    arrays : DriverArrays
    """

    def __init__(self, driver: Driver, car: Car, n: int, stiffness: Callable[[float], float]) -> None:
        self.driver, self._car, self._stiffness = driver, car, stiffness
        self._designs: dict[float, tuple[Array, float]] = {}
        self.arrays = DriverArrays(np.zeros((n, 0)), muscle_matrices(), np.zeros((n, 2)), np.zeros((n, MEMORY + 1)))
        self._kernel: Callable[..., None] | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_kernel": None}  # a compiled function cannot be pickled; it is looked up again

    def size_gains(self, size: int) -> None:
        """Make room for the gains of the preview model, whose number the first design tells."""
        if self.arrays.gains.shape[1] != size:
            self.arrays = self.arrays._replace(gains=np.zeros((len(self.arrays.memory), size)))

    def start(self, i: int, speed: float) -> None:
        """Begin an episode of driver ``i`` at a speed [m/s]; the driver knows the car at the nearest whole m/s."""
        arm, known = self.driver.arm, max(round(speed), 3.0)
        if known not in self._designs:
            steering = self._stiffness(known) if arm.stiffness > 0.0 else 0.0
            self._designs[known] = gains_of(self.driver, self._car, known), steering
        gains, steering = self._designs[known]
        self.size_gains(gains.size)
        arrays = self.arrays
        arrays.gains[i] = gains
        arrays.feed_forward[i] = arm.stiffness + steering, arm.damping
        arrays.memory[i] = 0.0

    def write_hand_torque(
        self, episodes: Any, channels: Array, observations: Array, inputs: Array, low: int, high: int
    ) -> None:
        """In the loop: write the hand torque of the next update as the first of the scripted ``inputs`` (n, U, M).

        The arrays are those of :class:`steer_env.batch_arrays.BatchArrays`; the rows are ``low`` to ``high`` - 1.
        """
        arrays, reflex = self.arrays, self.driver.arm.reflex
        arguments = self.driver.preview_model, arrays, reflex, episodes, channels, observations, inputs, low, high
        if self._kernel is None:
            self._kernel = bind(_write_hand_torque, *arguments)
        self._kernel(*arguments)

    def torque(self, observations: Array, places: NDArray[np.int64]) -> Array:
        """As controllers: hand torque (n,) [N m] from observations (n, O).

        ``places`` are those of handwheel angle and speed, lateral speed, yaw rate and lateral offset; the rest of the
        path's observations follows the last.
        """
        torque = np.zeros(len(observations))
        _hand_torque(self.driver.preview_model, self.arrays, self.driver.arm, observations, places, torque)
        return torque


def with_arms(p: Plant, arm: Arm) -> Plant:
    """The plant with arms on its handwheel."""
    return p._replace(column=p.column._replace(I_arm=arm.inertia, C_arm=arm.damping, K_arm=arm.stiffness), robot=0.0)


class Controller:
    """A driver model that acts in a driver environment, single or vector, from the environment's observations.

    Parameters
    ----------
    env : gym.Env or gym.vector.VectorEnv
        Of a task that observes a path, with ``control_dt`` of 10 ms.
    driver : str or Driver
        One of ``steer_env.drivers.available()``, or from ``steer_env.drivers.make``.

    Raises
    ------
    ValueError
        No driver model can act in this environment.
    """

    def __init__(self, env: Any, driver: Any = "preview") -> None:
        batch = env.unwrapped.batch
        task, names = batch.task, [quantity.name for quantity in batch.observed]
        needed = ("handwheel_angle", "handwheel_speed", "lateral_speed", "yaw_rate", "lateral_offset")
        if any(name not in names for name in needed) or task.driver_in_loop:
            raise ValueError(
                f"no driver model can act in {task.name}: a driver needs an observed path, and a hand torque as action"
            )
        if batch.control_dt != UPDATE_INTERVAL:
            raise ValueError(
                f"driver models act every 10 ms; make the environment with control_dt=0.01, not {batch.control_dt}"
            )
        self._places = np.array([names.index(name) for name in needed])
        self._speed = names.index("speed")
        self._scale = task.action.scale
        self._drivers = DriverBatch(resolve(driver), batch.car, batch.n, batch.steering_stiffness)
        self._new = np.ones(batch.n, bool)

    def reset(self, rows: Any = slice(None)) -> None:
        """Forget the episodes of some sub-environments (mask or indices), or of all."""
        self._new[rows] = True

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Action (1,) for an observation (O,), or (n, 1) for (n, O)."""
        observations = np.atleast_2d(observation).astype(float)
        for i in np.flatnonzero(self._new).tolist():
            self._drivers.start(i, observations[i, self._speed])
        self._new[:] = False
        torque = self._drivers.torque(observations, self._places)
        action = np.clip(torque / self._scale, -1.0, 1.0).astype(np.float32)
        return action if observation.ndim == 1 else action[:, None]
