"""One environment class for all tasks: the task makes it lane keeping, a weave or a lane change."""

import inspect
import math
from collections.abc import Iterable, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steer_env.engine.batch import EnvironmentBatch
from steer_env.engine.infos import Infos, checked_level
from steer_env.engine.row_wrapper import ALL, observed, wrapper_of
from steer_env.engine.specification import PlainSpecification
from steer_env.engine.state import State, copy_state, restore
from steer_env.friction.numerics.check import whole
from steer_env.rendering.modes import MODES, checked_mode, frame_rate
from steer_env.tasks import Task
from steer_env.tasks.common.definition import COST_LIMIT


class SteerEnv(PlainSpecification, gym.Env):
    """A car, its steering and a friction law in a task; every id is this class with a task of its own.

    Arguments
    ---------
    friction : str, mapping or parameters, optional
        By default that of the car: LuGre, split over the sites of its steering. The name of a law
        (``friction.available()``), which then sits at one site below the torsion bar; with parameters as text,
        ``"lugre,F_c=1.2"``, or as a mapping, ``{"law": "lugre", "F_c": 1.2}``; sites as ``friction.resolve`` takes
        them; a file with a fitted law, ``"fitted.json"``; or parameters from ``friction.make``.
    speed : float, optional
        Speed that is held [m/s]; the task's own by default, which is drawn at every reset where a task has a range. The
        task's documentation gives what is allowed.
    vehicle : str, path or mapping, default "compact"
        A packaged car (``steer_env.vehicle.cars.available()``), a ``.toml`` or ``.json`` file, or a mapping with the
        contents of such a file, as in ``{"base": "compact", "chassis": {"rear_spring": 24e3}}``.
    steering : {"column_eps", "rack_eps", "steer_by_wire"}, optional
        Kind of steering; the car's own by default. A packaged car that has another one is its packaged counterpart,
        where there is one: "compact" with "rack_eps" is "compact_rack_eps".
    chassis : {"single_track", "two_track"}, optional
        "single_track" has constant speed and first-order roll; "two_track" a body with six degrees of freedom, wheels
        that travel and rotate, drivetrain and brakes. The task's own by default.
    tyre : str, optional
        A packaged tyre or a ``.tir`` file that replaces the car's own.
    road : mapping or steer_env.vehicle.road.Road, optional
        Heights, friction of each side, grade and bank for ``chassis="two_track"``; level and dry by default. A mapping
        has a function of ``steer_env.vehicle.road`` (``make_road``, ``flat``, ``bump``, ``iso8608``) under "road" and
        its arguments beside it, as in ``{"road": "iso8608", "seed": 1, "road_class": "C"}``.
    control_dt : float, optional
        Time between actions: 1, 2 or 5 ms or a multiple of 10 ms, up to 100 ms [s]; the task's own by default, 50 ms
        for drivers, whose torque goes on a straight line from one decision to the next, and 10 ms for assists, whose
        action is held.
    driver : str, mapping or Driver, optional
        The driver model, in tasks that have one in the loop: one of ``steer_env.drivers.available()``, a mapping of one
        and its options, as in ``{"driver": "preview", "effort": 0.03, "co_contraction": 0.25}``, or from
        ``steer_env.drivers.make``; "preview" by default.
    randomise : mapping, optional
        What to draw at every reset: keys of ``steer_env.episode.randomise.RANGES`` to (low, high), and under "friction"
        the law's own parameters, as in ``{"load": (0, 300), "friction": {"F_c": (0.6, 1.2)}}``.
    weights : mapping, optional
        Weights of reward terms that replace the task's: 0 or more, for ``failure`` 0 or less. The reward stays below 1
        per second as long as the positive ones add up to 1 at most.
    normalise : bool, default True
        Whether each observation is divided by its usual size, which the task's documentation gives: PPO learns faster.
        ``observation_scale`` (O,) holds these sizes, or ones: an observation times it is in SI units.
    render_mode : None, "rgb_array", "rgb_array_list" or "human"
        A picture shows the car on its road from above, the handwheel and the live torque-angle loop. "rgb_array_list"
        keeps 25 pictures a simulated second, and ``render`` gives those since its last call or the reset. "human"
        shows them in a window in step with the simulated time. Needs the extra ``render``. Pictures at
        ``metadata["render_fps"]``, which is 1/``control_dt`` for "rgb_array", make a video in real time.
    info_level : {"full", "metrics", "none"}, default "full"
        What ``info`` holds: everything that is listed below, ``metrics`` alone, or nothing, which saves a single
        environment a third of the time of a step.
    wrapper : steer_env.RowWrapper class or its place as "module:Class", optional
        A wrapper of one's own around observations, actions and rewards: the same class in single and vector
        environments and in ``steer_env.sb3.SteerVecEnv``.

    Any other keyword is an error. ``spec`` holds the arguments as text, numbers, lists and mappings, whatever objects
    were given, so that ``gymnasium.make(EnvSpec.from_json(env.spec.to_json()))`` is the same environment to the bit. A
    file stays a path there; a Road that was given as an object is there with all its heights. Gymnasium's own vector
    environments keep what they were given: give them ``friction.as_mapping(...)``, ``drivers.as_mapping(...)``,
    ``steer_env.vehicle.road.as_mapping(...)``.

    ``reset(options=...)`` fixes what would be drawn: keys of ``RANGES`` and of the task.

    ``info`` has the same keys at reset, at every step and at the end: every plant channel under its name in SI;
    ``cost``; dicts of floats ``reward_terms``, ``cost_terms``, ``conditions`` (what was drawn: ``RANGES``, and
    ``friction_<parameter>`` for each parameter of the law that is drawn) and ``metrics`` (of the episode so far, zero
    at reset); and the integer ``failure``. ``terminated`` and ``truncated`` alone tell the end. The budget of every
    cost for an episode is ``cost_limit``.

    ``failure`` is 1 where the car left its lane or course, 2 where it rolled over, 3 where it spun out (moves more
    sideways than forward), 4 where a state is no longer finite, else 0; :meth:`failure_text` says it in words. A
    failure ends the episode. Where a task ends within a control step, reward, cost and metrics count up to that
    moment, while the observation is the one at the step's end.
    """

    metadata = {"render_modes": [*MODES], "render_fps": 20.0}  # noqa: RUF012 (Gymnasium's own form)
    cost_limit = COST_LIMIT
    task: Task

    def __init__(
        self, *, render_mode: str | None = None, info_level: str = "full", wrapper: Any = None, **arguments: Any
    ) -> None:
        self.render_mode, self.info_level = checked_mode(render_mode, MODES), checked_level(info_level)
        self.batch = batch_of(self.task, 1, arguments, ("render_mode", "info_level", "wrapper"))
        self.control_dt = self.batch.control_dt
        self.metadata = {**self.metadata, "render_fps": frame_rate(render_mode, self.control_dt)}
        self.observation_scale = self.batch.observation_scale
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = gym.spaces.Box(-self.batch.bound, self.batch.bound, dtype=np.float32)
        self._wrapper = wrapper_of(wrapper, 1, self.observation_space, self.action_space)
        if self._wrapper:
            self.action_space, self.observation_space = self._wrapper.action_space, self._wrapper.observation_space
        self._infos = Infos(self.batch, info_level)
        self._view_row()
        self._renderer: Any = None
        if render_mode is not None:
            from steer_env.rendering.renderer import Renderer  # here, because it takes long to import

            self._renderer = Renderer(self.batch, 0, render_mode)

    def _view_row(self) -> None:
        """Views of the only row of the batch."""
        self._observation = self.batch.arrays.observations[0]
        self._result = self.batch.episodes[["reward", "terminated", "truncated"]]

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._view_row()  # a copied view is an array of its own

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; ``options`` fix what would be drawn."""
        super().reset(seed=None if seed is None else whole("seed", seed, 0))
        self.batch.start([0], [self.np_random], options or {})
        if self._renderer is not None:
            self._renderer.start()
        observation = self._observation.copy()
        if self._wrapper:
            self._wrapper.reset(ALL)
            observation = observed(self._wrapper, observation[None], ALL)[0]
        self.batch.tell(self._infos.told)
        return observation, self._infos.of_first()

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold an action in [-1, 1] for ``control_dt``; an action beyond is clipped, as a motor or an arm would do.

        Raises
        ------
        ValueError
            The action, an array (1,), list or tensor, has another shape or is not finite.
        RuntimeError
            The episode is over or has not begun, or the environment was closed.
        """
        batch = self.batch
        if self._wrapper:
            action = self._wrapper.action(np.asarray(action)[None])[0]
        if not isinstance(action, np.ndarray) or action.shape != (1,) or action.dtype != np.float32:
            action = clip_actions(as_actions("action", action, (1,)))
        if batch.over[0]:
            clip_actions(action)
            raise RuntimeError("the episode is over or has not begun: call reset")
        if batch.step(action, (self._np_random,), self._infos.told) < 0:
            clip_actions(action)  # which says what is wrong
        result: Any = self._result.item()
        reward, terminated, truncated = result
        if self._renderer is not None:
            self._renderer.add()
        observation, info = self._observation.copy(), self._infos.of_first()
        if self._wrapper:
            reward = float(self._wrapper.reward(np.array([reward]), info)[0])
            observation = observed(self._wrapper, observation[None], ALL)[0]
        return observation, reward, terminated, truncated, info

    def get_state(self, include_rng: bool = True) -> State:
        """A copy of everything that decides how the episode goes on, but not of wrappers and spaces.

        Parameters
        ----------
        include_rng : bool
            Whether the random generator and the sensors' noise that is drawn already belong to it. Without them, an
            environment that takes the state draws its later noise and episodes from its own generator.
        """
        rng, seed = self.np_random, self.np_random_seed
        return copy_state(self.batch, ((rng, seed),) if include_rng else None)

    def set_state(self, state: State) -> None:
        """Continue from a state of :meth:`get_state`, of this environment or another of its kind.

        Raises
        ------
        TypeError
            It is not a state.
        ValueError
            It is of another id, version, car, law and so on, or of several sub-environments; the message names what
            differs.
        """
        ((rng, seed),) = restore(self.batch, state) or ((self._np_random, self._np_random_seed),)
        self._np_random, self._np_random_seed = rng, seed
        if self._renderer is not None:
            self._renderer.start()

    def failure_text(self, code: int | None = None) -> str:
        """A failure of ``info["failure"]`` in words, by default that of the last step; empty for none.

        If a state is not finite, the words name it.

        Raises
        ------
        ValueError
            There is no failure with this code.
        """
        return self.batch.failure_text(int(self.batch.episodes["failure"][0]) if code is None else code)

    def render(self) -> Any:
        """The present picture (H, W, 3); with "rgb_array_list" those that were kept; None with a window."""
        if self.render_mode is None:
            gym.logger.warn("render() draws nothing: make the environment with render_mode='rgb_array' or 'human'")
            return None
        if self._renderer is None:
            raise gym.error.ClosedEnvironmentError("render() was called after close(): make the environment anew")
        return self._renderer.given()

    def close(self) -> None:
        """Release the renderer, and end the episode."""
        self.batch.over[0] = True
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def batch_of(
    task: Task, n: int, arguments: Mapping[str, Any], others: tuple[str, ...], **more: Any
) -> EnvironmentBatch:
    """The batch for the arguments of an environment, which also takes ``others``; TypeError for an unknown keyword."""
    parameters = inspect.signature(EnvironmentBatch).parameters
    own = [key for key in parameters if key not in ("task", "n", "threads", "max_episode_steps")]
    check_keywords(task.name, [key for key in arguments if key not in own], (*own, *others))
    return EnvironmentBatch(task, n, **arguments, **more)


def check_keywords(name: str, unknown: Iterable[str], known: Iterable[str]) -> None:
    """TypeError for a keyword that an environment does not take, in Python's words, with the known ones.

    Programs look for these words: TorchRL leaves out the keyword that they name and tries again.
    """
    for key in unknown:
        raise TypeError(f"{name}.__init__() got an unexpected keyword argument {key!r}; it takes: {', '.join(known)}")


def as_actions(name: str, given: Any, shape: tuple[int, ...] | None) -> NDArray[Any]:
    """Actions as an array of real numbers, from an array, a list or a tensor; ValueError for another shape or kind."""
    try:
        actions = np.asarray(given)
    except (RuntimeError, TypeError, ValueError) as error:  # a ragged list, a tensor of another device
        raise ValueError(f"{name} must become an array of shape {shape}, got {given!r}: {error}") from None
    if actions.shape == shape and actions.dtype.kind in "fiu":
        return actions
    remedy = f"; numpy.reshape({name}, {shape}) has it" if actions.size == math.prod(shape or ()) else ""
    raise ValueError(f"{name} must be an array of shape {shape} of real numbers, got {given!r}{remedy}")


def clip_actions(actions: NDArray[Any]) -> NDArray[Any]:
    """Actions clipped to [-1, 1]; ValueError if one is not finite."""
    if np.minimum.reduce(actions, axis=None) >= -1.0 and np.maximum.reduce(actions, axis=None) <= 1.0:
        return actions
    bad = np.flatnonzero(~np.isfinite(actions))
    if bad.size:
        of_row = f" of sub-environment {bad[0]}" if actions.size > 1 else ""
        raise ValueError(f"action{of_row} must be finite (it is clipped to [-1, 1]), got {actions.ravel()[bad[0]]}")
    return np.clip(actions, -1.0, 1.0)
