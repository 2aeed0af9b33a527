"""What a friction law is, the registry of laws, and the step equation that all of them share.

A law is an immutable ``NamedTuple`` of parameters and a few scalar kernels. The functions below take those of the class
of the parameters: in plain Python they look it up, in compiled code it selects them at compile time. What is compiled
once for all laws, as the plant is, calls them by address (:mod:`steer_env.friction.unit`). The torque of a law
*resists* positive velocity [N m].

Every kernel takes ``(p, torque_scale, memory, ...)``: the parameters; a factor on the saturated friction, L in
equations (1 leaves the parameters as they are; friction that depends on load, wear or temperature changes it) [1];
and the memory of the law, a view of ``memory_size`` floats that are all zero where a motion starts from rest.
"""

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction import fitted_file, ode
from steer_env.friction.numerics.check import construct, read_number
from steer_env.friction.numerics.kernel import binds, dispatch, kernel, plainly
from steer_env.friction.numerics.registry import Registry
from steer_env.friction.numerics.simd import any_of, invert, where


class Sliders(NamedTuple):
    """How the parameters of a law of sliders in parallel follow from those that ``friction.fit`` finds in a record.

    A law whose sliders follow a Stribeck curve with a lag also says what one of them is: from its yield, the relative
    excess of break-away, the Stribeck speed and the attraction. Else the level of a slider is constant, or linear in
    the position: ``made`` then also takes the slopes (N,) of the levels and the ends (2,) of the stroke.
    """

    made: Callable[..., Any]  # levels (N,) [N m], yields (N,) [rad] -> parameters
    one: Callable[[float, float, float, float], Any] | None = None  # -> parameters of a slider of level 1 [N m]
    by_position: bool = False  # whether a level may grow to either end of the stroke, from zero at the other one
    viscous: str = ""  # parameter of a viscous part beside the sliders


class Law(NamedTuple):
    """A registered law; :func:`register` explains the fields."""

    name: str
    parameters: type
    make: Callable[..., Any]
    memory_size: Callable[[Any], int]
    fitted: tuple[str, ...] | Sliders
    units: Mapping[str, str]
    steepest_fall: Callable[[Any, float, float], float]  # of parameters, torque scale, step [N m s/rad]
    relaxes: bool
    continuous: bool
    wide: bool
    modes: Callable[[Any], int]
    parity: Callable[[Any], tuple[str, ...]]  # of parameters: of each float that the law's file counts
    permission: Callable[[Any], Mapping[str, Any]]
    extends: str
    advance: Callable
    torque: Callable
    rate: Callable
    stored_energy: Callable
    mean_torque: Callable | None
    solve: Callable
    rest_torque: Callable  # (p, torque_scale, memory, h) -> mean torque of a step at rest, which decides its side [N m]


LAW_SYNTAX = "LAW[,key=value...], a list of numbers as a:b:c, or a fitted FILE.json"  # a law as text
EXAMPLE = {"law": "lugre", "F_c": 1.2}  # a law as a mapping
LAWS: Registry[Law] = Registry("friction law", "steer_env.friction.models")


@kernel
def _no_advance(p, torque_scale, memory, w, h):
    pass


@kernel
def _no_rate(p, torque_scale, memory, w, out):
    pass


@kernel
def _no_energy(p, memory):
    return 0.0


# Long: its docstring is the contract of every law.
def register(
    name: str,
    parameters: type,
    *,
    make: Callable[..., Any],
    torque: Callable,
    memory_size: Callable[[Any], int] | None = None,
    advance: Callable | None = None,
    rate: Callable | None = None,
    stored_energy: Callable | None = None,
    mean_torque: Callable | None = None,
    solve: Callable | None = None,
    fitted: tuple[str, ...] | Sliders = (),
    units: Mapping[str, str] | None = None,
    steepest_fall: Callable[[Any, float, float], float] | None = None,
    relaxes: bool = False,
    continuous: bool = False,
    wide: bool = False,
    modes: Callable[[Any], int] | None = None,
    cut_back: Callable | None = None,
    parity: Callable[[Any], tuple[str, ...]] | None = None,
    rest: Callable | None = None,
    permission: Callable[[Any], Mapping[str, Any]] | None = None,
    extends: str = "",
) -> None:
    """Make a law known under a name; one call at the end of the law's file.

    A law with memory may leave out ``advance``, ``mean_torque`` and ``solve``: :mod:`steer_env.friction.ode` integrates
    it.

    Parameters
    ----------
    name : str
        Lower-case name for ``friction.make``.
    parameters : NamedTuple class
        The class of the immutable parameters, floats or ``(N,)`` arrays.
    make : callable
        Checked constructor with keyword arguments only, all with defaults; it raises ValueError for bad values. The
        fields of ``parameters`` are among its keywords, so that :func:`as_mapping` tells all of a set.
    torque : ``(p, torque_scale, memory, w) -> float``
        Torque at this moment [N m]; at ``w = 0`` it is the limit of ``mean_torque`` there.
    memory_size : callable, optional
        Parameters -> number of floats of memory. A law without memory omits this and the next three functions.
    advance : ``(p, torque_scale, memory, w, h) -> None``
        Changes the memory exactly as ``h`` [s] at constant speed ``w`` [rad/s] do.
    rate : ``(p, torque_scale, memory, w, out) -> None``
        Writes the time derivative of the memory at speed ``w`` into ``out``, as an ODE solver needs it; at rest it is
        zero, but for even entries and in a law that ``relaxes``.
    stored_energy : ``(p, memory) -> float``
        Energy that the memory can give back [J].
    mean_torque : ``(p, torque_scale, memory, w, h) -> (float, float)``, optional
        Exact mean torque over ``h`` at constant ``w`` [N m], and its derivative by ``w`` [N m s/rad]; of a set-valued
        law at ``w = 0`` the torque with which motion begins to the side of the sign of ``w``.
    solve : ``(p, torque_scale, memory, S, R, h, w_guess) -> float``, optional
        The speed ``w`` with ``S w + mean_torque(w) = R``; by default from a safeguarded Newton iteration.
    fitted : tuple of str or Sliders, optional
        For ``friction.fit``: the parameters that it needs; or, of sliders in parallel, how parameters follow from them.
    units : mapping, optional
        Unit of each field of ``parameters``, ``{"sigma_0": "N m/rad"}``, by which ``friction.fit`` scales; or ``"1"``.
    steepest_fall : ``(p, torque_scale, h) -> float``, optional
        The largest decrease of the mean torque over ``h`` with the speed [N m s/rad], over every memory and speed; 0
        by default. The step equation has one solution where ``S`` is larger; another plant is refused. No kernel.
    relaxes : bool
        Whether the torque of a loaded law gives way at rest, as that of a spring behind a damper does. Even entries of
        the memory may change at rest in every law.
    continuous : bool
        Whether ``mean_torque`` at a speed of zero, of either side, is that of a step at rest, to the bit: a plant then
        does not ask for it.
    wide : bool
        Whether the kernels take vectors of cars too (:mod:`steer_env.friction.numerics.simd`), so that rows of a batch
        can run side by side.
    modes : callable, optional
        Parameters -> number of floats at the end of the memory that change in jumps (stick, slip), of rate zero.
    cut_back : ``(p, torque_scale, memory) -> None``, optional
        Of a law that is integrated: cuts the memory back to what break-away allows where the torque scale has fallen.
    parity : callable, optional
        Parameters -> ``"odd"`` or ``"even"`` for each float of memory. In the mirrored motion an odd one changes its
        sign, as a bristle's deflection does, and an even one does not: the age of a contact, a temperature. All are odd
        by default.
    rest : ``(p, memory) -> None``, optional
        Of a law that is integrated: writes the values of the even entries with which a motion starts from rest, where
        they are not zero. What a simulation keeps is the difference from them; the memory of a law with an ``advance``
        of its own is that difference itself.
    permission : callable, optional
        Parameters -> keywords beyond the fields without which ``make`` would refuse the set, as ``allow_active``.
    extends : str
        The law that this one is with its default parameters, if any: side by side they would be the same rows twice.

    Raises
    ------
    ValueError
        If the name is taken, another law of the same file has a class of parameters of the same name, functions are
        missing that belong together, or those of a law from outside the package do not do what is said here.
    """
    if parity and not callable(parity):
        raise ValueError(f"friction law {name!r}: parity must be a function of the parameters, got {parity!r}")
    memory = {"memory_size": memory_size, "advance": advance, "rate": rate, "stored_energy": stored_energy}
    given = {"rest": rest, **memory, "cut_back": cut_back, "torque": torque, "mean_torque": mean_torque, "solve": solve}
    functions = _complete(name, parameters, dict(given))
    relaxing = ode.rest_torque if functions["mean_torque"] is ode.mean_torque else _relaxing
    law = Law(
        name=name,
        parameters=parameters,
        make=make,
        fitted=fitted,
        units=dict(units or {}),
        steepest_fall=steepest_fall or (lambda p, torque_scale, h: 0.0),
        relaxes=relaxes,
        continuous=continuous,
        wide=wide,
        rest_torque=relaxing if relaxes else _resting,
        modes=modes or (lambda p: 0),
        parity=functools.partial(_checked_parity, name, memory_size or (lambda p: 0), parity),
        permission=permission or (lambda p: {}),
        extends=extends,
        **functions,
    )
    if not parameters.__module__.startswith(_PACKAGED_MODULES):
        _try(law, given)
    LAWS.register(name, law, parameters)


_PACKAGED_MODULES = "steer_env.friction.models."  # modules of the laws that come with the package, which its tests try
_ARGUMENTS = {  # of the functions of a law, as :func:`register` describes them; what is at rest comes first
    "rest": "p, memory",
    "torque": "p, torque_scale, memory, w",
    "advance": "p, torque_scale, memory, w, h",
    "rate": "p, torque_scale, memory, w, out",
    "stored_energy": "p, memory",
    "mean_torque": "p, torque_scale, memory, w, h",
    "solve": "p, torque_scale, memory, S, R, h, w_guess",
    "cut_back": "p, torque_scale, memory",
}


def _checked_parity(name: str, memory_size: Callable, parity: Callable | None, p: Any) -> tuple[str, ...]:
    n = int(memory_size(p))
    found = tuple(parity(p)) if parity else ("odd",) * n
    if len(found) != n or not {*found} <= {"odd", "even"}:
        raise ValueError(
            f"friction law {name!r}: parity must be 'odd' or 'even' for each of the {n} floats of memory_size, "
            f"got {found!r}"
        )
    return found


def _try(law: Law, given: Mapping[str, Any]) -> None:
    """Run the functions that a law's file gives, as plain Python, to both sides of zero.

    Compiled, a function would write beyond its memory into that of its caller.
    """
    try:
        p = law.make()
    except TypeError as error:
        raise ValueError(f"friction law {law.name!r}: make takes keywords, all with defaults: {error}") from None
    parity = law.parity(p)
    n = len(parity)
    start = np.zeros(n)
    for name, function in ((name, given[name]) for name in _ARGUMENTS if given.get(name)):
        told = f"friction law {law.name!r}: {name}({_ARGUMENTS[name]})"
        for w in (0.0, 0.01, -0.01, 3.0, -3.0):
            around = np.full((2, n + 2), _GUARD)
            memory, out = around[0, 1:-1], around[1, 1:-1]
            memory[:], out[:] = start, 0.0
            values = {
                "p": p,
                "torque_scale": np.float64(1.0),
                "memory": memory,
                "w": np.float64(w),
                "h": 1e-3,
                "out": out,
            }
            values |= {"S": 100.0, "R": np.float64(100.0 * w), "w_guess": 0.0}
            try:
                with np.errstate(all="ignore"):  # as compiled code, a quotient of zero is no error in itself
                    found = plainly(function)(*(values[each] for each in _ARGUMENTS[name].split(", ")))
            except Exception as error:
                raise ValueError(f"{told} raises at w = {w:g}: {error!r}") from error
            if not (np.isfinite(around).all() and np.isfinite([] if found is None else found).all()):
                entries = (
                    f"{each}[{i}] is {values[each][i]}"
                    for each in ("memory", "out")
                    for i in np.flatnonzero(~np.isfinite(values[each]))
                )
                raise ValueError(f"{told} is not finite at w = {w:g}: {', '.join(entries) or found}")
            if (around[:, [0, -1]] != _GUARD).any():
                raise ValueError(f"{told} writes beyond the {n} floats of memory_size")
            numbers = {"mean_torque": 2, "torque": 1, "solve": 1, "stored_energy": 1}.get(name, 0)
            if np.size([] if found is None else found) != numbers:
                raise ValueError(f"{told} must return {numbers or 'no'} numbers, got {found!r}")
        if name == "rest":
            start = memory
            for i in np.flatnonzero(start):
                if parity[i] == "odd":
                    raise ValueError(
                        f"{told}: memory[{i}] is odd and must be 0 at rest, got {start[i]:g}; parity says what is even"
                    )


_GUARD = 7.25  # beside a memory that is tried


def _complete(name: str, parameters: type, given: dict[str, Any]) -> dict[str, Any]:
    """All functions of a law from those that its file gives; one that is left out is None."""
    cut_back, rest = given.pop("cut_back"), given.pop("rest")
    missing = [key for key in ("memory_size", "rate", "stored_energy", "advance") if given[key] is None]
    if given["mean_torque"] is None and given["solve"] is None:
        if missing != ["advance"]:
            raise ValueError(
                f"friction law {name!r} needs mean_torque or solve; a law with memory_size, rate and stored_energy may"
                " leave them out together with advance, and is integrated"
            )
        size, rate, torque, energy = (given[key] for key in ("memory_size", "rate", "torque", "stored_energy"))
        own = rate, torque, energy, cut_back or ode.no_cut, rest or ode.no_rest
        ode.EQUATIONS[parameters] = ode.Equation(size, *own)
        return {key: getattr(ode, key, _newton) for key in given}
    if cut_back:
        raise ValueError(f"friction law {name!r}: cut_back is for laws that are integrated; others cut in advance")
    if rest:
        raise ValueError(
            f"friction law {name!r}: rest is for laws that are integrated; the memory of others is zero at rest, the "
            "difference from the value there"
        )
    if missing and len(missing) < 4:
        raise ValueError(f"friction law {name!r} needs all or none of memory_size, advance, rate and stored_energy")
    without = {"memory_size": lambda p: 0, "advance": _no_advance, "rate": _no_rate, "stored_energy": _no_energy}
    return {**given, "solve": given["solve"] or _newton, **(without if missing else {})}


def available() -> tuple[str, ...]:
    """Names of the registered laws, in alphabetical order."""
    return LAWS.available()


def law_of(p: Any) -> Law:
    """The law that the class of these parameters belongs to.

    Raises
    ------
    ValueError
        If ``p`` is not an instance of a registered parameter class.
    """
    law = LAWS.of(type(p))
    if law is None:
        names = ", ".join(available())
        raise ValueError(f"{p!r} is not a set of friction parameters; make one with friction.make({names})")
    return law


def make(name: str, **parameters: Any) -> Any:
    """Parameters of the law called ``name``; those not given take the default car's calibration.

    Raises
    ------
    ValueError
        For an unknown name or key, with the valid ones, and for a value that the law does not allow.
    """
    return _make(name, parameters)


def _make(name: str, parameters: Mapping[str, Any]) -> Any:
    return construct(f"friction law {name!r}", LAWS[name].make, parameters)


def resolve(friction: Any) -> Any:
    """Parameters of a law from every form in which a law may be given.

    Parameters
    ----------
    friction : str, mapping or parameters
        The name of a law, for its defaults; a name with parameters as the command line takes it, ``"lugre,F_c=1.2"``,
        a list of numbers as ``a:b:c``; the name of a file with a fitted law, which ends in ``.json``
        (:mod:`steer_env.friction.fitted_file`); a mapping, ``{"law": "lugre", "F_c": 1.2}``; or parameters from
        :func:`make`, which are returned unchanged.

    Raises
    ------
    ValueError
        For another form, an unknown law or parameter, or a value that the law does not allow.
    """
    if _find(friction):
        return friction
    name, given = parts(friction)
    try:
        return _make(name, given)
    except ValueError as error:
        if fitted_file.is_file_name(friction):
            raise ValueError(f"{friction}: {error}") from None
        raise


def parts(friction: Any) -> tuple[str, dict[str, Any]]:
    """Name of the law and the parameters that are given, from a form of :func:`resolve`; they are not checked."""
    if fitted_file.is_file_name(friction):
        path, friction = friction, fitted_file.read(friction)
        if "law" not in friction:
            raise ValueError(f"{path} holds friction at {', '.join(friction)}, where one law is needed")
        if friction["law"] not in available():
            raise ValueError(
                f"{path} holds the friction law {friction['law']!r}, which is not registered here: import the module "
                f"that registers it, on the command line with --import MODULE; available: {', '.join(available())}"
            )
    if isinstance(friction, str):
        name, *pairs = friction.split(",")
        given: dict[str, Any] = {}
        for pair in pairs:
            key, equals, value = pair.partition("=")
            if not equals or key in given:
                raise ValueError(f"expected {LAW_SYNTAX}, each key once, got {friction!r}")
            given[key] = value.split(":") if ":" in value else read_number(value)
        return name, given
    if isinstance(friction, Mapping) and "law" in friction:
        given = dict(friction)
        return given.pop("law"), given
    if not _find(friction):
        raise ValueError(
            f"{friction!r} is not a set of friction parameters; give a name ({', '.join(available())}), text as"
            f" 'masing,elements=20', a mapping as {EXAMPLE}, or parameters from friction.make"
        )
    return law_of(friction).name, _keywords(friction)


def _keywords(parameters: Any) -> dict[str, Any]:
    """What ``make`` takes for these parameters."""
    return {**parameters._asdict(), **law_of(parameters).permission(parameters)}


def as_mapping(parameters: Any) -> dict[str, Any]:
    """The mapping that :func:`resolve` turns into these parameters again, of what JSON holds without loss.

    Raises
    ------
    ValueError
        If they are not parameters of a registered law.
    """
    values = {key: np.asarray(value).tolist() for key, value in _keywords(parameters).items()}
    return {"law": law_of(parameters).name, **values}


def scaled(parameters: Any, share: float) -> dict[str, Any]:
    """The mapping, as of :func:`as_mapping`, of the law whose torque is a share of this one's in every motion [1].

    Raises
    ------
    ValueError
        For a law that does not say the unit of each of its parameters.
    """
    law, mapping = law_of(parameters), as_mapping(parameters)
    units = law.units
    for name in mapping.keys() - {"law"} - law.permission(parameters).keys():
        if name not in units:
            raise ValueError(f"law {mapping['law']!r} has a share only where its units name {name!r}")
        if units[name].startswith("N m"):
            mapping[name] = (share * np.asarray(mapping[name])).tolist()
    return mapping


def _find(parameters: Any) -> bool:
    return LAWS.of(type(parameters)) is not None


# The dispatch points. Plain Python runs their bodies; compiled code takes the function of the law instead.


def advance(p, torque_scale, memory, w, h):
    """Advance the memory over ``h`` [s] at constant speed ``w`` [rad/s]."""
    law_of(p).advance(p, torque_scale, memory, w, h)


def torque(p, torque_scale, memory, w):
    """Torque at this moment [N m]; a simulation takes the mean over a step, which :func:`step` returns."""
    return law_of(p).torque(p, torque_scale, memory, w)


def rate(p, torque_scale, memory, w, out):
    """Write the time derivative of the memory at speed ``w`` [rad/s] into ``out``."""
    law_of(p).rate(p, torque_scale, memory, w, out)


def stored_energy(p, memory):
    """Energy that the memory can give back [J]."""
    return law_of(p).stored_energy(p, memory)


def mean_torque(p, torque_scale, memory, w, h):
    """Exact mean torque over ``h`` at constant ``w`` [N m], and its derivative by ``w`` [N m s/rad]."""
    law = law_of(p)
    if law.mean_torque is None:
        raise TypeError(f"friction law {law.name!r} solves its step itself and has no mean_torque")
    return law.mean_torque(p, torque_scale, memory, w, h)


def solve(p, torque_scale, memory, S, R, h, w_guess):
    """Speed ``w`` [rad/s] with ``S w + mean_torque(w) = R``."""
    return law_of(p).solve(p, torque_scale, memory, S, R, h, w_guess)


def rest_torque(p, torque_scale, memory, h):
    """Mean torque of a step of ``h`` [s] at rest [N m]: the side of a motion is that to which R exceeds it."""
    return law_of(p).rest_torque(p, torque_scale, memory, h)


for _point in (advance, torque, rate, stored_energy, mean_torque, solve, rest_torque):
    dispatch(_point, lambda parameters, name: getattr(LAWS.of(parameters), name, None))


def _resting(p, torque_scale, memory, h):
    return torque(p, torque_scale, memory, 0.0)


def _relaxing(p, torque_scale, memory, h):
    return mean_torque(p, torque_scale, memory, 0.0, h)[0]


def _newton(p, torque_scale, memory, S, R, h, w_guess):
    return newton(p, torque_scale, memory, S, R, h, w_guess, rest_torque(p, torque_scale, memory, h))


@kernel
def newton(p, torque_scale, memory, S, R, h, w_guess, rest):
    """Safeguarded Newton iteration for ``S w + mean_torque(w) = R``.

    The root lies on the side of zero that ``R`` minus ``rest``, the mean torque of a step at rest, points to. The
    iteration keeps a bracket on that side and replaces a step that would leave the bracket by a bisection, so the kink
    at zero cannot make it cycle.
    """
    excess = R - rest
    moves = (abs(excess) > 0.0) & (abs(excess) < math.inf)
    if not any_of(moves):
        return excess  # zero, or a value that is not finite and must be passed on
    side = where(excess > 0.0, 1.0, -1.0)
    low = 0.0
    high = -1.0  # negative while no upper end of the bracket is known
    s = side * w_guess
    if any_of(s <= 0.0):
        first = abs(excess) / (S + mean_torque(p, torque_scale, memory, side * 0.0, h)[1])
        s = where(s <= 0.0, where(first > 0.0, first, abs(excess) / S), s)
    going = moves
    for _ in range(100):
        F, slope = mean_torque(p, torque_scale, memory, side * s, h)
        residual = side * (S * side * s + F - R)
        beyond = residual > 0.0
        low, high = where(beyond, low, s), where(beyond, s, high)
        gradient = S + slope
        new = where(gradient > 0.0, s - residual / gradient, -1.0)
        found = abs(new - s) <= 1e-9 * s  # quadratic convergence: the step after this one would be below rounding
        bounded = high > 0.0
        leaves = invert(found) & ((new <= low) | (bounded & (new >= high)))
        middle = where(bounded, 0.5 * (low + high), 2.0 * s)
        spent = leaves & bounded & invert((low < middle) & (middle < high))  # down to neighbouring floats
        s = where(going & invert(spent), where(leaves, middle, new), s)
        going = going & invert(found | spent)
        if not any_of(going):
            break
    return where(moves, side * s, excess)


def _for_kernels(p: Any) -> Any:
    return p.for_kernels() if hasattr(p, "for_kernels") else p


@binds(0, _for_kernels)
@kernel
def step(p, torque_scale, memory, S, R, h, w_guess):
    """Solve ``S w + T = R`` (F7) over a step of ``h`` [s] and advance the memory; the same for every law.

    Returns
    -------
    w : float
        Mean speed over the step [rad/s].
    T : float
        Mean torque over the step [N m], from the step equation, so that the energy balance is exact.
    """
    w = solve(p, torque_scale, memory, S, R, h, w_guess)  # (F7)
    advance(p, torque_scale, memory, w, h)
    return w, R - S * w
