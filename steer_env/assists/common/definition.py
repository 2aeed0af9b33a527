"""What a baseline assist is, and the registry of them.

A baseline acts in an assist environment, single or vector: it reads observations by their names and requests an assist
torque that is added to the boost table's, as any policy does. It is one file: a class and its registration. It computes
row by row, so that its actions do not depend on the number of sub-environments.
"""

import inspect
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.registry import Registry
from steer_env.registration import id_of
from steer_env.tasks.common.definition import Quantity, by_name
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST

Array = NDArray[np.float64]
# The options that a search has found for each id, by baseline, and how well they did; maintainers write it.
TUNED = Path(__file__).parents[1] / "tuned.json"


class Baseline:
    """An assist controller; a subclass gives :meth:`torque`, and :meth:`begin` if it has a memory.

    Parameters
    ----------
    env : gym.Env or gym.vector.VectorEnv
        Of a task whose action is an assist torque. Observations are those of the environment itself, or scaled by the
        environment's ``normalise``.

    Raises
    ------
    ValueError
        The environment has another action, or does not observe what the baseline needs.
    """

    needs: tuple[str, ...] = ()  # observations that ``torque`` reads by their names
    optional: tuple[str, ...] = ()  # further ones, zero where the environment does not have them
    # Options to tune, with their least and largest value; on a logarithmic scale where the least is above zero.
    tuned: Mapping[str, tuple[float, float]] = {}

    def __init__(self, env: Any) -> None:
        batch = getattr(env.unwrapped, "batch", None)
        if batch is None or batch.task.action.input != ASSIST_REQUEST:
            got = env if batch is None else batch.task.name
            raise ValueError(f"a baseline assist needs an environment whose action is an assist torque, got {got}")
        observed = [quantity.name for quantity in batch.observed]
        for name in self.needs:
            if name not in observed:
                raise ValueError(f"{batch.task.name} does not observe {name}; it has: {', '.join(observed)}")
        self.batch = batch
        self.n, self.scale, self.control_dt = batch.n, batch.task.action.scale, batch.control_dt
        # Column -1 of what `act` puts together is zero; it is always read, so that a record is never empty.
        read = (*self.needs, *self.optional)
        self._places = [*(observed.index(name) if name in observed else -1 for name in read), -1]
        self._quantities = [Quantity(name, "", np.inf) for name in read]
        self._width = len(observed)
        self._units = getattr(env.unwrapped, "observation_scale", np.ones(self._width))
        self._new = np.ones(self.n, bool)

    def reset(self, rows: Any = slice(None)) -> None:
        """Forget the episodes of some sub-environments (mask or indices), or of all."""
        self._new[rows] = True

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Action (1,) for an observation (O,), or (n, 1) for (n, O); within [-1, 1].

        Raises
        ------
        ValueError
            The observation has another shape than the environment's.
        """
        allowed = [(self.n, self._width)] + [(self._width,)] * (self.n == 1)
        if np.shape(observation) not in allowed:
            raise ValueError(f"observation must be an array {allowed[-1]}, got {observation!r}")
        values = np.zeros((self.n, self._width + 1))
        values[:, :-1] = observation * self._units
        seen = by_name(np.ascontiguousarray(values[:, self._places]), self._quantities)
        if self._new.any():
            for i in np.flatnonzero(self._new):
                self.begin(int(i), seen[i])
            self._new[:] = False
        action = np.clip(self.torque(seen) / self.scale, -1.0, 1.0).astype(np.float32)
        return action if observation.ndim == 1 else action[:, None]

    def begin(self, i: int, seen: Any) -> None:
        """Begin an episode in row ``i`` with the record of its first observations."""

    def torque(self, seen: Any) -> Array:
        """Requested torque (n,) [N m]; :meth:`act` clips it to the action.

        ``seen`` are records (n,) of the needed observations in SI: ``seen.column_speed`` is (n,).
        """
        raise NotImplementedError


BASELINES: Registry[type[Baseline]] = Registry("baseline assist", "steer_env.assists")


def register(name: str, baseline: type[Baseline]) -> None:
    """Make a baseline known: a class that takes the environment, and options by keyword with standard values."""
    BASELINES.register(name, baseline)


def available() -> tuple[str, ...]:
    """Names of the baselines, in alphabetical order."""
    return BASELINES.available()


@cache
def _search_results() -> dict[str, dict[str, Any]]:
    """What was found, by id and baseline."""
    found: dict[str, dict[str, Any]] = json.loads(TUNED.read_text(encoding="utf-8"))
    return found


def make(name: str, env: Any, tuned: bool = True, **options: Any) -> Baseline:
    """A baseline by name for an environment.

    Parameters
    ----------
    name : str
        One of :func:`available`.
    env : gym.Env or gym.vector.VectorEnv
        As :class:`Baseline` takes it.
    tuned : bool
        Whether options that are not given are the best known for the task, which a search found with the default car;
        otherwise, and where it found none, they are the standard values of the class.
    **options
        Of the class, by keyword.

    Raises
    ------
    ValueError
        The name or an option is unknown (the message lists the valid ones), a value is out of range, or the baseline
        cannot act in the environment.
    """
    valid = list(inspect.signature(BASELINES[name]).parameters)[1:]
    for key in options:
        if key not in valid:
            raise ValueError(f"baseline assist {name!r} has no option {key!r}; it takes: {', '.join(valid) or 'none'}")
    batch = getattr(env.unwrapped, "batch", None)
    found = _search_results().get(id_of(batch.task.name), {}) if tuned and batch is not None else {}
    best = found[name]["options"] if name in found else {}
    return BASELINES[name](env, **{**best, **options})
