"""The filter of a coarse handwheel angle, and how the mailboxes use it."""

import math

import numpy as np
import pytest

from steer_env.live.real_time import Limits, Mailboxes
from steer_env.live.real_time.angle_filter import HORIZON, estimate, follow, make, response
from steer_env.live.real_time.loop import PERIOD, make_loop_memory, tick
from steer_env.live.real_time.model import make_model
from steer_env.vehicle import cars, subsystems

BIT = math.radians(900.0) / 2**16  # of a sensor with 16 bit over 900 deg [rad]


def readings(seconds, longest, angle, bit=BIT, seed=3):
    """Angles and speeds that the filter estimates at each millisecond (N, 2), from readings at uneven times.

    ``longest`` is the largest interval between readings [s], of which the shortest is a tenth.
    """
    draw, sensor = np.random.default_rng(seed), make()
    due, found = 0.0, []
    for k in range(round(1e3 * seconds)):
        while due <= 1e-3 * k:
            follow(sensor, bit * round(angle(due) / bit), round(1e9 * due) + 1)
            due += longest * draw.uniform(0.1, 1.0)
        found.append(estimate(sensor, k * PERIOD + 1))
    return np.array(found)


@pytest.mark.parametrize("longest", [0.001, 0.004, 0.010])
def test_a_constant_speed_has_no_lag(longest):
    found = readings(2.0, longest, lambda t: 3.0 * t)[500:]
    t = 1e-3 * np.arange(500, 2000)
    print(f"{np.abs(found[:, 0] - 3.0 * t).max() / BIT:.2f} steps, {np.abs(found[:, 1] - 3.0).max():.3f} rad/s")
    assert np.abs(found[:, 0] - 3.0 * t).max() < 2.0 * BIT
    assert np.abs(found[:, 1] - 3.0).max() < 0.1


@pytest.mark.parametrize("longest", [0.001, 0.004, 0.010])
def test_a_sine_at_uneven_times_is_followed(longest):
    """Of 2 Hz and 0.5 rad. The speed lags by 2/omega under an acceleration, and by the time since the last readings."""
    omega = 4.0 * math.pi
    found = readings(3.0, longest, lambda t: 0.5 * math.sin(omega * t))[500:]
    t = 1e-3 * np.arange(500, 3000)
    assert np.abs(found[:, 0] - 0.5 * np.sin(omega * t)).max() < 0.01
    lag = 2.0 / make().omega + 1.5 * longest
    assert np.abs(found[:, 1] - 0.5 * omega * np.cos(omega * t)).max() < 0.5 * omega**2 * lag


def test_the_answer_is_that_of_the_closed_form():
    """For frequent readings the filter is (2 w s + w^2) / (s + w)^2."""
    frequencies = np.array([1.0, 3.0, 10.0, 20.0])
    s, omega = 2j * math.pi * frequencies, 2.0 * math.pi * 20.0
    expected = (2.0 * omega * s + omega**2) / (s + omega) ** 2
    assert response(frequencies, 20.0, 0.0001) == pytest.approx(expected, rel=0.03)
    delays = -np.angle(response(frequencies)) / (2.0 * math.pi * frequencies)
    print(f"delays at {frequencies} Hz: {1e3 * delays} ms")
    assert delays.max() < 1e-3
    assert delays[0] < 2e-5


def test_times_that_do_not_go_on():
    sensor = make()
    follow(sensor, 1.0, 1_000)
    follow(sensor, 1.2, 2_001_000)
    before = estimate(sensor, 2_001_000)
    for stamp in (2_001_000, 1_000_000, 0):  # the same reading again, and older ones
        follow(sensor, 5.0, stamp)
        assert estimate(sensor, 2_001_000) == before
    late = estimate(sensor, 10**15)  # the line is not followed for ever
    assert abs(late[0] - before[0]) <= 1e-9 * HORIZON * abs(before[1]) * (1 + 1e-12)
    follow(sensor, -3.0, 10**15)  # begins anew behind a gap
    assert estimate(sensor, 10**15) == (-3.0, 0.0)


def test_a_filtered_wheel_shakes_less_than_its_steps():
    """A slow turn by a sensor with 16 bit: the handwheel torque of the robot, with and without the filter."""

    def hand_torque(**options):
        part = subsystems.make("car", cars.load("compact").plant("lugre", robot=True), 100.0 / 3.6)
        mail, model, loop = Mailboxes(part, **options), make_model(part), make_loop_memory(Limits())
        names, torque = [signal.name for signal in part.outputs], []
        for k in range(1500):
            now = (k + 10) * PERIOD
            if k % 2 == 0:  # at 500 Hz
                angle = BIT * round(0.2 * 1e-3 * k / BIT)
                mail.put([0.0, angle, 0.0, 0.0, 0.0, 0.0, 0.0], now)
            tick(model, loop, mail.device, now, 0)
            torque.append(model.outputs[0, names.index("torsion_bar_torque")])
        assert mail.get()[1] in ("starting", "on")
        return np.abs(np.diff(torque[500:], 2)).max()

    rough, smooth = hand_torque(), hand_torque(angle_bandwidth=50.0)
    print(f"largest bend of the torque: {rough:.4f} N m with the steps, {smooth:.4f} N m filtered")
    assert smooth < 0.5 * rough


def test_a_reading_that_is_no_number_or_jumps_still_ends_the_torque():
    for value in (math.nan, math.inf, 20.0):
        part = subsystems.make("car", cars.load("compact").plant("lugre", robot=True), 100.0 / 3.6)
        mail, model, loop = (
            Mailboxes(part, angle_bandwidth=50.0),
            make_model(part),
            make_loop_memory(Limits(soft_start=0.01)),
        )
        for k in range(200):
            now = (k + 10) * PERIOD
            mail.put([0.0, value if k == 150 else 0.1, 0.0, 0.0, 0.0, 0.0, 0.0], now)
            tick(model, loop, mail.device, now, 0)
            if k == 149:
                assert mail.get()[1] == "on"
        assert mail.get()[:2] == (0.0, "failed")


def test_bad_filters_are_named():
    with pytest.raises(ValueError, match=r"bandwidth of the angle filter \[Hz\] must be finite and at least 1"):
        make(0.5)
    with pytest.raises(ValueError, match=r"interval of the readings \[s\]"):
        response([1.0], 50.0, 0.1)
    chassis = subsystems.make("chassis", cars.load("compact").plant(speed=20.0, robot=True), 20.0)
    with pytest.raises(ValueError, match="needs a subsystem that takes it, got 'Chassis"):
        Mailboxes(chassis, angle_bandwidth=50.0)
