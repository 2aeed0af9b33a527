"""The limits of the motor: curve, supply, temperature, and the handwheel speed at which they are met."""

import numpy as np
import pytest
from scipy.optimize import brentq

from steer_env import manoeuvres, metrics
from steer_env.connect.variables import variables
from steer_env.experiments.calibration import constraints
from steer_env.vehicle import cars, plant, subsystems
from steer_env.vehicle.chassis.common.interface import HAND, HAND_SPEED, INPUTS
from steer_env.vehicle.steering import eps, motor

CURVE = {"motor_speeds": [0.0, 115.0, 150.0, 200.0, 260.0, 400.0], "motor_torques": [3.5, 3.5, 2.0, 1.5, 1.0, 0.0]}
OF_A_FILE = {f"assist.{key}": value for key, value in CURVE.items()}
DT = eps.SAMPLE_TIME


@pytest.fixture(scope="module")
def limited():
    return cars.load("compact", changes=OF_A_FILE)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_curve_supply_and_voltage_limit_the_command(sign):
    m = motor.make(**CURVE, motor_voltage=0.5, motor_power=100.0)
    middle = 0.5 * 175.0 / 20.5
    for speed, most in ((0.0, 71.75), (middle, 100.0 / middle), (15.0, 0.0)):
        assert motor.limited(m, np.zeros(1), 100.0 * sign, speed * sign) == pytest.approx(most * sign)
    braking = motor.limited(m, np.zeros(1), -100.0 * sign, middle * sign)
    assert braking == pytest.approx(-1.75 * 20.5 * sign)  # the supply takes up what the motor brakes
    assert motor.limited(m, np.zeros(1), 3.0 * sign, sign) == 3.0 * sign


def test_heat_derates_to_the_continuous_torque():
    m, heat, torque = motor.make(**CURVE, motor_continuous=2.0, motor_thermal_time=10.0), np.zeros(1), []
    for _ in range(100_000):
        torque.append(motor.limited(m, heat, 71.75, 0.0))
        motor.warm(m, heat, torque[-1], DT)
    begun = 10.0 * np.log(1.0 / (1.0 - motor.DERATED_FROM * (2.0 / 3.5) ** 2))  # (E23) under the standstill torque
    assert np.argmax(np.array(torque) < 71.75) * DT == pytest.approx(begun, abs=0.01)
    assert torque[-1] == pytest.approx(2.0 * 20.5, rel=1e-3)
    assert heat[0] == pytest.approx(1.0, abs=1e-3)


def turned(car, rate):
    """Channels of a standing car while a robot turns its handwheel from 30 to 270 deg at a rate [rad/s]."""
    p = car.plant("coulomb", 0.0, robot=True, chassis="two_track")
    angle = rate * DT * np.arange(1, round(1.5 * np.pi / rate / DT))
    u = np.zeros((angle.size, len(INPUTS)))
    u[:, HAND], u[:, HAND_SPEED] = angle, rate
    record = np.zeros((angle.size, len(plant.channels(p))))
    assert plant.run(p, plant.initial_state(p), u, record, 1)
    return {name: record[angle > np.pi / 6.0, i] for name, i in plant.CHANNEL.items()}


def test_limit_is_met_where_statics_and_the_curve_say(limited):
    """Bar and motor hold rack, friction and damping while the boost gives both torques, until the curve is met."""
    a, c, unlimited = limited.assist, limited.column, cars.load("compact")
    rack = unlimited.steering["pinion_radius"] * turned(unlimited, 11.2)["rack_force"][-1]
    friction = unlimited.plant("coulomb").friction.F_c + unlimited.steering["friction_load"] * rack
    bar = np.linspace(0.0, 7.0, 701)
    boost, damping = np.array([eps.boost_curve(a, T, 0.0)[0] for T in bar]), eps.boost_curve(a, 0.0, 0.0)[1]

    def spare(rate):
        T = np.interp(rack + friction + (c.C2 + damping) * rate, bar + boost, bar)
        return eps.available(a, rate) - (np.interp(T, bar, boost) - damping * rate)

    met = brentq(spare, 8.0, 14.0)
    assert met == pytest.approx(11.2, rel=0.01)  # for which the rack force holds
    for rate, meets in ((0.98 * met, False), (1.02 * met, True)):
        torque = np.abs(turned(limited, rate)["motor_torque"])
        assert bool(np.any(torque > 0.995 * eps.available(a, rate))) is meets


@pytest.mark.parametrize("changes", [{}, OF_A_FILE])
def test_metrics_tell_where_the_motor_ends(changes):
    car = cars.load("compact", changes=changes)
    drive = manoeuvres.make("catch-up", rates=(3.0, 9.0, 12.0), amplitude=4.6)
    recording = manoeuvres.drive(car, drive, "coulomb")
    found = metrics.evaluate(recording, intervals=False)
    if changes:
        assert found["motor_limit_rate"].value == pytest.approx(np.degrees(12.0), rel=0.02)
    else:
        assert found["share_at_motor_limit"].value == 0.0


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({**CURVE, "motor_torques": [3.5, 3.5, 2.0, 2.1, 1.0, 0.0]}, "motor_torques must be 6 torques .* none above"),
        ({**CURVE, "motor_torques": [3.5, 3.5]}, "motor_torques must be 6 torques"),
        ({**CURVE, "motor_speeds": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]}, "motor_speeds must ascend from 0"),
        ({**CURVE, "motor_continuous": 4.0}, "motor_continuous must be at most the first of motor_torques, 3.5"),
        ({"motor_power": 300.0}, "motor_power needs the curve"),
    ],
)
def test_bad_limits_are_refused(keys, message):
    with pytest.raises(ValueError, match=message):
        eps.make(**keys)


def test_a_motor_that_gives_too_little_is_told():
    """Where it stands, by a warning; at 360 deg/s as a constraint, which is finite also where the curve has ended."""
    car = cars.load("compact")
    weak = {**CURVE, "motor_torques": [2.0, 2.0, 1.0, 0.5, 0.1, 0.0]}
    with pytest.warns(cars.UnusualCar, match=r"greatest boost over the limit of the motor is 1\.289"):
        cars.load({"base": "compact", "assist": weak})
    ended = eps.make(motor_speeds=[0.0, 100.0], motor_torques=[3.5, 0.0])
    assert constraints.motor_share(car.assist) == car.assist.boost.max() / car.assist.limit
    assert 100.0 < constraints.motor_share(ended) < np.inf


def test_the_curve_is_of_parameters_of_an_exported_unit(limited):
    listed = variables(subsystems.make("steering", limited.plant("coulomb", 20.0), 20.0), 3)
    curve = {v.name: v for v in listed if v.name.startswith("assist.motor.torques[")}
    assert [v.start for v in curve.values()] == CURVE["motor_torques"]
    found = curve["assist.motor.torques[3]"]
    assert (found.unit, found.use, found.low) == ("N m", "TUNABLE", 0.0)
    assert found.description.endswith("; at 150 rad/s")


def test_keys_give_the_limits_again():
    a = eps.make(**CURVE, motor_voltage=0.9, motor_power=300.0, motor_continuous=2.0, motor_thermal_time=90.0)
    for one, other in zip(eps.make(**eps.keys(a)).motor, a.motor):
        assert one == pytest.approx(other, rel=1e-11)
