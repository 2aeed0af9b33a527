"""The linearised plant against differences of its motion, closed forms from python-control, and simulation."""

import math
from itertools import cycle, product

import control
import numpy as np
import pytest

from steer_env.vehicle import cars, plant
from steer_env.vehicle.analysis import linearised, understeer
from steer_env.vehicle.analysis.linearised import linearise
from steer_env.vehicle.analysis.operating_point import HAND_MODES, cornering, steady, with_hands
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND, INPUTS, RACK_DISTURBANCE
from steer_env.vehicle.steering.margins import boost_gain
from tests.by_law import pairs

CAR = cars.load("compact")
SPEED = 90.0 / 3.6  # between the speeds of the boost table [m/s]
ARMS = (0.05, 0.4, 8.0)


@pytest.fixture(scope="module")
def turns():
    """Slow turns of both chassis."""
    return {chassis: cornering(CAR, SPEED, chassis) for chassis in ("single_track", "two_track")}


def motion(point, column, amplitude, steps):
    """Channels (steps, C) after a pulse of one input over the first chassis step."""
    u = np.tile(point.inputs, (2 * steps, 1))
    u[:2, column] += amplitude
    record, state = np.zeros((len(u), len(plant.channels(point.plant)))), point.state.copy()
    plant.run(point.plant, state, u, record, 1)
    return record[1::2]


def off(point, law, n=250, larger=(1.0, 3.0)):
    """Largest difference of the responses of model and plant to pulses over its largest value, by output.

    The best of several amplitudes counts: small ones lose digits, of the heading most, and large ones are not linear.
    """
    g = linearise(point)
    names, worst = [name for name, _ in plant.channels(point.plant)], dict[str, float]()
    shown = [names.index(name) for name in g.output_labels]
    for name, column, e in (
        *((("hand_torque", HAND, 4e-4),) if not point.plant.robot else ()),
        ("assist_request", ASSIST_REQUEST, 4e-4),
        ("rack_disturbance", RACK_DISTURBANCE, 4e-2),
    ):
        pulse = np.zeros((g.ninputs, n + 1))
        pulse[g.input_labels.index(name), 0] = 1.0
        expected = control.forced_response(g, inputs=pulse).outputs[:, 1:].T
        # The channels end a step at its input, the model's begin the next one.
        expected[0] += g.D[:, g.input_labels.index(name)]
        scale = np.abs(expected).max(axis=0)
        moved = scale > 1e-9
        assert moved.sum() > 15
        best = np.full(len(shown), np.inf)
        for size in larger:
            ends = [k * size * e for k in (2.0, 1.0)]
            far, near = ((motion(point, column, x, n) - motion(point, column, -x, n)) / (2.0 * x) for x in ends)
            # Friction at rest has terms x|x|, whose error falls with the step, not with its square.
            found = (2.0 * near - far if law else (4.0 * near - far) / 3.0)[:, shown]
            best = np.minimum(best, np.abs(found - expected).max(axis=0) / np.maximum(scale, 1e-300))
        for i in np.flatnonzero(moved):
            worst[g.output_labels[i]] = max(worst.get(g.output_labels[i], 0.0), best[i])
    return worst


SITES = {
    "upper_column": "lugre,F_c=0.1",
    "gear": {"law": "lugre", "efficiency": 0.88},
    "rack": "dahl,F_c=0.3",
}


@pytest.mark.parametrize(
    ("torque", "hands", "law"),
    [
        *pairs(product([0.0, 1.7], HAND_MODES, [None, "lugre"])),
        pytest.param(1.7, "off", SITES, marks=pytest.mark.whole),
    ],
)
def test_motion_is_that_of_the_plant(turns, torque, hands, law):
    """The response to a pulse is that of the plant, by five points, within 2e-6 of its largest value."""
    point = with_hands(
        steady(turns["single_track"], torque=torque), hands, law, ARMS if hands == "arms" else (0.0,) * 3
    )
    assert max(off(point, law).values()) < 2e-6


# Channels of two tracks that answer the steering to second order, or as differences of large numbers.
ALONG = ("longitudinal", "kappa", "drive", "front_drive", "throttle", "wheel_angular", "height", "pitch", "wheel_load")


@pytest.mark.whole
@pytest.mark.parametrize(("torque", "hands", "law"), pairs(product([0.0, 1.7], ["on", "off"], [None, "lugre"])))
def test_motion_of_two_tracks_is_that_of_the_plant(turns, torque, hands, law):
    """Within 2e-6 for all that steering moves; the motion ahead, which it hardly moves, to the digits that it has."""
    found = off(
        with_hands(steady(turns["two_track"], torque=torque), hands, law), law, larger=(1.0, 3.0, 10.0, 30.0, 100.0)
    )
    across = {name: value for name, value in found.items() if not name.startswith(ALONG)}
    assert len(across) > 20
    assert max(across.values()) < 2e-6, {name: value for name, value in across.items() if value > 2e-6}
    assert max(found.values()) < 3e-4


FUNCTIONS = {
    "return": {"return_gain": 4.0},
    "damping": {"handwheel_damping": 0.3},
    "inertia": {"inertia_compensation": 0.01},
    "lead-lag": {"lead_lag_gain": 0.2},
    "friction, dahl": {"friction_share": 0.4, "friction_law": "dahl"},
    "friction, coulomb": {"friction_share": 0.4, "friction_law": "coulomb"},
}


@pytest.mark.whole
@pytest.mark.parametrize(("name", "torque"), list(zip(FUNCTIONS, cycle([1.7, 0.0]))))
def test_functions_of_the_assist_have_slopes_of_their_own(name, torque):
    """As the motion of the car without them, within 1e-6, sliding and at rest; each changes the car."""
    changes = {f"assist.{key}": value for key, value in FUNCTIONS[name].items()}
    straight = steady(cornering(cars.load("compact", changes=changes), SPEED), torque=torque)
    for law in (None, "lugre"):
        point = with_hands(straight, "off", law)
        assert max(off(point, law).values()) < 1e-6, law
    plain = with_hands(steady(cornering(CAR, SPEED), torque=torque), "off", "lugre")
    s = np.exp(2j * math.pi * 2.0 * plant.CHASSIS_STEP)
    one, other = (g(s)[g.output_labels.index("yaw_rate"), 0] for g in (linearise(point), linearise(plain)))
    # The return fades where the torsion bar is loaded, and the compensation of friction where it is not.
    assert (abs(one / other - 1.0) > 2e-3) == (name.partition(",")[0] != "friction" or torque > 0.0)


def test_column_on_a_rig():
    """Without rack force, up to 20 Hz: mechanics by python-control, the sampled controller by its transfer function."""
    p = CAR.plant(linearised.FRICTIONLESS, SPEED, True)._replace(pinion_radius=1e-9)
    g = linearise(linearised.Point(p, plant.initial_state(p), np.zeros(len(INPUTS)), SPEED))
    c, a, T = p.column, p.assist, plant.SAMPLE_TIME
    A = [[0.0, 1.0, 0.0], [-c.K_tb / c.I2, -(c.C2 + c.C_tb) / c.I2, 1.0 / c.I2], [0.0, 0.0, -a.bandwidth]]
    B = [[0.0, 0.0, 0.0], [c.K_tb / c.I2, c.C_tb / c.I2, 0.0], [0.0, 0.0, a.bandwidth]]
    mechanics = control.ss(A, B, np.eye(3), 0.0)  # angle, speed and command to angle, speed and motor torque
    slope, damping = boost_gain(a, 0.0, SPEED), np.interp(SPEED, a.speeds, a.damping)
    lead = control.tf([a.lead_b0, a.lead_b1], [1.0, a.lead_a1], T)
    for f in (0.5, 3.0, 8.0, 14.0, 20.0):
        s = 2j * math.pi * f
        G = np.squeeze(mechanics(s))
        hold = np.exp(-s * (a.delay * T + a.offset)) * (1.0 - np.exp(-s * T)) / (s * T)
        boost = hold * lead(np.exp(s * T)) * slope * c.K_tb
        # command = boost (hand - angle) - hold damping speed
        feedback = np.array([[-boost, -hold * damping, 0.0]])
        closed = np.linalg.solve(np.eye(3) - np.outer(G[:, 2], feedback), G[:, 0] + s * G[:, 1] + G[:, 2] * boost)
        whole = g(np.exp(s * 2.0 * T))
        # The model's handwheel follows a cubic through the ends of the steps, which start one step earlier.
        found = (whole[:, 0] + s * whole[:, 1]) * np.exp(s * 2.0 * T)
        for name, expected in zip(("column_angle", "column_speed", "motor_torque"), closed):
            assert abs(found[g.output_labels.index(name)] / expected - 1.0) < 0.005, (f, name)


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
def test_yaw_and_lateral_acceleration_at_low_frequency(turns, chassis):
    """Gain of the closed form of the car's response, which has no lags of the controller, within 0.5 %."""
    g, own = linearise(steady(turns[chassis])), understeer.response(CAR, SPEED, chassis)
    for f in (0.1, 0.3, 0.6):
        s = 2j * math.pi * f
        whole, closed = g(np.exp(s * plant.CHASSIS_STEP)), np.squeeze(own(s))
        for name in ("yaw_rate", "lateral_acceleration") if chassis == "single_track" else ("yaw_rate",):
            row = whole[g.output_labels.index(name)]
            assert abs(row[0] + s * row[1]) == pytest.approx(abs(closed[own.output_labels.index(name)]), rel=0.005)


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
@pytest.mark.parametrize("torque", [0.0, 2.5])
def test_gains_are_those_of_the_steady_plant(turns, chassis, torque):
    """The gain at 0 Hz is the difference of two simulated turns, 90 s after the handwheel has moved on."""
    point = steady(turns[chassis], torque=torque)
    assert point.torque == pytest.approx(torque, abs=1e-9)
    g, e = linearise(point), 1e-4
    names, ends = [name for name, _ in plant.channels(point.plant)], []
    for side in (e, -e):
        u = np.tile(point.inputs, (90_000, 1))
        u[:, HAND] += side
        record, state = np.zeros((1, len(names))), point.state.copy()
        plant.run(point.plant, state, u, record, 1)
        ends.append(record[0])
    expected = (ends[0] - ends[1]) / (2.0 * e)
    kept = [i for i, name in enumerate(g.state_labels) if "yaw_angle" not in name and name != "distance"]
    A, B = g.A[np.ix_(kept, kept)], g.B[kept, 0]
    found = g.C[:, kept] @ np.linalg.solve(np.eye(len(kept)) - A, B) + g.D[:, 0]
    for name in ("yaw_rate", "lateral_acceleration", "torsion_bar_torque", "motor_torque", "rack_force", "roll_angle"):
        assert found[g.output_labels.index(name)] == pytest.approx(expected[names.index(name)], rel=1e-4), name


@pytest.mark.parametrize("above", [False, True])
def test_one_side_of_a_knot(above):
    """At a knot in torque and in speed the slope of the boost is that of the chosen side."""
    a = CAR.assist
    knot, v = float(a.torques[3]), float(a.speeds[4])
    side = 1e-3 if above else -1e-3
    point = steady(cornering(CAR, v), torque=knot, above=above)
    assert boost_gain(point.plant.assist, knot, v) == pytest.approx(boost_gain(a, knot + side, v), rel=1e-6)
    assert boost_gain(a, knot + 1e-3, v) != pytest.approx(boost_gain(a, knot - 1e-3, v), rel=0.01)
    g = linearise(with_hands(point, "on"))
    kept = [i for i, name in enumerate(g.state_labels) if "yaw_angle" not in name and name != "distance"]
    gain = g.C[:, kept] @ np.linalg.solve(np.eye(len(kept)) - g.A[np.ix_(kept, kept)], g.B[kept, 0]) + g.D[:, 0]
    motor, bar = (gain[g.output_labels.index(name)] for name in ("motor_torque", "torsion_bar_torque"))
    assert motor / bar == pytest.approx(boost_gain(a, knot + side, v), rel=1e-6)


def test_a_car_at_standstill():
    """Derivatives at standstill are those from above; a turn at standstill is refused."""
    turn = cornering(CAR, 0.0, "two_track")
    point = steady(turn)
    g = linearise(point)
    assert np.isfinite(g.A).all()
    assert point.channel("longitudinal_speed") == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(ValueError, match="at standstill only straight running"):
        steady(turn, torque=1.0)


def test_refusals(turns):
    """What the car does not reach, or what contradicts itself, is refused with its value and what is possible."""
    turn = turns["single_track"]
    with pytest.raises(ValueError, match=r"torque \[N m\] of 9 is out of reach at 90 km/h: .* reaches 4\.\d+"):
        steady(turn, torque=9.0)
    with pytest.raises(ValueError, match=r"handwheel_angle \[rad\] of 50 is out of reach"):
        steady(turn, handwheel_angle=50.0)
    with pytest.raises(ValueError, match="give one of them"):
        steady(turn, torque=1.0, handwheel_angle=0.1)
    with pytest.raises(ValueError, match="at least 0"):
        steady(turn, torque=-1.0)
    with pytest.raises(ValueError, match="hands must be one of on, off, arms"):
        with_hands(steady(turn), "crossed")
    with pytest.raises(ValueError, match="needs arms"):
        with_hands(steady(turn), "arms")


def test_a_point_by_its_handwheel_angle(turns):
    """A handwheel angle gives the point with that angle, which is the one of its torque."""
    by_angle = steady(turns["single_track"], handwheel_angle=0.2)
    assert by_angle.handwheel_angle == pytest.approx(0.2, abs=1e-9)
    by_torque = steady(turns["single_track"], torque=by_angle.torque)
    assert by_torque.handwheel_angle == pytest.approx(0.2, abs=1e-9)


def test_a_point_with_an_unstable_assist():
    """Where the assist loop oscillates, the point is still found: its states repeat themselves for a step."""
    car = CAR._replace(assist=CAR.assist._replace(boost=3.0 * CAR.assist.boost, delay=4))
    point = steady(cornering(car, SPEED), torque=2.0)
    state, row = point.state.copy(), np.zeros((1, len(plant.channels(point.plant))))
    plant.run(point.plant, state, np.tile(point.inputs, (2, 1)), row, 1)
    A, index = linearised.transition(point.plant, state=point.state, inputs=point.inputs)
    assert np.abs(np.linalg.eigvals(A)).max() > 1.01
    np.testing.assert_allclose(state[index], point.state[index], rtol=1e-8, atol=1e-8)
