"""The sampled plant linearised around straight running or steady cornering, from the hands to the tyres.

A plant that corners steadily repeats its state x from one chassis step of 2 ms to the next, but for its place on the
road. Around this point, which :mod:`steer_env.vehicle.analysis.operating_point` finds,

    x(k+1) = A x(k) + B u(k),    y(k) = C x(k) + D u(k)                                            (P7)

with derivatives of :func:`steer_env.vehicle.plant.run` and of the reported channels by differences. Friction either
slides at a constant torque, which has no slope, or is at rest and acts by the slope that the law has there.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from steer_env import friction as friction_laws
from steer_env.friction.law import torque as law_torque
from steer_env.friction.numerics.interpolation import hermite
from steer_env.friction.numerics.kernel import plain
from steer_env.vehicle import plant
from steer_env.vehicle.chassis.common.interface import (
    ASSIST_REQUEST,
    HAND,
    HAND_SPEED,
    INPUTS,
    RACK_DISTURBANCE,
)
from steer_env.vehicle.layout import plant_layout, state_names
from steer_env.vehicle.plant import CHASSIS_STEP, STEPS_PER_CHASSIS_STEP, Plant
from steer_env.vehicle.steering.assist.friction_compensation import LIMITED
from steer_env.vehicle.steering.assist.functions import FRICTION, Functions
from steer_env.vehicle.steering.column import HANDWHEEL_ANGLE

Array = NDArray[np.float64]

FRICTIONLESS = friction_laws.make("viscous", sigma_2=0.0)

_CHOSEN = tuple(range(ASSIST_REQUEST, RACK_DISTURBANCE + 1))  # inputs of the linear model beside the hands
# Not continuous, and constant while cruising: counters, and the stored values of pedals and switches.
_LEFT_OUT = {"steps_since_evaluation", "samples_since_message", "sent_age", "gear", "shift_time_left"} | {
    f"{name}_{stored}" for name, _ in INPUTS[RACK_DISTURBANCE + 1 :] for stored in ("mean", "at_evaluation")
}
_FORCES = {"N": 1e-2, "N m": 1e-4}  # step of the differences of an input by its unit; of an angle or speed 1e-7
_POSITION_CHANNELS = {"x", "y"}  # channels without a steady value in cornering


def slope(f: Callable[[float], Array], step: float, side: int = 0) -> Array:
    """Derivative at zero by central differences, or from one side (1 or -1) by three points, of second order.

    Two central differences remove the part of the error that is linear in the step, where the curvature jumps: of
    friction at rest, as of other functions in which x|x| stands.
    """
    if side:
        return side * (4.0 * f(side * step) - f(2.0 * side * step) - 3.0 * f(0.0)) / (2.0 * step)
    return (4.0 * (f(step) - f(-step)) - (f(2.0 * step) - f(-2.0 * step))) / (4.0 * step)


def by_state(
    p: Plant,
    state: Array,
    inputs: Array,
    derivative: Callable[[Callable[[float], Array], int], Array],
    substeps: int = 1,
) -> tuple[Array, NDArray[np.int_]]:
    """Derivative (n, n) of the state after rows of inputs (N, I) by the state before, and the positions (n,) of both.

    Counters and the stored values of pedals are left out. ``derivative`` takes the state after a change of one before,
    and the position of that one.
    """
    row = np.zeros((1, len(plant.channels(p))))
    index = np.array([i for i, (name, _) in enumerate(state_names(p)) if not name.startswith(tuple(_LEFT_OUT))])

    def end(i: int, change: float) -> Array:
        after = _changed(p, state, i, change)
        plant.run(p, after, inputs, row, substeps)
        return after[index]

    return np.stack([derivative(partial(end, i), i) for i in index], axis=1), index


def _changed(p: Plant, state: Array, i: int, change: float) -> Array:
    """The state after a change of one.

    The torque of a friction compensation's observer follows the memory of its law, or it would not be differentiable:
    a change of the memory changes the torque, and the torque is not changed alone.
    """
    after, f, at = state.copy(), p.assist.functions, plant_layout(p)
    after[i] += change
    if isinstance(f, Functions) and (size := f.friction_compensation.memory_size):
        memory, limited, law = at.memory - size, at.functions + FRICTION + LIMITED, f.friction_compensation.law
        if i == limited:
            after[i] = state[i]
        elif memory <= i < at.memory:
            torques = [plain(law_torque)(law, 1.0, x[memory : at.memory], 0.0) for x in (after, state)]
            after[limited] += torques[0] - torques[1]
    return after


def by_input(
    p: Plant, state: Array, inputs: Array, index: NDArray[np.int_], chosen: list[int], coarser: float = 1.0
) -> Array:
    """Derivative (n, N, K) of the states at ``index`` after rows of inputs (N, I) by the ``chosen`` inputs of a row."""
    row = np.zeros((1, len(plant.channels(p))))

    def end(i: int, j: int, change: float) -> Array:
        after, u = state.copy(), inputs.copy()
        u[i, j] += change
        plant.run(p, after, u, row, 1)
        return after[index]

    found = np.empty((index.size, len(inputs), len(chosen)))
    for i in range(len(inputs)):
        for k, j in enumerate(chosen):
            step = coarser * _input_step(p, j)
            found[:, i, k] = slope(partial(end, i, j), step)
    return found


def _input_step(p: Plant, j: int) -> float:
    if j == HAND:
        return 1e-7 if p.robot else _FORCES["N m"]
    return _FORCES.get(INPUTS[j][1], 1e-7)


def read_states(matrix: Array, outputs: Array | None = None) -> NDArray[np.bool_]:
    """Which states another state or an output reads, after those that none reads have been left out one by one."""
    kept = np.ones(len(matrix), bool)
    while True:
        part = matrix[np.ix_(kept, kept)]
        read = np.any(part - np.diag(np.diag(part)), axis=0)
        if outputs is not None:
            read |= np.any(outputs[:, kept], axis=0)
        if read.all():
            return kept
        kept[np.flatnonzero(kept)[~read]] = False


def transition(
    p: Plant,
    substeps: int = 1,
    state: Array | None = None,
    inputs: Array | None = None,
) -> tuple[Array, NDArray[np.int_]]:
    """Transition matrix over two samples of 1 ms, which are one chassis step: A of (P7).

    The matrix comes from differences of :func:`steer_env.vehicle.plant.run`. States that no other state reads are left
    out one after another, as they take no part in a motion: position and heading on a level road, the distance, unused
    entries of the command queue, stored values of outputs. So are counters and the stored values of pedals.

    Parameters
    ----------
    p : Plant
        With any friction law; a law that is not differentiable at rest gives a secant.
    substeps : int
        As in ``run``.
    state : (S,) array, optional
        Around which to linearise; straight running by default.
    inputs : (I,) array, optional
        Constant inputs; zero by default.

    Returns
    -------
    matrix : (n, n) array
        In the units of the states.
    index : (n,) array of int
        Positions of the remaining states in the state array.
    """
    rest = plant.initial_state(p) if state is None else state
    rows = np.tile(np.zeros(len(INPUTS)) if inputs is None else inputs, (STEPS_PER_CHASSIS_STEP, 1))

    def central(f: Callable[[float], Array], i: int) -> Array:
        step = 1e-6 * max(1.0, abs(rest[i]))
        return (f(step) - f(-step)) / (2.0 * step)

    matrix, index = by_state(p, rest, rows, central, substeps)  # (P7)
    read = read_states(matrix)
    return matrix[np.ix_(read, read)], index[read]


class Point(NamedTuple):
    """An operating point: the plant, and what it repeats from step to step."""

    plant: Plant  # with its hands and friction; knots of the boost table lie beside the point
    state: Array  # (S,)
    inputs: Array  # (I,) that hold the point
    speed: float  # held [m/s]
    compensated: Array | None = None  # (V,) share of the friction that the assist compensates where friction rests [1]
    wire: Any = None  # controllers by wire with their friction laws, which act where friction rests

    @property
    def torque(self) -> float:
        """Torque of the torsion bar, or that which resists by wire [N m]."""
        return self.channel("torsion_bar_torque")

    @property
    def handwheel_angle(self) -> float:
        """Handwheel angle [rad]."""
        return float(self.state[HANDWHEEL_ANGLE])

    def channel(self, name: str) -> float:
        """Value of a channel [SI]."""
        names = [each for each, _ in plant.channels(self.plant)]
        return float(plant.reported(self.plant, self.state, self.inputs)[names.index(name)])


def _steps(p: Plant, state: Array) -> Array:
    """Steps (S,) of the differences by which friction at rest stays at rest and rounding of wheel loads stays small.

    The step equations are linear in the torques and in the stored values, which take large steps.
    """
    at, found = plant_layout(p), 1e-6 * np.maximum(1.0, np.abs(state))
    found[: at.assist] = found[at.memory :] = 1e-6
    found[at.assist : at.chassis] = found[at.rate : at.motor] = 1e-3
    found[at.functions : min(at.functions + FRICTION, at.memory)] = 1e-3  # filters of the assist's functions
    return found


def linearise(point: Point, coarser: float = 1.0) -> control.StateSpace:
    """The plant around a point as a discrete system at the chassis step of 2 ms (P7).

    Parameters
    ----------
    point : Point
    coarser : float
        Factor on the steps of the differences [1].

    Returns
    -------
    control.StateSpace
        Inputs, constant over a step: ``handwheel_angle`` [rad] and ``handwheel_speed`` [rad/s] at its end, between
        which the handwheel follows the cubic of (N5), or ``hand_torque`` [N m]; ``assist_request`` [N m],
        ``wind_force`` [N], ``wind_moment`` [N m], ``rack_disturbance`` [N]. Outputs: the channels of the plant but x
        and y [SI]. States: those of the plant that another one or an output reads. All are differences to the point.
        At standstill the derivatives by states are those from above.
    """
    p, rows = point.plant, np.tile(point.inputs, (STEPS_PER_CHASSIS_STEP, 1))
    A, index = one_step(point, coarser)
    hand, others = ([HAND, HAND_SPEED] if p.robot else [HAND]), list(_CHOSEN)
    B = by_input(p, point.state, rows, index, hand + others, coarser)
    total = B.sum(axis=1)
    if p.robot:
        # The first row holds the middle of the step, by the cubic from the present state to the input (N5).
        ends = np.eye(4)
        first = np.array([_middle(*end) for end in ends]).T  # (2, 4): of angle, speed before and behind
        A[:, :2] += B[:, 0, :2] @ first[:, :2]
        total[:, :2] = B[:, 0, :2] @ first[:, 2:] + B[:, 1, :2]
    C, D, names = _outputs(point, index, hand + others, coarser)
    kept = read_states(A, C)
    A, C, total = A[np.ix_(kept, kept)], C[:, kept], total[kept]
    labels = ["handwheel_angle", "handwheel_speed"] if p.robot else ["hand_torque"]
    return control.ss(
        A, total, C, D, CHASSIS_STEP,
        states=[state_names(p)[i][0] for i in index[kept]],
        inputs=[f"{name}_input" if name.startswith("handwheel") else name for name in labels]
        + [INPUTS[i][0] for i in others],
        outputs=names,
    )  # fmt: skip


def one_step(point: Point, coarser: float = 1.0) -> tuple[Array, NDArray[np.int_]]:
    """A (n, n) of (P7) over 2 ms, and the positions (n,) of the states; ``coarser`` and standstill as in ``linearise``.

    A motion that neither grows nor decays, as that of a bristle at rest, has an eigenvalue of 1 within 1e-8, where
    :func:`transition` has a larger error: that of the terms x|x|, which the differences here remove.
    """
    rows = np.tile(point.inputs, (STEPS_PER_CHASSIS_STEP, 1))
    steps, side = coarser * _steps(point.plant, point.state), 1 if point.speed == 0.0 else 0
    return by_state(point.plant, point.state, rows, lambda f, i: slope(f, steps[i], side))  # (P7)


def one_sample(point: Point, chosen: list[int]) -> tuple[Array, Array, NDArray[np.int_]]:
    """A (n, n), B (n, K) by the ``chosen`` inputs of a row, and the positions (n,) of the states, over 1 ms."""
    row, steps = point.inputs[None, :], _steps(point.plant, point.state)
    A, index = by_state(point.plant, point.state, row, lambda f, i: slope(f, steps[i]))
    return A, by_input(point.plant, point.state, row, index, chosen)[:, 0], index


def _middle(angle: float, speed: float, angle_after: float, speed_after: float) -> tuple[float, float]:
    """Angle and speed in the middle of a chassis step."""
    h = CHASSIS_STEP
    value, rate = plain(hermite)(0.5, angle, angle_after, speed * h, speed_after * h)
    return value, rate / h


def _outputs(
    point: Point, index: NDArray[np.int_], chosen: list[int], coarser: float
) -> tuple[Array, Array, list[str]]:
    """Derivatives of the channels by states and inputs, and their names."""
    p, names = point.plant, [name for name, _ in plant.channels(point.plant)]
    shown = [i for i, name in enumerate(names) if name not in _POSITION_CHANNELS]

    def row(i: int | None, j: int | None, change: float) -> Array:
        state, u = point.state.copy(), point.inputs.copy()
        if i is not None:
            state[i] += change
        if j is not None:
            u[j] += change
        return plant.reported(p, state, u)[shown]

    steps = coarser * _steps(p, point.state)
    C = [slope(partial(row, i, None), steps[i]) for i in index]
    D = [slope(partial(row, None, j), coarser * _input_step(p, j)) for j in chosen]
    return np.stack(C, axis=1), np.stack(D, axis=1), [names[i] for i in shown]
