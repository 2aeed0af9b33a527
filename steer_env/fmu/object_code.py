"""Object code of a part: one function without Python, for a stated platform and processor.

    int32_t steer_advance(int32_t *finite, void **unused, const double *numbers, const double *tables, double *state,
                          const double *given, double *inputs, double *outputs, int64_t samples)

The kernels are those that Python runs, compiled by the same compiler for a function that takes addresses alone. The
shapes of all arrays are constants in it. ``finite`` receives 0 where a state has ceased to be finite. The result of
the function itself is 0; numba's calling convention gives other values to exceptions, of which the kernels have none.
"""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import binding as llvm
from numba import types

from steer_env.fmu.flat import at_addresses
from steer_env.fmu.processor import Processor
from steer_env.friction.numerics.kernel import COMPILED

FUNCTION = "steer_advance"
TRIPLES = {"linux64": "x86_64-unknown-linux-gnu", "win64": "x86_64-w64-windows-gnu"}
PLATFORMS = tuple(TRIPLES)


def module_text(advance: Callable, template: Any, state: int, given: int, inputs: int, outputs: int) -> str:
    """LLVM module of a part, optimised, whose only visible function is ``steer_advance``.

    Parameters
    ----------
    advance : kernel ``(p, state, given, inputs, outputs, samples) -> bool``
        Advances a part and tells whether its state is finite.
    template : NamedTuple
        Parameters whose structure the code is made for.
    state, given, inputs, outputs : int
        Lengths of the arrays that the kernel takes, of shape ``(state,)``, ``(given,)``, ``(1, inputs)`` and
        ``(1, outputs)``.

    Raises
    ------
    ValueError
        Where kernels are not compiled (``NUMBA_DISABLE_JIT=1``).
    """
    if not COMPILED:
        raise ValueError("a unit is made of compiled kernels; unset NUMBA_DISABLE_JIT")
    parameters = at_addresses(template)
    x, g, u, y = (at_addresses(np.zeros(shape)) for shape in (state, given, (1, inputs), (1, outputs)))

    def entry(numbers, tables, state_, given_, inputs_, outputs_, samples):
        return advance(
            parameters(numbers, tables),
            x(state_, state_),
            g(given_, given_),
            u(inputs_, inputs_),
            y(outputs_, outputs_),
            samples,
        )

    signature = (*[types.CPointer(types.float64)] * 6, types.int64)
    # No entry points for Python, no counting of references: nothing but the function itself is compiled.
    bare: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
    compiled: Any = numba.njit(nogil=True, error_model="numpy", **bare)(entry)
    compiled.compile(signature)
    result = compiled.overloads[signature]
    module = llvm.parse_assembly(result.library.get_llvm_str())
    function = module.get_function(result.fndesc.llvm_func_name)
    function.name, function.visibility = FUNCTION, "hidden"  # several units in a process must not find one another's
    for member in (*module.functions, *module.global_variables):
        if not member.is_declaration and member.name != FUNCTION:
            member.linkage = "internal"
    return str(module)


def object_code(module: str, platform: str, processor: Processor) -> bytes:
    """Object file of a module for one of ``PLATFORMS``."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(TRIPLES[platform])
    machine = target.create_target_machine(
        cpu="x86-64", features=processor.for_llvm(), opt=3, reloc="pic", codemodel="default"
    )
    parsed = llvm.parse_assembly(module)
    parsed.triple = machine.triple
    parsed.data_layout = str(machine.target_data)
    options = llvm.create_pipeline_tuning_options(speed_level=0)
    passes = llvm.create_pass_builder(machine, options)
    manager = llvm.create_new_module_pass_manager()
    manager.add_global_dead_code_eliminate_pass()
    manager.run(parsed, passes)
    return machine.emit_object(parsed)
