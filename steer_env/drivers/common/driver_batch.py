"""Drivers side by side, one a lane: the persons of assist environments, and controllers of driver environments."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.drivers.common.definition import MEMORY, Arm, Driver, execution, gains_of, intend, late_error, resolve
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.tasks.common.definition import NODE, PER_NODE
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import CHANNEL, Plant

Array = NDArray[np.float64]

_ANGLE, _LATERAL_SPEED, _YAW_RATE = (CHANNEL[name] for name in ("handwheel_angle", "lateral_speed", "yaw_rate"))


@kernel
def _hold(eyes, gains, executed, reflex, feed, channels, situations, book, nodes, memory, low, high):
    """Hand torque beside the arms' impedance, a node ahead, of the lanes that stand at a node."""
    for i in range(low, high):
        clock = book[i].clock
        if clock % PER_NODE != 0:
            continue
        row = channels[i]
        late = late_error(memory[i], memory[i, 0] - row[_ANGLE], 1)
        angle, speed = intend(eyes, gains[i], executed, situations[i], row[_LATERAL_SPEED], row[_YAW_RATE], memory[i])
        node = within(clock // PER_NODE + 1, 0, nodes.shape[1] - 1)
        nodes[i, node, 0] = feed[i, 0] * angle + feed[i, 1] * speed + reflex * late


@kernel
def _act(eyes, gains, executed, reflex, feed, arm, seen, places, memory, out):
    """Hand torque of every lane from its observation, the arms' impedance in it."""
    for i in range(seen.shape[0]):
        angle_now, speed_now = seen[i, places[0]], seen[i, places[1]]
        late = late_error(memory[i], memory[i, 0] - angle_now, 0)
        sight = seen[i, places[4] :]
        angle, speed = intend(eyes, gains[i], executed, sight, seen[i, places[2]], seen[i, places[3]], memory[i])
        out[i] = feed[i, 0] * angle + feed[i, 1] * speed + reflex * late - arm[0] * angle_now - arm[1] * speed_now


class Crew:
    """``n`` drivers of one kind.

    Parameters
    ----------
    driver : Driver
    car : Car
    n : int
    stiffness : speed [m/s] -> steering stiffness [N m/rad]
        Hand torque over handwheel angle in a steady turn, which the drivers have learnt.
    """

    def __init__(self, driver: Driver, car: Car, n: int, stiffness: Callable[[float], float]) -> None:
        self.driver, self._car, self._stiffness = driver, car, stiffness
        self._known: dict[float, tuple[Array, float]] = {}
        self._executed = execution()
        self._memory = np.zeros((n, MEMORY + 1))
        self._feed = np.zeros((n, 2))
        self._gains: Array | None = None
        self._bound: Callable[..., None] | None = None

    def start(self, i: int, speed: float) -> None:
        """A new episode in lane ``i`` at a speed [m/s]; the driver knows the car to the nearest metre a second."""
        arm, known = self.driver.arm, max(round(speed), 3.0)
        if known not in self._known:
            held = self._stiffness(known) if arm.stiffness > 0.0 else 0.0
            self._known[known] = gains_of(self.driver, self._car, known), held
        gains, held = self._known[known]
        if self._gains is None:
            self._gains = np.zeros((len(self._memory), gains.size))
        self._gains[i] = gains
        self._feed[i] = arm.stiffness + held, arm.damping
        self._memory[i] = 0.0

    def hold(self, channels: Array, situations: Array, book: Any, nodes: Array, low: int, high: int) -> None:
        """As persons: write the hand torque of the coming node into the first column of the lanes' nodes."""
        arguments = (
            self.driver.eyes, self._gains, self._executed, self.driver.arm.reflex, self._feed, channels, situations,
            book, nodes, self._memory, low, high,
        )  # fmt: skip
        if self._bound is None:
            self._bound = bind(_hold, *arguments)
        self._bound(*arguments)

    def torque(self, seen: Array, places: NDArray[np.int64]) -> Array:
        """As controllers: hand torque (n,) [N m] from observations (n, O)."""
        out, arm = np.zeros(len(seen)), self.driver.arm
        held = np.array([arm.stiffness, arm.damping])
        _act(
            self.driver.eyes, self._gains, self._executed, arm.reflex, self._feed, held, seen, places, self._memory, out
        )
        return out


def gripped(p: Plant, arm: Arm) -> Plant:
    """The plant with arms on its handwheel."""
    return p._replace(column=p.column._replace(I_arm=arm.inertia, C_arm=arm.damping, K_arm=arm.stiffness), robot=0.0)


class Controller:
    """A driver model that acts in a driver environment, single or vector, from what it observes.

    Parameters
    ----------
    env : gym.Env or gym.vector.VectorEnv
        Of a task whose path is seen, with ``control_dt`` of 10 ms.
    driver : str or Driver
        ``steer_env.drivers.available()``, or from ``steer_env.drivers.make``.

    Raises
    ------
    ValueError
        An environment that no driver model can act in.
    """

    def __init__(self, env: Any, driver: Any = "preview") -> None:
        lanes = env.unwrapped.lanes
        task, names = lanes.task, [quantity.name for quantity in lanes.observed]
        needed = ("handwheel_angle", "handwheel_speed", "lateral_speed", "yaw_rate", "lateral_offset")
        if any(name not in names for name in needed) or task.person:
            raise ValueError(
                f"no driver model can act in {task.name}: it needs a path to see and the hand torque to give"
            )
        if lanes.control_dt != NODE:
            raise ValueError(
                f"driver models act every 10 ms; make the environment with control_dt=0.01, not {lanes.control_dt}"
            )
        self._places = np.array([names.index(name) for name in needed])
        self._speed = names.index("speed")
        self._scale = task.action.scale
        self._crew = Crew(resolve(driver), lanes.car, lanes.n, lanes.steering_stiffness)
        self._fresh = np.ones(lanes.n, bool)

    def reset(self, lanes: Any = slice(None)) -> None:
        """Forget the episodes of some lanes (mask or indices), or of all."""
        self._fresh[lanes] = True

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Action (1,) for an observation (O,), or (L, 1) for (L, O)."""
        seen = np.atleast_2d(observation).astype(float)
        for i in np.flatnonzero(self._fresh).tolist():
            self._crew.start(i, seen[i, self._speed])
        self._fresh[:] = False
        action = np.clip(self._crew.torque(seen, self._places) / self._scale, -1.0, 1.0).astype(np.float32)
        return action if observation.ndim == 1 else action[:, None]
