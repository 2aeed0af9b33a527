"""The column with its motor and sampled assist, linear: the equations from which stability, margins and the design of
controllers are read.

Friction slides at a constant torque, and the boost curve is replaced by its local slope. The twist phi = th1 - th2 of
the torsion bar stands in place of the column angle, and between two changes of the command the column moves as

    phi' = w1 - w2
    I2 w2' = K_tb phi + C_tb (w1 - w2) - C2 w2 + T_m + T_C                                     (C2)
    T_m' = omega_m (command - T_m)                                                             (E2)
    (I1 + I_arm) w1' = -K_tb phi - C_tb (w1 - w2) - (C1 + C_arm) w1 - K_arm th1 + T_hand       (C1), (C3)

A handwheel whose motion is prescribed has no equation of its own: its speed w1 is then an input. Nothing here imports
python-control before a :class:`System` is asked for its ``state_space``, because its import takes longer than that of
an environment.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.vehicle.steering.assist import active_return, inertia_compensation, lead_lag
from steer_env.vehicle.steering.assist.first_order import FirstOrder
from steer_env.vehicle.steering.assist.functions import Functions, gain_at
from steer_env.vehicle.steering.column import Column
from steer_env.vehicle.steering.eps import SAMPLE_TIME, Assist, boost_curve

if TYPE_CHECKING:
    import control

Array = NDArray[np.float64]

# Of the continuous column: its states, of which a prescribed handwheel leaves the first three, then its inputs.
TWIST, COLUMN_SPEED, MOTOR_TORQUE, HANDWHEEL_SPEED, HANDWHEEL_ANGLE, COMMAND, HAND_TORQUE, COLUMN_TORQUE = range(8)
STATES = ("twist", "column_speed", "motor_torque", "handwheel_speed", "handwheel_angle")
OUTPUTS = ("torsion_bar_torque", "column_speed")


class System(NamedTuple):
    """Matrices of a linear system at samples of 1 ms, with the names of what they act on."""

    A: Array  # (n, n)
    B: Array  # (n, m)
    C: Array  # (p, n)
    D: Array  # (p, m)
    states: Sequence[str]
    inputs: Sequence[str]
    outputs: Sequence[str]

    def state_space(self) -> "control.StateSpace":
        """The system for python-control, with the same names."""
        import control

        names = {kind: list(getattr(self, kind)) for kind in ("states", "inputs", "outputs")}
        return control.ss(self.A, self.B, self.C, self.D, SAMPLE_TIME, **names)


@lru_cache
def _column_over(c: Column, bandwidth: float, time: float, free: bool) -> tuple[Array, Array]:
    """The column's states (n,) after a time [s] by those before (n, n), and by its inputs (n, 3), which stay constant.

    Cached, as many assists share them. The inputs are command, handwheel speed or hand torque, and column torque.
    """
    from scipy.linalg import expm  # here, because its import takes a quarter of the start of an environment

    rates, I1, bar = np.zeros((8, 8)), c.I1 + c.I_arm, np.zeros(8)
    bar[[TWIST, COLUMN_SPEED, HANDWHEEL_SPEED]] = c.K_tb, -c.C_tb, c.C_tb  # torque of the torsion bar on the column
    rates[TWIST, [COLUMN_SPEED, HANDWHEEL_SPEED]] = -1.0, 1.0
    rates[COLUMN_SPEED] = bar / c.I2  # (C2)
    rates[COLUMN_SPEED, [MOTOR_TORQUE, COLUMN_TORQUE]] = 1.0 / c.I2
    rates[COLUMN_SPEED, COLUMN_SPEED] -= c.C2 / c.I2
    rates[MOTOR_TORQUE, [MOTOR_TORQUE, COMMAND]] = -bandwidth, bandwidth  # (E2)
    if free:
        rates[HANDWHEEL_SPEED] = -bar / I1  # (C1) with (C3)
        rates[HANDWHEEL_SPEED, [HANDWHEEL_ANGLE, HAND_TORQUE]] = -c.K_arm / I1, 1.0 / I1
        rates[HANDWHEEL_SPEED, HANDWHEEL_SPEED] -= (c.C1 + c.C_arm) / I1
        rates[HANDWHEEL_ANGLE, HANDWHEEL_SPEED] = 1.0
    n, hand = (5, HAND_TORQUE) if free else (3, HANDWHEEL_SPEED)
    kept = [*range(n), COMMAND, hand, COLUMN_TORQUE]
    found = expm(time * rates[np.ix_(kept, kept)])[:n]
    return found[:, :n], found[:, n:]


def _filtered(f: FirstOrder, x: Array, u: Array) -> tuple[Array, Array]:
    """Output of a filter and its next state, each over all states and inputs (N,)."""
    y = f.b0 * u + x
    return y, f.b1 * u - f.a1 * y


def plant(c: Column, a: Assist, speed: float, *, free: bool = False) -> System:
    """From the assist request to the sensor: boost and lead-lag open, the other functions of the assist closed.

    Parameters
    ----------
    c, a : parameters of column and assist
    speed : float
        Vehicle speed, for what depends on it [m/s].
    free : bool
        Whether the handwheel is free; otherwise its motion is prescribed. A free handwheel meets the active return at
        its steepest, near straight ahead; with a prescribed one the return is left out.

    Returns
    -------
    System
        Inputs, held over a sample: request [N m], handwheel speed [rad/s] or, if free, hand torque [N m], torque on the
        column from rack and friction [N m]. Outputs: torsion-bar torque [N m], column speed [rad/s]. States: those of
        the column, then the commands of the last delay + 1 samples, the newest first, then the filter of the inertia
        compensation.
    """
    f, n, queued = a.functions, 5 if free else 3, a.delay + 1
    filters = inertia_compensation.STATES if isinstance(f, Functions) else ()
    states = (*STATES[:n], *(f"command_{i}" for i in range(queued)), *(name for name, _ in filters))
    rows = np.eye(len(states) + 3)  # each state and input, over all of them
    x, queue, derivative, (request, hand, on_column) = np.split(rows, np.cumsum([n, queued, len(filters)]))
    output = np.array([c.K_tb * x[TWIST], x[COLUMN_SPEED]])
    command = request - boost_curve(a, 0.0, speed)[1] * x[COLUMN_SPEED]
    if isinstance(f, Functions):
        accelerated, derivative[0] = _filtered(f.inertia_compensation.derivative, derivative[0], x[COLUMN_SPEED])
        command = command + gain_at(f, f.inertia_compensation.gain, speed) * accelerated  # (E14)
        damping = gain_at(f, f.damping.gain, speed)
        if free:
            stiffness = gain_at(f, f.active_return.gain, speed) * active_return.share(f.active_return, speed)
            damping += stiffness * f.active_return.lead
            command = command - stiffness * x[HANDWHEEL_ANGLE]  # (E11)
        command = command - damping * (x[HANDWHEEL_SPEED] if free else hand)
    commands = np.vstack([command, queue])
    # The command changes within the sample: the old one acts for the offset, the new one for the rest.
    for time, acting in ((a.offset, queue[-1]), (SAMPLE_TIME - a.offset, commands[a.delay])):
        by_state, by_input = _column_over(c, a.bandwidth, time, free)
        x = by_state @ x + by_input @ np.array([acting, hand, on_column])
    after = np.vstack([x, commands[:-1], derivative])
    inputs = ("request", "hand_torque" if free else "handwheel_speed", "column_torque")
    return _system(after, output, states, inputs, OUTPUTS)


def answer(a: Assist, gain: float, slope: float = 0.0) -> System:
    """From the torsion bar's torque to the request: boost and lead-lag, and what needs no filter.

    Parameters
    ----------
    a : parameters of the assist
    gain : float
        Local slope of the boost curve [1].
    slope : float
        Slope of the functions over the torsion bar's torque, without the lead-lag [1].
    """
    f = a.functions
    states = ("lead_filter", *(name for name, _ in (lead_lag.STATES if isinstance(f, Functions) else ())))
    *x, torque = np.eye(len(states) + 1)
    boosted, x[0] = _filtered(FirstOrder(a.lead_b0, a.lead_b1, a.lead_a1), x[0], gain * torque)
    request = boosted + slope * torque
    if isinstance(f, Functions):
        lagging, x[1] = _filtered(f.lead_lag.lag, x[1], torque)
        shifted, x[2] = _filtered(f.lead_lag.lead, x[2], lagging)
        request = request + f.lead_lag.gain * shifted  # (E15)
    return _system(np.array(x), request[None], states, OUTPUTS[:1], ("request",))


def _system(after: Array, output: Array, *names: Sequence[str]) -> System:
    """The system whose next states and outputs are rows over its states and inputs; their names in its order."""
    n = len(after)
    return System(after[:, :n], after[:, n:], output[:, :n], output[:, n:], *names)


def closed(system: System, K: System) -> System:
    """A :func:`plant` with an :func:`answer` to its torsion-bar torque closed; the answer's states are the last."""
    torque, request = system.C[:1], system.B[:, :1]
    above, below = np.hstack([system.A + request @ K.D @ torque, request @ K.C]), np.hstack([K.B @ torque, K.A])
    B = np.vstack([system.B, np.zeros((len(K.A), system.B.shape[1]))])
    C = np.hstack([system.C, np.zeros((len(system.C), len(K.A)))])
    return system._replace(A=np.vstack([above, below]), B=B, C=C, states=(*system.states, *K.states))


def poles(system: System, a: Assist, gains: Array, slopes: Array | float = 0.0) -> NDArray[np.complex128]:
    """Eigenvalues (N, n) of the loop of a :func:`plant` closed with answers at gains (N,) and slopes (N,) [1]."""
    none, one = (closed(system, answer(a, gain)).A for gain in (0.0, 1.0))  # it is linear in gain and slope
    loops, n = none + np.reshape(gains, (-1, 1, 1)) * (one - none), len(system.A)
    loops[:, :n, :n] += np.reshape(slopes, (-1, 1, 1)) * (system.B[:, :1] @ system.C[:1])
    return np.linalg.eigvals(loops).astype(np.complex128)  # in one call: less than half the time


def response(system: "System | control.StateSpace", z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """First output over first input (F,) of a system at points z (F,) of the unit circle."""
    inputs = np.broadcast_to(system.B[:, :1], (z.size, len(system.B), 1))
    states = np.linalg.solve(z[:, None, None] * np.eye(len(system.A)) - system.A, inputs)
    return (system.C[:1] @ states)[:, 0, 0] + system.D[0, 0]  # type: ignore[no-any-return]
