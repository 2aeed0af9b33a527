"""The one place that decides how kernels are compiled: its decorators, and the choice of the compiler behind them.

A kernel is a small scalar function decorated with :func:`kernel`. It is compiled by numba without fast-math (mirror
symmetry has to be exact) and without the GIL (rows of a batch run in threads), and its machine code is kept on disk
(:mod:`steer_env.friction.numerics.cache`).

:mod:`steer_env.friction.numerics.compiler` compiles in half the time of numba's own compiler, but builds on numba's
internals. Where a version of numba lacks one of them, and where ``STEER_ENV_COMPILER=numba`` says so, numba's own
compiler takes over, with the same options and to the same numbers.
"""

import functools
import os
from collections.abc import Callable
from inspect import signature
from types import FunctionType
from typing import Any

import numba
import numpy as np
from numba.extending import overload

from steer_env.friction.numerics import cache
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.source_hash import POINTS

COMPILED = not numba.config.DISABLE_JIT  # type: ignore[attr-defined]  # False: kernels are plain Python

# Kernels pass parameter tuples by value, so they are inlined: a call would copy up to a hundred floats. There is no C
# callback, as nothing takes one, and no counting of references, as kernels own no arrays. What is not said here numba
# would take from the caller that compiles a kernel first, fast-math too (findings/numba_options_of_first_caller.sh).
_FIXED: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "_nrt": False,
    "fastmath": False,
}


def _chosen_compiler() -> Any:
    """The module of the fast compiler, or None for numba's own."""
    choice = os.environ.get("STEER_ENV_COMPILER", "")
    if choice not in ("", "numba", "fast"):
        raise ValueError(f"STEER_ENV_COMPILER must be 'numba' or 'fast', or unset for the fast one, got {choice!r}")
    if choice != "numba" and COMPILED:
        try:
            from steer_env.friction.numerics import compiler

            return compiler
        except Exception as error:  # numba has renamed something that the fast compiler builds on
            cache.say("compiler", f"the fast compiler cannot be loaded ({error!r}); numba's own takes over")
    return None


_fast = _chosen_compiler()
COMPILER = "fast" if _fast else "numba"


def _dispatcher(function: Callable, **inlining: Any) -> Any:
    """A function that is compiled for each new signature or read from the cache."""
    options = _FIXED | inlining
    dispatcher: Any = _fast.Kernel(function, options) if _fast else numba.njit(**options)(function)
    compile = dispatcher.compile
    dispatcher.compile = lambda signature: cache.compile_cached(dispatcher, signature, compile, COMPILER)
    return dispatcher


def kernel(function: Callable) -> Any:
    """Compile a scalar kernel on first use; plain Python under ``NUMBA_DISABLE_JIT=1``."""
    return _dispatcher(function, forceinline=True) if COMPILED else function


def separate_kernel(function: Callable) -> Any:
    """A kernel that stays a function of its own in compiled callers: translated once, whatever calls it."""
    return _dispatcher(function, forceinline=False) if COMPILED else function


def part(function: Callable) -> Any:
    """A kernel with one caller, merged into it before anything is compiled: it compiles sooner."""
    return _dispatcher(function, inline="always") if COMPILED else function


def dispatch(point: Callable, choose: Callable[[type, str], Any], **more: Any) -> None:
    """Make compiled code take, for a call of ``point(p, ...)``, the function for the class of the parameters ``p``.

    The choice is made at compile time and the function becomes part of the caller, so that nothing is passed at run
    time and everything can be cached. Plain Python runs the body of ``point``.

    Parameters
    ----------
    point : function
        Whose first argument selects.
    choose : (class, name of the point) -> function or None
        None where no function belongs to the class.
    **more
        Further options of ``numba.jit`` for the chosen function.
    """
    if not COMPILED:
        return

    POINTS[point] = choose

    def chosen(p, *_):
        return plain(choose(getattr(p, "instance_class", type(None)), point.__name__))

    options: Any = {"error_model": "numpy", "_nrt": False, "fastmath": False, "forceinline": True, **more}
    if _fast:
        options["pipeline_class"] = _fast.Drafter
    overload(point, jit_options=options, strict=False)(chosen)


def binds(position: int, bound: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Give a kernel's argument at a position bound where the caller is Python; kernels hand it over bound."""

    def decorated(compiled: Any) -> Any:
        taken = signature(plain(compiled))

        @functools.wraps(plain(compiled))
        def entry(*arguments, **named):
            if named:
                arguments = taken.bind(*arguments, **named).args
            return compiled(*arguments[:position], bound(arguments[position]), *arguments[position + 1 :])

        entry.kernel = compiled  # type: ignore[attr-defined]
        dispatch(entry, lambda kind, name: compiled)
        POINTS.pop(entry, None)  # no class selects it
        return entry

    return decorated


def plain(function: Any) -> Any:
    """A kernel as plain Python, for so few calls that compiling it would take longer."""
    return getattr(function, "py_func", function)


def plainly(function: Any, made: dict[Any, Any] | None = None) -> Any:
    """A kernel as plain Python, with all kernels that it calls by their names; ``made`` are those that are so."""
    code, made = plain(function), {} if made is None else made
    if code in made or not isinstance(code, FunctionType):
        return made.get(code, function)
    known = dict(code.__globals__)
    made[code] = FunctionType(code.__code__, known, argdefs=code.__defaults__, closure=code.__closure__)
    for name in code.__code__.co_names:
        if name in known and plain(known[name]) is not known[name]:
            known[name] = plainly(known[name], made)
    return made[code]


def record(parameters: Any) -> np.recarray:
    """A ``NamedTuple`` of floats as a record array (1,), whose element ``[0]`` serves the kernels in its place.

    A kernel takes the record by its address; the tuple would be unpacked, float by float, at every call from Python.
    """
    return frozen(np.rec.array([tuple(parameters)], dtype=[(key, np.float64) for key in parameters._fields]))


def bind(function: Any, *arguments: Any) -> Callable:
    """Entry point of ``function`` compiled for the types of these example arguments.

    Looking up a signature with nested parameter tuples costs ten times the unpacking of them;
    a loop that always passes the same types does it once. Wrong types are undefined behaviour. What :func:`binds`
    would bind has to be bound.
    """
    function = getattr(function, "kernel", function)
    if not COMPILED:
        return function
    signature = tuple(numba.typeof(argument) for argument in arguments)
    function.compile(signature)
    return function.get_overload(signature)
