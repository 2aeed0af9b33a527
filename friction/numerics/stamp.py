"""The digest of everything that the machine code of a kernel depends on.

numba's own cache looks at the file that holds the kernel only, and would serve stale code after a change of a callee,
of a friction law or of a constant in another file. :func:`stamp` therefore counts whole modules: that of the kernel,
those of the functions that the classes in its signature select at dispatch points, and all modules that these refer to
by any name. A module counts with its code and with the values of its constants, which compiled code freezes. What it
cannot decide it refuses, and the kernel is then compiled without a cache: a stale kernel would give wrong results, a
missing cache only costs time.

A module's code is that which Python imports, so comments and positions in a file do not count. A file that
was edited while the process runs is refused, as it may differ from what was imported.
"""

import functools
import hashlib
import os
import platform
import sys
import sysconfig
import time
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

_START = time.time()  # a source file that changed after this may differ from what was imported
_VERSIONED = {"numba": numba, "llvmlite": llvmlite, "numpy": np}  # packages that their version identifies
_PROJECT = __name__.partition(".")[0]
_INSTALLED = {Path(sysconfig.get_path(kind)) for kind in ("purelib", "platlib")}  # where others' packages lie
_STANDARD = Path(os.__file__).resolve().parent
# How kernels are compiled and kept; _environment counts what matters of it.
_MACHINERY = tuple(f"{__package__}.{name}" for name in ("cache", "compiler", "kernel", "stamp"))
_FREE = (  # settings of numba that leave the code as it is, or that numba sets itself as it runs
    *("CACHE_DIR", "CACHE_LOCATOR_CLASSES", "DEBUG_CACHE", "COLOR_SCHEME", "RUNNING_UNDER_PROFILER", "USING_SVML"),
    *("NUMBA_NUM_THREADS", "NUMBA_DEFAULT_NUM_THREADS", "THREADING_LAYER"),
)
_PLAIN = bool | int | float | complex | str | bytes

POINTS: dict[Callable, Callable[[type, str], Any]] = {}  # dispatch point -> (class, name of the point) -> function


class UndecidableError(Exception):
    """A kernel refers to something that cannot be stamped."""


def stamp(kernel: Any, signature: tuple, compiler: str) -> str:
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
    walk = _Walk()
    types = [walk.type_of(each) for each in signature]
    walk.function(kernel.py_func)
    return _hash(_environment(compiler), kernel.py_func.__qualname__, *types, *walk.all_parts())


@functools.cache
def _environment(compiler: str) -> str:
    """Digest of what every kernel depends on: versions, processor, settings of numba and the compiler's own sources."""
    options = {name: value for name, value in vars(numba.config).items() if name.isupper() and name not in _FREE}
    settings = sorted((name, value) for name, value in options.items() if isinstance(value, bool | int | float | str))
    versions = [module.__version__ for module in _VERSIONED.values()]
    processor = [platform.machine(), llvmlite.binding.get_host_cpu_name()]
    sources = [_unchanged(Path(__file__).with_name(name)).read_bytes() for name in ("kernel.py", "compiler.py")]
    return _hash(sys.version, compiler, *versions, *processor, repr(settings), *sources)


def _hash(*parts: Any) -> str:
    """Digest of strings and bytes, each of which counts with its length."""
    digest = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else str(part).encode()
        digest.update(f"{len(data)}:".encode())
        digest.update(data)
    return digest.hexdigest()


def _unchanged(file: Path) -> Path:
    """The file, if it is as it was when the process started; else, or where there is none, UndecidableError."""
    try:
        found = file.stat()
    except OSError as error:
        raise UndecidableError(f"{file} cannot be read") from error
    if max(found.st_mtime, found.st_ctime) > _START:  # the latter where a file with an old date was put in its place
        raise UndecidableError(f"{file} changed while the process was running")
    return file


def _code(module: ModuleType) -> CodeType:
    """The code of a module as Python imports it."""
    return _read(module, _unchanged(Path(getattr(module, "__file__", None) or "")))


@functools.cache  # what has not changed since the process started is read once
def _read(module: ModuleType, file: Path) -> CodeType:
    spec = module.__spec__
    if spec is None or not hasattr(spec.loader, "get_code"):  # a script, or a test whose assertions pytest rewrites
        return compile(file.read_bytes(), str(file), "exec", dont_inherit=True)
    return spec.loader.get_code(spec.name)  # type: ignore[union-attr]


@functools.cache
def _names(code: CodeType) -> tuple[str, ...]:
    """Every name that a code object and the functions within it mention, attributes included."""
    inner = (name for each in code.co_consts if isinstance(each, CodeType) for name in _names(each))
    return tuple(sorted({*code.co_names, *inner}))


@functools.cache
def _bytecode(code: CodeType) -> str:
    """Digest of a code object without its place and its line numbers."""
    constants = []
    for value in code.co_consts:
        if isinstance(value, CodeType):
            constants.append(_bytecode(value))
        elif isinstance(value, frozenset):  # its order changes from process to process
            constants.append(f"frozenset {sorted(map(repr, value))}")
        else:
            constants.append(f"{type(value).__name__} {value!r}")
    layout = code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_flags
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    return _hash(code.co_code, repr(layout), repr(names), *constants)


def _value(value: Any) -> str | None:
    """Digest of a constant that compiled code may freeze; None for anything else."""
    if value is None or isinstance(value, _PLAIN):
        return f"{type(value).__name__} {value!r}"
    if isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        return None if array.dtype.hasobject else _hash(type(value), repr((array.dtype, array.shape)), array.tobytes())
    if isinstance(value, tuple):
        members = [_value(each) for each in value]
        return None if None in members else _hash(_name(type(value)), repr(getattr(value, "_fields", ())), *members)
    return None


def _name(thing: Any) -> str:
    return f"{thing.__module__}.{thing.__qualname__}"


@functools.cache
def _by_version(module: str) -> bool:
    """Whether a module belongs to what _environment counts by its version: Python, numba, numpy or the machinery."""
    root = module.partition(".")[0]
    if root in _VERSIONED or root == "builtins" or module in _MACHINERY:
        return True
    file = getattr(sys.modules.get(root), "__file__", None)  # a user's file may have the name of one of Python's
    return root in sys.stdlib_module_names and (file is None or Path(file).resolve().is_relative_to(_STANDARD))


class _Walk:
    """One kernel's way through the modules that it refers to."""

    def __init__(self) -> None:
        self.parts: set[str] = set()
        self._modules: set[str] = set()
        self._searched: set[tuple[ModuleType, tuple[str, ...]]] = set()
        self._points: set[Callable] = set()
        self._classes: set[type] = {type(None)}  # that may select a function at a dispatch point

    def all_parts(self) -> list[str]:
        """Digests of everything met so far, and of what its classes select at its dispatch points."""
        done: set[tuple[Callable, type]] = set()
        while todo := {(point, kind) for point in self._points for kind in self._classes} - done:
            for point, kind in todo:
                chosen = POINTS[point](kind, point.__name__)
                if isinstance(chosen, FunctionType | Dispatcher):  # else it is for callers in Python alone
                    self.function(getattr(chosen, "py_func", chosen))
            done |= todo
        return sorted(self.parts)

    def type_of(self, kind: Any) -> str:
        """Digest of a numba type, with the names and the order of the fields of every ``NamedTuple`` within it."""
        made_of = getattr(kind, "instance_class", None)
        if made_of is not None:
            self._class(made_of)
            return _hash(_name(made_of), repr(getattr(kind, "fields", ())), *map(self.type_of, kind.types))
        if isinstance(kind, numba.types.BaseTuple):
            return _hash(type(kind).__name__, *map(self.type_of, kind.types))  # type: ignore[attr-defined]
        held = (getattr(kind, name, None) for name in ("dtype", "type", "key_type", "value_type"))  # list, dict
        inner = [self.type_of(each) for each in held if isinstance(each, numba.types.Type) and each is not kind]
        return _hash(str(kind), *inner)

    def function(self, function: FunctionType) -> None:
        """Count a function that is compiled, by its module, and what it closes over by its value."""
        module = sys.modules.get(function.__module__)
        if module is None or function.__globals__ is not vars(module) or function.__code__.co_filename.startswith("<"):
            raise UndecidableError(f"{_name(function)} has no source file")
        closed = [_value(cell.cell_contents) for cell in function.__closure__ or ()]
        if None in closed:
            raise UndecidableError(f"{_name(function)} closes over more than constants")
        self.parts.add(_hash("function", _name(function), *closed))
        self._module(module)

    def _class(self, kind: type) -> None:
        if issubclass(kind, tuple):
            self._classes.add(kind)
        self.parts.add(_hash("class", _name(kind), repr(getattr(kind, "_fields", ()))))
        self._refer(kind.__module__)

    def _refer(self, module: str | None) -> None:
        if module is not None and module in sys.modules:
            self._module(sys.modules[module])

    def _module(self, module: ModuleType) -> None:
        """Count a module: its code, its constants and, once each, all that it refers to."""
        name = module.__name__
        if name in self._modules or _by_version(name):
            return
        self._modules.add(name)
        file = Path(getattr(module, "__file__", None) or "")
        root = name.partition(".")[0]
        if root != _PROJECT and _INSTALLED.intersection(file.parents):  # another package, which is installed anew whole
            found = _unchanged(file).stat()
            version = getattr(sys.modules.get(root), "__version__", "")
            self.parts.add(_hash("installed", name, version, found.st_size, found.st_mtime_ns))
            return
        code = _code(module)
        names = _names(code)
        makes_code = "extending" in " ".join(names)  # by numba.extending; it may import, when it runs, what it needs
        self.parts.add(_hash("module", name, _bytecode(code)))
        for each in names:
            if each in vars(module) and not each.startswith("__"):
                self._member(f"{name}.{each}", vars(module)[each], names)
            if makes_code and "." in each:
                self._refer(each)

    def _member(self, name: str, member: Any, names: tuple[str, ...]) -> None:
        """Count what is known by a name, which code with these names refers to."""
        constant = _value(member)
        if constant is not None:
            self.parts.add(_hash("constant", name, constant))
        elif isinstance(member, tuple | list):
            for place, each in enumerate(member):
                self._member(f"{name}[{place}]", each, names)
        elif isinstance(member, ModuleType):
            self._module(member)
            if _by_version(member.__name__) or (member, names) in self._searched:
                return
            self._searched.add((member, names))
            for each in names if vars(member).keys() & {"__path__", "__getattr__"} else ():  # more than its code names
                if not each.startswith("__") and hasattr(member, each):
                    self._member(f"{name}.{each}", getattr(member, each), names)
        elif isinstance(member, type):
            self._class(member)
        elif isinstance(member, Dispatcher):
            self.function(member.py_func)
        else:
            if isinstance(member, FunctionType) and member in POINTS:
                self._points.add(member)
            self._refer(getattr(member, "__module__", None))
