"""The chassis against a second derivation in plain numpy, a linear model, and results computed by hand."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest

from steer_env import friction
from steer_env.vehicle import cars, chassis, plant
from steer_env.vehicle.chassis import single_track
from steer_env.vehicle.chassis.common.interface import COMMON_OUTPUTS as OUTPUTS
from steer_env.vehicle.chassis.single_track import STATES, layout
from steer_env.vehicle.constants import GRAVITY as G
from steer_env.vehicle.suspension.macpherson import WheelLoad, load_coefficients, rack_force

CAR = cars.load()
C = CAR.chassis
TYRE = CAR.tyre.symmetric()
TYRE = replace(TYRE, coefficients=TYRE.coefficients._replace(PHX1=0.0, PHX2=0.0))  # as the plant takes it
L = C["front_axle"] + C["rear_axle"]
STATIC = 0.5 * G * C["mass"] * np.array([C["rear_axle"], C["front_axle"]]) / L  # on a front, a rear wheel [N]
TRACK = np.array([C["front_track"], C["rear_track"]])
CENTRE = CAR.strut.solve(0.0, 0.0)
RADIUS = CAR.strut.loaded_radius
ROLL_CENTRE = np.array([float(CENTRE.roll_centre_height), C["rear_roll_centre"]])
AXIS = (ROLL_CENTRE[0] * C["rear_axle"] + ROLL_CENTRE[1] * C["front_axle"]) / L  # roll axis below the mass centre
ARM = C["sprung_height"] - AXIS
STIFFNESS = 0.5 * np.array([C["front_spring"], C["rear_spring"]]) * TRACK**2
STIFFNESS += [C["front_anti_roll"], C["rear_anti_roll"]]
DAMPING = 0.5 * np.array([C["front_damper"], C["rear_damper"]]) * TRACK**2
UNSPRUNG = np.array([C["front_unsprung_mass"], C["mass"] - C["sprung_mass"] - C["front_unsprung_mass"]])
INERTIA = C["roll_inertia"] + C["sprung_mass"] * ARM**2  # about the roll axis
COUPLING = C["sprung_mass"] * ARM
MASSES = np.array([[C["mass"], -COUPLING], [-COUPLING, INERTIA]])
KPH = 1.0 / 3.6
AXLES = ("front", "rear")
# Rear steer angle and inclination over the roll angle: a wheel's travel is half the track times the roll angle.
ROLL_STEER, ROLL_CAMBER = -0.5 * C["rear_bump_steer"] * TRACK[1], 1.0 - 0.5 * C["rear_camber_gain"] * TRACK[1]
FIRST = [name for name, _ in plant.state_names(CAR.plant())].index(STATES[0][0])
CHASSIS = slice(FIRST, FIRST + len(STATES))


def code(p, x, rack, wind=(0.0, 0.0)):
    """Derivative (15,), outputs (9,) and rack force of the module under test."""
    dx, out = np.empty(len(STATES)), np.empty(len(OUTPUTS))
    u = np.zeros(len(chassis.INPUTS))
    u[[chassis.WIND_FORCE, chassis.WIND_MOMENT]] = wind
    force = single_track.derivative(p.chassis, p.strut, p.tyre[0], np.asarray(x, float), rack, 0.0, u, dx, out)
    return dx, out, force


def drag(v):
    return 0.5 * 1.2 * C["drag_area"] * v**2


def scaled(axle, chassis=C):
    """The tyre of an axle, with the factor on its cornering stiffness."""
    c, factor = TYRE.coefficients, chassis[f"{axle}_cornering_stiffness_factor"]
    keys = ("PKY1", "QBZ1", "QBZ2", "QBZ3", "QBZ9")
    return replace(TYRE, coefficients=c._replace(**{key: factor * getattr(c, key) for key in keys}))


def second_derivation(c, v, mu, x, rack, wind):
    """Newton and Euler for bodies and wheels as vectors, with the exact strut and the checked tyre."""
    v_y, r, phi, phi_rate = x[:4]
    slips, e, transfer, drive = np.reshape(x[4:8], (2, 2)), x[8], np.array(x[9:11]), x[11]
    right_gains = (STIFFNESS * phi + DAMPING * phi_rate) / TRACK + transfer
    loads = STATIC[:, None] + np.outer(np.clip(right_gains, -STATIC, STATIC), [-1.0, 1.0])
    poses = CAR.strut.solve_pair(rack - e, -0.5 * TRACK[0] * phi, 0.5 * TRACK[0] * phi)
    # positions and headings in the complex plane of the road, ahead + i left: FL, FR; RL, RR
    at = np.array([[C["front_axle"]], [-C["rear_axle"]]]) + 0.5j * np.outer(TRACK, [1.0, -1.0])
    # A left rear wheel that rises by s turns by bump_steer s to the left and leans by camber_gain s to the right.
    rises, mirror = np.array([-0.5, 0.5]) * TRACK[1] * phi, np.array([1.0, -1.0])
    lean = mirror * c["rear_camber_gain"] * rises + phi
    camber = np.array([[float(pose.inclination) + phi for pose in poses], lean])
    of_axles = [
        scaled(axle, c).forces(0.0, np.arctan(slips[i]), camber[i], loads[i], v, mu) for i, axle in enumerate(AXLES)
    ]
    F_x, F_y, M_x, M_y, M_z = np.stack(of_axles, axis=1)
    steer = mirror * c["rear_bump_steer"] * rises + c["rear_lateral_compliance"] * F_y[1]
    heading = np.array([np.exp(1j * np.array([float(pose.steer_angle) for pose in poses])), 1.0 + 1j * steer])
    F_x = F_x + M_y / RADIUS + np.array([[0.5 * drive], [0.0]])
    F = heading * (F_x + 1j * F_y)
    moment = np.sum((np.conj(at) * F).imag) + M_z.sum() + wind[1]
    side = F.imag.sum() + wind[0]
    weight = C["sprung_mass"] * G * ARM * phi
    roll = weight - STIFFNESS.sum() * phi - DAMPING.sum() * phi_rate - wind[0] * ARM
    A, roll_acceleration = np.linalg.solve(MASSES, [side, roll])
    velocity = (v + 1j * v_y + 1j * r * at) * np.conj(heading)
    slip_rates = (velocity.imag - np.abs(velocity.real) * slips) / TYRE.relaxation_length
    # weight of a wheel and force of the anti-roll bar rest on the wheel, not on its strut
    past_strut = 0.5 * UNSPRUNG[0] * G + np.array([-1.0, 1.0]) * C["front_anti_roll"] / C["front_track"] * phi
    rack_load = sum(
        float(
            rack_force(
                pose, WheelLoad(0.0, F_x[0, i], F_y[0, i], loads[0, i], M_x[0, i], 0.0, M_z[0, i], -past_strut[i])
            )
        )
        for i, pose in enumerate(poses)
    )
    give = rack_load / (CAR.steering["compliance"] * float(CENTRE.per_rack.rotation[..., 2]) ** 2)
    axle = UNSPRUNG * A
    lever = ((F.imag.sum(axis=1) - axle) * ROLL_CENTRE + axle * RADIUS) / TRACK
    needed = drive - (F.real.sum() - drag(v) + C["mass"] * v_y * r)
    grip = mu * 2.0 * STATIC[0]
    travel = (v + 1j * v_y) * np.exp(1j * x[12])
    dx = [A - v * r, moment / C["yaw_inertia"], phi_rate, roll_acceleration, *slip_rates.ravel()]
    dx += [(give - e) / C["compliance_time"], *((lever - transfer) / single_track.LOAD_TIME)]
    dx += [(min(max(needed, -grip), grip) - drive) / C["speed_hold_time"], r, travel.real, travel.imag]
    steer = [float(pose.steer_angle) for pose in poses]
    out = [side / C["mass"], *steer, *loads.ravel(), *F.imag.sum(axis=1)]
    return np.array(dx), np.array(out), rack_load, (at, F, M_z)


SCALE = np.array([0.5, 0.3, 0.05, 0.3, *[0.08] * 4, 2e-3, 600.0, 300.0, 1500.0, 1.0, 10.0, 10.0])


@pytest.mark.parametrize("mu", [1.0, 0.4])
@pytest.mark.parametrize("v", [5.0, 100.0 * KPH, 60.0])
def test_second_derivation(v, mu):
    """With stiffness factors, bump steer, camber and compliance of the rear axle that all act, of either sign."""
    own = {"front_cornering_stiffness_factor": 1.3, "rear_cornering_stiffness_factor": 1.6}
    own |= {"rear_bump_steer": -0.8, "rear_camber_gain": 0.4, "rear_lateral_compliance": -4e-7}
    car = CAR._replace(chassis={**C, **own})
    p = car.plant(speed=v, road_friction=mu)
    rng = np.random.default_rng(4)
    found, expected = [], []
    for i in range(40):
        x = SCALE * rng.uniform(-1.0, 1.0, SCALE.size) * (0.1 if i < 10 else 1.0)
        rack, wind = rng.uniform(-0.06, 0.06), rng.uniform(-1.0, 1.0, 2) * (800.0, 400.0)
        found.append(np.hstack(code(p, x, rack, wind)))
        expected.append(np.hstack(second_derivation(car.chassis, v, mu, x, rack, wind)[:3]))
    error = np.abs(np.array(found) - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert error.max() < 2e-7  # the strut's table; 3e-8 as it stands


def slope(f, step):
    return (np.array(f(step)) - np.array(f(-step))) / (2.0 * step)


def linear_model(v):
    """Straight running, linear, as python-control states; inputs rack, wind force, wind moment.

    It holds: cornering, camber and aligning stiffness at static load, relaxation, roll with roll steer and roll camber,
    geometric load transfer, compliance, jacking by wheel load and drive force, rolling resistance and drag. Two front
    wheels count as one, since left and right differ in loads only, and those act through the jacking alone.
    States v_y, r, phi, phi', front and rear slip, compliance, transfers; outputs r, a_y, phi, rack force, road wheel.
    """
    tyres = [scaled(axle) for axle in AXLES]
    wheel_f, wheel_r = (
        lambda x, W=W, tyre=tyre: np.ravel(tyre.forces(0.0, x[0], x[1], W + x[2], v)) for W, tyre in zip(STATIC, tyres)
    )
    alpha_f, alpha_r = (slope(lambda s, f=f: f((s, 0.0, 0.0)), 1e-5) for f in (wheel_f, wheel_r))
    camber_f, camber_r = (slope(lambda s, f=f: f((0.0, s, 0.0)), 1e-5) for f in (wheel_f, wheel_r))
    rolling = np.array([f((0.0, 0.0, 0.0))[3] for f in (wheel_f, wheel_r)]) / RADIUS
    rolling_slope = np.array([slope(lambda s, f=f: f((0.0, 0.0, s)), 1.0)[3] for f in (wheel_f, wheel_r)]) / RADIUS
    ahead = 0.5 * (drag(v) - 2.0 * rolling.sum()) + rolling[0]  # of a front wheel at its centre [N]

    def knuckle(rack, travel):
        pose = CAR.strut.solve(rack, travel)
        return [float(pose.steer_angle), float(pose.inclination), *map(float, load_coefficients(pose))]

    k = knuckle(0.0, 0.0)
    per_rack, per_travel = slope(lambda s: knuckle(s, 0.0), 1e-4), slope(lambda s: knuckle(0.0, s), 1e-4)

    unit = np.eye(12)
    v_y, r, phi, phi_rate, s_f, s_r, e, T_f, T_r, rack, wind, moment = unit
    change = np.outer(per_rack, rack - e) - 0.5 * TRACK[0] * np.outer(per_travel, phi)  # of the left knuckle
    steer, camber = change[0], change[1] + phi
    F_y, M_x, M_z = (2.0 * (alpha_f[i] * s_f + camber_f[i] * camber) for i in (1, 2, 4))
    F_yr, M_zr = (2.0 * (alpha_r[i] * s_r + camber_r[i] * ROLL_CAMBER * phi) for i in (1, 4))
    steer_r = ROLL_STEER * phi + C["rear_lateral_compliance"] * 0.5 * F_yr
    Y_f, Y_r = F_y + 2.0 * ahead * steer, F_yr + 2.0 * rolling[1] * steer_r
    gain_f, gain_r = (
        (STIFFNESS[i] * phi + DAMPING[i] * phi_rate) / TRACK[i] + transfer for i, transfer in enumerate((T_f, T_r))
    )
    uneven = TRACK[0] * gain_f * rolling_slope[0] + TRACK[1] * gain_r * rolling_slope[1]
    yaw = C["front_axle"] * Y_f - C["rear_axle"] * Y_r + M_z + M_zr + uneven + moment
    side = Y_f + Y_r + wind
    roll = (COUPLING * G - STIFFNESS.sum()) * phi - DAMPING.sum() * phi_rate - ARM * wind
    A, roll_acceleration = np.linalg.solve(MASSES, np.array([side, roll]))
    # knuckle coefficients: 3 F_x at the centre, 4 F_y, 5 F_z, 6 M_x, 8 M_z, 9 F_z at the centre; both wheels, the
    # right one mirrored
    force = 2.0 * (change[3] * ahead + change[5] * STATIC[0]) - 2.0 * gain_f * (k[3] * rolling_slope[0] + k[5])
    # the struts hold neither the wheels nor the anti-roll bar
    force += 2.0 * (C["front_anti_roll"] / TRACK[0] * phi * k[9] - 0.5 * UNSPRUNG[0] * G * change[9])
    force = -(force + k[4] * F_y + k[6] * M_x + k[8] * M_z)
    sigma, rack_stiffness = TYRE.relaxation_length, CAR.steering["compliance"] * per_rack[0] ** 2
    lever = [
        ((Y - mass * A) * height + mass * A * RADIUS) / track
        for Y, mass, height, track in zip((Y_f, Y_r), UNSPRUNG, ROLL_CENTRE, TRACK)
    ]
    rates = [A - v * r, yaw / C["yaw_inertia"], phi_rate, roll_acceleration]
    rates += [
        (v_y + C["front_axle"] * r - v * (steer + s_f)) / sigma,
        (v_y - C["rear_axle"] * r - v * (steer_r + s_r)) / sigma,
    ]
    rates += [(force / rack_stiffness - e) / C["compliance_time"]]
    rates += [(lever[0] - T_f) / single_track.LOAD_TIME, (lever[1] - T_r) / single_track.LOAD_TIME]
    rates, out = np.array(rates), np.array([r, side / C["mass"], phi, force, steer])
    return control.ss(rates[:, :9], rates[:, 9:], out[:, :9], out[:, 9:])


def linearised(p):
    """The module under test by central differences at straight running, over the same states and outputs."""
    x_0 = plant.initial_state(p)[CHASSIS]

    def f(z):
        dx, out, force = code(p, x_0 + z[:15], z[15], z[16:])
        return [*dx[:11], dx[11], x_0[1] + z[1], out[0], z[2], force, 0.5 * (out[1] + out[2])]

    steps = np.array([*[1e-3] * 4, *[1e-5] * 4, 1e-6, 1.0, 1.0, 1.0, 1e-5, 1.0, 1.0, 1e-5, 1.0, 1.0])
    J = np.column_stack([slope(lambda s, u=u: f(s * u), step) for u, step in zip(np.eye(18), steps)])
    assert np.abs(J[11, [*range(11), 15, 16, 17]]).max() < 1e-3  # the drive does not see lateral motion, nor steers:
    assert np.abs(J[[*range(11), *range(12, 17)], 11]).max() < 1e-12  # torque steer is zero to first order
    return control.ss(J[:11, :11], J[:11, 15:], J[12:, :11], J[12:, 15:])


@pytest.mark.parametrize("v", [5.0, 100.0 * KPH, 60.0])
def test_frequency_response_is_the_linear_model(v):
    omega = 2j * math.pi * np.array([1e-3, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0])
    expected, found = linear_model(v)(omega), linearised(CAR.plant(speed=v))(omega)
    error = np.abs(found - expected).max(axis=2) / np.abs(expected).max(axis=2)
    assert error.max() < 3e-5  # differences, and the strut's table


def settled(angle, v=100.0 * KPH, law=None, seconds=15.0, wind=0.0):
    """The last row of a run with a ramp to a handwheel angle in a second, which then holds; and the state."""
    p = CAR.plant(law or friction.make("viscous", sigma_2=0.0), v, robot=True)
    u = np.zeros((round(seconds * 1e3), len(plant.INPUTS)))
    t = np.arange(1, len(u) + 1) * 1e-3
    u[:, plant.HAND] = angle * np.where(t < 1.0, t - np.sin(2 * math.pi * t) / (2 * math.pi), 1.0)
    u[:, plant.HAND_SPEED] = angle * np.where(t < 1.0, 1.0 - np.cos(2 * math.pi * t), 0.0)
    u[:, chassis.WIND_FORCE] = wind
    state, row = plant.initial_state(p), np.zeros((1, len(plant.CHANNELS)))
    assert plant.run(p, state, u, row, 1)
    return dict(zip(plant.CHANNEL, row[0])), state, p


def test_steady_gains_are_those_of_the_linear_model():
    """A run of 15 s at 0.03 m/s2 against the linear model; understeer gradient 1.86 deg/g at 100 km/h."""
    v = 100.0 * KPH
    row, _, p = settled(3e-3)
    rack = p.pinion_radius * row["column_angle"]
    names = "yaw_rate", "lateral_acceleration", "roll_angle", "rack_force"
    gains = np.array([row[name] for name in names]) / rack
    np.testing.assert_allclose(gains, linear_model(v).dcgain()[:4, 0], rtol=2e-5)
    assert gains[1] == pytest.approx(gains[0] * v, rel=1e-6)
    per_rack = float(CENTRE.per_rack.rotation[..., 2])
    understeer = (per_rack - L * gains[0] / v) / gains[1]  # of the steering's angle: compliance counts [rad s2/m]
    assert math.degrees(understeer) * G == pytest.approx(1.86, abs=0.01)


def test_lag_of_yaw_and_lateral_acceleration():
    """Lateral acceleration lags 0.08 s behind yaw at 100 km/h, which the steady sideslip explains.

    a_y = v (r + beta'), and steady beta = r (b/v - D_r v), where D_r is the angle by which the rear axle drifts over
    lateral acceleration: slip less roll steer and compliance. To first order in frequency a_y leads r by beta/r.
    """
    v, omega = 100.0 * KPH, 2.0 * math.pi * 0.01
    response = linearised(CAR.plant(speed=v))(1j * omega)[:, 0]
    yaw_lag, a_y_lag = -np.angle(response[:2]) / omega
    by_slip, by_lean = (
        2.0 * slope(lambda s, u=u: np.ravel(scaled("rear").forces(0.0, s * u[0], s * u[1], STATIC[1], v)), 1e-5)[1]
        for u in np.eye(2)
    )
    force, phi = C["mass"] * C["front_axle"] / L, COUPLING / (STIFFNESS.sum() - COUPLING * G)  # at 1 m/s2
    steer = ROLL_STEER * phi + C["rear_lateral_compliance"] * 0.5 * force
    D_r = (force - by_lean * ROLL_CAMBER * phi) / -by_slip - steer
    lead = C["rear_axle"] / v - D_r * v
    assert a_y_lag - yaw_lag == pytest.approx(-lead, rel=0.08)  # the aligning torque is left out by hand
    assert yaw_lag == pytest.approx(0.052, abs=1e-3)
    assert a_y_lag == pytest.approx(0.135, abs=1e-3)


@pytest.mark.parametrize("angle", [0.2, 0.6])
def test_steady_circle_balances(angle):
    """Forces sum to mass times acceleration, moments to zero, and the power of all wheels is that of the air drag."""
    row, state, p = settled(angle, law="lugre")
    v = p.chassis.v_x
    x = state[CHASSIS]
    at, F, M_z = second_derivation(C, v, 1.0, x, p.pinion_radius * row["column_angle"], (0.0, 0.0))[3]
    v_y, r = x[layout.LATERAL_SPEED], x[layout.YAW_RATE]
    assert F.imag.sum() == pytest.approx(C["mass"] * v * r, rel=1e-6)
    assert F.real.sum() - drag(v) == pytest.approx(-C["mass"] * v_y * r, rel=1e-6)
    assert (np.conj(at) * F).imag.sum() + M_z.sum() == pytest.approx(0.0, abs=1e-6 * np.abs(F).sum())
    power = (np.conj(v + 1j * v_y + 1j * r * at) * F).real.sum() + r * M_z.sum()
    assert power == pytest.approx(drag(v) * v, rel=1e-4)
    assert row["front_lateral_force"] + row["rear_lateral_force"] == pytest.approx(C["mass"] * v * r, rel=1e-6)


def test_left_turn_signs_and_roll_by_hand():
    """Left is positive in every lateral quantity; the body rolls right, the right wheels carry more."""
    row, _, p = settled(0.3, law="lugre")
    for name in ("handwheel_torque", "column_angle", "torsion_bar_torque", "motor_torque", "friction_torque"):
        assert row[name] > 0.0, name
    for name in ("rack_force", "yaw_rate", "yaw_angle", "y", "lateral_acceleration", "roll_angle"):
        assert row[name] > 0.0, name
    a_y = row["lateral_acceleration"]
    assert row["lateral_speed"] < 0.0  # at speed the tail hangs out
    assert 0.0 < row["road_wheel_angle_left"] < p.pinion_radius * 0.3 / 0.1149  # less than the handwheel asks for
    phi = COUPLING * a_y / (STIFFNESS.sum() - COUPLING * G)
    assert row["roll_angle"] == pytest.approx(phi, rel=1e-4)
    forces = row["front_lateral_force"], row["rear_lateral_force"]
    for i, (axle, force) in enumerate(zip(("front", "rear"), forces)):
        body = (force - UNSPRUNG[i] * a_y) * ROLL_CENTRE[i]
        gain = (STIFFNESS[i] * phi + body + UNSPRUNG[i] * a_y * RADIUS) / TRACK[i]
        assert row[f"wheel_load_{axle}_right"] - STATIC[i] == pytest.approx(gain, rel=1e-3)
    # about the ground: the whole load transfer is the weight's and the acceleration's moment
    moment = sum(TRACK[i] * (row[f"wheel_load_{axle}_right"] - STATIC[i]) for i, axle in enumerate(("front", "rear")))
    height = (C["sprung_mass"] * C["sprung_height"] + UNSPRUNG.sum() * RADIUS) / C["mass"]
    assert moment == pytest.approx(C["mass"] * height * a_y + COUPLING * G * phi, rel=3e-3)  # one roll axis only


def test_wind_from_the_right():
    """The wind moves the car to the left and rolls it to the left, at once and after five seconds."""
    p = CAR.plant()
    x = plant.initial_state(p)[CHASSIS]
    dx, out, _ = code(p, x, 0.0, (500.0, 0.0))
    push = np.linalg.solve(MASSES, [500.0, -500.0 * ARM])
    np.testing.assert_allclose([dx[layout.LATERAL_SPEED], dx[layout.ROLL_RATE]], push, rtol=1e-9)
    assert out[0] == pytest.approx(500.0 / C["mass"], rel=1e-12)
    assert push[0] > 0.0 > push[1]
    dx, _, _ = code(p, x, 0.0, (0.0, 500.0))
    assert dx[layout.YAW_RATE] == pytest.approx(500.0 / C["yaw_inertia"], rel=1e-12)
    row, _, _ = settled(0.0, wind=300.0, seconds=5.0)
    assert row["y"] > 0.0 > row["roll_angle"]


def test_compliance_deflects_under_the_rack_force():
    p = CAR.plant()
    x = np.zeros(len(STATES))
    x[[layout.SLIP_FL, layout.SLIP_FR]] = -0.03  # both front tyres push left
    dx, out, force = code(p, x, 0.0)
    assert force > 0.0
    assert out[7] > 0.0
    assert dx[layout.COMPLIANCE] == pytest.approx(force / p.chassis.K_rack / C["compliance_time"], rel=1e-12)
    x[layout.COMPLIANCE] = 1e-3  # the tie rods stay behind a left turn
    assert code(p, x, 5e-3)[1][1] < code(p, x, 6e-3)[1][1] == pytest.approx(code(p, x * 0.0, 5e-3)[1][1], abs=1e-12)


def test_slip_follows_over_the_relaxation_length():
    """At a steady lateral speed, a rolling tyre reaches 63 % of its slip after one relaxation length."""
    p = CAR._replace(chassis={**C, "rear_lateral_compliance": 0.0}).plant(speed=10.0)
    x = np.zeros(len(STATES))
    x[layout.LATERAL_SPEED] = 0.2
    places = slice(layout.SLIP_FL, layout.SLIP_RR + 1)
    step = 0.55 / 1000
    for _ in range(1000):
        x[places] += step / 10.0 * code(p, x, 0.0)[0][places]
    np.testing.assert_allclose(x[places], 0.02 * (1.0 - math.exp(-1.0)), rtol=1e-3)


SWAP = [0, 1, 2, 3, 5, 4, 7, 6, 8, 9, 10, 11, 12, 13, 14]
SIGN = np.array([-1.0] * 11 + [1.0, -1.0, 1.0, -1.0])
SWAP_OUT, SIGN_OUT = [0, 2, 1, 4, 3, 6, 5, 7, 8], np.array([-1.0] * 3 + [1.0] * 4 + [-1.0] * 2)


@pytest.mark.parametrize("v", [3.0, 100.0 * KPH])
def test_mirror_symmetry_is_exact_and_loads_sum_to_the_weight(v):
    p = CAR.plant(speed=v)
    rng = np.random.default_rng(5)
    for _ in range(300):
        x = 2.0 * SCALE * rng.uniform(-1.0, 1.0, SCALE.size)
        rack, wind = rng.uniform(-0.07, 0.07), rng.uniform(-500.0, 500.0, 2)
        dx, out, force = code(p, x, rack, wind)
        dx_m, out_m, force_m = code(p, SIGN * x[SWAP], -rack, -wind)
        np.testing.assert_array_equal(dx_m, SIGN * dx[SWAP])
        np.testing.assert_array_equal(out_m, SIGN_OUT * out[SWAP_OUT])
        assert force_m == -force
        assert out[3:7].sum() == pytest.approx(C["mass"] * G, rel=1e-9)
        assert np.all(out[3:7] >= 0.0)
