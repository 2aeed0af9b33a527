"""How the packed numbers of a plant follow from the parameters of the page: polynomials, made of Python's own plants.

Every packed number that depends on a parameter is a polynomial of it over the range of its slider, in Chebyshev's form:

    n = sum c_ij.. T_i(t) T_j(u) ..,    t = (2 x - low - high)/(high - low)

Python makes the plants at the nodes, and others between them that check the polynomials. Nothing of how a car becomes
numbers is therefore written a second time, and a law or a car of one's own needs nothing new. Most numbers are straight
lines; the inertias of a loaded body on two tracks and the springs of a Masing law, which are not, take up to twenty
terms. Compiling the constructors for the page was the alternative: they hold checks, texts and tables that numba does
not take.
"""

import itertools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from steer_env.experiments.explore.parameters import Parameter

Array = NDArray[np.float64]
NumbersOf = Callable[[dict[str, float]], Array]
CLOSE = 1e-13  # of the polynomials to Python's numbers, over the size of the number [1]
DEGREES = (2, 6, 12, 20, 32, 48)
CHECKS = (-0.93, 0.41)  # places between the nodes at which a polynomial of one parameter is checked, -1 to 1
TRIALS = 24  # sets of values at which all of them are


class Dependence(NamedTuple):
    """Numbers that depend on the same parameters."""

    parameters: tuple[int, ...]  # which of the parameters
    degrees: tuple[int, ...]  # of the polynomial in each of them
    places: tuple[int, ...]  # of the numbers
    coefficients: Array  # (places, terms), the last parameter fastest


def dependences(parameters: Sequence[Parameter], numbers_of: NumbersOf) -> list[Dependence]:
    """The polynomials of all numbers that depend on parameters.

    Parameters
    ----------
    parameters : sequence of Parameter
    numbers_of : callable
        From values of all parameters by name to the packed numbers (N,).

    Raises
    ------
    ValueError
        A plant that is refused within the ranges of the sliders, or numbers that no polynomial follows.
    """
    middle = np.array([0.5 * (q.low + q.high) for q in parameters])

    def at(changes: dict[int, float]) -> Array:
        values = middle.copy()
        for i, t in changes.items():
            values[i] += 0.5 * t * (parameters[i].high - parameters[i].low)
        return numbers_of({q.name: float(x) for q, x in zip(parameters, values)})

    def along(i: int, t: float) -> Array:
        return at({i: t})

    degrees = [_degrees(partial(along, i)) for i in range(len(parameters))]
    touched = np.array(degrees) > 0  # (P, N)
    groups: dict[tuple[int, ...], list[int]] = {}
    for place in np.flatnonzero(touched.any(axis=0)):
        groups.setdefault(tuple(map(int, np.flatnonzero(touched[:, place]))), []).append(int(place))
    found = []
    for which, places in groups.items():
        wanted = tuple(int(max(degrees[i][places])) for i in which)
        grid = [_nodes(degree) for degree in wanted]
        values = np.array([at(dict(zip(which, ts)))[places] for ts in itertools.product(*grid)])
        coefficients = values.T.reshape(len(places), *(degree + 1 for degree in wanted))
        for axis, degree in enumerate(wanted, 1):
            inverse = np.linalg.inv(chebyshev.chebvander(_nodes(degree), degree))
            coefficients = np.moveaxis(np.tensordot(inverse, coefficients, (1, axis)), 0, axis)
        found.append(Dependence(which, wanted, tuple(places), coefficients.reshape(len(places), -1)))
    _check(parameters, numbers_of, found)
    return found


def _nodes(degree: int) -> Array:
    return chebyshev.chebpts1(degree + 1)


def _degrees(at: Callable[[float], Array]) -> Array:
    """Degree (N,) of each number in one parameter, 0 where it does not depend on it."""
    between = np.array([at(t) for t in CHECKS])
    for degree in DEGREES:
        values = np.array([at(t) for t in _nodes(degree)])
        coefficients = np.linalg.solve(chebyshev.chebvander(_nodes(degree), degree), values)
        size = np.abs(values).max(axis=0) + np.finfo(float).tiny
        off = np.abs(chebyshev.chebval(CHECKS, coefficients).T - between).max(axis=0)
        if np.all(off <= CLOSE * size):
            large = np.abs(coefficients) > 0.1 * CLOSE * size
            return np.array([np.flatnonzero(column)[-1] if column.any() else 0 for column in large.T])
    worst = int(np.argmax(off / size))
    raise ValueError(
        f"packed number {worst} follows no polynomial of degree {DEGREES[-1]}: {off[worst] / size[worst]:.2g}"
    )


def numbers(
    base: Array, found: Sequence[Dependence], parameters: Sequence[Parameter], values: dict[str, float]
) -> Array:
    """The packed numbers (N,) for values of the parameters, as the page computes them."""
    made = base.copy()
    for each in found:
        terms = np.ones(1)
        for i, degree in zip(each.parameters, each.degrees):
            q = parameters[i]
            t = (2.0 * values[q.name] - q.low - q.high) / (q.high - q.low)
            terms = np.outer(terms, chebyshev.chebvander(t, degree)).ravel()
        made[list(each.places)] = each.coefficients @ terms
    return made


def _check(parameters: Sequence[Parameter], numbers_of: NumbersOf, found: Sequence[Dependence]) -> None:
    """Compare with Python's numbers at corners and at random places of all ranges together."""
    rng = np.random.default_rng(0)
    base = numbers_of({q.name: q.value for q in parameters})
    shares = [rng.integers(0, 2, len(parameters)) if k % 2 else rng.random(len(parameters)) for k in range(TRIALS)]
    sets = [{q.name: float(q.low + s * (q.high - q.low)) for q, s in zip(parameters, share)} for share in shares]
    wanted = np.array([numbers_of(values) for values in sets])
    off = np.abs([numbers(base, found, parameters, values) for values in sets] - wanted).max(axis=0)
    size = np.abs(wanted).max(axis=0)
    if np.any(off > 10.0 * CLOSE * size):
        worst = int(np.argmax(off - 10.0 * CLOSE * size))
        raise ValueError(f"packed number {worst} is off by {off[worst]:.3g}, and up to {size[worst]:.3g} large")


def as_data(found: Sequence[Dependence]) -> list[dict[str, Any]]:
    """The dependences as JSON holds them."""
    return [each._asdict() | {"coefficients": each.coefficients.tolist()} for each in found]
