"""Understeer by cause and frequency response of the linear car, against the simulation of both chassis."""

import math

import control
import numpy as np
import pytest

from steer_env import friction
from steer_env.vehicle import cars, plant, tyre
from steer_env.vehicle.analysis import linear, understeer
from steer_env.vehicle.constants import GRAVITY as G

V = 100.0 / 3.6
FREQUENCIES = 0.2, 0.5, 1.0  # [Hz]
REAR = {"front_cornering_stiffness_factor": 1.2, "rear_cornering_stiffness_factor": 1.5}
REAR |= {"rear_bump_steer": -0.1, "rear_camber_gain": 0.4, "rear_lateral_compliance": 5e-7}
STEERED = cars.load()
STEERED = STEERED._replace(chassis={**STEERED.chassis, **REAR})  # with every effect at the rear axle
# The tuned compact has the chassis of the compact, and an assist that is compiled by itself.
CARS = {name: cars.load(name) for name in cars.available() if name != "compact_tuned"}
CARS["rear axle that steers"] = STEERED
EACH = pytest.mark.parametrize("name", CARS)


def wheelbase(car):
    return car.chassis["front_axle"] + car.chassis["rear_axle"]


@EACH
@pytest.mark.parametrize("v", [10.0, V, 50.0])
def test_sum_is_the_gradient_of_the_linear_single_track(name, v):
    expected = linear.from_car(CARS[name], v).understeer_gradient()
    assert sum(understeer.budget(CARS[name], v).values()) == pytest.approx(expected, rel=1e-9)
    D_f, D_r = understeer.cornering_compliances(CARS[name], v)
    assert D_f - D_r == pytest.approx(expected, rel=1e-9)


def settled(car, chassis, v, angle):
    """Gains of yaw rate and lateral acceleration over the road-wheel angle of the pinion at the end of a small ramp."""
    p = car.plant(friction.make("viscous", sigma_2=0.0), v, robot=True, chassis=chassis)
    u, t = np.zeros((15_000, len(plant.INPUTS))), np.minimum(np.arange(1, 15_001) * 1e-3, 1.0)
    u[:, plant.HAND] = angle * (t - np.sin(2.0 * math.pi * t) / (2.0 * math.pi))
    u[:, plant.HAND_SPEED] = angle * (1.0 - np.cos(2.0 * math.pi * t))
    row = np.zeros((1, len(plant.channels(p))))
    assert plant.run(p, plant.initial_state(p), u, row, 1)
    row = dict(zip((name for name, _ in plant.channels(p)), row[0]))
    delta = car.steering_gain() * row["column_angle"]
    return np.array([row[name] for name in ("yaw_rate", "lateral_acceleration", "lateral_speed")]) / delta


@EACH
@pytest.mark.parametrize(("chassis", "within"), [("single_track", 1e-3), ("two_track", 0.02)])
def test_compliances_are_those_of_a_simulation(name, chassis, within):
    """At the road wheels, in a steady turn at 0.03 m/s2; the mark of the gradient is 5 %."""
    car = CARS[name]
    r, A, v_y = settled(car, chassis, V, 3e-3)
    front = (1.0 - (v_y + car.chassis["front_axle"] * r) / V) / A
    rear = -(v_y - car.chassis["rear_axle"] * r) / V / A
    assert understeer.cornering_compliances(car, V, chassis) == pytest.approx((front, rear), rel=within)
    gradient = sum(understeer.budget(car, V, chassis).values())
    assert gradient == pytest.approx((1.0 - wheelbase(car) * r / V) / A, rel=within)


def test_terms_by_hand():
    """Each cause has the value of its own formula, of the steady turn at 1 m/s2."""
    car, c, L = STEERED, STEERED.chassis, wheelbase(STEERED)
    a, b, m = c["front_axle"], c["rear_axle"], c["mass"]
    terms = understeer.cornering_terms(car, V)

    def stiffness(load, factor):
        C = car.tyre.symmetric().coefficients
        return -2.0 * factor * (tyre.forces(C, 0.0, 1e-6, 0.0, load, V)[1]) / 1e-6

    C_f = stiffness(0.5 * m * G * b / L, c["front_cornering_stiffness_factor"])
    C_r = stiffness(0.5 * m * G * a / L, c["rear_cornering_stiffness_factor"])
    assert terms["load and tyres"] == pytest.approx((m * b / (L * C_f), m * a / (L * C_r)), rel=1e-3)
    # Bump steer of -0.1 rad/m steers the rear wheels left in a left turn, into the turn, by t/2 a rolling.
    roll = float(understeer.response(car, V).dcgain()[3, 0] / understeer.response(car, V).dcgain()[2, 0])
    assert terms["rear roll steer"] == pytest.approx((0.0, -0.1 * 0.5 * c["rear_track"] * roll), rel=1e-6)
    # The rear axle carries a/L of the mass, less what the aligning torque and the camber thrust take: a few percent.
    assert terms["rear lateral compliance"][1] == pytest.approx(-5e-7 * 0.5 * m * a / L, rel=0.05)
    stiff = car._replace(steering={**car.steering, "compliance": 1e9})
    assert understeer.budget(stiff, V)["steering compliance"] == pytest.approx(0.0, abs=1e-7)
    twice = car._replace(steering={**car.steering, "compliance": 2.0 * car.steering["compliance"]})
    half = understeer.budget(twice, V)["steering compliance"] / understeer.budget(car, V)["steering compliance"]
    assert half == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("v", [10.0, V, 50.0])
def test_bundorf_is_the_lag_of_a_bicycle(v):
    """With the yaw inertia m a b, the slope of the phase of the yaw rate at low frequency, by python-control."""
    car, L = STEERED, wheelbase(STEERED)
    D_f, D_r = understeer.cornering_compliances(car, v)
    model = linear.from_car(car, v)
    a, b, m = model.front_axle, model.rear_axle, model.mass
    bicycle = model._replace(
        **dict.fromkeys(model._fields[7:-1], 0.0),
        yaw_inertia=m * a * b,
        front_stiffness=m * b / (L * D_f),
        rear_stiffness=m * a / (L * D_r),
    )
    omega = 1e-4
    yaw = control.frequency_response(bicycle.state_space(), [omega]).frdata[1, 0, 0]
    assert understeer.bundorf_lag(car, v) == pytest.approx(-np.angle(yaw) / omega, rel=1e-5)


def sines(car, chassis, law, amplitude, v=V):
    """Response (F, outputs) at ``FREQUENCIES`` of the simulation to three sines of the handwheel at once, from 20 s."""
    p = car.plant(law, v, robot=True, chassis=chassis)
    t = np.arange(1, 30_001) * 1e-3
    u, record = np.zeros((t.size, len(plant.INPUTS))), np.zeros((t.size, len(plant.channels(p))))
    for f in FREQUENCIES:
        omega = 2.0 * math.pi * f
        u[:, plant.HAND] += amplitude * np.sin(omega * t)
        u[:, plant.HAND_SPEED] += amplitude * omega * np.cos(omega * t)
    assert plant.run(p, plant.initial_state(p), u, record, 1)
    last = record[20_000:][:, [plant.CHANNEL[name] for name in understeer.OUTPUTS]]
    waves = np.exp(-2j * math.pi * np.outer(FREQUENCIES, t[20_000:]))
    return 2j / (amplitude * len(last)) * waves @ last


@EACH
@pytest.mark.parametrize(("chassis", "gain", "phase"), [("single_track", 0.01, 1.0), ("two_track", 0.03, 1.0)])
def test_response_is_that_of_a_simulation(name, chassis, gain, phase):
    """Gain, and phase in degrees, at 0.003 m/s2 without friction; the mark of the yaw lag at 0.2 Hz is 5 ms."""
    car = CARS[name]
    found = sines(car, chassis, friction.make("viscous", sigma_2=0.0), 2e-4)
    model = understeer.response(car, V, chassis)
    expected = np.array([model(2j * math.pi * f)[:, 0] for f in FREQUENCIES])
    np.testing.assert_allclose(np.abs(found / expected), 1.0, atol=gain)
    np.testing.assert_allclose(np.degrees(np.angle(found / expected)), 0.0, atol=phase)
    lag = -np.angle(found[0, 1]) / (2.0 * math.pi * 0.2)
    assert understeer.yaw_lag(car, V, chassis=chassis) == pytest.approx(lag, abs=2e-3)


def test_two_frequencies_are_not_the_ends_of_a_range():
    """Asked of the model, as docs/analysis.md says; a function of python-control takes a pair for a range."""
    model, asked = understeer.response(CARS["compact"], V), [1.0, 10.0]
    found = model.frequency_response(asked)
    np.testing.assert_array_equal(found.omega, asked)
    np.testing.assert_allclose(found.complex[..., 1], model(10j))
    assert len(control.frequency_response(model, asked).omega) > 2


def test_more_boost_twists_the_torsion_bar_less():
    on_centre, beside = (float(understeer.response(CARS["compact"], V, torque=T).dcgain()[1, 0]) for T in (0.0, 5.5))
    without = linear.from_car(CARS["compact"], V).state_space("handwheel").dcgain()[1, 0]
    assert on_centre < beside < without


def test_refused():
    car = CARS["compact"]
    for function in (understeer.budget, understeer.response):
        with pytest.raises(ValueError, match="single_track, two_track, got 'rail'"):
            function(car, V, "rail")
        with pytest.raises(ValueError, match="speed"):
            function(car, 0.0)
    with pytest.raises(ValueError, match="frequency"):
        understeer.yaw_lag(car, V, frequency=0.0)
