"""Lane-change courses: gates and cones after ISO 3888-1 and ISO 3888-2, a path through them, and distances to cones.

Axes of a course: x along the entry lane from its first cone, y to the left from the entry lane's centre line. The side
lane lies to the left, or to the right on a mirrored course. The lanes' limits touch the cones' bases (ISO 3888-2:2011,
4.2), so a cone is represented by the point of its base that is nearest to the lane.

Sources, all secondary: lengths, widths and offsets as in public implementations (Project Chrono's double lane change,
CommonRoad's controllers). For ISO 3888-2 the offset is the gap between the edges of entry and side lane, and the edges
of entry and exit lane on that side are in line. For ISO 3888-1 implementations differ; here right edges are 3.5 m apart
and those of entry and exit lane in line: assumed. So is the spacing of the cones.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import number
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

# The default edition comes first.
EDITIONS = {"double-lane-change": ("2018", "1999"), "obstacle-avoidance": ("2011", "2002")}
CONE_SPACING = {"double-lane-change": 5.0, "obstacle-avoidance": 3.0}  # largest distance of cones, assumed [m]
EXIT_WIDTH = 3.0  # least width of the exit lane in ISO 3888-2:2011 [m]
TYRE_WIDTH, OVERHANGS = 0.205, 1.75  # for a car whose data have no overall size; assumed [m]


class Gate(NamedTuple):
    """A lane between two rows of cones."""

    start: float  # [m]
    end: float  # [m]
    right: float  # edge [m]
    left: float  # edge [m]


class Course(NamedTuple):
    """Gates in driving order, and the cones beside them."""

    gates: tuple[Gate, ...]
    left: Array  # x, y of the cones to the left of the lanes (N, 2) [m]
    right: Array  # x, y of the cones to the right of the lanes (N, 2) [m]

    @property
    def length(self) -> float:
        """From the first cone to the last [m]."""
        return self.gates[-1].end


class Footprint(NamedTuple):
    """The car seen from above: a rectangle."""

    length: float  # [m]
    width: float  # [m]
    centre: float  # distance of the rectangle's centre ahead of the centre of gravity [m]


def footprint(car: Car) -> Footprint:
    """Overall size of a car around its centre of gravity, with equal overhangs; assumed.

    Without a ``length`` or ``width`` in the car's data, the wheelbase or the wider track plus an assumed value is used.
    """
    c = car.chassis
    return Footprint(
        c.get("length", c["front_axle"] + c["rear_axle"] + OVERHANGS),
        c.get("width", max(c["front_track"], c["rear_track"]) + TYRE_WIDTH),
        0.5 * (c["front_axle"] - c["rear_axle"]),
    )


def course(manoeuvre: str, width: float, edition: str | None = None, mirrored: bool = False) -> Course:
    """The course for a car.

    Parameters
    ----------
    manoeuvre : {"double-lane-change", "obstacle-avoidance"}
    width : float
        Of the car, without mirrors [m].
    edition : str, optional
        Of the standard; the latest by default. ISO 3888-1: "2018" or "1999", equal in all sources seen. ISO 3888-2:
        "2011", whose exit lane is at least 3 m wide, or "2002".
    mirrored : bool
        Whether the side lane lies to the right.

    Raises
    ------
    ValueError
        The manoeuvre or the edition is unknown, or the width is out of range.
    """
    if manoeuvre not in EDITIONS:
        raise ValueError(f"no course for {manoeuvre!r}; there are {', '.join(EDITIONS)}")
    edition = EDITIONS[manoeuvre][0] if edition is None else str(edition)
    if edition not in EDITIONS[manoeuvre]:
        raise ValueError(f"{manoeuvre} has no edition {edition!r}; there are {', '.join(EDITIONS[manoeuvre])}")
    w = number("vehicle width [m]", width, minimum=0.5, maximum=3.0)
    entry, exit_ = 1.1 * w + 0.25, 1.3 * w + 0.25
    edge = 0.5 * entry
    if manoeuvre == "double-lane-change":
        side, offset = 1.2 * w + 0.25, 3.5
        gates = [
            Gate(0.0, 15.0, -edge, edge),
            Gate(45.0, 70.0, offset - edge, offset - edge + side),
            Gate(95.0, 110.0, -edge, exit_ - edge),
            Gate(110.0, 125.0, -edge, exit_ - edge),
        ]
    else:
        side, gap = w + 1.0, 1.0
        exit_ = max(exit_, EXIT_WIDTH) if edition == "2011" else exit_
        gates = [
            Gate(0.0, 12.0, -edge, edge),
            Gate(25.5, 36.5, edge + gap, edge + gap + side),
            Gate(49.0, 61.0, edge - exit_, edge),
        ]
    rows = [_row(gate, CONE_SPACING[manoeuvre]) for gate in gates]
    left, right = (
        np.unique([(x, edge) for row, edge in zip(rows, edges) for x in row], axis=0)
        for edges in ([gate.left for gate in gates], [gate.right for gate in gates])
    )
    if mirrored:
        gates = [Gate(gate.start, gate.end, -gate.left, -gate.right) for gate in gates]
        left, right = right * [1.0, -1.0], left * [1.0, -1.0]
    return Course(tuple(gates), left, right)


def _row(gate: Gate, spacing: float) -> Array:
    return np.linspace(gate.start, gate.end, math.ceil((gate.end - gate.start) / spacing) + 1)


def cone_margins(cones: Array, car: Footprint, x: Array, y: Array, yaw: Array) -> Array:
    """Distances of cones from the car's outline, negative inside it.

    Parameters
    ----------
    cones : (..., 2) array
        x, y of cones in the course's axes [m].
    car : Outline
    x, y, yaw : arrays that broadcast with (...,)
        Position [m] and direction [rad] of the car in the course's axes.

    Returns
    -------
    (...,) array
        [m]
    """
    ahead, left = cones[..., 0] - x, cones[..., 1] - y
    c, s = np.cos(yaw), np.sin(yaw)
    past_end = np.abs(c * ahead + s * left - car.centre) - 0.5 * car.length
    past_side = np.abs(c * left - s * ahead) - 0.5 * car.width
    outside = np.hypot(np.maximum(past_end, 0.0), np.maximum(past_side, 0.0))
    return np.where(outside > 0.0, outside, np.maximum(past_end, past_side))


SPACING = 1.0  # of the stations of a path [m]
RUN_IN, RUN_OUT = 15.0, 15.0  # distance before and after the course in which the path may curve, assumed [m]
STRAIGHT = 300.0  # length of the straight lines before and after that [m]
KEPT_CLEARANCE = 0.5  # share of a lane's clearance beside the car that the path keeps, assumed [1]


def path(course: Course, car: Footprint) -> Array:
    """The smoothest path of the centre of gravity that takes the car's outline through the gates.

    The path minimises the integral of y'''^2 over x, which gives a quintic spline. The outline lies along the path's
    tangent and keeps a share of each lane's clearance at each cone. (Quintic steps from centre line to centre line
    within the transitions would need 11 and 15 m/s2 at 80 km/h: drivers use the lanes' width and length.) The quadratic
    programme is a least-distance problem, solved by non-negative least squares: Lawson, Hanson, Solving Least Squares
    Problems, 1974, chapter 23.

    Returns
    -------
    (N, 2) array
        x, y in the course's axes, with long straight lines before and after it [m].

    Raises
    ------
    ValueError
        The car does not fit through the gates.
    """
    from scipy import optimize  # here, because importing it takes longer than starting an environment

    # A mirrored course is solved as its image and the path mirrored back, so that both are bit-identical.
    mirrored = course.gates[1].left + course.gates[1].right < 0.0
    gates = [Gate(g.start, g.end, -g.left, -g.right) if mirrored else g for g in course.gates]
    x = np.arange(-RUN_IN, course.length + RUN_OUT + 0.5 * SPACING, SPACING)
    n = x.size - 1
    # Matrices from the third derivative (n,) between the stations to y, y' and y'' at the stations, zero at the first.
    y, slope, bend = (np.zeros((n + 1, n)) for _ in range(3))
    for i in range(n):
        bend[i + 1], slope[i + 1] = bend[i], slope[i] + SPACING * bend[i]
        y[i + 1] = y[i] + SPACING * slope[i] + SPACING**2 / 2.0 * bend[i]
        bend[i + 1, i], slope[i + 1, i], y[i + 1, i] = SPACING, SPACING**2 / 2.0, SPACING**3 / 6.0
    rows = [slope[-1], -slope[-1], bend[-1], -bend[-1]]  # G z >= h
    least = [0.0] * 4
    for gate in gates:
        clearance = gate.left - gate.right - car.width
        if clearance <= 0.0:
            raise ValueError(f"a car {car.width:g} m wide does not pass a lane of {gate.left - gate.right:g} m")
        half = 0.5 * car.width + 0.5 * KEPT_CLEARANCE * clearance
        for cone in _row(gate, SPACING):
            beside = np.flatnonzero(np.abs(cone - x - car.centre) <= 0.5 * car.length)
            sides = y[beside] + (cone - x[beside, None]) * slope[beside]
            rows += [*sides, *-sides]
            least += [gate.right + half] * beside.size + [half - gate.left] * beside.size
    # In units of the third derivative's order of magnitude; otherwise the programme is badly scaled.
    scale = 1e-3
    E = np.vstack([scale * np.array(rows).T, least])
    size = np.linalg.norm(E, axis=0)
    size[size == 0.0] = 1.0
    u, _ = optimize.nnls(E / size, np.append(np.zeros(n), 1.0), maxiter=30 * E.shape[1])
    r = (E / size) @ u
    r[-1] -= 1.0
    if abs(r[-1]) < 1e-12:
        raise ValueError(f"no path takes a car of {car.length:g} m by {car.width:g} m through the gates")
    z = -scale * r[:-1] / r[-1]
    found = y @ z
    ends = [(x[0] - STRAIGHT, 0.0)], [(x[-1] + STRAIGHT, found[-1])]
    points = np.concatenate([ends[0], np.column_stack([x, found]), ends[1]])
    return points * [1.0, -1.0] if mirrored else points
