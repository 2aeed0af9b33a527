"""Where friction sits, in the column with assist and in the whole car: closed forms, statics and published signs."""

import math

import gymnasium as gym
import numpy as np
import pytest

from steer_env import friction, manoeuvres
from steer_env.friction import sites
from steer_env.friction.level import Level
from steer_env.registration import id_of
from steer_env.vehicle import plant
from steer_env.vehicle.cars import load
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST
from steer_env.vehicle.steering import column

F, GAIN, ROAD = 0.4, 4.0, 30.0  # friction [N m], assist [N m/N m], road spring at the column [N m/rad]


@pytest.mark.parametrize(("site", "share"), [("upper_column", 1.0), ("rack", 1.0 / (1.0 + GAIN + ROAD / 130.0))])
def test_assist_hides_friction_below_the_bar(site, share):
    """Width of the loop of hand torque over a slow handwheel angle: 2 F above the bar, 2 F/(1 + A + K_road/K_tb) below.

    Statics: T1 = T_tb + F_above, (1 + A) T_tb = K_road th2 + F_below, T_tb = K_tb (th1 - th2).
    """
    c, p = column.make(C2=0.0, C_tb=0.1), sites.bound(friction.resolve({site: {"law": "coulomb", "F_c": F}}))
    scales = np.zeros(column.SCALES)
    sites.scales(p, Level(), 1.0, 0.0, 0.0, 0.0, scales)
    q, memory, h, omega = np.zeros(4), np.zeros(0), 1e-3, 2.0 * math.pi * 0.025
    t = h * np.arange(1, 40_001)  # a cycle: the angle falls through zero at 20 s, and rises through it at 40 s
    torque = np.empty(t.size)
    for i, (angle, speed) in enumerate(zip(0.1 * np.sin(omega * t), 0.1 * omega * np.cos(omega * t))):
        T_C = GAIN * (c.K_tb * (q[0] - q[2]) + 0.6 * (q[1] - q[3])) - ROAD * q[2]
        torque[i] = column.step(c, p, scales, q, memory, True, angle, speed, T_C, h)[3]
    assert torque[39_999] - torque[19_999] == pytest.approx(2.0 * F * share, rel=0.01)


def test_a_worm_gear_in_parking_is_statics():
    """Torques on the column while a standing car is steered slowly: bar, motor, rack and both frictions balance."""
    car = load("compact")
    for efficiency in (0.85, 0.9):
        given = {"gear": {"law": "masing", "efficiency": efficiency}}
        recording = manoeuvres.drive(car, manoeuvres.make("parking"), given)
        assert recording.meta["friction"] == "masing@gear"
        found = recording.channels
        w, rack, T_m = found["column_speed"], car.steering["pinion_radius"] * found["rack_force"], found["motor_torque"]
        steady = np.abs(w) > 0.3
        growth = np.where(w * T_m > 0.0, 1.0 - efficiency, 1.0 / efficiency - 1.0) * np.abs(T_m)
        of_car = 1.0 + car.steering["friction_load"] * np.abs(rack) / 0.9
        friction_torque = np.sign(w) * (0.9 * of_car + growth)
        left = found["torsion_bar_torque"] + T_m - rack - car.column.C2 * w - friction_torque
        assert np.quantile(np.abs(left[steady]), 0.9) < 0.01 * np.abs(T_m).max()


@pytest.mark.parametrize(("side", "factor"), [(1.0, 0.88), (-1.0, 1.0 / 0.88)])
def test_the_gain_of_the_motor_follows_the_efficiency_of_a_sliding_gear(side, factor):
    """A small change of the motor's torque, of 8 Hz, in a turn of the handwheel: less drives, more is driven back.

    The assist itself is off, and the motor has a torque of 3 N m to the left.
    """
    car = load("compact", changes={"steering.friction_load": 0.0})
    car = car._replace(assist=car.assist._replace(boost=0.0 * car.assist.boost, damping=0.0 * car.assist.damping))
    t = 1e-3 * np.arange(1, 3001)
    wave = np.exp(2j * math.pi * 8.0 * t)

    def response(friction_of_gear):
        ends = []
        for size in (0.02, -0.02):
            p = car.plant(friction_of_gear, 60.0 / 3.6, robot=True)
            state, u = plant.settled(p)[0], np.zeros((t.size, len(plant.INPUTS)))
            record = np.zeros((t.size, len(plant.channels(p))))
            u[:, plant.HAND], u[:, plant.HAND_SPEED] = 0.5 * side * t, 0.5 * side
            u[:, ASSIST_REQUEST] = 3.0 + size * wave.imag
            plant.run(p, state, u, record, 1)
            ends.append(record[:, plant.CHANNEL["torsion_bar_torque"]])
        return np.mean(((ends[0] - ends[1]) / wave)[-1000:])

    found = response("masing,F_c=0.5,efficiency=0.88@gear") / response("masing,F_c=0.5@gear")
    assert abs(found / factor - 1.0) < 0.01


def test_a_site_that_only_draws_have_friction_at_takes_part():
    """A damper of zero where nothing is drawn, and one of another value, both drawn to 5 N m s/rad."""
    shown = []
    for usual in (0.0, 1.0):
        env = gym.make(
            id_of("AssistWeave"),
            friction={"rack": "lugre", "gear": {"law": "viscous", "sigma_2": usual}},
            randomise={"friction": {"gear.sigma_2": (5.0, 5.0 + 1e-9)}},
        )
        env.reset(seed=2)
        shown.append(np.array([env.step(np.zeros(1, np.float32))[0] for _ in range(30)]))
    np.testing.assert_array_equal(*shown)
