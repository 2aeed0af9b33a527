"""One environment class; a task makes it lane keeping, a weave, or what is to come."""

import inspect
from collections.abc import Iterable, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steer_env.batch import Lanes
from steer_env.tasks import Task


class SteerEnv(gym.Env):
    """A car, its steering and a friction law under a task's rules; the ids are this class with a task each.

    Arguments
    ---------
    friction : str or parameters, default "lugre"
        A law's name (``friction.available()``), for its defaults, or parameters from ``friction.make``.
    speed : float, optional
        Held speed, 3 to 70, when parking 0 to 3 [m/s]; the task's own by default.
    vehicle : str, default "compact"
        A packaged car (``steer_env.vehicle.cars.available()``) or your own in a ``.toml`` or ``.json`` file.
    chassis : {"single_track", "two_track"}, optional
        Constant speed and first-order roll; or a body with six degrees of freedom, wheels that travel and spin,
        drivetrain and brakes. The task's own by default.
    tyre : str, optional
        A packaged tyre or a ``.tir`` file in place of the car's own.
    road : steer_env.vehicle.road.Road, optional
        Heights, friction of each side, grade and bank under ``chassis="two_track"``, for example
        ``steer_env.vehicle.road.iso8608(seed, "C")``; level and dry by default.
    control_dt : float, default 0.01
        Time between actions: 1, 2 or 5 ms or a multiple of 10 ms, up to 100 ms [s].
    driver : str or Driver, optional
        Who steers where a driver model is in the loop: ``steer_env.drivers.available()`` or from
        ``steer_env.drivers.make``; "preview" by default.
    randomise : mapping, optional
        What to draw anew at every reset: keys of ``steer_env.randomise.RANGES`` to (low, high), and under "friction"
        the law's own parameters, as in ``{"load": (0, 300), "friction": {"F_c": (0.6, 1.2)}}``.
    weights : mapping, optional
        Weights of reward terms in place of the task's.
    render_mode : None, "rgb_array" or "human"
        Draws the car on its road from above, the handwheel and the live torque-angle loop; "human" in a window that
        keeps pace with the simulated time. Needs the extra ``render``.

    Any other keyword is an error. ``reset(options=...)`` fixes what would be drawn: keys of ``RANGES`` and the task's.
    ``info`` holds every plant channel under its name in SI, ``reward_terms``, ``cost`` and ``cost_terms``, and at an
    episode's end ``metrics``. A state that turns non-finite ends the episode with a reward of -100;
    ``info["non_finite_state"]`` names it. So does a car that rolls over or goes more sideways than ahead;
    ``info["rolled_over"]`` or ``info["spun"]`` is then True. Where a task ends within a control step, reward, cost and
    metrics count up to there; the observation is that of the step's end. ``reset`` has what was drawn in
    ``info["conditions"]``.
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 25}  # noqa: RUF012 (Gymnasium's own form)
    task: Task

    def __init__(self, *, render_mode: str | None = None, **arguments: Any) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode must be None or one of {self.metadata['render_modes']}, got {render_mode!r}")
        self.render_mode = render_mode
        self.lanes = lanes_of(self.task, 1, arguments, ("render_mode",))
        self.control_dt = self.lanes.control_dt
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = gym.spaces.Box(-self.lanes.bound, self.lanes.bound, dtype=np.float32)
        self._names = tuple(name for name, _ in self.lanes.channels)
        self._reward_names = tuple(term.name for term in self.task.rewards)
        self._cost_names = tuple(term.name for term in self.task.costs)
        # Views of the one lane.
        self._row, self._terms, self._observation = (
            array[0] for array in (self.lanes.row, self.lanes.weighted, self.lanes.observation)
        )
        self._renderer: Any = None
        if render_mode is not None:
            from steer_env.rendering.renderer import Renderer  # here, for what draws is slow to import

            self._renderer = Renderer(self.lanes, render_mode, self.metadata["render_fps"])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; ``options`` fix what would be drawn."""
        super().reset(seed=seed)
        self.lanes.start(0, self.np_random, options or {})
        if self._renderer is not None:
            self._renderer.start()
        return self.lanes.observation[0].copy(), {**self._channels(), "conditions": self.lanes.drawn(0)}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold an action in [-1, 1] (clipped, as a motor or an arm would) for ``control_dt``.

        Raises
        ------
        ValueError
            An action of another shape, or not finite.
        RuntimeError
            Without a ``reset`` before.
        """
        lanes = self.lanes
        if not isinstance(action, np.ndarray) or action.shape != (1,) or action.dtype.kind not in "fiu":
            raise ValueError(f"action must be an array of shape (1,) of real numbers, got {action!r}")
        if not -1.0 <= action[0] <= 1.0:
            action = clipped(action)
        if lanes.over[0]:
            raise RuntimeError("the episode is over or has not begun: call reset")
        lanes.step(action, (self.np_random,))
        book: Any = lanes.book.item()
        *_, reward, cost, terminated, truncated, _ = book
        info = self._channels()
        terms = self._terms.tolist()
        info["reward_terms"] = dict(zip(self._reward_names, terms))
        info["cost"] = cost
        info["cost_terms"] = dict(zip(self._cost_names, terms[len(self._reward_names) :]))
        if terminated or truncated:
            lanes.over[0] = True
            info["metrics"] = lanes.figures(0)
            info |= lanes.failure(0)
        if self._renderer is not None:
            self._renderer.add()
        return self._observation.copy(), reward, terminated, truncated, info

    def _channels(self) -> dict[str, Any]:
        return dict(zip(self._names, self._row.tolist()))

    def render(self) -> NDArray[np.uint8] | None:
        """A frame (H, W, 3) of the episode so far if ``render_mode`` is "rgb_array"; "human" shows it in a window."""
        if self.render_mode is None:
            gym.logger.warn("render() draws nothing: make the environment with render_mode='rgb_array' or 'human'")
            return None
        return self._renderer.frame()

    def close(self) -> None:
        """Release the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def lanes_of(task: Task, n: int, arguments: Mapping[str, Any], others: tuple[str, ...], **more: Any) -> Lanes:
    """Lanes from the arguments of an environment; TypeError for one that neither they nor the environment take."""
    own = [key for key in inspect.signature(Lanes).parameters if key not in ("task", "n", *more)]
    check_keywords([key for key in arguments if key not in own], (*own, *others))
    return Lanes(task, n, **arguments, **more)


def check_keywords(unknown: Iterable[str], known: Iterable[str]) -> None:
    """TypeError for a keyword that an environment does not take."""
    for key in unknown:
        raise TypeError(f"unknown keyword {key!r}; the environment takes: {', '.join(known)}")


def clipped(actions: NDArray[Any]) -> NDArray[Any]:
    """Actions clipped to [-1, 1]; ValueError where one is not finite."""
    bad = np.flatnonzero(~np.isfinite(actions))
    if bad.size:
        of_lane = f" of lane {bad[0]}" if actions.size > 1 else ""
        raise ValueError(f"action{of_lane} must be finite (it is clipped to [-1, 1]), got {actions.ravel()[bad[0]]}")
    return np.clip(actions, -1.0, 1.0)
