"""Lane-change courses by hand, the path, the preview driver, and the loop that it closes with the car."""

from dataclasses import replace

import control
import gymnasium as gym
import numpy as np
import pytest
from scipy.optimize import linprog

from steer_env import manoeuvres, metrics
from steer_env.courses import iso3888
from steer_env.drivers.common import lq
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.tasks.common import cones
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import linear
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.plant import CHANNEL
from tests.by_law import EACH_LAW

CAR = cars.load()
KPH = 1.0 / 3.6


def test_double_lane_change_by_hand():
    """A car of 1.8 m: lanes of 2.23, 2.41 and 2.59 m, right edges 3.5 m apart, 125 m in all."""
    course = iso3888.course("double-lane-change", 1.8)
    expected = [(0, 15, -1.115, 1.115), (45, 70, 2.385, 4.795), (95, 110, -1.115, 1.475), (110, 125, -1.115, 1.475)]
    assert np.allclose(course.gates, expected)
    assert course.length == 125.0
    assert course.left.shape == course.right.shape == (17, 2)  # at most 5 m apart, the last two lanes share a cone
    assert np.allclose(course.left[[0, 3, 4, 9, 10, 16]], [(0, 1.115), (15, 1.115), (45, 4.795), (70, 4.795), (95, 1.475), (125, 1.475)])  # fmt: skip # noqa: E501
    assert np.allclose(course.right[[1, 5, 12]], [(5, -1.115), (50, 2.385), (105, -1.115)])
    for old, new in zip(iso3888.course("double-lane-change", 1.8, "1999"), course):
        assert np.array_equal(old, new)


def test_obstacle_avoidance_by_hand():
    """Lanes of 2.23 and 2.8 m, 1 m between them; the way out is 3 m wide, and was 2.59 m in 2002."""
    course = iso3888.course("obstacle-avoidance", 1.8)
    assert np.allclose(course.gates, [(0, 12, -1.115, 1.115), (25.5, 36.5, 2.115, 4.915), (49, 61, -1.885, 1.115)])
    assert np.allclose(iso3888.course("obstacle-avoidance", 1.8, "2002").gates[2], (49, 61, -1.475, 1.115))
    assert iso3888.course("obstacle-avoidance", 2.3).gates[2].right == pytest.approx(1.39 - 3.24)  # not 3 m
    assert course.left.shape == course.right.shape == (15, 2)


@pytest.mark.parametrize("name", iso3888.EDITIONS)
def test_mirrored_course(name):
    course, other = (iso3888.course(name, 1.7, mirrored=mirrored) for mirrored in (False, True))
    assert np.array_equal(other.left, course.right * [1, -1])
    assert np.array_equal(other.right, course.left * [1, -1])
    car = iso3888.footprint(CAR)
    assert np.array_equal(iso3888.path(other, car), iso3888.path(course, car) * [1, -1])


def test_course_refuses():
    with pytest.raises(ValueError, match=r"no edition '2020'; there are 2018, 1999"):
        iso3888.course("double-lane-change", 1.8, "2020")
    with pytest.raises(ValueError, match="no course for 'weave'"):
        iso3888.course("weave", 1.8)
    with pytest.raises(ValueError, match="vehicle width"):
        iso3888.course("double-lane-change", 0.0)


def test_cone_margins_by_hand():
    """A car of 4 m by 2 m whose middle is 1 m ahead of its reference point."""
    cones = np.array([[1.0, 1.5], [4.0, 2.0], [1.0, 0.6], [2.9, 0.0], [-1.5, 0.0]])
    car, zero = iso3888.Footprint(4.0, 2.0, 1.0), np.zeros(1)
    expected = [0.5, np.hypot(1, 1), -0.4, -0.1, 0.5]
    for side in (1, -1):
        assert np.allclose(iso3888.cone_margins(cones * [1, side], car, zero, zero, zero), expected)
    # driven to (2, 1) and turned by a quarter: what was ahead is to the left now
    turned = cones @ [[0, 1], [-1, 0]] + [2, 1]
    assert np.allclose(iso3888.cone_margins(turned, car, zero + 2.0, zero + 1.0, zero + np.pi / 2), expected)


def test_outline_of_packaged_cars_and_of_one_without_sizes():
    assert iso3888.footprint(CAR)[:2] == (4.4, 1.8)
    bare = CAR._replace(chassis={key: value for key, value in CAR.chassis.items() if key not in ("length", "width")})
    size = iso3888.footprint(bare)
    assert size.length == pytest.approx(1.08 + 1.62 + 1.75)
    assert size.width == pytest.approx(1.55 + 0.205)
    with pytest.raises(ValueError, match=r"chassis\.width"):
        cars.from_data({**cars.every_key("compact"), "chassis": {**CAR.chassis, "width": 18.0}})


@pytest.mark.parametrize("name", iso3888.EDITIONS)
@pytest.mark.parametrize("vehicle", cars.available())
def test_the_path_keeps_half_of_the_clearance(name, vehicle):
    """To a centimetre: stations are a metre apart, and an outline's distance to a cone is not its offset across it."""
    car = iso3888.footprint(cars.load(vehicle))
    course = iso3888.course(name, car.width)
    x, y = iso3888.path(course, car)[1:-1].T
    cones, yaw = np.concatenate([course.left, course.right])[:, None], np.arctan(np.gradient(y, x))
    margins = iso3888.cone_margins(cones, car, x, y, yaw)
    least = 0.25 * min(gate.left - gate.right - car.width for gate in course.gates)
    assert margins.min() == pytest.approx(least, abs=0.01)
    assert y[0] == 0.0
    assert np.ptp(y[-2:]) == pytest.approx(0.0, abs=1e-3)


def test_a_car_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match=r"2\.5 m wide does not pass a lane of 2\.23 m"):
        iso3888.path(iso3888.course("double-lane-change", 1.8), iso3888.Footprint(4.0, 2.5, 0.0))


@pytest.fixture(scope="module")
def model():
    return linear.from_car(CAR, 80.0 * KPH)


def test_preview_gains_are_those_of_the_shift_register(model):
    """K and g against one Riccati equation for car, delay and 45 registers of the path ahead, to 1e-6 of the largest.

    The car's part is rebuilt from what the driver tells: A - B K is needed only through g.
    """
    K, g, arms = lq.gains(model, preview_time=0.45, delay=0.05)
    body, n, N = model.state_space("handwheel"), 12, 45
    A = np.zeros((8, 8))
    A[:2, :2], A[:2, 4:5], A[2, [0, 3]], A[3, 1] = body.A, body.B, (1.0, model.speed), 1.0
    # what the arms do in continuous time, from what they do in 10 ms
    omega, lag = 2.0 * np.pi * lq.ARM_FREQUENCY, lq.MUSCLE_LAG
    A[4, 5], A[5, 4:7], A[6, 6:] = 1.0, (-(omega**2), -1.4 * omega, omega**2), (-1.0 / lag, 1.0 / lag)
    step = control.c2d(control.ss(A[:7, :7], A[:7, 7:], np.eye(7), np.zeros((7, 1))), 0.01)
    assert np.allclose(arms, np.hstack([step.A[4:, 4:], step.B[4:]]))
    whole, B = np.zeros((n + N + 1, n + N + 1)), np.zeros((n + N + 1, 1))
    whole[:7, :7], whole[:7, 7:8], whole[7:11, 8:12] = step.A, step.B, np.eye(4)
    whole[n:-1, n + 1 :], B[11] = np.eye(N), 1.0
    error = np.zeros(n + N + 1)
    error[2], error[n] = 1.0, -1.0
    direct = control.dlqr(whole, B, np.outer(error, error), lq.EFFORT**2)[0][0]
    assert np.allclose(direct[:n], K, atol=1e-6 * np.abs(K).max())
    assert np.allclose(direct[n + 1 :], -g, atol=1e-6 * np.abs(g).max())
    assert direct[n] == pytest.approx(0.0, abs=1e-6 * np.abs(g).max())  # what is beside the car is too late


@pytest.mark.parametrize("speed", [40.0, 80.0, 100.0])
def test_the_preview_is_long_enough(speed):
    """A path moved aside or turned moves the car with it: gains ahead sum up to those on offset and heading, to 5 %."""
    K, g, _ = lq.gains(linear.from_car(CAR, speed * KPH))
    assert g.sum() == pytest.approx(K[2], rel=0.05)
    ahead = speed * KPH * UPDATE_INTERVAL * np.arange(1, g.size + 1)
    assert g @ ahead == pytest.approx(K[3], rel=0.05)


def test_gains_refuse(model):
    with pytest.raises(ValueError, match="preview_time"):
        lq.gains(model, preview_time=0.3)
    with pytest.raises(ValueError, match="delay"):
        lq.gains(model, delay=-0.1)
    with pytest.raises(ValueError, match="effort"):
        lq.gains(model, effort=0.0)


@pytest.fixture(scope="module")
def run():
    return manoeuvres.drive(CAR, manoeuvres.make("double-lane-change"), "lugre")


def test_the_hand_moves_smoothly(run):
    """Its speed is the slope of its angle, to 0.5 deg/s, and no jump of its acceleration shakes the torque.

    The residue above 40 Hz stays below 20 mN m.
    """
    angle, rate = run["handwheel_angle"], run["handwheel_speed"]
    assert np.gradient(angle, 0.001)[1:-1] == pytest.approx(rate[1:-1], abs=np.radians(0.5))
    residue = run["handwheel_torque"] - run.filtered(40.0)["handwheel_torque"]
    assert np.abs(residue[100:-100]).max() < 0.02


def test_it_ends_behind_the_course(run):
    assert run["x"][-1] == pytest.approx(60.0 + 125.0 + 15.0, abs=0.3)
    assert run["x"][0] < 0.1
    assert run.meta["vehicle_width_m"] == 1.8
    assert "amplitude_rad" not in run.meta


@pytest.mark.parametrize("law", EACH_LAW)
def test_double_lane_change_at_80_without_a_cone_on_a_single_track(law):
    values = metrics.evaluate(manoeuvres.drive(CAR, manoeuvres.make("double-lane-change"), law))
    assert (values["course_completed"].value, values["cones_hit"].value) == (1.0, 0.0)
    assert values["smallest_cone_margin"].value > 0.03
    assert not any(value.reason for value in values.values())


@pytest.mark.whole
def test_double_lane_change_at_80_without_a_cone_on_two_tracks():
    test = replace(manoeuvres.make("double-lane-change"), chassis="two_track")
    values = metrics.evaluate(manoeuvres.drive(CAR, test, "lugre"))
    assert (values["course_completed"].value, values["cones_hit"].value) == (1.0, 0.0)


def test_the_course_is_not_passed_faster_than_by_a_point_with_the_grip_of_the_tyres():
    """A linear program gives the least curvature with which a point stays half a width within the gates, at any yaw."""
    car = iso3888.footprint(CAR)
    gates = iso3888.course("double-lane-change", car.width).gates
    x = np.arange(0.0, gates[-1].end + 0.5)
    low, high = np.full(x.size, -np.inf), np.full(x.size, np.inf)
    for gate in gates:
        inside = (x >= gate.start) & (x <= gate.end)
        low[inside], high[inside] = gate.right + 0.5 * car.width, gate.left - 0.5 * car.width
    curvature = np.diff(np.eye(x.size), 2, axis=0)
    limits = np.vstack([np.column_stack([sign * curvature, -np.ones(x.size - 2)]) for sign in (1.0, -1.0)])
    least = linprog(np.eye(x.size + 1)[-1], limits, np.zeros(len(limits)), bounds=[*zip(low, high), (0.0, None)]).fun
    grip = abs(CAR.tyre.coefficients.PDY1) * GRAVITY
    too_fast = replace(manoeuvres.make("double-lane-change"), speed=np.sqrt(grip / least))
    assert 100.0 * KPH < too_fast.speed < 170.0 * KPH
    assert metrics.evaluate(manoeuvres.drive(CAR, too_fast, "lugre"))["cones_hit"].value > 0.0


def test_obstacle_avoidance_coasts():
    recording = manoeuvres.drive(CAR, manoeuvres.make("obstacle-avoidance"), "lugre")
    values = metrics.evaluate(recording)
    assert (values["course_completed"].value, values["cones_hit"].value) == (1.0, 0.0)
    assert values["lane_change_entry_speed"].value == pytest.approx(50.0, abs=0.5)
    assert 30.0 < values["lane_change_exit_speed"].value < 48.0
    assert np.all(recording["throttle"][recording["x"] > 61.0] == 0.0)


def test_a_driver_follows_a_gentle_path():
    """A sine of 1 m over 150 m at 80 km/h, 0.9 m/s2 at its crests, to 3 cm after the first 3 s."""
    x = np.arange(-100.0, 600.0)
    path = np.column_stack([x, np.sin(2.0 * np.pi * np.clip(x, 0.0, 525.0) / 150.0)])
    test = replace(manoeuvres.make("double-lane-change"), driver=lambda car, p: lq.preview(car, p, path), ends_at=450.0)
    recording = manoeuvres.drive(CAR, test, "lugre")
    late = recording.time > 3.0
    assert recording["y"][late] == pytest.approx(np.interp(recording["x"][late], *path.T), abs=0.03)


def test_a_cone_is_counted_once_while_the_car_stays_on_it():
    memory, channels = np.zeros(cones.MEMORY), np.zeros(len(CHANNEL))
    data = np.array([100.0, 4.0, 1.8, 0.2, 1.0, 0.5, 2.1, -0.8, 2.3, 0.0, 30.0, 0.5])  # end, outline, four cones
    counted = []
    for x in (0.0, 0.1, 0.2, 27.5, 28.0, 29.0):
        channels[CHANNEL["x"]] = x
        counted.append(cones.newly_touched(channels, data, memory))
    assert counted == [2.0, 1.0, 0.0, 0.0, 1.0, 0.0]


def test_a_car_that_goes_straight_on_beside_the_middle_touches_one_side_of_the_first_lane():
    """Four cones, 5 m apart: at 80 km/h and a decision every 50 ms the car is on each of them for several steps."""
    env = gym.make("steer_env/DriverDoubleLaneChange-v3")
    env.reset(seed=0, options={"entry_offset": 0.5, "entry_heading": 0.0, "mirrored": 0})
    over = False
    while not over:
        *_, terminated, truncated, info = env.step(np.zeros(1, np.float32))
        over = terminated or truncated
    assert info["metrics"]["cones_hit"] == 4.0
