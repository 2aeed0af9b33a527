"""What ``info`` holds: the same keys and types at reset, at every step and at an episode's end, single and vector."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.engine.batch import EnvironmentBatch
from steer_env.friction.numerics.check import one_of

Mask = NDArray[np.bool_]
LEVELS = ("full", "metrics", "none")


def checked_level(level: Any) -> str:
    """An ``info_level``; ValueError if it is none of ``LEVELS``."""
    return one_of("info_level", level, LEVELS)


def require_full(level: Any, reader: str) -> None:
    """ValueError where the infos at a level lack what a reader takes from them."""
    if checked_level(level) != "full":
        raise ValueError(f"info_level must be 'full' for {reader}, got {level!r}")


class Infos:
    """Infos of a batch: channels by name, ``cost``, ``failure``, and dicts of floats by name.

    The dicts are ``reward_terms``, ``cost_terms``, ``conditions`` (what was drawn) and ``metrics`` (so far; zero
    before the first step). At the level "metrics" there is this one alone, and at "none" nothing.
    """

    def __init__(self, batch: EnvironmentBatch, level: str) -> None:
        self._batch, self._level, task = batch, checked_level(level), batch.task
        names = {
            "reward_terms": tuple(term.name for term in task.rewards),
            "cost_terms": tuple(cost.name for cost in task.costs),
            "metrics": tuple(metric.name for metric in task.metrics),
            "conditions": batch.condition_names,
        }
        self._groups = {"full": names, "metrics": {"metrics": names["metrics"]}, "none": {}}[self._level]
        every = np.ones(batch.n, bool)
        every.flags.writeable = False  # all infos share it
        self._every = self._masked(every)
        self._names = tuple(names.values())[:3]
        self._drawn: Any = None  # the conditions that ``_conditions`` holds by name
        self._conditions: dict[str, float] = {}
        self._view()

    def _view(self) -> None:
        """Views of the first row: making them at every step would take as long as reading them."""
        a = self._batch.arrays
        self._first = a.channels[0], a.terms[0], a.metrics[0, 2]

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._view()  # a copied view is an array of its own

    def of_first(self, cost: float, failure: int) -> dict[str, Any]:
        """The info of row 0, whose cost and failure are given: floats and an integer."""
        if self._level == "none":
            return {}
        channels, terms, metrics = self._first
        rewards, costs, measured = self._names
        so_far = dict(zip(measured, metrics.tolist()))
        if self._level == "metrics":
            return {"metrics": so_far}
        batch = self._batch
        if batch.conditions[0] is not self._drawn:
            self._drawn = batch.conditions[0]
            self._conditions = dict(zip(batch.condition_names, batch.condition_values[0].tolist()))
        both = iter(terms.tolist())
        info: dict[str, Any] = dict(zip(batch.channels, channels.tolist()))
        info["reward_terms"] = dict(zip(rewards, both))
        info["cost_terms"] = dict(zip(costs, both))
        info["metrics"] = so_far
        info["conditions"] = self._conditions.copy()
        info["cost"], info["failure"] = cost, failure
        return info

    def of_all(self, mask: Mask | None = None) -> dict[str, Any]:
        """The infos of all rows in the form of Gymnasium's vector environments: arrays (n,), and a mask beside each.

        The mask is that of the rows that have an info, by default all.
        """
        batch, a, n = self._batch, self._batch.arrays, len(self._batch.task.rewards)
        outer, inner = self._every if mask is None else self._masked(mask)
        info: dict[str, Any] = outer.copy()
        columns = {"metrics": a.metrics[:, 2].T.copy()}
        if self._level == "full":
            terms, episodes, drawn = a.terms.T.copy(), batch.episodes, batch.condition_values.T.copy()
            info.update(zip(batch.channels, a.channels.T.copy()))
            info["cost"], info["failure"] = episodes["cost"].copy(), episodes["failure"].copy()
            columns |= {"reward_terms": terms[:n], "cost_terms": terms[n:], "conditions": drawn}
        for (key, names), masks in zip(self._groups.items(), inner):
            info[key] = found = masks.copy()
            found.update(zip(names, columns[key]))
        return info

    def _masked(self, mask: Mask) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        """The infos and their dicts with masks alone."""
        alone = (*self._batch.channels, "cost", "failure") if self._level == "full" else ()
        outer = (*alone, *self._groups)
        return _masks(outer, mask), [_masks(names, mask) for names in self._groups.values()]


def _masks(names: Iterable[str], mask: Mask) -> dict[str, Any]:
    return {key: mask for name in names for key in (name, f"_{name}")}


def of_some(info: dict[str, Any], chosen: Mask) -> dict[str, Any]:
    """The infos of all rows as those of the chosen ones alone; the others are zero."""
    return {
        key: chosen
        if key[0] == "_"
        else of_some(value, chosen)
        if isinstance(value, dict)
        else np.where(chosen, value, 0)
        for key, value in info.items()
    }


def row(info: dict[str, Any], i: int) -> dict[str, Any]:
    """The info of row ``i`` out of those of all rows, as a single environment gives it."""
    return {
        key: row(value, i) if isinstance(value, dict) else value[i].item()
        for key, value in info.items()
        if key[0] != "_"
    }
