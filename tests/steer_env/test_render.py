"""Pictures: what Gymnasium asks of them, left on the left, and windows without a window system."""

import math
import subprocess
import sys
import time

import gymnasium as gym
import numpy as np
import pygame
import pytest
from gymnasium.utils.env_checker import check_env

from steer_env.registration import DRIVEN
from steer_env.rendering import canvas, renderer
from steer_env.rendering.canvas import Canvas, nice_step

IDS = tuple(DRIVEN)
LANE_CHANGE = "steer_env/DriverDoubleLaneChange-v1"
STRAIGHT_ENTRY = {"entry_offset": 0.0, "entry_heading": 0.0}


def acted(env, steps, action=0.0):
    """Channels after so many steps."""
    for _ in range(steps):
        *_, info = env.step(np.array([action], np.float32))
    return info


def places(frame, colour, box):
    """Rows and columns (N, 2) of a box's pixels that have a colour, counted from its corner."""
    left, top, width, height = box
    part = frame[top : top + height, left : left + width].astype(int)
    return np.argwhere(np.abs(part - colour).max(axis=2) < 12)


@pytest.mark.parametrize("name", IDS)
def test_frames(name):
    """One shape for all, other at every moment, alike for the same seed; and a new episode begins a new picture."""
    one, two = (gym.make(name, render_mode="rgb_array") for _ in range(2))
    frames = []
    for env in (one, two, one):
        env.reset(seed=4)
        start = env.render()
        acted(env, 60, 0.1)
        frames.append((start, env.render()))
    for frame in frames[0]:
        assert frame.shape == (renderer.HEIGHT, renderer.WIDTH, 3)
        assert frame.dtype == np.uint8
        assert len(np.unique(frame.reshape(-1, 3), axis=0)) > 50
    assert (frames[0][0] != frames[0][1]).any(axis=2).mean() > 0.002
    for other in frames[1:]:
        assert np.array_equal(frames[0], other)
    one.close()
    two.close()


@pytest.mark.parametrize("name", ["steer_env/AssistLaneChange-v1", "steer_env/DriverParking-v1"])
def test_gymnasium_accepts_the_pictures(name):
    check_env(gym.make(name, render_mode="rgb_array").unwrapped)  # the suite takes a warning for an error


def test_a_mirrored_road_makes_a_mirrored_picture():
    env = gym.make(LANE_CHANGE, render_mode="rgb_array")
    cones = []
    for mirrored in (0.0, 1.0):
        env.reset(seed=0, options={"mirrored": mirrored, **STRAIGHT_ENTRY})
        acted(env, 400)  # the side lane is ahead
        cones.append(places(env.render(), renderer.CONE, renderer.ROAD))
    middle = 0.5 * (renderer.ROAD[2] - 1)
    upper = [found[found[:, 0] < 0.4 * renderer.ROAD[3], 1] - middle for found in cones]
    assert upper[0].mean() < -10.0  # pixels: 3.5 m to the left
    assert upper[0].mean() == pytest.approx(-upper[1].mean(), abs=1.0)
    assert len(cones[0]) == pytest.approx(len(cones[1]), rel=0.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_left_is_counter_clockwise_on_the_handwheel(side):
    env = gym.make("steer_env/DriverParking-v1", render_mode="rgb_array")
    env.reset(seed=0)
    info = acted(env, 40, 0.4 * side)
    assert 0.3 < side * info["handwheel_angle"] < 3.0
    frame, middle = env.render(), 122
    for colour in (renderer.HAND, renderer.MOTOR):
        arc = places(frame, colour, (*renderer.DIAL[:2], 2 * middle, renderer.DIAL[3]))
        assert side * (arc[:, 1].mean() - middle) < -5.0
    # The mark at the rim's top stands where the angle says.
    x = renderer.DIAL[0] + middle - 73.0 * math.sin(info["handwheel_angle"])
    y = renderer.DIAL[1] + 0.5 * renderer.DIAL[3] + 14.0 - 73.0 * math.cos(info["handwheel_angle"])
    assert frame[int(y), int(x)].min() > 200
    # So do the front wheels: their upper halves, ahead of the axle, lie to the side.
    wheels = places(frame, renderer.INK, renderer.ROAD)
    front = wheels[wheels[:, 0] < 0.5 * renderer.ROAD[3]]
    axle = np.median(front[:, 0])
    assert side * (front[front[:, 0] < axle, 1].mean() - front[front[:, 0] > axle, 1].mean()) < -1.0


def test_touched_cones_change_their_colour():
    env = gym.make(LANE_CHANGE, render_mode="rgb_array")
    env.reset(seed=0, options={"entry_offset": 0.6, "entry_heading": 0.0})
    assert not len(places(env.render(), renderer.TOUCHED, renderer.ROAD))
    for _ in range(600):
        *_, info = env.step(np.zeros(1, np.float32))
        if info["cost_terms"]["cones"]:
            break
    assert len(places(env.render(), renderer.TOUCHED, renderer.ROAD)) > 20


def test_a_state_that_is_not_finite_leaves_a_picture():
    env = gym.make("steer_env/DriverParking-v1", render_mode="rgb_array").unwrapped
    env.reset(seed=0)
    env.batch.arrays.states[:] = math.nan
    *_, terminated, _, info = env.step(np.zeros(1, np.float32))
    assert terminated
    assert "non_finite_state" in info
    assert env.render().shape == (renderer.HEIGHT, renderer.WIDTH, 3)


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_without_pygame_there_is_one_clear_error(monkeypatch, mode):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(gym.error.DependencyNotInstalled, match=r"pip install 'steer-env\[render\]'"):
        gym.make("steer_env/AssistWeave-v1", render_mode=mode)
    gym.make("steer_env/AssistWeave-v1")


def test_pygame_is_imported_for_pictures_alone_and_says_nothing():
    code = (
        "import sys, gymnasium as gym, steer_env; gym.make('steer_env/AssistWeave-v1');"
        "assert 'pygame' not in sys.modules;"
        "gym.make('steer_env/AssistWeave-v1', render_mode='rgb_array'); assert 'pygame' in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == ""


def test_an_array_needs_no_window_system(monkeypatch):
    pygame.display.quit()
    monkeypatch.setenv("SDL_VIDEODRIVER", "none of this name")
    env = gym.make("steer_env/AssistWeave-v1", render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().any()
    assert not pygame.display.get_init()
    env.close()
    with pytest.raises(RuntimeError, match=r"needs a window.*render_mode='rgb_array'"):
        gym.make("steer_env/AssistWeave-v1", render_mode="human").reset(seed=0)


def test_a_window_shows_25_frames_a_second_as_time_passes(monkeypatch):
    shown, show = [], Canvas.show

    def counted(self, title, period):
        shown.append(period)
        return show(self, title, period)

    monkeypatch.setattr(Canvas, "show", counted)
    env = gym.make("steer_env/AssistWeave-v1", render_mode="human")
    env.reset(seed=0)
    start = time.perf_counter()
    acted(env, 50)
    assert env.render() is None
    assert shown[1:] == pytest.approx([0.04] * 12)
    assert time.perf_counter() - start > 0.4  # 0.48 s less what a timer may wake too early
    env.reset(seed=0)
    assert len(shown) == 14
    env.close()


def test_an_episode_goes_on_without_a_window_that_was_closed():
    env = gym.make("steer_env/AssistWeave-v1", render_mode="human")
    env.reset(seed=0)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    acted(env, 20)
    assert not pygame.display.get_init()
    acted(env, 20)
    env.reset(seed=0)
    assert not pygame.display.get_init()


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_closing_twice_does_no_harm(mode):
    env = gym.make("steer_env/AssistWeave-v1", render_mode=mode)
    env.reset(seed=0)
    env.close()
    env.close()
    gym.make("steer_env/AssistWeave-v1", render_mode=mode).close()  # nothing drawn


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_a_closed_environment_draws_no_more(mode):
    env = gym.make("steer_env/AssistWeave-v1", render_mode=mode)
    env.reset(seed=0)
    env.close()
    with pytest.raises(gym.error.ClosedEnvironmentError, match=r"after close.*make the environment anew"):
        env.render()


def test_fonts_outlive_another_environment_that_ends_pygame():
    env = gym.make("steer_env/AssistWeave-v1", render_mode="rgb_array")
    env.reset(seed=0)
    env.render()
    pygame.quit()
    acted(env, 30, 0.3)
    assert env.render().any()


def test_steps_of_scales():
    assert [nice_step(span, 5.0) for span in (10.0, 24.0, 25.0, 49.0, 50.0)] == [2.0, 2.0, 5.0, 5.0, 10.0]
    scales = [renderer._full_scale(peak) for peak in (0.0, 5.0, 5.1, 19.0, 21.0, 60.0)]
    assert scales == [5.0, 5.0, 10.0, 20.0, 50.0, 100.0]
    assert [renderer._signed(value, 1) for value in (-0.04, 0.0, 1.0, -2.25)] == ["+0.0", "+0.0", "+1.0", "−2.2"]
    assert canvas.around((0.0, 0.0), 1.0, 0.5 * math.pi) == pytest.approx([-1.0, 0.0])  # counter-clockwise is left
