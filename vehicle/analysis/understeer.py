"""Understeer of a car by its causes, its cornering compliances, and how late its yaw follows the handwheel.

The cornering compliance of an axle is the angle by which it drifts outwards over lateral acceleration, as a term for
each cause: the slip of its tyres, and the angles by which roll and forces turn its wheels. The understeer gradient is
that of the front axle less that of the rear axle. All terms are values of one steady turn, not differences between cars
with and without an effect; their sum is therefore the gradient. The frequency response adds the states that delay the
car: relaxation of the tyres, roll, steering compliance and torsion bar. Left is positive. Everything holds to first
order around straight running without friction and is derived here, not from the kernels of the simulation;
docs/model.md numbers the equations. Source of the terms: Bundorf, Leffert, The cornering compliance concept for
description of vehicle directional control properties, SAE 760713, 1976.
"""

import math

import control
import numpy as np

from steer_env.friction.numerics.check import one_of, positive
from steer_env.vehicle.analysis import linear_axles
from steer_env.vehicle.analysis.linear_axles import Axles, Lateral, Moments, Roll, Row
from steer_env.vehicle.cars import Car
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.steering.assist import functions
from steer_env.vehicle.steering.by_wire import Wire, ratio_at
from steer_env.vehicle.steering.eps import boost_curve
from steer_env.vehicle.steering.margins import boost_gain

CHASSIS = ("single_track", "two_track")
_STATES = (
    "lateral_speed",
    "yaw_rate",
    "roll_angle",
    "roll_rate",
    "slip_front",
    "slip_rear",
    "compliance_travel",
    "column_angle",
    "column_speed_less_hand",
)
_ROLL_ON_TYRES = "front_roll", "front_roll_rate", "rear_roll", "rear_roll_rate"  # of the body over the axles
OUTPUTS = ("lateral_speed", "yaw_rate", "lateral_acceleration", "roll_angle")


def _checked(speed: float, chassis: str) -> tuple[float, bool]:
    """Speed and whether the chassis has two tracks."""
    one_of("chassis", chassis, CHASSIS)
    return positive("speed [m/s]", speed), chassis == "two_track"


def cornering_terms(car: Car, speed: float, chassis: str = "single_track") -> dict[str, tuple[float, float]]:
    """Cornering compliance of both axles by cause (L11).

    Parameters
    ----------
    car : Car
    speed : float
        Above 0 [m/s].
    chassis : {"single_track", "two_track"}
        The simulated chassis that the turn is of; on two tracks the car also rolls on its tyres, the drag changes the
        loads of the axles, and the drive acts on the driven axles.

    Returns
    -------
    dict
        Front and rear compliance [rad s2/m] by cause, at the road wheels.

    Raises
    ------
    ValueError
        A speed that is not above zero, or another chassis.
    """
    v, two_track = _checked(speed, chassis)
    k = linear_axles.axles(car, v, two_track)
    s = linear_axles.steady(k, two_track)
    x, A, m = s.lateral, s.acceleration, k.mass
    a, b = k.arms[0], -k.arms[1]
    L = a + b
    aligning, uneven = sum(s.moments.aligning), sum(s.moments.uneven)
    angle_f, angle_r = (s.slip[i] + x.steer[i] for i in (0, 1))  # to the body, of the velocity of an axle
    balance = [x.Y[0] + x.Y[1] - m * A, a * x.Y[0] - b * x.Y[1] + aligning + uneven, angle_f - angle_r - L / v**2 * A]
    turn = np.linalg.solve([*s.zero, *balance, A], [0.0] * 7 + [1.0])  # at A = 1 m/s2
    C_f, C_r = -k.by_slip[:, 0]
    own = np.array([[b / C_f, a / C_r], [-1.0 / C_f, 1.0 / C_r]]) / L  # slip by mass times A, and by a yaw moment
    bent, phi_f, phi_r = s.deflection @ turn, s.roll.front @ turn, s.roll.rear @ turn
    tie_rods, steer = s.tie_rods @ turn, [row @ turn for row in x.steer]
    lean_f, lean_r = k.by_lean[0, 0] / C_f, k.by_lean[1, 0] / C_r
    steered = k.per_rack[1] * tie_rods
    along = uneven @ turn * own[1] - k.along * steer / (C_f, C_r)
    # (L11)
    terms = {
        "load and tyres": (m * own[0, 0], m * own[0, 1]),
        "aligning torque": (aligning @ turn * own[1, 0], aligning @ turn * own[1, 1]),
        "steering compliance": (k.per_rack[0] * bent, 0.0),
        "front roll steer": (-k.per_roll[0] * phi_f, 0.0),
        "front camber by roll": (-lean_f * (x.lean[0] @ turn - steered), 0.0),
        "front camber by steer": (-lean_f * steered, 0.0),
        "rear roll steer": (0.0, -k.rear_roll_steer * phi_r),
        "rear camber by roll": (0.0, -lean_r * (x.lean[1] @ turn)),
        "rear lateral compliance": (0.0, -k.rear_compliance * (x.tyres[1][0] @ turn)),
        "drive and rolling resistance": (along[0], along[1]),
    }
    return {cause: (float(front), float(rear)) for cause, (front, rear) in terms.items()}


def budget(car: Car, speed: float, chassis: str = "single_track") -> dict[str, float]:
    """Understeer gradient by cause [rad s2/m]; the sum is the gradient at the road wheels (L12).

    The road-wheel angle is that of the rack: that of the handwheel without the twist of the torsion bar, over the
    steering ratio. Parameters and errors are those of :func:`cornering_terms`.
    """
    # (L12)
    return {cause: front - rear for cause, (front, rear) in cornering_terms(car, speed, chassis).items()}


def cornering_compliances(car: Car, speed: float, chassis: str = "single_track") -> tuple[float, float]:
    """Total cornering compliance of the front and of the rear axle [rad s2/m], at the road wheels (L12).

    D_f = d(delta - (v_y + a r)/v)/dA and D_r = -d((v_y - b r)/v)/dA, in a steady turn; D_f - D_r is the understeer
    gradient. Parameters and errors are those of :func:`cornering_terms`.
    """
    front, rear = zip(*cornering_terms(car, speed, chassis).values())
    return sum(front), sum(rear)  # (L12)


def bundorf_lag(car: Car, speed: float, chassis: str = "single_track") -> float:
    """Lag of the yaw rate behind the road wheels by the cornering compliances alone [s] (L13).

    It is the lag at low frequency of a single track whose yaw inertia is m a b, without relaxation of the tyres, time
    to roll or torsion bar. Parameters and errors are those of :func:`cornering_terms`.

    Source: the form by Bundorf; V, g, D and K there in degrees per g.
    """
    D_f, D_r = cornering_compliances(car, speed, chassis)
    L = car.chassis["front_axle"] + car.chassis["rear_axle"]
    return speed * ((D_f + D_r) / (1.0 + speed * speed * (D_f - D_r) / L) - D_r)  # (L13)


def response(car: Car, speed: float, chassis: str = "single_track", torque: float = 0.0) -> control.StateSpace:
    """The car from the handwheel angle on, without friction (L14).

    The handwheel turns the torsion bar, which turns the column against rack force, motor damping and assist. Phase
    lead, delay and lag of the motor are left out; they matter above some 5 Hz, as does the lag of the geometric load
    transfer. Of the assist's functions the lead-lag has its gain at 0 Hz; friction compensation is left out with the
    friction. By wire the column follows the handwheel by the loop of the position, without delays (W2), (W3).

    Parameters
    ----------
    car, speed, chassis
        As in :func:`cornering_terms`, with its errors.
    torque : float
        Torque of the torsion bar around which the boost curve is replaced by its slope [N m].

    Returns
    -------
    control.StateSpace
        Input handwheel angle [rad]; outputs lateral speed [m/s], yaw rate [rad/s], lateral acceleration of the centre
        of gravity of the whole car [m/s2], roll angle [rad].
    """
    v, two_track = _checked(speed, chassis)
    k, column, radius = linear_axles.axles(car, v, two_track), car.column, car.steering["pinion_radius"]
    wire, ratio = car.assist.wire, ratio_at(car.assist.wire, v)
    states = (*_STATES, *(_ROLL_ON_TYRES if two_track else ()))
    states += ("position_integral",) if isinstance(wire, Wire) else ()
    z = dict(zip((*states, "hand"), np.eye(len(states) + 1)))
    phi, hand, angle, deflection = z["roll_angle"], z["hand"], z["column_angle"], z["compliance_travel"]
    slip, tie_rods = (z["slip_front"], z["slip_rear"]), radius * angle - deflection
    roll = Roll(phi, z["front_roll"], z["rear_roll"]) if two_track else Roll(phi, phi, phi)
    x = linear_axles.lateral(k, slip, roll, tie_rods)
    # The damping of the bar would need the handwheel speed; the state is the column speed less C/I2 hand.
    more = functions.linear(car.assist.functions, v, torque)
    I2 = column.I2 - more.inertia
    by_speed = column.C_tb - more.damping + (wire.speed_gain * ratio if isinstance(wire, Wire) else 0.0)
    column_speed = z["column_speed"] = z["column_speed_less_hand"] + by_speed / I2 * hand
    body, M, contact = (_roll_on_tyres if two_track else _roll_about_axis)(k, car, v, z, x, roll, tie_rods)
    gain, damping = boost_gain(car.assist, torque, v), boost_curve(car.assist, 0.0, v)[1]
    on_column = (1.0 + gain + more.gain) * column.K_tb * (hand - angle) - radius * M.rack - more.stiffness * hand
    on_column = on_column - (column.C2 + column.C_tb + damping) * column_speed
    if isinstance(wire, Wire):
        off = wire.position_gain * (ratio * hand - angle) - column_speed  # (W2) without the handwheel speed
        on_column += wire.speed_gain * off + z["position_integral"] + wire.integral_gain * ratio * hand  # (W3)
        body["position_integral"] = wire.integral_gain * off
    # (L14)
    rates = body | {
        "column_angle": column_speed,
        "column_speed_less_hand": on_column / I2,
        "compliance_travel": (M.rack / k.rack_stiffness - deflection) / car.chassis["compliance_time"],
    }
    for i, name in enumerate(("slip_front", "slip_rear")):
        rates[name] = (contact[i] - v * (x.steer[i] + slip[i])) / car.tyre.relaxation_length
    A = np.array([rates[name] for name in states])
    C = np.array([z["lateral_speed"], z["yaw_rate"], (x.Y[0] + x.Y[1]) / k.mass, phi])
    names = {"states": list(states), "inputs": ["handwheel_angle"], "outputs": list(OUTPUTS)}
    return control.ss(A[:, :-1], A[:, -1:], C[:, :-1], C[:, -1:], **names)


def _roll_about_axis(
    k: Axles, car: Car, v: float, z: dict[str, Row], x: Lateral, roll: Roll, tie_rods: Row
) -> tuple[dict[str, Row], Moments, list[Row]]:
    """Rates of the body of a single track (L14), yaw moments and rack force, lateral speed of the contact points."""
    phi, rate, v_y, r = (z[name] for name in ("roll_angle", "roll_rate", "lateral_speed", "yaw_rate"))
    upright = (GRAVITY * k.coupling - k.roll_stiffness.sum()) * phi - k.roll_damping.sum() * rate
    masses = [[k.mass, -k.coupling], [-k.coupling, k.roll_inertia]]
    A, roll_acceleration = np.linalg.solve(masses, np.array([x.Y[0] + x.Y[1], upright]))
    M = linear_axles.moments(k, x, roll, tie_rods, linear_axles.load_transfer(k, x, phi, rate, A), (r, r))
    yaw = k.arms @ np.array(x.Y) + sum(M.aligning) + sum(M.uneven)
    rates = {
        "lateral_speed": A - v * r,
        "yaw_rate": yaw / car.chassis["yaw_inertia"],
        "roll_angle": rate,
        "roll_rate": roll_acceleration,
    }
    return rates, M, [v_y + arm * r for arm in k.arms]


def _roll_on_tyres(
    k: Axles, car: Car, v: float, z: dict[str, Row], x: Lateral, roll: Roll, tie_rods: Row
) -> tuple[dict[str, Row], Moments, list[Row]]:
    """As :func:`_roll_about_axis`, of two tracks: the axles roll on their tyres, the body on its springs (L15)."""
    rate, v_y, r = (z[name] for name in ("roll_rate", "lateral_speed", "yaw_rate"))
    c, spin = car.chassis, 4.0 * k.wheel_inertia * v / k.radius  # angular momentum of the wheels
    transfer = linear_axles.transfer_on_tyres(k, roll)
    steering = k.turn_per_rack * car.steering["pinion_radius"] * z["column_speed"]
    M = linear_axles.moments(k, x, roll, tie_rods, transfer, (r + steering, r))
    whole, axles = linear_axles.roll_on_tyres(k, x, roll, transfer)
    rates_of_axles = z["front_roll_rate"], z["rear_roll_rate"]
    axles = [axles[i] + k.roll_damping[i] * rates_of_axles[i] for i in (0, 1)]
    on_body = whole + spin * r - axles[0] - axles[1]  # (L15)
    yaw = k.arms @ np.array(x.Y) + sum(M.aligning) + sum(M.uneven) - spin * rate
    # Inertia of a body with its unsprung masses at its centre of gravity, which moves them up and down.
    sprung, up, down = c["sprung_mass"], c["sprung_height"] - k.height, k.radius - k.height
    ahead = float(k.unsprung @ k.arms)
    product = down * ahead - up * ahead
    I = [[c["roll_inertia"] + sprung * up**2 + k.unsprung.sum() * down**2, -product], [-product, c["yaw_inertia"]]]
    roll_acceleration, yaw_acceleration = np.linalg.solve(I, np.array([on_body, yaw]))
    rates = {
        "lateral_speed": (x.Y[0] + x.Y[1]) / k.mass - v * r,
        "yaw_rate": yaw_acceleration,
        "roll_angle": rate,
        "roll_rate": roll_acceleration,
    }
    for i, name in enumerate(("front_roll", "rear_roll")):
        rates[name] = rates_of_axles[i]
        rates[f"{name}_rate"] = roll_acceleration - 4.0 * axles[i] / (k.unsprung[i] * k.track[i] ** 2)
    contact = [v_y + k.arms[i] * r + k.height * rate - k.roll_centres[i] * rates_of_axles[i] for i in (0, 1)]
    return rates, M, contact


def yaw_lag(car: Car, speed: float, frequency: float = 0.2, chassis: str = "single_track") -> float:
    """Lag of the yaw rate behind the handwheel at a frequency [Hz], from :func:`response` [s]."""
    omega = 2.0 * math.pi * positive("frequency [Hz]", frequency)
    own = complex(np.squeeze(response(car, speed, chassis)(1j * omega))[OUTPUTS.index("yaw_rate")])
    return -float(np.angle(own)) / omega
