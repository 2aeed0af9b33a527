"""Atomic output: a file or directory appears as a whole or not at all."""

import csv
import io
import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from steer_env.recording.csv_file import SEPARATORS


def write_text(path: Path, text: str) -> None:
    """Write a text file as :func:`write_bytes` does, in UTF-8 and with the line ends of the system."""
    write_bytes(path, text.replace("\n", os.linesep).encode())


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file beside ``path``, then rename it."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        os.replace(part, path)
    except OSError as error:  # a full disk has no name
        error.filename = error.filename or str(path)
        raise
    finally:
        part.unlink(missing_ok=True)


_decimal: ContextVar[str] = ContextVar("decimal sign of tables", default=".")


@contextmanager
def csv_decimal(sign: str) -> Iterator[None]:
    """Write tables with this decimal sign meanwhile, "." or ","."""
    token = _decimal.set(sign)
    try:
        yield
    finally:
        _decimal.reset(token)


def csv_text(rows: Iterable[Sequence[Any]]) -> str:
    """Rows as CSV; with a decimal comma (:func:`csv_decimal`) the columns are separated by semicolons."""
    file, sign = io.StringIO(), _decimal.get()
    writer = csv.writer(file, delimiter=SEPARATORS[sign], lineterminator="\n")
    writer.writerows([str(x).replace(".", sign) if isinstance(x, float) else x for x in row] for row in rows)
    return file.getvalue()


def write_json(path: Path, data: Any) -> None:
    """Write strict JSON, in which NaN and infinity are errors."""
    write_text(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


def usable(out: Path, contents: frozenset[str] | None = None) -> None:
    """ValueError for a directory that cannot be written, to be called before the work that it is for.

    ``contents`` are the names that :func:`replaced_directory` may replace; with None any content is accepted.
    """
    out = out.resolve()
    if not out.exists() and out.suffix[1:2].isalpha():
        raise ValueError(f"{out} is named like a file, with {out.suffix!r}: give the name of a directory")
    if out.exists():
        if not out.is_dir():
            raise ValueError(f"{out} is a file: give a directory")
        others = sorted(entry.name for entry in out.iterdir() if contents is not None and entry.name not in contents)
        if others:
            raise ValueError(
                f"{out} holds other files ({others[0]}): give a new directory, or one with the output of an earlier run"
            )
    place = out if out.exists() and contents is None else out.parent
    there = next(folder for folder in (place, *place.parents) if folder.exists())
    if not there.is_dir():
        raise ValueError(f"{out} cannot be made, as {there} is a file: give another directory")
    if not os.access(there, os.W_OK | os.X_OK):
        raise ValueError(f"{out} cannot be written, as you have no permission in {there}: give another directory")


@contextmanager
def replaced_directory(out: Path, contents: frozenset[str]) -> Iterator[Path]:
    """A new directory beside ``out`` to write into; it replaces ``out`` when the block ends without an error.

    If the block is interrupted, ``out`` stays as it was.

    Parameters
    ----------
    out : Path
        A directory that does not exist yet, is empty, or holds an earlier output.
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
        part.chmod(0o755)  # mkdtemp makes a private directory
        _swap(part, out)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _swap(part: Path, out: Path) -> None:
    """Replace ``out`` by ``part``; if that is interrupted, ``out`` is restored."""
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
