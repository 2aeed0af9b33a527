"""Torque of a law along a prescribed displacement."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.law import advance, law_of, resolve, torque
from steer_env.friction.numerics.check import numbers, positive
from steer_env.friction.numerics.kernel import kernel


@kernel
def _follow(p, level, memory, x, dt, out):
    for i in range(1, x.size):
        w = (x[i] - x[i - 1]) / dt
        advance(p, level, memory, w, dt)
        out[i] = torque(p, level, memory, w)


def response(law: Any, x: ArrayLike, dt: float, level: float = 1.0) -> NDArray[np.float64]:
    """Friction torque at the samples of a displacement history, straight lines between the samples.

    Parameters
    ----------
    law : parameters or str
        From ``friction.make``, or a law's name for its defaults.
    x : (T,) array_like
        Displacement [rad].
    dt : float
        Time between samples [s].
    level : float
        Factor on the saturated friction [1].

    Returns
    -------
    (T,) array
        Torque that resists positive motion [N m], exact for the polygon; the memory is at rest at ``x[0]``.

    Raises
    ------
    ValueError
        If ``law`` is none, ``x`` is not a finite one-dimensional history, or ``dt`` or ``level`` is not positive.
    """
    p = resolve(law)
    path = numbers("x", x)
    out = np.zeros_like(path)
    _follow(p, positive("level", level), np.zeros(law_of(p).memory_size(p)), path, positive("dt", dt), out)
    return out
