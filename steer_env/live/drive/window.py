"""The window of a drive: road and car, handwheel, torque over angle with a fading trail, configurations, and the loop.

It draws what a session shows and passes the events of pygame on; the drive itself is the same without it.
"""

import math
import time
from collections import deque
from typing import Any

import numpy as np

from steer_env.live.drive.scene import LANE, LANES, Scene
from steer_env.live.drive.shown import ConfigurationInfo, DriveMoment
from steer_env.rendering import panels
from steer_env.rendering.canvas import Box, Canvas, Colour, mix
from steer_env.rendering.panels import COLOURS, HAND, INK, MOTOR, MUTED, PANEL, PAPER, RULE, WANTED, with_sign
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import CHANNEL

WIDTH, HEIGHT = 1280, 680
FRAMES = 60.0  # at most in a second [1/s]
PEAK_HOLD_TIME = 10.0  # time for which the arcs suit a torque that was large; that of the loop [s]
TORQUE = "torsion-bar torque"  # which a wheel gives, and which has no noise of the sensor
TITLE = "steer-env drive"
# Panels: left, top, width, height.
ROAD, DIAL, LOOP, HEALTH = (14, 70, 440, 560), (468, 70, 498, 254), (468, 338, 498, 292), (980, 70, 286, 254)
SETS = (980, 338, 286, 292)
_STEER = "Left, Right or a, d  steer     Up, Down or w, s  pedals     "
KEYS_TEXT = (
    "Tab  swap     1–9  choose     Page up, down  speed     C  recentre     R  road to car     "
    "P  pause     F11  full screen     Esc  end"
)
GOOD, WAITS, BAD = (22, 128, 80), (202, 138, 4), (190, 18, 60)
_PHASES = {"on": GOOD, "starting": WAITS, "fading": WAITS, "off": MUTED, "failed": BAD}
_AGES = np.linspace(0.08, 1.0, 24).tolist()
_POSE = [CHANNEL[name] for name in ("x", "y", "yaw_angle", "road_wheel_angle_left", "road_wheel_angle_right")]


class Window:
    """Draws a session.

    Parameters
    ----------
    scene : Scene
    cars : sequence of Car
        Of the configurations.

    Raises
    ------
    gymnasium.error.DependencyNotInstalled
        pygame-ce is not installed.
    """

    def __init__(self, scene: Scene, cars: list[Car]) -> None:
        self.canvas = Canvas(WIDTH, HEIGHT)
        self._scene, self._cars = scene, cars
        self._peaks = np.array([20.0, 2.0])  # of the axes of the loop [deg], [N m]
        # Times [s] and torques of torsion bar and assist [N m] that may be the largest of the last seconds.
        self._largest: tuple[deque[tuple[float, float]], ...] = (deque(), deque())
        self._seen = 0.0  # time up to which the cones know the way [s]
        self.frames, self._began = 0, math.nan

    def open(self) -> None:
        """Open the window; NoWindowError where there is no window system."""
        self.canvas.open(TITLE)

    def events(self) -> tuple[list[Any], bool]:
        """The events since the last call, and whether the window was closed; F11 is for the window itself."""
        events, closed = self.canvas.events()
        if any(self.canvas.pressed(event, "F11") for event in events):
            self.canvas.fill_screen()
        return events, closed

    def show(self, shown: DriveMoment) -> None:
        """Draw a moment into the open window."""
        self.draw(shown)
        self.canvas.flip(1.0 / FRAMES)
        if not self.frames:
            self._began = time.monotonic()
        self.frames += 1

    def frame_rate(self) -> float:
        """Frames shown in a second so far, NaN before the second one [1/s]."""
        return (self.frames - 1) / (time.monotonic() - self._began) if self.frames > 1 else math.nan

    def draw(self, shown: DriveMoment) -> None:
        """Draw a moment."""
        canvas = self.canvas
        canvas.begin(PAPER)
        for box in (ROAD, DIAL, LOOP, HEALTH, SETS):
            canvas.panel(box, PANEL, RULE)
        self._status(shown)
        self._road(shown)
        self._dial(shown)
        self._loop(shown)
        self._health(shown)
        self._configurations(shown)
        keys = f"{_STEER if shown.keyboard else ''}{KEYS_TEXT}{'     Space  hold for torque' if shown.dead_man else ''}"
        canvas.text(keys, (16, HEIGHT - 14), MUTED, 12)
        canvas.text(_cut(shown.note, 170), (16, HEIGHT - 36), INK, 13, bold=True)

    def _status(self, shown: DriveMoment) -> None:
        canvas, info = self.canvas, shown.configurations[shown.chosen]
        speed = f"{round(3.6 * shown.speed)}"
        right = 16 + canvas.text(speed, (16, 36), INK, 34, bold=True)
        canvas.text("km/h", (right + 8, 42), MUTED, 13)
        held = "pedals" if math.isnan(shown.held) else f"held at {3.6 * shown.held:.0f}"
        canvas.text(held, (right + 8, 24), MUTED, 11)
        for x, label, words in (
            (206, "set", f"{shown.chosen + 1}  {info.label}"),
            (468, "friction law", info.law),
            (732, "car", f"{info.car}, {info.chassis.replace('_', ' ')}"),
            (980, "assist", info.assist),
            (1190, "time", f"{int(shown.time // 60)}:{shown.time % 60:04.1f}"),
        ):
            canvas.text(label, (x, 24), MUTED, 11)
            canvas.text(_cut(words, 25), (x, 44), INK, 15, bold=x == 206)

    def _road(self, shown: DriveMoment) -> None:
        pose = panels.Pose(*shown.channels[_POSE])
        span = min(14.0 + 1.35 * max(shown.speed, 0.0), 90.0)
        ahead = span + 20.0
        along = pose.x + np.arange(-ahead, ahead)
        straight = np.column_stack([np.floor(along), np.zeros((along.size, 2))])
        # The car drives upward where it drives along the road, and turns in the picture where it leaves it.
        heading = 0.0 if math.cos(pose.yaw) > 0.5 else pose.yaw
        road = panels.Road(self.canvas, ROAD, pose, heading, span, 0.25)
        road.grid()
        road.lane(straight, 0.5 * LANES * LANE)
        for side in (-0.5 * LANE, 0.5 * LANE):
            road.dashes(straight[:, :2] + [0.0, side], int(straight[0, 0]))
        history = shown.history
        road.trace(history.pose[:, :2])
        new = round(min(max(shown.time - self._seen, 0.0), 1.0) / 0.01)
        self._scene.touch_cones(map(tuple, history.pose[-new:].tolist() if new else ()))
        self._seen = shown.time
        if (cones := self._scene.cones()) is not None:
            road.cones(cones)
        road.car(self._cars[shown.chosen], self._scene.size)
        road.scale()
        if words := off_road(pose):
            left, top, width, _ = ROAD
            self.canvas.text(words, (left + 0.5 * width, top + 20), BAD, 15, bold=True, align=0.5)

    def _dial(self, shown: DriveMoment) -> None:
        now = shown.channels
        angle, hand, motor = (now[CHANNEL[name]] for name in ("handwheel_angle", "torsion_bar_torque", "motor_torque"))
        for largest, value in zip(self._largest, (hand, motor)):
            while largest and largest[-1][1] <= abs(value):
                largest.pop()
            largest.append((shown.time, abs(float(value))))
            while largest[0][0] < shown.time - PEAK_HOLD_TIME:
                largest.popleft()
        arcs = [
            panels.Arc(float(value), full, colour)
            for value, full, colour in zip((hand, motor), self.full_scales(), (HAND, MOTOR))
        ]
        rows = [
            panels.Row("handwheel angle", f"{with_sign(math.degrees(angle), 1)} deg"),
            panels.Row("torsion-bar torque", f"{with_sign(hand, 2)} N m", HAND, f"full arc {arcs[0].full:g} N m"),
            panels.Row("assist torque", f"{with_sign(motor, 2)} N m", MOTOR, f"full arc {arcs[1].full:g} N m"),
            panels.Row("lateral acceleration", f"{with_sign(now[CHANNEL['lateral_acceleration']], 2)} m/s²"),
        ]
        wanted = None if math.isnan(shown.wanted) else shown.wanted
        if wanted is not None:
            rows.insert(1, panels.Row("wanted angle", f"{with_sign(math.degrees(wanted), 1)} deg", WANTED))
        panels.dial(self.canvas, DIAL, float(angle), arcs, rows, wanted)

    def full_scales(self) -> list[float]:
        """Full scales of the arcs of torsion bar and assist, by their largest torques of the last seconds [N m]."""
        return [panels.full_scale(largest[0][1]) for largest in self._largest]

    def _loop(self, shown: DriveMoment) -> None:
        history = shown.history
        angles, torques = np.degrees(history.angle), history.torque
        if angles.size:
            # The axes grow at once and shrink slowly, so that they do not jump.
            now = np.maximum([np.abs(angles).max(), np.abs(torques).max()], [5.0, 1.0])
            self._peaks = np.maximum(now, self._peaks - 0.01 * (self._peaks - now))
            panels.loop(
                self.canvas,
                LOOP,
                angles,
                torques,
                self._peaks,
                "last 10 s",
                ages=_AGES,
                sets=history.configurations,
                title=TORQUE,
            )

    def _health(self, shown: DriveMoment) -> None:
        canvas, (left, top, width, _) = self.canvas, HEALTH
        right, colour = left + width - 16, _PHASES[shown.phase] if shown.motor else MUTED
        canvas.text("●", (left + 14, top + 27), colour, 20)
        heading = f"torque {shown.phase}" if shown.motor else "no motor"
        canvas.text(heading, (left + 40, top + 28), INK, 17, bold=True)
        state = shown.waits or f"{shown.gain:.0%}"
        canvas.text(state if shown.motor else "", (right, top + 28), INK if shown.waits else MUTED, 14, align=1.0)
        motor: list[tuple[str, str, Colour]] = [
            ("torque at the wheel", f"{with_sign(shown.torque, 2)} N m", INK),
            ("limited", f"{100.0 * shown.clipped:.1f} % of the time", BAD if shown.clipped > 0.01 else INK),
        ]
        rows: list[tuple[str, str, Colour]] = [
            *(motor if shown.motor else []),
            ("late, 99 of 100", f"{1e3 * shown.late:.2f} ms", WAITS if shown.late > 1e-3 else INK),
            ("deadlines missed", f"{100.0 * shown.missed:.2f} %", WAITS if shown.missed > 0.01 else INK),
            ("recording", shown.file or "none", INK),
        ]
        y = top + 66
        for label, words, ink in rows:
            canvas.text(label, (left + 16, y), MUTED, 12)
            canvas.text(words, (right, y), ink, 14, align=1.0)
            y += 30
        canvas.text(_cut(shown.device, 42), (left + 16, y + 6), MUTED, 11)

    def _configurations(self, shown: DriveMoment) -> None:
        canvas, (left, top, width, height) = self.canvas, SETS
        canvas.field((left + 1, top + 1, width - 2, height - 2), PANEL)
        step = min(58, (height - 16) // max(len(shown.configurations), 1))
        for number, info in enumerate(shown.configurations):
            self._configuration(shown, number, info, (left + 8, top + 8 + number * step, width - 16, step - 6))

    def _configuration(self, shown: DriveMoment, number: int, info: ConfigurationInfo, box: Box) -> None:
        canvas, (left, top, width, height) = self.canvas, box
        colour, acts = COLOURS[number % len(COLOURS)], number == shown.chosen
        corners = [(left, top), (left + width, top), (left + width, top + height), (left, top + height)]
        canvas.polygon(corners, mix(PANEL, colour, 0.14 if acts else 0.04))
        if acts:
            canvas.polygon([(left, top), (left + 5, top), (left + 5, top + height), (left, top + height)], colour)
        middle = top + 0.5 * height
        canvas.text(str(number + 1), (left + 22, middle), colour, 18, bold=True, align=0.5)
        more = ", ".join(dict.fromkeys(filter(None, (info.law, info.car, info.chassis.replace("_", " ")))))
        two = height > 36
        canvas.text(_cut(info.label, 22), (left + 42, middle - 8 * two), INK, 14, bold=acts)
        if two:
            canvas.text(_cut(more, 32), (left + 42, middle + 11), MUTED, 11)
        if number in shown.pair and len(shown.configurations) > 1:
            letter = "AB"[shown.pair.index(number)]
            canvas.text(letter, (left + width - 14, middle), colour if acts else MUTED, 17, bold=True, align=0.5)

    def close(self) -> None:
        """Close the window."""
        self.canvas.close()


def off_road(pose: panels.Pose) -> str:
    """Where the road is, for a car that has left it; empty on the road."""
    beyond = abs(pose.y) - 0.5 * LANES * LANE
    if beyond <= 0.0:
        return ""
    side = "right" if pose.y * math.cos(pose.yaw) > 0.0 else "left"
    return f"off the road, which is {math.ceil(beyond)} m to the {side}"


def _cut(words: str, length: int) -> str:
    return words if len(words) <= length else words[: length - 1] + "…"
