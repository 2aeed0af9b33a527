"""What ``info`` holds: the same keys and types at reset, at every step and at an episode's end, single and vector."""

from collections.abc import Callable
from functools import wraps
from itertools import count
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

    Attributes
    ----------
    told : (K, n) array
        What :meth:`of_first` is made of, as :func:`steer_env.engine.kernels.step` writes it.
    """

    def __init__(self, batch: EnvironmentBatch, level: str) -> None:
        task = batch.task
        self._n, self._level, self._channels = batch.n, checked_level(level), batch.channels
        self._groups = {
            "reward_terms": tuple(term.name for term in task.rewards),
            "cost_terms": tuple(cost.name for cost in task.costs),
            "metrics": tuple(metric.name for metric in task.metrics),
            "conditions": batch.condition_names,
        }
        row = count()  # of what is told
        places: dict[str, Any] = {name: next(row) for name in self._channels}
        for key in ("reward_terms", "cost_terms", "metrics", "cost", "failure", "conditions"):
            names = self._groups.get(key)
            places[key] = next(row) if names is None else {name: next(row) for name in names}
        keys = {"full": (*self._channels, "cost", "failure", *self._groups), "metrics": ("metrics",), "none": ()}
        self._places = {key: places[key] for key in keys[level]}
        self._size = next(row) if self._places else 0
        self._order = dict.fromkeys(each for key in self._places for each in (key, f"_{key}"))
        self._every = np.ones(batch.n, bool)
        self._every.flags.writeable = False  # all infos share it
        self.told = self.room()
        self._batch, self._conditions = batch, dict[str, float]()
        self._drawn: Any = None  # the conditions that ``_conditions`` holds by name
        self._view()

    def _view(self) -> None:
        """What changes at every step of the first row, but for what is drawn at its start."""
        self._seen = self.told[: self._size - len(self._groups["conditions"]), 0]

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._view()  # a copied view is an array of its own

    def room(self) -> NDArray[np.float64]:
        """Memory (K, n) for what infos are made of."""
        return np.empty((self._size, self._n))

    def of_first(self) -> dict[str, Any]:
        """The info of row 0 by :attr:`told`: floats and an integer."""
        if self._level == "none":
            return {}
        groups = self._groups
        if self._level == "metrics":
            return {"metrics": {name: self.told.item(i, 0) for name, i in self._places["metrics"].items()}}
        drawn = self._batch.conditions[0]
        if drawn is not self._drawn:
            first = min(self._places["conditions"].values())
            self._drawn = drawn
            self._conditions = dict(zip(groups["conditions"], self.told[first:, 0].tolist()))
        values = iter(self._seen.tolist())
        info: dict[str, Any] = dict(zip(self._channels, values))
        info["reward_terms"] = dict(zip(groups["reward_terms"], values))
        info["cost_terms"] = dict(zip(groups["cost_terms"], values))
        info["metrics"] = dict(zip(groups["metrics"], values))
        info["conditions"] = self._conditions.copy()
        info["cost"], failure = values
        info["failure"] = int(failure)
        return info

    def of_all(self, told: NDArray[np.float64], mask: Mask | None = None) -> dict[str, Any]:
        """The infos of all rows in the form of Gymnasium's vector environments: arrays (n,), and a mask beside each.

        The mask is that of the rows that have an info, by default all.
        """
        return VectorInfo(self._order, self._made, told, self._every if mask is None else mask)

    def _made(self, key: str, told: NDArray[np.float64], mask: Mask) -> Any:
        """What an info has under a key."""
        if key[0] == "_":
            return mask
        place = self._places[key]
        if isinstance(place, dict):
            return {each: part for name, i in place.items() for each, part in ((name, told[i]), (f"_{name}", mask))}
        return told[place].astype(np.int64) if key == "failure" else told[place]


class VectorInfo(dict[str, Any]):
    """A dict whose values are made when they are first asked for: to make them takes longer than the step of a row.

    Whatever looks at more than a key has all of them made first, in their order; copies are plain dicts.
    """

    __slots__ = ("_given", "_make", "_order")

    def __init__(self, order: dict[str, None], make: Callable[..., Any], *given: Any) -> None:
        self._order, self._make, self._given = order, make, given

    def __missing__(self, key: str) -> Any:
        if key not in self._order:
            raise KeyError(key)
        self[key] = value = self._make(key, *self._given)
        return value

    def __contains__(self, key: object) -> bool:
        return key in self._order or super().__contains__(key)

    def get(self, key: str, default: Any = None) -> Any:
        """The value of a key, or another one."""
        try:
            return self[key]
        except KeyError:
            return default

    def __reduce_ex__(self, protocol: Any) -> Any:
        return dict, (dict(self),)

    def made(self) -> "VectorInfo":
        """Itself, with all values."""
        if self._order:
            given = dict([*dict.items(self)])  # a copy would come here again
            dict.clear(self)
            for key in self._order:
                self[key] = given.pop(key) if key in given else self._make(key, *self._given)
            self._order = {}
            dict.update(self, given)
        return self


def _of_made(name: str) -> Callable[..., Any]:
    method = getattr(dict, name)

    @wraps(method)
    def of_made(self: VectorInfo, *arguments: Any, **named: Any) -> Any:
        others = [each.made() if isinstance(each, VectorInfo) else each for each in arguments]
        return method(self.made(), *others, **named)

    return of_made


_COMPARED = ("__eq__", "__ne__", "__or__", "__ror__", "__ior__")
_SEEN = ("__iter__", "__reversed__", "__len__", "__repr__", "keys", "values", "items", "copy")
for _name in (*_COMPARED, *_SEEN, "__delitem__", "pop", "popitem", "clear", "setdefault"):
    setattr(VectorInfo, _name, _of_made(_name))


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
