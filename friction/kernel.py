"""The one place that decides how kernels are compiled and where the machine code is cached.

A kernel is a small scalar function decorated with :func:`kernel`. It is compiled by numba
without fast-math (mirror symmetry has to be exact) and without the GIL (lanes run in threads),
and cached on disk. numba's own cache looks only at the file that holds the kernel, so a change
in a callee of another file would serve stale code; here the directory is named by a digest of
every source file of the packages that a kernel can reach, so any change starts a fresh one.
"""

import hashlib
import marshal
import os
import platform
import tempfile
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import numba
import numba.core.config
import numpy as np
import platformdirs
from numba.core.registry import CPUDispatcher
from numba.extending import overload

config: Any = numba.core.config  # its names are made at run time
COMPILED = not config.DISABLE_JIT  # False under NUMBA_DISABLE_JIT=1: kernels are plain Python

_dispatchers: dict[Any, int] = {}  # kernel -> number of sources known when its cache folder was chosen
_digests: dict[str, str] = {}  # package folder or foreign law -> digest, in order of import


def _digest_of(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _package_root(file: Path) -> Path | None:
    """Topmost folder with an ``__init__.py`` that holds ``file``; None for a lone module."""
    root = None
    for folder in file.parents:
        if not (folder / "__init__.py").exists():
            break
        root = folder
    return root


def _add_sources(function: Callable) -> None:
    """Count the sources behind ``function``, once."""
    file = Path(function.__code__.co_filename)
    if not file.is_file():  # typed at a prompt: the code object is all there is
        key, digest = repr(function), hashlib.sha256(marshal.dumps(function.__code__)).hexdigest()
    else:
        root = _package_root(file)
        key = str(root or file)
        if key in _digests:
            return
        digest = _digest_of(list(root.rglob("*.py")) if root else [file])
    _digests[key] = digest


def cache_directory() -> Path | None:
    """Folder of the machine code for the sources known so far; None where none is writable.

    ``NUMBA_CACHE_DIR``, if set, is the parent; else the user's cache folder.
    """
    parent = Path(os.environ.get("NUMBA_CACHE_DIR") or platformdirs.user_cache_dir("steer_env"))
    text = "".join([numba.__version__, platform.processor(), config.CPU_NAME or "", *_digests.values()])
    folder = parent / hashlib.sha256(text.encode()).hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return None


def _cache(dispatcher: Any) -> None:
    """Point a kernel at the current cache folder, or at none."""
    _dispatchers[dispatcher] = len(_digests)
    folder = cache_directory()
    if folder is None:
        return
    previous = config.CACHE_DIR
    try:
        for part, kernel_ in ((folder, dispatcher), (folder / "inner", dispatcher.inner)):
            config.CACHE_DIR = str(part)  # read once, when the dispatcher chooses its locator
            kernel_.enable_caching()
    except RuntimeError:
        pass  # no source file to stamp (a kernel typed at a prompt): compile in memory
    finally:
        config.CACHE_DIR = previous


class _Kernel(CPUDispatcher):
    """A kernel as Python calls it; compiled callers take ``inner``, which lacks the entry point for Python.

    Unpacking a hundred parameters for an entry point that nothing calls would be a sixth of the compile time.
    """

    @cached_property
    def inner(self) -> CPUDispatcher:
        return CPUDispatcher(self.py_func, targetoptions={**self.targetoptions, "no_cpython_wrapper": True})

    @property
    def _numba_type_(self) -> numba.types.Dispatcher:
        return numba.types.Dispatcher(self.inner)  # type: ignore[arg-type]  # numba's annotations see a method


def part(function: Callable) -> Any:
    """A kernel with one caller, merged into it before anything is compiled: it compiles sooner."""
    return kernel(function, {"inline": "always"})


def kernel(function: Callable, inlining: dict[str, Any] = {"forceinline": True}) -> Any:  # noqa: B006 (never changed)
    """Compile a scalar kernel on first use; plain Python under ``NUMBA_DISABLE_JIT=1``.

    Kernels pass parameter tuples by value, so they are inlined: a call would copy up to a hundred floats.
    """
    if not COMPILED:
        return function
    _add_sources(function)
    options = {"nopython": True, "nogil": True, "error_model": "numpy", **inlining}
    # No C callback: nothing takes one. No reference counts: kernels own no arrays, and one that allocates is refused.
    # Both would go through every number of the parameters: a quarter of the compile time.
    options |= {"no_cfunc_wrapper": True, "_nrt": False}
    dispatcher = _Kernel(function, targetoptions=options)
    _cache(dispatcher)
    return dispatcher


def dispatch(point: Callable, choose: Callable[[type, str], Any]) -> None:
    """Make compiled code take, for a call of ``point(p, ...)``, the function for the class of the parameters ``p``.

    ``choose(class, name of the point)`` returns it, or None. It is looked up at compile time and compiled as part of
    the caller, so nothing is passed at run time and everything caches; plain Python runs the body of ``point``.
    """
    if not COMPILED:
        return

    def chosen(p, *_):
        function = choose(getattr(p, "instance_class", type(None)), point.__name__)
        return getattr(function, "py_func", function)

    overload(point, strict=False)(chosen)


def record(parameters: Any) -> np.recarray:
    """A ``NamedTuple`` of floats as a record array (1,), whose element ``[0]`` serves the kernels in its place.

    A kernel takes the record by its address; the tuple would be unpacked, float by float, at every call from Python.
    """
    return np.rec.array([tuple(parameters)], dtype=[(key, np.float64) for key in parameters._fields])


def include_sources(*functions: Callable) -> None:
    """Make the cache depend on a law from outside the packages too.

    Compiled callers inline the law, so every kernel older than it moves to a folder named after it.
    """
    if not COMPILED:
        return
    for function in functions:
        _add_sources(function)
    for dispatcher, known in _dispatchers.items():
        if known < len(_digests):
            _cache(dispatcher)


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
