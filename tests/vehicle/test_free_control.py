"""Free control: the modes against the motion that they describe, the verdicts after a pulse, and the limits."""

import math
from itertools import product

import numpy as np
import pytest

from steer_env import friction
from steer_env.vehicle import cars, plant
from steer_env.vehicle.analysis import free_control
from steer_env.vehicle.chassis.common.interface import INPUTS, RACK_DISTURBANCE
from tests.by_law import pairs

CAR = cars.load("compact")
NONE = friction.make("viscous", sigma_2=0.0)
UNDAMPED = CAR._replace(assist=CAR.assist._replace(damping=0.0 * CAR.assist.damping))  # swings on at speed, and spins
CHASSIS = ["single_track", "two_track"]


def after_a_touch(p):
    """Yaw rate over 4 s after a force of 1 N on the rack for 0.1 s, from 1.5 s on, and its time step."""
    inputs = np.zeros((4000, len(INPUTS)))
    inputs[:100, RACK_DISTURBANCE] = 1.0
    record = np.zeros((4000, len(plant.channels(p))))
    assert plant.run(p, plant.initial_state(p), inputs, record, 1)
    return record[1500::20, plant.CHANNEL["yaw_rate"]], 0.02


def swing(y, dt):
    """Eigenvalue [1/s] of one decaying or growing oscillation, by linear prediction from two samples (Prony)."""
    c = np.linalg.lstsq(np.column_stack([y[1:-1], y[:-2]]), y[2:], rcond=None)[0]
    return np.log(np.roots([1.0, *-c]).astype(complex))[0] / dt


@pytest.mark.parametrize(("factor", "v", "chassis"), pairs(product([0.5, 1.0, 1.5], [100.0 / 3.6, 50.0], CHASSIS)))
def test_modes_are_those_of_the_motion(factor, v, chassis):
    """The least damped mode is the one with which the free car swings after a touch, with any motor damping."""
    car = CAR._replace(assist=CAR.assist._replace(damping=factor * CAR.assist.damping))
    p = car.plant(NONE, v, chassis=chassis)
    motion = swing(*after_a_touch(p))
    ratio, frequency = free_control.least_damping_ratio(p)
    assert ratio == pytest.approx(-motion.real / abs(motion), abs=0.001)
    assert frequency == pytest.approx(abs(motion) / (2.0 * math.pi), rel=0.002)


@pytest.mark.parametrize("chassis", CHASSIS)
def test_only_modes_of_the_steering_count(chassis):
    """Position, heading, speed hold, heave and pitch are no modes of the steering: none is neutral or slow."""
    found = free_control.modes(CAR.plant("lugre", 40.0, robot=True, chassis=chassis))
    assert np.abs(found).min() > 5.0  # the speed hold has 0.3 and 2 1/s on two tracks, the rest is neutral
    np.testing.assert_array_equal(np.sort_complex(found), np.sort_complex(found.conj()))
    free = CAR.plant(NONE, 40.0, chassis=chassis)
    matrix, index = free_control.transition(free)
    names = [plant.state_names(free)[i][0] for i in index]
    assert {"x", "y", "yaw_angle", "distance", "steps_since_evaluation"}.isdisjoint(names)
    assert {"handwheel_angle", "column_speed", "roll_angle"} <= set(names)
    z = np.linalg.eigvals(matrix)
    rates = np.log(z[np.abs(z) > 0.5].astype(complex)) / plant.CHASSIS_STEP
    others = [rate for rate in rates if abs(rate) < 20.0 and np.abs(found - rate).min() > 1e-3]
    assert len(others) == {"single_track": 1, "two_track": 6}[chassis]  # of the drive; and heave and pitch in pairs


def test_least_damping_of_a_car_without_oscillation():
    """Where no mode lies below a frequency, the car counts as damped; a frequency out of range is refused."""
    assert free_control.least_damping_ratio(CAR.plant("lugre", 40.0), 0.1) == (1.0, 0.0)
    with pytest.raises(ValueError, match=r"highest must be .* at most 50, got 60"):
        free_control.least_damping_ratio(CAR.plant("lugre"), 60.0)


PULSES = [(20.0, "settles"), (35.0, "decays"), (60.0, "spins")]


@pytest.mark.parametrize("chassis", CHASSIS)
@pytest.mark.parametrize(("speed", "verdict"), PULSES)
def test_verdicts_are_those_of_half_the_step(chassis, speed, verdict):
    """The verdict is read from the record: by the peaks of the yaw rate, and at half the step too."""
    for substeps in (1, 2):
        found = free_control.pulse(UNDAMPED.plant("lugre", speed, chassis=chassis), substeps=substeps)
        assert found.verdict == verdict
        if verdict == "spins":
            assert found.spins
            assert found.sideslip > 0.5 or found.lost != "sideslip"
        else:
            yaw = np.degrees(found.record[:, plant.CHANNEL["yaw_rate"]])
            assert len(yaw) == 10_300
            expected = [0.5 * np.ptp(yaw[300 + 1000 * (t - 2) : 300 + 1000 * t]) for t in (6, 8, 10)]
            np.testing.assert_allclose(np.degrees(found.amplitudes), expected, rtol=1e-9, atol=1e-12)
            assert (max(expected) < 0.5) == (verdict == "settles")
            assert found.residual == pytest.approx(np.radians(yaw[-2000:].mean()))


def test_a_non_finite_motion_counts_as_a_spin():
    found = free_control.pulse(CAR.plant()._replace(pinion_radius=math.nan))
    assert (found.verdict, found.lost, len(found.record)) == ("spins", "non-finite", 0)
    assert math.isnan(found.residual)


def test_verdicts_of_made_up_motions():
    """Falling and small settles; falling decays; small but growing oscillates, unless it is at rest; lost spins."""

    def verdict(*amplitudes, lost=""):
        return free_control.Pulse(np.zeros((1, 1)), lost, 0.0, np.radians(amplitudes)).verdict

    assert verdict(0.4, 0.3, 0.2) == "settles"
    assert verdict(0.4, 0.01, 0.011) == "settles"  # stuck
    assert verdict(0.6, 0.3, 0.2) == "decays"
    assert verdict(0.2, 0.3, 0.4) == "oscillates"
    assert verdict(0.3, 0.3, 0.3) == "oscillates"
    assert verdict(math.inf, lost="sideslip") == "spins"


@pytest.mark.parametrize("chassis", CHASSIS)
def test_the_limit_without_friction_is_where_the_mode_loses_its_damping(chassis):
    """A small pulse without friction decays up to the speed at which the damping ratio crosses zero."""
    speed = free_control.limit(UNDAMPED, NONE, chassis, torque=0.05, tolerance=0.2)
    below, above = (
        free_control.least_damping_ratio(UNDAMPED.plant(NONE, v, chassis=chassis)) for v in (speed, speed + 0.8)
    )
    assert below[0] > 0.0 > above[0]


def test_limit_at_its_ends_and_refusals():
    """A car that never fails has the highest speed, and one with a motor that pushes the swing on has none."""
    assert free_control.limit(CAR, highest=12.0) == 12.0
    pushed = CAR._replace(assist=CAR.assist._replace(damping=CAR.assist.damping - 30.0))
    assert free_control.limit(pushed, NONE) == 0.0
    with pytest.raises(ValueError, match=r"highest \[m/s\] must be .* at most 70"):
        free_control.limit(CAR, highest=80.0)
    with pytest.raises(ValueError, match="the hand torque"):
        free_control.pulse(CAR.plant(robot=True))
    with pytest.raises(ValueError, match=r"time must be .*at least 8"):
        free_control.pulse(CAR.plant(), time=5.0)
