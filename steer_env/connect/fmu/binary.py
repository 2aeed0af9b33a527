"""The binary of a unit: the C layer and the object code of the kernels, linked by a C compiler; and its sources.

For Linux on x86-64 the system's ``cc`` links, for other platforms the compiler zig, which comes as the wheel
``ziglang``. The headers of FMI come with the package ``fmpy``. Both are in the extra ``fmu``.
"""

import importlib.util
import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from platform import machine

import numpy as np

from steer_env.connect.fmu.object_code import PLATFORMS, SOURCE, Processor, assembler
from steer_env.connect.variables import Variable
from steer_env.friction.numerics.extras import install
from steer_env.friction.numerics.packing import pack
from steer_env.vehicle.subsystems import Subsystem
from steer_env.vehicle.subsystems.poses import has_poses

SOURCES = Path(__file__).parent / "c"
_FLAGS = ("-std=gnu11", "-O2", "-shared", "-Wall", "-Wextra", "-Wno-unused-parameter", "-s")


def headers() -> Path:
    """Folder of the standard's headers.

    Raises
    ------
    ValueError
        The package that contains them is not installed.
    """
    found = importlib.util.find_spec("fmpy")
    if found is None or found.origin is None:
        raise ValueError(f"the headers of FMI come with the package fmpy, which is not installed: {install('fmu')}")
    return Path(found.origin).parent / "c-code"


def compiler(platform: str) -> list[str]:
    """The command that compiles and links for a platform; none for sources.

    Raises
    ------
    ValueError
        There is none; the message tells what to install. Or this is another machine than those that were tried.
    """
    if machine() not in ("x86_64", "AMD64"):
        raise ValueError(f"an export needs a machine with an x86-64 processor, this one has {machine()}")
    if platform == SOURCE:
        return []
    if PLATFORMS[platform].zig:
        if importlib.util.find_spec("ziglang") is None:
            raise ValueError(f"{platform} is linked by zig, which is not installed: {install('fmu')}")
        return [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS[platform].zig]
    if sys.platform != "linux":
        raise ValueError(f"a binary for linux64 is linked on Linux only, and this is {sys.platform}")
    found = shutil.which(os.environ.get("CC", "cc"))
    if found is None:
        raise ValueError(
            "linux64 is linked by a C compiler, and there is none called cc: install one, as by 'apt install gcc', or "
            "name it in the environment variable CC"
        )
    return [found, "-fPIC"]


def link(platform: str, version: int, data: str, kernels: bytes, name: str, folder: Path) -> Path:
    """The shared library of a name in a folder, from C data and the object code of the kernels.

    Raises
    ------
    ValueError
        No compiler, no headers, or a compiler that fails; the message has what it says.
    """
    command = compiler(platform)
    binary = folder / f"{name}.{PLATFORMS[platform].suffix}"
    (folder / "data.c").write_text(data, encoding="utf-8")
    (folder / "kernels.o").write_bytes(kernels)
    files = (SOURCES / "core.c", SOURCES / f"fmi{version}.c", folder / "data.c", folder / "kernels.o")
    paths = (f"-I{SOURCES}", f"-I{headers()}", "-o", str(binary))
    done = subprocess.run([*command, *_FLAGS, *paths, *map(str, files), "-lm"], capture_output=True, text=True)
    if done.returncode:
        raise ValueError(f"the compiler {' '.join(command)} failed: {done.stderr.strip() or done.returncode}")
    return binary


# Platforms for which the sources have kernels, by the macro with which a compiler for them tells its processor.
_ASSEMBLED = {"__x86_64__": "linux64", "__aarch64__": "aarch64"}


def c_kernels(module: str, processor: Processor) -> str:
    """C source that defines the kernels by assembler within it, the same code as in the binaries.

    An importer thus needs nothing but gcc or clang. Sections and directives are those of ELF.
    """
    lines: list[str] = []
    for macro, platform in _ASSEMBLED.items():
        text = assembler(module, platform, processor).splitlines()
        lines += [f"#{'elif' if lines else 'if'} defined(__ELF__) && defined({macro})"]
        lines += ['__asm__(".pushsection .text\\n"', *(json.dumps(f"{line}\n") for line in text), '".popsection\\n");']
    lines += ["#else", '#error "the kernels are assembler for ELF on x86-64 and aarch64, as of Linux"', "#endif"]
    return "\n".join(lines) + "\n"


def sources(version: int, data: str, kernels: str) -> dict[str, bytes]:
    """The files of ``sources`` by their names; the headers of FMI belong to the importer."""
    files = {name: (SOURCES / name).read_bytes() for name in ("core.c", f"fmi{version}.c", "unit.h")}
    return {**files, "data.c": data.encode(), "kernels.c": kernels.encode()}


def c_data(subsystem: Subsystem, variables: list[Variable], processor: Processor, token: str) -> str:
    """C source that defines ``unit``."""
    numbers, tables = pack(subsystem.parameters)
    needed = processor.masks().items()
    lines = [
        '#include "unit.h"',
        _array("struct requirement", "requirements", (f"{{{leaf}u, '{r}', {bits}u}}" for (leaf, r), bits in needed)),
        _array("struct variable", "variables", map(_variable, variables)),
        _array("char *const", "states", map(json.dumps, subsystem.states)),
        *(
            _array("double", name, map(_float, values))
            for name, values in (
                ("numbers", numbers),
                ("tables", tables),
                ("start", subsystem.start),
                ("shown", subsystem.shown),
                ("given", [s.start for s in subsystem.given] + [0.0] * (subsystem.given_size - len(subsystem.given))),
            )
        ),
        _array("unsigned", "places", map(str, subsystem.zero_states)),
        _array("unsigned", "rows", map(str, subsystem.zero_outputs)),
        "const struct unit unit = {",
        f"    .token = {json.dumps(token)},",
        f"    .processor = {json.dumps(processor.name)},",
        *(f"    .{name} = {name}," for name in ("requirements", "variables", "states", "numbers", "tables")),
        *(f"    .{name} = {name}," for name in ("start", "shown", "given", "places", "rows")),
        f"    .poses = {'steer_poses' if has_poses(subsystem) else 'NULL'},",
        f"    .requirement_count = {len(needed)},",
        f"    .variable_count = {len(variables)},",
        f"    .number_count = {numbers.size},",
        f"    .state_count = {subsystem.start.size},",
        f"    .given_count = {subsystem.given_size},",
        f"    .input_count = {subsystem.inputs},",
        f"    .output_count = {len(subsystem.outputs)},",
        f"    .place_count = {len(subsystem.zero_states)},",
        f"    .row_count = {len(subsystem.zero_outputs)},",
        "};",
    ]
    return "\n".join(lines) + "\n"


def _array(kind: str, name: str, values: Iterable[str]) -> str:
    """An array; C has none of length zero, so that an empty one gets an element that nothing reads."""
    return f"static const {kind} {name}[] = {{{', '.join(values) or '0'}}};"


def _float(value: float) -> str:
    """A float without loss; hexadecimal, as C knows it."""
    if not math.isfinite(value):
        raise ValueError(f"a unit holds finite numbers only, got {value}")
    return float(np.float64(value)).hex()


def _bound(value: float) -> str:
    """A bound, which may be none."""
    return _float(value) if math.isfinite(value) else "INFINITY" if value > 0.0 else "-INFINITY"


def _variable(v: Variable) -> str:
    kind = "BOOLEAN" if v.boolean else "REAL"
    return f"{{{json.dumps(v.name)}, {v.array}, {v.place}, {v.use}, {kind}, {_bound(v.low)}, {_bound(v.high)}}}"
