"""The digest of everything that the machine code of a kernel depends on.

numba's own cache looks at the file that holds the kernel only, and would serve stale code after a change of a callee,
of a friction law or of a constant in another file. :func:`source_hash` therefore counts whole files: that of the
kernel, those of the classes in its signature, which select functions at dispatch points, and of all modules that these
refer to by any name, with the constants and functions that their names stand for now. Of a package that loads its
modules when they are asked for it counts what is asked for; an installed package of somebody else with size and date of
the file that is referred to. What has no file, or one that was edited while the process runs, is refused, and the
kernel is then compiled without a cache: a stale kernel would give wrong results, a missing cache only costs time.
"""

import functools
import hashlib
import operator
import os
import platform
import re
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

_START = time.time()  # a source file that changed after this may differ from what was imported
_PROJECT = __name__.partition(".")[0]
_INSTALLED = tuple(Path(sysconfig.get_path(kind)) for kind in ("purelib", "platlib"))  # where others' packages lie
_STANDARD = Path(os.__file__).resolve().parent
_UNCOUNTED_SETTINGS = (  # settings of numba that leave the code as it is, or that numba sets itself as it runs
    *("CACHE_DIR", "CACHE_LOCATOR_CLASSES", "DEBUG_CACHE", "COLOR_SCHEME", "RUNNING_UNDER_PROFILER", "USING_SVML"),
    *("NUMBA_NUM_THREADS", "NUMBA_DEFAULT_NUM_THREADS", "THREADING_LAYER"),
)


# How kernels are compiled and kept, whose numbers change as they are.
_MACHINERY = tuple(f"{__package__}.{name}" for name in ("cache", "compiler", "kernel", "source_hash"))


_CODE = FunctionType | Dispatcher
POINTS: dict[Callable, Callable[[type, str], Any]] = {}  # dispatch point -> (class, name of the point) -> function


class UndecidableError(Exception):
    """A kernel refers to something of which no source is known."""


def source_hash(kernel: Any, signature: tuple, compiler: str) -> str:
    """Digest of what the machine code of a kernel depends on.

    Parameters
    ----------
    kernel : dispatcher
        As :func:`steer_env.friction.numerics.kernel.kernel` makes it.
    signature : tuple of numba types
        The types of the arguments.
    compiler : {"numba", "fast"}

    Returns
    -------
    str
        Hexadecimal digits.

    Raises
    ------
    UndecidableError
        If the kernel refers to a thing whose source this module cannot find.
    """
    files: dict[str, str] = {}
    classes = {made_of for kind in signature for made_of in _classes(kind)}
    chosen = ((point, choose(made_of, point.__name__)) for made_of in classes for point, choose in POINTS.items())
    selected = [(point.__name__, getattr(each, "py_func", each)) for point, each in chosen if isinstance(each, _CODE)]
    functions = [("", kernel.py_func), *selected]
    for thing in (*classes, *(function for _, function in functions)):
        name = thing.__module__
        if getattr(sys.modules.get(name), "__file__", None) is None and name != "builtins":
            raise UndecidableError(f"{name} has no source file")
        _count(sys.modules[name], files)
    for point, function in functions:
        closed = [_value(cell.cell_contents) for cell in function.__closure__ or ()]
        if None in closed:
            raise UndecidableError(f"{function.__qualname__} closes over more than constants")
        files[f"{point} {function.__module__}.{function.__qualname__}"] = repr(closed)
    counted = sorted(f"{file} {digest}" for file, digest in files.items())
    return _hash(_environment(compiler), kernel.py_func.__qualname__, *map(str, signature), *counted)


def _classes(kind: Any) -> Iterator[type]:
    """The classes of all tuples within a numba type."""
    if isinstance(made_of := getattr(kind, "instance_class", None), type):
        yield made_of
    for member in (*getattr(kind, "types", ()), *getattr(kind, "parts", ())):
        yield from _classes(member)


def _count(module: ModuleType, files: dict[str, str]) -> None:
    """Count a module: its file, and all modules that it refers to."""
    name, where = module.__name__, getattr(module, "__file__", None) or ""
    root = name.partition(".")[0]
    if name in files or _by_version(root, where):
        return
    file = Path(where)
    if root != _PROJECT and any(file.is_relative_to(folder) for folder in _INSTALLED):
        found = _unchanged(file).stat()
        files[name] = f"{found.st_size} {found.st_mtime_ns}"
        return
    files[name] = _digest(file) if where else "a folder"
    if _lazy(module):  # which names it holds depends on what was asked for
        return
    known = _known.get(module)
    if known is None or not known.holds(module):
        text = file.read_bytes() if file.is_file() else b""
        known = _known[module] = _known_now(module, text)
    files.update(known.values)
    for each in known.modules:
        if each in sys.modules:
            _count(sys.modules[each], files)


class _ModuleNames(NamedTuple):
    """What the names of a module stand for."""

    names: tuple[str, ...]
    members: list[tuple[ModuleType, str]]  # packages that load their modules when asked, and what is asked for
    things: list[Any]  # that the names and members stand for
    fixed: bool  # whether none of the things changes by itself
    values: dict[str, str]  # of the constants
    modules: dict[str, None]  # in their order

    def holds(self, module: ModuleType) -> bool:
        """Whether the names stand for the same things now."""
        names = tuple(vars(module))
        return self.fixed and names == self.names and all(map(operator.is_, self.things, _things(module, self.members)))


_known: dict[ModuleType, _ModuleNames] = {}


def _known_now(module: ModuleType, text: bytes) -> _ModuleNames:
    held = dict(vars(module))
    lazy = [(key, value) for key, value in held.items() if _lazy(value)]
    members = [
        (value, name.decode()) for key, value in lazy for name in re.findall(rb"\b%s\.(\w+)" % key.encode(), text)
    ]
    things = _things(module, members)
    counted = {key: value for key, value in held.items() if module.__name__ not in _MACHINERY and key[:2] != "__"}
    return _ModuleNames(
        tuple(held),
        members,
        things,
        not any(map(_changes, counted.values())),
        {  # what is set while the process runs counts too
            # Not with a point, which makes the name of a module in a package.
            f"{module.__name__}:{key}": _value(value) or f"{type(value)} {getattr(value, '__qualname__', '')}"
            for key, value in counted.items()
        },
        dict.fromkeys(name for each in things for name in _modules_of(each)),
    )


def _things(module: ModuleType, members: list[tuple[ModuleType, str]]) -> list[Any]:
    return [*vars(module).values(), *(getattr(package, name, None) for package, name in members)]


def _changes(value: Any) -> bool:
    """Whether a counted constant may be another one though it is the same object."""
    return isinstance(value, np.ndarray | list) or (isinstance(value, tuple) and any(map(_changes, value)))


def _modules_of(thing: Any) -> Iterator[str]:
    """Names of a module, or of that of a function or class, or of those of a tuple or list of them."""
    if type(thing) in (tuple, list):
        for each in thing:
            yield from _modules_of(each)
    name = thing.__name__ if isinstance(thing, ModuleType) else getattr(thing, "__module__", None)
    if isinstance(name, str):
        yield name


def _lazy(thing: Any) -> bool:
    """Whether a package loads its modules when they are asked for."""
    return isinstance(thing, ModuleType) and {"__getattr__", "__path__"} <= vars(thing).keys()


def _value(value: Any) -> str | None:
    """Digest of a constant that compiled code may freeze; None for anything else."""
    if value is None or isinstance(value, bool | int | float | complex | str | bytes):
        return f"{type(value).__name__} {value!r}"
    if isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
        return _hash(type(value), value.dtype, np.shape(value), np.asarray(value).tobytes())
    if isinstance(value, tuple):
        members = [_value(each) for each in value]
        return None if None in members else _hash(type(value), getattr(value, "_fields", ()), *members)
    return None


@functools.cache
def _by_version(root: str, file: str) -> bool:
    """Whether a module belongs to Python, numba, llvmlite or numpy, which :func:`_environment` counts."""
    own = root in sys.stdlib_module_names and (not file or Path(file).resolve().is_relative_to(_STANDARD))
    return own or root in (
        "builtins",
        "numba",
        "llvmlite",
        "numpy",
    )  # a user's file may have the name of one of Python's


@functools.cache
def _digest(file: Path) -> str:
    return _hash(_unchanged(file).read_bytes())


def _unchanged(file: Path) -> Path:
    """The file, if it is as it was when the process started; else, or where there is none, UndecidableError."""
    try:
        found = file.stat()
    except OSError as error:
        raise UndecidableError(f"{file} cannot be read") from error
    if max(found.st_mtime, found.st_ctime) > _START:  # the latter where a file with an old date was put in its place
        raise UndecidableError(f"{file} changed while the process was running")
    return file


@functools.cache
def _environment(compiler: str) -> str:
    """Digest of what every kernel depends on: versions, processor and settings of numba."""
    options = {
        name: value for name, value in vars(numba.config).items() if name.isupper() and name not in _UNCOUNTED_SETTINGS
    }
    settings = sorted((name, value) for name, value in options.items() if isinstance(value, bool | int | float | str))
    versions = [module.__version__ for module in (numba, llvmlite, np)]
    processor = [platform.machine(), llvmlite.binding.get_host_cpu_name()]
    return _hash(sys.version, compiler, *versions, *processor, repr(settings))


def _hash(*parts: Any) -> str:
    """Digest of strings and bytes, each of which counts with its length."""
    digest = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else str(part).encode()
        digest.update(f"{len(data)}:".encode())
        digest.update(data)
    return digest.hexdigest()
