"""What a baseline assist is, and the registry of them.

A baseline acts in an assist environment, single or vector: it reads what is observed by name and asks for an assist
torque on top of the boost table's, as any policy does. It is one file: a class and its registration. Arithmetic is per
lane, in kernels, so that a lane of many acts to the bit as one alone.
"""

import inspect
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.registry import Registry
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST

Array = NDArray[np.float64]


class Baseline:
    """An assist controller; a subclass gives :meth:`torque`, and :meth:`begin` if it remembers anything.

    Parameters
    ----------
    env : gym.Env or gym.vector.VectorEnv
        Of a task whose action is an assist torque. Observations must come as the environment gives them.

    Raises
    ------
    ValueError
        Another environment, or one that does not observe what the baseline needs.
    """

    needs: tuple[str, ...] = ()  # observations, in the order in which ``torque`` takes them
    welcome: tuple[str, ...] = ()  # that come after these, zero where they are not observed

    def __init__(self, env: Any) -> None:
        lanes = getattr(env.unwrapped, "lanes", None)
        if lanes is None or lanes.task.action.input != ASSIST_REQUEST:
            got = env if lanes is None else lanes.task.name
            raise ValueError(f"a baseline assist needs an environment whose action is an assist torque, got {got}")
        observed = [quantity.name for quantity in lanes.observed]
        for name in self.needs:
            if name not in observed:
                raise ValueError(f"{lanes.task.name} does not observe {name}; it has: {', '.join(observed)}")
        self.lanes = lanes
        self.n, self.scale, self.control_dt = lanes.n, lanes.task.action.scale, lanes.control_dt
        # A place behind the last is a column of zeros.
        self._places = [observed.index(name) if name in observed else -1 for name in (*self.needs, *self.welcome)]
        self._width = len(observed)
        self._fresh = np.ones(self.n, bool)

    def reset(self, lanes: Any = slice(None)) -> None:
        """Forget the episodes of some lanes (mask or indices), or of all."""
        self._fresh[lanes] = True

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Action (1,) for an observation (O,), or (L, 1) for (L, O); within [-1, 1].

        Raises
        ------
        ValueError
            An observation of another shape than the environment's.
        """
        allowed = [(self.n, self._width)] + [(self._width,)] * (self.n == 1)
        if np.shape(observation) not in allowed:
            raise ValueError(f"observation must be an array {allowed[-1]}, got {observation!r}")
        seen = np.zeros((self.n, self._width + 1))
        seen[:, :-1] = observation
        seen = np.ascontiguousarray(seen[:, self._places])
        if self._fresh.any():
            for i in np.flatnonzero(self._fresh):
                self.begin(int(i), seen[i])
            self._fresh[:] = False
        action = np.clip(self.torque(seen) / self.scale, -1.0, 1.0).astype(np.float32)
        return action if observation.ndim == 1 else action[:, None]

    def begin(self, i: int, seen: Array) -> None:
        """A new episode in lane ``i``, of which this is seen first."""

    def torque(self, seen: Array) -> Array:
        """Torque asked for (n,) [N m] from what is needed (n, N), in SI; it is clipped to what the action spans."""
        raise NotImplementedError


BASELINES: Registry[type[Baseline]] = Registry("baseline assist", "steer_env.assists")


def register(name: str, baseline: type[Baseline]) -> None:
    """Make a baseline known: a class that takes the environment and options, by keyword, with standard values."""
    BASELINES.register(name, baseline)


def available() -> tuple[str, ...]:
    """Names of the baselines, in alphabetical order."""
    return BASELINES.available()


def make(name: str, env: Any, **options: Any) -> Baseline:
    """A baseline by name for an environment.

    Raises
    ------
    ValueError
        Unknown name or option (the valid ones are listed), a value out of range, or an environment that does not suit.
    """
    valid = list(inspect.signature(BASELINES[name]).parameters)[1:]
    for key in options:
        if key not in valid:
            raise ValueError(f"baseline assist {name!r} has no option {key!r}; it takes: {', '.join(valid) or 'none'}")
    return BASELINES[name](env, **options)
