"""Several episodes of one task at once: the common engine of the single and the vector environment.

A row of the batch is one sub-environment: its plant, its episode's setup, and what the kernels remember. A step of all
rows is one call of :func:`steer_env.engine.kernels.step`, or one in each thread. Each row draws from its own generator.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env import drivers
from steer_env.engine import kernels
from steer_env.engine.arrays import EPISODE, allocate, layout, scores, stored
from steer_env.engine.sensor_noise import SensorNoise
from steer_env.episode.randomise import LIMITS, RANGES, SENSOR_NOISE, Conditions, Randomise, with_level
from steer_env.episode.timing import SAMPLES_PER_UPDATE
from steer_env.friction import sites
from steer_env.friction.numerics.check import number, whole
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.held import NOTHING, Called, Holder, called
from steer_env.friction.numerics.kernel import bind
from steer_env.friction.numerics.packing import numbers, structure
from steer_env.friction.numerics.thread_pool import ThreadPool
from steer_env.manoeuvres.common.driving import sine_response
from steer_env.tasks.common.definition import (
    FAILURE,
    FAILURES,
    NON_FINITE,
    EpisodeContext,
    EpisodeSetup,
    Scenery,
    Script,
    Task,
)
from steer_env.vehicle import cars, plant
from steer_env.vehicle import chassis as chassis_models
from steer_env.vehicle import tyre as tyres
from steer_env.vehicle.road import Road, resolve
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

_POSE = ("x", "y", "yaw_angle")


class EnvironmentBatch:
    """``n`` episodes of a task; :class:`steer_env.env.SteerEnv` describes the arguments.

    Attributes
    ----------
    task : Task
    n : int
    observed : tuple of Quantity
        The observations in their order.
    control_dt : float
        Time between actions [s].
    car : Car
    chassis : str
    road : Road or None
    driver : Driver or None
        The driver model in the loop.
    channels, states : tuple of str
        Names of the plant's channels and states.
    observation_scale : (O,) array
        SI value of an observation of 1: the usual sizes with ``normalise``, ones without.
    bound : (O,) array of float32
        The observation space spans +- these.
    arrays : BatchArrays
        States, channels, observations and so on of all rows.
    episodes : (n,) array of EPISODE
        Progress of the episodes; the same memory as ``arrays.episodes``.
    over : (n,) array of bool
        Whether the episode is over or has not begun.
    results : tuple of (n,) array
        Reward of the last step, and whether it terminated and truncated the episode; views of ``episodes``.
    conditions : list of Conditions
        What was drawn for each episode.
    condition_names : tuple of str
        Names of the conditions in infos.
    condition_values : (n, names) array
        Their values for each episode.
    noise : SensorNoise
    drivers : DriverBatch or None
    """

    def __init__(
        self,
        task: Task,
        n: int,
        *,
        friction: Any = None,
        speed: float | None = None,
        vehicle: str | Mapping[str, Any] = "compact",
        steering: str | None = None,
        chassis: str | None = None,
        tyre: str | None = None,
        road: Road | Mapping[str, Any] | None = None,
        control_dt: float | None = None,
        driver: Any = None,
        randomise: Mapping[str, Any] | None = None,
        weights: Mapping[str, float] | None = None,
        normalise: bool = True,
        threads: int = 1,
        max_episode_steps: int | None = None,
    ) -> None:
        self.task, self.n, self.observed = task, n, task.observed
        self.chassis, self.road = _checked_chassis(task, chassis), resolve(road)
        if driver is not None and not task.driver_in_loop:
            raise ValueError(f"{task.name} has no driver model in its loop, so it takes no driver, got {driver!r}")
        self.control_dt, samples = _checked_control_dt(task.control_dt if control_dt is None else control_dt)
        limits = task.speed_limits(self.chassis)
        if task.draw_scenario is not None:
            if speed is not None or "speed" in (randomise or {}):
                raise ValueError(f"{task.name} draws its speeds with its scenarios: leave speed out")
            limits = (task.speed, task.speed)
        if task.speeds is not None and speed is None and isinstance(randomise, Mapping | None):
            randomise = {"speed": task.speeds, **(randomise or {})}
        given = task.speed if speed is None else speed
        speed = number("speed [m/s]", given, minimum=limits[0], maximum=limits[1])
        self.car = cars.load(vehicle, steering=steering)
        if tyre is not None:
            self.car = self.car._replace(tyre=tyres.load(tyre))
        self.driver = drivers.resolve("preview" if driver is None else driver) if task.driver_in_loop else None
        law = self.car.friction if friction is None else friction
        self._randomise = Randomise(randomise, law, speed, self.car, LIMITS | {"speed": limits})
        weights_of = _weights(task, weights)

        usual = self._randomise.usual
        self._free = self.car.plant(usual.friction, usual.speed, chassis=self.chassis, road=self.road)
        template = self._template = self._plant(usual, task.robot, self.driver)
        for corner in self._randomise.corners:  # refused now, not in some later episode
            with_level(template._replace(friction=corner.friction), corner)
        self.channels = tuple(name for name, _ in plant.channels(template))
        self.states = tuple(name for name, _ in plant.state_names(template))
        self._pose_states = [self.states.index(name) for name in _POSE]
        self._pose_channels = [plant.CHANNEL[name] for name in _POSE]
        delay_steps = round(LIMITS["delay"][1] / self.control_dt)
        self.arrays = allocate(task, template, n, samples, delay_steps)
        self.observation_scale = _scales(task, normalise)
        of_rewards = np.array(list(weights_of.values()))
        self._layout = layout(task, template, samples, of_rewards, self.observation_scale, max_episode_steps)
        self.bound = (self._layout.bounds / self.observation_scale).astype(np.float32)
        self.over = np.ones(n, bool)
        self.conditions: list[Conditions] = [usual] * n
        self.condition_names = (*self._randomise.names, *(["scenario"] if task.draw_scenario else []))
        self.condition_values = np.zeros((n, len(self.condition_names)))
        self.condition_values[:, : len(self._randomise.names)] = usual.values(self._randomise.names)
        self.untold = np.empty((0, n))
        self.noise = SensorNoise(n, np.array([SENSOR_NOISE.get(quantity.name, 0.0) for quantity in self.observed]))
        self.drivers: drivers.DriverBatch | None = None
        self._bind()
        self._pool = ThreadPool(whole("threads", threads, 1))
        own = numbers(template)
        states, channels, straight = self._settled(own[None])
        self._usual_start, self._straight = (own, states[0], channels[0]), bool(straight[0])
        if self.driver:
            self.drivers = drivers.DriverBatch(self.driver, self.car, n, self.steering_response, usual)

    def _bind(self) -> None:
        """Views of the arrays, and the compiled kernels for their types."""
        a, at = self.arrays, self._layout
        self.episodes = a.episodes.view(EPISODE, np.ndarray)
        self._scores = scores(self.task, a)
        self.results = self.episodes["reward"], self.episodes["terminated"], self.episodes["truncated"]
        self._given = a.actions[:, None]
        fours = self.n >= 4 and plant.side_by_side(self._template)
        drawn = (self._template.friction, *(corner.friction for corner in self._randomise.corners))
        most = max(drawn, key=sites.active)  # a site may be without friction where nothing is drawn
        self._outline = structure(plant.bound(self._template._replace(friction=most), wide=fours))
        self._hold_plants = Holder(a, at, self._outline)
        self._advance_kernel = kernels.advance_fours if fours else kernels.advance
        self._advance = bind(self._advance_kernel, self._hold_plants(a, at, self._outline), kernels.GIVEN, 0, self.n)
        begin = plant.begin_fours if fours else plant.begin_rows
        self._begin = bind(begin, self._outline, a.plants, a.states, np.zeros(self.n, int), 0, self.n)
        self._hold_rows = Holder(*self._of_rows(NOTHING, NOTHING))
        self._held_of: Any = ()
        self._hold()
        self._step = bind(kernels.step, self._held_rows, kernels.STEP, self.untold, 0, self.n)

    def _of_rows(self, of_drivers: Called, cars: Called) -> tuple[Any, ...]:
        """What the kernel ``step`` takes."""
        a = self.arrays
        own = a, self._scores, self._layout, self.task.parameters, self.over, self.condition_values
        return (*own, of_drivers, cars)

    def _hold(self) -> None:
        """Put the arrays where the kernels find them, if one was replaced since."""
        a, of_drivers = self.arrays, self.drivers and self.drivers.arrays
        if self._held_of and self._held_of[0] is a and self._held_of[1] is of_drivers:
            return
        self._held_of = a, of_drivers
        self._held_plants = self._hold_plants(a, self._layout, self._outline)
        acts = NOTHING
        if self.drivers is not None:
            acts = self.drivers.called(a.episodes, a.channels, a.task_observations, a.scripted_inputs)
        self._held_rows = self._hold_rows(*self._of_rows(acts, called(self._advance_kernel, self._held_plants)))

    def __getstate__(self) -> dict[str, Any]:
        # Addresses and compiled functions stay in their process, and some arrays are views of others.
        left_out = (
            "_advance",
            "_advance_kernel",
            "_begin",
            "_step",
            "episodes",
            "results",
            "_scores",
            "_given",
            "_outline",
        )
        held = ("_hold_plants", "_hold_rows", "_held_of", "_held_plants", "_held_rows")
        return {key: value for key, value in self.__dict__.items() if key not in (*left_out, *held)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        # A copied array can be written to, which is another type to a kernel.
        self._free, self._template = frozen(self._free), frozen(self._template)
        self._bind()

    def _plant(self, drawn: Conditions, robot: bool, driver: drivers.Driver | None = None) -> plant.Plant:
        """The plant of an episode, with a robot, with the arms of a driver or with free hands.

        As :meth:`steer_env.vehicle.cars.car.Car.plant` makes it, but only what the draws change is made anew.
        """
        p = self._free
        if not drawn.same_motion(self._randomise.usual):
            loaded = self.car.loaded(drawn.load)
            p = p._replace(chassis=loaded.running(drawn.speed, drawn.road_friction, self.chassis, self.road))
        p = with_level(p._replace(friction=drawn.friction, robot=float(robot)), drawn)
        return p if robot or driver is None else drivers.with_arms(p, driver.arm)

    def _runner(self, own: Array) -> Callable[..., None]:
        """Runs the plant of these numbers as :func:`steer_env.vehicle.plant.run` does, by the batch's own kernel."""
        finite = np.ones(1, bool)

        def run(_: Any, state: Array, inputs: Array, channels: Array, substeps: int) -> None:
            a = self.arrays._replace(
                plants=own[None], states=state[None], inputs=inputs[None], channels=channels, finite=finite
            )
            self._advance(self._hold_plants(a, self._layout, self._outline), kernels.GIVEN, 0, 1)

        return run

    def _settled(self, plants: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """States (K, S) and channels (K, C) of plants, by their numbers (K, N), as ``plant.settled`` gives them.

        And whether each car (K,) begins in balance.
        """
        k, given = len(plants), self.arrays
        a = given._replace(
            plants=plants,
            states=np.zeros((k, given.states.shape[1])),
            inputs=np.zeros((k, plant.SETTLING, given.inputs.shape[2])),
            channels=np.zeros((k, given.channels.shape[1])),
            finite=np.ones(k, bool),
        )
        samples, held = np.zeros(k, int), self._hold_plants(a, self._layout, self._outline)

        def settle(low: int, high: int) -> None:
            self._begin(self._outline, a.plants, a.states, samples, low, high)
            for i in range(low, high):
                for _ in range(samples[i] // plant.SETTLING):
                    self._advance(held, kernels.GIVEN, i, i + 1)

        self._pool.run(k, settle)
        plant.start_line(self._template, a.states, a.channels)
        return a.states, a.channels, samples == plant.SETTLING

    @property
    def usual_conditions(self) -> Conditions:
        """The conditions of an episode if nothing is drawn."""
        return self._randomise.usual

    def steering_response(self, conditions: Conditions, amplitude: float, frequency: float) -> NDArray[np.complex128]:
        """Hand torque, lateral speed and yaw rate over a sine of the handwheel angle in some conditions.

        As :func:`steer_env.manoeuvres.common.driving.sine_response`, with an amplitude [rad] and a frequency [Hz].
        """
        p = self._plant(conditions, robot=True)
        return sine_response(p, amplitude, frequency, self._runner(numbers(p)))

    def start(self, rows: Sequence[int], generators: Sequence[np.random.Generator], options: Mapping[str, Any]) -> None:
        """Begin an episode in each of the ``rows``, with draws from its own of the ``generators``, one for every row.

        ``options`` fix what would be drawn. ValueError for an unknown option.
        """
        _check_options(self.task, options)
        begun = {i: self._draw(i, generators[i], options) for i in rows}
        a, own = self.arrays, [i for i, (drawn, _) in begun.items() if not self._runs_as_usual(drawn)]
        if own:
            a.states[own], a.channels[own], _ = self._settled(a.plants[own])
        for i, (drawn, pose) in begun.items():
            a.states[i, self._pose_states] = a.channels[i, self._pose_channels] = pose
            self.over[i] = False
            self.set_conditions(i, drawn)
            if self.drivers is not None and self.episodes["driven"][i]:
                self.drivers.start(i, drawn)
            a.noise[i] = self.noise.begin(i, drawn.sensor_noise, generators[i])
            self._hold()
            self._step(self._held_rows, kernels.BEGIN, self.untold, i, i + 1)

    def _draw(
        self, i: int, rng: np.random.Generator, options: Mapping[str, Any]
    ) -> tuple[Conditions, tuple[float, float, float]]:
        """Draw an episode for row ``i`` and store it: its conditions, and the pose at its start.

        The state is stored where the car runs straight ahead as usual.
        """
        task = self.task
        drawn = self._randomise.draw(rng, {key: value for key, value in options.items() if key in RANGES})
        own = {key: task.checked_option(key, value) for key, value in options.items() if key in task.options}
        scenario = 0
        if task.draw_scenario is not None:
            scenario, speed = task.draw_scenario(rng, own)
            drawn = drawn._replace(speed=speed)
        setup = task.draw_setup(rng, EpisodeContext(self.car, drawn.speed, scenario), own)
        self._store(i, setup, drawn)
        return drawn, setup.pose

    def set_conditions(self, i: int, drawn: Conditions) -> None:
        """Note what was drawn for the episode of row ``i``."""
        self.conditions[i] = drawn
        values = drawn.values(self._randomise.names)
        self.condition_values[i, : len(values)] = values
        if self.task.draw_scenario is not None:
            self.condition_values[i, -1] = self.arrays.task_data[i, 0]

    def deliver(self) -> None:
        """Give every row its present observation: that of its delay, over this batch's scales."""
        past, episodes = self.arrays.past_observations, self.episodes
        delayed = (episodes["latest"] - episodes["delay"]) % past.shape[1]
        rows, own = np.arange(self.n), len(self.task.channels) + 1  # the last action is known without delay
        seen = past[rows, delayed]
        seen[:, own] = past[rows, episodes["latest"], own]
        self.arrays.observations[:] = seen / self.observation_scale

    def _store(self, i: int, setup: EpisodeSetup, drawn: Conditions) -> None:
        """Put an episode's setup and its plant into the arrays."""
        self.over[i] = True  # until it has begun: another row, or its own plant, may be refused
        path = np.zeros((0, 4)) if setup.path is None else setup.path
        data = np.zeros(0) if setup.data is None else setup.data
        script, setups = setup.scripted_inputs, {"paths": path[None], "task_data": data[None]}
        if isinstance(script, Script) and self._shares(script.factors):
            updates, self.arrays.scales[i] = script.factors.shape[1], script.scale
        else:
            setups["scripted_inputs"] = setup.inputs()[None]
            updates, self.arrays.scales[i] = setups["scripted_inputs"].shape[1], math.nan
        self.arrays = a = stored(self.arrays, slice(i, i + 1), setups)
        robot = self.task.robot if setup.robot is None else setup.robot
        driven = self.driver is not None and not robot
        if self._runs_as_usual(drawn):
            a.plants[i], a.states[i], a.channels[i] = self._usual_start
            if not drawn.same_plant(self._randomise.usual):
                a.plants[i] = numbers(with_level(self._template._replace(friction=drawn.friction), drawn))
        else:
            a.plants[i] = numbers(self._plant(drawn, robot, self.driver if driven else None))
        episode = np.zeros((), EPISODE)
        episode["end"] = (updates - 1) * SAMPLES_PER_UPDATE
        episode["release"] = -1 if setup.release_time is None else round(setup.release_time / SAMPLE_TIME)
        episode["path_points"], episode["data_size"] = len(path), len(data)
        episode["speed"] = episode["held_speed"] = drawn.speed
        episode["action_gain"], episode["driven"] = drawn.action_gain, driven
        episode["action_kept"] = math.exp(-SAMPLE_TIME / drawn.action_lag) if drawn.action_lag > 0.0 else 0.0
        episode["delay"] = round(drawn.delay / self.control_dt)
        self.episodes[i] = episode
        a.task_memory[i] = a.metrics[i] = a.terms[i] = 0.0
        a.finite[i] = True

    def _shares(self, factors: Array) -> bool:
        """Whether a script is the one that the rows share: the first that comes."""
        if not self.arrays.factors.size:
            self.arrays = self.arrays._replace(factors=np.array(factors, order="C"))
        return np.array_equal(self.arrays.factors, factors)

    def scripts(self) -> Array:
        """The scripted inputs (n, U, M) of every row, those of the shared script too."""
        a = self.arrays
        shared = np.flatnonzero(~np.isnan(a.scales)).tolist()
        updates = max(a.scripted_inputs.shape[1], a.factors.shape[1] if shared else 0)
        found = np.zeros((self.n, updates, a.factors.shape[2]))
        found[:, : a.scripted_inputs.shape[1]] = a.scripted_inputs
        for i in shared:
            found[i, : a.factors.shape[1]] = Script(a.factors, a.scales[i]).inputs()
        return found

    def _runs_as_usual(self, drawn: Conditions) -> bool:
        """Whether a car begins as where nothing is drawn: friction does not act straight ahead."""
        usual = self._randomise.usual
        same = drawn.same_motion(usual) if self._straight else drawn.same_plant(usual)
        return self.task.draw_scenario is None and same

    def step(self, actions: NDArray[Any], generators: Sequence[Any], told: Array) -> int:
        """Hold actions (n, 1), clipped to [-1, 1], for ``control_dt`` in every row.

        The results are in ``arrays``, ``episodes`` and ``told``. A row whose episode is over is advanced as well, but
        its results have no meaning, and it draws nothing from its generator.

        Returns
        -------
        int
            How many episodes ended, which are over now; or below zero where an action is not finite, and nothing was
            done.
        """
        self._given[...] = actions
        if self.noise.noisy:
            if not np.isfinite(self._given).all():
                return -1
            self.noise.advance(~self.over, generators, self.arrays.noise)
        self._hold()
        return sum(self._pool.run(self.n, self._step, self._held_rows, kernels.STEP, told))

    def tell(self, told: Array) -> Array:
        """Write what infos are made of, as :func:`steer_env.engine.kernels.step` does, and return it."""
        self._hold()
        self._step(self._held_rows, kernels.TELL, told, 0, self.n)
        return told

    def failure_text(self, code: Any) -> str:
        """A failure in words, empty for 0; that of a state names those of the rows that failed so in the last step.

        Raises
        ------
        ValueError
            There is no failure with this code.
        """
        code = whole("failure", code, 0)
        if code >= len(FAILURES):
            raise ValueError(f"failure must be a whole number from 0 to {len(FAILURES) - 1}, got {code}")
        rows = np.flatnonzero((self.episodes["failure"] == NON_FINITE) & (code == NON_FINITE))
        names = dict.fromkeys(self._first_non_finite(i) for i in rows.tolist())
        return f"{FAILURES[code]}: {', '.join(names)}" if names else FAILURES[code]

    def _first_non_finite(self, i: int) -> str:
        """Repeat the last round of row ``i``, sample by sample; a run is reproducible to the bit."""
        a, row = self.arrays, slice(i, i + 1)
        state, channels, run = a.previous_states[i].copy(), a.channels[row].copy(), self._runner(a.plants[i])
        for k in range(self._layout.samples_per_round):
            run(None, state, a.inputs[i, k : k + 1], channels, 1)
            bad = np.flatnonzero(~np.isfinite(state))
            if bad.size:
                return plant.state_name(self._template, int(bad[0]))
        return "the reward"

    def path(self, i: int) -> Array | None:
        """The path (P, 4) of row ``i``, or None."""
        points = self.episodes["path_points"][i]
        return self.arrays.paths[i, :points] if points else None

    def scenery(self, i: int) -> Scenery:
        """What a picture shows of row ``i`` besides its path."""
        if self.task.scenery is None:
            return Scenery()
        a = self.arrays
        data = a.task_data[i, : self.episodes["data_size"][i]]
        return self.task.scenery(a.channels[i], a.task_observations[i], data, a.task_memory[i])

    def close(self) -> None:
        """Stop the threads."""
        self._pool.close()


def _checked_chassis(task: Task, chassis: str | None) -> str:
    chassis = task.chassis[0] if chassis is None else chassis_models.checked(chassis)
    if chassis not in task.chassis:
        raise ValueError(f"{task.name} needs chassis={' or '.join(map(repr, task.chassis))}, got {chassis!r}")
    return chassis


def _checked_control_dt(control_dt: Any) -> tuple[float, int]:
    """The control step [s] and its samples of 1 ms."""
    dt = number("control_dt [s]", control_dt, minimum=SAMPLE_TIME, maximum=0.1)
    samples = round(dt / SAMPLE_TIME)
    if not math.isclose(samples * SAMPLE_TIME, dt) or (SAMPLES_PER_UPDATE % samples and samples % SAMPLES_PER_UPDATE):
        raise ValueError(f"control_dt must be 1, 2 or 5 ms or a multiple of 10 ms, got {control_dt!r} s")
    return dt, samples


def _check_options(task: Task, options: Any) -> None:
    if not isinstance(options, Mapping):
        raise ValueError(f"reset options must map names to values, got {options!r}")
    for key in options:
        if key == "speed" and task.draw_scenario is not None:
            raise ValueError(f"{task.name} draws its speeds with its scenarios: leave the reset option 'speed' out")
        if key not in RANGES and key not in task.options:
            raise ValueError(f"unknown reset option {key!r}; {task.name} takes: {', '.join([*task.options, *RANGES])}")


def _scales(task: Task, normalise: Any) -> Array:
    """SI value of each observation of 1 (O,)."""
    if not isinstance(normalise, bool | np.bool_):
        raise ValueError(f"normalise must be True or False, got {normalise!r}")
    return np.array([quantity.usual if normalise else 1.0 for quantity in task.observed])


def _weights(task: Task, given: Mapping[str, float] | None) -> dict[str, float]:
    """Weight of every reward term; ValueError for an unknown term, or where a failure would pay."""
    weights = {term.name: term.weight for term in task.rewards}
    if not isinstance(given, Mapping | None):
        raise ValueError(f"weights must map reward terms to numbers, got {given!r}")
    for name, value in (given or {}).items():
        if name not in weights:
            raise ValueError(f"{task.name} has no reward term {name!r}; there are {', '.join(weights)}")
        low, high = (-math.inf, 0.0) if name == FAILURE.name else (0.0, math.inf)
        weights[name] = number(f"weights[{name!r}]", value, minimum=low, maximum=high)
    return weights
