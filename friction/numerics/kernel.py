"""The one place that decides how kernels are compiled and where the machine code is cached.

A kernel is a small scalar function decorated with :func:`kernel`. It is compiled by numba
without fast-math (mirror symmetry has to be exact) and without the GIL (lanes run in threads),
and cached on disk. numba's own cache looks only at the file that holds the kernel, so a change
in a callee of another file would serve stale code; here the directory is named by a digest of
every source file of the packages that a kernel can reach, so any change starts a fresh one.
"""

import gc
import hashlib
import marshal
import operator
import os
import platform
import tempfile
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numba
import numba.core.config
import numpy as np
import platformdirs
from llvmlite.ir import IRBuilder
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, Flags
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import (
    AnnotateTypes,
    NativeLowering,
    NoPythonBackend,
    NoPythonSupportedFeatureValidation,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import (
    DeadBranchPrune,
    FixupArgs,
    GenericRewrites,
    InlineInlinables,
    IRProcessing,
    ReconstructSSA,
    TranslateByteCode,
)
from numba.extending import overload
from numba.np.arrayobj import fix_integer_index, load_item, store_item

config: Any = numba.core.config  # its names are made at run time
COMPILED = not config.DISABLE_JIT  # False under NUMBA_DISABLE_JIT=1: kernels are plain Python

_digests: dict[str, str] = {}  # package folder or foreign law -> digest, in order of import


def _digest_of(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


@cache
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
    file = Path(function.__code__.co_filename).resolve()  # the folder itself, not the link to it
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
    folder = cache_directory()
    if folder is None:
        return
    previous = config.CACHE_DIR
    try:
        config.CACHE_DIR = str(folder)  # read once, when the dispatcher chooses its locator
        dispatcher.enable_caching()
    except RuntimeError:
        pass  # no source file to stamp (a kernel typed at a prompt): compile in memory
    finally:
        config.CACHE_DIR = previous


class _Typing:
    """numba's typing context with a memory: for the type of ``x * y`` it tries thirty rules, each time anew."""

    known: dict[Any, Any] = {}  # noqa: RUF012 (of the process, as numba's context is)

    def __init__(self, context: Any) -> None:
        self.context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self.context, name)

    def resolve_function_type(self, function: Any, arguments: Any, keywords: Any) -> Any:
        """Signature of a call, remembered for operators and other functions that are not kernels themselves."""
        kind = self.context._lookup_global(function) or function
        if keywords or not (isinstance(kind, numba.types.Function) and all(each.is_precise() for each in arguments)):
            return self.context.resolve_function_type(function, arguments, keywords)
        key = kind, arguments  # a kind that gains a rule is another one
        if key not in self.known:
            self.known[key] = self.context.resolve_function_type(function, arguments, keywords)
        return self.known[key]


# What two operands of one type compile to, as numba's own rules have it in its error model "numpy".
_SHORT: dict[tuple[Any, Any], Callable] = {}
_SIGNS = (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "=="), ("ne", "!="))


def _comparison(instruction: Callable, sign: str) -> Callable:
    return lambda builder, x, y: instruction(builder, sign, x, y)


def short_arithmetic(kind: Any) -> None:
    """Let kernels add, subtract, multiply and divide a type of floats, or of vectors of them, the short way."""
    for name, instruction in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
        _SHORT[getattr(operator, name), kind] = getattr(IRBuilder, instruction)


short_arithmetic(numba.float64)
for _name in ("add", "sub", "mul"):
    _SHORT[getattr(operator, _name), numba.int64] = getattr(IRBuilder, _name)
for _name, _sign in _SIGNS:
    _compare = IRBuilder.fcmp_unordered if _name == "ne" else IRBuilder.fcmp_ordered
    _SHORT[getattr(operator, _name), numba.float64] = _comparison(_compare, _sign)
    _SHORT[getattr(operator, _name), numba.int64] = _comparison(IRBuilder.icmp_signed, _sign)


class _Lower(Lower):
    """numba's lowering, with a short way for what kernels are made of: arithmetic of floats and elements of vectors.

    numba looks each up among its rules, three times in vain, and builds a whole array to read one element.
    """

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        signature = self.fndesc.calltypes[expr]
        kind, other = signature.args
        make = _SHORT.get((op, kind)) if kind == other else None
        if make is None:
            return super().lower_binop(resty, expr, op)
        x, y = (self._cast_var(side, kind) for side in (expr.lhs, expr.rhs))
        return self.context.cast(self.builder, make(self.builder, x, y), signature.return_type, resty)

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        if not self._is_vector(signature):
            return super().lower_getitem(resty, expr, value, index, signature)
        found = load_item(self.context, self.builder, signature.args[0], self._element(value, index, signature))
        return self.context.cast(self.builder, found, signature.return_type, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        if not self._is_vector(signature):
            return super().lower_setitem(target_var, index_var, value_var, signature)
        kind = signature.args[0]
        value = self._cast_var(value_var, kind.dtype)
        store_item(self.context, self.builder, kind, value, self._element(target_var, index_var, signature))

    def _is_vector(self, signature: Any) -> bool:
        kind, index = signature.args[:2]
        return (
            isinstance(kind, numba.types.Array)
            and (kind.ndim, kind.layout) == (1, "C")
            and isinstance(kind.dtype, numba.types.Number)
            and isinstance(index, numba.types.Integer)
            and not self.context.enable_boundscheck
        )

    def _element(self, array: Any, index: Any, signature: Any) -> Any:
        """Address of an element of a vector; indices count from the end where they are negative."""
        kind, builder = signature.args[0], self.builder
        model, whole = self.context.data_model_manager[kind], self.loadvar(array.name)
        size = builder.extract_value(model.get(builder, whole, "shape"), 0)
        place = fix_integer_index(
            self.context, builder, signature.args[1], self._cast_var(index, signature.args[1]), size
        )
        return builder.gep(model.get(builder, whole, "data"), [place], inbounds=True)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    """Lowering by :class:`_Lower`."""

    _name = "lowering"

    @property
    def lowering_class(self) -> type:
        return _Lower


class _Flags(Flags):
    """numba's, compared by what is set: it asks every option of both for its value, some six thousand times."""

    __slots__ = ()

    def __hash__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Flags) and self._values == other._values


class _Compiler(CompilerBase):
    """numba's compiler without the passes for what no kernel has: closures, ``with``, array expressions, objects."""

    lowering: type = _Lowering

    def __init__(self, typing_context: Any, *rest: Any) -> None:
        super().__init__(_Typing(typing_context), *rest)
        self.state.flags = _Flags(self.state.flags)

    def define_pipelines(self) -> list[PassManager]:
        passes = PassManager("kernel")
        for each in (
            *(TranslateByteCode, FixupArgs, IRProcessing, GenericRewrites, InlineInlinables, DeadBranchPrune),
            *(ReconstructSSA, NopythonTypeInference, PreLowerStripPhis, NoPythonSupportedFeatureValidation),
            *(AnnotateTypes, self.lowering, NoPythonBackend),
        ):
            passes.add_pass(each, each.__name__)
        passes.finalize()
        return [passes]


class _Draft(JITCodeLibrary):
    """Code for compiled callers alone, which take it in as it is: it is optimised and translated once, as part of them.

    numba would do both for each kernel on its own too.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _Drafting(_Lowering):
    """Lowering to a :class:`_Draft`, without an entry point for Python.

    Unpacking a hundred parameters for an entry point that nothing calls would be a sixth of the compile time.
    """

    _name = "drafting"

    def run_pass(self, state: Any) -> bool:
        state.library = _Draft(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = state.flags.no_compile = True
        super().run_pass(state)
        entry: Any = [].append  # numba tells functions apart by their entry points; any will do where none is called
        state.targetctx.insert_user_function(entry, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=entry)
        return True


class _Drafter(_Compiler):
    lowering = _Drafting


class _Kernel(CPUDispatcher):
    """A kernel as Python calls it; compiled callers take ``inner``."""

    known: tuple[str, ...] = ()  # sources when the cache folder was chosen

    def compile(self, signature: Any) -> Any:
        """As numba's, without the garbage collector: what it would go through again and again stays in use.

        The cache folder is chosen here: a law that came later is a source too, since callers inline it.
        """
        if self.known != tuple(_digests):
            self.known = tuple(_digests)
            _cache(self)
        collecting = gc.isenabled()
        gc.disable()
        try:
            return super().compile(signature)
        finally:
            if collecting:
                gc.enable()

    @cached_property
    def inner(self) -> CPUDispatcher:
        return CPUDispatcher(self.py_func, targetoptions=self.targetoptions, pipeline_class=_Drafter)

    def add_overload(self, cres: Any) -> None:
        super().add_overload(cres)
        for environment in cres._find_referenced_environments():  # what a ``print`` in a draft needs
            cres.library.codegen.set_env(environment.env_name, environment)

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
    return _Kernel(function, targetoptions=options, pipeline_class=_Compiler)


def dispatch(point: Callable, choose: Callable[[type, str], Any]) -> None:
    """Make compiled code take, for a call of ``point(p, ...)``, the function for the class of the parameters ``p``.

    ``choose(class, name of the point)`` returns it, or None. It is looked up at compile time and compiled as part of
    the caller, so nothing is passed at run time and everything caches; plain Python runs the body of ``point``.
    """
    if not COMPILED:
        return

    def chosen(p, *_):
        return plain(choose(getattr(p, "instance_class", type(None)), point.__name__))

    options: Any = {"pipeline_class": _Drafter}
    overload(point, jit_options=options, strict=False)(chosen)


def plain(function: Any) -> Any:
    """A kernel as plain Python, for so few calls that compiling it would take longer."""
    return getattr(function, "py_func", function)


def record(parameters: Any) -> np.recarray:
    """A ``NamedTuple`` of floats as a record array (1,), whose element ``[0]`` serves the kernels in its place.

    A kernel takes the record by its address; the tuple would be unpacked, float by float, at every call from Python.
    """
    return np.rec.array([tuple(parameters)], dtype=[(key, np.float64) for key in parameters._fields])


def include_sources(*functions: Callable) -> None:
    """Make the cache depend on a law from outside the packages too."""
    if not COMPILED:
        return
    for function in functions:
        _add_sources(function)


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
