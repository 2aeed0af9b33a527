"""The window: what it draws of a moment, without a screen."""

import math

import numpy as np
import pytest

from steer_env.live.drive import window
from steer_env.live.drive.scene import COURSES, FIRST, Scene
from steer_env.live.drive.shown import ConfigurationInfo, DriveMoment, History
from steer_env.live.drive.window import DIAL, HEALTH, HEIGHT, LOOP, ROAD, WIDTH, Window
from steer_env.live.real_time.safety import PHASES
from steer_env.rendering.panels import COLOURS, CONE, TOUCHED, WANTED, Pose
from steer_env.vehicle import cars
from steer_env.vehicle.plant import CHANNEL, CHANNELS
from tests.needs import needs

pytestmark = needs("pygame")

INFOS = tuple(
    ConfigurationInfo(f"configuration of {law}", "compact", law, "boost curve", "two_track")
    for law in ("lugre", "dahl", "masing")
)


def moment(x=50.0, chosen=0, configurations=None, **more):
    """A moment of a drive whose handwheel went to and fro."""
    t = np.arange(0.0, 10.0, 0.01)
    angle, torque = 0.3 * np.sin(1.3 * t), 2.0 * np.cos(1.3 * t)
    configurations = np.full(t.size, chosen) if configurations is None else configurations
    pose = np.column_stack([x - 20.0 * (10.0 - t), 0.0 * t, 0.0 * t])
    channels = np.zeros(len(CHANNELS))
    channels[CHANNEL["x"]] = x
    usual = {
        "time": 12.0, "channels": channels, "speed": 20.0, "held": 20.0, "wanted": math.nan, "torque": -1.0,
        "phase": "on", "gain": 1.0, "clipped": 0.0, "late": 1e-4, "missed": 0.0, "chosen": chosen,
        "configurations": INFOS, "pair": (0, 1), "note": "", "waits": "",
        "motor": True, "keyboard": False, "dead_man": False, "file": "drive-0001.csv", "device": "the fake wheel",
        "history": History(pose, angle, torque, configurations),
    }  # fmt: skip
    return DriveMoment(**{**usual, **more})


def drawn(course="plain", **more):
    """The picture of a moment."""
    car = cars.load("compact")
    made = Window(Scene(course, car), [car] * len(INFOS))
    made.draw(moment(**more))
    return made.canvas.array()


def seen(frame, colour, box):
    """How many pixels of a box have a colour."""
    left, top, width, height = box
    part = frame[top : top + height, left : left + width].astype(int)
    return int((np.abs(part - colour).max(axis=2) < 12).sum())


@pytest.mark.parametrize("chosen", [0, 1])
def test_the_loop_has_the_colour_of_the_configuration(chosen):
    frame = drawn(chosen=chosen)
    assert frame.shape == (HEIGHT, WIDTH, 3)
    assert seen(frame, COLOURS[chosen], LOOP) > 100
    assert seen(frame, COLOURS[1 - chosen], LOOP) == 0


def test_the_arcs_grow_at_once_and_shrink_behind_some_seconds():
    car = cars.load("compact")
    made = Window(Scene("plain", car), [car] * len(INFOS))
    shown = []
    for time, torque in (
        (1.0, 40.0),
        (2.0, 1.0),
        (1.0 + window.PEAK_HOLD_TIME - 0.1, 1.0),
        (1.0 + window.PEAK_HOLD_TIME + 0.1, 1.0),
    ):
        channels = np.zeros(len(CHANNELS))
        channels[CHANNEL["motor_torque"]] = torque
        made.draw(moment(time=time, channels=channels))
        shown.append(made.full_scales()[1])
    assert shown == [50.0, 50.0, 50.0, 5.0]


def test_behind_a_switch_the_loop_has_both_colours_and_fades():
    frame = drawn(chosen=1, configurations=np.repeat([0, 1], [800, 200]))
    assert seen(frame, COLOURS[1], LOOP) > 50
    newest, oldest = (drawn(configurations=np.repeat(which, [100, 900])) for which in ([1, 0], [0, 1]))
    assert seen(newest, COLOURS[1], LOOP) < seen(oldest, COLOURS[1], LOOP)


@pytest.mark.parametrize("phase", PHASES)
def test_the_phase_of_the_torque_has_its_colour_and_needs_no_history(phase):
    nothing = History(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, np.int64))
    for frame in (drawn(phase=phase, history=nothing), drawn(phase=phase, held=math.nan)):
        assert seen(frame, window._PHASES[phase], (HEALTH[0], HEALTH[1], 40, 50)) > 50


def test_the_wanted_angle_is_a_mark_on_the_rim():
    assert not seen(drawn(), WANTED, DIAL)
    assert seen(drawn(wanted=0.4), WANTED, DIAL) > 20


def test_f11_fills_the_screen_and_ends_that():
    import pygame

    car = cars.load("compact")
    made = Window(Scene("plain", car), [car])
    made.open()
    try:
        for full in (True, False):
            pygame.event.clear()
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_F11))
            assert not made.events()[1]
            surface = pygame.display.get_surface()
            assert surface.get_size() == (WIDTH, HEIGHT)
            assert bool(surface.get_flags() & pygame.FULLSCREEN) == full
    finally:
        made.close()


@pytest.mark.parametrize("course", COURSES[1:])
def test_cones_are_drawn_and_change_where_they_are_touched(course):
    assert seen(drawn(course, x=FIRST), CONE, ROAD) > 100
    car = cars.load("compact")
    scene = Scene(course, car)
    scene.touch_cones([(FIRST - 5.0, 0.0, 0.0), (FIRST, 0.0, 0.0)])
    assert scene.cones()[:, 2].sum() == 0.0
    place = scene.cones()[0, :2]
    scene.touch_cones([(place[0], place[1], 0.0)])
    assert scene.cones()[0, 2] == 1.0
    made = Window(scene, [car] * len(INFOS))
    made.draw(moment(x=FIRST))
    assert seen(made.canvas.array(), TOUCHED, ROAD) > 20
    scene.touch_cones([(0.0, 0.0, 0.0)])  # where the road begins anew
    assert scene.cones()[0, 2] == 0.0
    scene.touch_cones([(FIRST + 1000.0, 0.0, 0.0)])
    assert scene.cones()[:, 2].sum() == 0.0
    assert abs(scene.cones()[:, 0] - FIRST - 1000.0).min() < 300.0


@pytest.mark.parametrize(
    ("y", "yaw", "words"),
    [
        (0.0, 0.0, ""),
        (30.0, 0.3, "off the road, which is 25 m to the right"),
        (-30.0, 0.3, "off the road, which is 25 m to the left"),
        (30.0, 3.0, "off the road, which is 25 m to the left"),
    ],
)
def test_a_car_off_the_road_is_told_where_it_is(y, yaw, words):
    assert window.off_road(Pose(0.0, y, yaw, 0.0, 0.0)) == words


def test_a_device_without_a_motor_shows_no_torque():
    assert (drawn(motor=False) != drawn()).any()
    assert not seen(drawn(motor=False), window.GOOD, (HEALTH[0], HEALTH[1], 40, 50))


def test_an_unknown_course_is_told():
    with pytest.raises(ValueError, match=r"course must be one of plain, .*'slalom'"):
        Scene("slalom", cars.load("compact"))


def test_a_window_shows_frames_and_tells_its_close(monkeypatch):
    import pygame

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    car = cars.load("compact")
    made = Window(Scene("plain", car), [car] * len(INFOS))
    made.open()
    try:
        for _ in range(3):
            made.show(moment())
        assert made.frame_rate() > 0.0
        assert not made.events()[1]
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_TAB))
        events, closed = made.events()
        assert [event.key for event in events if event.type == pygame.KEYDOWN] == [pygame.K_TAB]
        assert not closed
        pygame.event.post(pygame.event.Event(pygame.QUIT))
        assert made.events()[1]
    finally:
        made.close()
