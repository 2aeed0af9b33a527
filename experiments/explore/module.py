"""The car as a WebAssembly module: the kernels that Python runs, compiled by the same compiler for browsers.

The module imports nothing. It exports ``memory``, ``__heap_base``, from where on the memory is free, ``_initialize``,
which is called once, and the functions of :mod:`steer_env.vehicle.subsystems.machine_code`, whose addresses have 32
bits there. It is made for the structure of the parameters, not for their values: one for each law and chassis.
"""

import importlib.util
import subprocess
import sys
import tempfile
from importlib import metadata
from pathlib import Path

from filelock import FileLock

from steer_env.connect.fmu.object_code import module_text, object_for
from steer_env.experiments.pages import files
from steer_env.friction.numerics import cache
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.subsystems import Subsystem, car
from steer_env.vehicle.subsystems.machine_code import entry, signature

# The rack kinematics and the four wheels are computed in vectors, which browsers have had since 2021 to 2023.
TRIPLE, CPU, FEATURES = "wasm32-unknown-wasi", "generic", "+simd128"
EXPORTS = ("steer_advance", "steer_begin", "__heap_base")
LINK = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-mcpu=generic+simd128", "-O2", "-s")
INSTALL = "pip install '.[explore]'"


def compiled(p: Plant) -> bytes:
    """The module of a plant; it is kept on disk as the machine code of every kernel is.

    Raises
    ------
    ValueError
        Where kernels are not compiled (``NUMBA_DISABLE_JIT=1``), the compiler zig is missing, or it fails.
    """
    subsystem = car.unsettled(p)
    kinds = signature(subsystem)
    made_by = (TRIPLE, CPU, FEATURES, *LINK, *EXPORTS, _zig())
    folder = cache.folder_of(entry, kinds, " ".join(made_by))
    kept = folder / "car.wasm" if folder else None
    if not kept:
        return _linked(subsystem)
    with FileLock(kept.with_suffix(".lock")):  # others that need the same module wait for it
        if not kept.is_file():
            files.write_bytes(kept, _linked(subsystem))
        return kept.read_bytes()


def _zig() -> str:
    """The version of zig; ValueError where it is missing."""
    if importlib.util.find_spec("ziglang") is None:
        raise ValueError(f"a WebAssembly module is linked by zig, which is not installed: {INSTALL}")
    return metadata.version("ziglang")


def _linked(subsystem: Subsystem) -> bytes:
    """The module, from the object code of the kernels and the mathematical functions of zig's C library."""
    kernels = object_for(module_text(subsystem), TRIPLE, CPU, FEATURES)
    with tempfile.TemporaryDirectory() as folder:
        code, out = Path(folder, "kernels.o"), Path(folder, "car.wasm")
        code.write_bytes(kernels)
        command = [sys.executable, "-m", "ziglang", "cc", *LINK, *(f"-Wl,--export={name}" for name in EXPORTS)]
        done = subprocess.run([*command, "-o", str(out), str(code), "-lm"], capture_output=True, text=True)
        if done.returncode:
            raise ValueError(f"the linker zig failed: {done.stderr.strip() or done.returncode}")
        return out.read_bytes()
