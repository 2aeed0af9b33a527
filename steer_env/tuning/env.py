"""One environment class for tuning: a step drives a parameter set of the assist through the scenario's tests."""

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steer_env.engine.specification import PlainSpecification
from steer_env.env import as_actions, check_keywords, clip_actions
from steer_env.episode.randomise import LIMITS, Conditions, Randomise
from steer_env.friction.numerics.check import number, whole
from steer_env.friction.numerics.frozen import frozen
from steer_env.metrics import Value, definition
from steer_env.targets import load as load_targets
from steer_env.tasks import Quantity
from steer_env.tuning import context, driving, reward, start
from steer_env.tuning.parameters import KNOWN, acting, car_with, keys, make_assist, values
from steer_env.tuning.scenarios.common.definition import SPEEDS, Scenario
from steer_env.vehicle import cars
from steer_env.vehicle import chassis as chassis_models
from steer_env.vehicle import tyre as tyres
from steer_env.vehicle.steering.eps import Assist
from steer_env.vehicle.steering.margins import Margins

SETS = 8  # default of the parameter sets in an episode
SPEED = 100.0 / 3.6  # default of the context's speed [m/s]
DETUNING = 0.8  # default of the largest offset of the start; assumed [1]
TOLERANCE = 0.1  # default of the width of a wanted band over that of the target band, about what hands notice; assumed
DRAWN_CONDITIONS = (
    "load",
    "road_friction",
    "friction_level",
    "speed",
)  # keys of RANGES; there are no sensors in the loop
_MARGINS = (
    Quantity("phase_margin", "deg", 180.0, "smallest one of the assist loop"),
    Quantity("gain_margin", "dB", 100.0, "smallest one of the assist loop"),
)
_REFUSED = Quantity("refused", "1", 1.0, "share of the metrics above that the tests refused; these are 0")


def wanted_metrics(scenario: Scenario) -> tuple[str, ...]:
    """The observed metrics that are tuned: those with a target band of the default targets that weighs."""
    terms = reward.terms(scenario, load_targets("compact"), None)
    return tuple(name for name in scenario.bounds if name in terms and terms[name].weight)


def observed_quantities(scenario: Scenario) -> tuple[Quantity, ...]:
    """All observations of a scenario in their order."""
    aims = ((name, definition(name).unit, scenario.bounds[name]) for name in wanted_metrics(scenario))
    return (
        *context.OBSERVED,
        *(Quantity(f"wanted_{name}", unit, bound, "middle of the wanted band") for name, unit, bound in aims),
        *(Quantity(f"last_{name}", "1", 1.0, "this parameter in the last action") for name in scenario.parameters),
        *(Quantity(name, definition(name).unit, bound, "of the last set") for name, bound in scenario.bounds.items()),
        *_MARGINS,
        _REFUSED,
    )


def _checked_parameters(parameters: Sequence[str]) -> tuple[str, ...]:
    """The parameters that the action sets, checked."""
    known = not isinstance(parameters, str) and set(parameters) <= set(KNOWN)
    if not known or not parameters or len(set(parameters)) != len(parameters):
        raise ValueError(f"parameters must be a list of {', '.join(KNOWN)}, each once, got {parameters!r}")
    return tuple(parameters)


class TuneEnv(PlainSpecification, gym.Env):
    """A car's assist is tuned for a friction law and a road; every id is this class with a scenario of its own.

    An episode starts with the car's own assist out of tune: an offset of every parameter is drawn and not observed. The
    wanted bands are narrow and lie about the metrics that the car's own assist gives in the context, inside the target
    bands, so that the best set is near the car's own one, wherever the start is.

    Arguments
    ---------
    friction : str, mapping or parameters, optional
        By default that of the car: LuGre, split over the sites of its steering. The name of a law
        (``friction.available()``), which then sits at one site below the torsion bar; with parameters as text,
        ``"lugre,F_c=1.2"``, or as a mapping, ``{"law": "lugre", "F_c": 1.2}``; sites as ``friction.resolve`` takes
        them; or parameters from ``friction.make``.
    speed : float, default 100/3.6
        Speed of the tests that have none of their own, 12 to 50 [m/s].
    vehicle : str, path or mapping, default "compact"
        A packaged car (``steer_env.vehicle.cars.available()``), a ``.toml`` or ``.json`` file, or a mapping with the
        contents of such a file.
    steering : {"column_eps", "rack_eps", "steer_by_wire"}, optional
        Kind of steering; the car's own by default. A packaged car that has another one is its packaged counterpart,
        where there is one: "compact" with "rack_eps" is "compact_rack_eps".
    chassis : {"single_track", "two_track"}, default "single_track"
        Chassis of the tests; parking always uses "two_track".
    tyre : str, optional
        A packaged tyre or a ``.tir`` file that replaces the car's own.
    targets : str, default "compact"
        Packaged target bands (``steer_env.targets.available()``) or a ``.toml`` file.
    detuning : float, default 0.8
        Largest offset of a parameter at the start, 0 to 1, in the unit of the action; 0: the start is the car's own
        assist.
    tolerance : float, default 0.1
        Width of the wanted bands over that of the target bands, above 0 and at most 1, where they are the same.
    randomise : mapping, optional
        What to draw at every reset: load, road_friction, friction_level, speed to (low, high), and under
        "friction" the law's own parameters, as in ``{"load": (0, 300), "friction": {"F_c": (0.6, 1.2)}}``.
    weights : mapping, optional
        Weights of reward terms that replace the scenario's.
    parameters : sequence of str, optional
        Parameters that the action sets, in this order, in place of the scenario's: those of ``PARAMETERS`` and
        ``FUNCTIONS`` in ``steer_env.tuning.parameters``.
    sets : int, optional, default 8
        Parameter sets after which an episode is truncated; with None it has no end, and the context stays.
    vector_reward : bool, default False
        Whether the reward is an array of float32, (reward_dim,), of the terms that weigh more than 0. Their sum, which
        the reward is otherwise, a float, agrees to 1e-6 of it, the rounding of float32. It has the form of
        MO-Gymnasium, with ``reward_space`` and ``reward_dim``; ``reward_components`` are the names of the terms.
        Gymnasium's checker warns of every reward that is no number:
        ``gymnasium.make(id, vector_reward=True, disable_env_checker=True)`` leaves it out.
    render_mode : None
        There is no rendering.

    Any other keyword is an error. ``reset(options=...)`` fixes what would be drawn. ``baseline_action`` is the action
    of the start, ``own_action`` that of the car's own assist.

    ``info`` has ``cost``, and dicts of floats ``context``, ``parameters`` (of the set), ``wanted`` (middles of the
    wanted bands), ``reward_terms`` and ``cost_terms``; after a step also ``evaluated`` (the set's metrics, NaN where
    one is refused), ``margins``, ``best`` (reward and parameters of the best set so far) and ``metrics`` (those of the
    best set), which a reset has not. ``units`` are those of the metrics, ``refused`` the reasons of the last set by
    metric, and ``best_action`` is the action of the best set so far.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own form)
    scenario: Scenario

    def __init__(
        self,
        *,
        friction: Any = None,
        speed: float = SPEED,
        vehicle: str | Mapping[str, Any] = "compact",
        steering: str | None = None,
        chassis: str = "single_track",
        tyre: str | None = None,
        targets: str = "compact",
        detuning: float = DETUNING,
        tolerance: float = TOLERANCE,
        randomise: Mapping[str, Any] | None = None,
        weights: Mapping[str, float] | None = None,
        parameters: Sequence[str] | None = None,
        sets: int | None = SETS,
        vector_reward: bool = False,
        render_mode: None = None,
        **unknown: Any,
    ) -> None:
        known = [key for key in inspect.signature(TuneEnv).parameters if key != "unknown"]
        check_keywords(self.scenario.name, unknown, known)
        if render_mode is not None:
            raise ValueError(f"tuning environments cannot render: render_mode must be None, got {render_mode!r}")
        self.render_mode = render_mode
        self.chassis = chassis_models.checked(chassis)
        if parameters is not None:
            self.scenario = replace(self.scenario, parameters=_checked_parameters(parameters))
        self.car = cars.load(vehicle, steering=steering)
        if parameters is None:
            self.scenario = replace(self.scenario, parameters=acting(self.car.assist, self.scenario.parameters))
        elif missing := set(parameters) - {*acting(self.car.assist, tuple(parameters))}:
            raise ValueError(
                f"{self.car.name} is steered by wire and has no {', '.join(sorted(missing))}: leave it out"
            )
        if tyre is not None:
            self.car = self.car._replace(tyre=tyres.load(tyre))
        self._limits = {name: LIMITS[name] for name in DRAWN_CONDITIONS}
        self._limits["speed"] = low, high = SPEEDS
        self._limits["road_friction"] = self.scenario.least_road_friction, LIMITS["road_friction"][1]
        self.speed = number("speed [m/s]", speed, minimum=low, maximum=high)
        law = self.car.friction if friction is None else friction
        self._randomise = Randomise(randomise, law, self.speed, self.car, self._limits)
        self.targets = load_targets(targets)
        self.terms = reward.terms(self.scenario, self.targets, weights)
        self.detuning = number("detuning", detuning, minimum=0.0, maximum=1.0)
        self.tolerance = number("tolerance", tolerance, minimum=0.0, maximum=1.0, above=True)
        self._quantities, self._aims = observed_quantities(self.scenario), wanted_metrics(self.scenario)
        self.wanted = self.terms  # with the bands of the present context
        bound = np.array([quantity.bound for quantity in self._quantities], np.float32)
        n = len(self.scenario.parameters)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (n,), np.float32)
        self.observation_space = gym.spaces.Box(-bound, bound, dtype=np.float32)
        self.sets = None if sets is None else whole("sets", sets, 1)
        self.reward_components = (*(name for name, term in self.terms.items() if term.weight), *reward.MARGIN_TERMS)
        if vector_reward:  # only then, as MO-Gymnasium's users tell such an environment by it
            self.reward_dim = len(self.reward_components)
            worst = [reward.worst_reward(self.terms, name) for name in self.reward_components]
            self.reward_space = gym.spaces.Box(np.array(worst, np.float32), np.zeros(self.reward_dim, np.float32))
        self._vector_reward = bool(vector_reward)
        self._drawn: tuple[Conditions, context.Reference] | None = None
        self._start = self._next = np.zeros(n)  # offset of the start, of this episode and of the one drawn last
        self._drives: tuple[driving.PreparedDrive, ...] = ()  # in the context; empty where others drive
        self._left = 0.0  # parameter sets left in the episode
        self.units = {name: definition(name).unit for name in self.scenario.metrics}
        self._forget()

    def _forget(self) -> None:
        """No set has been tried."""
        self.refused: dict[str, str] = {}
        self.best_action: NDArray[np.float32] | None = None
        self._best: dict[str, float] = {}  # reward and parameters of the best set
        self._metrics: dict[str, float] = {}  # of the best set

    def __getstate__(self) -> dict[str, Any]:
        # The motion of a manoeuvre's hands is a function within a function and cannot be pickled.
        kept = {key: value for key, value in self.__dict__.items() if key != "scenario"}
        return {**kept, "_drives": [drive[1:] for drive in self._drives], "_parameters": self.scenario.parameters}

    def __setstate__(self, state: dict[str, Any]) -> None:
        own = dict(state)
        self.scenario = replace(type(self).scenario, parameters=own.pop("_parameters"))
        self.__dict__.update(own)
        if self._drawn is not None:
            drives = driving.adapt_drives(self.scenario.drives, self.chassis, self._drawn[0])
            self._drives = tuple(
                driving.PreparedDrive(drive, car, frozen(p), course)
                for drive, (car, p, course) in zip(drives, state["_drives"])
            )

    @property
    def baseline_action(self) -> NDArray[np.float32]:
        """The action of the start."""
        return np.zeros(len(self.scenario.parameters), np.float32)

    @property
    def own_action(self) -> NDArray[np.float32]:
        """The action of the car's own assist, to the rounding of float32, in the present episode."""
        return (0.0 - self._start).astype(np.float32)

    @property
    def parameters(self) -> dict[str, tuple[str, float, float, float]]:
        """Of each parameter in the action: unit, value at -1, value of the start and value at 1."""
        a = self.car.assist
        named = [(name, KNOWN[name], x) for name, x in zip(self.scenario.parameters, self._start.tolist())]
        return {name: (p.unit, p.value(a, x - 1.0), p.value(a, x), p.value(a, x + 1.0)) for name, p, x in named}

    def tuned_car(self, action: NDArray[Any]) -> cars.Car:
        """The car with the parameter set of an action, whose assist is to the bit the one that :meth:`step` drives.

        ``steer_env.vehicle.cars.write(env.tuned_car(env.best_action), "tuned.toml")`` writes it as a car file.
        """
        return car_with(self.car, keys(self.car.assist, self._values(clip_actions(action))), f"{self.car.name}_tuned")

    def _values(self, action: NDArray[Any]) -> dict[str, float]:
        """The value of every parameter at an action in [-1, 1] in the present episode."""
        return values(self.car.assist, self.scenario.parameters, self._start + action)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Draw a context; ``options`` fix what would be drawn.

        Raises
        ------
        ValueError
            An option is unknown or out of its range, or the car does not reach a test's lateral acceleration.
        """
        drawn = self.draw(seed, options)
        if self._drawn is None or not self._drawn[0].same_plant(drawn):
            self._drives = driving.prepare_drives(self.scenario, self.car, self.chassis, drawn)
            known = driving.measure_reference(self._drives, self.car, self.chassis, drawn)
        else:
            known = self._drawn[1]
        return self.begin(drawn, known)

    def draw(self, seed: int | None, options: dict[str, Any] | None) -> Conditions:
        """The conditions of the next episode, as :meth:`reset` draws them, which has the drawn start."""
        super().reset(seed=None if seed is None else whole("seed", seed, 0))
        options = options or {}
        for key in options:
            if key not in DRAWN_CONDITIONS:
                raise ValueError(
                    f"unknown reset option {key!r}; {self.scenario.name} takes: {', '.join(DRAWN_CONDITIONS)}"
                )
        drawn = self._randomise.draw(self.np_random, options)
        speeds = {each.manoeuvre.speed for each in driving.adapt_drives(self.scenario.drives, self.chassis, drawn)}
        names = self.scenario.parameters
        self._next = start.draw_offsets(self.np_random, self.car, drawn.friction, names, sorted(speeds), self.detuning)
        return drawn

    def begin(self, drawn: Conditions, known: context.Reference) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode in the context of drawn conditions: what :meth:`reset` returns."""
        self._drawn, self._start = (drawn, known), self._next
        self.wanted = reward.wanted_terms(self.terms, known.own, self.tolerance)
        self._left = math.inf if self.sets is None else self.sets
        self._forget()
        nothing = {
            "reward_terms": dict.fromkeys((*self.terms, *reward.MARGIN_TERMS), 0.0),
            "cost_terms": dict.fromkeys(reward.MARGIN_TERMS, 0.0),
        }
        return self._observation(None, {}, None), self._info(self.baseline_action, nothing)

    def step(self, action: Any) -> tuple[NDArray[np.float32], Any, bool, bool, dict[str, Any]]:
        """Try a parameter set: an action in [-1, 1]; an action beyond is clipped.

        Raises
        ------
        ValueError
            The action, an array, list or tensor, has another shape or is not finite.
        RuntimeError
            The episode is over or has not begun, or the environment was closed.
        """
        action = clip_actions(as_actions("action", action, self.action_space.shape))
        if not self._left:
            raise RuntimeError("the episode is over or has not begun: call reset")
        return self.finish_step(action, driving.drive_set(self._drives, self.assist(action)))

    def close(self) -> None:
        """End the episode."""
        self._left = 0

    def assist(self, action: NDArray[Any]) -> Assist:
        """The assist of an action in [-1, 1]."""
        return make_assist(self.car.assist, self._values(action))

    def finish_step(
        self, action: NDArray[Any], tried: driving.SetResult
    ) -> tuple[NDArray[np.float32], Any, bool, bool, dict[str, Any]]:
        """What :meth:`step` returns for an action and what its tests gave."""
        found, margins = tried
        shortfall = reward.margin_shortfall(margins)
        terms = reward.reward_terms(self.wanted, found, shortfall)
        total = float(sum(terms.values()))
        self._left -= 1
        self.refused = {name: value.reason for name, value in found.items() if value.reason}
        evaluated = {name: found[name].value for name in self.units}
        if self.best_action is None or total > self._best["reward"]:
            self.best_action, self._metrics = action.copy(), evaluated
            self._best = {"reward": total, **self._values(action)}
        results = {
            "evaluated": evaluated,
            "margins": dict(zip(("phase_deg", "gain_db"), reward.degrees_and_decibels(margins))),
            "reward_terms": terms,
            "cost_terms": shortfall,
        }
        observation, given = self._observation(action, found, margins), self._info(action, results)
        own = np.array([terms[name] for name in self.reward_components], np.float32) if self._vector_reward else total
        return observation, own, False, self._left == 0, given

    def _info(self, action: NDArray[Any], results: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
        """The info of a parameter set with its results; plain floats, in dicts of their own."""
        assert self._drawn is not None
        every = {
            "context": self._drawn[1].context._asdict(),
            "parameters": self._values(action),
            "wanted": {name: sum(term.band.good) / 2.0 for name, term in self.wanted.items()},
            **results,
        }
        if self.best_action is not None:
            every |= {"best": self._best, "metrics": self._metrics}
        info: dict[str, Any] = {key: {name: float(x) for name, x in each.items()} for key, each in every.items()}
        info["cost"] = sum(info["cost_terms"].values())
        return info

    def _observation(
        self, action: NDArray[Any] | None, found: Mapping[str, Value], margins: Margins | None
    ) -> NDArray[np.float32]:
        """The context and the last parameter set with its results, which are zero before the first."""
        assert self._drawn is not None
        seen = np.zeros(len(self._quantities))
        aims = [sum(self.wanted[name].band.good) / 2.0 if name in self.wanted else 0.0 for name in self._aims]
        known = [*self._drawn[1].context, *aims]
        seen[: len(known)] = known
        if action is not None and margins is not None:
            metrics = [found[name] for name in self.scenario.bounds]
            refused = sum(bool(value.reason) for value in metrics) / len(metrics)
            held = [0.0 if value.reason else value.value for value in metrics]
            limits = reward.degrees_and_decibels(margins) if margins.stable else (0.0, 0.0)
            seen[len(known) :] = [*action, *held, *limits, refused]
        return np.clip(seen.astype(np.float32), self.observation_space.low, self.observation_space.high)  # type: ignore[attr-defined]
