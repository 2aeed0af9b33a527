"""Parameter sets of a tuning id driven as a sweep: here, in processes of this machine, or on a Dask cluster."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steer_env.experiments.sweep import Runner, run
from steer_env.friction.numerics.check import one_of, whole
from steer_env.registration import TUNED

SETS_PER_CASE = 8  # parameter sets in a case by default, which share the preparation of their context


class Sets(NamedTuple):
    """A case: parameter sets in one context."""

    env_id: str
    arguments: Mapping[str, Any]
    seed: int | None
    options: Mapping[str, float]  # of the reset
    actions: tuple[tuple[float, ...], ...]  # in [-1, 1] [1]


class Result(NamedTuple):
    """What the tests of a parameter set gave."""

    reward: Any  # float, or (reward_dim,) with ``vector_reward``
    info: dict[str, Any]  # that of ``step``; best and metrics are those of the sets of its case
    refused: dict[str, str]  # reasons by metric


def drive_sets(case: Sets) -> list[Result]:
    """Drive the sets of a case one after another."""
    env: Any = gym.make(case.env_id, **{**case.arguments, "sets": None}).unwrapped
    env.reset(seed=case.seed, options=dict(case.options))
    found = []
    for action in case.actions:
        _, reward, _, _, info = env.step(np.array(action, np.float32))
        found.append(Result(reward, info, env.refused))
    env.close()
    return found


def evaluate(
    env_id: str,
    actions: NDArray[Any],
    *,
    arguments: Mapping[str, Any] | None = None,
    contexts: Sequence[Mapping[str, float]] = ({},),
    seed: int | None = 0,
    together: int = SETS_PER_CASE,
    sweep: Runner = run,
    notify: Callable[[float, str], None] = lambda *_: None,
) -> list[list[Result]]:
    """Drive parameter sets (K, n) in contexts: for each context the results of all sets, equal wherever they run.

    Parameters
    ----------
    env_id : str
        A tuning id.
    actions : (K, n) array
        In [-1, 1].
    arguments : mapping, optional
        Those of :class:`steer_env.tuning.TuneEnv`, in forms that pickle takes.
    contexts : sequence of mappings
        Reset options; what they leave out and ``randomise`` names is drawn with ``seed``, the same for every set.
    seed : int, optional
    together : int
        Parameter sets of one case, which prepare their context once.
    sweep : Runner
        :func:`steer_env.experiments.sweep.run`, perhaps with ``where=Where(cluster="local")`` and a store.
    notify : (share, text) -> None
        Is told how far the sweep is.

    Raises
    ------
    ValueError
        For another id, actions of another shape, or what the environment refuses.
    """
    one_of("env_id", env_id, TUNED)
    sets = np.asarray(actions, np.float32)
    if sets.ndim != 2 or not len(sets):
        raise ValueError(f"actions must be an array (K, n) with at least one row, got shape {sets.shape}")
    rows, n = [tuple(row) for row in sets.tolist()], whole("together", together, 1)
    cases = [
        Sets(env_id, dict(arguments or {}), seed, dict(context), tuple(rows[k : k + n]))
        for context in contexts
        for k in range(0, len(rows), n)
    ]
    parts = sweep(
        drive_sets, cases, notify=notify, words=lambda case: f"{len(case.actions)} sets, {case.options or env_id}"
    )
    each = [result for part in parts for result in part]
    return [each[k : k + len(rows)] for k in range(0, len(each), len(rows))]
