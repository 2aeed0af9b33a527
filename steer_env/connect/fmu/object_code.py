"""Object code of a subsystem, which an FMU contains: for a stated platform and, of x86-64, level of processors."""

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numba
from llvmlite import binding as llvm

from steer_env.friction.numerics.check import one_of
from steer_env.friction.numerics.kernel import plain
from steer_env.vehicle.subsystems import Subsystem, poses
from steer_env.vehicle.subsystems.machine_code import entry, first, require_compiled, signature


def functions(subsystem: Subsystem) -> dict[str, Any]:
    """The kernels that the C layer calls, by their names there."""
    found = {"steer_advance": entry, "steer_begin": first}
    return {**found, "steer_poses": poses.entry} if poses.has_poses(subsystem) else found


class Platform(NamedTuple):
    """A machine for which an FMU has a binary."""

    triple: str  # by which LLVM knows it
    zig: str  # by which zig knows it; empty where the system's compiler links
    suffix: str  # of a shared library
    folders: dict[int, str]  # of the binary, by version of FMI


PLATFORMS = {
    "linux64": Platform("x86_64-unknown-linux-gnu", "", "so", {2: "linux64", 3: "x86_64-linux"}),
    "win64": Platform("x86_64-w64-windows-gnu", "x86_64-windows-gnu", "dll", {2: "win64", 3: "x86_64-windows"}),
    # FMI 2.0 has no folders for ARM: importers there look into those of 64 bit.
    "aarch64": Platform(
        "aarch64-unknown-linux-gnu", "aarch64-linux-gnu.2.29", "so", {2: "linux64", 3: "aarch64-linux"}
    ),
    "macos": Platform("arm64-apple-macosx11.0", "aarch64-macos.11.0", "dylib", {2: "darwin64", 3: "aarch64-darwin"}),
}
SOURCE = "source"  # in place of a platform: sources, which the importer compiles
# Feature of LLVM -> where the instruction ``cpuid`` reports it: leaf, register (a, b, c, d) and bit; sub-leaf 0.
# Source: Intel 64 and IA-32 Architectures Software Developer's Manual, volume 2, CPUID; AMD64 volume 3 for 0x80000001.
FEATURES = {
    "sse3": (1, "c", 0),
    "ssse3": (1, "c", 9),
    "fma": (1, "c", 12),
    "cx16": (1, "c", 13),
    "sse4.1": (1, "c", 19),
    "sse4.2": (1, "c", 20),
    "movbe": (1, "c", 22),
    "popcnt": (1, "c", 23),
    "avx": (1, "c", 28),
    "f16c": (1, "c", 29),
    "bmi": (7, "b", 3),
    "avx2": (7, "b", 5),
    "bmi2": (7, "b", 8),
    "avx512f": (7, "b", 16),
    "avx512dq": (7, "b", 17),
    "avx512cd": (7, "b", 28),
    "avx512bw": (7, "b", 30),
    "avx512vl": (7, "b", 31),
    "sahf": (0x80000001, "c", 0),
    "lzcnt": (0x80000001, "c", 5),
}
_V2 = ("sse3", "ssse3", "cx16", "sse4.1", "sse4.2", "popcnt", "sahf")
_V3 = (*_V2, "fma", "movbe", "avx", "f16c", "bmi", "avx2", "bmi2", "lzcnt")
# As the System V psABI for x86-64 defines them.
LEVELS = {
    "x86-64": (),
    "x86-64-v2": _V2,
    "x86-64-v3": _V3,
    "x86-64-v4": (*_V3, "avx512f", "avx512dq", "avx512cd", "avx512bw", "avx512vl"),
}
PROCESSOR_NAMES = (*LEVELS, "native")


class Processor(NamedTuple):
    """A processor to generate code for, and what the FMU asks of the machine it runs on."""

    name: str
    features: tuple[str, ...]  # beyond x86-64, all of them keys of ``FEATURES``

    def for_llvm(self) -> str:
        """The features as LLVM takes them."""
        return ",".join(f"+{feature}" for feature in self.features)

    def masks(self) -> dict[tuple[int, str], int]:
        """Bits that ``cpuid`` has to report, by leaf and register."""
        found: dict[tuple[int, str], int] = {}
        for feature in self.features:
            leaf, register, bit = FEATURES[feature]
            found[leaf, register] = found.get((leaf, register), 0) | 1 << bit
        return found


def processor(name: str) -> Processor:
    """A processor by its level; ``"native"`` is what this machine can do of ``FEATURES``.

    Raises
    ------
    ValueError
        For another name.
    """
    one_of("cpu", name, PROCESSOR_NAMES)
    if name in LEVELS:
        return Processor(name, LEVELS[name])
    here = llvm.get_host_cpu_features()
    return Processor(name, tuple(feature for feature in FEATURES if here.get(feature, False)))


def module_text(
    subsystem: Subsystem,
    chosen: Collection[str] | None = None,
    further: Mapping[str, tuple[Any, tuple]] | None = None,
) -> str:
    """LLVM module of a subsystem, optimised, whose only visible functions are its :func:`functions`, or those chosen.

    ``further`` holds other kernels that become visible functions, with the types of their arguments. The code is made
    for the structure of the subsystem's parameters, not for their values.

    Raises
    ------
    ValueError
        Where kernels are not compiled (``NUMBA_DISABLE_JIT=1``).
    """
    require_compiled("an export")
    whole = llvm.parse_assembly("")
    own = {name: (function, signature(subsystem)) for name, function in functions(subsystem).items()}
    for name, (function, arguments) in {**own, **(further or {})}.items():
        if chosen is None or name in chosen or name not in own:
            whole.link_in(_module(name, function, arguments))
    return str(whole)


def _module(name: str, kernel: Any, arguments: tuple) -> llvm.ModuleRef:
    """LLVM module of a kernel, for the first of these arguments, whose only visible function is ``name``."""
    kinds = arguments[: plain(kernel).__code__.co_argcount]
    # No entry points for Python, no counting of references: nothing but the function itself is compiled.
    bare: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
    compiled: Any = numba.njit(nogil=True, error_model="numpy", **bare)(plain(kernel))
    compiled.compile(kinds)
    result = compiled.overloads[kinds]
    module = llvm.parse_assembly(result.library.get_llvm_str())
    function = module.get_function(result.fndesc.llvm_func_name)
    function.name, function.visibility = name, "hidden"  # several FMUs in a process must not find one another's
    for member in (*module.functions, *module.global_variables):
        if not member.is_declaration and member.name != name:
            member.linkage = "internal"
    return module


def object_code(module: str, platform: str, processor: Processor) -> bytes:
    """Object file of a module for one of ``PLATFORMS``."""
    machine, parsed = _for_platform(module, platform, processor)
    return machine.emit_object(parsed)


def assembler(module: str, platform: str, processor: Processor) -> str:
    """The same code as text, of which the platform's assembler makes the object file."""
    machine, parsed = _for_platform(module, platform, processor)
    return machine.emit_assembly(parsed)


def object_for(module: str, triple: str, cpu: str, features: str = "", reloc: str = "static") -> bytes:
    """Object file of a module for a machine as LLVM names it."""
    machine, parsed = _for_machine(module, triple, cpu, features, reloc)
    return machine.emit_object(parsed)


def _for_platform(module: str, platform: str, processor: Processor) -> tuple[llvm.TargetMachine, llvm.ModuleRef]:
    triple = PLATFORMS[platform].triple
    kind = ("x86-64", processor.for_llvm()) if triple.startswith("x86_64") else ("generic", "")
    return _for_machine(module, triple, *kind, "pic")


def _for_machine(
    module: str, triple: str, cpu: str, features: str, reloc: str
) -> tuple[llvm.TargetMachine, llvm.ModuleRef]:
    """What emits code for a machine, and the module without what nothing calls."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(triple)
    machine = target.create_target_machine(cpu, features, opt=3, reloc=reloc, codemodel="default")
    parsed = llvm.parse_assembly(module)
    parsed.triple = machine.triple
    parsed.data_layout = str(machine.target_data)
    options = llvm.create_pipeline_tuning_options(speed_level=0)
    passes = llvm.create_pass_builder(machine, options)
    manager = llvm.create_new_module_pass_manager()
    manager.add_global_dead_code_eliminate_pass()
    manager.run(parsed, passes)
    return machine, parsed
