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


def usable(out: Path, contents: frozenset[str] | None = None) -> None:
    """ValueError for a directory that could not be written, so that it is known before the work and not after.

    ``contents`` are the names that :func:`replaced_directory` will replace; None leaves what the directory holds to
    the caller.
    """
    out = out.resolve()
    if out.exists():
        if not out.is_dir():
            raise ValueError(f"{out} is a file: give a directory")
        others = sorted(entry.name for entry in out.iterdir() if contents is not None and entry.name not in contents)
        if others:
            raise ValueError(
                f"{out} holds other files ({others[0]}): give a new directory, which is replaced as a whole"
            )
    place = out if out.exists() and contents is None else out.parent
    there = next(folder for folder in (place, *place.parents) if folder.exists())
    if not there.is_dir():
        raise ValueError(f"{out} cannot be made, for {there} is a file: give another directory")
    if not os.access(there, os.W_OK | os.X_OK):
        raise ValueError(f"{out} cannot be written, for {there} is closed to you: give another directory")


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
        As :func:`usable`.
    """
    out = out.resolve()
    usable(out, contents)
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
