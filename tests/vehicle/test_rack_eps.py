"""Rack EPS: the column that follows from the rack, against python-control's assembly at the rack, and statics."""

import math

import control
import gymnasium as gym
import numpy as np
import pytest

from steer_env import friction, manoeuvres
from steer_env.vehicle import cars, plant
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, INPUTS
from steer_env.vehicle.plant import CHANNEL
from steer_env.vehicle.steering import linear, margins
from steer_env.vehicle.steering.eps import SAMPLE_TIME, boost_curve

CAR = cars.load("compact_rack_eps")
OWN, R = CAR.given["rack_eps"], CAR.steering["pinion_radius"]
N = 2.0 * math.pi * OWN["belt_ratio"] / OWN["screw_lead"]  # motor angle over rack travel [rad/m]
SPEED = 20.0
TWO = {"speeds": [0.0, 10.0], "torques": [0.0, 5.0], "damping": [1.0, 1.0]}  # an assist without its boost


def at_the_rack(car, speed):
    """Handwheel held: from motor torque [N m] and force on the rack [N] to bar torque [N m] and rack speed [m/s].

    Sampled at 1 ms, with the motor's damping closed and its command changing half a sample late, in the units of the
    rack: masses in kg, damping in N s/m, motor torque at the motor.
    """
    c, a = car.column, car.assist
    mass = OWN["rack_mass"] + OWN["wheels_mass"] + N**2 * OWN["motor_inertia"] + OWN["pinion_inertia"] / R**2
    damping = OWN["rack_damping"] + c.C_tb / R**2
    A = [[0.0, -1.0 / R, 0.0], [c.K_tb / R / mass, -damping / mass, N / mass], [0.0, 0.0, -a.bandwidth]]
    B = [[0.0, 0.0], [0.0, 1.0 / mass], [a.bandwidth, 0.0]]
    C = [[c.K_tb, 0.0, 0.0], [0.0, 1.0, 0.0]]
    half = control.c2d(control.ss(A, B, C, 0.0), 0.5 * SAMPLE_TIME, "zoh")
    assert (a.delay, a.offset) == (0, 0.5 * SAMPLE_TIME)
    # The state holds the last command, which acts for the first half of the sample.
    command, force = half.B[:, :1], half.A @ half.B[:, 1:] + half.B[:, 1:]
    phi = np.block([[half.A @ half.A, half.A @ command], [np.zeros((1, 4))]])
    gamma = np.block([[command, force], [np.ones((1, 1)), np.zeros((1, 1))]])
    open_loop = control.ss(phi, gamma, np.hstack([half.C, np.zeros((2, 1))]), 0.0, SAMPLE_TIME)
    brake = boost_curve(a, 0.0, speed)[1] / (R * N) / R  # of the motor torque over the rack speed [N s]
    return control.feedback(open_loop, np.array([[0.0, brake], [0.0, 0.0]]))


def test_transfer_functions_are_those_of_the_rack():
    """Bar torque and column speed by request and rack force, and the loop, within 1e-6 up to 490 Hz."""
    z = np.exp(2j * math.pi * margins.FREQUENCIES * SAMPLE_TIME)
    ours = linear.plant(CAR.column, CAR.assist, SPEED).state_space()(z)[:, [0, 2]]
    rack = at_the_rack(CAR, SPEED)(z)
    rack[:, 0] /= R * N  # a torque of 1 N m at the column is that of the motor through belt, screw and pinion
    rack[:, 1] /= R
    rack[1] /= R  # speed of the column
    np.testing.assert_allclose(ours, rack, rtol=1e-6)


@pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")
def test_a_small_sweep_of_the_plant_is_that_of_the_rack():
    """The motor shakes the rack of the whole car, whose wheels hang on a soft steering; amplitudes within 1 %."""
    car = cars.load("compact_rack_eps", {"steering.compliance": 100.0, "assist.boost_scale": 0.0})
    p = car.plant(friction.make("viscous", sigma_2=0.0), SPEED, robot=True)
    t = SAMPLE_TIME * np.arange(2000)
    for frequency in (5.0, 10.0, 20.0, 40.0):
        u, record = np.zeros((t.size, len(INPUTS))), np.zeros((t.size, len(plant.channels(p))))
        wave = np.exp(2j * math.pi * frequency * t)
        u[:, ASSIST_REQUEST] = 0.5 * wave.imag
        assert plant.run(p, plant.initial_state(p), u, record, 1)
        z = np.exp(2j * math.pi * frequency * SAMPLE_TIME)
        expected = np.abs(at_the_rack(car, SPEED)(z)[:, 0]) * 0.5 / (R * N) / [1.0, R]
        for name, size in zip(("torsion_bar_torque", "column_speed"), expected):
            found = 2.0 * abs(np.mean((record[:, CHANNEL[name]] * wave.conj())[-1000:]))
            assert found == pytest.approx(size, rel=0.01)


def test_parking_is_statics_at_the_rack():
    """Hand and motor torque from the rack force while a standing car is steered slowly, within 1 % of their largest."""
    found = manoeuvres.drive(CAR, manoeuvres.make("parking"), "lugre").channels
    rack, w, T = found["rack_force"], found["column_speed"], found["torsion_bar_torque"]
    motor = found["motor_torque"] / (R * N)
    steady = np.abs(w) > 0.3
    resisting = rack + found["friction_torque"] / R + OWN["rack_damping"] * R * w  # [N]
    table, brake = CAR.assist.torques, boost_curve(CAR.assist, 0.0, 0.0)[1]
    both = table + np.interp(table, CAR.assist.torques, CAR.assist.boost[0])
    hand = np.sign(resisting) * np.interp(np.abs(R * resisting + brake * w), both, table)
    for value, expected in ((motor, (resisting - T / R) / N), (T, hand)):
        assert np.quantile(np.abs(value - expected)[steady], 0.9) < 0.01 * np.abs(value).max()


def test_boost_at_the_rack_is_that_at_the_column():
    force = [[0.0, 3000.0], [0.0, 1000.0]]
    car = cars.load({"base": "compact", "rack_eps": {"boost": force}, "assist": TWO})
    np.testing.assert_array_equal(car.assist.boost, R * np.array(force))
    assert "boost" not in car.data()["rack_eps"]  # that of the assist says the same, and its tools change it
    again = cars.load(car.data())
    assert (again.column, again.data()) == (car.column, car.data())
    changed = cars.load(car.data(), {"rack_eps.boost": [[0.0, 2000.0], [0.0, 500.0]]})
    np.testing.assert_array_equal(changed.assist.boost, R * np.array([[0.0, 2000.0], [0.0, 500.0]]))


def test_steering_chooses_a_packaged_car():
    assert cars.load("compact", steering="rack_eps") is CAR
    assert cars.load("compact_rack_eps", steering="rack_eps") is CAR
    assert cars.load(steering="column_eps") is cars.load("compact")
    assert [cars.load(name).kind for name in ("compact", "compact_rack_eps")] == ["column_eps", "rack_eps"]
    changed = cars.load("compact", {"rack_eps.screw_lead": 0.005}, "rack_eps")
    assert changed.assist.limit == pytest.approx(1.4 * CAR.assist.limit, rel=1e-12)


def test_a_base_gives_way_to_the_kind_of_the_file():
    """What the base says of the motor at the column is not that of the rack EPS of a file."""
    car = cars.load({"base": "bmw_320i", "rack_eps": {"motor_torque": 6.0}})
    assert car.assist.limit == pytest.approx(6.0 * N * car.steering["pinion_radius"], rel=1e-12)
    assert cars.load({"base": "compact_rack_eps", "column": {"K_tb": 143.0}}).column.I2 == CAR.column.I2


FOLLOWS = (
    "of a car with rack_eps follows from its section rack_eps and the pinion radius: leave it out, or give 0.0485989"
)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"base": "compact", "rack_eps": {}, "column": {"I2": 0.06}}, rf"column.I2 {FOLLOWS}\d*, got 0.06$"),
        ({"base": "compact", "rack_eps": {"lead": 0.007}}, "rack_eps has no key 'lead'; it takes: screw_lead, "),
        (
            {"base": "compact", "rack_eps": {"boost": [[0.0, 1.0]]}, "assist": {"boost": [[0.0, 1.0]]}},
            "rack_eps.boost and assist.boost are both given",
        ),
        (
            {"base": "compact", "rack_eps": {"boost": [[0.0, -3000.0], [0.0, 1.0]]}, "assist": TWO},
            r"rack_eps.boost must have rows of numbers \[N\], not negative, .*, got \[\[0.0, -3000.0\]",
        ),
        ({"base": "compact", "rack_eps": {}, "assist": 5}, "assist must hold keys and values, got 5"),
    ],
)
def test_bad_car_files_are_refused(data, message):
    with pytest.raises(ValueError, match=message):
        cars.load(data)


@pytest.mark.parametrize(
    ("name", "steering", "message"),
    [
        ("compact", "belt", "steering must be one of column_eps, rack_eps, steer_by_wire, got 'belt'"),
        (
            "ford_escort",
            "rack_eps",
            r"ford_escort has column_eps, .* give a car that has it \(compact_rack_eps\), or a ",
        ),
        ("compact_rack_eps", "column_eps", "compact_rack_eps has rack_eps, and no packaged car is its counterpart"),
    ],
)
def test_a_steering_that_no_car_has_is_refused(name, steering, message):
    with pytest.raises(ValueError, match=message):
        cars.load(name, steering=steering)


def test_a_column_that_was_replaced_is_no_rack_eps():
    with pytest.raises(ValueError, match=r"column.I2 follows from the section rack_eps of the car"):
        CAR._replace(column=CAR.column._replace(I2=0.06)).data()


def test_friction_of_its_sites():
    p = friction.resolve("lugre@rack_eps")
    assert [site.law.F_c for site in (p.upper_column, p.gear, p.rack)] == pytest.approx([0.09, 0.18, 0.63])
    assert p.gear.driving * 0.18 == pytest.approx(0.1)  # 1 - 0.90 of the motor's torque
    with pytest.raises(ValueError, match="friction at column_eps is that of all its sites: leave it or rack_eps out"):
        friction.resolve({"rack_eps": "lugre", "column_eps": "lugre"})


def test_an_environment_takes_the_steering():
    assert gym.make("steer_env/DriverOnCentre-v3", steering="rack_eps").unwrapped.batch.car is CAR
