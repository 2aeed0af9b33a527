"""LQG: hand torque that follows the reference feel, as well as a linear controller can.

The model is the assisted column between control steps (:func:`steer_env.assists.common.linear.sampled`): its state x, driven
by the request u, the handwheel's speed w1 and the torque d of rack and friction on the column. Both are disturbances
that wander at random, so that the estimate of d is integral action. From the torsion bar's torque T and the column
speed a Kalman filter estimates x, w1 and d; around the steady state at which T is the reference r under these, the
regulator is optimal for the sum of (T - r)^2 + (effort (u - u_s))^2:

    (A - I) x_s + B_u u_s = -B_w w1 - B_d d,    C_T x_s = r,    u = u_s - K (x - x_s)

Linearised: the boost curve, by its slope at ``linearised_at``; friction slides at constant torque and the rack's
stiffness is left out, both for d to take up; the handwheel's motion is given, as firm hands give it; hand torque is
torsion-bar torque, which leaves out the handwheel's inertia. The reference (:mod:`steer_env.reference_feel`, or parking's
own) is taken as it is, nonlinear, from lateral acceleration and handwheel speed.

The reference brings next to no damping, and stiffness that lags with the lateral acceleration. A torque that followed
it without limit leaves arms, let alone a handwheel let go, to oscillate: with the whole span, AssistLaneKeeping's
driver sways at 1.2 Hz, from 0.2 of it on he begins to. So the request stays within 0.1, and is zero while the hands
are known to be off; parking's reference has no such stiffness and gets the whole span. On centre, where the boost
curve is flat, it is linearised for the margins: there the filter and regulator of a steeper slope would be next to
unstable. ``effort`` then leaves 30 deg and 6 dB at every slope of the curve.
"""

from typing import Any

import numpy as np

from steer_env.assists.common.definition import Array, register
from steer_env.assists.common.linear import Linear, LinearBaseline, sampled
from steer_env.friction.numerics.check import not_negative, number, positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.randomise import SENSOR_NOISE
from steer_env.reference_feel import reference_torque
from steer_env.tasks.assist_parking import Robot, wanted_torque


@kernel
def _refer(standing, seen, y):
    """Put the torque wanted in every lane into the last column [N m]; ``standing`` is parking's, or negative."""
    for i in range(seen.shape[0]):
        if standing >= 0.0:
            y[i, 2] = wanted_torque(standing, seen[i, 4])
        else:
            y[i, 2] = reference_torque(seen[i, 3], seen[i, 4])


class LQG(LinearBaseline):
    """LQG on the torsion-bar torque.

    Parameters
    ----------
    env : assist environment
    effort : float
        Torque error that is as bad as a unit of request [1].
    authority : float
        Share of the action's span that the request stays within, 0 to 1; 0.1 by default, in parking 1.
    linearised_at : float
        Torsion-bar torque at which the boost curve's slope is taken [N m].
    torque_noise, speed_noise : float
        Standard deviations of how far the torque d [N m] and the handwheel speed [rad/s] wander in a control step. The
        sensors' noise is ``steer_env.randomise.SENSOR_NOISE``.
    """

    needs = ("speed", "torsion_bar_torque", "column_speed", "lateral_acceleration", "handwheel_speed")
    welcome = ("released",)

    def __init__(
        self,
        env: Any,
        *,
        effort: float = 1.0,
        authority: float | None = None,
        linearised_at: float = 0.0,
        torque_noise: float = 0.2,
        speed_noise: float = 0.05,
    ) -> None:
        super().__init__(env)
        self.effort = positive("effort", effort)
        self.linearised_at = not_negative("linearised_at [N m]", linearised_at)
        self.torque_noise = positive("torque_noise [N m]", torque_noise)
        self.speed_noise = positive("speed_noise [rad/s]", speed_noise)
        rules = self.lanes.task.rules
        self._standing = rules.torque if isinstance(rules, Robot) else -1.0
        usual = 1.0 if isinstance(rules, Robot) else 0.1
        self.authority = usual if authority is None else number("authority", authority, minimum=0.0, maximum=1.0)

    def signals(self, seen: Array) -> Array:
        """Torsion-bar torque, column speed and reference (n, 3)."""
        y = seen[:, 1:4].copy()
        _refer(self._standing, seen, y)
        return y

    def torque(self, seen: Array) -> Array:
        """What the controller asks for, nothing while the hands are off [N m]."""
        return super().torque(seen) * (1.0 - seen[:, 5])

    def design(self, speed: float) -> Linear:
        """Filter and regulator for a speed [m/s]."""
        import control

        from steer_env.vehicle.steering.margins import boost_gain

        car = self.lanes.car
        plant = sampled(car, boost_gain(car.assist, self.linearised_at, speed), speed, self.control_dt)
        n = len(plant.A)
        A, B, T = plant.A, plant.B[:, :1], plant.C[:1]
        K, _, _ = control.dlqr(A, B, T.T @ T, np.array([[self.effort**2]]))
        # The filter's model: x, then w1 and d.
        whole = np.block([[A, plant.B[:, 1:]], [np.zeros((2, n)), np.eye(2)]])
        seen = np.hstack([plant.C, np.zeros((2, 2))])
        wander = np.diag([self.speed_noise**2, self.torque_noise**2])
        sensors = np.diag([SENSOR_NOISE[name] ** 2 for name in self.needs[1:3]])
        _, P, _ = control.dlqe(whole, np.eye(n + 2)[:, n:], seen, wander, sensors)
        L = P @ seen.T @ np.linalg.inv(seen @ P @ seen.T + sensors)  # to the estimate after the measurement
        # Steady state (x_s, u_s) by (w1, d, r), and the request by these and by the estimate of (x, w1, d).
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
