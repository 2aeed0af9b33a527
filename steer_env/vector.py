"""Many environments of one kind in one object: the same kernels run over all rows of a batch, in threads."""

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from steer_env.engine.infos import Infos, checked_level, of_some
from steer_env.engine.row_wrapper import ALL, Rows, observed, wrapper_of
from steer_env.engine.specification import PlainSpecification
from steer_env.engine.state import State, copy_state, restore
from steer_env.env import as_actions, batch_of, clip_actions
from steer_env.friction.numerics.check import whole
from steer_env.friction.numerics.thread_pool import most_threads
from steer_env.rendering.modes import VECTOR_MODES, checked_mode, frame_rate
from steer_env.tasks import Task
from steer_env.tasks.common.definition import COST_LIMIT

ROWS_PER_THREAD = 16  # sub-environments that make another thread worthwhile


class SteerVectorEnv(PlainSpecification, VectorEnv):
    """``num_envs`` environments of an id; each is bit-identical to the single environment with the same seed.

    ``gymnasium.make_vec(id, num_envs=N)`` makes it. Arguments as :class:`steer_env.env.SteerEnv`, and

    num_envs : int
        Number of sub-environments.
    autoreset_mode : gymnasium.vector.AutoresetMode or its value, default NEXT_STEP
        NEXT_STEP resets a sub-environment at the step after its episode's end and ignores that step's action;
        SAME_STEP resets it at once, and ``info["final_obs"]`` and ``info["final_info"]`` hold the end; with DISABLED
        ``reset(options={"reset_mask": mask})`` does it.
    threads : int, optional
        By default one for each 16 sub-environments, at most as many as there are processors.
    max_episode_steps : int, optional
        Control steps after which an episode is truncated, as Gymnasium's ``TimeLimit`` does it; -1 is none.
    render_mode : None, "rgb_array" or "rgb_array_list"
        ``render`` gives a tuple with the picture, or the list of pictures, of each sub-environment.

    ``reset(seed=s)`` seeds sub-environment i with s + i. A sub-environment that a first reset leaves out by its
    ``reset_mask`` counts as one whose episode has ended: it begins at the next step, or with DISABLED at its reset.
    Infos hold arrays over the sub-environments, with masks, as those of Gymnasium's vector environments do. In a step
    that resets a sub-environment its info is that of the reset. The two keys of SAME_STEP are there at every
    ``info_level``.
    """

    metadata = {  # noqa: RUF012 (Gymnasium's own form)
        "render_modes": [*VECTOR_MODES],
        "render_fps": 20.0,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    cost_limit = COST_LIMIT
    task: Task

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        info_level: str = "full",
        wrapper: Any = None,
        **arguments: Any,
    ) -> None:
        num_envs = whole("num_envs", num_envs, 1)
        self.render_mode, self.info_level = checked_mode(render_mode, VECTOR_MODES), checked_level(info_level)
        self.num_envs, self._shape = num_envs, (num_envs, 1)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        if threads is None:
            threads = min(most_threads(), -(-num_envs // ROWS_PER_THREAD))
        steps = None if max_episode_steps in (None, -1) else whole("max_episode_steps", max_episode_steps, 1)
        others = ("num_envs", "autoreset_mode", "threads", "max_episode_steps", "render_mode", "info_level", "wrapper")
        self.batch = batch_of(self.task, num_envs, arguments, others, threads=threads, max_episode_steps=steps)
        self.control_dt = self.batch.control_dt
        fps = frame_rate(render_mode, self.control_dt)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode, "render_fps": fps}
        self.observation_scale = self.batch.observation_scale
        self.single_action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.single_observation_space = gym.spaces.Box(-self.batch.bound, self.batch.bound, dtype=np.float32)
        self._wrapper = wrapper_of(wrapper, num_envs, self.single_observation_space, self.single_action_space)
        if self._wrapper:
            self.single_action_space = self._wrapper.action_space
            self.single_observation_space = self._wrapper.observation_space
            self._seen = np.zeros((num_envs, *self._wrapper.observation_space.shape), np.float32)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._infos = Infos(self.batch, info_level)
        self._renderers: list[Any] = []
        if render_mode is not None:
            from steer_env.rendering.renderer import renderers  # here, because it takes long to import

            self._renderers = renderers(self.batch, render_mode)
        self._generators: list[np.random.Generator] = []  # empty before they are needed
        self._seeds: list[int] = []

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode in every sub-environment, or in those of ``options["reset_mask"]``."""
        n, chosen = self.num_envs, dict(options or {})
        mask = chosen.pop("reset_mask", np.ones(n, bool))
        if not isinstance(mask, np.ndarray) or mask.shape != (n,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(f"reset_mask must be a boolean array ({n},) with at least one True, got {mask!r}")
        if isinstance(seed, Sequence | np.ndarray):
            seeds = [None if each is None else whole("seed", each, 0) for each in seed]
        else:
            first = None if seed is None else whole("seed", seed, 0)
            seeds = [None if first is None else first + i for i in range(n)]
        if len(seeds) != n:
            raise ValueError(f"seed must be a number or {n} of them, got {len(seeds)}")
        # A sub-environment that a first reset leaves out is seeded as well, so that its later beginning is known.
        new = mask | (self.batch.episodes["end"] == 0)
        self._seed([each if is_new else None for each, is_new in zip(seeds, new.tolist())])
        self._start(np.flatnonzero(mask).tolist(), chosen)
        return self._observed(np.flatnonzero(mask)), self._infos.of_all(self._told(), mask.copy())

    def _start(self, rows: list[int], options: dict[str, Any]) -> None:
        """Start an episode in some sub-environments."""
        self.batch.start(rows, self._generators, options)
        if self._wrapper and rows:
            self._wrapper.reset(np.array(rows))
        for i in rows if self._renderers else ():
            self._renderers[i].start()

    def step(
        self, actions: Any
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Hold actions (num_envs, 1) in [-1, 1] for ``control_dt``; actions beyond are clipped.

        Raises
        ------
        ValueError
            The actions have another shape or are not finite.
        RuntimeError
            There was no ``reset`` yet, or an episode is over in DISABLED mode.
        """
        batch, over = self.batch, None
        if self._wrapper:
            actions = self._wrapper.action(np.asarray(actions))
        if not (type(actions) is np.ndarray and actions.shape == self._shape and actions.dtype == np.float32):
            actions = clip_actions(as_actions("actions", actions, self._shape))
        if np.count_nonzero(batch.over):
            clip_actions(actions)
            if self.autoreset_mode == AutoresetMode.DISABLED or not batch.episodes["end"].any():
                raise RuntimeError("an episode is over or has not begun: call reset")
            over = batch.over.copy()
        told = self._infos.room()
        ended = batch.step(actions, self._generators, told)
        if ended < 0:
            clip_actions(actions)  # which says what is wrong
        if over is not None:  # NEXT_STEP: this step resets, whatever the action was
            self._start(np.flatnonzero(over).tolist(), {})
            batch.tell(told)
        for i in range(self.num_envs) if self._renderers else ():
            if over is None or not over[i]:
                self._renderers[i].add()
        rewards, terminated, truncated = (values.copy() for values in batch.results)
        info = self._infos.of_all(told)
        if self._wrapper:
            given = self._wrapper.reward(rewards, info)
            rewards = given if over is None else np.where(over, rewards, given)  # a step that resets has no reward
        observations = self._observed()
        if ended and self.autoreset_mode == AutoresetMode.SAME_STEP:  # the step that ends an episode resets at once
            done = terminated | truncated
            info = self._ended(done, info, observations)
            observations = self._observed(np.flatnonzero(done))
        return observations, rewards, terminated, truncated, info

    def _told(self) -> NDArray[np.float64]:
        return self.batch.tell(self._infos.room())

    def _observed(self, rows: Rows = ALL) -> NDArray[np.float32]:
        """A copy of all observations, of which a wrapper sees those of some sub-environments anew."""
        if not self._wrapper:
            return self.batch.arrays.observations.copy()
        self._seen[rows] = observed(self._wrapper, self.batch.arrays.observations[rows].copy(), rows)
        return self._seen.copy()

    def _ended(
        self, done: NDArray[np.bool_], last: dict[str, Any], observations: NDArray[np.float32]
    ) -> dict[str, Any]:
        """Reset the sub-environments whose episodes are done; their info, with the last one of those episodes in it."""
        final = np.full(self.num_envs, None, object)
        rows = np.flatnonzero(done).tolist()
        for i in rows:
            final[i] = observations[i].copy()
        self._start(rows, {})
        info = self._infos.of_all(self._told()).copy()  # a plain dict, as torch looks into no other
        info["final_obs"], info["_final_obs"] = final, done.copy()
        info["final_info"], info["_final_info"] = of_some(last, done.copy()), done.copy()
        return info

    def _seed(self, seeds: list[int | None]) -> None:
        """Give sub-environments new generators by their seeds; None keeps the generator, if there is one."""
        if not self._generators:
            made = [gym.utils.seeding.np_random(seed) for seed in seeds]
            self._generators, self._seeds = [rng for rng, _ in made], [seed for _, seed in made]
            return
        for i, seed in enumerate(seeds):
            if seed is not None:
                self._generators[i], self._seeds[i] = gym.utils.seeding.np_random(seed)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The generators of the sub-environments, as Gymnasium's own vector environments give them."""
        if not self._generators:
            self._seed([None] * self.num_envs)
        return tuple(self._generators)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seeds of the sub-environments."""
        return tuple(self._seeds) if self.np_random else ()

    def get_state(self, include_rng: bool = True) -> State:
        """A copy of everything that decides how the episodes go on, as :meth:`steer_env.env.SteerEnv.get_state`."""
        return copy_state(self.batch, tuple(zip(self.np_random, self.np_random_seed)) if include_rng else None)

    def set_state(self, state: State) -> None:
        """Continue from a state, as :meth:`steer_env.env.SteerEnv.set_state`.

        A state of one sub-environment, or of a single environment, is taken by every sub-environment.
        """
        generators = restore(self.batch, state)
        for renderer in self._renderers:
            renderer.start()
        if generators is None:
            generators = tuple(zip(self.np_random, self.np_random_seed))
        self._generators, self._seeds = [rng for rng, _ in generators], [seed for _, seed in generators]

    def failure_text(self, code: int) -> str:
        """A failure of ``info["failure"]`` in words, as :meth:`steer_env.env.SteerEnv.failure_text`.

        The states that are not finite are named before the sub-environments that failed so are reset.
        """
        return self.batch.failure_text(code)

    def render(self) -> tuple[Any, ...] | None:
        """The present picture (H, W, 3) of each sub-environment, or the list of those that were kept."""
        if self.render_mode is None:
            gym.logger.warn("render() draws nothing: make the environment with render_mode='rgb_array'")
            return None
        if not self._renderers:
            raise gym.error.ClosedEnvironmentError("render() was called after close(): make the environment anew")
        return tuple(renderer.given() for renderer in self._renderers)

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the threads, release the renderers, and end the episodes."""
        self.batch.close()
        self.batch.over[:] = True
        self.batch.episodes["end"] = 0  # so that no step resets
        self._renderers = []
