"""Linear single-track (bicycle) model of a car at constant speed, for analysis.

    m (v_y' + v r) = Y_f + Y_r              Y = -C alpha + Y_A A + Y_d delta,   A = v_y' + v r    (L1)
    I_z r' = a Y_f - b Y_r + M_f + M_r      M = N alpha + M_A A + M_d delta                       (L2)
    alpha_f = (v_y + a r)/v - delta         alpha_r = (v_y - b r)/v                               (L3)

delta is the road-wheel angle that the rack prescribes. C and N are the slopes of both tyres of an axle at static load.
Steering compliance softens the front axle. The effects of body roll (roll camber, roll steer, and, through the
compliance, the wheel loads on the rack) follow the lateral acceleration without delay. Y_d and M_d are further effects
of steering: the drive force turns with the wheels, their camber changes, and their load deflects the steering. The
model leaves out the relaxation of the tyres and the time that the body takes to roll, so that its gains agree with the
simulated chassis up to some 0.2 Hz. Load transfer is of second order and therefore not in a linear model. Left is
positive, as everywhere. Source: the textbook model (Pacejka, Tyre and Vehicle Dynamics, 2006, section 1.3), extended by
aligning torque, compliance and quasi-static roll; derived here.
"""

from collections.abc import Callable
from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import positive
from steer_env.vehicle import tyre
from steer_env.vehicle.cars import Car
from steer_env.vehicle.constants import AIR_DENSITY, GRAVITY
from steer_env.vehicle.suspension.macpherson import Pose, load_coefficients


class LinearSingleTrack(NamedTuple):
    """Parameters of the linear model; :func:`from_car` derives them."""

    speed: float  # [m/s]
    mass: float  # [kg]
    yaw_inertia: float  # [kg m2]
    front_axle: float  # centre of gravity to front axle [m]
    rear_axle: float  # centre of gravity to rear axle [m]
    front_stiffness: float  # C_f, both wheels, softened by the steering's compliance [N/rad]
    rear_stiffness: float  # C_r [N/rad]
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


def _slope(f: Callable[[float], NDArray], step: float) -> NDArray:
    return (f(step) - f(-step)) / (2.0 * step)


class _Tyres(NamedTuple):
    """Forces and moments of a tyre at static load: F_x, F_y, M_x, M_y, M_z of each axle, by slip and by camber."""

    loads: NDArray  # of a front and of a rear wheel [N]
    by_slip: list[NDArray]  # of both wheels [N/rad, N m/rad]
    by_camber: list[NDArray]  # of both wheels [N/rad, N m/rad]
    rolling: NDArray  # longitudinal force of rolling resistance of each wheel, negative [N]
    rolling_by_load: NDArray  # [1]


def _tyres(car: Car, v: float) -> _Tyres:
    c = car.chassis
    a, b, R = c["front_axle"], c["rear_axle"], car.strut.loaded_radius
    coefficients = car.tyre.symmetric().coefficients._replace(PHX1=0.0, PHX2=0.0)  # as in the plant
    loads = 0.5 * GRAVITY * c["mass"] * np.array([b, a]) / (a + b)

    def wheel(load: float, alpha: float, camber: float) -> NDArray:
        return np.array(tyre.forces(coefficients, 0.0, alpha, camber, load, v))

    def by(load: float, *unit: float, step: float = 1e-5) -> NDArray:
        return _slope(lambda s: wheel(load + s * unit[0], s * unit[1], s * unit[2]), step)

    return _Tyres(
        loads,
        by_slip=[2.0 * by(load, 0.0, 1.0, 0.0) for load in loads],
        by_camber=[2.0 * by(load, 0.0, 0.0, 1.0) for load in loads],
        rolling=np.array([wheel(F, 0.0, 0.0)[3] for F in loads]) / R,
        rolling_by_load=np.array([by(load, 1.0, 0.0, 0.0, step=1.0)[3] for load in loads]) / R,
    )


def _knuckle(car: Car, rack: float, travel: float) -> NDArray:
    """Steer angle and inclination of the left front wheel, and work of F_x, F_y, F_z, M_x, M_z, F_z at the centre."""
    pose: Pose = car.strut.solve(rack, travel)
    work = load_coefficients(pose)
    forces = (work.F_x_centre, work.F_y, work.F_z, work.M_x, work.M_z, work.F_z_centre)
    values = (pose.steer_angle, pose.inclination, *forces)
    return np.array([float(np.asarray(value)) for value in values])


def _roll(car: Car) -> tuple[float, NDArray]:
    """Roll angle and load transfer of both axles over lateral acceleration, as in ``single_track``."""
    c = car.chassis
    m, a, b, track = c["mass"], c["front_axle"], c["rear_axle"], np.array([c["front_track"], c["rear_track"]])
    centres = np.array([float(car.strut.solve(0.0, 0.0).roll_centre_height), c["rear_roll_centre"]])
    arm = c["sprung_height"] - (centres[0] * b + centres[1] * a) / (a + b)
    stiffness = 0.5 * np.array([c["front_spring"], c["rear_spring"]]) * track**2
    stiffness += [c["front_anti_roll"], c["rear_anti_roll"]]
    phi = c["sprung_mass"] * arm / (stiffness.sum() - c["sprung_mass"] * GRAVITY * arm)
    unsprung = np.array([c["front_unsprung_mass"], m - c["sprung_mass"] - c["front_unsprung_mass"]])
    body = (m * np.array([b, a]) / (a + b) - unsprung) * centres + unsprung * car.strut.loaded_radius
    return phi, (stiffness * phi + body) / track


def _front_response(
    car: Car, tyres: _Tyres, phi: float, transfer: float, ahead: float, compliance: bool, roll: bool
) -> tuple[NDArray, float]:
    """Y_f and M_f by alpha_in, A and delta (2, 3), and the road-wheel angle per rack travel [rad/m].

    The rack deflects by e under its force K e, and alpha = alpha_in - (steer - delta); ``ahead`` is the longitudinal
    force on a front wheel [N].
    """
    k = _knuckle(car, 0.0, 0.0)
    per_rack = _slope(lambda s: _knuckle(car, s, 0.0), 1e-4)
    # Rolling to the right lowers the left wheel in its arch.
    per_roll = -0.5 * car.chassis["front_track"] * _slope(lambda s: _knuckle(car, 0.0, s), 1e-4)
    K = car.steering["compliance"] * float(per_rack[0]) ** 2 if compliance else np.inf
    rolled = (phi * per_roll + [0.0, phi, *[0.0] * 6]) if roll else np.zeros(8)

    # The struts hold neither the unsprung mass nor the anti-roll bar.
    weight = 0.5 * GRAVITY * car.chassis["front_unsprung_mass"]
    bar = car.chassis["front_anti_roll"] / car.chassis["front_track"] * phi

    def axle(e: float, alpha_in: float, A: float, delta: float) -> tuple[float, float, float]:
        change = A * rolled + (delta / per_rack[0] - e) * per_rack
        forces = tyres.by_slip[0] * (alpha_in + delta - change[0]) + tyres.by_camber[0] * change[1]
        work = k[3] * forces[1] + k[5] * forces[2] + k[6] * forces[4]
        work += 2.0 * (change[2] * ahead + change[4] * tyres.loads[0] - change[7] * weight)
        if roll:
            work += 2.0 * A * (bar * k[7] - transfer * (k[4] + k[2] * tyres.rolling_by_load[0]))
        return -work, forces[1] + 2.0 * ahead * change[0], forces[4]

    response = np.zeros((2, 3))
    for j, unit in enumerate(np.eye(3)):
        stiff, bent = axle(0.0, *unit), axle(1.0, *unit)
        e = stiff[0] / (K - (bent[0] - stiff[0]))
        response[:, j] = [low + e * (high - low) for low, high in zip(stiff[1:], bent[1:])]
    return response, float(per_rack[0])


def from_car(
    car: Car,
    speed: float,
    *,
    aligning: bool = True,
    compliance: bool = True,
    roll: bool = True,
    rear_camber: float = 0.0,
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
        Whether the rack force bends the steering.
    roll : bool
        Whether camber, steer angles and rack force follow the roll of the body.
    rear_camber : float
        Inclination of the rear wheels over the roll of the body: 0 for an axle that stays upright (``single_track``),
        1 for wheels that lean with the body (``two_track`` with a ``rear_camber_gain`` of 0) [1].

    Raises
    ------
    ValueError
        A speed that is not above zero.
    """
    v = positive("speed [m/s]", speed)
    c, tyres = car.chassis, _tyres(car, v)
    phi, transfer = _roll(car)
    track = np.array([c["front_track"], c["rear_track"]])
    drag = 0.5 * AIR_DENSITY * c["drag_area"] * v * v
    ahead = 0.5 * (drag - 2.0 * tyres.rolling.sum()) + tyres.rolling[0]
    response, per_rack = _front_response(car, tyres, phi, transfer[0], ahead, compliance, roll)
    # The outer wheels have more rolling resistance.
    uneven = float((track * transfer * tyres.rolling_by_load).sum()) if roll else 0.0
    rear_inclination = rear_camber * phi if roll else 0.0
    turns = 1.0 if aligning else 0.0
    return LinearSingleTrack(
        speed=v,
        mass=c["mass"],
        yaw_inertia=c["yaw_inertia"],
        front_axle=c["front_axle"],
        rear_axle=c["rear_axle"],
        front_stiffness=-float(response[0, 0]),
        rear_stiffness=-float(tyres.by_slip[1][1]),
        front_aligning=turns * float(response[1, 0]),
        rear_aligning=turns * float(tyres.by_slip[1][4]),
        front_roll_force=float(response[0, 1]),
        rear_roll_force=rear_inclination * float(tyres.by_camber[1][1]),
        front_roll_moment=turns * float(response[1, 1]) + uneven,
        rear_roll_moment=turns * rear_inclination * float(tyres.by_camber[1][4]),
        steer_force=float(response[0, 2]),
        steer_moment=float(response[1, 2]),
        steering_ratio=car.steering["pinion_radius"] * per_rack,
    )
