"""Pictures: what Gymnasium asks of them, left on the left, and windows without a window system."""

import copy
import math
import subprocess
import sys
import time

import gymnasium as gym
import numpy as np
import pygame
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from steer_env.registration import DRIVEN, id_of
from steer_env.rendering import canvas, panels, renderer
from steer_env.rendering.canvas import Canvas, nice_step
from steer_env.tasks import assist_release as release
from steer_env.tasks.common.definition import NON_FINITE
from steer_env.tasks.common.reference_feel import reference_torque

IDS = tuple(DRIVEN)
LANE_CHANGE = "steer_env/DriverDoubleLaneChange-v3"
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
        acted(env, round(0.6 / env.unwrapped.control_dt), 0.1)
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


@pytest.mark.parametrize("name", IDS)
def test_gymnasium_accepts_the_pictures(name):
    check_env(gym.make(name, render_mode="rgb_array").unwrapped)  # the suite takes a warning for an error


def test_a_mirrored_road_makes_a_mirrored_picture():
    env = gym.make(LANE_CHANGE, render_mode="rgb_array", control_dt=0.01)
    cones = []
    for mirrored in (0.0, 1.0):
        env.reset(seed=0, options={"mirrored": mirrored, **STRAIGHT_ENTRY})
        acted(env, 400)  # the side lane is ahead
        cones.append(places(env.render(), panels.CONE, renderer.ROAD))
    middle = 0.5 * (renderer.ROAD[2] - 1)
    upper = [found[found[:, 0] < 0.4 * renderer.ROAD[3], 1] - middle for found in cones]
    assert upper[0].mean() < -10.0  # pixels: 3.5 m to the left
    assert upper[0].mean() == pytest.approx(-upper[1].mean(), abs=1.0)
    assert len(cones[0]) == pytest.approx(len(cones[1]), rel=0.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_left_is_counter_clockwise_on_the_handwheel(side):
    env = gym.make("steer_env/DriverParking-v3", render_mode="rgb_array", control_dt=0.01)
    env.reset(seed=0)
    info = acted(env, 40, 0.4 * side)
    assert 0.3 < side * info["handwheel_angle"] < 3.0
    frame, middle = env.render(), 122
    for colour in (panels.HAND, panels.MOTOR):
        arc = places(frame, colour, (*renderer.DIAL[:2], 2 * middle, renderer.DIAL[3]))
        assert side * (arc[:, 1].mean() - middle) < -5.0
    # The mark at the rim's top stands where the angle says.
    x = renderer.DIAL[0] + middle - 73.0 * math.sin(info["handwheel_angle"])
    y = renderer.DIAL[1] + 0.5 * renderer.DIAL[3] + 14.0 - 73.0 * math.cos(info["handwheel_angle"])
    assert frame[int(y), int(x)].min() > 200
    # So do the front wheels: their upper halves, ahead of the axle, lie to the side.
    wheels = places(frame, panels.INK, renderer.ROAD)
    front = wheels[wheels[:, 0] < 0.5 * renderer.ROAD[3]]
    axle = np.median(front[:, 0])
    assert side * (front[front[:, 0] < axle, 1].mean() - front[front[:, 0] > axle, 1].mean()) < -1.0


def test_touched_cones_change_their_colour():
    env = gym.make(LANE_CHANGE, render_mode="rgb_array", control_dt=0.01)
    env.reset(seed=0, options={"entry_offset": 0.6, "entry_heading": 0.0})
    assert not len(places(env.render(), panels.TOUCHED, renderer.ROAD))
    for _ in range(600):
        *_, info = env.step(np.zeros(1, np.float32))
        if info["metrics"]["cones_hit"]:
            break
    assert len(places(env.render(), panels.TOUCHED, renderer.ROAD)) > 20


def test_a_state_that_is_not_finite_leaves_a_picture():
    env = gym.make("steer_env/DriverParking-v3", render_mode="rgb_array").unwrapped
    env.reset(seed=0)
    env.batch.arrays.states[:] = math.nan
    *_, terminated, _, info = env.step(np.zeros(1, np.float32))
    assert terminated
    assert info["failure"] == NON_FINITE
    assert env.render().shape == (renderer.HEIGHT, renderer.WIDTH, 3)


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_without_pygame_there_is_one_clear_error(monkeypatch, mode):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(gym.error.DependencyNotInstalled, match=r"pip install '\.\[render\]'"):
        gym.make("steer_env/AssistWeave-v3", render_mode=mode)
    gym.make("steer_env/AssistWeave-v3")


def test_pygame_is_imported_for_pictures_alone_and_says_nothing():
    code = (
        "import sys, gymnasium as gym, steer_env; gym.make('steer_env/AssistWeave-v3');"
        "assert 'pygame' not in sys.modules;"
        "gym.make('steer_env/AssistWeave-v3', render_mode='rgb_array'); assert 'pygame' in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == ""


def test_an_array_needs_no_window_system(monkeypatch):
    pygame.display.quit()
    monkeypatch.setenv("SDL_VIDEODRIVER", "none of this name")
    env = gym.make("steer_env/AssistWeave-v3", render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().any()
    assert not pygame.display.get_init()
    env.close()
    env = gym.make("steer_env/AssistWeave-v3", render_mode="human")
    with pytest.warns(UserWarning, match=r"needs a window.*nothing is shown; use render_mode='rgb_array'"):
        env.reset(seed=0)
    env.step(env.action_space.sample())  # goes on without another word


@pytest.mark.parametrize("control_dt", [0.001, 0.01, 0.05])
def test_pictures_at_their_rate_make_a_video_in_real_time(control_dt):
    """As many pictures in a simulated second as ``render_fps`` says: one a step, and some 25 in a list."""
    name, second = "steer_env/AssistWeave-v3", round(1.0 / control_dt)
    assert gym.make(name, control_dt=control_dt).metadata["render_fps"] == 1.0 / control_dt
    env = gym.make(name, render_mode="rgb_array", control_dt=control_dt)
    assert env.metadata["render_fps"] == 1.0 / control_dt
    env.close()
    env = gym.make(name, render_mode="rgb_array_list", control_dt=control_dt)
    env.reset(seed=0)
    assert len(env.render()) == 1  # the start
    acted(env, second)
    frames = env.render()
    assert len(frames) == env.metadata["render_fps"] == (20 if control_dt == 0.05 else 25)
    assert env.render() == []
    single = gym.make(name, render_mode="rgb_array", control_dt=control_dt)
    single.reset(seed=0)
    acted(single, second)
    assert np.array_equal(frames[-1], single.render())
    acted(env, second)
    env.reset(seed=0)
    assert len(env.render()) == 1  # an episode begins its own list


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_vector_environment_gives_the_frame_of_each_sub_environment(mode):
    """Those of Gymnasium's own vector environment, also where an episode ends and begins anew."""
    name, actions = "steer_env/DriverLaneKeeping-v3", np.array([[1.0], [0.1]], np.float32)
    arguments = {"num_envs": 2, "render_mode": "rgb_array", "control_dt": 0.1}
    ours = gym.make_vec(name, **arguments, autoreset_mode=mode)
    theirs = gym.make_vec(name, **arguments, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode})
    assert ours.metadata["render_fps"] == theirs.metadata["render_fps"] == 10.0
    assert (ours.render_mode, ours.metadata["render_modes"]) == ("rgb_array", ["rgb_array", "rgb_array_list"])
    for env in (ours, theirs):
        env.reset(seed=3)
    ends = 0
    for _ in range(15):
        over = np.logical_or(*ours.step(actions)[2:4])
        theirs.step(actions)
        frames = ours.render()
        assert isinstance(frames, tuple)
        assert all(map(np.array_equal, frames, theirs.render()))
        assert not np.array_equal(*frames)
        ends += int(over.sum())
        if over.any() and mode == AutoresetMode.DISABLED:
            for env in (ours, theirs):
                env.reset(options={"reset_mask": over.copy()})
            assert all(map(np.array_equal, ours.render(), theirs.render()))
    assert ends
    ours.close()
    with pytest.raises(gym.error.ClosedEnvironmentError, match="after close"):
        ours.render()


def test_a_vector_environment_keeps_lists_and_is_copied_with_its_pictures():
    vector = gym.make_vec("steer_env/AssistWeave-v3", num_envs=2, render_mode="rgb_array_list")
    vector.reset(seed=0)
    for _ in range(10):
        vector.step(np.zeros((2, 1), np.float32))
    other = copy.deepcopy(vector)
    one, two = vector.render(), other.render()
    assert [len(frames) for frames in one] == [3, 3]  # at 0, 40 and 80 ms
    assert all(np.array_equal(a, b) for each in zip(one, two) for a, b in zip(*each))
    silent = gym.make_vec("steer_env/AssistWeave-v3", num_envs=2)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert silent.render() is None


@pytest.mark.parametrize(
    ("name", "scored"), [("AssistWeave", True), ("AssistAllRound", True), ("DriverLaneKeeping", False)]
)
def test_the_wanted_hand_torque_is_drawn_where_the_task_scores_it(name, scored):
    """In the loop's panel, in its own colour, and nowhere where no feel is scored."""
    env = gym.make(id_of(name), render_mode="rgb_array", control_dt=0.02)
    env.reset(seed=0)
    acted(env, 60)
    assert (len(places(env.render(), panels.WANTED, renderer.LOOP)) > 20) == scored


def test_the_drawn_torque_is_the_reference_feel_until_the_hands_let_go():
    env = gym.make("steer_env/AssistRelease-v4", render_mode="rgb_array")
    env.reset(seed=0)
    for k in range(1, 101 + round(release.RELEASE_TIME / 0.01)):
        *_, info = env.step(np.zeros(1, np.float32))
        kept = env.unwrapped._renderer._history[-1]
        if 0.01 * k <= release.RELEASE_TIME:
            assert kept[renderer._REFERENCE] == pytest.approx(
                reference_torque(info["lateral_acceleration"], info["handwheel_speed"])
            )
        else:
            assert math.isnan(kept[renderer._REFERENCE])


def test_a_window_shows_25_frames_a_second_as_time_passes(monkeypatch):
    shown, show = [], Canvas.show

    def counted(self, title, period):
        shown.append(period)
        return show(self, title, period)

    monkeypatch.setattr(Canvas, "show", counted)
    env = gym.make("steer_env/AssistWeave-v3", render_mode="human")
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
    env = gym.make("steer_env/AssistWeave-v3", render_mode="human")
    env.reset(seed=0)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    acted(env, 20)
    assert not pygame.display.get_init()
    acted(env, 20)
    env.reset(seed=0)
    assert not pygame.display.get_init()


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_closing_twice_does_no_harm_and_a_closed_environment_draws_no_more(mode):
    gym.make("steer_env/AssistWeave-v3", render_mode=mode).close()  # nothing drawn
    env = gym.make("steer_env/AssistWeave-v3", render_mode=mode)
    env.reset(seed=0)
    env.close()
    env.close()
    with pytest.raises(gym.error.ClosedEnvironmentError, match=r"after close.*make the environment anew"):
        env.render()


def test_fonts_outlive_another_environment_that_ends_pygame():
    env = gym.make("steer_env/AssistWeave-v3", render_mode="rgb_array")
    env.reset(seed=0)
    env.render()
    pygame.quit()
    acted(env, 30, 0.3)
    assert env.render().any()


def test_steps_of_scales():
    assert [nice_step(span, 5.0) for span in (10.0, 24.0, 25.0, 49.0, 50.0)] == [2.0, 2.0, 5.0, 5.0, 10.0]
    scales = [panels.full_scale(peak) for peak in (0.0, 5.0, 5.1, 19.0, 21.0, 60.0)]
    assert scales == [5.0, 5.0, 10.0, 20.0, 50.0, 100.0]
    assert [panels.with_sign(value, 1) for value in (-0.04, 0.0, 1.0, -2.25)] == ["+0.0", "+0.0", "+1.0", "−2.2"]
    assert canvas.polar_points((0.0, 0.0), 1.0, 0.5 * math.pi) == pytest.approx(
        [-1.0, 0.0]
    )  # counter-clockwise is left
