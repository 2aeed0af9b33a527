"""What becomes of a wanted angle and of pedals."""

import math

import pytest

from steer_env.live.drive import hands
from steer_env.live.drive.hands import ARM, Arms, Pedals, in_order
from steer_env.vehicle.subsystems.car import TORQUE


def torques(wanted, seconds, arms=None):
    """Torques of arms every 2 ms while an angle is wanted."""
    arms = arms or Arms()
    return [arms.torque(wanted, 1_000_000_000 + 2_000_000 * k) for k in range(round(500 * seconds))]


def test_arms_settle_at_the_wanted_angle_and_mirror():
    left, right = (torques(side * 0.5, 1.0) for side in (1.0, -1.0))
    assert left[-1] == pytest.approx(ARM.stiffness * 0.5, rel=1e-3)
    assert left == [-torque for torque in right]


def test_no_wanted_angle_asks_for_more_than_the_loop_takes():
    found = torques(100.0, 2.0)
    assert max(found) < TORQUE[1]
    assert found[-1] == pytest.approx(ARM.stiffness * hands.LARGEST_WANTED, rel=1e-3)


def test_arms_do_not_move_by_a_clock_that_jumps():
    arms = Arms()
    arms.torque(0.5, 10**9)
    before = arms.torque(0.5, 10**9 + 2_000_000)
    back = arms.torque(0.5, 10**6)
    assert abs(back - before) < 0.5 * ARM.stiffness
    assert math.isfinite(arms.torque(0.5, 10**15))


def test_pedals_end_the_held_speed_and_a_command_holds_the_present_one():
    pedals = Pedals(20.0)
    assert pedals.inputs(0.0, 0.0) == {
        "target_speed": 0.0,
        "throttle_request": 0.0,
        "brake_request": 0.0,
        "coast": 0.0,
    }
    pedals.change(2, 20.0)
    assert pedals.inputs(0.0, 0.0)["target_speed"] == pytest.approx(10.0 / 3.6)
    assert pedals.inputs(0.0, 0.5)["coast"] == 1.0
    assert pedals.inputs(0.0, 0.0)["coast"] == 1.0  # still: the pedals drive
    pedals.change(1, 10.0 / 3.6)
    assert pedals.held == pytest.approx(15.0 / 3.6)
    assert pedals.inputs(0.0, 0.0)["coast"] == 0.0
    pedals.change(-10, 0.0)
    assert pedals.held == 0.0
    pedals.change(1000, 0.0)
    assert pedals.held == hands.FASTEST


def test_inputs_of_a_car_that_lacks_some_are_left_out():
    assert in_order(["hand_torque", "wind_force"], {"hand_torque": 2.0, "coast": 1.0}) == [2.0, 0.0]
