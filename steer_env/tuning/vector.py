"""Several tuning environments in one object, whose parameter sets are driven at once in worker processes.

Processes, as reading the metrics takes longer than the kernels and holds the interpreter's lock: two threads were
0.9 to 1.2 times as fast as one. What a worker does depends on the context and the assist alone. It keeps the contexts
that it has prepared, and prepares one that it does not have: so any of them takes any job, and one that is lost is
replaced without a trace in the results.
"""

import copy
import pickle
import uuid
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from steer_env.engine.specification import PlainSpecification
from steer_env.env import as_actions, clip_actions
from steer_env.episode.randomise import Conditions
from steer_env.friction.numerics.check import whole
from steer_env.friction.numerics.thread_pool import most_threads
from steer_env.friction.numerics.worker_process import end_processes, run_in_processes
from steer_env.tuning import driving
from steer_env.tuning.context import Reference
from steer_env.tuning.driving import PreparedDrive, SetResult
from steer_env.tuning.env import TuneEnv
from steer_env.tuning.scenarios.common.definition import SCENARIOS
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import Assist


class Course(NamedTuple):
    """A context as it goes to a worker."""

    scenario: str  # name
    car: Car  # without its load
    chassis: str
    drawn: Conditions


class Job(NamedTuple):
    """A context to be prepared, or an assist to be driven in it."""

    key: str  # of the context, unlike any other's
    course: bytes  # a pickled :class:`Course`
    keep: int  # contexts that a worker keeps
    assist: Assist | None = None  # None: the context is only prepared


class _PreparedContext(NamedTuple):
    known: Reference
    drives: tuple[PreparedDrive, ...]


_in_worker: OrderedDict[str, _PreparedContext] = OrderedDict()  # by key, the last used one at the end


def perform(job: Job, kept: OrderedDict[str, _PreparedContext] = _in_worker) -> Any:
    """The :class:`Reference` of a job, or what its assist gives there (:class:`SetResult`).

    Raises
    ------
    ValueError
        The car does not reach the lateral acceleration of a test.
    """
    if job.key not in kept:
        name, car, chassis, drawn = pickle.loads(job.course)
        drives = driving.prepare_drives(SCENARIOS[name], car, chassis, drawn)
        kept[job.key] = _PreparedContext(driving.measure_reference(drives, car, chassis, drawn), drives)
    kept.move_to_end(job.key)
    while len(kept) > job.keep:
        kept.popitem(last=False)
    own = kept[job.key]
    return own.known if job.assist is None else driving.drive_set(own.drives, job.assist)


class Workers:
    """``count`` worker processes, which start with the first job; with one, the jobs run in this process."""

    def __init__(self, count: int) -> None:
        self.count = count
        self._kept: OrderedDict[str, _PreparedContext] = OrderedDict()  # of this process

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_kept": OrderedDict()}

    def run(self, jobs: Sequence[Job]) -> list[Any]:
        """Results of :func:`perform` in the order of the jobs; its errors.

        Raises
        ------
        RuntimeError
            Worker processes die again and again.
        """
        if self.count == 1:
            return [perform(job, self._kept) for job in jobs]
        results = dict(run_in_processes(perform, jobs, self.count))
        return [results[index] for index in range(len(jobs))]

    def close(self) -> None:
        """End the processes; those of another vector environment start again with its next step."""
        if self.count > 1:
            end_processes()
        self._kept.clear()


Array = NDArray[np.float32]


class TuneVectorEnv(PlainSpecification, VectorEnv):
    """``num_envs`` tuning environments of an id; each is bit-identical to the single environment with the same seed.

    ``gymnasium.make_vec(id, num_envs=N)`` makes it. Arguments as :class:`steer_env.tuning.TuneEnv`, and

    num_envs : int
        Number of sub-environments.
    autoreset_mode : gymnasium.vector.AutoresetMode or its value, default NEXT_STEP
        As of the vector environments of the driving ids.
    workers : int, optional
        Processes in which parameter sets are driven, each of one thread; 1 is this process alone. By default one for
        each processor or as many as ``STEER_ENV_THREADS`` says, at most ``num_envs``. They start with the first reset,
        which takes some seconds, and end with ``close``.
    max_episode_steps : int, optional
        Parameter sets after which an episode is truncated, where ``sets`` is not smaller; -1 is none.

    ``reset(seed=s)`` seeds sub-environment i with s + i. ``envs[i]`` is sub-environment i, with its
    ``best_action``, ``refused`` and ``tuned_car``; it is reset and stepped by the vector environment alone. With
    ``vector_reward`` the rewards are an array of float32, (num_envs, reward_dim), otherwise of float64,
    (num_envs,). Infos hold arrays over the sub-environments, with masks, as those of Gymnasium's vector
    environments do.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 (Gymnasium's own form)
    single: type[TuneEnv]

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        workers: int | None = None,
        max_episode_steps: int | None = None,
        **arguments: Any,
    ) -> None:
        self.num_envs = whole("num_envs", num_envs, 1)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        if workers is None:
            workers = min(most_threads(), num_envs)
        self._workers = Workers(whole("workers", workers, 1))
        first = self.single(**arguments)
        if max_episode_steps not in (None, -1):
            first.sets = min(first.sets or max_episode_steps, whole("max_episode_steps", max_episode_steps, 1))
        self.envs = [first, *(copy.copy(first) for _ in range(num_envs - 1))]  # which share what never changes
        self.single_action_space, self.single_observation_space = first.action_space, first.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.render_mode = first.render_mode
        self.reward_components = first.reward_components
        if vector := hasattr(first, "reward_space"):
            self.reward_dim, self.reward_space = first.reward_dim, first.reward_space
        self._reward_type = np.float32 if vector else np.float64
        self._reward_shape = (num_envs, first.reward_dim) if vector else (num_envs,)
        self._observations = np.zeros(self.observation_space.shape or (), np.float32)
        self._over = np.ones(num_envs, bool)
        self._begun = False
        self._contexts: list[_Context | None] = [None] * num_envs

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode in every sub-environment, or in those of ``options["reset_mask"]``.

        Raises
        ------
        ValueError
            An option, a seed or the mask is wrong, or the car does not reach a test's lateral acceleration.
        """
        n, chosen = self.num_envs, dict(options or {})
        mask = chosen.pop("reset_mask", np.ones(n, bool))
        if not isinstance(mask, np.ndarray) or mask.shape != (n,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(f"reset_mask must be a boolean array ({n},) with at least one True, got {mask!r}")
        if isinstance(seed, Sequence | np.ndarray):
            seeds = list(seed)
        else:
            seeds = [None if seed is None else whole("seed", seed, 0) + i for i in range(n)]
        if len(seeds) != n:
            raise ValueError(f"seed must be a number or {n} of them, got {len(seeds)}")
        drawn = {}
        for i, env in enumerate(self.envs):
            if mask[i]:
                drawn[i] = env.draw(seeds[i], chosen)
            elif not self._begun and seeds[i] is not None:  # seeded as well, so that its later beginning is known
                env.draw(seeds[i], {})
        self._evaluated(drawn, {})
        self._begun = True
        info = self._gathered(self._started(drawn))
        return self._observations.copy(), info

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[Array, NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Try a parameter set in every sub-environment, or start an episode where one is over: actions (num_envs, n).

        Raises
        ------
        ValueError
            The actions have another shape or are not finite.
        RuntimeError
            An episode is over with DISABLED, or none has begun.
        """
        actions, over = clip_actions(as_actions("actions", actions, self.action_space.shape)), self._over.copy()
        if over.any() and (self.autoreset_mode == AutoresetMode.DISABLED or not self._begun):
            raise RuntimeError("an episode is over or has not begun: call reset")
        # NEXT_STEP: this step resets what is over, whatever the action was.
        drawn = {i: self.envs[i].draw(None, None) for i in np.flatnonzero(over).tolist()}
        tried = self._evaluated(drawn, {i: self.envs[i].assist(actions[i]) for i in np.flatnonzero(~over).tolist()})
        told = self._started(drawn)
        rewards, truncated = np.zeros(self._reward_shape, self._reward_type), np.zeros(self.num_envs, bool)
        for i, found in tried.items():
            self._observations[i], rewards[i], _, truncated[i], told[i] = self.envs[i].finish_step(actions[i], found)
        self._over |= truncated
        last = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and truncated.any():
            ended = np.flatnonzero(truncated).tolist()
            last = {i: {"final_obs": self._observations[i].copy(), "final_info": told[i]} for i in ended}
            drawn = {i: self.envs[i].draw(None, None) for i in ended}
            self._evaluated(drawn, {})
            told |= self._started(drawn)
        info = self._gathered(told, self._gathered(last))
        return self._observations.copy(), rewards, np.zeros(self.num_envs, bool), truncated, info

    def _evaluated(self, drawn: dict[int, Conditions], assists: dict[int, Assist]) -> dict[int, SetResult]:
        """Prepare the contexts of drawn conditions, and drive assists in their contexts, all at once.

        The jobs of contexts that are new come first; their results are kept, and those of the assists are returned.
        """
        for i, conditions in drawn.items():
            self._contexts[i] = self._context(conditions)
        new = {id(each): each for i in drawn if (each := self._of(i)).known is None}
        jobs = [each.job for each in new.values()]
        jobs += [self._of(i).job._replace(assist=assist) for i, assist in assists.items()]
        results = self._workers.run(jobs)
        for each in new.values():
            each.known = results.pop(0)
        return dict(zip(assists, results))

    def _context(self, drawn: Conditions) -> "_Context":
        """The context of drawn conditions: one that a sub-environment has, or a new one."""
        for own in self._contexts:
            if own and own.drawn.same_plant(drawn):
                return own
        first = self.envs[0]
        course = pickle.dumps(Course(first.scenario.name, first.car, first.chassis, drawn))
        return _Context(drawn, Job(uuid.uuid4().hex, course, 2 * self.num_envs))

    def _of(self, i: int) -> "_Context":
        own = self._contexts[i]
        assert own is not None
        return own

    def _started(self, drawn: Iterable[int]) -> dict[int, dict[str, Any]]:
        """Start episodes in contexts that are prepared: the infos."""
        told = {}
        for i in drawn:
            own = self._of(i)
            assert own.known is not None
            self._observations[i], told[i] = self.envs[i].begin(own.drawn, own.known)
            self._over[i] = False
        return told

    def _gathered(self, infos: dict[int, dict[str, Any]], found: dict[str, Any] | None = None) -> dict[str, Any]:
        """Infos by sub-environment in the form of Gymnasium's vector environments, added to those that are found."""
        found = {} if found is None else found
        for i, info in infos.items():
            found = self._add_info(found, info, i)
        return found

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The generators of the sub-environments, as Gymnasium's own vector environments give them."""
        return tuple(env.np_random for env in self.envs)

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """The seeds of the sub-environments."""
        return tuple(env.np_random_seed for env in self.envs)

    def close_extras(self, **kwargs: Any) -> None:
        """End the worker processes and the episodes."""
        self._workers.close()
        self._over[:], self._begun = True, False


@dataclass
class _Context:
    """The context of some sub-environments."""

    drawn: Conditions
    job: Job  # that prepares it, and with an assist drives it
    known: Reference | None = None  # once it is prepared
