"""Recordings as text: lines ``# key: value`` with the meta, a header that names the units, and one row per sample.

    # manoeuvre: weave
    time_s,handwheel_angle_deg,handwheel_torque_Nm,...
    0.001,0.0,0.0,...

Files from other programs may lack the meta, have comments without a key or a preamble of other lines above the header
(which become the meta ``comment``), put units
in brackets or in a row under the header, use semicolons or tabs as separators (then a comma is a decimal comma), leave
cells empty (an empty cell is a gap), and be UTF-8, UTF-16 with a byte-order mark, or Latin-1.
"""

import csv
import gzip
import json
import re
import warnings
import zlib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice, zip_longest
from os import PathLike, fspath
from typing import IO, Any, NamedTuple

import numpy as np

from steer_env.recording.table import Column, Table, Values, column, gaps, label, time_column

COMPRESSED = ".csv.gz"  # end of the name of a file that gzip has made smaller, which is read only
LONGEST_PREAMBLE = 50  # lines of a file among which its header is
APPENDED = "appended"  # key of the meta of a file that grew while it was recorded, see `steer_env.live.drive.log`
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")  # characters that no table has
_BLOCK_ROWS = 10_000  # rows that are converted to text at a time, which limits the memory


SEPARATORS = {".": ",", ",": ";"}  # decimal sign -> what separates columns then


def save(
    file: IO[bytes],
    time: np.ndarray,
    channels: list[tuple[str, str, np.ndarray]],
    meta: Mapping[str, Any],
    decimal: str = ".",
) -> None:
    """Write the channels (name, unit in memory, values in file units); every number is read back unchanged."""
    separator = SEPARATORS[decimal]
    file.write(head([(name, unit) for name, unit, _ in channels], meta, separator))
    for start in range(0, time.size, _BLOCK_ROWS):
        rows = np.column_stack([values[start : start + _BLOCK_ROWS] for values in (time, *(v for _, _, v in channels))])
        text = "".join([separator.join(map(repr, row)) + "\n" for row in rows.tolist()])
        file.write(text.replace(".", decimal).encode())


def head(channels: Sequence[tuple[str, str]], meta: Mapping[str, Any], separator: str = ",") -> bytes:
    """What stands above the rows: the meta, and the names of the channels (name, unit in memory)."""
    header = ["time_s"]
    for name, unit in channels:
        header.append(label(name, unit))
        if len(name.splitlines()) != 1 or re.search("[,;\t]", name) or [header[-1]] != _cells(header[-1], ","):
            raise ValueError(f"channel {name!r} in {unit!r} cannot be a column: rename the channel")
    lines = [f"# {key}: {_meta_text(value)}\n" for key, value in meta.items()]
    return ("".join(lines) + separator.join(header) + "\n").encode()


@contextmanager
def _check_gzip() -> Iterator[None]:
    """ValueError where what gzip has compressed is damaged or cut."""
    try:
        yield
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise ValueError(f"cannot be unpacked by gzip ({error}); is it complete?") from None


class _Layout(NamedTuple):
    """The parts of a file."""

    columns: list[Column]
    separator: str
    start: int  # index of the line from which on there are rows
    heads: set[int]  # indices of the lines with the header and the units


@_check_gzip()
def open_table(path: str | PathLike[str]) -> Table:
    """Read the header and the meta; the table's ``load`` reads the rows."""
    encoding = encoding_of(path)
    with _text(path, encoding) as file:
        lines = _decode(file)
        top: list[str] = []  # the lines up to the first one that is no comment, and some more
        for line in lines:
            top.append(line)
            if line.strip() and line[0] != "#":
                break
        else:
            raise ValueError("no header: expected a line that names the columns, time_s or Time [s] among them")
        first = len(top) - 1
        top += islice(lines, LONGEST_PREAMBLE)
    if _CONTROL.search("".join(top)):
        raise ValueError("no table: it begins with bytes that are no text (UTF-8, UTF-16 with its mark, or Latin-1)")
    layout = _layout(top, first)
    meta: dict[str, Any] = {}
    comments: list[str] = []
    for line in (line for k, line in enumerate(top[: layout.start]) if k not in layout.heads):
        key, colon, value = (part.strip() for part in line.removeprefix("#").partition(":"))
        if line[0] == "#" and colon and key:
            meta[key] = _meta_value(value)
        elif text := line.lstrip("#").strip():
            comments.append(text)
    if comments:
        meta["comment"] = "\n".join([*str(meta.get("comment", "")).splitlines(), *comments])
    repeated, blank = {top[k].strip() for k in layout.heads}, f'{layout.separator}" \t\r\n'

    def rows() -> Iterator[tuple[int, str]]:
        """Number and text of the lines that are rows, with decimal points."""
        with _text(path, encoding) as file:
            for number, line in enumerate(_decode(file), start=1):
                if meta.get(APPENDED) is True and not line.endswith("\n"):  # the program that wrote it was killed
                    meta["torn"] = "the last line"
                elif number > layout.start and line.strip(blank) and line[0] != "#" and line.strip() not in repeated:
                    yield number, line if layout.separator == "," else line.replace(",", ".")

    @_check_gzip()
    def load(places: Sequence[int]) -> list[Values]:
        table = _plain(rows(), layout, places)
        return (
            _load(rows(), layout, places, meta)
            if table is None
            else [gaps(meta, layout.columns[place].label, samples) for place, samples in zip(places, table)]
        )

    return Table(layout.columns, meta, True, load)


def _layout(top: list[str], first: int) -> _Layout:
    """Where the header is, and the units and the rows below it.

    The header is the line of index ``first``, which is the first one that is no comment. It may come later, below a
    preamble, if it has a row of numbers under it, and names a time where several lines have. Where the first line is
    such a row, the header may be one of the comments.
    """
    among = range(0 if _has_number(top[first]) else first, len(top))
    places = [first, *(k for k in among if k != first and not _has_number(top[k]))]
    layout = max((_layout_at(top, k, k < first) for k in places), key=lambda pair: pair[0])[1]
    if len(layout.columns) == 1 and time_column(layout.columns) is None:
        text = "separate columns by , or ; or tabs, and name a time in the header, time_s or Time [s]"
        raise ValueError(f"no time among the columns {layout.columns[0].label}: {text}")
    return layout


def _layout_at(top: list[str], place: int, commented: bool) -> tuple[int, _Layout]:
    """The parts of a file whose header is the line of an index, and how likely that is: 2, with a time, to 0."""
    separator = _separator(top[place])
    names = _cells(top[place], separator)
    while len(names) > 1 and not names[-1]:  # every line ends with separators
        names.pop()
    below = [k for k in range(place + 1, len(top)) if top[k].strip() and (commented or top[k][0] != "#")]
    columns, heads = [column(name) for name in names], {place}
    if below and (united := _with_units(columns, _cells(top[below[0]], separator), below[0] + 1)):
        columns = united
        heads.add(below.pop(0))
    layout = _Layout(columns, separator, below[0] if below else len(top), heads)
    row, time = _cells(top[below[0]], separator) if below else [], time_column(columns)
    if len(names) < 2 or len(row) < len(names) or any(row[len(names) :]):
        return 0, layout
    if time is not None:
        return 2 * _is_number(row[time]), layout
    return int(any(row) and all(not cell or _is_number(cell) for cell in row)), layout


def _has_number(line: str) -> bool:
    return any(map(_is_number, _cells(line, _separator(line))))


def _separator(line: str) -> str:
    return next((mark for mark in (";", "\t") if mark in line), ",")


def _with_units(columns: list[Column], cells: list[str], line: int) -> list[Column]:
    """The columns with the units of the line under the header; none where that has other things than units.

    ValueError where the header names another unit in brackets.
    """
    units = [cell[1:-1].strip() if cell[:1] + cell[-1:] in ("[]", "()") else cell for cell in cells]
    if any(_is_number(unit) and unit != "1" for unit in units):
        return []
    found = [column(each.label, unit) if unit else each for each, unit in zip_longest(columns, units[: len(columns)])]
    if not any(each.known and unit not in ("", "1") for each, unit in zip(found, units)):
        return []
    for k, (named, apart) in enumerate(zip(columns, found)):
        if named.unit is not None and named.known == apart.known:
            found[k] = named
        elif named.declares_unit and named is not apart:
            text = f"the row of units says {apart.unit!r}, the header says {named.unit!r}: correct one of them"
            raise ValueError(f"line {line}, column {named.label!r}: {text}")
    return found


def _plain(rows: Iterator[tuple[int, str]], layout: _Layout, places: Sequence[int]) -> np.ndarray | None:
    """The columns at the indices ``places`` (P, T), the first of which is the time; None if not all are numbers.

    It is twice as fast as :func:`_load`, which says what is not.
    """
    marks = len(layout.columns) - 1
    lines = (line if line.count(layout.separator) == marks else "no row" for _, line in rows)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a file without rows
        try:
            table = np.loadtxt(lines, delimiter=layout.separator, comments=None, usecols=places, ndmin=2).T
        except ValueError:
            return None
    return table if table.shape[1] > 1 and np.all(np.diff(table[0]) >= 0) and np.isfinite(table[0]).all() else None


def _load(
    rows: Iterator[tuple[int, str]], layout: _Layout, places: Sequence[int], meta: dict[str, Any]
) -> list[Values]:
    """The columns at the indices ``places``, the first of which is the time, or the reasons why they are none.

    A text without a digit, or one with the # of Windows and spreadsheets (1.#QNAN, #NV), stands for no value.
    """
    labels = [each.label for each in layout.columns]
    table, size = array("d"), 0  # the numbers of each row behind those of the row before
    codes: dict[int, dict[str, list[int]]] = {place: {} for place in places}  # texts in place of numbers, in which rows
    found: dict[int, Values] = {}
    number, latest = layout.start, -np.inf
    for number, line in rows:
        row = _cells(line, layout.separator)
        if len(row) < len(labels) or any(row[len(labels) :]):
            where = labels[min(len(row), len(labels) - 1)]
            raise _unreadable(number, where, f"{len(labels)} values separated by {layout.separator!r}", len(row))
        for place in places:
            cell = row[place] or "nan"
            value = _number(cell)
            if value is None:
                codes[place].setdefault(cell, []).append(size)
                if re.search(r"\d", cell) and "#" not in cell:
                    found.setdefault(place, f"has {cell!r} in line {number}, which is no number")
            table.append(np.nan if value is None else value)
        size += 1
        if not latest <= (latest := table[-len(places)]) < np.inf:
            found[places[0]] = f"has {row[places[0]]!r} in line {number}, which is no finite time that does not go back"
            break
    if size < 2 and not found:
        raise _unreadable(number + 1, labels[places[0]], "at least two rows", size)
    for samples, place in zip(np.array(table).reshape(size, -1).T, places):
        texts = codes[place]
        if texts and np.isnan(samples).all():
            found.setdefault(place, f"holds no numbers but {', '.join(map(repr, islice(texts, 3)))}")
        if place not in found:
            masks = {text: np.isin(np.arange(size), at) for text, at in texts.items()}
            found[place] = gaps(meta, labels[place], samples, masks)
    return [found[place] for place in places]


def _unreadable(line: int, place: int | str, expected: str, got: object) -> ValueError:
    return ValueError(f"line {line}, column {place!r}: expected {expected}, got {got!r}")


def is_compressed(path: str | PathLike[str]) -> bool:
    """Whether a file is a compressed one by its name."""
    return fspath(path).lower().endswith(COMPRESSED)


def _text(path: str | PathLike[str], encoding: str) -> IO[str]:
    """A file opened to be read as text."""
    return gzip.open(path, "rt", encoding=encoding) if is_compressed(path) else open(path, encoding=encoding)


def encoding_of(path: Any) -> str:
    """UTF-16 by its mark; UTF-8 if the first lines are UTF-8; else Latin-1, for degree signs of older tools."""
    with gzip.open(path) if is_compressed(path) else open(path, "rb") as file:
        if file.read(2) in (b"\xff\xfe", b"\xfe\xff"):
            return "utf-16"
    with _text(path, "utf-8-sig") as file:
        try:
            for _ in islice(file, 1000):
                pass
        except UnicodeDecodeError:
            return "latin-1"
    return "utf-8-sig"


def _decode(file: IO[str]) -> Iterator[str]:
    """The lines of a file; ValueError where its bytes are no text in its encoding."""
    number = 1
    try:
        for line in file:
            yield line
            number += 1
    except UnicodeDecodeError as error:
        raise ValueError(f"line {number} holds bytes that are not {error.encoding}: is it complete?") from None


def _cells(line: str, separator: str) -> list[str]:
    """The cells of a line, or of a comment, without spaces and quotation marks around them."""
    text = line.removeprefix("#").strip(" \r\n")
    cells = text.split(separator)
    if '"' in text and len(text) < csv.field_size_limit():  # unless it is a comment as long as a book
        cells = next(csv.reader([text], delimiter=separator, skipinitialspace=True))
    return [cell.strip() for cell in cells]


def _number(cell: str) -> float | None:
    """The number of a cell with a decimal point; None where it is none, as 1_0 is, which Python takes for 10."""
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def _is_number(cell: str) -> bool:
    return _number(cell.replace(",", ".")) is not None


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
