"""Linear single-track (bicycle) model of a car at constant speed, for analysis.

    m (v_y' + v r) = Y_f + Y_r              Y = -C alpha + Y_A A + Y_d delta,   A = v_y' + v r    (L1)
    I_z r' = a Y_f - b Y_r + M_f + M_r      M = N alpha + M_A A + M_d delta                       (L2)
    alpha_f = (v_y + a r)/v - delta         alpha_r = (v_y - b r)/v                               (L3)

delta is the road-wheel angle that the rack prescribes. C and N are the slopes of both tyres of an axle at static load.
Steering compliance softens the front axle, lateral compliance the rear axle. The effects of body roll (camber and steer
angles of both axles, and, through the compliance, the wheel loads on the rack) follow the lateral acceleration without
delay. Y_d and M_d are further effects of steering: the drive force turns with the wheels, their camber changes, and
their load deflects the steering. The model leaves out the relaxation of the tyres and the time that the body takes to
roll, so that its gains agree with the simulated chassis up to some 0.2 Hz;
:func:`steer_env.vehicle.analysis.understeer.response` has both. Load transfer is of second order and therefore not in a
linear model. Left is positive, as everywhere. Source: the textbook model (Pacejka, Tyre and Vehicle Dynamics, 2006,
section 1.3), extended by aligning torque, compliance and quasi-static roll; derived here.
"""

from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import positive
from steer_env.vehicle.analysis import linear_axles
from steer_env.vehicle.cars import Car


class LinearSingleTrack(NamedTuple):
    """Parameters of the linear model; :func:`from_car` derives them."""

    speed: float  # [m/s]
    mass: float  # [kg]
    yaw_inertia: float  # [kg m2]
    front_axle: float  # centre of gravity to front axle [m]
    rear_axle: float  # centre of gravity to rear axle [m]
    front_stiffness: float  # C_f, both wheels, softened by the steering's compliance [N/rad]
    rear_stiffness: float  # C_r, both wheels, softened by the lateral compliance of the axle [N/rad]
    front_aligning: float  # N_f [N m/rad]
    rear_aligning: float  # N_r [N m/rad]
    front_roll_force: float  # Y_Af: lateral force over lateral acceleration that roll adds [kg]
    rear_roll_force: float  # Y_Ar [kg]
    front_roll_moment: float  # M_Af: yaw moment over lateral acceleration that roll and load add [kg m]
    rear_roll_moment: float  # M_Ar [kg m]
    steer_force: float  # Y_d, front [N/rad]
    steer_moment: float  # M_d, front [N m/rad]
    steering_ratio: float  # road-wheel angle over handwheel angle [1]

    def _balance(self) -> tuple[NDArray, NDArray]:
        """Y_f + Y_r and the yaw moment: their slopes by (alpha_f, alpha_r), and by (A, delta)."""
        slopes = np.array(
            [
                [-self.front_stiffness, -self.rear_stiffness],
                [
                    self.front_aligning - self.front_axle * self.front_stiffness,
                    self.rear_aligning + self.rear_axle * self.rear_stiffness,
                ],
            ]
        )
        force = self.front_roll_force + self.rear_roll_force
        moment = self.front_axle * self.front_roll_force - self.rear_axle * self.rear_roll_force
        moment += self.front_roll_moment + self.rear_roll_moment
        return slopes, np.array(
            [[force, self.steer_force], [moment, self.front_axle * self.steer_force + self.steer_moment]]
        )

    def state_space(self, steering: str = "road_wheel") -> control.StateSpace:
        """States and outputs of the model as a linear system.

        Parameters
        ----------
        steering : {"road_wheel", "handwheel"}
            Which angle is the input [rad].

        Returns
        -------
        control.StateSpace
            States v_y [m/s] and yaw rate [rad/s]; outputs v_y, yaw rate, lateral acceleration [m/s2].

        Raises
        ------
        ValueError
            Another name of the input.
        """
        if steering not in ("road_wheel", "handwheel"):
            raise ValueError(f"steering must be 'road_wheel' or 'handwheel', got {steering!r}")
        gain = self.steering_ratio if steering == "handwheel" else 1.0
        slopes, rest = self._balance()
        v, m = self.speed, self.mass
        # (L3): slopes of alpha_f and alpha_r by v_y, r, delta
        alphas = np.array([[1.0, self.front_axle, -gain * v], [1.0, -self.rear_axle, 0.0]]) / v
        force, moment = slopes @ alphas + np.outer(rest[:, 1], [0.0, 0.0, gain])
        acceleration = force / (m - rest[0, 0])  # A of (L1)
        yaw = (moment + rest[1, 0] * acceleration) / self.yaw_inertia  # (L2)
        rows = np.array([acceleration - [0.0, v, 0.0], yaw])
        out = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], acceleration])
        return control.ss(
            rows[:, :2],
            rows[:, 2:],
            out[:, :2],
            out[:, 2:],
            states=["lateral_speed", "yaw_rate"],
            inputs=[f"{steering}_angle"],
            outputs=["lateral_speed", "yaw_rate", "lateral_acceleration"],
        )

    def understeer_gradient(self) -> float:
        """Understeer gradient: road-wheel angle over lateral acceleration beyond that of the path [rad s2/m] (L4).

        It is d delta/dA - L/v^2. With the levers a' = a - N_f/C_f and b' = b + N_r/C_r, L' = a' + b', F = m - Y_A and
        the moment M that roll adds over lateral acceleration,

            K_A = ((F b' - M)/C_f - (F a' + M)/C_r)/L'        delta = (L/v^2 + K_A) A/(1 + K_d)

        K_d is K_A with Y_d, M_d for -F, M. Without these effects K is the textbook's m (b/C_f - a/C_r)/L.
        """
        a = self.front_axle - self.front_aligning / self.front_stiffness
        b = self.rear_axle + self.rear_aligning / self.rear_stiffness
        _, ((force, steer_force), (moment, steer_moment)) = self._balance()

        def angle(force: float, moment: float) -> float:
            front, rear = force * b - moment, force * a + moment
            return float(front / self.front_stiffness - rear / self.rear_stiffness) / (a + b)

        path = (self.front_axle + self.rear_axle) / self.speed**2
        return (path + angle(self.mass - force, moment)) / (1.0 - angle(-steer_force, steer_moment)) - path  # (L4)


def from_car(
    car: Car,
    speed: float,
    *,
    aligning: bool = True,
    compliance: bool = True,
    roll: bool = True,
) -> LinearSingleTrack:
    """The linear model of a car.

    Parameters
    ----------
    car : Car
    speed : float
        Above 0 [m/s].
    aligning : bool
        Whether aligning torques turn the car.
    compliance : bool
        Whether the rack force bends the steering, and the lateral force the rear axle.
    roll : bool
        Whether camber, steer angles and rack force follow the roll of the body.

    Raises
    ------
    ValueError
        A speed that is not above zero.
    """
    k = linear_axles.axles(car, positive("speed [m/s]", speed))
    if not compliance:
        k = k._replace(rear_compliance=0.0)
    s = linear_axles.steady(k, False, compliance, roll)
    (steer_f, steer_r), M = s.lateral.steer, s.moments
    # Slips, deflection and roll angles follow from the slip angles of (L3), A and delta.
    given = [s.slip[0] + steer_f - s.delta, s.slip[1] + steer_r, s.acceleration, s.delta, *s.zero]
    inverse = np.linalg.inv(given)[:, :4]
    turns = 1.0 if aligning else 0.0
    moments = [turns * torque + uneven for torque, uneven in zip(M.aligning, M.uneven)]
    Y_f, Y_r, M_f, M_r = np.array([*s.lateral.Y, *moments]) @ inverse
    c = car.chassis
    return LinearSingleTrack(
        speed=speed,
        mass=c["mass"],
        yaw_inertia=c["yaw_inertia"],
        front_axle=c["front_axle"],
        rear_axle=c["rear_axle"],
        front_stiffness=-float(Y_f[0]),
        rear_stiffness=-float(Y_r[1]),
        front_aligning=float(M_f[0]),
        rear_aligning=float(M_r[1]),
        front_roll_force=float(Y_f[2]),
        rear_roll_force=float(Y_r[2]),
        front_roll_moment=float(M_f[2]),
        rear_roll_moment=float(M_r[2]),
        steer_force=float(Y_f[3]),
        steer_moment=float(M_f[3]),
        steering_ratio=car.steering_gain(speed),
    )
