"""Driver models: their gains against direct calculations, and what they do at the wheel."""

import gymnasium as gym
import numpy as np
import pytest

import steer_env  # noqa: F401 (registers the ids)
from steer_env import drivers
from steer_env.courses.preview import PREVIEW_TIMES
from steer_env.drivers.common import lq
from steer_env.drivers.common.definition import (
    ARM_DAMPING,
    ARM_FREQUENCY,
    DELAYED_COMMANDS,
    DELAYED_ERRORS,
    MEMORY,
    MUSCLE_LAG,
    NEUROMUSCULAR_STATES,
    OWN_MEMORY,
    command,
    delayed_error,
    muscle_matrices,
    neuromuscular_step,
    preview_gains,
)
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.registration import id_of
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import linear

CAR = cars.load("compact")
SPEED = 22.0  # [m/s]
WITH_PREVIEW = ("macadam", "preview", "robot", "two_point")


def drive(env, driver, **reset):
    """Channels of an episode under a driver (T, C) and its last info."""
    controller, rows = drivers.Controller(env, driver), []
    observation, info = env.reset(seed=0, **reset)
    over = False
    while not over:
        observation, _, terminated, truncated, info = env.step(controller.act(observation))
        rows.append([info[name] for name in ("x", "y", "handwheel_angle", "handwheel_torque")])
        over = terminated or truncated
    return np.array(rows), info


def steady_acceleration(car, speed):
    """Lateral acceleration of the linear car over its handwheel angle in a steady turn [m/s2/rad]."""
    body = linear.from_car(car, speed).state_space("handwheel")
    return -speed * np.linalg.solve(body.A, body.B)[1, 0]


def sight_of(lateral):
    """What is seen of a path at lateral places (1 + points,) in the car's frame, the first beside the car."""
    return np.array([-lateral[0], 0.0, *lateral[1:]])


@pytest.mark.parametrize("driver", WITH_PREVIEW)
def test_a_mirrored_course_is_driven_mirrored_to_the_bit(driver):
    env = gym.make("steer_env/DriverDoubleLaneChange-v3")
    one, _ = drive(env, driver, options={"mirrored": 0, "entry_offset": 0.1, "entry_heading": -0.005})
    other, _ = drive(env, driver, options={"mirrored": 1, "entry_offset": -0.1, "entry_heading": 0.005})
    assert np.array_equal(one, other * [1.0, -1.0, -1.0, -1.0])


@pytest.mark.parametrize("driver", WITH_PREVIEW)
@pytest.mark.parametrize("name", ["DriverLaneKeeping", "DriverWindingRoad"])
def test_every_driver_keeps_the_lane(name, driver):
    _, info = drive(gym.make(id_of(name)), driver)
    assert info["metrics"]["peak_lateral_offset"] < 0.6
    assert info["metrics"]["rms_hand_torque"] < 2.5


@pytest.mark.parametrize(("law", "co_contraction"), [("lugre", 0.2), ("lugre", 1.0), ("masing", 0.5), ("viscous", 0.2)])
def test_arms_in_the_loop_are_stable(law, co_contraction):
    """Tensed or nearly relaxed, the driver in the loop keeps the lane without oscillation."""
    driver = drivers.make("preview", co_contraction=co_contraction)
    env = gym.make("steer_env/AssistLaneKeeping-v3", driver=driver, friction=law)
    env.reset(seed=0)
    over = False
    while not over:
        *_, terminated, over, info = env.step(np.zeros(1, np.float32))
        assert not terminated
    assert info["metrics"]["peak_lateral_offset"] < 0.4
    assert info["metrics"]["rms_handwheel_speed"] < 0.5


def test_tensed_arms_follow_the_path_better():
    offsets = []
    for co_contraction in (0.2, 1.0):
        env = gym.make("steer_env/AssistLaneKeeping-v3", driver=drivers.make("preview", co_contraction=co_contraction))
        env.reset(seed=0)
        over = False
        while not over:
            *_, over, info = env.step(np.zeros(1, np.float32))
        offsets.append(info["metrics"]["rms_lateral_offset"])
    assert offsets[1] < offsets[0]


def test_a_handwheel_that_is_let_go_settles():
    """Hands off after a steady turn: it comes back by more than half, and stands still."""
    env = gym.make("steer_env/AssistRelease-v4", speed=100.0 / 3.6)
    env.reset(seed=0, options={"amplitude": 0.4})
    over, angles = False, []
    while not over:
        *_, over, info = env.step(np.zeros(1, np.float32))
        angles.append(info["handwheel_angle"])
    assert max(angles) == pytest.approx(0.4, rel=1e-3)
    assert abs(angles[-1]) < 0.2
    assert np.ptp(angles[-100:]) < 0.01


def test_free_hands_give_nothing():
    env = gym.make("steer_env/DriverLaneKeeping-v3")
    observation, _ = env.reset(seed=0)
    assert drivers.Controller(env, "free").act(observation).tolist() == [0.0]


def test_preview_commands_as_the_optimum_on_every_sample():
    """On a path that is straight between what is seen, the few points give what all 150 of the optimum do."""
    rng = np.random.default_rng(0)
    driver = drivers.make("preview", effort=0.02)
    model = linear.from_car(CAR, SPEED)
    K, g, arms = lq.gains(model, PREVIEW_TIMES[-1], effort=0.02 * steady_acceleration(CAR, SPEED))
    lateral, z, v_y, r = rng.normal(size=1 + len(PREVIEW_TIMES)), rng.normal(size=NEUROMUSCULAR_STATES), 0.3, -0.1
    path = np.interp(UPDATE_INTERVAL * np.arange(1, g.size + 1), [0.0, *PREVIEW_TIMES], lateral)
    wanted = g @ path - K[:2] @ [v_y, r] - K[4:] @ z
    found = command(driver.preview_model, preview_gains(driver, CAR, SPEED), sight_of(lateral), v_y, r, z, np.zeros(1))
    assert found == pytest.approx(wanted, rel=1e-12)
    np.testing.assert_allclose(muscle_matrices(), arms, atol=1e-9)


def test_macadam_is_the_least_squares_command():
    """Against a simulation of the linear car, the arms and the delay with a command held, and numpy's least squares."""
    from scipy.integrate import solve_ivp

    body, omega = linear.from_car(CAR, SPEED).state_space("handwheel"), 2.0 * np.pi * ARM_FREQUENCY
    times = np.array([t for t in PREVIEW_TIMES if t <= 0.9 + 1e-9])
    rng = np.random.default_rng(0)
    v_y, r, z = 0.2, 0.05, rng.normal(size=NEUROMUSCULAR_STATES)

    def ways(held, start, pipeline):
        """Lateral places at the times; the commands of the pipeline take effect first, then the held one."""
        x, found = np.array([*start[:2], 0.0, 0.0, *start[2:]]), []
        for k in range(round(times[-1] / UPDATE_INTERVAL)):
            u = pipeline[k] if k < len(pipeline) else held

            def rate(t, x, u=u):
                v, turn, _, yaw, angle, speed, muscles = x
                arms = omega**2 * (muscles - angle) - 2.0 * ARM_DAMPING * omega * speed
                car = body.A @ [v, turn] + body.B[:, 0] * angle
                return [*car, v + SPEED * yaw, turn, speed, arms, (u - muscles) / MUSCLE_LAG]

            x = solve_ivp(rate, (0.0, UPDATE_INTERVAL), x, rtol=1e-9, atol=1e-12).y[:, -1]
            found.append(x[2])
        return np.array(found)[np.round(times / UPDATE_INTERVAL).astype(int) - 1]

    lateral = np.array([0.0, *0.02 * np.array(PREVIEW_TIMES) ** 2 * SPEED**2 / 5.0])
    unit, free = ways(1.0, np.zeros(5), np.zeros(DELAYED_COMMANDS)), ways(0.0, [v_y, r, *z[:3]], z[3:])
    wanted = np.linalg.lstsq(unit[:, None], lateral[1 : 1 + times.size] - free, rcond=None)[0][0]
    driver = drivers.make("macadam", preview_time=0.9)
    gains = preview_gains(driver, CAR, SPEED)
    found = command(driver.preview_model, gains, sight_of(lateral), v_y, r, z, np.zeros(1))
    assert found == pytest.approx(wanted, rel=1e-6)


def test_two_points_ask_for_the_cars_own_angle_in_a_steady_turn():
    """On a circle the near and far angle are known; small enough, the linear car turns with just what they ask for."""
    curvature = 1e-5
    ahead = SPEED * np.array([0.0, *PREVIEW_TIMES])
    driver = drivers.make("two_point")
    gains = preview_gains(driver, CAR, SPEED)
    asked = command(
        driver.preview_model,
        gains,
        sight_of(0.5 * curvature * ahead**2),
        0.0,
        0.0,
        np.zeros(NEUROMUSCULAR_STATES),
        np.zeros(1),
    )
    turning = -np.linalg.solve(*(lambda s: (s.A, s.B))(linear.from_car(CAR, SPEED).state_space("handwheel")))[1, 0]
    integral = gains[2] * 0.01 * 0.5 * curvature * 8.0  # of the first sample
    # Between the points seen the near point's parabola is a chord.
    assert asked - integral == pytest.approx(curvature * SPEED / turning, rel=0.02)


def test_a_command_takes_its_time():
    """A unit step asked for reaches the intended angle after the delay, and arrives without much overshoot."""
    driver = drivers.make("free")
    memory, intended = np.zeros(MEMORY + OWN_MEMORY), []
    for _ in range(100):
        angle, *_ = neuromuscular_step(
            driver.preview_model, np.zeros(0), muscle_matrices(), np.zeros(17), 0.0, 0.0, memory
        )
        memory[NEUROMUSCULAR_STATES - 1] = 1.0
        intended.append(angle)
    assert max(intended[:12]) == 0.0
    assert 0.99 < intended[-1] < 1.01
    assert max(intended) < 1.1


@pytest.mark.parametrize("ahead", [0, 1])
def test_a_reflex_answers_to_an_error_50_ms_old(ahead):
    """With ``ahead`` 1 the result is the delayed error of the next update."""
    memory = np.zeros(MEMORY + OWN_MEMORY)
    answers = [delayed_error(memory, 1.0 if k == 3 else 0.0, ahead) for k in range(12)]
    assert np.flatnonzero(answers).tolist() == [3 + DELAYED_ERRORS - ahead]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: drivers.make("chauffeur"), "unknown driver 'chauffeur'; available: .*free, macadam, preview, robot"),
        (lambda: drivers.make("preview", co_contraction=1.5), "co_contraction must be .*at most 1, got 1.5"),
        (lambda: drivers.make("preview", effort=0.0), r"effort \[s2\] must be .*greater than 0"),
        (lambda: drivers.make("macadam", preview_time=9.0), r"preview_time \[s\] must be .*at most 1.5"),
        (lambda: drivers.make("two_point", near=0.0), r"near \[m\] must be .*at least 2"),
        (lambda: gym.make("steer_env/AssistLaneKeeping-v3", driver=3), "driver must be one of .*free, .*got 3"),
        (lambda: gym.make("steer_env/AssistWeave-v3", driver="preview"), "AssistWeave has no driver model in its loop"),
        (lambda: drivers.Controller(gym.make("steer_env/AssistWeave-v3")), "no driver model can act in AssistWeave"),
        (
            lambda: drivers.Controller(gym.make("steer_env/DriverParking-v3")),
            "no driver model can act in DriverParking",
        ),
        (
            lambda: drivers.Controller(gym.make("steer_env/DriverLaneKeeping-v3", control_dt=0.005)),
            "act every 10 ms; make the environment with a multiple of it as control_dt, not 0.005",
        ),
        (lambda: drivers.make("preview", informed="yes"), "informed must be True or False, got 'yes'"),
        (lambda: drivers.resolve({"driver": "robot", "informed": 1}), "informed must be True or False, got 1"),
        (
            lambda: drivers.AngleServo(gym.make("steer_env/DriverLaneKeeping-v3")),
            "the angle servo cannot act in DriverLaneKeeping: it needs an observed target angle",
        ),
    ],
)
def test_bad_calls(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("name", ["preview", "macadam", "robot"])
def test_a_driver_takes_over_without_a_jump(name):
    """An offset that is there at the start is no step to answer: it asked for 4 to 10 N m within one decision."""
    env = gym.make("steer_env/DriverDoubleLaneChange-v3")
    driver, last, steps = drivers.Controller(env, name), 0.0, []
    for seed in range(4):
        observation, info = env.reset(seed=seed)
        driver.reset()
        for _ in range(20):
            observation, _, _, _, info = env.step(driver.act(observation))
            steps.append(abs(info["handwheel_torque"] - last))
            last = info["handwheel_torque"]
    assert max(steps) < 2.2
