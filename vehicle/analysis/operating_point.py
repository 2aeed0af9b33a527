"""Operating points of the plant: straight running and steady cornering at a torque or a handwheel angle.

A point solves x = f(x, hand angle) for the states after a chassis step, with the torque of the torsion bar where that
is given, by Newton's rule from a slow ramp of the handwheel angle (P8). It is that of the car without friction, the
middle of the hysteresis; :func:`with_hands` gives it other hands, and friction at rest. The compensation of friction by
the assist follows it: while friction slides, so does its observer, at a constant torque; at rest it acts by its own
slope.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from steer_env import friction as friction_laws
from steer_env.friction.law import law_of
from steer_env.friction.numerics.check import number, one_of
from steer_env.friction.numerics.frozen import frozen
from steer_env.vehicle import plant
from steer_env.vehicle.analysis.linearised import FRICTIONLESS, Point, by_input, transition
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND, HAND_SPEED, INPUTS, WHEELS
from steer_env.vehicle.layout import plant_layout
from steer_env.vehicle.plant import CHANNEL, CHASSIS_STEP, STEPS_PER_CHASSIS_STEP, Plant
from steer_env.vehicle.steering import wire_loops
from steer_env.vehicle.steering.assist import friction_compensation, functions
from steer_env.vehicle.steering.by_wire import FORCES, MEMORY, Wire
from steer_env.vehicle.steering.column import COLUMN_ANGLE, HANDWHEEL_ANGLE, HANDWHEEL_SPEED
from steer_env.vehicle.steering.eps import LEAD_STATE, Assist, boost_curve

Array = NDArray[np.float64]

HAND_MODES = ("on", "off", "arms")
_AT_KNOT = 1e-9, 1e-2  # distance to a knot that counts as on it, and how far it is then moved [N m, m/s]
_RAMP, _CHUNK = 20.0, 100  # duration of the ramp to the lock [s], samples between its stored states, assumed
_RELAXED = 4000  # samples between Newton's steps, in which stored values follow and the body comes to rest; even
# Samples before them, in which a car with a drivetrain comes near the speed that it holds; even
_SPEED_HOLD_SAMPLES = 100_000
_SPIN = 0.5  # sideslip angle at which the ramp ends, assumed [rad]


class Cornering(NamedTuple):
    """A slow turn of the handwheel from straight running up to what the car can follow."""

    plant: Plant  # without friction and its compensation, handwheel prescribed
    speed: float  # [m/s]
    states: Array  # (K, S) every 0.1 s
    angles: Array  # (K,) of the handwheel [rad]
    torques: Array  # (K,) of the torsion bar [N m]
    end: str  # why it ended
    compensated: Array | None = None  # (V,) share of the friction that the assist compensates [1]
    wire: Any = None  # controllers by wire with their friction laws


def cornering(car: Car, speed: float, chassis: str = "single_track", road_friction: float = 1.0) -> Cornering:
    """Turn the handwheel to the left, slowly and ever faster, until the lock or the limit of the car.

    Parameters are those of :meth:`steer_env.vehicle.cars.Car.plant`, with its errors.
    """
    p, compensated = _without_compensation(car.plant(FRICTIONLESS, speed, True, road_friction, chassis))
    if by_wire := isinstance(p.assist.wire, Wire):
        if p.assist.wire.every > STEPS_PER_CHASSIS_STEP:
            raise ValueError(
                f"steer_by_wire.wire_sample_time must be at most {CHASSIS_STEP:g} s for a linear model, whose step it "
                f"is, got {p.assist.wire.every * plant.SAMPLE_TIME:g}"
            )
        wire, none = p.assist.wire, {"law": FRICTIONLESS, "law_size": 0}  # the middle of the wanted hysteresis
        own = wire._replace(**none, observer=wire.observer._replace(**none))
        p = frozen(p._replace(assist=p.assist._replace(wire=own)))
    bare = _without_boost(p)  # which is stable where the assist is not; a rack position has the same chassis with both
    state, lock = plant.initial_state(bare), 0.98 * car.handwheel_lock(speed)
    names = {name: i for i, (name, _) in enumerate(plant.channels(p))}
    t = plant.SAMPLE_TIME * np.arange(1, round(_RAMP / plant.SAMPLE_TIME) + 1)
    inputs, row = np.zeros((t.size, len(INPUTS))), np.zeros((1, len(names)))
    inputs[:, HAND], inputs[:, HAND_SPEED] = lock * (t / _RAMP) ** 2, 2.0 * lock * t / _RAMP**2
    found, end = [state.copy()], "the steering is at its lock"
    for start in range(0, t.size if speed > 0.0 else 0, _CHUNK):
        if not plant.run(bare, state, inputs[start : start + _CHUNK], row, 1):
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
    if by_wire:
        angles, told = every[:, HANDWHEEL_ANGLE], every[:, plant_layout(p).wire + FORCES + wire.wait]
        torques = np.array([wire_loops.torque_at(own, *each, speed) for each in zip(angles, told)])
        return Cornering(p, speed, every, angles, torques, end, wire=wire)
    whole = p.column.K_tb * (every[:, HANDWHEEL_ANGLE] - every[:, COLUMN_ANGLE])  # of torsion bar and boost
    grid = np.linspace(0.0, max(whole.max(), 1.0), 2000)
    torques = np.interp(whole, grid + [boost_curve(p.assist, T, speed)[0] for T in grid], grid)
    return Cornering(p, speed, every, every[:, COLUMN_ANGLE] + torques / p.column.K_tb, torques, end, compensated)


def _without_compensation(p: Plant) -> tuple[Plant, Array | None]:
    """The plant whose assist compensates no friction, and the share (V,) that it compensated."""
    f = p.assist.functions
    if not isinstance(f, functions.Functions):
        return p, None
    share = f.friction_compensation.gain
    return _compensating(p, 0.0 * share), share


def _compensating(p: Plant, share: Array) -> Plant:
    f = p.assist.functions
    assert isinstance(f, functions.Functions)
    own = f._replace(friction_compensation=f.friction_compensation._replace(gain=share))
    return frozen(p._replace(assist=p.assist._replace(functions=own)))


def _rested(p: Plant, state: Array, torque: float) -> Array:
    """The state with the observer of the friction compensation in the middle of its hysteresis, as the friction is."""
    found, at = state.copy(), plant_layout(p)
    observer = found[at.functions + functions.FRICTION : at.memory]
    observer[:] = 0.0
    observer[friction_compensation.GRIP : friction_compensation.GRIP + 1] = abs(torque)
    return found


def _without_boost(p: Plant) -> Plant:
    return frozen(p._replace(assist=p.assist._replace(boost=0.0 * p.assist.boost)))


def steady(
    c: Cornering, *, torque: float | None = None, handwheel_angle: float | None = None, above: bool = True
) -> Point:
    """The point of steady cornering with a torque of the torsion bar or a handwheel angle, hands on (P8).

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
    top = int(np.argmax(c.torques))
    curve = (c.torques if torque is not None else c.angles)[: top + 1]
    if wanted and c.speed == 0.0:
        raise ValueError("at standstill only straight running can be linearised: give a speed above 0, or no torque")
    if wanted > curve[-1]:
        raise ValueError(
            f"{key} of {wanted:g} is out of reach at {3.6 * c.speed:.4g} km/h: a slow turn of the handwheel reaches "
            f"{curve[-1]:.4g}, then the torque falls as the grip of the front tyres fades, or {c.end}; give less"
        )
    if handwheel_angle:
        k = int(np.argmax(curve >= wanted))

        def beyond(T: float) -> float:
            return _newton(c, T, above).handwheel_angle - wanted

        # The ramp is ahead of the steady turn by its speed: the torques around the angle are spread.
        low, high = 0.8 * c.torques[k - 1], min(1.2 * c.torques[k], c.torques[top])
        if beyond(low) * beyond(high) > 0.0:
            raise ValueError(f"{key} of {wanted:g} is too near to the fading grip of the front tyres; give less")
        torque = float(brentq(beyond, low, high, xtol=1e-12, rtol=1e-14))
    return _newton(c, torque or 0.0, above)


def _newton(c: Cornering, wanted: float, above: bool) -> Point:
    """The steady point with a torque of the torsion bar [N m] (P8).

    A request of the boost's size stands for the boost, so that the states settle where the assist loop is unstable.
    """
    if isinstance(c.plant.assist.wire, Wire):
        return _newton_by_wire(c, wanted)
    p = _off_knots(c.plant, wanted, c.speed, above)
    bare, a, K_tb, row = _without_boost(p), p.assist, p.column.K_tb, np.zeros((1, len(plant.channels(p))))
    k = int(np.argmax(c.torques >= wanted))
    state, u = c.states[k].copy(), np.zeros(len(INPUTS))
    if c.speed == 0.0:
        return Point(p, state, u, c.speed, c.compensated)
    boost = boost_curve(a, wanted, c.speed)[0]
    u[HAND], u[ASSIST_REQUEST] = c.angles[k], boost
    state[HANDWHEEL_ANGLE], state[HANDWHEEL_SPEED] = c.angles[k], 0.0
    if "longitudinal_speed" in dict(plant.channels(p)):
        plant.run(bare, state, np.tile(u, (_SPEED_HOLD_SAMPLES, 1)), row, 1)
    for _ in range(20):
        plant.run(bare, state, np.tile(u, (_RELAXED, 1)), row, 1)
        rows, after = np.tile(u, (STEPS_PER_CHASSIS_STEP, 1)), state.copy()
        plant.run(bare, after, rows, row, 1)
        A, index = transition(bare, state=state, inputs=u)
        if not np.isfinite(A).all():
            break
        off = np.append(after[index] - state[index], K_tb * (state[HANDWHEEL_ANGLE] - state[COLUMN_ANGLE]) - wanted)
        if np.all(np.abs(off) < 1e-10 * np.append(np.maximum(1.0, np.abs(state[index])), 1.0)):
            u[ASSIST_REQUEST] = 0.0
            state[plant_layout(p).assist + LEAD_STATE] = (1.0 - a.lead_b0) * boost
            return Point(p, _rested(p, state, wanted), u, c.speed, c.compensated)
        J = np.zeros((index.size + 1, index.size + 1))
        J[:-1, :-1] = A - np.eye(index.size)
        J[:-1, -1] = by_input(bare, state, rows, index, [HAND])[:, :, 0].sum(axis=1)
        J[-1, :-1] = K_tb * ((index == HANDWHEEL_ANGLE) * 1.0 - (index == COLUMN_ANGLE))
        change = np.linalg.solve(J, -off)  # (P8)
        state[index] += change[:-1]
        u[HAND] += change[-1]
        if not np.isfinite(state).all():
            break
    raise ValueError(
        f"the car does not corner steadily with a torque of {wanted:g} N m at {3.6 * c.speed:.4g} km/h; give less"
    )


def _newton_by_wire(c: Cornering, wanted: float) -> Point:
    """As :func:`_newton`, by the angle that has the torque: by secants, as the car follows the angle (P8)."""
    k = int(np.argmax(c.torques >= wanted))
    if not wanted or c.speed == 0.0:
        return Point(c.plant, c.states[0].copy(), np.zeros(len(INPUTS)), c.speed, wire=c.wire)
    angles = [float(np.interp(wanted, c.torques[k - 1 : k + 1], c.angles[k - 1 : k + 1]))]
    angles.append(1.001 * angles[0])
    points = [_settled(c, angle, c.states[k]) for angle in angles]
    for _ in range(20):
        if abs(points[-1].torque - wanted) < 1e-9:
            return points[-1]
        slope = (points[-1].torque - points[-2].torque) / (angles[-1] - angles[-2])
        angles.append(angles[-1] + (wanted - points[-1].torque) / slope)
        points.append(_settled(c, angles[-1], points[-1].state))
    raise ValueError(
        f"the car does not corner steadily with a torque of {wanted:g} N m at {3.6 * c.speed:.4g} km/h; give less"
    )


def _settled(c: Cornering, angle: float, state: Array) -> Point:
    """The steady point at a handwheel angle [rad] by wire, from a state near it (P8)."""
    p, row, u, state = c.plant, np.zeros((1, len(plant.channels(c.plant)))), np.zeros(len(INPUTS)), state.copy()
    u[HAND], state[HANDWHEEL_ANGLE], state[HANDWHEEL_SPEED] = angle, angle, 0.0
    if "longitudinal_speed" in dict(plant.channels(p)):
        plant.run(p, state, np.tile(u, (_SPEED_HOLD_SAMPLES, 1)), row, 1)
    for _ in range(20):
        plant.run(p, state, np.tile(u, (_RELAXED, 1)), row, 1)
        after = state.copy()
        plant.run(p, after, np.tile(u, (STEPS_PER_CHASSIS_STEP, 1)), row, 1)
        A, index = transition(p, state=state, inputs=u)
        off = after[index] - state[index]
        if not np.isfinite(A).all():
            break
        if np.all(np.abs(off) < 1e-10 * np.maximum(1.0, np.abs(state[index]))):
            return Point(p, state, u, c.speed, wire=c.wire)
        state[index] += np.linalg.solve(A - np.eye(index.size), -off)  # (P8)
    raise ValueError(f"the car does not corner steadily at {angle:.4g} rad at {3.6 * c.speed:.4g} km/h; give less")


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


def with_hands(
    point: Point, hands: str = "on", law: Any = None, arms: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Point:
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
    one_of("hands", hands, HAND_MODES)
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
        if point.compensated is not None:
            p = _compensating(p, point.compensated)
        state = np.append(state[: plant_layout(p).memory], np.zeros(law_of(resting).memory_size(resting)))
        if point.wire is not None:
            at, own = plant_layout(p), np.zeros(point.wire.law_size + point.wire.observer.law_size)
            state = np.insert(state, at.wire + MEMORY, own)
            p = frozen(p._replace(assist=p.assist._replace(wire=point.wire)))
    return point._replace(plant=p, state=state, inputs=u)
