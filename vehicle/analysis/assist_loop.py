"""The assist loop of the whole car, opened at the torque sensor of the torsion bar, with its margins.

The loop is that of :mod:`steer_env.vehicle.steering.margins` with everything that the column is connected to: rack,
tyres, chassis, hands and friction. The plant is sampled at 1 ms and its chassis at 2 ms, so that it repeats itself
after two samples. With the linearised samples x1 = A0 x0 + B0 r0 and x2 = A1 x1 + B1 r1 of the plant without boost, the
answer of the torque T = c x to a request r = z^k, at the frequency of the request, is

    P(z) = (c x0 + c x1/z)/2,   x1 = A0 x0 + B0,   z^2 x0 = A1 x1 + B1 z,   z = exp(j omega 1 ms)              (E17)
    L(z) = -K(z) P(z),   K the boost's slope and all else that answers the torque with a filter                (E17)

Motor damping, damping of the handwheel, inertia compensation, active return and friction compensation stay closed in P.
"""

import math
from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur

from steer_env.friction.numerics.frozen import frozen
from steer_env.vehicle import plant
from steer_env.vehicle.analysis import linearised
from steer_env.vehicle.analysis.linearised import Point
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, RACK_DISTURBANCE
from steer_env.vehicle.layout import plant_layout, state_names
from steer_env.vehicle.plant import CHASSIS_STEP, STEPS_PER_CHASSIS_STEP, Plant
from steer_env.vehicle.steering import by_wire, eps, wire_loops
from steer_env.vehicle.steering.assist.functions import Functions
from steer_env.vehicle.steering.by_wire import Wire
from steer_env.vehicle.steering.column import COLUMN_ANGLE, COLUMN_SPEED, HANDWHEEL_ANGLE, HANDWHEEL_SPEED
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.steering.feels.torque_map import TorqueMap
from steer_env.vehicle.steering.linear import answer
from steer_env.vehicle.steering.margins import FREQUENCIES, Margins, boost_gain, least, read
from steer_env.vehicle.steering.margins import transmitted as of_assist

Array = NDArray[np.float64]

# Growth of a motion in a step of 2 ms that still counts as none [1]. Bristles at rest, of the friction and of the
# observer that compensates it, neither grow nor decay: differences find their eigenvalue of 1 within 1e-8. A motion
# that grows by 1e-6 doubles in 23 minutes.
STABLE = 1e-6


SLOWEST_OF_FEEL = 2.0  # oscillations of a handwheel by wire; slower ones are those of the car, assumed [Hz]
INPUTS = ("request", "rack_disturbance")
OUTPUTS = ("torsion_bar_torque", "column_angle", "column_speed")


class Loop(NamedTuple):
    """The open loop of a point: its plant without boost over two samples, and what answers the torque."""

    plant: control.StateSpace  # at 2 ms: INPUTS of both samples to OUTPUTS at the beginning of both
    answer: control.StateSpace  # K, from the torque to the request

    def plant_response(self, frequency: Array) -> NDArray[np.complex128]:
        """Torque, column angle and speed over request and rack disturbance (F, 3, 2) at frequencies (F,) [Hz]."""
        P = self.plant
        T, Q = schur(P.A, output="complex")  # a triangle, solved from its last row for all frequencies at once
        z = np.exp(2j * math.pi * SAMPLE_TIME * np.asarray(frequency))[:, None, None]
        u = np.concatenate([np.broadcast_to(np.eye(2), (len(z), 2, 2)), z * np.eye(2)], axis=1)
        x0 = Q.conj().T @ (P.B @ u)  # (F, n, 2)
        for i in reversed(range(len(T))):
            x0[:, i] = (x0[:, i] + T[i, i + 1 :] @ x0[:, i + 1 :]) / (z[:, 0] ** 2 - T[i, i])  # (E17)
        first, second = np.split(P.C @ (Q @ x0) + P.D @ u, 2, axis=1)
        return 0.5 * (first + second / z)  # type: ignore[no-any-return]  # (E17)

    def response(self, frequency: Array) -> NDArray[np.complex128]:
        """The open loop L (F,) at frequencies (F,) [Hz]; negative feedback closes it."""
        K = self.answer(np.exp(2j * math.pi * SAMPLE_TIME * np.asarray(frequency)))
        return -np.atleast_1d(K) * self.plant_response(frequency)[:, 0, 0]  # (E17)


def _by_wire(point: Point) -> list[NDArray[np.complex128]]:
    """The loop of the rack's position (W8), and of a handwheel that is not prescribed that of the feel, at FREQUENCIES.

    The first is the actuator's alone. The second is that of the whole car: by a feel that knows the rack force, wire,
    rack and tyres are in it.
    """
    p = point.plant
    z = np.exp(2j * math.pi * SAMPLE_TIME * FREQUENCIES)
    found = [wire_loops.position_loop(p.column, p.assist).response(z)]
    return found if p.robot else [*found, open_loop(point).response(FREQUENCIES)]


def _without_feel(point: Point) -> tuple[Point, Array]:
    """The same point with a request in place of the feel, and how that depends on the states (S,) (W9)."""
    p, w, at = point.plant, point.plant.assist.wire, plant_layout(point.plant)
    told, angle, step = at.wire + by_wire.FORCES + w.wait, point.handwheel_angle, 1e-6
    force = float(point.state[told])

    def slope(by_angle: float, by_force: float) -> float:
        ends = [wire_loops.torque_at(w, angle + k * by_angle, force + k * by_force, point.speed) for k in (-1.0, 1.0)]
        return 0.5 * (ends[1] - ends[0]) / (by_angle or by_force)

    none = {"law": linearised.FRICTIONLESS, "law_size": 0}
    own = w._replace(**none, feel=0.0 * w.feel, force_feel=0.0 * w.force_feel, damping=0.0 * w.damping)
    bare = frozen(p._replace(assist=p.assist._replace(wire=own)))
    start = at.wire + by_wire.MEMORY
    u, state = point.inputs.copy(), np.delete(point.state, np.s_[start : start + w.law_size])
    u[ASSIST_REQUEST] -= wire_loops.torque_at(w, angle, force, point.speed)
    row = np.zeros(state.size)
    row[HANDWHEEL_ANGLE] = slope(step, 0.0) + wire_loops.steepest(w)
    row[HANDWHEEL_SPEED] = np.interp(abs(point.speed), w.speeds, w.damping)
    row[told] = slope(0.0, 1e3 * step)
    return point._replace(plant=bare, state=state, inputs=u), row


def without_boost(point: Point) -> Point:
    """The same point with a request in place of boost and lead-lag."""
    a = point.plant.assist
    f = a.functions
    if isinstance(f, Functions):
        f = f._replace(lead_lag=f.lead_lag._replace(gain=0.0))
    return _requested(point, a._replace(boost=0.0 * a.boost, functions=f), 0.0)


def transmitted(point: Point, factor: float) -> Point:
    """The same point, whose loop is that behind a gear that slides, with a factor of (E25); ``point`` itself at 1."""
    return point if factor == 1.0 else _requested(point, of_assist(point.plant.assist, factor), factor)


def _requested(point: Point, a: eps.Assist, factor: float) -> Point:
    """The point with another assist, of ``factor`` times the boost, and a request that keeps the motor's torque."""
    p, state, u = frozen(point.plant._replace(assist=a)), point.state.copy(), point.inputs.copy()
    if isinstance(a.wire, Wire):  # whose motor at the rack holds it by its integral
        return point._replace(plant=p)
    at = plant_layout(p).assist
    state[at + eps.LEAD_STATE] *= factor
    trial, row = state.copy(), np.zeros((1, len(plant.channels(p))))
    plant.run(p, trial, u[None, :], row, 1)
    u[ASSIST_REQUEST] += state[at + eps.QUEUE] - trial[at + eps.QUEUE]
    return point._replace(plant=p, state=state, inputs=u)


def response(point: Point, frequency: Array) -> NDArray[np.complex128]:
    """The open loop L (F,) around a point at frequencies (F,) [Hz].

    By wire it is that of the feel, or of the rack's position where the handwheel is prescribed, opened at the command
    of its motor.
    """
    if isinstance(point.plant.assist.wire, Wire) and point.plant.robot:
        z = np.exp(2j * math.pi * SAMPLE_TIME * np.asarray(frequency))
        return wire_loops.position_loop(point.plant.column, point.plant.assist).response(z)
    return open_loop(point).response(frequency)


def open_loop(point: Point) -> Loop:
    """The assist loop around a point of :mod:`steer_env.vehicle.analysis.linearised`, opened at the torque sensor.

    By wire it is the loop of the feel, opened at the command of the feedback motor.
    """
    wired = isinstance(point.plant.assist.wire, Wire)
    bare, feel = _without_feel(point) if wired else (without_boost(point), None)
    p, state, row = bare.plant, bare.state.copy(), np.zeros((1, len(plant.channels(bare.plant))))
    found = []
    for _ in range(2):
        here = bare._replace(state=state)
        found.append(linearised.one_sample(here, [ASSIST_REQUEST, RACK_DISTURBANCE]))
        plant.run(p, state, bare.inputs[None, :], row, 1)
    index = found[0][2]
    outputs = np.zeros((3, index.size))
    twist = p.column.K_tb * ((index == HANDWHEEL_ANGLE) * 1.0 - (index == COLUMN_ANGLE))
    outputs[0] = twist if feel is None else feel[index]
    outputs[1], outputs[2] = index == COLUMN_ANGLE, index == COLUMN_SPEED
    (A0, B0, _), (A1, B1, _) = found
    # Each sample reads what the other one writes.
    read = linearised.read_states(np.abs(A0) + np.abs(A1), outputs)
    speed = point.channel("longitudinal_speed") if "longitudinal_speed" in dict(plant.channels(p)) else point.speed
    gain = -1.0 if feel is not None else boost_gain(point.plant.assist, point.torque, speed)
    K = control.ss([], [], [], gain, SAMPLE_TIME) if wired else answer(point.plant.assist, gain).state_space()
    A0, A1, B0, B1, C = A0[np.ix_(read, read)], A1[np.ix_(read, read)], B0[read], B1[read], outputs[:, read]
    two_samples = control.ss(
        A1 @ A0, np.hstack([A1 @ B0, B1]), np.vstack([C, C @ A0]),
        np.block([[np.zeros((3, 4))], [C @ B0, np.zeros((3, 2))]]), CHASSIS_STEP,
        states=[state_names(p)[i][0] for i in index[read]],
        inputs=[*INPUTS, *(f"{name}_of_second" for name in INPUTS)],
        outputs=[*OUTPUTS, *(f"{name}_of_second" for name in OUTPUTS)],
    )  # fmt: skip
    return Loop(two_samples, K)


def grows(point: Point) -> bool:
    """Whether a motion of the closed loop grows."""
    A, _ = linearised.one_step(point)
    kept = linearised.read_states(A)
    return bool(np.abs(np.linalg.eigvals(A[np.ix_(kept, kept)])).max() > 1.0 + STABLE)


def wire_reason(p: Plant) -> str:
    """Why the feel of a plant by wire that knows the rack force is unstable, hands off; empty where it is not.

    Oscillations above 2 Hz alone are judged, at the speed of the plant. The wire's delay is named with the longest one
    that is stable.
    """
    w = p.assist.wire
    if not isinstance(w, Wire) or isinstance(w.feel_law, TorqueMap) or w.every > STEPS_PER_CHASSIS_STEP:
        return ""
    none = {"law": linearised.FRICTIONLESS, "law_size": 0}

    def calm(wait: int) -> bool:
        own = w._replace(**none, observer=w.observer._replace(**none), wait=wait)
        free = p._replace(assist=p.assist._replace(wire=own), friction=linearised.FRICTIONLESS, robot=0.0)
        poles = np.linalg.eigvals(linearised.transition(free)[0])
        fast = np.abs(np.angle(poles)) > 2.0 * math.pi * SLOWEST_OF_FEEL * CHASSIS_STEP
        return bool(np.abs(poles[fast]).max(initial=0.0) <= 1.0 + STABLE)

    if calm(w.wait):
        return ""
    longest = next((wait for wait in range(w.wait - 1, -1, -1) if calm(wait)), -1)
    rest = f"it is stable with at most {longest * SAMPLE_TIME:g} s" if longest >= 0 else "give more damping"
    return f"the feel by the rack force is unstable with steer_by_wire.wire_delay {w.wait * SAMPLE_TIME:g} s: {rest}"


def margins(point: Point) -> Margins:
    """The margins of the assist loop around a point."""
    calm = not grows(point)
    if isinstance(point.plant.assist.wire, Wire):
        return least([read(FREQUENCIES, L, calm) for L in _by_wire(point)])
    return read(FREQUENCIES, open_loop(point).response(FREQUENCIES), calm)
