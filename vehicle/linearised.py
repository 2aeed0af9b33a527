"""The sampled plant linearised around straight running or steady cornering, from the hands to the tyres.

A plant that corners steadily repeats its state x from one chassis step of 2 ms to the next, but for its place on the
road. Around this point

    x(k+1) = A x(k) + B u(k),    y(k) = C x(k) + D u(k)                                            (P6)

with derivatives of :func:`steer_env.vehicle.plant.run` and of the reported channels by differences. The point itself
solves x = f(x, hand angle), with the torsion bar's torque if that is given, by Newton's rule from a slow ramp of the
handwheel angle (P7). It is that of the car without friction, the middle of the hysteresis. Friction either slides at a
constant torque, which has no slope, or is at rest and acts by the slope that the law has there.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from steer_env import friction as friction_laws
from steer_env.friction.law import law_of
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.interpolation import hermite
from steer_env.friction.numerics.kernel import plain
from steer_env.vehicle import plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import (
    ASSIST_REQUEST,
    HAND,
    HAND_SPEED,
    INPUTS,
    RACK_DISTURBANCE,
    WHEELS,
)
from steer_env.vehicle.layout import layout_of, states
from steer_env.vehicle.plant import CHANNEL, CHASSIS_STEP, STEPS_PER_CHASSIS_STEP, Plant
from steer_env.vehicle.steering.column import COLUMN_ANGLE, HANDWHEEL_ANGLE, HANDWHEEL_SPEED
from steer_env.vehicle.steering.eps import Assist

Array = NDArray[np.float64]

FRICTIONLESS = friction_laws.make("viscous", sigma_2=0.0)
HANDS = ("on", "off", "arms")

_CHOSEN = tuple(range(ASSIST_REQUEST, RACK_DISTURBANCE + 1))  # inputs of the linear model beside the hands
# Not continuous, and constant while cruising: counters, and the stored values of pedals and switches.
_LEFT_OUT = {"steps_since_evaluation", "gear", "shift_time_left"} | {
    f"{name}_{stored}" for name, _ in INPUTS[RACK_DISTURBANCE + 1 :] for stored in ("mean", "at_evaluation")
}
_FORCES = {"N": 1e-2, "N m": 1e-4}  # step of the differences of an input by its unit; of an angle or speed 1e-7
_PLACE = {"x", "y"}  # channels without a steady value in cornering
_AT_KNOT = 1e-9, 1e-2  # distance to a knot that counts as on it, and how far it is then moved [N m, m/s]
_RAMP, _CHUNK = 20.0, 100  # duration of the ramp to the lock [s], samples between its stored states, assumed
_RELAXED = 100  # samples between Newton's steps, in which the stored values follow the states; even
_SPIN = 0.5  # sideslip angle at which the ramp ends, assumed [rad]


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
    index = np.array([i for i, (name, _) in enumerate(states(p)) if not name.startswith(tuple(_LEFT_OUT))])

    def end(i: int, change: float) -> Array:
        after = state.copy()
        after[i] += change
        plant.run(p, after, inputs, row, substeps)
        return after[index]

    return np.stack([derivative(partial(end, i), i) for i in index], axis=1), index


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


def _read(matrix: Array, outputs: Array | None = None) -> NDArray[np.bool_]:
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
    """Transition matrix over two samples of 1 ms, which are one chassis step: A of (P6).

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

    matrix, index = by_state(p, rest, rows, central, substeps)  # (P6)
    read = _read(matrix)
    return matrix[np.ix_(read, read)], index[read]


class Point(NamedTuple):
    """An operating point: the plant, and what it repeats from step to step."""

    plant: Plant  # with its hands and friction; knots of the boost table lie beside the point
    state: Array  # (S,)
    inputs: Array  # (I,) that hold the point
    speed: float  # held [m/s]

    @property
    def torque(self) -> float:
        """Torque of the torsion bar [N m]."""
        return float(self.plant.column.K_tb * (self.state[HANDWHEEL_ANGLE] - self.state[COLUMN_ANGLE]))

    @property
    def handwheel_angle(self) -> float:
        """Handwheel angle [rad]."""
        return float(self.state[HANDWHEEL_ANGLE])

    def channel(self, name: str) -> float:
        """Value of a channel [SI]."""
        names = [each for each, _ in plant.channels(self.plant)]
        return float(plant.reported(self.plant, self.state, self.inputs)[names.index(name)])


class Cornering(NamedTuple):
    """A slow turn of the handwheel from straight running up to what the car can follow."""

    plant: Plant  # without friction, handwheel prescribed
    speed: float  # [m/s]
    states: Array  # (K, S) every 0.1 s
    angles: Array  # (K,) of the handwheel [rad]
    torques: Array  # (K,) of the torsion bar [N m]
    end: str  # why it ended


def cornering(car: Car, speed: float, chassis: str = "single_track", road_friction: float = 1.0) -> Cornering:
    """Turn the handwheel to the left, slowly and ever faster, until the lock or the limit of the car.

    Parameters are those of :meth:`steer_env.vehicle.cars.Car.plant`, with its errors.
    """
    p = car.plant(FRICTIONLESS, speed, True, road_friction, chassis)
    state, lock = plant.initial_state(p), 0.98 * p.rack_limit / p.pinion_radius
    names = {name: i for i, (name, _) in enumerate(plant.channels(p))}
    t = plant.SAMPLE_TIME * np.arange(1, round(_RAMP / plant.SAMPLE_TIME) + 1)
    inputs, row = np.zeros((t.size, len(INPUTS))), np.zeros((1, len(names)))
    inputs[:, HAND], inputs[:, HAND_SPEED] = lock * (t / _RAMP) ** 2, 2.0 * lock * t / _RAMP**2
    found, end = [state.copy()], "the steering is at its lock"
    for start in range(0, t.size if speed > 0.0 else 0, _CHUNK):
        if not plant.run(p, state, inputs[start : start + _CHUNK], row, 1):
            end = "the states leave the range of numbers"
            break
        forward = row[0, names["longitudinal_speed"]] if "longitudinal_speed" in names else p.chassis.v_x
        if abs(math.atan2(row[0, CHANNEL["lateral_speed"]], forward)) > _SPIN:
            end = "the car spins"
            break
        if min(row[0, CHANNEL[f"wheel_load_{wheel}"]] for wheel in WHEELS) <= 0.0:
            end = "a wheel lifts"
            break
        found.append(state.copy())
    every = np.array(found)
    angles = every[:, HANDWHEEL_ANGLE]
    return Cornering(p, speed, every, angles, p.column.K_tb * (angles - every[:, COLUMN_ANGLE]), end)


def steady(
    c: Cornering, *, torque: float | None = None, handwheel_angle: float | None = None, above: bool = True
) -> Point:
    """The point of steady cornering with a torque of the torsion bar or a handwheel angle, hands on (P7).

    Parameters
    ----------
    c : Cornering
    torque, handwheel_angle : float, optional
        Not negative; one of them at most, straight running without [N m, rad].
    above : bool
        From which side of a knot of the boost table, in torque and in speed, the point takes its slopes.

    Raises
    ------
    ValueError
        For both of them, or a point that the car does not reach.
    """
    if torque is not None and handwheel_angle is not None:
        raise ValueError("an operating point has a torque or a handwheel_angle: give one of them")
    key, wanted = ("torque [N m]", torque) if torque is not None else ("handwheel_angle [rad]", handwheel_angle or 0.0)
    wanted = number(key, wanted, minimum=0.0, maximum=100.0)
    curve = c.torques if torque is not None else c.angles
    if wanted and c.speed == 0.0:
        raise ValueError("at standstill only straight running can be linearised: give a speed above 0, or no torque")
    if wanted > curve.max():
        raise ValueError(
            f"{key} of {wanted:g} is out of reach at {3.6 * c.speed:.4g} km/h: a slow turn of the handwheel reaches "
            f"{curve.max():.4g}, then the grip of the front tyres fades or {c.end}; give less"
        )
    start = c.states[int(np.argmax(curve >= wanted))]
    # The knots next to a given torque are moved first; at a given angle the torque is known only then.
    p = _off_knots(c.plant, torque or 0.0, c.speed, above)
    point = Point(p, start, np.zeros(len(INPUTS)), c.speed)
    if c.speed > 0.0:
        point = _newton(point, key, wanted, by_torque=torque is not None)
    return point._replace(plant=_off_knots(p, point.torque, c.speed, above))


def _newton(point: Point, key: str, wanted: float, by_torque: bool) -> Point:
    """The steady point from one nearby; its handwheel angle is unknown, too, where the torque is given (P7)."""
    p, state, u = point.plant, point.state.copy(), point.inputs.copy()
    u[HAND] = state[HANDWHEEL_ANGLE] if by_torque else wanted
    row = np.zeros((1, len(plant.channels(p))))
    state[HANDWHEEL_SPEED] = 0.0
    for _ in range(20):
        rows = np.tile(u, (STEPS_PER_CHASSIS_STEP, 1))
        plant.run(p, state, np.tile(u, (_RELAXED, 1)), row, 1)
        after = state.copy()
        plant.run(p, after, rows, row, 1)
        matrix, index = transition(p, state=state, inputs=u)
        off = np.append(after[index] - state[index], p.column.K_tb * (state[0] - state[COLUMN_ANGLE]) - wanted)
        size = np.append(np.maximum(1.0, np.abs(state[index])), 1.0)
        if np.all(np.abs(off / size)[: None if by_torque else -1] < 1e-10):
            return Point(p, state, u, point.speed)
        J = np.zeros((index.size + 1, index.size + 1))
        J[:-1, :-1] = matrix - np.eye(index.size)
        J[:-1, -1] = by_input(p, state, rows, index, [HAND])[:, :, 0].sum(axis=1)
        if by_torque:
            J[-1, :-1] = p.column.K_tb * ((index == HANDWHEEL_ANGLE) * 1.0 - (index == COLUMN_ANGLE))
        else:
            J[-1, -1], off[-1] = 1.0, 0.0
        try:
            change = np.linalg.solve(J, -off)  # (P7)
        except np.linalg.LinAlgError:
            break
        state[index] += change[:-1]
        u[HAND] += change[-1]
        if not np.isfinite(state).all():
            break
    raise ValueError(
        f"the car does not corner steadily with a {key} of {wanted:g} at {3.6 * point.speed:.4g} km/h; give less"
    )


def _off_knots(p: Plant, torque: float, speed: float, above: bool) -> Plant:
    """The plant with a knot of its boost table at the point moved to the other side, along the line of the wanted one.

    At zero torque the curve is odd and has one slope.
    """
    a: Assist = p.assist
    torques, boost = _moved(a.torques, a.boost.T, abs(torque), above) if torque else (a.torques, a.boost.T)
    speeds, both = _moved(a.speeds, np.column_stack([boost.T, a.damping]), abs(speed), above)
    if torques is a.torques and speeds is a.speeds:
        return p
    return frozen(
        p._replace(
            assist=a._replace(torques=torques, speeds=speeds, boost=both[:, :-1].copy(), damping=both[:, -1].copy())
        )
    )


def _moved(grid: Array, values: Array, x: float, above: bool) -> tuple[Array, Array]:
    """A grid (K,) with values (K, M), constant beyond its ends, whose knot at x lies beside it."""
    near, distance = _AT_KNOT
    k = int(np.argmin(np.abs(grid - x)))
    if abs(grid[k] - x) > near:
        return grid, values
    grid, values, way = grid.copy(), values.copy(), 1 if above else -1
    if 0 <= k + way < grid.size:
        values[k] -= way * distance * (values[k + way] - values[k]) / (grid[k + way] - grid[k])
    grid[k] -= way * distance
    return grid, values


def held(point: Point, hands: str = "on", law: Any = None, arms: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Point:
    """The same point with other hands, and with friction at rest.

    Parameters
    ----------
    point : Point
        Of :func:`steady`.
    hands : {"on", "off", "arms"}
        A prescribed handwheel; a constant hand torque, whatever the handwheel does; that with arms on the handwheel.
    law : str or parameters, optional
        A friction law at rest; by default friction slides.
    arms : (float, float, float)
        Inertia, damping and stiffness of the arms [kg m2, N m s/rad, N m/rad]; assumed by who gives them.

    Raises
    ------
    ValueError
        Other hands, or arms without inertia, damping and stiffness.
    """
    if hands not in HANDS:
        raise ValueError(f"hands must be one of {', '.join(HANDS)}, got {hands!r}")
    if (hands == "arms") != any(arms):
        raise ValueError("hands='arms' needs arms=(inertia, damping, stiffness), and other hands have none")
    p, state, u = point.plant, point.state, point.inputs.copy()
    if hands != "on":
        I_arm, C_arm, K_arm = arms
        p = p._replace(robot=0.0, column=p.column._replace(I_arm=I_arm, C_arm=C_arm, K_arm=K_arm))
        u[HAND] = point.torque + K_arm * point.handwheel_angle
    if law is not None:
        resting = friction_laws.resolve(law)
        p = p._replace(friction=frozen(resting))
        state = np.append(state[: layout_of(p).memory], np.zeros(law_of(resting).memory_size(resting)))
    return Point(p, state, u, point.speed)


def _steps(p: Plant, state: Array) -> Array:
    """Steps (S,) of the differences by which friction at rest stays at rest and rounding of wheel loads stays small.

    The step equations are linear in the torques and in the stored values, which take large steps.
    """
    at, found = layout_of(p), 1e-6 * np.maximum(1.0, np.abs(state))
    found[: at.assist] = found[at.memory :] = 1e-6
    found[at.assist : at.chassis] = found[at.rate : at.functions] = 1e-3
    return found


def linearise(point: Point, coarser: float = 1.0) -> control.StateSpace:
    """The plant around a point as a discrete system at the chassis step of 2 ms (P6).

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
    p, u = point.plant, point.inputs
    rows = np.tile(u, (STEPS_PER_CHASSIS_STEP, 1))
    steps, side = coarser * _steps(p, point.state), 1 if point.speed == 0.0 else 0
    A, index = by_state(p, point.state, rows, lambda f, i: slope(f, steps[i], side))  # (P6)
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
    kept = _read(A, C)
    A, C, total = A[np.ix_(kept, kept)], C[:, kept], total[kept]
    labels = ["handwheel_angle", "handwheel_speed"] if p.robot else ["hand_torque"]
    return control.ss(
        A, total, C, D, CHASSIS_STEP,
        states=[states(p)[i][0] for i in index[kept]],
        inputs=[f"{name}_input" if name.startswith("handwheel") else name for name in labels]
        + [INPUTS[i][0] for i in others],
        outputs=names,
    )  # fmt: skip


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
    shown = [i for i, name in enumerate(names) if name not in _PLACE]

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
