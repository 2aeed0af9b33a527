"""LQG: the hand torque follows the reference feel by a linear-quadratic-Gaussian controller.

The model is the assisted column between control steps (:func:`steer_env.assists.common.linear.discretise`) with state
x. Its inputs are the request u, the handwheel speed w1 and the torque d of rack and friction on the column. w1 and d
are modelled as random walks, so that the estimate of d gives integral action. A Kalman filter estimates x, w1 and d
from the torsion bar's torque T and the column speed. Around the steady state (x_s, u_s) in which T equals the reference
r under these w1 and d, the regulator minimises the sum of (T - r)^2 + (effort (u - u_s))^2:

    (A - I) x_s + B_u u_s = -B_w w1 - B_d d,    C_T x_s = r,    u = u_s - K (x - x_s)

Linearisation: the boost curve has its slope at ``linearised_at``. Friction slides at constant torque and the rack has
no stiffness; d represents both. The handwheel's motion is prescribed, as by firm hands. The hand torque is the
torsion-bar torque, which neglects the handwheel's inertia. The reference (:mod:`steer_env.tasks.common.reference_feel`,
or that of parking) stays nonlinear, from lateral acceleration and handwheel speed.

The request may use the whole of the action, times the share by which an assist that follows a feel steps back where
nobody holds the handwheel or it moves quickly (:mod:`steer_env.assists.common.reference_feel`), and nothing while the
hands are known to be off. Without that share a released handwheel oscillates, and the arms of a driver on some cars.
The boost curve is linearised on centre, where it is flat, because of the margins: there, filter and regulator designed
for a steeper slope would be almost unstable. ``effort`` then leaves 30 deg and 6 dB at every slope of the curve, and
``torque_noise`` is small enough for 20 ms of delay, which a quicker filter answers with a ripple.
"""

from typing import Any

import numpy as np

from steer_env.assists.common.definition import Array, register
from steer_env.assists.common.linear import Linear, LinearBaseline, discretise
from steer_env.assists.common.reference_feel import Feel
from steer_env.episode.randomise import SENSOR_NOISE
from steer_env.friction.numerics.check import not_negative, number, positive
from steer_env.vehicle.steering.margins import boost_gain


class LQG(LinearBaseline):
    """LQG on the torsion-bar torque.

    Parameters
    ----------
    env : assist environment
    effort : float
        Torque error that costs as much as a request of 1 N m, over 1 N m [1].
    authority : float
        Largest request over the action's full scale, 0 to 1.
    linearised_at : float
        Torsion-bar torque at which the slope of the boost curve is taken [N m].
    torque_noise, speed_noise : float
        Standard deviations of the change of the torque d [N m] and of the handwheel speed [rad/s] in a control step.
        The sensors' noise is ``steer_env.episode.randomise.SENSOR_NOISE``.
    caution : float
        How far quick motions of the handwheel fade the request [1].
    """

    needs = ("speed", "torsion_bar_torque", "column_speed", "lateral_acceleration", "handwheel_speed")
    optional = ("released",)
    tuned = {"effort": (0.2, 5.0), "torque_noise": (0.02, 0.5), "caution": (0.3, 100.0)}  # noqa: RUF012

    def __init__(
        self,
        env: Any,
        *,
        effort: float = 1.0,
        authority: float = 1.0,
        linearised_at: float = 0.0,
        torque_noise: float = 0.05,
        speed_noise: float = 0.05,
        caution: float = 1.0,
    ) -> None:
        super().__init__(env)
        self.effort = positive("effort", effort)
        self.linearised_at = not_negative("linearised_at [N m]", linearised_at)
        self.torque_noise = positive("torque_noise [N m]", torque_noise)
        self.speed_noise = positive("speed_noise [rad/s]", speed_noise)
        self.authority = number("authority", authority, minimum=0.0, maximum=1.0)
        self.caution = not_negative("caution", caution)
        self._feel = Feel(self.batch, self.caution)

    def begin(self, i: int, seen: Any) -> None:
        """Start at rest, without hands."""
        super().begin(i, seen)
        self._feel.begin(i, seen.handwheel_speed)

    def signals(self, seen: Any) -> Array:
        """Torsion-bar torque, column speed and reference (n, 3)."""
        reference = self._feel.references(seen.lateral_acceleration, seen.handwheel_speed, seen.speed)
        return np.column_stack([seen.torsion_bar_torque, seen.column_speed, reference])

    def shares(self, seen: Any) -> Array:
        """The share of a feel that may be followed, zero while the hands are known to be off."""
        share = self._feel.shares(seen.torsion_bar_torque, seen.handwheel_speed, seen.speed)
        return share * (1.0 - seen.released)

    def design(self, speed: float) -> Linear:
        """Filter and regulator for a speed [m/s]."""
        import control

        car = self.batch.car
        plant = discretise(car, boost_gain(car.assist, self.linearised_at, speed), speed, self.control_dt)
        n = len(plant.A)
        A, B, T = plant.A, plant.B[:, :1], plant.C[:1]
        K, _, _ = control.dlqr(A, B, T.T @ T, np.array([[self.effort**2]]))
        # The filter's model: x, then w1 and d.
        whole = np.block([[A, plant.B[:, 1:]], [np.zeros((2, n)), np.eye(2)]])
        seen = np.hstack([plant.C, np.zeros((2, 2))])
        wander = np.diag([self.speed_noise**2, self.torque_noise**2])
        sensors = np.diag([SENSOR_NOISE[name] ** 2 for name in ("torsion_bar_torque", "column_speed")])
        _, P, _ = control.dlqe(whole, np.eye(n + 2)[:, n:], seen, wander, sensors)
        L = P @ seen.T @ np.linalg.inv(seen @ P @ seen.T + sensors)  # gain of the estimate after the measurement
        # Steady state (x_s, u_s) from (w1, d, r), and the request from these and the estimate of (x, w1, d).
        balance = np.block([[A - np.eye(n), B], [T, np.zeros((1, 1))]])
        driven = np.block([[-plant.B[:, 1:], np.zeros((n, 1))], [np.zeros((1, 2)), np.ones((1, 1))]])
        feed = (np.append(K[0], 1.0) @ np.linalg.solve(balance, driven))[:3]
        gains = np.append(-K[0], feed[:2])
        rest = np.eye(n + 2) - L @ seen
        return Linear(
            whole @ rest,
            np.hstack([whole @ L, np.zeros((n + 2, 1))]),
            np.append(B[:, 0], [0.0, 0.0]),
            gains @ rest,
            np.append(gains @ L, feed[2]),
        )


register("lqg", LQG)
