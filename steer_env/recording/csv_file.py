"""Recordings as text: lines ``# key: value`` with the meta, a header that names the units, and one row per sample.

    # manoeuvre: weave
    time_s,handwheel_angle_deg,handwheel_torque_Nm,...
    0.001,0.0,0.0,...

Files from other programs may lack the meta, have comments without a key or a preamble of other lines above the header
(which become the meta ``comment``), put units
in brackets or in a row under the header, use semicolons or tabs as separators (then a comma is a decimal comma), leave
cells empty (an empty cell is a gap), and be UTF-8, UTF-16 with a byte-order mark, or Latin-1.
"""

import gzip
import json
import os
import re
import warnings
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from os import PathLike, fspath
from typing import IO, Any

import numpy as np

from steer_env.recording.table import Column, Table, Values, column, label, time_place
from steer_env.recording.units import parse_unit

COMPRESSED = ".csv.gz"  # end of the name of a file that gzip has made smaller, which is read only
LONGEST_PREAMBLE = 50  # lines of a file among which its header is
APPENDED = "appended"  # key of the meta of a file that grew while it was recorded, see `steer_env.live.drive.log`
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")  # characters that no table has
_BLOCK = 10_000  # rows that are converted to text at a time, which limits the memory


def save(
    file: IO[bytes], time: np.ndarray, channels: list[tuple[str, str, np.ndarray]], meta: Mapping[str, Any]
) -> None:
    """Write the channels (name, unit in memory, values in file units); every number is read back unchanged."""
    file.write(head([(name, unit) for name, unit, _ in channels], meta))
    for start in range(0, time.size, _BLOCK):
        rows = np.column_stack([values[start : start + _BLOCK] for values in (time, *(v for _, _, v in channels))])
        file.write("".join([",".join(map(repr, row)) + "\n" for row in rows.tolist()]).encode())


def head(channels: Sequence[tuple[str, str]], meta: Mapping[str, Any]) -> bytes:
    """What stands above the rows: the meta, and the names of the channels (name, unit in memory)."""
    header = ["time_s"]
    for name, unit in channels:
        header.append(label(name, unit))
        if len(name.splitlines()) != 1 or re.search("[,;\t]", name) or header[-1] != _bare(header[-1]):
            raise ValueError(f"channel {name!r} in {unit!r} cannot be a column: rename the channel")
    lines = [f"# {key}: {_meta_text(value)}\n" for key, value in meta.items()]
    return ("".join(lines) + ",".join(header) + "\n").encode()


@contextmanager
def _undamaged() -> Iterator[None]:
    """ValueError where what gzip has compressed is damaged or cut."""
    try:
        yield
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise ValueError(f"cannot be unpacked by gzip ({error}); is it complete?") from None


@_undamaged()
def open_table(path: str | PathLike[str]) -> Table:
    """Read the header and the meta; the table's ``load`` reads the rows."""
    encoding = _encoding(path)
    meta: dict[str, Any] = {}
    comments: list[str] = []
    with _text(path, encoding) as file:
        lines = _decoded(file)
        top: list[str] = []  # the lines up to the header
        for header in lines:
            top.append(header)
            if header.strip() and not header.startswith("#"):
                break
            key, colon, value = (part.strip() for part in header[1:].partition(":"))
            if colon and key:
                meta[key] = _meta_value(value)
            elif header[1:].strip():
                comments.append(header[1:].strip())
        else:
            raise ValueError("no header: expected a line that names the columns, time_s or Time [s] among them")
        first = len(top)
        top += islice(lines, max(LONGEST_PREAMBLE - first, 0) + 2)
    if _CONTROL.search("".join(top)):
        raise ValueError("no table: it begins with bytes that are no text (UTF-8, UTF-16 with its mark, or Latin-1)")
    place, above, separator, columns = _header(top, first - 1)
    comments += [line.lstrip("#").strip() for line in top[first - 1 : place] if line.strip()]
    if comments:
        meta["comment"] = "\n".join([*str(meta.get("comment", "")).splitlines(), *comments])

    torn = meta.get(APPENDED) is True and not _ends(path)
    if torn:
        meta["torn"] = "the last line"

    def load(places: Sequence[int]) -> list[Values]:
        return _load(path, encoding, above, separator, columns, places, torn)

    return Table(columns, meta, True, load)


def _header(top: list[str], first: int) -> tuple[int, int, str, list[Column]]:
    """Index of the header, the number of lines above the rows, the separator and the columns.

    The header is the line of index ``first``, which is the first one that is no comment. It may come later, below a
    preamble, if it names a time and has a row of numbers under it.
    """
    for place in [*range(first, min(len(top), LONGEST_PREAMBLE)), first]:
        separator, columns = _columns(top[place])
        above = place + 1
        units = _row_of_units(top[above], separator, len(columns)) if above < len(top) else []
        if units:
            above += 1
            columns = [_with_unit(*pair, above) for pair in zip(columns, units)]
        texts = len(columns) > 1 and not any(_is_number(entry.label) for entry in columns)
        if texts and time_place(columns) is not None and _is_row("".join(top[above : above + 1]), separator, columns):
            break
    return place, above, separator, columns


def _columns(header: str) -> tuple[str, list[Column]]:
    """The separator of a header, and its columns."""
    separator = next((s for s in (";", "\t") if s in header), ",")
    columns = [column(cell) for cell in _cells(header, separator)]
    if len(columns) > 1 and not columns[-1].label:  # every line ends with a separator
        columns.pop()
    return separator, columns


def _row_of_units(line: str, separator: str, count: int) -> list[str]:
    """The units in the line under the header; empty unless every cell is one, or none, and one at least is known."""
    cells = _cells(line, separator)[:count]
    units = [cell[1:-1].strip() if cell[:1] + cell[-1:] in ("[]", "()") else cell for cell in cells]
    numbers = any(_is_number(cell) and cell != "1" for cell in cells)
    if len(units) == count and not numbers and any(parse_unit(unit) and unit != "1" for unit in units):
        return units
    return []


def _with_unit(named: Column, unit: str, line: int) -> Column:
    """A column with the unit of the row under the header; ValueError where the header names another in brackets."""
    if not unit or (named.unit is not None and parse_unit(named.unit) == parse_unit(unit)):
        return named
    if named.declares_unit:
        text = f"the row of units says {unit!r}, the header says {named.unit!r}: correct one of them"
        raise ValueError(f"line {line}, column {named.label!r}: {text}")
    return Column(named.label, named.label, unit)  # what looked like a unit at the end is part of the name


@_undamaged()
def _load(
    path: Any, encoding: str, above: int, separator: str, columns: list[Column], places: Sequence[int], torn: bool
) -> list[Values]:
    """The columns at the indices ``places``, the first of which is the time, without a last line that is ``torn``.

    A file that the fast reader refuses is read again slowly, to find the place of the error.
    """
    with _text(path, encoding) as file, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a file without rows
        rows = _complete(file) if torn else _decoded(file)
        lines = _whole(_numerals(islice(rows, above, None), separator), separator, len(columns))
        try:
            table = np.loadtxt(lines, delimiter=separator, comments=None, usecols=places, ndmin=2).T
        except ValueError:
            return _load_slowly(path, encoding, above, separator, columns, places, torn)
    if table.size and table.shape[1] > 1 and np.all(np.diff(table[0]) > 0):
        return list(table)
    return _load_slowly(path, encoding, above, separator, columns, places, torn)


def _load_slowly(
    path: Any, encoding: str, above: int, separator: str, columns: list[Column], places: Sequence[int], torn: bool
) -> list[Values]:
    """The columns of :func:`_load`; a ValueError names the line and the column of an error."""
    rows: list[list[float]] = []
    labels = [entry.label for entry in columns]
    number = above
    with _text(path, encoding) as file:
        lines = _complete(file) if torn else _decoded(file)
        for number, text in enumerate(_numerals(islice(lines, above, None), separator), start=above + 1):
            if not text.strip():
                continue
            cells = text.rstrip("\n").split(separator)
            if len(cells) == len(labels) + 1 and not cells[-1].strip():
                cells.pop()
            if len(cells) != len(labels):
                where = labels[min(len(cells), len(labels) - 1)]
                raise _unreadable(number, where, f"{len(labels)} values separated by {separator!r}", len(cells))
            row: list[float] = []
            for place in places:
                try:
                    row.append(float(cells[place].strip() or "nan"))
                except ValueError:
                    raise _unreadable(number, labels[place], "a number", cells[place]) from None
            if not np.isfinite(row[0]) or (rows and row[0] <= rows[-1][0]):
                expected = "a finite time after that of the line before"
                raise _unreadable(number, labels[places[0]], expected, cells[places[0]])
            rows.append(row)
    if len(rows) < 2:
        raise _unreadable(number + 1, labels[places[0]], "at least two rows", len(rows))
    return list(np.array(rows).T)


def _numerals(lines: Iterator[str], separator: str) -> Iterator[str]:
    """Lines in which decimal commas are replaced by points."""
    return lines if separator == "," else (line.replace(",", ".") for line in lines)


def _whole(lines: Iterator[str], separator: str, count: int) -> Iterator[str]:
    """Lines that are not blank, with NaN in empty cells; ValueError for a line with a wrong number of cells."""
    empty = re.compile(rf"(?<![^{separator}])(?={separator}|\s*$)")
    twice, ends = 2 * separator, (separator, separator + "\n")
    for line in lines:
        extra = line.count(separator) + 1 - count
        if extra == 0 or (extra == 1 and line.rstrip(" \n").endswith(separator)):
            # This test is faster than the regular expression.
            yield empty.sub("nan", line) if twice in line or line.startswith(separator) or line.endswith(ends) else line
        elif line.strip():
            raise ValueError(f"{count + extra} cells")


def _unreadable(line: int, place: int | str, expected: str, got: object) -> ValueError:
    return ValueError(f"line {line}, column {place!r}: expected {expected}, got {got!r}")


def compressed(path: str | PathLike[str]) -> bool:
    """Whether a file is a compressed one by its name."""
    return fspath(path).lower().endswith(COMPRESSED)


def _text(path: str | PathLike[str], encoding: str) -> IO[str]:
    """A file opened to be read as text."""
    return gzip.open(path, "rt", encoding=encoding) if compressed(path) else open(path, encoding=encoding)


def _encoding(path: Any) -> str:
    """UTF-16 by its mark; UTF-8 if the first lines are UTF-8; else Latin-1, for degree signs of older tools."""
    with gzip.open(path) if compressed(path) else open(path, "rb") as file:
        if file.read(2) in (b"\xff\xfe", b"\xfe\xff"):
            return "utf-16"
    with _text(path, "utf-8-sig") as file:
        try:
            for _ in islice(file, 1000):
                pass
        except UnicodeDecodeError:
            return "latin-1"
    return "utf-8-sig"


def _decoded(file: IO[str]) -> Iterator[str]:
    """The lines of a file; ValueError where its bytes are no text in its encoding."""
    number = 1
    try:
        for line in file:
            yield line
            number += 1
    except UnicodeDecodeError as error:
        raise ValueError(f"line {number} holds bytes that are not {error.encoding}: is it complete?") from None


def _complete(file: IO[str]) -> Iterator[str]:
    """The lines of a file that end; the last one may not, where the program that wrote it was killed."""
    return (line for line in _decoded(file) if line.endswith("\n"))


def _ends(path: Any) -> bool:
    """Whether the last line of a file is complete."""
    with gzip.open(path) if compressed(path) else open(path, "rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read() == b"\n"


def _cells(line: str, separator: str) -> list[str]:
    """The cells of a line without what is around them."""
    return [_bare(cell) for cell in line.rstrip("\n").split(separator)]


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _is_row(line: str, separator: str, columns: Sequence[Column]) -> bool:
    """Whether a line has a number or nothing in every column."""
    cells, count = _cells(line, separator), len(columns)
    return cells[count:] in ([], [""]) and len(cells) >= count and all(not cell or _is_number(cell) for cell in cells)


def _bare(cell: str) -> str:
    """A header's cell without spaces and quotation marks around it."""
    cell = cell.strip()
    return cell[1:-1].strip() if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell


def _meta_value(text: str) -> Any:
    """The value of a text in JSON; any other text as it is."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def _meta_text(value: Any) -> str:
    """Plain text where that is read back unchanged, JSON otherwise."""
    plain = isinstance(value, str) and value == value.strip() and len(value.splitlines()) <= 1
    plain = plain and not _CONTROL.search(value)  # which JSON escapes
    return value if plain and _meta_value(value) == value else json.dumps(value)
