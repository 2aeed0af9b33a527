"""The car as WebAssembly modules: the kernels that Python runs, compiled by the same compiler for browsers.

A module imports nothing. It exports ``memory``, ``__heap_base``, from where on the memory is free, ``_initialize``,
which is called once, and one of the functions of :mod:`steer_env.vehicle.subsystems.machine_code`, whose addresses have
32 bits there. It is made for the structure of the parameters, not for their values. Each law on each chassis has a
module that advances the car, and exports the law alone too, as ``steer_friction``. What begins a drive is larger, and
does not depend on the law: it is a module for each chassis, made for ``BEGINNING``, a law without memory, whose state
is that of any other law up to its memory.
"""

import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock
from numba import types

from steer_env.connect.fmu.object_code import module_text, object_for
from steer_env.experiments.pages import files
from steer_env.friction import sites
from steer_env.friction.law import law_of
from steer_env.friction.numerics import cache
from steer_env.friction.numerics.extras import install
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.packing import Floats, at_addresses
from steer_env.friction.response import follow
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.subsystems import Subsystem, car
from steer_env.vehicle.subsystems.machine_code import entry, first, signature

# The rack kinematics and the four wheels are computed in vectors, which browsers have had since 2021 to 2023.
TRIPLE, CPU, FEATURES = "wasm32-unknown-wasi", "generic", "+simd128"
BEGINNING = "viscous"
LINK = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-mcpu=generic+simd128", "-O2", "-s")
SAMPLES = 1024  # of a displacement that a friction law follows


def advancing(p: Plant) -> bytes:
    """The module that advances a plant, with ``steer_advance``.

    It is kept on disk as the machine code of every kernel is.

    Raises
    ------
    ValueError
        Where kernels are not compiled (``NUMBA_DISABLE_JIT=1``), the compiler zig is missing, or it fails.
    """
    return _kept(
        entry, signature(car.without_start_state(p)), "steer_advance", p, {"steer_friction": (path, _of_path(p))}
    )


def beginning(p: Plant) -> bytes:
    """The module with ``steer_begin``, for a plant with the law ``BEGINNING``; it is kept on disk as well.

    Raises
    ------
    ValueError
        As of :func:`advancing`.
    """
    return _kept(first, signature(car.without_start_state(p))[:3], "steer_begin", p)


@kernel
def path(numbers: Any, tables: Any, memory: Any, scales: Any, x: Any, step: Any, out: Any) -> None:
    """The torque of a friction law along a displacement, as :func:`steer_env.friction.response.follow`; by addresses.

    ``step`` has one value, the time between two samples [s].
    """
    follow(
        at_addresses(numbers, tables),
        at_addresses(scales, scales),
        at_addresses(memory, memory),
        at_addresses(x, x),
        at_addresses(step, step)[0],
        at_addresses(out, out),
    )


def _of_path(p: Plant) -> tuple:
    """Types of the arguments of :func:`path` for the law of a plant and ``SAMPLES`` samples."""
    arrays = [(law_memory_size(p),), (SAMPLES, 2), (SAMPLES,), (1,), (SAMPLES,)]
    friction = sites.bound(p.friction, linked=True) if isinstance(p.friction, sites.Sites) else p.friction
    return (Floats(friction), types.CPointer(types.float64), *(Floats(np.zeros(shape)) for shape in arrays))


def law_memory_size(p: Plant) -> int:
    """Floats of the memory of a plant's friction law, at least one."""
    return max(law_of(p.friction).memory_size(p.friction), 1)


Further = Mapping[str, tuple[Any, tuple]]  # name of a function -> its kernel and the types of its arguments


def _kept(kernel: Any, kinds: tuple, name: str, p: Plant, further: Further | None = None) -> bytes:
    """A module with the function ``name`` of a plant, and further ones, from disk or made anew."""
    others = (cache.source_hash(*each, name) for name, each in (further or {}).items())
    folder = cache.kernel_folder(kernel, kinds, " ".join((TRIPLE, CPU, FEATURES, *LINK, _zig(), *others)))
    kept = folder / "car.wasm" if folder else None
    if not kept:
        return _linked(car.without_start_state(p), name, further)
    with FileLock(kept.with_suffix(".lock")):  # others that need the same module wait for it
        if not kept.is_file():
            files.write_bytes(kept, _linked(car.without_start_state(p), name, further))
        return kept.read_bytes()


def _zig() -> str:
    """The version of zig; ValueError where it is missing."""
    if importlib.util.find_spec("ziglang") is None:
        raise ValueError(f"a WebAssembly module is linked by zig, which is not installed: {install('explore')}")
    return metadata.version("ziglang")


def _linked(subsystem: Subsystem, name: str, further: Further | None) -> bytes:
    """The module with a function, and further ones.

    It is made of the kernels' object code and the mathematical functions of zig's C library.
    """
    kernels = object_for(module_text(subsystem, (name,), further), TRIPLE, CPU, FEATURES)
    with tempfile.TemporaryDirectory() as folder:
        code, out = Path(folder, "kernels.o"), Path(folder, "car.wasm")
        code.write_bytes(kernels)
        exports = (f"-Wl,--export={each}" for each in (name, *(further or {}), "__heap_base"))
        command = [sys.executable, "-m", "ziglang", "cc", *LINK, *exports]
        done = subprocess.run([*command, "-o", str(out), str(code), "-lm"], capture_output=True, text=True)
        if done.returncode:
            raise ValueError(f"the linker zig failed: {done.stderr.strip() or done.returncode}")
        return out.read_bytes()
