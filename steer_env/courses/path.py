"""A path to follow: curvature over arc length, integrated to a curve, and the kernel that locates the car on it."""

import math

import numpy as np
from numpy.typing import NDArray

from steer_env.courses.preview import AHEAD, HEADING_ERROR, LATERAL_OFFSET
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel

SPACING = 1.0  # of the path's points [m]
_WAVELENGTHS = (80.0, 120.0, 180.0, 270.0, 400.0)  # of a winding road [m]

# Columns of a path, an array (N, 4) of points one metre apart: position [m], direction [rad], curvature [1/m].
_X, _Y, _YAW, CURVATURE = range(4)


def from_curvature(curvature: NDArray[np.float64]) -> NDArray[np.float64]:
    """Curve that starts at the origin along x, with curvatures (N,) [1/m] one metre apart and linear between them.

    Returns
    -------
    (N, 4) array
        x, y [m], direction [rad] and curvature [1/m], left positive.
    """
    path = np.zeros((len(curvature), 4))
    path[:, CURVATURE] = curvature
    _integrate(path)
    return path


@kernel
def _integrate(path):
    """Fill position and direction of a path whose curvature is given and whose first point is the origin."""
    c, s = 1.0, 0.0
    for i in range(path.shape[0] - 1):
        here, there = path[i, CURVATURE], path[i + 1, CURVATURE]
        middle = path[i, _YAW] + SPACING * (3.0 * here + there) / 8.0  # of a clothoid
        end = path[i, _YAW] + SPACING * (here + there) / 2.0
        c_end, s_end = math.cos(end), math.sin(end)
        # Simpson's rule
        path[i + 1, _X] = path[i, _X] + SPACING * (c + 4.0 * math.cos(middle) + c_end) / 6.0
        path[i + 1, _Y] = path[i, _Y] + SPACING * (s + 4.0 * math.sin(middle) + s_end) / 6.0
        path[i + 1, _YAW] = end
        c, s = c_end, s_end


def winding(rng: np.random.Generator, length: float, peak: float) -> NDArray[np.float64]:
    """Random road: curvature as a sum of sines of 80 to 400 m with random phases, bounded by ``peak`` [1/m].

    The road starts straight: the curvature grows from zero over the first 50 m.
    """
    curvature = np.zeros(math.ceil(length / SPACING) + 1)
    for wavelength, phase in zip(_WAVELENGTHS, rng.uniform(0.0, 2.0 * math.pi, len(_WAVELENGTHS)).tolist()):
        _add_sine(curvature, peak * wavelength / sum(_WAVELENGTHS), 2.0 * math.pi * SPACING / wavelength, phase)
    begins = curvature[: round(50.0 / SPACING)]
    begins *= np.linspace(0.0, 1.0, len(begins), endpoint=False)
    return from_curvature(curvature)


@kernel
def _add_sine(values, amplitude, step, phase):
    """Add a sine with an angle [rad] between neighbours: a complex number that turns by it, 1e-13 exact over 1,000."""
    s, c = math.sin(phase), math.cos(phase)
    s_step, c_step = math.sin(step), math.cos(step)
    for i in range(values.size):
        values[i] += amplitude * s
        s, c = s * c_step + c * s_step, c * c_step - s * s_step


def path_through_points(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """A path (N, 4), as :func:`from_curvature` gives it, along a cubic spline through points (M, 2) [m]."""
    from scipy import interpolate  # here, because importing it takes longer than starting an environment

    chord = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    spline = interpolate.CubicSpline(chord, points)
    fine = np.linspace(0.0, chord[-1], 1 + int(10.0 * chord[-1] / SPACING))
    speed = np.hypot(*spline(fine, 1).T)
    length = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(fine) * (speed[1:] + speed[:-1]))))
    u = np.interp(np.arange(0.0, length[-1], SPACING), length, fine)
    (x1, y1), (x2, y2) = spline(u, 1).T, spline(u, 2).T
    return np.column_stack((spline(u), np.arctan2(y1, x1), (x1 * y2 - y1 * x2) / np.hypot(x1, y1) ** 3))


@kernel
def locate(path, x, y, yaw, guess, step, out):
    """Locate a car relative to a path, and the path ahead relative to the car.

    Parameters
    ----------
    path : (N, 4) array
        As from :func:`from_curvature`.
    x, y, yaw : float
        Position [m] and direction [rad] of the car.
    guess : float
        Arc length near which the search starts [m]: the last result, or zero.
    step : float
        Distance between the points ahead; the first is one step away [m].
    out : (2 + K,) array
        Receives the lateral offset, positive where the car is left of the path [m], the heading error [rad], and the
        lateral positions of K points of the path ahead, positive to the left of the car's axis [m].

    Returns
    -------
    float
        Arc length of the nearest point [m].
    """
    last = path.shape[0] - 1
    i = within(int(guess / SPACING), 0, last)
    along = 0.0
    back = False
    for _ in range(path.shape[0]):
        c, s = math.cos(path[i, _YAW]), math.sin(path[i, _YAW])
        along = (x - path[i, _X]) * c + (y - path[i, _Y]) * s
        # Outside a curve a car may be beyond the metre of one point and before the next: it is between them.
        if along >= SPACING and i < last and not back:
            i += 1
        elif along < 0.0 and i > 0:
            i -= 1
            back = True
        else:
            break
    part = within(along, 0.0, SPACING)
    k = path[i, CURVATURE]
    # On an arc with the point's curvature the direction changes linearly and the offset from the tangent quadratically.
    c, s = math.cos(path[i, _YAW]), math.sin(path[i, _YAW])
    across = (y - path[i, _Y]) * c - (x - path[i, _X]) * s
    out[LATERAL_OFFSET] = across - 0.5 * k * part * part
    error = yaw - path[i, _YAW] - k * part
    out[HEADING_ERROR] = error - 2.0 * math.pi * math.floor(error / (2.0 * math.pi) + 0.5)
    position = SPACING * i + along
    c_car, s_car = math.cos(yaw), math.sin(yaw)
    for j in range(out.size - AHEAD):
        # After the last point the path continues straight.
        ahead = within(position + (j + 1) * step, 0.0, math.inf)
        n = within(int(ahead / SPACING), 0, last)
        part = ahead - SPACING * n
        k = path[n, CURVATURE] if n < last else 0.0
        c, s = math.cos(path[n, _YAW]), math.sin(path[n, _YAW])
        left = 0.5 * k * part * part
        to_x, to_y = path[n, _X] + part * c - left * s - x, path[n, _Y] + part * s + left * c - y
        out[AHEAD + j] = to_y * c_car - to_x * s_car
    return position
