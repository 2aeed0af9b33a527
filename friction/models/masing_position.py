"""Masing whose sliders yield at a torque that depends on the position (F41).

    T = sum k_i e_i,   |e_i| <= L y_i (1 + m_i u),   u = (x - x_m)/r, within -1 and 1          (F41)

x is the displacement since the memory was at rest, x_m the middle of a stroke and r half of it. Friction on one side of
the stroke differs from that on the other where m_i is not zero; no level is negative, as |m_i| is at most 1, and beyond
the stroke it stays as at its end. Where a level changes by less than the way, as r >= y_i |m_i| demands, a slider that
has yielded goes on to slide: over a way s in one direction it moves by min(s, g + kappa q), with its gap g, the slope
kappa of its level and the part q of the way that lies within the stroke. A friction scale L that would need more
weakens m_i to what the stroke allows.

The law is passive: a level only bounds the spring of its slider, and a spring that is cut back loses energy.

Source: Iwan, J. Appl. Mech. 33 (1966) 893 (sliders). Levels linear in the position, of both slopes, are the least that
describes a contact whose friction differs over the stroke; they are assumed.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.law import Sliders, register
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import numbers
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.virgin_curve import sliders

ROUNDING = 1e-9  # of a yield, by which it may exceed what the stroke allows [1]


class MasingPosition(NamedTuple):
    """Parameters, which ``friction.make("masing_position", ...)`` checks and this class does not.

    The elements stand in ascending order of their yield displacements.
    """

    k: NDArray[np.float64]  # (N,) stiffnesses [N m/rad]
    y: NDArray[np.float64]  # (N,) yield displacements in the middle of the stroke [rad]
    slope: NDArray[np.float64]  # (N,) m_i, relative increase of a yield from the middle to the high end [1]
    stroke: NDArray[np.float64]  # (2,) ends of the stroke, from the displacement at which the memory is at rest [rad]


def make(
    *,
    k: ArrayLike | None = None,
    y: ArrayLike | None = None,
    slope: ArrayLike | None = None,
    stroke: ArrayLike = (-1.0, 1.0),
    F_c: float | None = None,
    x_c: float | None = None,
    elements: int | None = None,
) -> MasingPosition:
    """Checked parameters, from the elements of ``friction.make("masing", ...)`` and the slopes of their yields.

    By default no yield depends on the position, because no source gives such a slope for a steering.

    Raises
    ------
    ValueError
        For values out of range, slopes that are not as many as the elements, or a yield that changes by more than the
        way.
    """
    ks, ys = sliders(k, y, F_c, x_c, elements)
    slopes = np.zeros(ys.size) if slope is None else numbers("slope", slope)
    if slopes.shape != ys.shape:
        raise ValueError(f"slope must hold one value for each of the {ys.size} elements, got {slopes.size}")
    if y is not None:
        slopes = slopes[np.argsort(numbers("y", y), kind="stable")]  # as the elements are
    if np.any(np.abs(slopes) > 1.0):
        raise ValueError(f"slope must be within -1 and 1, so that no yield is negative, got {slopes}")
    ends = numbers("stroke", stroke)
    if ends.shape != (2,) or not ends[0] < ends[1]:
        raise ValueError(f"stroke must hold its low and its high end, got {ends}")
    most = float(np.max(ys * np.abs(slopes)))
    if most > (1.0 + ROUNDING) * 0.5 * (ends[1] - ends[0]):
        raise ValueError(
            f"y times slope must be at most half the stroke, {0.5 * (ends[1] - ends[0]):g} rad, got {most:g} rad"
        )
    return frozen(MasingPosition(ks, ys, slopes, ends))


@kernel
def _change(p, i, torque_scale):
    """Increase of the limit of an element from the middle of the stroke to its high end [rad], at most half of it."""
    half = 0.5 * (p.stroke[1] - p.stroke[0])
    return within(torque_scale * p.y[i] * p.slope[i], -half, half)


@kernel
def _limit(p, i, torque_scale, position):
    """Limit of an element [rad]."""
    half = 0.5 * (p.stroke[1] - p.stroke[0])
    u = within((position - 0.5 * (p.stroke[0] + p.stroke[1])) / half, -1.0, 1.0)
    return max(torque_scale * p.y[i] + _change(p, i, torque_scale) * u, 0.0)  # (F41)


@kernel
def _element_torque(p, i, torque_scale, memory):
    """What an element holds at its position [rad]; the torque scale may have fallen since the last step."""
    limit = _limit(p, i, torque_scale, memory[p.k.size])
    return within(memory[i], -limit, limit)


@kernel
def _element_travel(way, gap, kappa, first, last):
    """How far an element moves within a way (F41)."""
    return min(way, gap + kappa * (within(way, first, last) - first))


@kernel
def _mean_element_travel(a, b, gap, kappa, first, last):
    """Integral of :func:`_element_travel` from ``a`` to ``b`` of a way, where the level has one slope."""
    g_a = gap + kappa * (within(a, first, last) - first)
    g_b = gap + kappa * (within(b, first, last) - first)
    if b <= g_b:
        return 0.5 * (a + b) * (b - a)
    if a >= g_a:
        return 0.5 * (g_a + g_b) * (b - a)
    over = (b - g_b) + (g_a - a)
    return (0.5 * (g_a + g_b) - 0.5 * (g_a - a) ** 2 / over) * (b - a)


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    side = math.copysign(1.0, w)
    way = abs(w) * h
    position = memory[p.k.size]
    half = 0.5 * (p.stroke[1] - p.stroke[0])
    ends = side * (p.stroke[0] - position), side * (p.stroke[1] - position)
    first, last = max(min(ends[0], ends[1]), 0.0), max(max(ends[0], ends[1]), 0.0)  # of the way within the stroke
    a, b = min(first, way), min(last, way)
    T = 0.0
    slope = 0.0
    for i in range(p.k.size):
        e = _element_torque(p, i, torque_scale, memory)
        gap = _limit(p, i, torque_scale, position) - side * e
        kappa = side * _change(p, i, torque_scale) / half
        T += p.k[i] * e
        if way > 0.0:
            mean = _mean_element_travel(0.0, a, gap, kappa, first, last) + _mean_element_travel(
                a, b, gap, kappa, first, last
            )
            mean = (mean + _mean_element_travel(b, way, gap, kappa, first, last)) / way
            T += p.k[i] * side * mean
            slope += p.k[i] * h * (_element_travel(way, gap, kappa, first, last) - mean) / way
        elif gap > 0.0:
            slope += 0.5 * h * p.k[i]
        elif first == 0.0 < last:
            slope += 0.5 * h * p.k[i] * kappa
    return T, slope


@kernel
def advance(p, torque_scale, memory, w, h):
    n = p.k.size
    for i in range(n):
        e = _element_torque(p, i, torque_scale, memory)
        limit = _limit(p, i, torque_scale, memory[n] + w * h)
        memory[i] = within(e + w * h, -limit, limit)
    memory[n] += w * h


@kernel
def torque(p, torque_scale, memory, w):
    T = 0.0
    for i in range(p.k.size):
        T += p.k[i] * _element_torque(p, i, torque_scale, memory)
    return T


@kernel
def rate(p, torque_scale, memory, w, out):
    n = p.k.size
    half = 0.5 * (p.stroke[1] - p.stroke[0])
    inside = p.stroke[0] < memory[n] < p.stroke[1]
    for i in range(n):
        if w * memory[i] < _limit(p, i, torque_scale, memory[n]) * abs(w):
            out[i] = w
        else:
            out[i] = abs(w) * _change(p, i, torque_scale) / half if inside else 0.0  # along with its level
    out[n] = w


@kernel
def stored_energy(p, memory):
    E = 0.0
    for i in range(p.k.size):
        E += 0.5 * p.k[i] * memory[i] ** 2
    return E


def steepest_fall(p: MasingPosition, torque_scale: float, h: float) -> float:
    """All levels that fall in one direction slide at once (F41)."""
    half = 0.5 * (p.stroke[1] - p.stroke[0])
    falls = p.k * np.clip(torque_scale * p.y * p.slope / half, -1.0, 1.0)
    return 0.5 * h * float(max(np.sum(falls[falls > 0.0]), -np.sum(falls[falls < 0.0])))


def _of_sliders(F: NDArray, y: NDArray, slope: NDArray, stroke: NDArray) -> Any:
    return make(k=F / y, y=y, slope=slope, stroke=stroke)


register(
    "masing_position",
    MasingPosition,
    make=make,
    memory_size=lambda p: p.k.size + 1,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    mean_torque=mean_torque,
    steepest_fall=steepest_fall,
    continuous=True,
    fitted=Sliders(_of_sliders, by_position=True),
    units={"k": "N m/rad", "y": "rad", "slope": "1", "stroke": "rad"},
    extends="masing",
)
