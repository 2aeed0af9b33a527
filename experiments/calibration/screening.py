"""Global sensitivity of functions of parameters in [0, 1] by SALib: sampled points, and effects from the outputs.

Both methods tell one quantity, the change of an output while a parameter goes over its whole range, the others anywhere
in theirs. By Morris it is the mean size of the elementary effects, by Sobol that range of a linear function which has
the same total share of the variance: with V the variance and S_T the total index,

    size = sqrt(12 S_T V)

Sources: Morris, Technometrics 33 (1991); Campolongo et al., Environmental Modelling & Software 22 (2007); Saltelli et
al., Computer Physics Communications 181 (2010).
"""

import math
import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import one_of

Array = NDArray[np.float64]

METHODS = ("morris", "sobol")
LEVELS = 4  # of Morris's grid
FEWEST = 4  # blocks with finite outputs below which there are no effects, assumed
MIXED = 0.5  # share of its size that an effect's mean must reach to have a sign, assumed


class Design(NamedTuple):
    """Points at which a function is to be evaluated."""

    method: str  # of METHODS
    points: Array  # (blocks, rows, k) in [0, 1]; the rows of a block are used together or not at all
    seed: int

    @property
    def problem(self) -> dict[str, Any]:
        """The parameters as SALib takes them."""
        return _problem(self.points.shape[2])


class Effect(NamedTuple):
    """What a parameter does to an output; changes are in the unit of the output, over the parameter's whole range."""

    size: float  # mean size of the change [unit of the output]
    low: float  # of its 95 % interval [unit of the output]
    high: float  # of its 95 % interval [unit of the output]
    mean: float  # with its sign [unit of the output]
    spread: float  # standard deviation of the change, by interactions and curvature; NaN by Sobol [unit of the output]
    first: float  # share of the variance by the parameter alone; NaN by Morris [1]
    total: float  # share of the variance with its interactions; NaN by Morris [1]

    @property
    def sign(self) -> int:
        """1 where the output rises with the parameter, -1 where it falls, 0 where it does both."""
        return int(np.sign(self.mean)) if abs(self.mean) >= MIXED * self.size and self.size else 0


def _problem(k: int) -> dict[str, Any]:
    return {"num_vars": k, "names": [f"x{i}" for i in range(k)], "bounds": [[0.0, 1.0]] * k}


def design(k: int, method: str, n: int, seed: int) -> Design:
    """Points for k parameters.

    Parameters
    ----------
    k : int
        Number of parameters; two or more by Sobol.
    method : {"morris", "sobol"}
    n : int
        Trajectories of k + 1 points by Morris; base samples, a power of two, of k + 2 points by Sobol.
    seed : int

    Raises
    ------
    ValueError
        Another method, fewer than ``FEWEST`` trajectories or base samples, or base samples that are no power of two.
    """
    one_of("method", method, METHODS)
    if n < FEWEST:
        raise ValueError(f"--samples must be at least {FEWEST}, got {n}")
    if method == "sobol" and n & (n - 1):
        lower = 2 ** int(math.log2(n))
        raise ValueError(f"--samples must be a power of two with --method sobol, as {lower} or {2 * lower}, got {n}")
    if method == "morris":
        from SALib.sample import morris

        points = morris.sample(_problem(k), n, num_levels=LEVELS, seed=seed)
        return Design(method, points.reshape(n, k + 1, k), seed)
    from SALib.sample import sobol

    points = sobol.sample(_problem(k), n, calc_second_order=False, seed=seed)
    return Design(method, points.reshape(n, k + 2, k), seed)


def effects(d: Design, outputs: Array) -> list[Effect] | None:
    """Effects of every parameter from the outputs (blocks, rows).

    Blocks with an output that is not finite are left out; None where fewer than ``FEWEST`` are left.
    """
    whole = np.isfinite(outputs).all(axis=1)
    if whole.sum() < FEWEST:
        return None
    X, Y = d.points[whole], outputs[whole]
    if np.ptp(Y) == 0.0:
        return [Effect(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)] * X.shape[2]
    return (_morris if d.method == "morris" else _sobol)(d, X, Y)


def _morris(d: Design, X: Array, Y: Array) -> list[Effect]:
    from SALib.analyze import morris

    found = morris.analyze(d.problem, X.reshape(-1, X.shape[2]), Y.ravel(), num_levels=LEVELS, seed=d.seed)
    columns = (found[key] for key in ("mu_star", "mu_star_conf", "mu", "sigma"))
    return [
        Effect(
            float(size), float(max(size - half, 0.0)), float(size + half), float(mu), float(sigma), math.nan, math.nan
        )
        for size, half, mu, sigma in zip(*columns)
    ]


def _sobol(d: Design, X: Array, Y: Array) -> list[Effect]:
    from SALib.analyze import sobol

    with warnings.catch_warnings():  # blocks with refused outputs are left out, so that their number is no power of two
        warnings.simplefilter("ignore")
        found = sobol.analyze(d.problem, Y.ravel(), calc_second_order=False, seed=d.seed)
    variance = float(np.var(Y[:, [0, -1]]))  # of the two independent samples in each block
    x = X.reshape(-1, X.shape[2])
    slopes = np.linalg.lstsq(np.column_stack([x, np.ones(len(x))]), Y.ravel(), rcond=None)[0]

    def size(total: float) -> float:
        return math.sqrt(12.0 * max(total, 0.0) * variance)

    return [
        Effect(size(total), size(total - half), size(total + half), float(mean), math.nan, float(first), float(total))
        for total, half, first, mean in zip(found["ST"], found["ST_conf"], found["S1"], slopes)
    ]
