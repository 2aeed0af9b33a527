"""Histories of motion that hypothesis draws, and what a friction law makes of them."""

from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from steer_env.friction import law

Array = NDArray[np.float64]


def log(low: float, high: float) -> st.SearchStrategy[float]:
    """Floats between two powers of ten, even in the exponent."""
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


def both_signs(magnitudes: st.SearchStrategy[float]) -> st.SearchStrategy[float]:
    """Both signs, and zero."""
    return st.tuples(st.sampled_from([1.0, -1.0, 0.0]), magnitudes).map(lambda pair: pair[0] * pair[1])


def _move(w: float, distance: float) -> tuple[float, float]:
    """Speed and duration."""
    return w, distance / abs(w) if w else distance


speeds = both_signs(log(-3, 1.5))  # [rad/s]
torque_scales = log(-1, 1)
# Friction follows displacements, so durations are drawn as distances [rad].
moves = st.lists(st.builds(_move, speeds, log(-5, 0)), max_size=8)
# S, R, h of step equations; the load R would give the drawn speed without friction.
steps = st.lists(
    st.builds(lambda S, motion: (S, S * motion[0], motion[1]), log(-2, 4), st.builds(_move, speeds, log(-5, 0))),
    min_size=1,
    max_size=8,
)


def at_rest(p: Any) -> Array:
    """Memory of a law at rest."""
    return np.zeros(law.law_of(p).memory_size(p))


def memory_after(
    p: Any, history: list[tuple[float, float]], torque_scale: float = 1.0, memory: Array | None = None
) -> Array:
    """Memory after a history of constant speeds [rad/s] and durations [s], from rest or from another memory."""
    memory = at_rest(p) if memory is None else memory.copy()
    for w, h in history:
        law.advance(p, torque_scale, memory, w, h)
    return memory


def odd(p: Any, memory: Array) -> NDArray[np.bool_]:
    """Which floats of a memory are odd."""
    return np.resize(np.array([each == "odd" for each in law.law_of(p).parity(p)], bool), memory.size)


def mirror(p: Any, memory: Array) -> Array:
    """Memory, or its rate, of the mirrored motion."""
    return np.where(odd(p, memory), -memory, memory)


def extent(p: Any, torque_scale: float) -> Array:
    """The largest float of the same parity after a long slide and a rest: what rounding is compared with."""
    slid = memory_after(p, [(1.0, 100.0)], torque_scale)
    found, turns = np.maximum(np.abs(slid), np.abs(memory_after(p, [(0.0, 1.0)], torque_scale, slid))), odd(p, slid)
    return np.where(turns, found.max(where=turns, initial=0.0), found.max(where=~turns, initial=0.0))


def rate(p: Any, torque_scale: float, memory: Array, w: float) -> Array:
    """Time derivative of the memory at the speed ``w`` [rad/s]."""
    out = np.zeros_like(memory)
    law.rate(p, torque_scale, memory, w, out)
    return out


def size(p: Any, torque_scale: float = 1.0) -> float:
    """Torque of a long slide at 1 rad/s: what rounding is compared with [N m]."""
    return law.torque(p, torque_scale, memory_after(p, [(1.0, 100.0)], torque_scale), 1.0)


def mean_by_quadrature(p: Any, torque_scale: float, memory: Array, w: float, h: float) -> float:
    """Mean over the step of ``torque`` along ``advance``: adaptive Simpson, good to about 1e-9 of the torque."""

    def f(t: float) -> float:
        return law.torque(p, torque_scale, memory_after(p, [(w, t)], torque_scale, memory), w)

    def integral(a: float, b: float, f_a: float, f_m: float, f_b: float) -> float:
        m = 0.5 * (a + b)
        f_l, f_r = f(0.5 * (a + m)), f(0.5 * (m + b))
        whole = (f_a + 4.0 * f_m + f_b) / 6.0 * (b - a)
        halves = (f_a + 4.0 * f_l + 2.0 * f_m + 4.0 * f_r + f_b) / 12.0 * (b - a)
        if abs(halves - whole) <= tolerance:
            return halves + (halves - whole) / 15.0
        return integral(a, m, f_a, f_l, f_m) + integral(m, b, f_m, f_r, f_b)

    # an element may yield at any fraction of the step, so the pieces shrink towards its start
    edges = [0.0, *(h * 10.0**k for k in range(-8, 1))]
    # of a piece; a jump of the torque ends in one this small
    tolerance = 1e-11 * h * (size(p, torque_scale) + abs(f(h)))
    return sum(integral(a, b, f(a), f(0.5 * (a + b)), f(b)) for a, b in pairwise(edges)) / h
