"""The compiler of kernels: numba's passes, with callees compiled as part of their callers only.

It builds on names that numba does not document for users; nothing else in ``steer_env.friction`` does. Its machine code
gives the same numbers to the bit as that of numba's own compiler with the same options.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numba
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

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
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _Drafting(NativeLowering):
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
    lowering: type = NativeLowering

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
