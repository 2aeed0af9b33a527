"""Torque of a law along a prescribed displacement."""

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.law import advance, law_of, resolve, torque
from steer_env.friction.numerics.check import numbers, positive
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.renamed import REMOVED_IN


@kernel
def follow(p, torque_scales, memory, x, dt, out):
    """Write the torque at each sample of a displacement into ``out``; the memory is changed.

    Parameters
    ----------
    p : parameters of a law
    torque_scales, x, out : (T,) arrays
        Factor on the saturated friction [1], displacement [rad], torque [N m].
    memory : (M,) array
    dt : float
        Time between samples [s].
    """
    for i in range(1, x.size):
        w = (x[i] - x[i - 1]) / dt
        advance(p, torque_scales[i], memory, w, dt)
        out[i] = torque(p, torque_scales[i], memory, w)


def response(
    law: Any, x: ArrayLike, dt: float, friction_torque_scale: ArrayLike = 1.0, *, level: float | None = None
) -> NDArray[np.float64]:
    """Friction torque at the samples of a displacement history, with straight lines between the samples.

    Parameters
    ----------
    law : parameters or str
        From ``friction.make``, or a law's name for its defaults.
    x : (T,) array_like
        Displacement [rad].
    dt : float
        Time between samples [s].
    friction_torque_scale : float or (T,) array_like
        Factor on the saturated friction, the same at all samples or one for each [1].
    level : float, optional
        The former name of ``friction_torque_scale``, which release 1.0 removes.

    Returns
    -------
    (T,) array
        Torque that resists positive motion [N m], exact for the polygon; the memory is at rest at ``x[0]``.

    Raises
    ------
    ValueError
        If ``law`` is none, ``x`` is not a finite one-dimensional history, or ``dt`` or ``friction_torque_scale`` is not
        positive.
    """
    if level is not None:
        text = f"response(level=...) is now response(friction_torque_scale=...); release {REMOVED_IN} removes level"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        friction_torque_scale = level
    p = frozen(resolve(law))
    path = numbers("x", x)
    scales = numbers("friction_torque_scale", friction_torque_scale)
    if not np.all(scales > 0.0) or scales.size not in (1, path.size):
        raise ValueError(
            f"friction_torque_scale must be greater than 0, one number or one for each of the {path.size} samples, "
            f"got {scales.size} from {scales.min():g}"
        )
    out = np.zeros_like(path)
    scales = np.repeat(scales, path.size // scales.size)
    follow(p, scales, np.zeros(law_of(p).memory_size(p)), path, positive("dt", dt), out)
    return out
