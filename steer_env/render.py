"""Frames of an episode: the car on its road from above, and the live loop of hand torque over handwheel angle."""

from collections import deque

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from steer_env.tasks import LaneKeeping
from vehicle.plant import CHANNEL

AHEAD = 60.0  # shown in front of the car [m]
_CAR = np.array([[-1.9, -0.84], [2.0, -0.84], [2.4, -0.5], [2.4, 0.5], [2.0, 0.84], [-1.9, 0.84]])  # outline [m]


class Renderer:
    """Draws off screen, without a window system."""

    def __init__(self) -> None:
        self._trace: deque[tuple[float, ...]] = deque(maxlen=1000)
        figure = Figure(figsize=(9.0, 4.5), dpi=80, layout="constrained")
        self._canvas = FigureCanvasAgg(figure)
        self._road, self._loop = figure.subplots(1, 2, width_ratios=(3, 2))

    def clear(self) -> None:
        """Forget the episode."""
        self._trace.clear()

    def add(self, row: NDArray[np.float64]) -> None:
        """Take in a row of plant channels."""
        names = ("x", "y", "yaw_angle", "handwheel_angle", "handwheel_torque", "lateral_acceleration")
        self._trace.append(tuple(float(row[CHANNEL[name]]) for name in names))

    def frame(self, path: NDArray[np.float64] | None) -> NDArray[np.uint8]:
        """The picture (360, 720, 3) now."""
        x, y, yaw, angle, torque, acceleration = self._trace[-1] if self._trace else (0.0,) * 6
        trace = np.array(self._trace) if self._trace else np.zeros((1, 6))
        angles, torques = np.degrees(trace[:, 3]), trace[:, 4]
        reach = max(10.0, 1.1 * np.abs(angles).max()), max(2.0, 1.1 * np.abs(torques).max())
        road, loop = self._road, self._loop
        road.clear()
        road.set(
            xlim=(x - 15.0, x + AHEAD), ylim=(y - 18.75, y + 18.75), aspect="equal", xlabel="x [m]", ylabel="y [m]"
        )
        if path is not None:
            x_path, y_path, direction = path[:, :3].T
            edge = LaneKeeping.lane_half_width
            for side, style in zip((-edge, 0.0, edge), "-:-"):
                road.plot(
                    x_path - side * np.sin(direction), y_path + side * np.cos(direction), style, color="0.6", lw=1.2
                )
        road.plot(trace[:, 0], trace[:, 1], color="tab:blue", lw=1.0)
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        road.add_patch(Polygon(_CAR @ turn.T + (x, y), color="tab:blue"))
        road.set_title(f"lateral acceleration {acceleration:+.2f} m/s²", fontsize=10)
        loop.clear()
        loop.plot(angles, torques, color="tab:orange", lw=1.0)
        loop.plot(np.degrees(angle), torque, "o", color="tab:red")
        loop.set(xlim=(-reach[0], reach[0]), ylim=(-reach[1], reach[1]))
        loop.set(xlabel="handwheel angle [deg]", ylabel="hand torque [N m]")
        loop.set_title(f"{np.degrees(angle):+.1f} deg, {torque:+.2f} N m", fontsize=10)
        loop.grid(alpha=0.3)
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()
