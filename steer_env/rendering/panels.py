"""The panels of a picture, drawn from plain numbers: road and car, handwheel with its torques, torque over angle.

Lengths in the picture are in pixels, y downward; the axes of the road are ISO 8855: x forward, y to the left. The car
drives upward, so that left in the picture is left on the road.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.courses.iso3888 import Footprint
from steer_env.rendering.canvas import Box, Canvas, Colour, mix, nice_step, polar_points
from steer_env.rendering.view import View, rotate
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

PAPER, PANEL, RULE, GRID = (244, 245, 248), (255, 255, 255), (208, 213, 221), (235, 238, 243)
INK, MUTED = (31, 41, 55), (107, 114, 128)
SURFACE, EDGE, GUIDE = (229, 232, 238), (140, 149, 163), (176, 184, 197)
BODY, OUTLINE, GLASS, TRACE = (112, 135, 174), (55, 71, 99), (222, 231, 243), (150, 170, 205)
HAND, MOTOR, WANTED = (37, 99, 235), (13, 148, 136), (168, 50, 210)
CONE, TOUCHED = (245, 130, 32), (190, 18, 60)
# Of the loops of several sets, as many as there are keys for; they differ in lightness as well as in hue.
COLOURS: tuple[Colour, ...] = (
    *(HAND, (217, 93, 14), (22, 128, 80), (126, 58, 160), (120, 90, 60), (90, 100, 120)),
    *((219, 39, 119), (202, 160, 10), (20, 30, 40)),
)

_FULL_ARC = math.radians(120.0)  # angle of an arc at full scale
_WHEEL = np.array([[0.31, 0.1], [0.31, -0.1], [-0.31, -0.1], [-0.31, 0.1]])  # of a 205/60 R15 tyre [m]
_WINDSCREEN = np.array([[0.17, 0.40], [0.17, -0.40], [0.04, -0.33], [0.04, 0.33]])  # over the car's length and width
_REAR_WINDOW = np.array([[-0.28, 0.29], [-0.28, -0.29], [-0.37, -0.33], [-0.37, 0.33]])


class Pose(NamedTuple):
    """Where a car is, and how its front wheels stand."""

    x: float  # [m]
    y: float  # [m]
    yaw: float  # [rad]
    left: float  # angle of the left front wheel [rad]
    right: float  # of the right one [rad]


class Arc(NamedTuple):
    """A torque as an arc around the handwheel."""

    value: float  # [N m]
    full: float  # at which the arc is full [N m]
    colour: Colour


class Row(NamedTuple):
    """A line of words beside the handwheel."""

    label: str
    words: str
    swatch: Colour | None = None
    note: str = ""


class Road:
    """A view of the road in a box, from ``share`` of its height behind the car; ``span`` [m] is the whole height.

    Its methods draw one thing each, later ones above earlier ones.
    """

    def __init__(self, canvas: Canvas, box: Box, pose: Pose, heading: float, span: float, share: float) -> None:
        left, top, width, height = box
        self._canvas, self._box, self._pose, self._span = canvas, box, pose, span
        canvas.field((left + 1, top + 1, width - 2, height - 2), PANEL)
        self._focus = np.array([pose.x, pose.y])
        self.view = View((left + 0.5 * width, top + (1.0 - share) * height), height / span, self._focus, heading)

    def grid(self) -> None:
        """Lines at even distances."""
        now, step = self._focus, nice_step(self._span, 5.0)
        reach = 1.5 * self._span
        for axis in (0, 1):
            at = step * np.arange(math.ceil((now[axis] - reach) / step), (now[axis] + reach) / step)
            starts, ends = np.empty((2, at.size, 2))
            starts[:, axis] = ends[:, axis] = at
            starts[:, 1 - axis], ends[:, 1 - axis] = now[1 - axis] - reach, now[1 - axis] + reach
            self._canvas.segments(self.view(starts), self.view(ends), GRID)

    def lane(self, path: Array, half: float) -> None:
        """Surface and edges of a lane along a path (P, 3) of x, y, direction; ``half`` its width [m]."""
        points, normal = path[:, :2], np.column_stack([-np.sin(path[:, 2]), np.cos(path[:, 2])])
        edges = [self.view(points + side * half * normal) for side in (1.0, -1.0)]
        self._canvas.polygon(np.concatenate([edges[0], edges[1][::-1]]), SURFACE)
        for edge in edges:
            self._canvas.lines(edge, EDGE, 2.0)

    def dashes(self, points: Array, first: int) -> None:
        """A dashed line through points (P, 2) one metre apart; ``first`` is the number of those before them."""
        seen = self.view(points)
        starts = np.arange(-first % 3, len(seen) - 1, 3)  # fixed to the road
        self._canvas.segments(seen[starts], seen[starts + 1], GUIDE, 1.5)

    def trace(self, points: Array) -> None:
        """The way (N, 2) that the car has come [m]."""
        near = points[np.abs(points - self._focus).max(axis=1) < 2.0 * self._span]
        self._canvas.lines(self.view(near), TRACE, 2.0)

    def cones(self, cones: Array) -> None:
        """Cones (N, 3): x, y [m], and above zero where they were touched."""
        canvas, view, (left, top, width, height) = self._canvas, self.view, self._box
        radius = max(0.2 * view.scale, 3.5)
        for place, touched in zip(view(cones[:, :2]), cones[:, 2] > 0.0):
            if abs(place - view.centre).max() > max(width, height) + radius:
                continue
            canvas.circle(place, radius, TOUCHED if touched else CONE)
            if touched:
                arm = (radius + 2.0) * np.array([[1.0, 1.0], [1.0, -1.0]])
                canvas.segments(place - arm, place + arm, TOUCHED, 1.5)
        hit = int(cones[:, 2].sum())
        words = f"{hit} of {len(cones)} cones touched"
        canvas.text(words, (left + width - 12, top + height - 16), TOUCHED if hit else MUTED, 12, align=1.0)

    def car(self, car: Car, size: Footprint) -> None:
        """The car from above, with its wheels."""
        canvas, view, pose, data = self._canvas, self.view, self._pose, car.chassis

        def placed(points: Array) -> Array:
            return view(self._focus + rotate(points, pose.yaw))

        t = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
        rounded = 0.5 * np.sign([np.cos(t), np.sin(t)]).T * np.abs([np.cos(t), np.sin(t)]).T ** 0.4
        extent, ahead = np.array([size.length, size.width]), np.array([size.centre, 0.0])
        body = placed(rounded * extent + ahead)
        canvas.polygon(body, BODY)
        canvas.lines(np.concatenate([body, body[:1]]), OUTLINE, 1.5)
        for window in (_WINDSCREEN, _REAR_WINDOW):
            canvas.polygon(placed(window * extent + ahead), GLASS)
        front, rear = data["front_axle"], -data["rear_axle"]
        for x, y, angle in (
            (front, 0.5 * data["front_track"], pose.left),
            (front, -0.5 * data["front_track"], pose.right),
            (rear, 0.5 * data["rear_track"], 0.0),
            (rear, -0.5 * data["rear_track"], 0.0),
        ):
            canvas.polygon(placed(rotate(_WHEEL, angle) + np.array([x, y])), INK)

    def scale(self) -> None:
        """A bar of a known length at the lower edge."""
        left, top, _, height = self._box
        bar = nice_step(self._span, 5.0)
        end = left + 14 + bar * self.view.scale
        y = top + height - 16
        self._canvas.segments(
            [(left + 14, y), (left + 14, y - 4), (end, y - 4)], [(end, y), (left + 14, y + 4), (end, y + 4)], INK
        )
        self._canvas.text(f"{bar:g} m", (end + 8, y), INK, 12)


def dial(
    canvas: Canvas, box: Box, angle: float, arcs: Sequence[Arc], rows: Sequence[Row], wanted: float | None = None
) -> None:
    """The handwheel at an angle [rad] with torques around it, a mark at a wanted angle [rad], and words beside it."""
    left, top, width, height = box
    canvas.field((left + 4, top + 8, 238, height - 16), PANEL)
    centre = (left + 122.0, top + 0.5 * height + 14.0)
    canvas.circle(centre, 78.0, INK, 10.0)
    for turn, half in ((0.5 * math.pi, 5.0), (math.pi, 6.0), (-0.5 * math.pi, 5.0)):  # spokes
        along, across = (
            polar_points((0.0, 0.0), 72.0, angle + turn),
            polar_points((0.0, 0.0), half, angle + turn + 0.5 * math.pi),
        )
        canvas.polygon(np.array([across, along + across, along - across, -across]) + centre, INK)
    canvas.circle(centre, 21.0, INK)
    canvas.arc(centre, 73.0, angle - 0.12, angle + 0.12, PANEL, 5.0)  # the mark at the top of the rim
    if wanted is not None:
        canvas.polygon(polar_points(centre, [67.0, 52.0, 52.0], np.array([0.0, 0.13, -0.13]) + wanted), WANTED)
    for radius, arc in zip((92.0, 109.0), arcs):
        _draw_arc(canvas, centre, radius, arc.value / arc.full, arc.colour)
    right = left + width - 16
    y = top + 0.5 * height - 0.5 * sum(40 if row.note else 26 for row in rows) + 13
    for row in rows:
        if row.swatch is not None:
            canvas.text("●", (left + 244, y - 1), row.swatch, 13)
        canvas.text(row.label, (left + 260, y), MUTED, 12)
        canvas.text(row.words, (right, y), INK, 14, align=1.0)
        if row.note:
            canvas.text(row.note, (left + 260, y + 15), MUTED, 10)
        y += 40 if row.note else 26


def _draw_arc(canvas: Canvas, centre: tuple[float, float], radius: float, part: float, colour: Colour) -> None:
    """A torque over full scale as an arc from twelve o'clock; left, and so counter-clockwise, is positive."""
    canvas.arc(centre, radius, -_FULL_ARC, _FULL_ARC, GRID, 9.0)
    end = _FULL_ARC * part
    head = math.copysign(min(0.16, abs(end)), end)
    canvas.arc(centre, radius, 0.0, end - head, colour, 6.0)
    canvas.polygon(polar_points(centre, radius + np.array([-6.5, 6.5, 0.0]), [end - head, end - head, end]), colour)
    canvas.lines(polar_points(centre, [radius - 6.0, radius + 6.0], [0.0, 0.0]), MUTED)


def loop(
    canvas: Canvas,
    box: Box,
    angles: Array,
    torques: Array,
    peaks: ArrayLike,
    note: str,
    wanted: Array | None = None,
    ages: Sequence[float] = (0.25, 0.4, 0.6, 0.8, 1.0),
    sets: NDArray[np.int64] | None = None,
    title: str = "hand torque",
) -> None:
    """A torque over the handwheel angle, paler where it is older.

    Parameters
    ----------
    canvas : Canvas
    box : Box
    angles : (N,) array
        [deg]
    torques : (N,) array
        [N m]
    peaks : (2,) array
        Largest angle [deg] and torque [N m] that the axes show at least.
    note : str
        Words at the upper right, on the length of time.
    wanted : (N,) array, optional
        Wanted hand torque, NaN where there is none [N m].
    ages : sequence of float
        Strength of the line, from its oldest part to its newest [1].
    sets : (N,) array, optional
        Number of the colour in ``COLOURS`` of each point; by default the first.
    title : str
        Which torque it is.
    """
    left, top, width, height = box[0] + 52, box[1] + 30, box[2] - 72, box[3] - 74
    canvas.field((left - 6, top - 6, width + 12, height + 12), PANEL)
    middle, scales = np.array([left + 0.5 * width, top + 0.5 * height]), np.empty(2)
    for axis, (length, peak) in enumerate(zip((width, height), np.asarray(peaks, float).tolist())):
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
    canvas.text(f"{title} [N m]", (box[0] + 12, box[1] + 14), INK, 12)
    canvas.text(note, (box[0] + box[2] - 20, box[1] + 14), MUTED, 11, align=1.0)
    canvas.text("handwheel angle [deg]", (left + 0.5 * width, box[1] + box[3] - 15), INK, 12, align=0.5)
    points = middle + np.column_stack([angles, torques]) * scales
    of_set = np.zeros(len(points), np.int64) if sets is None else sets
    for age, places in zip(ages, np.array_split(np.arange(len(points)), len(ages))):
        for part in np.split(places, np.flatnonzero(np.diff(of_set[places])) + 1):
            if part.size:
                colour = COLOURS[of_set[part[0]] % len(COLOURS)]
                canvas.lines(points[part[0] : part[-1] + 2], mix(PANEL, colour, age), 1.5)
    if wanted is not None and np.isfinite(wanted).any():
        canvas.text("wanted hand torque", (box[0] + box[2] - 96, box[1] + 14), WANTED, 11, align=1.0)
        line = middle + np.column_stack([angles, wanted]) * scales
        known = np.isfinite(line[:, 1])
        for gap in np.split(line, np.flatnonzero(np.diff(known)) + 1):  # a gap where no feel is scored
            if np.isfinite(gap[0, 1]):
                canvas.lines(gap, WANTED, 1.5)
    canvas.circle(points[-1], 4.5, COLOURS[of_set[-1] % len(COLOURS)])


def full_scale(peak: float) -> float:
    """The smallest of 5, 10, 20, 50, ... that is not below a peak."""
    scale = 5.0
    for factor in (2.0, 2.0, 2.5) * 20:
        if peak <= scale:
            break
        scale *= factor
    return scale


def with_sign(value: Any, digits: int, plus: str = "+") -> str:
    """A number with its sign; minus zero becomes zero."""
    return f"{round(float(value), digits) + 0.0:{plus}.{digits}f}".replace("-", "−")
