"""Pictures of an episode: the car on its road from above, the handwheel with its torques, the live torque-angle loop.

Lengths in the picture are in pixels, y downward; the axes of the road are ISO 8855: x forward, y to the left. The car
drives upward, so that left in the picture is left on the road.
"""

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.courses.iso3888 import footprint
from steer_env.engine.batch import EnvironmentBatch
from steer_env.friction.law import law_of
from steer_env.friction.sites import Sites, as_mapping
from steer_env.rendering import panels
from steer_env.rendering.canvas import Canvas
from steer_env.rendering.modes import frame_rate
from steer_env.rendering.panels import HAND, INK, MOTOR, MUTED, PANEL, PAPER, RULE, WANTED, with_sign
from steer_env.rendering.view import extend
from steer_env.tasks.common.definition import NON_FINITE, Task
from steer_env.tasks.common.feel_term import FEEL_METRIC
from steer_env.vehicle.plant import CHANNEL
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

WIDTH, HEIGHT = 960, 540
# Panels: left, top, width, height.
ROAD, DIAL, LOOP = (14, 62, 430, 464), (458, 62, 488, 226), (458, 302, 488, 224)
HISTORY, SPACING = 10.0, 0.01  # length of trace and loop, time between their points [s]

# Channels that are kept for every point of trace and loop, in SI.
_CHANNEL_NAMES = (
    "x", "y", "yaw_angle", "handwheel_angle", "handwheel_torque", "motor_torque", "lateral_acceleration",
    "road_wheel_angle_left", "road_wheel_angle_right",
)  # fmt: skip
_PLACES = [CHANNEL[name] for name in _CHANNEL_NAMES]
_X, _Y, _YAW, _ANGLE, _TORQUE, _MOTOR, _ACCELERATION, _LEFT, _RIGHT = range(len(_CHANNEL_NAMES))
# Place beside them of the hand torque that the task wants; NaN where it wants none [N m]
_REFERENCE = len(_CHANNEL_NAMES)
_HISTORY_PLACES = [_ANGLE, _TORQUE, _MOTOR]

_VIEW_LAG = 1.0  # time constant with which the view turns with the car where there is no path [s]


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
        self._size = footprint(batch.car)
        self._scored = _feel(batch.task)
        self._frames: list[NDArray[np.uint8]] = []
        self._history: deque[Array] = deque(maxlen=round(HISTORY / SPACING))
        self._open = self._window
        self._forget()

    def _forget(self) -> None:
        self._now = np.zeros(1 + len(_CHANNEL_NAMES))
        self._peaks = np.zeros(len(_HISTORY_PLACES))
        self._history.clear()
        self._kept = self._shown = -math.inf  # times of the last point of the trace and of the last frame shown [s]
        self._time = self._heading = self._reward = 0.0
        self._path: Array | None = None

    def start(self) -> None:
        """Begin an episode."""
        self._forget()
        path = self._batch.path(self._row)
        if path is not None:
            self._path = extend(path[:, :3])
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
        np.maximum(self._peaks, np.abs(now[_HISTORY_PLACES]), out=self._peaks)
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
        canvas, now = self._canvas, self._now
        canvas.begin(PAPER)
        for box in (ROAD, DIAL, LOOP):
            canvas.panel(box, PANEL, RULE)
        history = np.array([*self._history, now])
        cones, wanted = self._batch.scenery(self._row)
        self._draw_status()
        self._draw_road(history, cones)
        self._draw_dial(wanted if wanted is not None and math.isfinite(wanted) else None)
        reference = history[:, _REFERENCE]
        largest = max(self._peaks[1], np.abs(reference[np.isfinite(reference)]).max(initial=0.0))
        peaks = np.maximum([math.degrees(self._peaks[0]), largest], [5.0, 1.0])
        angles = np.degrees(history[:, _ANGLE])
        panels.loop(canvas, LOOP, angles, history[:, _TORQUE], peaks, f"last {HISTORY:g} s", reference)

    def _draw_status(self) -> None:
        batch, canvas = self._batch, self._canvas
        episode, action = batch.episodes[self._row], batch.task.action
        canvas.text(batch.task.name, (16, 32), INK, 17, bold=True)
        given = float(episode["action"])
        for x, label, words in (
            (318, "friction", _friction(batch.conditions[self._row].friction)),
            (438, "speed", f"{with_sign(3.6 * float(episode['speed']), 1, plus='')} km/h"),
            (548, "time", f"{self._time:.2f} s"),
            (638, "action", f"{with_sign(given, 2)}  ({with_sign(given * action.scale, 2)} {action.unit})"),
            (842, "reward so far", with_sign(self._reward, 2)),
        ):
            canvas.text(label, (x, 22), MUTED, 11)
            canvas.text(words, (x, 40), INK, 14)

    def _draw_road(self, history: Array, cones: Array | None) -> None:
        path, now, low, heading = self._path, self._now, 0, self._heading
        speed = self._batch.conditions[self._row].speed
        span = min(7.0 + 1.35 * speed, 90.0)  # length of road that the panel's height shows [m]
        share = 0.5 if speed == 0.0 else 0.2 if path is not None else 0.4  # of this length behind the car
        if path is not None:
            nearest = int(np.argmin(np.hypot(*(path[:, :2] - now[:2]).T)))
            low, high = max(nearest - int(span), 0), min(nearest + int(span) + 1, len(path) - 1)
            behind, ahead = (
                path[max(nearest - int(share * span), 0)],
                path[min(nearest + int(0.7 * span), len(path) - 1)],
            )
            heading = math.atan2(ahead[1] - behind[1], ahead[0] - behind[0])
            path = path[low:high]
        road = panels.Road(self._canvas, ROAD, panels.Pose(*now[[_X, _Y, _YAW, _LEFT, _RIGHT]]), heading, span, share)
        road.grid()
        if path is not None:
            if (half := self._batch.task.lane_half_width) is not None:
                road.lane(path, half)
            road.dashes(path[:, :2], low)
        road.trace(history[:, :2])
        if cones is not None:
            road.cones(cones)
        road.car(self._batch.car, self._size)
        road.scale()

    def _draw_dial(self, wanted: float | None) -> None:
        now = self._now
        hand, motor = (
            panels.Arc(float(now[place]), panels.full_scale(peak), colour)
            for place, peak, colour in zip((_TORQUE, _MOTOR), self._peaks[1:].tolist(), (HAND, MOTOR))
        )
        rows = [
            panels.Row("handwheel angle", f"{with_sign(math.degrees(now[_ANGLE]), 1)} deg"),
            panels.Row("hand torque", f"{with_sign(hand.value, 2)} N m", HAND, f"full arc {hand.full:g} N m"),
            panels.Row("motor torque", f"{with_sign(motor.value, 2)} N m", MOTOR, f"full arc {motor.full:g} N m"),
            panels.Row("lateral acceleration", f"{with_sign(now[_ACCELERATION], 2)} m/s²"),
        ]
        if wanted is not None:
            rows.insert(1, panels.Row("wanted angle", f"{with_sign(math.degrees(wanted), 1)} deg", WANTED))
        panels.dial(self._canvas, DIAL, float(now[_ANGLE]), (hand, motor), rows, wanted)


def renderers(batch: EnvironmentBatch, mode: str) -> list[Renderer]:
    """One for each row, which draw on one canvas."""
    canvas = Canvas(WIDTH, HEIGHT)
    return [Renderer(batch, i, mode, canvas) for i in range(batch.n)]


def _feel(task: Task) -> int | None:
    """Place among the metrics of the hand torque's error, in tasks that score it."""
    names = [metric.name for metric in task.metrics]
    return names.index(FEEL_METRIC.name) if FEEL_METRIC.name in names else None


def _friction(p: Any) -> str:
    """The friction in a few words: a law, or the laws of several sites."""
    if not isinstance(p, Sites):
        return law_of(p).name
    given = as_mapping(p).values()
    return f"{', '.join(dict.fromkeys(own['law'] for own in given))}, {len(given)} sites"
