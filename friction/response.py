"""Torque of a law along a prescribed displacement."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction import sites
from steer_env.friction.law import advance, law_of, resolve, torque
from steer_env.friction.level import Scales, choose_scale
from steer_env.friction.numerics.check import numbers, positive
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import binds, kernel
from steer_env.friction.ode import MOST_SUBSTEPS


@binds(0, sites.bound)
@kernel
def follow(p, scales, memory, x, dt, out):
    """Write the torque at each sample of a displacement into ``out``; the memory is changed.

    Parameters
    ----------
    p : parameters of a law, or sites
    scales : (T, 2) array
        Factors on the saturated friction, of positive and of negative motion [1].
    x, out : (T,) arrays
        Displacement [rad], torque [N m].
    memory : (M,) array
    dt : float
        Time between samples [s].
    """
    for i in range(1, x.size):
        w = (x[i] - x[i - 1]) / dt
        torque_scale = choose_scale(
            p, Scales(scales[i, 0], scales[i, 1]), memory, math.inf * w if w != 0.0 else 0.0, dt
        )
        advance(p, torque_scale, memory, w, dt)
        out[i] = torque(p, torque_scale, memory, w)


def response(law: Any, x: ArrayLike, dt: float, friction_torque_scale: ArrayLike = 1.0) -> NDArray[np.float64]:
    """Friction torque at the samples of a displacement history, with straight lines between the samples.

    Parameters
    ----------
    law : parameters or str
        From ``friction.make``, or a law's name for its defaults.
    x : (T,) array_like
        Displacement [rad].
    dt : float
        Time between samples [s].
    friction_torque_scale : float, (T,) or (T, 2) array_like
        Factor on the saturated friction [1]: one; one for each sample, which holds since the one before; or one for
        each sample and direction of motion, positive and negative, as :func:`steer_env.friction.level.by_sample` gives
        them.

    Returns
    -------
    (T,) array
        Torque that resists positive motion [N m], exact for the polygon; the memory is at rest at ``x[0]``.

    Raises
    ------
    ValueError
        If ``law`` is none, ``x`` is not a finite one-dimensional history, ``dt`` or a scale is not positive, the
        scales are not as many as the samples, or the torque does not stay finite.
    """
    p = frozen(resolve(law))
    path = numbers("x", x)
    scales = _scales(friction_torque_scale, path.size)
    out = np.zeros_like(path)
    follow(p, scales, np.zeros(law_of(p).memory_size(p)), path, positive("dt", dt), out)
    if not np.isfinite(out).all():
        first = int(np.argmin(np.isfinite(out)))
        raise ValueError(
            f"the torque of friction law {law_of(p).name!r} is {out[first]} at sample {first}, "
            f"{(path[first] - path[first - 1]) / dt:g} rad/s: check the unit of x, or sample it more densely, as a "
            f"law that is integrated takes at most {MOST_SUBSTEPS:,} substeps between two samples"
        )
    return out


def _scales(given: ArrayLike, samples: int) -> NDArray[np.float64]:
    """Scales (T, 2) of every sample and direction, from a form of :func:`response`."""
    if np.ndim(given) == 0:
        return np.full((samples, 2), positive("friction_torque_scale", given))
    flat = numbers("friction_torque_scale", np.ravel(given))
    if np.shape(given) not in ((samples,), (samples, 2)):
        raise ValueError(
            f"friction_torque_scale must hold one value for each of the {samples} samples of x, or two, for positive "
            f"and negative motion, got shape {np.shape(given)}"
        )
    if not flat.min() > 0.0:
        first = int(np.argmin(flat > 0.0))
        sample = np.unravel_index(first, np.shape(given))[0]
        raise ValueError(f"friction_torque_scale must be positive, got {flat[first]:g} at sample {sample}")
    return np.repeat(flat, 2).reshape(samples, 2) if np.ndim(given) == 1 else flat.reshape(samples, 2)
