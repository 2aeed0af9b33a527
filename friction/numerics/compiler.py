"""The compiler of kernels: numba's passes, with callees compiled as part of their callers only.

It builds on names that numba does not document for users; nothing else in ``steer_env.friction`` does. Its machine code
gives the same numbers to the bit as that of numba's own compiler with the same options.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numba
from llvmlite import ir
from llvmlite.binding import create_new_function_pass_manager
from numba import types
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.cpython.slicing import fix_index
from numba.np.arrayobj import load_item, make_array, make_view, store_item

# Passes for what kernels do not have: ``with``, closures, array expressions, unrolled loops over tuples of types.
_NEEDLESS = {
    *("WithLifting", "InlineClosureLikes", "RewriteSemanticConstants", "RewriteDynamicRaises", "FindLiterallyCalls"),
    *("MakeFunctionToJitFunction", "LiteralUnroll", "LiteralPropagationSubPipelinePass"),
    *("InlineOverloads", "NopythonRewrites"),
}


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


class _Draft(JITCodeLibrary):
    """Code of a kernel for compiled callers alone.

    It is optimised and translated to machine code only as part of its callers; numba would do both for each kernel too.
    What makes it short is all that it goes through by itself.
    """

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout
        passes = create_new_function_pass_manager()
        passes.add_sroa_pass()
        passes.add_simplify_cfg_pass()
        passes.add_instruction_combine_pass()
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, self._codegen._pass_builder())

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


class _Lower(Lower):
    """Lowering in which elements and parts of contiguous arrays take a fifth of numba's code, to the same effect.

    An index below zero counts from the end, and a slice ends where the array does.
    """

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        place = self._place(value, index, signature)
        if place is None:
            return super().lower_getitem(resty, expr, value, index, signature)
        kind, (data, shape) = signature.args[0], place
        if shape:
            array = make_array(kind)(self.context, self.builder, self.loadvar(value.name))
            strides = cgutils.unpack_tuple(self.builder, array.strides)[kind.ndim - len(shape) :]
            view = make_view(self.context, self.builder, kind, array, signature.return_type, data, shape, strides)
            found = view._getvalue()
        else:
            found = load_item(self.context, self.builder, kind, data)
        return self.context.cast(self.builder, found, signature.return_type, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        place = self._place(target_var, index_var, signature)
        if place is None or place[1]:
            return super().lower_setitem(target_var, index_var, value_var, signature)
        kind, value = signature.args[0], self.loadvar(value_var.name)
        value = self.context.cast(self.builder, value, self.typeof(value_var.name), kind.dtype)
        return store_item(self.context, self.builder, kind, value, place[0])

    def _place(self, array: Any, index: Any, signature: Any) -> tuple[Any, list[Any]] | None:
        """Address of what is indexed, and its shape, () for an element; None for what numba is left to."""
        kind, builder = self.typeof(array.name), self.builder
        given: Any = self.typeof(index.name)
        kinds = getattr(given, "types", (given,))
        slices = isinstance(given, types.SliceType) and not given.has_step
        if (
            not (isinstance(kind, types.Array) and kind.layout == "C" and kind == signature.args[0])
            or not (slices or all(getattr(each, "signed", False) for each in kinds))
            or not 0 < len(kinds) <= kind.ndim
            or self.context.enable_boundscheck
            or self.context.enable_nrt
        ):
            return None
        array, index = self.loadvar(array.name), self.loadvar(index.name)
        lengths = [builder.extract_value(array, (5, axis)) for axis in range(kind.ndim)]
        if slices:
            first, end = (self._bound(builder.extract_value(index, k), lengths[0]) for k in (0, 1))
            size = builder.sub(end, first)
            shape = [builder.select(builder.icmp_signed(">", size, size.type(0)), size, size.type(0)), *lengths[1:]]
            places = [first]
        else:
            indices = cgutils.unpack_tuple(builder, index) if isinstance(given, types.BaseTuple) else [index]
            cast = [self.context.cast(builder, i, of, types.intp) for i, of in zip(indices, kinds)]
            places, shape = [*map(self._from_start, cast, lengths)], lengths[len(kinds) :]
        offset = places[0]
        for axis in range(1, kind.ndim):
            offset = builder.mul(offset, lengths[axis])
            offset = builder.add(offset, places[axis]) if axis < len(places) else offset
        return builder.gep(builder.extract_value(array, 4), [offset]), shape

    def _from_start(self, i: Any, length: Any) -> Any:
        return i if isinstance(i, ir.Constant) and i.constant >= 0 else fix_index(self.builder, i, length)

    def _bound(self, i: Any, length: Any) -> Any:
        """Where a slice begins or ends."""
        builder, i = self.builder, fix_index(self.builder, i, length)
        i = builder.select(builder.icmp_signed("<", i, i.type(0)), i.type(0), i)
        return builder.select(builder.icmp_signed("<", i, length), i, length)


class _Lowering(NativeLowering):
    """Lowering by :class:`_Lower`."""

    _name: Any

    @property
    def lowering_class(self) -> type:
        return _Lower


@register_pass(mutates_CFG=True, analysis_only=False)
class _Finishing(_Lowering):
    _name = "finishing"


@register_pass(mutates_CFG=True, analysis_only=False)
class _Drafting(_Lowering):
    """Lowering to a :class:`_Draft`, without an entry point for Python."""

    _name = "drafting"

    def run_pass(self, state: Any) -> bool:
        state.library = _Draft(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = state.flags.no_compile = True
        super().run_pass(state)
        entry: Any = [].append  # never called; numba distinguishes functions by their entry points
        state.targetctx.insert_user_function(entry, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=entry)
        return True


class _Compiler(CompilerBase):
    lowering: type = _Finishing

    def __init__(self, typing_context: Any, *rest: Any) -> None:
        super().__init__(_Typing(typing_context), *rest)

    def define_pipelines(self) -> list[PassManager]:
        passes = PassManager("kernel")
        for each, description in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            if each.__name__ not in _NEEDLESS:
                passes.add_pass(self.lowering if each is NativeLowering else each, description)
        passes.finalize()
        return [passes]


class Drafter(_Compiler):
    """The compiler of kernels that compiled kernels call."""

    lowering = _Drafting


class Kernel(CPUDispatcher):
    """A kernel for callers in Python; compiled callers take ``inner``."""

    def __init__(self, function: Callable, options: dict[str, Any]) -> None:
        super().__init__(function, targetoptions={"nopython": True, **options}, pipeline_class=_Compiler)

    @cached_property
    def inner(self) -> CPUDispatcher:
        return CPUDispatcher(self.py_func, targetoptions=self.targetoptions, pipeline_class=Drafter)

    def add_overload(self, cres: Any) -> None:
        super().add_overload(cres)
        for environment in cres._find_referenced_environments():  # what a ``print`` in a draft needs
            cres.library.codegen.set_env(environment.env_name, environment)

    @property
    def _numba_type_(self) -> numba.types.Dispatcher:
        return numba.types.Dispatcher(self.inner)  # type: ignore[arg-type]
