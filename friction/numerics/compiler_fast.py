"""A faster way to compile kernels, to the same machine arithmetic as numba's own, which builds on numba's internals.

Nothing else in ``steer_env.friction`` needs names that numba does not document for users. This file is imported only
where :mod:`steer_env.friction.numerics.kernel` selects it, and numba's own compiler takes over where it fails.

What each part saves of the first step of ``AssistWeave-v1`` on one track and on two, of 8.9 and 15.7 s of processor
time with numba's own compiler and 4.1 and 6.3 s with this one [s]:

================================================================  =====  =====
callees are compiled as part of their callers only (``_Draft``)    0.9    2.1
no entry points for Python and C, no reference counts for callees  2.2    4.5
types of operators are remembered (``_Typing``)                    0.2    0.9
short lowering of arithmetic and of elements (``_Lower``)          0.5    0.7
no passes for what kernels do not have (``_Compiler``)             0.3    0.8
================================================================  =====  =====
"""

import operator
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import Any

import numba
from llvmlite.ir import IRBuilder
from numba.core import compiler
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
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
from numba.np.arrayobj import fix_integer_index, load_item, store_item

from steer_env.friction.numerics.cache import compile_cached, say

_works = True  # False once a compilation has failed that numba's own compiler can do
_points: list[Callable] = []


class _Typing:
    """numba's typing context, which remembers the types of operators.

    numba tries thirty rules for the type of ``x * y``, each time anew.
    """

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


# What two operands of one type are compiled to, as by numba's own rules in its error model "numpy".
_SHORT: dict[tuple[Any, Any], Callable] = {}
_SIGNS = (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "=="), ("ne", "!="))


def _comparison(instruction: Callable, sign: str) -> Callable:
    return lambda builder, x, y: instruction(builder, sign, x, y)


def short_arithmetic(kind: Any) -> None:
    """Use LLVM's instructions for floats to add, subtract, multiply and divide values of a type, floats or vectors."""
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
    """numba's lowering, with a short way for arithmetic of floats and for elements of vectors, the bulk of a kernel.

    numba searches its rules for each operation three times before it finds one, and builds a whole array structure to
    read one element.
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
        """Address of an element of a vector; a negative index counts from the end."""
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


class _Compiler(CompilerBase):
    """numba's compiler without the passes for closures, ``with``, array expressions and objects; no kernel has them."""

    lowering: type = _Lowering

    def __init__(self, typing_context: Any, *rest: Any) -> None:
        super().__init__(_Typing(typing_context), *rest)

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
    """Code of a kernel for compiled callers alone.

    It is optimised and translated to machine code only as part of its callers; numba would do both for each kernel too.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _Drafting(_Lowering):
    """Lowering to a :class:`_Draft`, without an entry point for Python.

    To unpack a hundred parameters for an entry point that nothing calls would take a sixth of the compile time.
    """

    _name = "drafting"

    def run_pass(self, state: Any) -> bool:
        state.library = _Draft(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = state.flags.no_compile = True
        super().run_pass(state)
        entry: Any = [].append  # never called; numba distinguishes functions by their entry points
        state.targetctx.insert_user_function(entry, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=entry)
        return True


class _Drafter(_Compiler):
    lowering = _Drafting


class _Kernel(CPUDispatcher):
    """A kernel for callers in Python; compiled callers take ``inner``."""

    by_numba: Any  # maker of the same kernel for numba's own compiler

    def compile(self, signature: Any) -> Any:
        """Compile as numba does. Where that fails and numba's own compiler succeeds, the latter compiles this kernel
        from then on.
        """
        if not _works:
            return self._borrow(signature)
        try:
            return compile_cached(self, signature, super().compile, "fast")
        except Exception as error:
            _switch(False)
            try:
                entry = self._borrow(signature)
            except Exception:  # the kernel itself is at fault
                _switch(True)
                raise
            reason = str(error).strip().splitlines() or [""]
            say("compiler", f"the fast compiler failed ({type(error).__name__}: {reason[0]}); numba's own takes over")
            return entry

    def _borrow(self, signature: Any) -> Any:
        """Machine code of numba's own compiler."""
        if signature not in self.overloads:
            self.own.compile(signature)
            self.add_overload(self.own.overloads[signature])
        return self.get_overload(signature)

    @cached_property
    def own(self) -> Any:
        inline = {key: value for key, value in self.targetoptions.items() if key == "inline"}
        return self.by_numba(self.py_func, **inline)

    @cached_property
    def inner(self) -> CPUDispatcher:
        return CPUDispatcher(self.py_func, targetoptions=self.targetoptions, pipeline_class=_Drafter)

    def add_overload(self, cres: Any) -> None:
        super().add_overload(cres)
        for environment in cres._find_referenced_environments():  # what a ``print`` in a draft needs
            cres.library.codegen.set_env(environment.env_name, environment)

    @property
    def _numba_type_(self) -> numba.types.Dispatcher:
        return numba.types.Dispatcher(self.inner if _works else self.own)  # type: ignore[arg-type]


def kernel(function: Callable, by_numba: Callable, **options: Any) -> Any:
    """A kernel for this compiler; ``by_numba`` makes the same kernel for numba's own.

    Kernels pass parameter tuples by value, so they are inlined: a call would copy up to a hundred floats. There is no C
    callback, as nothing takes one, and no counting of references, as kernels own no arrays. Both would go through every
    number of the parameters, which would take a quarter of the compile time.
    """
    inlining = options or {"forceinline": True}
    fixed = {"nopython": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}
    made = _Kernel(function, targetoptions={**fixed, **inlining}, pipeline_class=_Compiler)
    made.by_numba = by_numba
    return made


def dispatch_options(point: Callable) -> dict[str, Any]:
    """Options of ``numba.extending.overload`` for a dispatch point."""
    _points.append(point)
    return {"pipeline_class": lambda *given: (_Drafter if _works else compiler.Compiler)(*given)}


def _switch(works: bool) -> None:
    """Compile by this compiler or by numba's own from now on, and forget what the other one made of dispatch points."""
    global _works
    _works = works
    with suppress(AttributeError):
        context = CPUDispatcher.targetdescr.typing_context
        for point in _points:
            for template in getattr(context._lookup_global(point), "templates", ()):
                template._impl_cache.clear()
