"""Levels of x86-64 processors: what the code generator may use, and what a unit asks of the machine it runs on."""

from typing import NamedTuple

from llvmlite import binding as llvm

from steer_env.friction.numerics.check import one_of

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
NAMES = (*LEVELS, "native")


class Processor(NamedTuple):
    """A processor to generate code for."""

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
    one_of("cpu", name, NAMES)
    if name in LEVELS:
        return Processor(name, LEVELS[name])
    here = llvm.get_host_cpu_features()
    return Processor(name, tuple(feature for feature in FEATURES if here.get(feature, False)))
