"""One environment class for tuning: a step drives a set of assist parameters through the scenario's tests."""

import inspect
import math
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steer_env.env import check_keywords, clipped
from steer_env.friction.numerics.check import number
from steer_env.metrics import Value, definition
from steer_env.randomise import LIMITS, Conditions, Randomise
from steer_env.targets import load as load_targets
from steer_env.tasks import Quantity
from steer_env.tuning import context, reward, scenarios
from steer_env.tuning.parameters import PARAMETERS, tuned, values
from steer_env.tuning.scenarios import Scenario
from steer_env.vehicle import cars
from steer_env.vehicle import tyre as tyres
from steer_env.vehicle.steering.margins import Margins, worst_margins

SETS = 8  # in an episode
SPEED = 100.0 / 3.6  # by default [m/s]
KNOWN = ("load", "road_friction", "friction_level", "speed")  # of what may be drawn; no sensor, no delay is in the loop
_MARGINS = (
    Quantity("phase_margin", "deg", 180.0, "of the assist loop, at its worst"),
    Quantity("gain_margin", "dB", 100.0, "of the assist loop, at its worst"),
)
_REFUSED = Quantity("refused", "1", 1.0, "share of the metrics above that the tests refused, which are 0")


def observed(scenario: Scenario) -> tuple[Quantity, ...]:
    """Every observation of a scenario in its place."""
    return (
        *context.OBSERVED,
        *(Quantity(f"last_{name}", "1", 1.0, "in the last set's action") for name in scenario.parameters),
        *(Quantity(name, definition(name).unit, bound, "of the last set") for name, bound in scenario.bounds.items()),
        *_MARGINS,
        _REFUSED,
    )


class TuneEnv(gym.Env):
    """A car's assist to be tuned for a friction law and a road; the ids are this class with a scenario each.

    Arguments
    ---------
    friction : str or parameters, default "lugre"
        A law's name (``friction.available()``), for its defaults, or parameters from ``friction.make``.
    speed : float, default 100/3.6
        Of the tests that have none of their own, 12 to 50 [m/s].
    vehicle : str, default "compact"
        A packaged car (``steer_env.vehicle.cars.available()``) or your own in a ``.toml`` or ``.json`` file.
    chassis : {"single_track", "two_track"}, default "single_track"
        Parking stands on two tracks anyway.
    tyre : str, optional
        A packaged tyre or a ``.tir`` file in place of the car's own.
    targets : str, default "compact"
        Packaged target bands (``steer_env.targets.available()``) or your own in a ``.toml`` file.
    randomise : mapping, optional
        What to draw anew at every reset: load, road_friction, friction_level, speed to (low, high), and under
        "friction" the law's own parameters, as in ``{"load": (0, 300), "friction": {"F_c": (0.6, 1.2)}}``.
    weights : mapping, optional
        Weights of reward terms in place of the scenario's.
    render_mode : None
        Nothing is drawn.

    Any other keyword is an error. ``reset(options=...)`` fixes what would be drawn. ``baseline_action`` makes the car's
    own assist. ``info`` holds ``context``, ``parameters`` (of the set), and after a step ``evaluated`` (every metric
    with its unit, None where it is refused), ``refused`` (why), ``margins``, ``reward_terms``, ``cost`` and
    ``cost_terms``; at the end of an episode ``best``, its best set, and ``metrics``, what that set gave.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own form)
    scenario: Scenario

    def __init__(
        self,
        *,
        friction: Any = "lugre",
        speed: float = SPEED,
        vehicle: str = "compact",
        chassis: str = "single_track",
        tyre: str | None = None,
        targets: str = "compact",
        randomise: Mapping[str, Any] | None = None,
        weights: Mapping[str, float] | None = None,
        render_mode: None = None,
        **unknown: Any,
    ) -> None:
        check_keywords(unknown, [key for key in inspect.signature(TuneEnv).parameters if key != "unknown"])
        if render_mode is not None:
            raise ValueError(f"tuning draws nothing: render_mode must be None, got {render_mode!r}")
        self.render_mode = render_mode
        if chassis not in cars.SPEEDS:
            raise ValueError(f"chassis must be one of {', '.join(cars.SPEEDS)}, got {chassis!r}")
        self._chassis = chassis
        self.car = cars.load(vehicle)
        if tyre is not None:
            self.car = self.car._replace(tyre=tyres.load(tyre))
        self._limits = {name: LIMITS[name] for name in KNOWN}
        self._limits["speed"] = low, high = scenarios.SPEEDS
        self._limits["road_friction"] = self.scenario.slipperiest, LIMITS["road_friction"][1]
        self.speed = number("speed [m/s]", speed, minimum=low, maximum=high)
        self._randomise = Randomise(randomise, friction, self.speed, self._limits)
        self.targets = load_targets(targets)
        self.terms = reward.terms(self.scenario, self.targets, weights)
        self._quantities = observed(self.scenario)
        bound = np.array([quantity.bound for quantity in self._quantities], np.float32)
        n = len(self.scenario.parameters)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (n,), np.float32)
        self.observation_space = gym.spaces.Box(-bound, bound, dtype=np.float32)
        self._prepared: tuple[Conditions, context.Context, tuple[scenarios.Ready, ...]] | None = None
        self._sets = SETS  # tried so far; an episode is over at SETS
        self._best: dict[str, Any] = {}

    @property
    def baseline_action(self) -> NDArray[np.float32]:
        """The action that makes the car's own assist."""
        return np.zeros(len(self.scenario.parameters), np.float32)

    @property
    def parameters(self) -> dict[str, tuple[str, float, float, float]]:
        """Of each action: unit, value at -1, the car's own and value at 1."""
        a = self.car.assist
        named = ((name, PARAMETERS[name]) for name in self.scenario.parameters)
        return {name: (p.unit, p.value(a, -1.0), p.value(a, 0.0), p.value(a, 1.0)) for name, p in named}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Draw a context; ``options`` fix what would be drawn.

        Raises
        ------
        ValueError
            An unknown option or a value out of its range; a test whose lateral acceleration the car does not reach.
        """
        super().reset(seed=seed)
        options = options or {}
        for key in options:
            if key not in KNOWN:
                raise ValueError(f"unknown reset option {key!r}; {self.scenario.name} takes: {', '.join(KNOWN)}")
        drawn = self._randomise.draw(self.np_random, options)
        same = self._prepared and self._prepared[0].friction is drawn.friction and self._prepared[0][:4] == drawn[:4]
        if not same:
            found = context.context(self.car, self._chassis, drawn)
            self._prepared = drawn, found, scenarios.ready(self.scenario, self.car, self._chassis, drawn)
        self._sets, self._best = 0, {}
        return self._observation(None, {}, None), self._info(self.baseline_action)

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Try a set: an action in [-1, 1] (clipped).

        Raises
        ------
        ValueError
            An action of another shape, or not finite.
        RuntimeError
            Without a ``reset`` before.
        """
        shape = self.action_space.shape
        if not isinstance(action, np.ndarray) or action.shape != shape:
            raise ValueError(f"action must be an array of shape {shape}, got {action!r}")
        action = clipped(action)
        if self._sets == SETS or self._prepared is None:
            raise RuntimeError("the episode is over or has not begun: call reset")
        drives = self._prepared[2]
        assist = tuned(self.car.assist, values(self.car.assist, self.scenario.parameters, action))
        found = scenarios.evaluate(drives, assist)
        margins = self._margins(assist)
        lacks = reward.lacking(margins)
        earned = reward.earned(self.terms, found, lacks)
        total = float(sum(earned.values()))
        self._sets += 1
        info = self._info(action) | {
            "evaluated": {name: (None if value.reason else value.value, value.unit) for name, value in found.items()},
            "refused": {name: value.reason for name, value in found.items() if value.reason},
            "margins": {"phase_deg": math.degrees(margins.phase), "gain_db": reward.decibels(margins.gain)},
            "reward_terms": earned,
            "cost": float(sum(lacks.values())),
            "cost_terms": lacks,
        }
        if not self._best or total > self._best["reward"]:
            self._best = {"reward": total, "action": action.copy(), "parameters": info["parameters"], "values": found}
        truncated = self._sets == SETS
        if truncated:
            best = dict(self._best)
            info["metrics"] = {n: value.value for n, value in best.pop("values").items() if not value.reason}
            info["best"] = best
        return self._observation(action, found, margins), total, False, truncated, info

    def _margins(self, assist: Any) -> Margins:
        """The worst over the speeds at which the scenario drives."""
        assert self._prepared is not None
        speeds = {ready.drive.manoeuvre.speed for ready in self._prepared[2]}
        each = [worst_margins(self.car.column, assist, speed) for speed in sorted(speeds)]
        worst = min(each, key=lambda m: m.phase)
        return worst._replace(gain=min(m.gain for m in each), stable=all(m.stable for m in each))

    def _info(self, action: NDArray[Any]) -> dict[str, Any]:
        assert self._prepared is not None
        return {
            "context": self._prepared[1]._asdict(),
            "parameters": values(self.car.assist, self.scenario.parameters, action),
        }

    def _observation(
        self, action: NDArray[Any] | None, found: Mapping[str, Value], margins: Margins | None
    ) -> NDArray[np.float32]:
        """The context and the last set with what it gave; zeros for that before the first."""
        assert self._prepared is not None
        seen = np.zeros(len(self._quantities))
        known = self._prepared[1]
        seen[: len(known)] = known
        if action is not None and margins is not None:
            metrics = [found[name] for name in self.scenario.bounds]
            refused = sum(bool(value.reason) for value in metrics) / len(metrics)
            held = [0.0 if value.reason else value.value for value in metrics]
            sure = (math.degrees(margins.phase), reward.decibels(margins.gain)) if margins.stable else (0.0, 0.0)
            seen[len(known) :] = [*action, *held, *sure, refused]
        return np.clip(seen.astype(np.float32), self.observation_space.low, self.observation_space.high)  # type: ignore[attr-defined]
