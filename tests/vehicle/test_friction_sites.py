"""Where friction sits, in the column with assist and in the whole car: closed forms, statics and published signs."""

import math

import gymnasium as gym
import numpy as np
import pytest

import steer_env  # noqa: F401  # registers the ids
from steer_env import friction, manoeuvres
from steer_env.friction import law, sites
from steer_env.friction.level import Level
from steer_env.vehicle import cars, plant
from steer_env.vehicle.cars import load
from steer_env.vehicle.steering import column

F, GAIN, ROAD = 0.4, 4.0, 30.0  # friction [N m], assist [N m/N m], road spring at the column [N m/rad]
TWO = {"gear": "masing", "upper_column": "coulomb"}


@pytest.mark.parametrize(("site", "share"), [("upper_column", 1.0), ("rack", 1.0 / (1.0 + GAIN + ROAD / 130.0))])
def test_assist_hides_friction_below_the_bar(site, share):
    """Width of the loop of hand torque over a slow handwheel angle: 2 F above the bar, 2 F/(1 + A + K_road/K_tb) below.

    Statics: T1 = T_tb + F_above, (1 + A) T_tb = K_road th2 + F_below, T_tb = K_tb (th1 - th2).
    """
    c, p = column.make(C2=0.0, C_tb=0.1), friction.resolve({site: {"law": "coulomb", "F_c": F}})
    scales = sites.scales(p, Level(), 1.0, 0.0, 0.0, 0.0)
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
        found = manoeuvres.drive(car, manoeuvres.make("parking"), given).channels
        w, rack, T_m = found["column_speed"], car.steering["pinion_radius"] * found["rack_force"], found["motor_torque"]
        steady = np.abs(w) > 0.3
        growth = np.where(w * T_m > 0.0, 1.0 - efficiency, 1.0 / efficiency - 1.0) * np.abs(T_m)
        of_car = 1.0 + car.steering["friction_load"] * np.abs(rack) / 0.9
        friction_torque = np.sign(w) * (0.9 * of_car + growth)
        left = found["torsion_bar_torque"] + T_m - rack - car.column.C2 * w - friction_torque
        assert np.quantile(np.abs(left[steady]), 0.9) < 0.01 * np.abs(T_m).max()


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
def test_environments_take_sites_single_and_vector(chassis):
    one = gym.make("steer_env/AssistWeave-v2", friction=TWO, chassis=chassis)
    many = gym.make_vec("steer_env/AssistWeave-v2", num_envs=2, friction=TWO, chassis=chassis)
    seen, _ = one.reset(seed=3)
    all_seen, _ = many.reset(seed=[3, 4])
    for k in range(30):
        np.testing.assert_array_equal(all_seen[0], seen)
        action = np.array([0.3 * math.sin(0.2 * k)], np.float32)
        seen, reward, *_ = one.step(action)
        all_seen, rewards, *_ = many.step(np.stack([action, action]))
        assert rewards[0] == reward


def test_sites_are_drawn():
    env = gym.make("steer_env/AssistWeave-v2", friction=TWO, randomise={"friction": {"upper_column.F_c": (0.1, 0.3)}})
    drawn = [env.reset(seed=seed)[1]["conditions"]["friction_upper_column.F_c"] for seed in range(3)]
    assert len(set(drawn)) == 3
    assert all(0.1 <= each <= 0.3 for each in drawn)
    with pytest.raises(ValueError, match="the site of friction must be"):
        gym.make("steer_env/AssistWeave-v2", friction=TWO, randomise={"friction": {"rack.F_c": (0.1, 0.3)}})


def test_a_law_alone_is_one_site_below_the_bar():
    car = cars.load("compact")
    ends = []
    for given in ("masing", {"rack": "masing"}):
        p = car.plant(given, robot=True, chassis="two_track")
        state, _ = plant.settled(p)
        u = np.zeros((2000, len(plant.INPUTS)))
        u[:, plant.HAND] = 0.5 * (1.0 - np.cos(np.arange(1, 2001) * 1e-3 * math.pi))
        u[:, plant.HAND_SPEED] = 0.5 * math.pi * np.sin(np.arange(1, 2001) * 1e-3 * math.pi)
        record = np.zeros((2000, len(plant.channels(p))))
        plant.run(p, state, u, record, 1)
        ends.append(record)
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-9, rtol=1e-9)


def test_memory_of_all_sites_is_in_the_state():
    p = cars.load("compact").plant({"upper_column": "lugre", "gear": "masing,elements=4"})
    assert law.law_of(p.friction).memory_size(p.friction) == 5
