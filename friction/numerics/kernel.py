"""The one place that decides how kernels are compiled: its decorators, and the choice of the compiler behind them.

A kernel is a small scalar function decorated with :func:`kernel`. It is compiled by numba without fast-math (mirror
symmetry has to be exact) and without the GIL (rows of a batch run in threads), and its machine code is kept on disk
(:mod:`steer_env.friction.numerics.cache`).

``STEER_ENV_COMPILER=numba`` selects numba's own compiler, through its public options, and ``STEER_ENV_COMPILER=fast``
:mod:`steer_env.friction.numerics.compiler_fast`, which compiles in half the time and to the same numbers but builds on
numba's internals. Without the variable the fast one is taken where it was tested with the numba that is installed.
Where the fast one fails, numba's own takes over.
"""

import os
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.extending import overload

from steer_env.friction.numerics import cache
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.stamp import POINTS

# Of numba, those that the fast compiler was tested with: docs/compatibility.md.
FAST_VERSIONS = ("0.61", "0.62", "0.63", "0.64", "0.65", "0.66", "0.67", "0.68")
COMPILED = not numba.config.DISABLE_JIT  # type: ignore[attr-defined]  # False: kernels are plain Python


def _chosen_compiler() -> str:
    """``"fast"`` or ``"numba"``, by the environment variable or else by the version of numba."""
    choice = os.environ.get("STEER_ENV_COMPILER", "")
    if choice not in ("", "numba", "fast"):
        raise ValueError(f"STEER_ENV_COMPILER must be 'numba' or 'fast', or unset for the best choice, got {choice!r}")
    tested = ".".join(numba.__version__.split(".")[:2]) in FAST_VERSIONS
    if not (choice or tested):
        cache.say(
            "version",
            f"numba {numba.__version__} is not among the versions that the fast compiler was tested with "
            f"({', '.join(FAST_VERSIONS)}); numba's own compiles the kernels, which takes longer",
        )
    return choice or ("fast" if tested else "numba")


_fast: Any = None  # the module of the fast compiler, where it is the one
if COMPILED and _chosen_compiler() == "fast":
    try:
        from steer_env.friction.numerics import compiler_fast as _fast
    except Exception as error:  # numba has renamed something that the fast compiler builds on
        cache.say("compiler", f"the fast compiler cannot be loaded ({error!r}); numba's own takes over")


def _by_numba(function: Callable, **options: Any) -> Any:
    """A kernel as numba's own compiler compiles it, through its public options alone."""
    dispatcher: Any = numba.njit(nogil=True, error_model="numpy", **options)(function)
    compile = dispatcher.compile
    dispatcher.compile = lambda signature: cache.compile_cached(dispatcher, signature, compile, "numba")
    return dispatcher


def kernel(function: Callable) -> Any:
    """Compile a scalar kernel on first use; plain Python under ``NUMBA_DISABLE_JIT=1``."""
    if not COMPILED:
        return function
    return _by_numba(function) if _fast is None else _fast.kernel(function, _by_numba)


def part(function: Callable) -> Any:
    """A kernel with one caller, merged into it before anything is compiled: it compiles sooner."""
    if not COMPILED:
        return function
    merged = {"inline": "always"}
    return _by_numba(function, **merged) if _fast is None else _fast.kernel(function, _by_numba, **merged)


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

    options: Any = {**({"error_model": "numpy"} if _fast is None else _fast.dispatch_options(point)), **more}
    overload(point, jit_options=options, strict=False)(chosen)


def plain(function: Any) -> Any:
    """A kernel as plain Python, for so few calls that compiling it would take longer."""
    return getattr(function, "py_func", function)


def record(parameters: Any) -> np.recarray:
    """A ``NamedTuple`` of floats as a record array (1,), whose element ``[0]`` serves the kernels in its place.

    A kernel takes the record by its address; the tuple would be unpacked, float by float, at every call from Python.
    """
    return frozen(np.rec.array([tuple(parameters)], dtype=[(key, np.float64) for key in parameters._fields]))


def bind(function: Any, *arguments: Any) -> Callable:
    """Entry point of ``function`` compiled for the types of these example arguments.

    Looking up a signature with nested parameter tuples costs ten times the unpacking of them;
    a loop that always passes the same types does it once. Wrong types are undefined behaviour.
    """
    if not COMPILED:
        return function
    signature = tuple(numba.typeof(argument) for argument in arguments)
    function.compile(signature)
    return function.get_overload(signature)


def short_arithmetic(kind: Any) -> None:
    """Tell the fast compiler that a type's arithmetic is that of LLVM's own instructions for floats."""
    if _fast is not None:
        _fast.short_arithmetic(kind)
