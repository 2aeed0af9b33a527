"""A path to follow: curvature over arc length, integrated to a curve, and the kernel that finds the car on it."""

import math

import numpy as np
from numpy.typing import NDArray

from friction.kernel import kernel

SPACING = 1.0  # of the path's points [m]


# Columns of a path, an array (N, 4) of points one metre apart: position [m], direction [rad], curvature [1/m].
_X, _Y, _YAW, _CURVATURE = range(4)


def from_curvature(curvature: NDArray[np.float64]) -> NDArray[np.float64]:
    """Curve from the origin along x with the given curvatures (N,) [1/m], one metre apart and linear between.

    Returns
    -------
    (N, 4) array
        x, y [m], direction [rad] and curvature [1/m], left positive.
    """
    yaw = np.concatenate(([0.0], np.cumsum(0.5 * SPACING * (curvature[1:] + curvature[:-1]))))
    middle = yaw[:-1] + SPACING * (3.0 * curvature[:-1] + curvature[1:]) / 8.0  # of a clothoid
    # Simpson's rule over each interval
    dx = SPACING * (np.cos(yaw[:-1]) + 4.0 * np.cos(middle) + np.cos(yaw[1:])) / 6.0
    dy = SPACING * (np.sin(yaw[:-1]) + 4.0 * np.sin(middle) + np.sin(yaw[1:])) / 6.0
    x, y = (np.concatenate(([0.0], np.cumsum(d))) for d in (dx, dy))
    return np.column_stack((x, y, yaw, curvature))


def winding(rng: np.random.Generator, length: float, peak: float) -> NDArray[np.float64]:
    """Random road: curvature as a sum of sines of 80 to 400 m with random phases, bounded by ``peak`` [1/m].

    It starts straight: the first 50 m grow from zero curvature.
    """
    s = np.arange(0.0, length + SPACING, SPACING)
    wavelengths = np.array([80.0, 120.0, 180.0, 270.0, 400.0])
    weights = wavelengths / wavelengths.sum()
    phases = rng.uniform(0.0, 2.0 * np.pi, wavelengths.size)
    curvature = peak * np.sin(2.0 * np.pi * s[:, None] / wavelengths + phases) @ weights
    return from_curvature(curvature * np.clip(s / 50.0, 0.0, 1.0))


@kernel
def locate(path, x, y, yaw, guess, preview, out):
    """Where a car stands on a path.

    Parameters
    ----------
    path : (N, 4) array
        As from :func:`from_curvature`.
    x, y, yaw : float
        Position [m] and direction [rad] of the car.
    guess : float
        Arc length near which to look [m]; the last result, or zero.
    preview : (K,) array
        Distances ahead at which the curvature is wanted [m].
    out : (2 + K,) array
        Receives lateral offset (left of the path positive) [m], heading error [rad], curvatures ahead [1/m].

    Returns
    -------
    float
        Arc length of the nearest point [m].
    """
    last = path.shape[0] - 1
    i = min(max(int(guess / SPACING), 0), last)
    along = 0.0
    for _ in range(path.shape[0]):
        c, s = math.cos(path[i, _YAW]), math.sin(path[i, _YAW])
        along = (x - path[i, _X]) * c + (y - path[i, _Y]) * s
        if along >= SPACING and i < last:
            i += 1
        elif along < 0.0 and i > 0:
            i -= 1
        else:
            break
    part = min(max(along, 0.0), SPACING)
    k = path[i, _CURVATURE]
    # On the arc of the point's curvature: the tangent turns, and the curve leaves the tangent, by its second order.
    c, s = math.cos(path[i, _YAW]), math.sin(path[i, _YAW])
    across = (y - path[i, _Y]) * c - (x - path[i, _X]) * s
    out[0] = across - 0.5 * k * part * part
    error = yaw - path[i, _YAW] - k * part
    out[1] = error - 2.0 * math.pi * math.floor(error / (2.0 * math.pi) + 0.5)
    position = SPACING * i + along
    for j in range(preview.size):
        u = min(max((position + preview[j]) / SPACING, 0.0), float(last))
        n = min(int(u), last - 1)
        out[2 + j] = path[n, _CURVATURE] + (u - n) * (path[n + 1, _CURVATURE] - path[n, _CURVATURE])
    return position
