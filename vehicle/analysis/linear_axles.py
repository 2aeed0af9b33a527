"""Forces of both axles of a car around straight running, to first order: the ground of the linear models.

Every quantity is a row of coefficients over a basis that the caller chooses, for example the states of a model: the
same equations serve a steady turn (:mod:`steer_env.vehicle.analysis.understeer`), the quasi-static model
(:mod:`steer_env.vehicle.analysis.linear`) and the frequency response. The wheels of an axle count as one, because left
and right differ in their loads only. To first order these act on the rack and through the rolling resistance. Derived
here, not from the kernels of the simulation; docs/model.md numbers the equations.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.vehicle import tyre
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.two_track.from_car import BORE_RELAXATION, bore_friction
from steer_env.vehicle.constants import AIR_DENSITY, GRAVITY
from steer_env.vehicle.suspension.macpherson import load_coefficients
from steer_env.vehicle.tyre.scaling import CORNERING_STIFFNESS

Row = NDArray[np.float64]  # (n,) over a basis
Pair = tuple[Row, Row]  # front and rear
# Of a knuckle: its angles, then the work of the loads per rack.
_STEER, _LEAN, _F_X, _F_Y, _F_Z, _M_X, _M_Z, _F_Z_CENTRE = range(8)
_FORCES = (1, 2, 4)  # F_y, M_x, M_z among the results of a tyre


class Axles(NamedTuple):
    """A car at a speed in slopes; pairs are front and rear, forces and moments those of both wheels."""

    speed: float  # [m/s]
    mass: float  # [kg]
    coupling: float  # sprung mass times the height of its centre of gravity over the roll axis [kg m]
    roll_inertia: float  # about the roll axis [kg m2]
    roll_stiffness: NDArray  # (2,) [N m/rad]
    roll_damping: NDArray  # (2,) [N m s/rad]
    anti_roll: float  # stiffness of the front anti-roll bar [N m/rad]
    roll_centres: NDArray  # (2,) height [m]
    unsprung: NDArray  # (2,) unsprung mass [kg]
    track: NDArray  # (2,) [m]
    arms: NDArray  # (2,) from the centre of gravity to the axles, the rear one negative [m]
    radius: float  # of the loaded wheels [m]
    loads: NDArray  # (2,) static load [N]
    height: float  # of the centre of gravity of the whole car [m]
    wheel_inertia: float  # of one wheel about its axle [kg m2]
    tyre_stiffness: float  # of one tyre, vertical [N/m]
    by_slip: NDArray  # (2, 3) F_y, M_x, M_z by tan(alpha) [N, N m]
    by_lean: NDArray  # (2, 3) F_y, M_x, M_z by inclination [N/rad, N m/rad]
    along: NDArray  # (2,) longitudinal force that turns with the wheels [N]
    rolling_by_load: NDArray  # (2,) longitudinal force of rolling resistance over load [1]
    bore: float  # bore torque of both wheels over their turning, which is friction by the speed of rolling [N m s/rad]
    knuckle: NDArray  # (8,) work of the loads per rack travel, straight ahead, of the left wheel [1, rad/m]
    per_rack: NDArray  # (8,) change of the knuckle over rack travel [rad/m, 1/m, rad/m2]
    per_roll: NDArray  # (8,) over the roll angle of the body over the axle, at fixed rack [1, 1/rad]
    rear_roll_steer: float  # rear steer angle over that roll angle [1]
    rear_roll_lean: float  # inclination of the rear wheels to the body over it [1]
    rear_compliance: float  # rear steer angle over lateral force of the axle [rad/N]
    rack_stiffness: float  # [N/m]

    @property
    def roll_by_acceleration(self) -> float:
        """Steady roll angle over lateral acceleration [rad s2/m]."""
        return self.coupling / (float(self.roll_stiffness.sum()) - GRAVITY * self.coupling)

    @property
    def turn_per_rack(self) -> float:
        """Turn of the front knuckles about z over rack travel, at fixed strut length [rad/m]."""
        return float(self.knuckle[_M_Z])


class Roll(NamedTuple):
    """Roll angles as rows [rad]: of the body over the road, and of the body over its axles, which moves the wheels."""

    body: Row  # [rad]
    front: Row  # [rad]
    rear: Row  # [rad]


class Lateral(NamedTuple):
    """Angles of the wheels [rad] and forces of the tyres, as rows."""

    steer: Pair  # [rad]
    lean: Pair  # [rad]
    tyres: tuple[NDArray, NDArray]  # (3, n) F_y, M_x, M_z [N, N m]
    Y: Pair  # lateral force on the body [N]


class Moments(NamedTuple):
    """What the load transfer and the aligning torques add, as rows."""

    uneven: Pair  # yaw moment of the rolling resistance, which is larger outside [N m]
    aligning: Pair  # aligning torque, with the bore torque [N m]
    rack: Row  # rack force [N]


def _slope(f: Callable[[float], NDArray], step: float) -> NDArray:
    return (f(step) - f(-step)) / (2.0 * step)


def _wheels(car: Car, speed: float, loads: NDArray, drag: float, front_share: float, slips: bool) -> dict[str, NDArray]:
    """The fields of :class:`Axles` that are slopes of the tyres, at loads of a wheel (2,) [N] and an air drag [N].

    ``slips`` says whether the drive force takes slip, which changes the slopes.
    """
    c, R = car.chassis, car.strut.loaded_radius
    neutral = car.tyre.symmetric().coefficients._replace(PHX1=0.0, PHX2=0.0)  # as in the plant
    factors = c["front_cornering_stiffness_factor"], c["rear_cornering_stiffness_factor"]
    tyres = [
        neutral._replace(**{key: factor * getattr(neutral, key) for key in CORNERING_STIFFNESS}) for factor in factors
    ]
    kappa = np.zeros(2)

    def by(i: int, *unit: float, step: float = 1e-5) -> NDArray:
        """Slope of all five results of a tyre by (kappa, alpha, inclination, load)."""
        at, way = np.array([kappa[i], 0.0, 0.0, loads[i]]), np.array(unit)
        return _slope(lambda s: np.array(tyre.forces(tyres[i], *(at + s * way), speed)), step)

    rolling = np.array([tyre.forces(tyres[i], 0.0, 0.0, 0.0, loads[i], speed)[3] for i in (0, 1)]) / R
    drive = (drag - 2.0 * float(rolling.sum())) * np.array([front_share, 1.0 - front_share])
    if slips:
        # Rolling resistance is a torque on the wheels, which pitches the car.
        loads = loads + R * float(rolling.sum()) / (c["front_axle"] + c["rear_axle"]) * np.array([1.0, -1.0])
        kappa = 0.5 * drive / [by(i, 1.0, 0.0, 0.0, 0.0)[0] for i in (0, 1)]
    return {
        "loads": 2.0 * loads,
        "by_slip": np.array([2.0 * by(i, 0.0, 1.0, 0.0, 0.0)[list(_FORCES)] for i in (0, 1)]),
        "by_lean": np.array([2.0 * by(i, 0.0, 0.0, 1.0, 0.0)[list(_FORCES)] for i in (0, 1)]),
        "along": 2.0 * rolling + drive,
        "rolling_by_load": np.array([by(i, 0.0, 0.0, 0.0, 1.0, step=1.0)[3] for i in (0, 1)]) / R,
    }


def _knuckle(car: Car, rack: float, travel: float) -> NDArray:
    """Angles of the left front wheel and work of F_x at the centre, F_y, F_z, M_x, M_z and F_z at the centre (8,)."""
    pose = car.strut.solve(rack, travel)
    work = load_coefficients(pose)
    forces = work.F_x_centre, work.F_y, work.F_z, work.M_x, work.M_z, work.F_z_centre
    return np.array([float(np.asarray(value)) for value in (pose.steer_angle, pose.inclination, *forces)])


def axles(car: Car, speed: float, two_track: bool = False) -> Axles:
    """The slopes of a car at a speed [m/s], on a level and dry road.

    On a single track the drive force acts in front and the loads are those at rest. On two tracks the driven axles
    drive, drag and lift change the loads, and the springs gain leverage in bump, because the strut turns in its arch.
    """
    c, R = car.chassis, car.strut.loaded_radius
    m, m_s, a, b = c["mass"], c["sprung_mass"], c["front_axle"], c["rear_axle"]
    track = np.array([c["front_track"], c["rear_track"]])
    pose = car.strut.straight
    centres = np.array([float(pose.roll_centre_height), c["rear_roll_centre"]])
    h = c["sprung_height"] - (centres[0] * b + centres[1] * a) / (a + b)
    height = (m_s * c["sprung_height"] + (m - m_s) * R) / m
    unsprung = np.array([c["front_unsprung_mass"], m - m_s - c["front_unsprung_mass"]])
    loads = GRAVITY * m * np.array([b, a]) / (a + b)
    stiffness = 0.5 * np.array([c["front_spring"], c["rear_spring"]]) * track**2
    stiffness += [c["front_anti_roll"], c["rear_anti_roll"]]
    pressure, share = 0.5 * AIR_DENSITY * speed * speed, 1.0
    drag = pressure * c["drag_area"]
    if two_track:
        share = car.drivetrain.front_share
        lengths = _slope(lambda s: np.asarray(car.strut.solve(0.0, s).per_travel.strut_length), 1e-4)
        gain = float(lengths / pose.per_travel.strut_length)
        stiffness[0] += 0.25 * track[0] ** 2 * (loads[0] - GRAVITY * unsprung[0]) * gain
        pitched = height * drag / (a + b)
        loads = loads + np.array([-pitched, pitched]) - pressure * np.array([c["front_lift_area"], c["rear_lift_area"]])
    return Axles(
        speed=speed,
        mass=m,
        coupling=m_s * h,
        roll_inertia=c["roll_inertia"] + m_s * h * h,
        roll_stiffness=stiffness,
        roll_damping=0.5 * np.array([c["front_damper"], c["rear_damper"]]) * track**2,
        anti_roll=c["front_anti_roll"],
        roll_centres=centres,
        unsprung=unsprung,
        track=track,
        arms=np.array([a, -b]),
        radius=R,
        height=height,
        wheel_inertia=c["wheel_inertia"],
        tyre_stiffness=car.tyre.vertical_stiffness,
        **_wheels(car, speed, 0.5 * loads, drag, share, two_track),
        bore=2.0 * bore_friction(car.tyre).sigma_0 * BORE_RELAXATION / speed if two_track else 0.0,
        knuckle=_knuckle(car, 0.0, 0.0),
        per_rack=_slope(lambda s: _knuckle(car, s, 0.0), 1e-4),
        # Rolling to the right lowers the left wheel in its arch.
        per_roll=-0.5 * track[0] * _slope(lambda s: _knuckle(car, 0.0, s), 1e-4),
        rear_roll_steer=-0.5 * track[1] * c["rear_bump_steer"],
        rear_roll_lean=-0.5 * track[1] * c["rear_camber_gain"],
        rear_compliance=0.5 * c["rear_lateral_compliance"],
        rack_stiffness=car.rack_stiffness(),
    )


def lateral(k: Axles, slip: Pair, roll: Roll, tie_rods: Row) -> Lateral:
    """Lateral forces of the axles (L5), (L6).

    Parameters
    ----------
    k : Axles
    slip : pair of rows
        Slip angle of the front and of the rear tyres [rad].
    roll : Roll
    tie_rods : row
        Rack travel less the deflection of the steering compliance [m].
    """
    steer_f = k.per_rack[_STEER] * tie_rods + k.per_roll[_STEER] * roll.front  # (L5)
    lean_f = k.per_rack[_LEAN] * tie_rods + k.per_roll[_LEAN] * roll.front + roll.body  # (L5)
    lean = lean_f, k.rear_roll_lean * roll.rear + roll.body  # (L5)
    front, rear = (np.outer(k.by_slip[i], slip[i]) + np.outer(k.by_lean[i], lean[i]) for i in (0, 1))  # (L6)
    steer = steer_f, k.rear_roll_steer * roll.rear + k.rear_compliance * rear[0]  # (L5)
    Y = front[0] + k.along[0] * steer[0], rear[0] + k.along[1] * steer[1]  # (L6)
    return Lateral(steer, lean, (front, rear), Y)


def load_transfer(k: Axles, x: Lateral, roll: Row, roll_rate: Row, acceleration: Row) -> Pair:
    """Load transfer of a body that rolls about an axis (L7), without the lag of its geometric part [N].

    Parameters
    ----------
    k : Axles
    x : Lateral
    roll, roll_rate : row
        [rad, rad/s].
    acceleration : row
        Of the roll axis below the centre of gravity [m/s2].
    """

    def axle(i: int) -> Row:
        unsprung = k.unsprung[i] * acceleration
        body = (x.Y[i] - unsprung) * k.roll_centres[i] + unsprung * k.radius
        return (k.roll_stiffness[i] * roll + k.roll_damping[i] * roll_rate + body) / k.track[i]  # (L7)

    return axle(0), axle(1)


def transfer_on_tyres(k: Axles, roll: Roll) -> Pair:
    """Load transfer of axles that roll on their tyres (L10) [N]."""
    stiffness = 0.5 * k.tyre_stiffness * k.track
    return stiffness[0] * (roll.body - roll.front), stiffness[1] * (roll.body - roll.rear)  # (L10)


def roll_on_tyres(k: Axles, x: Lateral, roll: Roll, transfer: Pair) -> tuple[Row, list[Row]]:
    """Roll moments on the whole car and between the body and each axle, without damping and inertia (L10) [N m]."""
    whole, axles_ = k.height * (x.Y[0] + x.Y[1]), []
    for i, lean in ((0, k.per_roll[_LEAN]), (1, k.rear_roll_lean)):
        # A cambered wheel meets the road beside the foot of its centre.
        offset, M_x = k.radius * x.lean[i], x.tyres[i][1]
        foot = (k.height - k.radius) * roll.body + offset
        whole = whole + k.loads[i] * foot + M_x - k.track[i] * transfer[i]
        spring = k.roll_stiffness[i] * roll[1 + i] + k.roll_centres[i] * x.Y[i]
        axles_.append(spring - lean * (k.loads[i] * offset + M_x) - k.track[i] * transfer[i])
    return whole, axles_


def moments(k: Axles, x: Lateral, roll: Roll, tie_rods: Row, transfer: Pair, turning: Pair) -> Moments:
    """Yaw moments and rack force (L8) from the above and the rates at which the wheels turn about z [rad/s]."""
    F_y, M_x, M_z = x.tyres[0]
    M_z = M_z - k.bore * turning[0]
    work = k.knuckle[_F_Y] * F_y + k.knuckle[_M_X] * M_x + k.knuckle[_M_Z] * M_z
    # The strut holds neither the unsprung mass nor the anti-roll bar (S9).
    for at, load in ((_F_X, k.along[0]), (_F_Z, k.loads[0]), (_F_Z_CENTRE, -GRAVITY * k.unsprung[0])):
        work = work + load * (k.per_rack[at] * tie_rods + k.per_roll[at] * roll.front)
    work = work - 2.0 * (k.knuckle[_F_Z] + k.knuckle[_F_X] * k.rolling_by_load[0]) * transfer[0]
    work = work + 2.0 * k.anti_roll / k.track[0] * k.knuckle[_F_Z_CENTRE] * roll.front
    uneven = k.track * k.rolling_by_load
    aligning = M_z, x.tyres[1][2] - k.bore * turning[1]
    return Moments((uneven[0] * transfer[0], uneven[1] * transfer[1]), aligning, -work)  # (L8)


class Steady(NamedTuple):
    """A steady state as rows over ``slip_f, slip_r, deflection, roll, roll_f, roll_r, A, delta`` (8,)."""

    slip: Pair  # [rad]
    deflection: Row  # of the steering compliance [m]
    tie_rods: Row  # [m]
    roll: Roll
    acceleration: Row  # A [m/s2]
    delta: Row  # road-wheel angle that the rack prescribes [rad]
    lateral: Lateral
    moments: Moments
    zero: NDArray  # (4, 8) what vanishes in equilibrium of the steering and in roll


def steady(k: Axles, two_track: bool, compliance: bool = True, rolls: bool = True) -> Steady:
    """The equations of a steady state; ``zero`` leaves four of its eight coordinates free.

    Parameters
    ----------
    k : Axles
    two_track : bool
        Whether the body also rolls on the tyres, each axle for itself (L10), or about an axis (L9).
    compliance, rolls : bool
        Whether the steering bends, and whether body and loads follow the lateral acceleration.
    """
    slip_f, slip_r, deflection, body, front, rear, A, delta = np.eye(8)
    roll, tie_rods, none = Roll(body, front, rear), delta / k.per_rack[_STEER] - deflection, np.zeros(8)
    x = lateral(k, (slip_f, slip_r), roll, tie_rods)
    if not rolls:
        transfer, balance = (none, none), list(roll)
    elif two_track:
        transfer = transfer_on_tyres(k, roll)
        whole, axles_ = roll_on_tyres(k, x, roll, transfer)
        # The wheels rotate about their axles; turning them left takes a moment that rolls the body right.
        balance = [whole + 4.0 * k.wheel_inertia / k.radius * A, *axles_]
    else:
        transfer = load_transfer(k, x, body, none, A)
        balance = [body - k.roll_by_acceleration * A, front - body, rear - body]  # (L9)
    M = moments(k, x, roll, tie_rods, transfer, (A / k.speed, A / k.speed))
    bent = M.rack - k.rack_stiffness * deflection if compliance else deflection
    return Steady((slip_f, slip_r), deflection, tie_rods, roll, A, delta, x, M, np.array([bent, *balance]))
