"""Episodes side by side: the engine under the single and the vector environment, which therefore agree to the bit.

A lane is one episode: a plant's numbers and state, a case of the task, and what the kernels remember. One step of all
lanes runs in compiled code without the GIL, so that a thread pool over lanes needs no threading layer of numba's:

    script (inputs from case and action) -> plant -> look -> judge -> observe

in rounds of at most one node of 10 ms; persons act at the nodes. Randomness comes from each lane's own generator.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env import drivers
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.interpolation import hermite
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.manoeuvres.common.driving import steering_stiffness
from steer_env.randomise import LIMITS, RANGES, SENSOR_NOISE, Conditions, Randomise
from steer_env.tasks.common import definition as tasks
from steer_env.tasks.common.definition import NODE, PEAK, PER_NODE, RMS, Now, Setting, Task
from steer_env.vehicle import cars, plant, plant_batch
from steer_env.vehicle import tyre as tyres
from steer_env.vehicle.chassis.common.interface import HAND, HAND_SPEED, INPUTS
from steer_env.vehicle.road import Road
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

FAILURE = -100.0  # reward of a step that ends upside down, spun, or not finite: worse than driving on
ROLLED_OVER = 1.0  # roll angle from which on no car comes back [rad]
SLOW = 3.0  # forward speed below which a car that slides sideways has not spun; assumed [m/s]
NOISE_BLOCK = 128  # control steps of noise drawn at once

_LATERAL_SPEED = plant.CHANNEL["lateral_speed"]
_ROLL = plant.CHANNEL["roll_angle"]
_POSE = [plant.CHANNEL[name] for name in ("x", "y", "yaw_angle")]


# What there is to know of a lane beside its arrays.
_BOOK = np.dtype(
    [
        ("clock", np.int64),  # samples since the start
        ("judged", np.int64),  # samples that were judged: those before the end
        ("end", np.int64),  # of the episode [samples]
        ("released", np.int64),  # when the hands let go [samples]; negative: never
        ("points", np.int64),  # of the path
        ("values", np.int64),  # of the case
        ("latest", np.int64),  # place of the newest observation in the ring
        ("delay", np.int64),  # of the observation [control steps]
        ("speed", np.float64),  # forward [m/s]
        ("action", np.float64),
        ("rate", np.float64),  # of the action [1/s]
        ("reward", np.float64),
        ("cost", np.float64),
        ("ended", np.bool_),
        ("truncated", np.bool_),
        ("failed", np.bool_),  # a state is not finite, or the car is upside down or goes sideways
    ],
    align=True,
)


@kernel
def _script(
    book, actions, dt, begins, state, past, finite, terms, nodes, columns, action_input, scale, rows, robot, inputs,
    low, high,
):  # fmt: skip
    """Begin a step of ``dt`` [s], if it ``begins``, and give the inputs of the coming samples.

    They are the case's, straight lines between the nodes, and the action. A handwheel angle comes with its speed and is
    a cubic that meets both. Once released, nobody holds the handwheel: ``robot`` is the place of that parameter among
    the plant's numbers. State and inputs of a lane that has failed stay as they led there.
    """
    for i in range(low, high):
        lane = book[i]
        if begins:
            lane.rate = (actions[i] - lane.action) / dt
            lane.action = actions[i]
            lane.ended = False
            for k in range(terms.shape[1]):
                terms[i, k] = 0.0
        if not finite[i]:
            continue
        for k in range(state.shape[1]):
            past[i, k] = state[i, k]
        free = lane.released >= 0 and lane.clock >= lane.released
        if free:
            rows[i, robot] = 0.0
        for j in range(inputs.shape[1]):
            u, sample = inputs[i, j], lane.clock + j + 1
            for k in range(u.size):
                u[k] = 0.0
            node = within((sample - 1) // PER_NODE, 0, nodes.shape[1] - 2)
            s = (sample - node * PER_NODE) / PER_NODE
            start, end = nodes[i, node], nodes[i, node + 1]
            for k in range(columns.size):
                u[columns[k]] = start[k] + s * (end[k] - start[k])
            if columns.size > 1 and columns[1] == HAND_SPEED:
                u[HAND], slope = hermite(s, start[0], end[0], start[1] * NODE, end[1] * NODE)
                u[HAND_SPEED] = slope / NODE
            if free:
                u[HAND] = 0.0
                u[HAND_SPEED] = 0.0
            u[action_input] += scale * lane.action


@kernel
def _judge(
    book, rules, kinds, channels, finite, speed, paths, values, memory, situations, terms, split, figures, samples,
    low, high,
):  # fmt: skip
    """Let ``samples`` pass, look at the lanes, and judge those that have not ended and are finite.

    ``speed`` is the place of the forward speed among the channels, or -1 where the speed is held. Of the terms, those
    before ``split`` are of the reward, the others of the cost. Figures hold present values and what they add up to.
    """
    dt = samples * SAMPLE_TIME
    for i in range(low, high):
        lane, row, situation = book[i], channels[i], situations[i]
        lane.clock += samples
        if speed >= 0:
            lane.speed = row[speed]
        now = Now(lane.clock * SAMPLE_TIME, dt, lane.speed, lane.action, lane.rate)
        known = values[i, : lane.values]
        tasks.look(rules, row, paths[i, : lane.points], known, now, memory[i], situation)
        if samples > 0 and finite[i] and not lane.ended:
            lane.judged += samples
            present, whole = figures[i, 0], figures[i, 1]
            lane.ended = tasks.judge(
                rules, row, situation, known, now, memory[i], terms[i, :split], terms[i, split:], present
            )
            for k in range(kinds.size):
                size = abs(present[k])
                if kinds[k] == PEAK:
                    if size > whole[k]:
                        whole[k] = size
                else:
                    whole[k] += dt * size * size if kinds[k] == RMS else size


@kernel
def _conclude(
    book,
    terms,
    weights,
    split,
    weighted,
    finite,
    step,
    channels,
    observed,
    situations,
    noise,
    bound,
    ring,
    out,
    low,
    high,
):
    """Reward and cost, whether it is over, and the observation: with noise, as old as the delay, clipped to the bounds.

    ``step`` is the samples that the next step will take.
    """
    n = observed.size
    for i in range(low, high):
        lane, row = book[i], channels[i]
        lane.reward = lane.cost = 0.0
        for k in range(weights.size):
            weighted[i, k] = weights[k] * terms[i, k]
            if k < split:
                lane.reward += weighted[i, k]
            else:
                lane.cost += weighted[i, k]
        lane.truncated = lane.clock + step > lane.end
        upset = abs(row[_ROLL]) > ROLLED_OVER or abs(row[_LATERAL_SPEED]) > within(lane.speed, SLOW, math.inf)
        # What came after the task's own end does not count.
        lane.failed = not lane.ended and (upset or not finite[i] or not abs(lane.reward) < math.inf)
        if lane.failed:
            lane.reward = FAILURE
            lane.ended = True
        lane.latest = (lane.latest + 1) % ring.shape[1]
        seen = ring[i, lane.latest]
        for k in range(bound.size):
            value = row[observed[k]] if k < n else (lane.speed if k == n else situations[i, k - n - 1])
            value += noise[i, k]
            # NaN of a failed lane becomes zero.
            seen[k] = within(value, -bound[k], bound[k]) if abs(value) <= math.inf else 0.0
        past = ring[i, (lane.latest - lane.delay) % ring.shape[1]]
        for k in range(bound.size):
            out[i, k] = past[k]


class _Pool:
    """Work on slices of lanes in threads, kept for the process that made them."""

    def __init__(self, n: int, threads: int) -> None:
        edges = np.linspace(0, n, min(threads, n) + 1).round().astype(int).tolist()
        self._slices = list(pairwise(edges))
        self._executor: ThreadPoolExecutor | None = None
        self._process = 0

    def run(self, work: Callable[[int, int], None]) -> None:
        """``work(low, high)`` for every slice; the first one in this thread."""
        if len(self._slices) == 1:
            work(*self._slices[0])
            return
        if self._process != os.getpid():  # threads do not survive a fork
            self._executor, self._process = ThreadPoolExecutor(len(self._slices) - 1), os.getpid()
        assert self._executor is not None
        others = [self._executor.submit(work, low, high) for low, high in self._slices[1:]]
        work(*self._slices[0])
        for other in others:
            other.result()

    def close(self) -> None:
        """Let the threads go."""
        if self._executor is not None and self._process == os.getpid():
            self._executor.shutdown()
        self._executor, self._process = None, 0


def _weights(task: Task, given: Mapping[str, float] | None) -> dict[str, float]:
    """Weight of every reward term; ValueError for an unknown one."""
    found = {term.name: term.weight for term in task.rewards}
    if not isinstance(given, Mapping | None):
        raise ValueError(f"weights must map reward terms to numbers, got {given!r}")
    for name, value in (given or {}).items():
        if name not in found:
            raise ValueError(f"{task.name} has no reward term {name!r}; there are {', '.join(found)}")
        found[name] = number(f"weights[{name!r}]", value)
    return found


class Lanes:
    """``n`` episodes of a task; arguments as :class:`steer_env.env.SteerEnv`, which describes them."""

    def __init__(
        self,
        task: Task,
        n: int,
        *,
        friction: Any = "lugre",
        speed: float | None = None,
        vehicle: str = "compact",
        chassis: str | None = None,
        tyre: str | None = None,
        road: Road | None = None,
        control_dt: float = 0.01,
        driver: Any = None,
        randomise: Mapping[str, Any] | None = None,
        weights: Mapping[str, float] | None = None,
        threads: int = 1,
    ) -> None:
        self.task, self.n, self.observed = task, n, task.observed
        chassis = task.chassis[0] if chassis is None else chassis
        if chassis not in cars.SPEEDS:
            raise ValueError(f"chassis must be one of {', '.join(cars.SPEEDS)}, got {chassis!r}")
        if chassis not in task.chassis:
            raise ValueError(f"{task.name} needs chassis={' or '.join(map(repr, task.chassis))}, got {chassis!r}")
        if driver is not None and not task.person:
            raise ValueError(f"{task.name} has no driver model in its loop, so driver={driver!r} has no place in it")
        self.control_dt = dt = number("control_dt [s]", control_dt, minimum=SAMPLE_TIME, maximum=0.1)
        self._samples = samples = round(dt / SAMPLE_TIME)
        if not math.isclose(samples * SAMPLE_TIME, dt) or (PER_NODE % samples and samples % PER_NODE):
            raise ValueError(f"control_dt must be 1, 2 or 5 ms or a multiple of 10 ms, got {control_dt!r} s")
        self._round = min(samples, PER_NODE)
        self._rounds = samples // self._round
        (low, high), (least, most) = cars.SPEEDS[chassis], task.speeds
        limits = max(low, least), min(high, most)
        given = task.speed if speed is None else speed
        self.speed = number("speed [m/s]", given, minimum=limits[0], maximum=limits[1])
        self.car = cars.load(vehicle)
        if tyre is not None:
            self.car = self.car._replace(tyre=tyres.load(tyre))
        self._chassis, self._road = chassis, road
        self._driver = drivers.resolve("preview" if driver is None else driver) if task.person else None
        self._randomise = Randomise(randomise, friction, self.speed, LIMITS | {"speed": limits})
        weights_of = _weights(task, weights)

        usual = self._randomise.usual
        template = self._template = self._plant(usual, task.robot)
        self.channels = plant.channels(template)
        names = [name for name, _ in self.channels]
        self._speed = names.index("longitudinal_speed") if "longitudinal_speed" in names else -1
        self.states = tuple(name for name, _ in plant.states(template))
        self._pose = [self.states.index(name) for name in ("x", "y", "yaw_angle")]
        self._robot = plant_batch.places(template)["robot"].start
        self._rows = np.tile(plant_batch.numbers(template), (n, 1))
        self.state, self._before = np.zeros((n, len(self.states))), np.zeros((n, len(self.states)))
        self.row = np.zeros((n, len(self.channels)))
        self._inputs = np.zeros((n, self._round, len(INPUTS)))
        self._finite = np.ones(n, bool)
        self._advance = bind(
            plant_batch.run, template, self._rows, self.state, self._inputs, self.row, self._finite, 0, n
        )
        self._usual = self._settle(template)

        o, terms = len(self.observed), (*task.rewards, *task.costs)
        self.book = np.zeros(n, _BOOK)
        self._records = self.book.view(np.recarray)  # whose fields plain Python, too, finds as kernels do
        self.bound = np.array([quantity.bound for quantity in self.observed], np.float32)
        self._bound = self.bound.astype(float)
        self._observed = np.array([plant.CHANNEL[name] for name in task.channels])
        self._columns = np.array(task.scripted, np.int64)
        self._kinds = np.array([figure.kind for figure in task.figures])
        self._weights = np.array(
            [weights_of[term.name] for term in task.rewards] + [term.weight for term in task.costs]
        )
        self._split = len(task.rewards)
        self._terms, self.weighted = np.zeros((n, len(terms))), np.zeros((n, len(terms)))
        self.situation, self._memory = np.zeros((n, len(task.situation))), np.zeros((n, task.memory))
        self._figures = np.zeros((n, 2, len(task.figures)))
        self._nodes, self._paths, self._values = (
            np.zeros((n, 2, len(task.scripted))),
            np.zeros((n, 0, 4)),
            np.zeros((n, 0)),
        )
        self._actions = np.zeros(n, np.float32)
        self._noise, self._noise_factor, self._noisy = np.zeros((n, o)), np.zeros(n), False
        self._noise_size = np.array([SENSOR_NOISE.get(quantity.name, 0.0) for quantity in self.observed])
        self._noise_blocks: dict[int, Array] = {}
        self._steps = np.zeros(n, np.int64)
        self._ring = np.zeros((n, 1 + round(LIMITS["delay"][1] / dt), o))
        self.observation = np.zeros((n, o), np.float32)
        self.over = np.ones(n, bool)
        self.conditions: list[Conditions] = [usual] * n
        self._persons = drivers.Crew(self._driver, self.car, n, self.steering_stiffness) if self._driver else None
        self._arrange()
        self._script = bind(_script, *self._begin_with, *self._scripted, 0, n)
        self._judge = bind(_judge, *self._judged, 0, 0, n)
        self._conclude = bind(_conclude, *self._concluded, 0, n)
        self._pool = _Pool(n, threads)

    def _arrange(self) -> None:
        """Arguments of the kernels; anew where an array of the cases has grown."""
        action = self.task.action
        step = self._records, self._actions, self.control_dt
        self._begin_with, self._go_on_with = (*step, True), (*step, False)
        self._scripted = (
            self.state, self._before, self._finite, self._terms, self._nodes, self._columns, action.input, action.scale,
            self._rows, self._robot, self._inputs,
        )  # fmt: skip
        self._advanced = self._template, self._rows, self.state, self._inputs, self.row, self._finite
        self._judged = (
            self._records, self.task.rules, self._kinds, self.row, self._finite, self._speed, self._paths, self._values,
            self._memory, self.situation, self._terms, self._split, self._figures,
        )  # fmt: skip
        self._concluded = (
            self._records, self._terms, self._weights, self._split, self.weighted, self._finite, self._samples,
            self.row, self._observed, self.situation, self._noise, self._bound, self._ring, self.observation,
        )  # fmt: skip

    def _plant(self, drawn: Conditions, robot: bool) -> plant.Plant:
        p = self.car.loaded(drawn.load).plant(
            drawn.friction,
            speed=drawn.speed,
            robot=robot,
            road_friction=drawn.road_friction,
            chassis=self._chassis,
            road=self._road,
        )
        p = p._replace(friction_torque_scale=drawn.friction_level)
        return p if self._driver is None else drivers.gripped(p, self._driver.arm)

    def _run(self, p: plant.Plant) -> Callable[..., None]:
        """Runs one plant as :func:`steer_env.vehicle.plant.run` does, by the lanes' own kernel: no other has to be compiled."""
        numbers, finite = plant_batch.numbers(p)[None], np.ones(1, bool)

        def run(_: Any, state: Array, inputs: Array, channels: Array, substeps: int) -> None:
            self._advance(self._template, numbers, state[None], inputs[None], channels, finite, 0, 1)

        return run

    def _settle(self, p: plant.Plant) -> tuple[Array, Array, Array]:
        """Numbers, settled state and channels of a plant."""
        return (plant_batch.numbers(p), *plant.settled(p, self._run(p)))

    def steering_stiffness(self, speed: float) -> float:
        """Hand torque over handwheel angle [N m/rad] in steady turns at a speed [m/s], beyond friction."""
        p = self._plant(self._randomise.usual._replace(speed=speed), robot=True)
        return steering_stiffness(p, self._run(p))

    def start(self, i: int, rng: np.random.Generator, options: Mapping[str, Any]) -> None:
        """Begin an episode in lane ``i``; ``options`` fix what would be drawn. ValueError for an unknown one."""
        task = self.task
        if not isinstance(options, Mapping):
            raise ValueError(f"reset options must map names to values, got {options!r}")
        for key, value in options.items():
            if isinstance(value, str | bool):
                raise ValueError(f"reset option {key!r} must be a number, got {value!r}")
            if key not in RANGES and key not in task.options:
                raise ValueError(
                    f"unknown reset option {key!r}; {task.name} takes: {', '.join([*task.options, *RANGES])}"
                )
        drawn = self._randomise.draw(rng, {key: value for key, value in options.items() if key in RANGES})
        own = {key: task.checked(key, value) for key, value in options.items() if key in task.options}
        case = task.start(rng, Setting(self.car, drawn.speed), own)
        self._rows[i], self.state[i], self.row[i] = self._begin(drawn)
        self.state[i, self._pose] = case.pose
        self.row[i, _POSE] = case.pose
        self._keep(i, case)
        lane = self.book[i : i + 1]
        lane[:] = 0
        lane["end"] = (len(case.nodes) - 1) * PER_NODE
        lane["released"] = -1 if case.released is None else round(case.released / SAMPLE_TIME)
        lane["points"] = 0 if case.path is None else len(case.path)
        lane["values"] = 0 if case.values is None else len(case.values)
        lane["speed"] = drawn.speed
        lane["delay"] = round(drawn.delay / self.control_dt)
        self._memory[i] = self._figures[i] = self._terms[i] = 0.0
        self._finite[i], self.over[i], self._steps[i] = True, False, 0
        self.conditions[i] = drawn
        self._noise_factor[i] = drawn.sensor_noise
        self._noisy = bool(self._noise_factor.any())
        if self._persons is not None:
            self._persons.start(i, drawn.speed)
        self._draw_noise(i, rng)
        self._judge(*self._judged, 0, i, i + 1)
        self._conclude(*self._concluded, i, i + 1)
        self._ring[i] = self._ring[i, lane["latest"][0]]
        self.observation[i] = self._ring[i, 0]

    def _begin(self, drawn: Conditions) -> tuple[Array, Array, Array]:
        usual = self._randomise.usual
        if drawn.friction is usual.friction and drawn[:4] == usual[:4]:
            return self._usual
        return self._settle(self._plant(drawn, self.task.robot))

    def _keep(self, i: int, case: tasks.Case) -> None:
        """Put a case into the lanes' arrays, which grow with the largest."""
        path = np.zeros((0, 4)) if case.path is None else case.path
        values = np.zeros(0) if case.values is None else case.values
        for name, array in (("_nodes", case.nodes), ("_paths", path), ("_values", values)):
            held = getattr(self, name)
            if len(array) > held.shape[1]:
                larger = np.zeros((self.n, len(array), *held.shape[2:]))
                larger[:, : held.shape[1]] = held
                setattr(self, name, held := larger)
                self._arrange()
            held[i, : len(array)] = array

    def _draw_noise(self, i: int, rng: np.random.Generator) -> None:
        """Noise of the coming observation of lane ``i``, from blocks of its generator."""
        if self._noise_factor[i] == 0.0:
            self._noise[i] = 0.0
            return
        place = self._steps[i] % NOISE_BLOCK
        if place == 0:
            self._noise_blocks[i] = rng.standard_normal((NOISE_BLOCK, self._noise_size.size))
        self._noise[i] = self._noise_factor[i] * self._noise_size * self._noise_blocks[i][place]

    def step(self, actions: NDArray[np.float32], generators: Sequence[np.random.Generator]) -> None:
        """Hold the clipped actions (n,) for ``control_dt`` in every lane.

        ``observation`` and ``book`` then tell what came of it. A lane that is over runs on without a meaning, and draws
        nothing from its generator.
        """
        self._actions[:] = actions
        if self._noisy:
            self._steps += 1
            for i in np.flatnonzero(~self.over).tolist():
                self._draw_noise(i, generators[i])
        self._pool.run(self._work)

    def _work(self, low: int, high: int) -> None:
        step = self._begin_with
        for _ in range(self._rounds):
            if self._persons is not None:
                self._persons.hold(self.row, self.situation, self._records, self._nodes, low, high)
            self._script(*step, *self._scripted, low, high)
            self._advance(*self._advanced, low, high)
            self._judge(*self._judged, self._round, low, high)
            step = self._go_on_with
        self._conclude(*self._concluded, low, high)

    def drawn(self, i: int) -> dict[str, Any]:
        """Conditions of the episode in lane ``i``, for its info, which shares nothing."""
        return deepcopy(self.conditions[i]._asdict())

    def figures(self, i: int) -> dict[str, float]:
        """Figures of the episode in lane ``i`` so far, by name."""
        time = max(self.book["judged"][i], 1) * SAMPLE_TIME
        return {
            figure.name: math.sqrt(value / time) if figure.kind == RMS else value
            for figure, value in zip(self.task.figures, self._figures[i, 1].tolist())
        }

    def failure(self, i: int) -> dict[str, Any]:
        """Why lane ``i`` failed in the last step, for its info; empty if it did not."""
        if not self.book["failed"][i]:
            return {}
        if not self._finite[i]:
            return {"non_finite_state": self._first_non_finite(i)}
        return {"rolled_over": True} if abs(self.row[i, _ROLL]) > ROLLED_OVER else {"spun": True}

    def _first_non_finite(self, i: int) -> str:
        """Runs are reproducible to the bit: the last step's inputs lead from its start to the same end."""
        state, row, finite = self._before[i : i + 1].copy(), self.row[i : i + 1].copy(), np.ones(1, bool)
        for k in range(self._round):
            u = self._inputs[i : i + 1, k : k + 1].copy()
            self._advance(self._template, self._rows[i : i + 1], state, u, row, finite, 0, 1)
            bad = np.flatnonzero(~np.isfinite(state[0]))
            if bad.size:
                return plant.state_name(self._template, int(bad[0]))
        return "the reward"

    @property
    def path(self) -> Array | None:
        """The path (P, 4) of lane 0, or None."""
        points = self.book["points"][0]
        return self._paths[0, :points] if points else None

    @property
    def scenery(self) -> tasks.Scenery:
        """What a picture shows of lane 0 besides its path."""
        if self.task.scenery is None:
            return tasks.Scenery()
        return self.task.scenery(
            self.row[0], self.situation[0], self._values[0, : self.book["values"][0]], self._memory[0]
        )

    def close(self) -> None:
        """Let the threads go."""
        self._pool.close()
