"""The example that goes with the steering's object file, run on an emulated Cortex-M7."""

import shutil
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env.connect import fmu

COMPILER, QEMU = shutil.which("arm-none-eabi-gcc"), shutil.which("qemu-system-arm")
MISSING = "" if COMPILER and QEMU else "arm-none-eabi-gcc or qemu-system-arm is not installed"
SPEED = 20.0  # [m/s]
# As steering.h says, and with the warnings that a firmware may have.
_FLAGS = ("-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "-O2", "-Wall", "-Wextra", "-Werror")
# newlib, whose printf reaches the host through the emulator. The memory of the board begins at 0.
_LINKED = ("--specs=rdimon.specs", "-Wl,--section-start=.vectors=0,--wrap=steering_step,-z,noexecstack", "-lm")
_BOARD = ("-M", "mps2-an500", "-icount", "shift=0", "-nographic", "-semihosting-config", "enable=on,target=native")
_LIMIT = 120  # of a run, which takes less than a second [s]
_INPUTS = 6


class Run(NamedTuple):
    """One second of the example, and what a step takes."""

    inputs: np.ndarray  # (T, 6)
    outputs: np.ndarray  # (T, 10)
    mean: float  # instructions of a step
    most: float  # and of the longest, to 40
    stack: int  # bytes
    code: int  # bytes of the kernel, in flash memory
    parameters: int  # bytes, there
    memory: int  # bytes of a struct steering, in RAM


def run(folder: Path, law: Any) -> Run:
    """Export the steering with a friction law, link its example and run that."""
    fmu.export_object(folder, friction=law, speed=SPEED)
    program = folder / "example.elf"
    files = [
        Path(__file__).with_suffix(".c"),
        *(folder / f"steering{end}" for end in ("_example.c", ".c", "_kernels.o")),
    ]
    subprocess.run([COMPILER, *_FLAGS, f"-I{folder}", *files, *_LINKED, "-o", program], check=True)
    called = [QEMU, *_BOARD, "-kernel", program]
    text = subprocess.check_output(called, text=True, timeout=_LIMIT, stdin=subprocess.DEVNULL)
    taken, inputs, outputs = np.split(
        np.array([line.split() for line in text.splitlines()], float), (3, 3 + _INPUTS), 1
    )
    size = _sizes(program)
    mean, most, stack = taken[-1]
    code = _sizes(folder / "steering_kernels.o")
    memory = size["steering_parameters"], size["steering"]
    return Run(inputs, outputs, mean, most, int(stack), code["steer_advance"] + code["steer_begin"], *memory)


def _sizes(path: Path) -> dict[str, int]:
    """Bytes of every symbol of an object file or program."""
    tool = COMPILER.removesuffix("gcc") + "nm"
    lines = subprocess.check_output([tool, "--print-size", path], text=True).splitlines()
    return {words[3]: int(words[1], 16) for words in map(str.split, lines) if len(words) == 4}
