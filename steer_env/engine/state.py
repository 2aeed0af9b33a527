"""The state of an environment: a copy of everything that decides how its episodes go on, which another one can take.

It is a value for planners and for tests: a vector environment can take copies of the state of a single one. It holds
plain numbers, text and arrays alone, so that it can be stored, and it carries a version.
"""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from steer_env.engine.arrays import SETUP, stored
from steer_env.engine.batch import EnvironmentBatch
from steer_env.episode.randomise import Conditions
from steer_env.friction.law import law_of
from steer_env.friction.numerics.packing import numbers
from steer_env.friction.sites import friction_name
from steer_env.registration import id_of

_APART = ("episodes", "factors", "scales")  # arrays of a batch that a state has in another form
VERSION = 2  # of the format and of the meaning of what it holds: raised when either changes
Generators: TypeAlias = tuple[tuple[np.random.Generator, int], ...]  # of each sub-environment, with its seed


@dataclass(frozen=True)
class State:
    """The state of ``n`` sub-environments, from ``get_state``; one of ``n`` is that of a single environment.

    Attributes
    ----------
    version : int
        Of the format.
    kind : dict of str to str
        What an environment must have in common with the one that gave the state: id, car, law and so on.
    arrays : dict of str to array
        Row i belongs to sub-environment i: plants, friction, episode, accumulators, delay line, driver models, noise.
    conditions : tuple of dict
        What was drawn for the episode of each.
    generators : tuple of dict, optional
        State and seed of the random generator of each; None without ``include_rng``.
    """

    version: int
    kind: dict[str, str]
    arrays: dict[str, NDArray[Any]]
    conditions: tuple[dict[str, Any], ...]
    generators: tuple[dict[str, Any], ...] | None

    def __len__(self) -> int:
        return len(self.conditions)

    def row(self, i: int) -> "State":
        """The state of sub-environment ``i`` alone."""
        rows = slice(range(len(self))[i], range(len(self))[i] + 1)
        return replace(
            self,
            arrays={name: values[rows].copy() for name, values in self.arrays.items()},
            conditions=self.conditions[rows],
            generators=None if self.generators is None else self.generators[rows],
        )

    @property
    def observations(self) -> NDArray[np.float32]:
        """The present observations (n, O), on the scale of the environment that gave the state."""
        return self.arrays["observations"].copy()


_kinds: WeakKeyDictionary[EnvironmentBatch, dict[str, str]] = WeakKeyDictionary()


def kind(batch: EnvironmentBatch) -> dict[str, str]:
    """What two environments must have in common for one to take the state of the other."""
    if batch not in _kinds:
        _kinds[batch] = _kind(batch)
    return _kinds[batch]


def _kind(batch: EnvironmentBatch) -> dict[str, str]:
    usual, road = batch.usual_conditions, batch.road
    law, memory = friction_name(usual.friction), law_of(usual.friction).memory_size(usual.friction)
    # Every number of the car that a plant is made of, at any speed and with any law.
    p = batch.car.plant("coulomb", speed=20.0, chassis=batch.chassis)
    return {
        "id": id_of(batch.task.name),
        "car": f"{batch.car.name} (numbers {_digest((numbers(p), *p.strut))})",
        "chassis": batch.chassis,
        "law": f"{law} ({numbers(usual.friction).size} numbers, {memory} of memory)",
        "driver": repr(batch.driver),
        "road": "the default" if road is None else f"numbers {_digest(road)}",
        "control_dt": f"{batch.control_dt:g} s",
    }


def _digest(values: Sequence[Any]) -> str:
    """A short text that differs when a number differs."""
    found = hashlib.sha256()
    for value in values:
        found.update(np.asarray(value).tobytes())
    return found.hexdigest()[:8]


def copy_state(batch: EnvironmentBatch, generators: Generators | None) -> State:
    """The state of a batch, with the random generators of its rows or without."""
    arrays = {name: np.array(values) for name, values in batch.arrays._asdict().items() if name not in _APART}
    arrays |= {
        "scripted_inputs": batch.scripts(),
        "episodes": batch.episodes.copy(),
        "over": batch.over.copy(),
        "noise_factor": batch.noise.factor.copy(),
    }
    if batch.drivers is not None:
        a = batch.drivers.arrays
        arrays |= {f"driver_{name}": getattr(a, name).copy() for name in ("gains", "feed_forward", "memory")}
    drawn = [conditions._asdict() for conditions in batch.conditions]
    conditions = tuple({**found, "friction": dict(found["friction"]._asdict())} for found in drawn)
    if generators is None:
        return State(VERSION, kind(batch), arrays, conditions, None)
    arrays |= {"noise_steps": batch.noise.steps.copy(), "noise_blocks": batch.noise.blocks.copy()}
    states = tuple({"seed": seed, "state": rng.bit_generator.state} for rng, seed in generators)
    return State(VERSION, kind(batch), arrays, conditions, states)


def restore(batch: EnvironmentBatch, state: State) -> Generators | None:
    """Make a batch continue from a state, and return generators for its rows if the state has them.

    A state of one row is taken by every row, each with a generator of its own in that state.

    Raises
    ------
    TypeError
        It is not a state.
    ValueError
        It does not fit; the message names what differs.
    """
    _require_fit(batch, state)
    held = state.arrays
    batch.arrays = stored(batch.arrays, slice(None), {name: held[name] for name in SETUP})
    for name, values in batch.arrays._asdict().items():
        if name not in (*SETUP, *_APART):
            values[:] = held[name]
    batch.arrays.scales[:] = math.nan
    batch.episodes[:], batch.over[:] = held["episodes"], held["over"]
    if batch.drivers is not None:
        batch.drivers.size_gains(held["driver_gains"].shape[1])
        for name in ("gains", "feed_forward", "memory"):
            getattr(batch.drivers.arrays, name)[:] = held[f"driver_{name}"]
    times, law = batch.n // len(state), type(batch.usual_conditions.friction)
    drawn = [Conditions(**{**found, "friction": law(**found["friction"])}) for found in state.conditions]
    for i, conditions in enumerate(drawn * times):
        batch.set_conditions(i, conditions)
    batch.deliver()
    batch.noise.set_factor(slice(None), held["noise_factor"])
    if state.generators is None:
        batch.noise.redraw()
        return None
    batch.noise.steps[:] = held["noise_steps"]
    if batch.noise.noisy:
        batch.noise.blocks[:] = held["noise_blocks"]
    return tuple(_generator(found) for found in state.generators * times)


def _require_fit(batch: EnvironmentBatch, state: State) -> None:
    if not isinstance(state, State):
        raise TypeError(f"state must be a steer_env.engine.state.State from get_state, got {type(state).__name__}")
    if state.version != VERSION:
        raise ValueError(
            f"the state has version {state.version}, this release takes version {VERSION}: repeat the episode here"
        )
    own = kind(batch)
    differing = [
        f"{name} is {state.kind.get(name)!r} in the state and {own[name]!r} here"
        for name in own
        if state.kind.get(name) != own[name]
    ]
    if differing:
        raise ValueError(f"the state does not fit this environment: {'; '.join(differing)}")
    if len(state) not in (1, batch.n):
        raise ValueError(
            f"the state has {len(state)} sub-environments and this environment {batch.n}: take one by state.row(i)"
        )


def _generator(found: dict[str, Any]) -> tuple[np.random.Generator, int]:
    rng = np.random.Generator(getattr(np.random, found["state"]["bit_generator"])())
    rng.bit_generator.state = found["state"]
    return rng, found["seed"]
