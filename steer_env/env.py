"""One environment class; a task object makes it lane keeping, a weave, or what is to come."""

import inspect
import math
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from friction import resolve
from friction.bounds import within
from friction.check import number
from friction.kernel import bind, kernel
from steer_env.tasks import Task
from vehicle import cars, plant
from vehicle import tyre as tyres
from vehicle.assist import SAMPLE_TIME
from vehicle.road import Road

FAILURE = -100.0  # reward of a step that ends in a state that is not finite, or upside down: worse than driving on
ROLLED_OVER = 1.0  # roll angle from which on no car comes back [rad]


@kernel
def _observe(row, observed, situation, bound, out):
    """Observed channels and situation, clipped to the bounds."""
    n = observed.size
    for i in range(out.size):
        value = row[observed[i]] if i < n else situation[i - n]
        out[i] = within(value, -bound[i], bound[i])


class SteerEnv(gym.Env):
    """A car, its steering and a friction law under a task's rules; the ids are this class with a task each.

    Arguments
    ---------
    friction : str or parameters, default "lugre"
        A law's name (``friction.available()``), for its defaults, or parameters from ``friction.make``.
    speed : float, default 100/3.6
        Held speed, 3 to 70 [m/s].
    vehicle : str, default "compact"
        A packaged car (``vehicle.cars.available()``) or your own in a ``.toml`` or ``.json`` file.
    chassis : {"single_track", "two_track"}, default "single_track"
        Constant speed and first-order roll; or a body with six degrees of freedom, wheels that travel and spin,
        drivetrain and brakes.
    tyre : str, optional
        A packaged tyre or a ``.tir`` file in place of the car's own.
    road : vehicle.road.Road, optional
        Heights, friction of each side, grade and bank under ``chassis="two_track"``, for example
        ``vehicle.road.iso8608(seed, "C")``; level and dry by default.
    control_dt : float, default 0.01
        Time between actions, a whole number of milliseconds up to 100 ms [s].
    render_mode : None or "rgb_array"
        "rgb_array" makes ``render()`` draw the car on its road and the live torque-angle loop.

    Any other keyword is an error. ``info`` holds every plant channel under its name in SI, and ``reward_terms``.
    A state that turns non-finite ends the episode with a reward of -100; ``info["non_finite_state"]`` names it. So does
    a car on two tracks that rolls over; ``info["rolled_over"]`` is then True.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012 (Gymnasium's own form)
    make_task: Callable[[], Task]

    def __init__(
        self,
        *,
        friction: Any = "lugre",
        speed: float = 100.0 / 3.6,
        vehicle: str = "compact",
        chassis: str = "single_track",
        tyre: str | None = None,
        road: Road | None = None,
        control_dt: float = 0.01,
        render_mode: str | None = None,
        **unknown: Any,
    ) -> None:
        if unknown:
            known = [key for key in inspect.signature(SteerEnv).parameters if key != "unknown"]
            raise TypeError(f"unknown keyword {next(iter(unknown))!r}; the environments take: {', '.join(known)}")
        dt = number("control_dt [s]", control_dt, minimum=SAMPLE_TIME, maximum=0.1)
        self._samples = round(dt / SAMPLE_TIME)
        if not math.isclose(self._samples * SAMPLE_TIME, dt):
            raise ValueError(f"control_dt must be a whole number of milliseconds, got {control_dt!r} s")
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode must be None or one of {self.metadata['render_modes']}, got {render_mode!r}")
        self.render_mode = render_mode
        self.control_dt = dt
        self.task = task = self.make_task()
        self.speed = number("speed [m/s]", speed, minimum=cars.SPEED_MIN, maximum=cars.SPEED_MAX)
        car = cars.load(vehicle)
        if tyre is not None:
            car = car._replace(tyre=tyres.load(tyre))
        self.plant = car.plant(resolve(friction), speed=self.speed, robot=task.robot, chassis=chassis, road=road)
        bound = np.array([o.bound for o in (*task.channels, *task.situation)], np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = gym.spaces.Box(-bound, bound, dtype=np.float32)
        self._straight, self._straight_channels = plant.settled(self.plant)
        self._state = self._straight.copy()
        self._row = np.zeros((1, len(plant.channels(self.plant))))
        self._now_channels = self._row[0]
        self._situation = np.zeros(len(task.situation))
        self._observed = np.array([plant.CHANNEL[o.name] for o in task.channels])
        self._bound = bound
        self._inputs = np.zeros((0, len(plant.INPUTS)))
        self._names = tuple(name for name, _ in plant.channels(self.plant))
        self._run = bind(plant.run, self.plant, self._state, self._inputs, self._row, 1)
        self._observe = bind(_observe, self._now_channels, self._observed, self._situation, bound, bound)
        self._now = 0
        self._over = True
        self._action = 0.0
        self._renderer: Any = None
        if render_mode is not None:
            from steer_env.render import Renderer  # here, for matplotlib is slow to import

            self._renderer = Renderer()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode from straight running; ``options`` fixes what the task would draw (see the id)."""
        super().reset(seed=seed)
        self._inputs = self.task.start(self.np_random, self.speed, options or {})
        self._acted = self._inputs[:, self.task.action_input]
        self._state[:] = self._straight
        self._row[:] = self._straight_channels
        self._now = 0
        self._over = False
        self._action = 0.0
        if self._renderer is not None:
            self._renderer.clear()
            self._renderer.add(self._now_channels)
        info = self._channels()
        return self._look(info), info

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold an action in [-1, 1] (clipped, as a motor or an arm would) for ``control_dt``.

        Raises
        ------
        ValueError
            An action of another shape, or NaN.
        RuntimeError
            Without a ``reset`` before.
        """
        if not isinstance(action, np.ndarray) or action.shape != (1,):
            raise ValueError(f"action must be an array of shape (1,), got {action!r}")
        value = action.item()
        if not -1.0 <= value <= 1.0:
            if not math.isfinite(value):
                raise ValueError(f"action must be a finite number in [-1, 1], got {value}")
            value = math.copysign(1.0, value)
        end = self._now + self._samples
        if self._over or end > len(self._inputs):
            raise RuntimeError("the episode is over or has not begun: call reset")
        self._acted[self._now : end] = self.task.action_scale * value
        u = self._inputs[self._now : end]
        finite = self._run(self.plant, self._state, u, self._row, 1)
        self._now = end
        info = self._channels()
        observation = self._look(info)
        terms, terminated = self.task.judge(info, self._situation, value, value - self._action, self.control_dt)
        self._action = value
        reward = math.fsum(terms.values())
        truncated = end + self._samples > len(self._inputs)
        info["reward_terms"] = terms
        if not math.isfinite(reward) or not finite:
            # Runs are reproducible to the bit, so the episode's inputs lead to the same end, sample by sample.
            past = self._inputs[:end]
            info["non_finite_state"] = plant.first_non_finite(self.plant, self._straight, past) or "reward"
            self._over = True
            return np.nan_to_num(observation), FAILURE, True, truncated, info
        if abs(info["roll_angle"]) > ROLLED_OVER:
            info["rolled_over"] = True
            reward, terminated = FAILURE, True
        self._over = terminated
        if self._renderer is not None:
            self._renderer.add(self._now_channels)
        return observation, reward, terminated, truncated, info

    def _channels(self) -> dict[str, Any]:
        return dict(zip(self._names, self._now_channels.tolist()))

    def _look(self, channels: dict[str, Any]) -> NDArray[np.float32]:
        self.task.locate(channels, self._situation)
        observation = np.empty(len(self._bound), np.float32)
        self._observe(self._now_channels, self._observed, self._situation, self._bound, observation)
        return observation

    def render(self) -> NDArray[np.uint8] | None:
        """A frame (H, W, 3) of the episode so far if ``render_mode`` is "rgb_array"."""
        if self.render_mode is None:
            gym.logger.warn("render() draws nothing: make the environment with render_mode='rgb_array'")
            return None
        return self._renderer.frame(getattr(self.task, "path", None))

    def close(self) -> None:
        """Release the renderer."""
        self._renderer = None
