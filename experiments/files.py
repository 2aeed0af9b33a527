"""Output that appears whole or not at all."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def write_text(path: Path, text: str) -> None:
    """Write text beside ``path`` and then rename it."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_text(text, encoding="utf-8")
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_json(path: Path, data: Any) -> None:
    """Write strict JSON, whole or not at all; NaN and infinity are errors."""
    write_text(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


@contextmanager
def replaced_directory(out: Path, contents: frozenset[str]) -> Iterator[Path]:
    """A new directory beside ``out`` to write into, which takes its place when the block ends without an error.

    Whatever interrupts the block, ``out`` stays as it was.

    Parameters
    ----------
    out : Path
        Not there yet, empty, or an earlier output.
    contents : set of str
        File names of an earlier output; a directory that holds anything else is not replaced.

    Raises
    ------
    ValueError
        If ``out`` is no directory or holds other files.
    """
    out = out.resolve()
    if out.exists():
        if not out.is_dir():
            raise ValueError(f"{out} is a file: give a directory")
        others = sorted(entry.name for entry in out.iterdir() if entry.name not in contents)
        if others:
            raise ValueError(
                f"{out} holds other files ({others[0]}): give a new directory, which is replaced as a whole"
            )
    out.parent.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
    try:
        yield part
        part.chmod(0o755)  # mkdtemp's are private
        _swap(part, out)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _swap(part: Path, out: Path) -> None:
    """Put ``part`` in the place of ``out``; if that is interrupted, ``out`` is put back."""
    if not out.exists():
        os.rename(part, out)
        return
    old = part.with_name(part.name + ".old")
    try:
        os.rename(out, old)
        os.rename(part, out)
    finally:
        if not out.exists():
            os.rename(old, out)
        shutil.rmtree(old, ignore_errors=True)
