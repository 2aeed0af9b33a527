"""``friction.fit``: parameters of a law from a record (F12), (F30) to (F36)."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.identification.branches import BAND as SWING
from steer_env.friction.identification.branches import Branches, branches_of, stiffness_of, weighed_of
from steer_env.friction.identification.determined import Estimate, determined, linear
from steer_env.friction.identification.displacement import BAND, motion_of, noise_of
from steer_env.friction.identification.elements import Elements
from steer_env.friction.identification.problem import Problem, searched
from steer_env.friction.identification.quality import own_noise, refuse
from steer_env.friction.identification.record import Record, checked
from steer_env.friction.identification.remarks import remarks
from steer_env.friction.identification.scales import Scales, scaled
from steer_env.friction.identification.space import space_of
from steer_env.friction.law import Law, law_of, make
from steer_env.friction.numerics.check import number

Bound = float | NDArray[np.float64]  # an array for a curve


class Fit(NamedTuple):
    """What :func:`fit` found.

    The record is ``steer_env.friction.response(parameters, x, dt) + offset + inertia x''`` and a residual, with ``x``
    freed of its noise.
    """

    law: str
    parameters: Any  # as from friction.make
    intervals: dict[str, tuple[Bound, Bound]]  # name -> (low, high), 95 %, in the parameter's unit
    offset: float  # constant part of the measured torque [N m]
    residual: float  # RMS over the weighed samples [N m]
    warnings: tuple[str, ...]
    level: Any = None  # steer_env.friction.level.Level, where load or direction change the friction
    undetermined: tuple[str, ...] = ()  # names of the parameters that the record does not determine
    explained: float = 0.0  # share of the variance of the weighed torque [1]
    inertia: float = 0.0  # that the torque sensor moves along, given or estimated [kg m2]


class Prepared(NamedTuple):
    """A record made ready for every law."""

    record: Record  # with x freed of its noise
    noise: float  # of x [rad]
    own_noise: float  # of the torque: what even the true law leaves [N m]
    branches: Branches
    scales: Scales


def fit(
    x: ArrayLike,
    torque: ArrayLike,
    law: str = "lugre",
    *,
    dt: float,
    load: ArrayLike | None = None,
    inertia: float = 0.0,
    fixed: Mapping[str, float] | None = None,
    starts: int = 3,
    global_search: bool = False,
    seed: int = 0,
) -> Fit:
    """Identify a law from displacement and torque.

    The memory at the start is unknown. The samples before the first reversal from saturation (before the first reversal
    at all, if none is) therefore drive the law but are not weighed. A constant offset is estimated too. The fit takes
    place in the record's own scales, so that the same record in other units gives the same answer.

    Parameters
    ----------
    x : (T,) array_like
        Displacement [rad].
    torque : (T,) array_like
        Torque that resists positive motion [N m].
    law : str
        Name of a law that tells the units of its parameters.
    dt : float
        Time between samples [s].
    load : (T,) array_like, optional
        Load on the contact [N].
    inertia : float
        Inertia between the friction and the torque sensor, whose torque is subtracted [kg m2].
    fixed : mapping, optional
        Parameters that are known, in the units of the record.
    starts : int
        Number of starting points of the search.
    global_search : bool
        Whether differential evolution looks for a better optimum.
    seed : int
        Of the draws.

    Returns
    -------
    Fit
        The intervals cover noise of the torque, not a law that does not fit. That of ``F_c`` is open above where the
        weighed torque never saturates; those of Masing are of ``F_c`` and of the ``virgin_torque`` at its yields.

    Raises
    ------
    ValueError
        For an unknown law or one whose units are not told, values that are not finite, arrays of unequal length, ``dt``
        not positive, no motion, no reversal, too few samples, torque of the wrong sign, or a search that does not
        converge.
    """
    friction_law = law_of(make(law))
    ready = prepared(checked(x, torque, dt, load), inertia)
    return fitted(ready, friction_law, fixed=fixed or {}, starts=starts, global_search=global_search, seed=seed)


def prepared(record: Record, inertia: float = 0.0) -> Prepared:
    """The noise of x removed, torque of inertia subtracted, branches and scales found; see :func:`fit`."""
    noise = noise_of(record.x)
    refuse(record.x, record.torque, noise)
    path = motion_of(record.x, noise)
    mass = number("inertia", inertia, minimum=0.0)
    T = record.torque - mass * np.gradient(np.gradient(path, record.dt), record.dt) if mass else record.torque
    clean = record._replace(x=path, torque=T)
    branches = branches_of(path, T, max(SWING * float(np.ptp(path)), BAND * noise))
    level = 0.5 * branches.swing
    steps = np.abs(np.diff(path))
    moving = steps[steps > 0.0]
    length = max(2.0 * level / stiffness_of(branches), 0.1 * float(np.median(moving)))
    speed = float(np.mean(moving)) / record.dt
    slope_noise = 0.5 * noise / length * level if path is not record.x else 0.0
    own = own_noise(path, T, branches, slope_noise)
    return Prepared(clean, noise, own, branches, Scales(level, length, length / speed))


def fitted(
    ready: Prepared,
    law: Law,
    *,
    fixed: Mapping[str, float],
    starts: int = 3,
    global_search: bool = False,
    seed: int = 0,
) -> Fit:
    """One law on a record that is ready; see :func:`fit`."""
    record, scales = ready.record, ready.scales
    remembers = law.memory_size(law.make()) > 0
    weighed = weighed_of(record.x, ready.branches, remembers)
    problem = Problem(
        record.x / scales.displacement,
        record.torque / scales.torque,
        record.dt / scales.time,
        np.ones(record.x.size),
        weighed,
        np.ones((record.x.size, 1)),
    )
    known = scaled(law, fixed, scales)
    held, elements = dict(known), None
    if callable(law.fitted):
        arrays, elements = law.fitted(problem)
        held |= {name: value for name, value in arrays._asdict().items() if np.ndim(value)}
    space = space_of(law, held)
    estimate = determined(problem, space, searched(problem, space, starts, seed, global_search))
    return _told(ready, law, problem, estimate, elements)


def _told(ready: Prepared, law: Law, problem: Problem, estimate: Estimate, elements: Elements | None) -> Fit:
    """The estimate in the units of the record, with intervals and warnings."""
    scales, branches, weighed = ready.scales, ready.branches, problem.weighed
    values = scaled(law, estimate.parameters._asdict(), scales, back=True)
    parameters = law.make(**values)
    bounds = linear(estimate)
    intervals = {name: tuple(scaled(law, {name: b}, scales, back=True)[name] for b in bounds[name]) for name in bounds}
    if elements is not None:
        intervals |= {
            name: (low * scales.torque, high * scales.torque) for name, (low, high) in elements.intervals.items()
        }
    if "F_c" in intervals and not branches.saturates:
        intervals["F_c"] = intervals["F_c"][0], math.inf
    e = estimate.optimum.residual * scales.torque
    residual = math.sqrt(np.mean(e**2))
    variance = float(np.var(ready.record.torque[weighed]))
    result = Fit(
        law.name,
        parameters,
        intervals,
        float(estimate.factors[0]) * scales.torque,
        residual,
        (),
        undetermined=tuple(estimate.undetermined),
        explained=1.0 - residual**2 / variance if variance else 0.0,
    )
    return result._replace(warnings=remarks(result, ready, law, e))
