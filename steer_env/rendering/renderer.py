"""Pictures of an episode: the car on its road from above, the handwheel with its torques, the live torque-angle loop.

Lengths in the picture are in pixels, y downward; the axes of the road are ISO 8855: x forward, y to the left. The car
drives upward, so that left in the picture is left on the road.
"""

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.batch import EnvironmentBatch
from steer_env.courses.iso3888 import outline
from steer_env.friction.law import law_of
from steer_env.rendering.canvas import Canvas, Colour, around, mixed, nice_step
from steer_env.rendering.modes import frame_rate
from steer_env.rendering.view import View, extended, turned
from steer_env.tasks.common.definition import NON_FINITE, Task
from steer_env.tasks.common.feel import FEEL_METRIC
from steer_env.vehicle.plant import CHANNEL
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

WIDTH, HEIGHT = 960, 540
# Panels: left, top, width, height.
ROAD, DIAL, LOOP = (14, 62, 430, 464), (458, 62, 488, 226), (458, 302, 488, 224)
HISTORY, SPACING = 10.0, 0.01  # length of trace and loop, time between their points [s]

PAPER, PANEL, RULE, GRID = (244, 245, 248), (255, 255, 255), (208, 213, 221), (235, 238, 243)
INK, MUTED = (31, 41, 55), (107, 114, 128)
SURFACE, EDGE, GUIDE = (229, 232, 238), (140, 149, 163), (176, 184, 197)
BODY, OUTLINE, GLASS, TRACE = (112, 135, 174), (55, 71, 99), (222, 231, 243), (150, 170, 205)
HAND, MOTOR, WANTED = (37, 99, 235), (13, 148, 136), (168, 50, 210)
CONE, TOUCHED = (245, 130, 32), (190, 18, 60)

# Channels that are kept for every point of trace and loop, in SI.
_NAMES = (
    "x", "y", "yaw_angle", "handwheel_angle", "handwheel_torque", "motor_torque", "lateral_acceleration",
    "road_wheel_angle_left", "road_wheel_angle_right",
)  # fmt: skip
_PLACES = [CHANNEL[name] for name in _NAMES]
_X, _Y, _YAW, _ANGLE, _TORQUE, _MOTOR, _ACCELERATION, _LEFT, _RIGHT = range(len(_NAMES))
_REFERENCE = len(_NAMES)  # place beside them of the hand torque that the task wants; NaN where it wants none [N m]
_SHOWN = [_ANGLE, _TORQUE, _MOTOR]

_VIEW_LAG = 1.0  # time constant with which the view turns with the car where there is no path [s]
_FULL_ARC = math.radians(120.0)  # angle of an arc at full scale
_WHEEL = np.array([[0.31, 0.1], [0.31, -0.1], [-0.31, -0.1], [-0.31, 0.1]])  # of a 205/60 R15 tyre [m]
_WINDSCREEN = np.array([[0.17, 0.40], [0.17, -0.40], [0.04, -0.33], [0.04, 0.33]])  # over the car's length and width
_REAR_WINDOW = np.array([[-0.28, 0.29], [-0.28, -0.29], [-0.37, -0.33], [-0.37, 0.33]])


class Renderer:
    """Draws a row of a batch.

    Parameters
    ----------
    batch : EnvironmentBatch
    row : int
    mode : {"rgb_array", "rgb_array_list", "human"}
        "rgb_array" draws off screen and needs no window system; "rgb_array_list" draws so at every frame that is due
        and keeps the pictures; "human" draws in a window in step with the simulated time. After the user has closed the
        window, the simulation goes on without one.
    canvas : Canvas, optional
        That of other rows, which draw one after the other; by default one of its own.

    Raises
    ------
    gymnasium.error.DependencyNotInstalled
        pygame-ce is not installed.
    """

    def __init__(self, batch: EnvironmentBatch, row: int, mode: str, canvas: Canvas | None = None) -> None:
        self._batch, self._row, self._mode = batch, row, mode
        self._period = 1.0 / frame_rate(mode, batch.control_dt)
        self._window = mode == "human"
        self._canvas = Canvas(WIDTH, HEIGHT) if canvas is None else canvas
        self._size = outline(batch.car)
        self._scored = _feel(batch.task)
        self._frames: list[NDArray[np.uint8]] = []
        self._history: deque[Array] = deque(maxlen=round(HISTORY / SPACING))
        self._open = self._window
        self._forget()

    def _forget(self) -> None:
        self._now = np.zeros(1 + len(_NAMES))
        self._peaks = np.zeros(len(_SHOWN))
        self._history.clear()
        self._kept = self._shown = -math.inf  # times of the last point of the trace and of the last frame shown [s]
        self._time = self._heading = self._reward = 0.0
        self._path: Array | None = None

    def start(self) -> None:
        """Begin an episode."""
        self._forget()
        path = self._batch.path(self._row)
        if path is not None:
            self._path = extended(path[:, :3])
        self._heading = float(self._batch.arrays.channels[self._row, CHANNEL["yaw_angle"]])
        self._read()
        self._frames.clear()
        self._keep()

    def add(self) -> None:
        """Add a step, and show or keep a frame when one is due."""
        self._reward += float(self._batch.episodes["reward"][self._row])
        self._read()
        if self._time - self._shown >= self._period - 0.5 * SAMPLE_TIME:
            self._keep()

    def given(self) -> Any:
        """What ``render`` gives: the present picture (540, 960, 3), or those that were kept; None with a window."""
        if self._window:
            return None
        if self._mode == "rgb_array":
            return self._picture()
        frames, self._frames = self._frames, []
        return frames

    def _picture(self) -> NDArray[np.uint8]:
        self._draw()
        return self._canvas.array()

    def close(self) -> None:
        """Close the window."""
        self._open = False
        self._canvas.close()

    def _keep(self) -> None:
        """Show a frame in the window, or keep a picture, as the mode wants it."""
        passed, self._shown = self._time - self._shown, self._time
        if self._mode == "rgb_array_list":
            self._frames.append(self._picture())
        elif self._open:
            self._draw()
            self._open = self._canvas.show(f"steer-env: {self._batch.task.name}", passed)

    def _read(self) -> None:
        """Read the present state. One that is not finite leaves the last picture as it was."""
        arrays, episode = self._batch.arrays, self._batch.episodes[self._row]
        now = arrays.channels[self._row, [*_PLACES, 0]]
        if episode["failure"] == NON_FINITE or not np.isfinite(now).all():
            return
        now[_REFERENCE] = now[_TORQUE] - self._feel_error(episode)
        time = float(episode["sample"]) * SAMPLE_TIME
        self._heading += -math.expm1((self._time - time) / _VIEW_LAG) * (now[_YAW] - self._heading)
        self._now, self._time = now, time
        np.maximum(self._peaks, np.abs(now[_SHOWN]), out=self._peaks)
        if time - self._kept >= SPACING - 0.5 * SAMPLE_TIME:
            self._history.append(now)
            self._kept = time

    def _feel_error(self, episode: Any) -> float:
        """Hand torque minus the wanted one, as the task has just scored it; NaN where no feel is scored [N m]."""
        # Nobody feels a handwheel that is let go.
        released = 0 <= episode["release"] < episode["sample"]
        if self._scored is None or released or episode["evaluated"] == 0:
            return math.nan
        return float(self._batch.arrays.metrics[self._row, 0, self._scored])

    def _draw(self) -> None:
        canvas = self._canvas
        canvas.begin(PAPER)
        for box in (ROAD, DIAL, LOOP):
            canvas.panel(box, PANEL, RULE)
        history = np.array([*self._history, self._now])
        cones, wanted = self._batch.scenery(self._row)
        self._draw_status()
        self._draw_road(history, cones)
        self._draw_dial(wanted if wanted is not None and math.isfinite(wanted) else None)
        self._draw_loop(history)

    def _draw_status(self) -> None:
        batch, canvas = self._batch, self._canvas
        episode, action = batch.episodes[self._row], batch.task.action
        canvas.text(batch.task.name, (16, 32), INK, 17, bold=True)
        given = float(episode["action"])
        for x, label, words in (
            (318, "friction law", law_of(batch.conditions[self._row].friction).name),
            (438, "speed", f"{_signed(3.6 * float(episode['speed']), 1, plus='')} km/h"),
            (548, "time", f"{self._time:.2f} s"),
            (638, "action", f"{_signed(given, 2)}  ({_signed(given * action.scale, 2)} {action.unit})"),
            (842, "reward so far", _signed(self._reward, 2)),
        ):
            canvas.text(label, (x, 22), MUTED, 11)
            canvas.text(words, (x, 40), INK, 14)

    def _draw_road(self, history: Array, cones: Array | None) -> None:
        canvas, path = self._canvas, self._path
        left, top, width, height = ROAD
        canvas.field((left + 1, top + 1, width - 2, height - 2), PANEL)
        speed = self._batch.conditions[self._row].speed
        span = min(7.0 + 1.35 * speed, 90.0)  # length of road that the panel's height shows [m]
        share = 0.5 if speed == 0.0 else 0.2 if path is not None else 0.4  # of this length behind the car
        view = View((left + 0.5 * width, top + (1.0 - share) * height), height / span, self._now, self._heading)
        if path is not None:
            nearest = int(np.argmin(np.hypot(*(path[:, :2] - self._now[:2]).T)))
            low, high = max(nearest - int(span), 0), min(nearest + int(span) + 1, len(path) - 1)
            behind, ahead = (
                path[max(nearest - int(share * span), 0)],
                path[min(nearest + int(0.7 * span), len(path) - 1)],
            )
            view.heading = math.atan2(ahead[1] - behind[1], ahead[0] - behind[0])
            path = path[low:high]
        self._draw_grid(view, span)
        if path is not None:
            self._draw_lane(view, path, low)
        near = history[np.abs(history[:, :2] - self._now[:2]).max(axis=1) < 2.0 * span]
        canvas.lines(view(near[:, :2]), TRACE, 2.0)
        if cones is not None:
            self._draw_cones(view, cones)
        self._draw_car(view)
        bar = nice_step(span, 5.0)
        end = left + 14 + bar * view.scale
        y = top + height - 16
        canvas.segments(
            [(left + 14, y), (left + 14, y - 4), (end, y - 4)], [(end, y), (left + 14, y + 4), (end, y + 4)], INK
        )
        canvas.text(f"{bar:g} m", (end + 8, y), INK, 12)

    def _draw_grid(self, view: "View", span: float) -> None:
        step = nice_step(span, 5.0)
        reach = 1.5 * span
        for axis in (0, 1):
            at = step * np.arange(math.ceil((self._now[axis] - reach) / step), (self._now[axis] + reach) / step)
            starts, ends = np.empty((2, at.size, 2))
            starts[:, axis] = ends[:, axis] = at
            starts[:, 1 - axis], ends[:, 1 - axis] = self._now[1 - axis] - reach, self._now[1 - axis] + reach
            self._canvas.segments(view(starts), view(ends), GRID)

    def _draw_lane(self, view: "View", path: Array, first: int) -> None:
        half = self._batch.task.lane_half_width
        points, normal = path[:, :2], np.column_stack([-np.sin(path[:, 2]), np.cos(path[:, 2])])
        if half is not None:
            edges = [view(points + side * half * normal) for side in (1.0, -1.0)]
            self._canvas.polygon(np.concatenate([edges[0], edges[1][::-1]]), SURFACE)
            for edge in edges:
                self._canvas.lines(edge, EDGE, 2.0)
        seen = view(points)
        dashes = np.arange(-first % 3, len(seen) - 1, 3)  # fixed to the road
        self._canvas.segments(seen[dashes], seen[dashes + 1], GUIDE, 1.5)

    def _draw_cones(self, view: "View", cones: Array) -> None:
        radius = max(0.2 * view.scale, 3.5)
        for place, touched in zip(view(cones[:, :2]), cones[:, 2] > 0.0):
            if abs(place - view.centre).max() > HEIGHT:
                continue
            self._canvas.circle(place, radius, TOUCHED if touched else CONE)
            if touched:
                arm = (radius + 2.0) * np.array([[1.0, 1.0], [1.0, -1.0]])
                self._canvas.segments(place - arm, place + arm, TOUCHED, 1.5)
        hit = int(cones[:, 2].sum())
        words = f"{hit} of {len(cones)} cones touched"
        self._canvas.text(
            words, (ROAD[0] + ROAD[2] - 12, ROAD[1] + ROAD[3] - 16), TOUCHED if hit else MUTED, 12, align=1.0
        )

    def _draw_car(self, view: "View") -> None:
        canvas, size, car = self._canvas, self._size, self._batch.car.chassis

        def placed(points: Array) -> Array:
            return view(self._now[:2] + turned(points, self._now[_YAW]))

        t = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
        rounded = 0.5 * np.sign([np.cos(t), np.sin(t)]).T * np.abs([np.cos(t), np.sin(t)]).T ** 0.4
        extent, ahead = np.array([size.length, size.width]), np.array([size.centre, 0.0])
        body = placed(rounded * extent + ahead)
        canvas.polygon(body, BODY)
        canvas.lines(np.concatenate([body, body[:1]]), OUTLINE, 1.5)
        for window in (_WINDSCREEN, _REAR_WINDOW):
            canvas.polygon(placed(window * extent + ahead), GLASS)
        front, rear = car["front_axle"], -car["rear_axle"]
        for x, y, angle in (
            (front, 0.5 * car["front_track"], self._now[_LEFT]),
            (front, -0.5 * car["front_track"], self._now[_RIGHT]),
            (rear, 0.5 * car["rear_track"], 0.0),
            (rear, -0.5 * car["rear_track"], 0.0),
        ):
            canvas.polygon(placed(turned(_WHEEL, angle) + np.array([x, y])), INK)

    def _draw_dial(self, wanted: float | None) -> None:
        canvas, now = self._canvas, self._now
        left, top, width, height = DIAL
        canvas.field((left + 4, top + 8, 238, height - 16), PANEL)
        centre, angle = (left + 122.0, top + 0.5 * height + 14.0), float(now[_ANGLE])
        canvas.circle(centre, 78.0, INK, 10.0)
        for turn, half in ((0.5 * math.pi, 5.0), (math.pi, 6.0), (-0.5 * math.pi, 5.0)):  # spokes
            along, across = (
                around((0.0, 0.0), 72.0, angle + turn),
                around((0.0, 0.0), half, angle + turn + 0.5 * math.pi),
            )
            canvas.polygon(np.array([across, along + across, along - across, -across]) + centre, INK)
        canvas.circle(centre, 21.0, INK)
        canvas.arc(centre, 73.0, angle - 0.12, angle + 0.12, PANEL, 5.0)  # the mark at the top of the rim
        if wanted is not None:
            canvas.polygon(around(centre, [67.0, 52.0, 52.0], np.array([0.0, 0.13, -0.13]) + wanted), WANTED)
        full = [_full_scale(peak) for peak in self._peaks[1:]]
        for radius, value, scale, colour in ((92.0, now[_TORQUE], full[0], HAND), (109.0, now[_MOTOR], full[1], MOTOR)):
            self._draw_arc(centre, radius, float(value) / scale, colour)
        right = left + width - 16
        rows: list[tuple[str, str, Colour | None, str]] = [
            ("handwheel angle", f"{_signed(math.degrees(angle), 1)} deg", None, ""),
            ("hand torque", f"{_signed(now[_TORQUE], 2)} N m", HAND, f"full arc {full[0]:g} N m"),
            ("motor torque", f"{_signed(now[_MOTOR], 2)} N m", MOTOR, f"full arc {full[1]:g} N m"),
            ("lateral acceleration", f"{_signed(now[_ACCELERATION], 2)} m/s²", None, ""),
        ]
        if wanted is not None:
            rows.insert(1, ("wanted angle", f"{_signed(math.degrees(wanted), 1)} deg", WANTED, ""))
        y = top + 0.5 * height - 0.5 * sum(40 if note else 26 for *_, note in rows) + 13
        for label, words, swatch, note in rows:
            if swatch is not None:
                canvas.text("●", (left + 244, y - 1), swatch, 13)
            canvas.text(label, (left + 260, y), MUTED, 12)
            canvas.text(words, (right, y), INK, 14, align=1.0)
            if note:
                canvas.text(note, (left + 260, y + 15), MUTED, 10)
            y += 40 if note else 26

    def _draw_arc(self, centre: tuple[float, float], radius: float, part: float, colour: Colour) -> None:
        """A torque over full scale as an arc from twelve o'clock; left, and so counter-clockwise, is positive."""
        canvas = self._canvas
        canvas.arc(centre, radius, -_FULL_ARC, _FULL_ARC, GRID, 9.0)
        end = _FULL_ARC * part
        head = math.copysign(min(0.16, abs(end)), end)
        canvas.arc(centre, radius, 0.0, end - head, colour, 6.0)
        canvas.polygon(around(centre, radius + np.array([-6.5, 6.5, 0.0]), [end - head, end - head, end]), colour)
        canvas.lines(around(centre, [radius - 6.0, radius + 6.0], [0.0, 0.0]), MUTED)

    def _draw_loop(self, history: Array) -> None:
        canvas = self._canvas
        left, top, width, height = LOOP[0] + 52, LOOP[1] + 30, LOOP[2] - 72, LOOP[3] - 74
        canvas.field((left - 6, top - 6, width + 12, height + 12), PANEL)
        wanted = history[np.isfinite(history[:, _REFERENCE]), _REFERENCE]
        largest = max(self._peaks[1], np.abs(wanted).max(initial=0.0))
        peaks = np.maximum([math.degrees(self._peaks[0]), largest], [5.0, 1.0])
        middle, scales = np.array([left + 0.5 * width, top + 0.5 * height]), np.empty(2)
        for axis, (length, peak) in enumerate(zip((width, height), peaks.tolist())):
            step = nice_step(peak, 2.0)
            reach = step * math.ceil(1.02 * peak / step)
            scales[axis] = (0.5, -0.5)[axis] * length / reach
            for k in range(-round(reach / step), round(reach / step) + 1):
                value, colour = k * step, GRID if k else GUIDE
                place = middle[axis] + value * scales[axis]
                words = f"{value:g}".replace("-", "−")
                if axis == 0:
                    canvas.segments([(place, top)], [(place, top + height)], colour)
                    canvas.text(words, (place, top + height + 12), MUTED, 11, align=0.5)
                else:
                    canvas.segments([(left, place)], [(left + width, place)], colour)
                    canvas.text(words, (left - 8, place), MUTED, 11, align=1.0)
        canvas.text("hand torque [N m]", (LOOP[0] + 12, LOOP[1] + 14), INK, 12)
        canvas.text(f"last {HISTORY:g} s", (LOOP[0] + LOOP[2] - 20, LOOP[1] + 14), MUTED, 11, align=1.0)
        canvas.text("handwheel angle [deg]", (left + 0.5 * width, LOOP[1] + LOOP[3] - 15), INK, 12, align=0.5)
        points = middle + np.column_stack([np.degrees(history[:, _ANGLE]), history[:, _TORQUE]]) * scales
        ages = np.array_split(np.arange(len(points)), 5)
        for age, places in zip((0.25, 0.4, 0.6, 0.8, 1.0), ages):  # older parts are paler
            if places.size:
                canvas.lines(points[places[0] : places[-1] + 2], mixed(PANEL, HAND, age), 1.5)
        if wanted.size:
            canvas.text("wanted hand torque", (LOOP[0] + LOOP[2] - 96, LOOP[1] + 14), WANTED, 11, align=1.0)
            line = middle + np.column_stack([np.degrees(history[:, _ANGLE]), history[:, _REFERENCE]]) * scales
            known = np.isfinite(line[:, 1])
            for part in np.split(line, np.flatnonzero(np.diff(known)) + 1):  # a gap where no feel is scored
                if np.isfinite(part[0, 1]):
                    canvas.lines(part, WANTED, 1.5)
        canvas.circle(points[-1], 4.5, HAND)


def renderers(batch: EnvironmentBatch, mode: str) -> list[Renderer]:
    """One for each row, which draw on one canvas."""
    canvas = Canvas(WIDTH, HEIGHT)
    return [Renderer(batch, i, mode, canvas) for i in range(batch.n)]


def _feel(task: Task) -> int | None:
    """Place among the metrics of the hand torque's error, in tasks that score it."""
    names = [metric.name for metric in task.metrics]
    return names.index(FEEL_METRIC.name) if FEEL_METRIC.name in names else None


def _full_scale(peak: float) -> float:
    """The smallest of 5, 10, 20, 50, ... that is not below a peak."""
    scale = 5.0
    for factor in (2.0, 2.0, 2.5) * 20:
        if peak <= scale:
            break
        scale *= factor
    return scale


def _signed(value: Any, digits: int, plus: str = "+") -> str:
    """A number with its sign; minus zero becomes zero."""
    return f"{round(float(value), digits) + 0.0:{plus}.{digits}f}".replace("-", "−")
