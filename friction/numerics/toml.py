"""TOML as every supported Python reads it, and text files from outside."""

import sys
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    from tomllib import TOMLDecodeError, load, loads
else:
    from tomli import TOMLDecodeError, load, loads

__all__ = ["TOMLDecodeError", "load", "loads", "parse_file", "read", "text"]


def text(path: str | PathLike[str]) -> str:
    """The text of a file, with a byte-order mark or without; ValueError names a file that is not in UTF-8."""
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: expected text in UTF-8") from None


def parse_file(path: str | PathLike[str], content: str | bytes, parse: Callable[[Any], Any]) -> Any:
    """``parse(content)``; ValueError names the file and, as the parsers do, the line of an error."""
    try:
        return parse(content)
    except RecursionError:
        raise ValueError(f"{path}: is nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def read(path: str | PathLike[str], parse: Callable[[str], Any] = loads) -> Any:
    """What a file says, in TOML or what else ``parse`` reads, ``json.loads``.

    Raises
    ------
    ValueError
        With the name of the file and the reason.
    OSError
        If the file cannot be opened.
    """
    return parse_file(path, text(path), parse)
