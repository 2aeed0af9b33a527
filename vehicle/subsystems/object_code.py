"""Object code of a part: one function without Python, for a stated platform and processor.

    int32_t steer_advance(int32_t *finite, void **unused, const double *numbers, const double *tables, double *state,
                          const double *given, double *inputs, double *outputs, int64_t samples)

The kernels are those that Python runs, compiled by the same compiler for a function that takes addresses alone. The
shapes of all arrays are constants in it. ``finite`` receives 0 where a state has ceased to be finite. The result of
the function itself is 0; numba's calling convention gives other values to exceptions, of which the kernels have none.
"""

from typing import Any

import numba
import numpy as np
from llvmlite import binding as llvm
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils

from steer_env.friction.numerics.kernel import COMPILED, kernel, plain
from steer_env.vehicle.subsystems.advance import CLASSES, advance
from steer_env.vehicle.subsystems.packing import Floats, at_addresses
from steer_env.vehicle.subsystems.processor import Processor
from steer_env.vehicle.subsystems.subsystem import Part

FUNCTION = "steer_advance"
_intrinsic: Any = extending.intrinsic  # whose first argument no caller gives
TRIPLES = {"linux64": "x86_64-unknown-linux-gnu", "win64": "x86_64-w64-windows-gnu"}
PLATFORMS = tuple(TRIPLES)


@kernel
def entry(numbers, tables, state, given, inputs, outputs, samples):
    """Advance a part by so many samples; every array is given by its address. Whether its state is finite.

    The numbers and tables are those of :func:`steer_env.vehicle.subsystems.packing.numbers_and_tables`. The types of
    the addresses, from :func:`signature`, hold the part's structure and the shapes of the arrays.
    """
    return advance(
        at_addresses(numbers, tables),
        at_addresses(state, state),
        at_addresses(given, given),
        at_addresses(inputs, inputs),
        at_addresses(outputs, outputs),
        samples,
    )


def signature(part: Part) -> tuple:
    """Types of the arguments with which :func:`entry` is the function of a part."""
    shapes = part.start.size, part.given_size, (1, part.inputs), (1, len(part.outputs))
    numbers, arrays = Floats(CLASSES[part.name](part.parameters)), (Floats(np.zeros(shape)) for shape in shapes)
    return (numbers, types.CPointer(types.float64), *arrays, types.int64)


def address(part: Part) -> int:
    """The address of :func:`entry`, compiled for a part, as :func:`call` takes it; it stays valid.

    The code is kept on disk as that of every kernel.

    Raises
    ------
    ValueError
        Where kernels are not compiled (``NUMBA_DISABLE_JIT=1``).
    """
    _compiled_or_refused("an address")
    kinds = signature(part)
    entry.compile(kinds)
    result = entry.overloads[kinds]
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))


@_intrinsic
def call(typing_context, code, numbers, tables, state, given, inputs, outputs, samples):
    """Call the function at an :func:`address`, with the addresses of its arrays; whether the state is finite."""
    word = ir.IntType(64)

    def generate(context, builder, signature, given):
        pointer, result = ir.DoubleType().as_pointer(), ir.IntType(32)
        unused = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(result, [result.as_pointer(), unused.as_pointer(), *[pointer] * 6, word])
        finite, exception = cgutils.alloca_once_value(builder, result(0)), cgutils.alloca_once(builder, unused)
        arrays = [builder.inttoptr(each, pointer) for each in given[1:7]]
        function = builder.inttoptr(given[0], kind.as_pointer())
        builder.call(function, [finite, exception, *arrays, given[7]])
        return builder.icmp_unsigned("!=", builder.load(finite), result(0))

    return types.boolean(*[types.int64] * 8), generate


def _compiled_or_refused(what: str) -> None:
    if not COMPILED:
        raise ValueError(f"{what} is made of compiled kernels; unset NUMBA_DISABLE_JIT")


def module_text(part: Part) -> str:
    """LLVM module of a part, optimised, whose only visible function is ``steer_advance``.

    Its code is made for the structure of the part's parameters, not for their values.

    Raises
    ------
    ValueError
        Where kernels are not compiled (``NUMBA_DISABLE_JIT=1``).
    """
    _compiled_or_refused("a unit")
    kinds = signature(part)
    # No entry points for Python, no counting of references: nothing but the function itself is compiled.
    bare: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
    compiled: Any = numba.njit(nogil=True, error_model="numpy", **bare)(plain(entry))
    compiled.compile(kinds)
    result = compiled.overloads[kinds]
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
