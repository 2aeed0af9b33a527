"""The digest of everything that the machine code of a kernel depends on.

numba's own cache looks at the file that holds the kernel only, and would serve stale code after a change of a callee,
of a friction law or of a constant in another file. :func:`stamp` follows a kernel instead: through the names that its
bytecode loads to other kernels, to module constants and arrays (which compiled code freezes), and through the
dispatch points to the functions that the classes in its signature select. What it cannot decide it either stamps by
the whole source file or refuses, and the kernel is then compiled without a cache. A stale
kernel would give wrong results; a missing cache only costs time.

Functions enter by their bytecode, so that comments, docstrings and positions in a file do not count, and a file that is
edited while the process runs cannot mislabel what was imported before.
"""

import dataclasses
import dis
import functools
import hashlib
import importlib.util
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from enum import Enum
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np

_START = time.time()  # a source file that changed after this may differ from what was imported
_VERSIONED = {"numba": numba, "llvmlite": llvmlite, "numpy": np}  # packages that their version identifies
_MACHINERY = tuple(f"{__package__}.{name}" for name in ("cache", "compiler_fast", "kernel", "stamp"))  # of _environment
_FREE = (  # settings of numba that leave the code as it is, or that numba sets itself as it runs
    *("CACHE_DIR", "CACHE_LOCATOR_CLASSES", "DEBUG_CACHE", "COLOR_SCHEME", "RUNNING_UNDER_PROFILER", "USING_SVML"),
    *("NUMBA_NUM_THREADS", "NUMBA_DEFAULT_NUM_THREADS", "THREADING_LAYER"),
)

POINTS: dict[Callable, Callable[[type, str], Any]] = {}  # dispatch point -> (class, name of the point) -> function


class UndecidableError(Exception):
    """A kernel refers to something that cannot be stamped."""


def stamp(kernel: Any, signature: tuple, compiler: str) -> str:
    """Digest of what the machine code of a kernel depends on.

    Parameters
    ----------
    kernel : dispatcher
        As numba or :mod:`steer_env.friction.numerics.compiler_fast` makes it.
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
        If the kernel refers to a thing of a kind that this module does not know.
    """
    walk = _Walk()
    parts = [_environment(compiler), *map(walk.type_of, signature), walk.digest(kernel)]
    return _hash(*parts, *walk.choices())


@functools.cache
def _environment(compiler: str) -> str:
    """Digest of what every kernel depends on: versions, processor, settings of numba and the compiler's own sources."""
    options = {name: value for name, value in vars(numba.config).items() if name.isupper() and name not in _FREE}
    settings = sorted((name, value) for name, value in options.items() if isinstance(value, bool | int | float | str))
    versions = [module.__version__ for module in _VERSIONED.values()]
    processor = [platform.machine(), llvmlite.binding.get_host_cpu_name()]
    sources = [_text(Path(__file__).with_name(name)) for name in ("kernel.py", f"compiler_{compiler}.py")]
    return _hash(sys.version, compiler, *versions, *processor, repr(settings), *sources)


def _hash(*parts: Any) -> str:
    """Digest of strings and bytes, each of which counts with its length."""
    digest = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else str(part).encode()
        digest.update(f"{len(data)}:".encode())
        digest.update(data)
    return digest.hexdigest()


def _text(file: Path) -> bytes:
    """Contents of a source file, or nothing where there is none; UndecidableError if it changed after its import."""
    try:
        changed, text = file.stat().st_mtime, file.read_bytes()
    except OSError:
        return b""
    if changed > _START:
        raise UndecidableError(f"{file} changed while the process was running")
    return text


def _name(thing: Any) -> str:
    return f"{thing.__module__}.{thing.__qualname__}"


def _version(module: str | None) -> str | None:
    """Version of the package that a module belongs to, where that says all about it; None for all other modules."""
    root = (module or "builtins").partition(".")[0]
    if root in _VERSIONED:
        return f"{root} {_VERSIONED[root].__version__}"
    if root == "builtins" or module in _MACHINERY or (root in sys.stdlib_module_names and _in_stdlib(root)):
        return f"{root} {sys.version}"
    return None


@functools.cache
def _in_stdlib(root: str) -> bool:
    """Whether a module is Python's own rather than a user's file of the same name."""
    file = getattr(sys.modules.get(root), "__file__", None)
    return file is None or Path(file).resolve().is_relative_to(Path(os.__file__).resolve().parent)


def _loads(code: CodeType) -> Iterator[tuple[str, ...]]:
    """Dotted names that a code object and the functions within it load, such as ``("plant", "run")``."""
    chain: list[str] = []
    for instruction in dis.get_instructions(code):
        if chain and instruction.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            chain.append(instruction.argval)
            continue
        if chain:
            yield tuple(chain)
        chain = []
        if instruction.opname in ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_DEREF", "LOAD_CLASSDEREF"):
            chain = [instruction.argval]
    if chain:
        yield tuple(chain)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _loads(constant)


@functools.cache
def _chains(code: CodeType) -> tuple[tuple[str, ...], ...]:
    return tuple(sorted(set(_loads(code))))


@functools.cache
def _all_names(code: CodeType) -> tuple[str, ...]:
    """Every name that a code object and the functions within it mention, attributes included."""
    inner = (name for each in code.co_consts if isinstance(each, CodeType) for name in _all_names(each))
    return tuple(sorted({*code.co_names, *code.co_freevars, *inner}))


def _module_of(thing: Any) -> str:
    return thing.__name__ if isinstance(thing, ModuleType) else thing.__module__


def _bytecode(code: CodeType, doc: str | None) -> str:
    """Digest of a code object without its docstring, its place and its line numbers."""
    constants = []
    for place, value in enumerate(code.co_consts):
        if isinstance(value, CodeType):
            constants.append(_bytecode(value, None))
        elif isinstance(value, frozenset):  # its order changes from process to process
            constants.append(f"frozenset {sorted(map(repr, value))}")
        elif place > 0 or doc is None or value != doc:
            constants.append(f"{type(value).__name__} {value!r}")
    layout = code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_flags
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    return _hash(code.co_code, repr(layout), repr(names), *constants)


def _all_bytecode(code: CodeType) -> Iterator[str]:
    """Digests of a code object and of all those within it."""
    yield _bytecode(code, None)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _all_bytecode(constant)


def _functions_of(module: ModuleType) -> Iterator[FunctionType]:
    """The functions that a module defines: its own, those of its classes, and those behind numba's decorators."""
    for value in list(vars(module).values()):
        members = (
            list(vars(value).values()) if isinstance(value, type) and value.__module__ == module.__name__ else [value]
        )
        for member in members:
            for each in (member, *(getattr(member, name, None) for name in ("py_func", "__wrapped__", "_defn"))):
                if isinstance(each, FunctionType) and each.__module__ == module.__name__:
                    yield each


def _local_imports(code: CodeType, within: bool = False) -> Iterator[Path]:
    """Files of the modules of the project or its users that the functions of a module import when they run."""
    for instruction in dis.get_instructions(code) if within else ():
        if instruction.opname == "IMPORT_NAME" and _version(instruction.argval) is None:
            with suppress(ImportError, ValueError):  # not there, or imported relative to its package
                spec = importlib.util.find_spec(instruction.argval)
                yield Path(spec.origin if spec and spec.origin else "")
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _local_imports(constant, True)


class _Walk:
    """One kernel's way through everything that it refers to."""

    def __init__(self) -> None:
        self.classes: dict[type, None] = {}  # that may select a function at a dispatch point
        self.points: dict[Callable, None] = {}
        self._known: dict[int, str] = {}  # id -> digest, of functions and modules
        self._kept: list[Any] = []  # so that no id is used twice

    def choices(self) -> list[str]:
        """Digests of what the classes met so far select at the dispatch points met so far, with all that follows."""
        done: dict[tuple[Callable, type], str] = {}
        while True:
            pairs = ((point, kind) for point in self.points for kind in (type(None), *self.classes))
            todo = [pair for pair in pairs if pair not in done]
            if not todo:
                return sorted(done.values())
            for point, kind in todo:
                function = POINTS[point](kind, point.__name__)
                function = getattr(function, "py_func", function)
                found = "" if function is None else self._once(function, lambda f: self._function(f, strict=True))
                done[point, kind] = _hash(_name(point), _name(kind), found)

    def type_of(self, kind: Any) -> str:
        """Digest of a numba type, with the names and the order of the fields of every ``NamedTuple`` within it."""
        made_of = getattr(kind, "instance_class", None)
        if made_of is not None:
            self.classes[made_of] = None
            return _hash(_name(made_of), repr(getattr(kind, "fields", ())), *map(self.type_of, kind.types))
        if isinstance(kind, numba.types.BaseTuple):
            return _hash(type(kind).__name__, *map(self.type_of, kind.types))  # type: ignore[attr-defined]
        held = (
            getattr(kind, name, None) for name in ("dtype", "type", "key_type", "value_type")
        )  # list, optional, dict
        inner = [self.type_of(each) for each in held if isinstance(each, numba.types.Type) and each is not kind]
        return _hash(str(kind), *inner)

    def digest(self, value: Any, strict: bool = True) -> str:
        """Digest of anything that a kernel refers to; UndecidableError for an unknown kind of thing if ``strict``."""
        if isinstance(value, Enum):
            return _hash(_name(type(value)), value.name, repr(value.value))
        if value is None or isinstance(value, bool | int | float | complex | str | bytes):
            return _hash(type(value).__name__, repr(value))
        if isinstance(value, tuple | list):
            fields = getattr(value, "_fields", ())
            if fields:
                self.classes[type(value)] = None
            return _hash(_name(type(value)), repr(fields), *(self.digest(each, strict) for each in value))
        if isinstance(value, dict):
            return _hash("dict", *(self.digest(each, strict) for item in value.items() for each in item))
        if isinstance(value, set | frozenset):
            return _hash("set", *sorted(self.digest(each, strict) for each in value))
        if isinstance(value, np.ndarray | np.generic):
            array = np.asarray(value)
            return _hash(_name(type(value)), repr((array.dtype, array.shape)), array.tobytes())
        if isinstance(value, type):
            return self._class(value, strict)
        return self._once(value, lambda thing: self._thing(thing, strict))

    def _class(self, kind: type, strict: bool) -> str:
        """Digest of a class that compiled code makes things of or raises."""
        self.classes[kind] = None
        plain = issubclass(kind, tuple | Enum | BaseException) or _version(kind.__module__) is not None
        if strict and not plain:
            raise UndecidableError(f"the class {_name(kind)}")
        members = [(member.name, member.value) for member in kind] if issubclass(kind, Enum) else ()
        text = b"" if strict or plain else self._text_of(kind)  # its methods may generate code
        return _hash(_name(kind), repr(getattr(kind, "_fields", ())), repr(members), text)

    def _text_of(self, thing: Any) -> bytes:
        """Source of the module that a class or function comes from; empty where there is none."""
        return _text(Path(getattr(sys.modules.get(thing.__module__), "__file__", None) or ""))

    def _once(self, value: Any, work: Callable[[Any], str]) -> str:
        """Digest of a function, a module or the like, worked out once; a circle ends where it began."""
        if id(value) not in self._known:
            self._kept.append(value)
            self._known[id(value)] = getattr(value, "__name__", "")
            self._known[id(value)] = work(value)
        return self._known[id(value)]

    def _thing(self, value: Any, strict: bool) -> str:
        inner = getattr(value, "py_func", None)
        if isinstance(inner, FunctionType):  # a kernel
            options = {key: option for key, option in value.targetoptions.items() if key != "pipeline_class"}
            return _hash("kernel", repr(sorted(options.items())), self._function(inner, strict))
        if isinstance(value, FunctionType) and value in POINTS:
            self.points[value] = None
            return _hash("point", _name(value))
        if isinstance(value, ModuleType):
            return _hash(value.__name__, _version(value.__name__) or "")  # its attributes are followed one by one
        if isinstance(value, np.ufunc | np.dtype | numba.types.Type | slice | range):
            return _hash(_name(type(value)), repr(value))
        if isinstance(value, functools.partial):
            return _hash("partial", *(self.digest(each, strict) for each in (value.func, value.args, value.keywords)))
        found = getattr(value, "__wrapped__", value)  # that of an intrinsic of numba
        if isinstance(found, FunctionType):
            version = _version(found.__module__)
            return _hash(_name(found), version) if version else self._file(found)
        if isinstance(found, BuiltinFunctionType):
            return _hash(found.__qualname__, _version(found.__module__) or "")
        if strict:
            raise UndecidableError(f"a {_name(type(value))} among what a kernel refers to")
        if dataclasses.is_dataclass(value):
            kept = [self.digest(getattr(value, each.name), strict) for each in dataclasses.fields(value)]
            return _hash(self.digest(type(value), strict), *kept)
        return _hash(_name(type(value)))

    def _function(self, function: FunctionType, strict: bool) -> str:
        """Digest of a function that is compiled: its bytecode, its defaults and all that it refers to."""
        code = function.__code__
        cells = zip(code.co_freevars, function.__closure__ or ())
        scope = {**function.__globals__, **{name: cell.cell_contents for name, cell in cells}}
        defaults = self.digest((function.__defaults__, function.__kwdefaults__), strict)
        references = self._references(code, scope, strict)
        return _hash(_name(function), _bytecode(code, function.__doc__), defaults, *references)

    def _references(self, code: CodeType, scope: dict[str, Any], strict: bool) -> Iterator[str]:
        """Digests of what a code object loads from a scope, with the names."""
        single = [name for name in _all_names(code) if name in scope]  # the others are builtins, local or attributes
        dotted = any(
            isinstance(scope[name], ModuleType | type) and _version(_module_of(scope[name])) is None for name in single
        )
        for chain in _chains(code) if dotted else ((name,) for name in single):  # reading the bytecode takes long
            if chain[0] not in scope:
                continue
            value, rest = scope[chain[0]], list(chain[1:])
            path = [chain[0]]
            while rest and isinstance(value, ModuleType | type) and hasattr(value, rest[0]):
                if isinstance(value, type):
                    yield self.digest(value, strict)
                path.append(rest.pop(0))
                value = getattr(value, path[-1])
            if isinstance(value, ModuleType) and _version(value.__name__) is None and strict:
                raise UndecidableError(f"the module {value.__name__} itself, as {'.'.join(path)}")
            yield _hash(".".join(path), self.digest(value, strict))

    def _file(self, function: FunctionType) -> str:
        """Digest of a function that is not a kernel: what stands for it in compiled code is declared in its file.

        The whole file counts, and what its code refers to as far as that can be decided.
        """
        module = sys.modules.get(function.__module__)
        text = _text(Path(getattr(module, "__file__", None) or ""))
        if module is None or not text:
            raise UndecidableError(f"{_name(function)} is not a kernel and has no source file")
        references = self._once(module, lambda _: self._module(module, text))
        return _hash(_name(function), references)

    def _module(self, module: ModuleType, text: bytes) -> str:
        code = compile(text, module.__name__, "exec", dont_inherit=True)
        written = set(_all_bytecode(code))
        for function in _functions_of(module):
            if _bytecode(function.__code__, None) not in written:
                raise UndecidableError(f"{module.__file__} is not the source of {_name(function)} as it was imported")
        imported = [_text(file) for file in _local_imports(code)]
        return _hash(module.__name__, text, *imported, *self._references(code, vars(module), strict=False))
