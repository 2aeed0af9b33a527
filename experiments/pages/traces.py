"""Result files: the trace that each holds, and whether two of them hold the same results.

A trace (:func:`steer_env.experiments.pages.provenance.trace`) is the key ``trace`` of a JSON file and of the meta of a
recording, and an element of a page.
"""

import json
import os
import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from steer_env.experiments.pages import provenance
from steer_env.friction.numerics import toml
from steer_env.recording import files

# What describes the run and not its result, at the top of a JSON file: dates, durations, machine, versions, the trace.
_ABOUT_THE_RUN = frozenset({"trace", "versions", "provenance", "real_time", "version"})
_ELEMENT = re.compile(r'<script type="application/json" id="trace">(.*?)</script>\n?', re.DOTALL)
_DATE = re.compile(r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d)?(?:\+00:00)?)?")
_MEASURED = re.compile(r"<!-- measured -->.*?<!-- end of measured -->", re.DOTALL)  # durations, and the machine
_RANDOM_NAME_PATTERN = re.compile(r"[0-9a-f]{8}-(?:[0-9a-f]{4}-){3}[0-9a-f]{12}")  # random names of plots in a page
Place = tuple[str | int, ...]  # of a value: the keys of mappings and the positions in lists that lead to it
SUFFIXES = (".json", ".html", *files.FORMATS)


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The trace of a result file.

    Raises
    ------
    ValueError
        A file of another kind, or without a trace.
    OSError
        A file that cannot be read.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"{path}: results end in {', '.join(SUFFIXES)}")
    if suffix == ".html":
        element = _ELEMENT.search(toml.text(path))
        found = toml.parse_file(path, element[1], json.loads) if element else None
    elif suffix == ".json":
        contents = toml.read(path, json.loads)
        found = contents.get("trace") if isinstance(contents, dict) else None
    else:
        found = files.read(path).meta.get("trace")
    if not isinstance(found, dict):
        raise ValueError(f"{path}: holds no trace, so nothing tells what it was made from")
    _check(path, found)
    return found


def _check(path: str | os.PathLike[str], trace: Mapping[str, Any]) -> None:
    """ValueError for a trace that :func:`provenance.trace` has not written; what it names is made beside nothing else.

    The name of a result has no folder, so that a result that is made again stays where it is wanted.
    """
    inputs = trace.get("inputs", [])
    words, result = trace.get("command"), trace.get("result")
    right = {
        "version": isinstance(trace.get("version"), str),
        "sources": isinstance(trace.get("sources"), str),
        "packages": isinstance(trace.get("packages"), dict),
        "command": words is None or (isinstance(words, list) and all(isinstance(word, str) for word in words)),
        "result": words is None
        or (isinstance(result, str) and result not in ("", "..") and Path(result).name == result),
        "inputs": isinstance(inputs, list) and all(map(_is_input, inputs)),
    }
    for key, as_it_should_be in right.items():
        if not as_it_should_be:
            raise ValueError(f"{path}: its trace holds no {key} as this program writes it, got {trace.get(key)!r}")


def other_program(trace: Mapping[str, Any]) -> str:
    """In what this program is another than the one that a trace tells, in words; empty if in nothing."""
    now = provenance.trace()
    packages = {f"package {name}": version for name, version in now["packages"].items()}
    then = {f"package {name}": version for name, version in trace["packages"].items()}
    here = {"version": now["version"], "sources": now["sources"], **packages}
    before = {"version": trace["version"], "sources": trace["sources"], **then}
    others = [key for key in {**here, **before} if before.get(key) != here.get(key)]
    return "; ".join(f"{key} {before.get(key)} then, {here.get(key)} now" for key in others)


def _is_input(given: Any) -> bool:
    """Whether an entry of a trace is an input: texts, with a digest and the name of a file or a module."""
    texts = isinstance(given, dict) and all(isinstance(value, str) for value in given.values())
    return texts and "sha256" in given and ("name" in given or "module" in given)


def differences(one: str | os.PathLike[str], other: str | os.PathLike[str]) -> list[str]:
    """What two result files of a kind do not have in common, to the bit; none for equal results.

    The trace is not compared, nor what stands at the top of a JSON file, or marked in a page, about the run: date,
    durations, machine, versions.
    """
    suffix = Path(one).suffix.lower()
    if suffix == ".html":
        return [] if _page(one) == _page(other) else ["the text of the page"]
    if suffix == ".json":
        a, b = (_result(toml.read(path, json.loads), _ABOUT_THE_RUN) for path in (one, other))
    else:
        a, b = _read_recording(one), _read_recording(other)
    places = [place for place in {**a, **b} if place not in a or place not in b or not _equal(a[place], b[place])]
    return [".".join(map(str, place)) for place in places]


def _page(path: str | os.PathLike[str]) -> str:
    """The text of a page without its trace, its dates, what it marks as measured, and the random names of its plots."""
    text = _MEASURED.sub("", _ELEMENT.sub("", toml.text(path)))
    return _RANDOM_NAME_PATTERN.sub("", _DATE.sub("", text))


def _values(value: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """The values of nested mappings and lists with their places."""
    if isinstance(value, Mapping | list) and value:
        for key, each in value.items() if isinstance(value, Mapping) else enumerate(value):
            yield from _values(each, (*place, key))
    else:
        yield place, value


def _result(contents: Any, about_the_run: Collection[str]) -> dict[Place, Any]:
    """The values of a result file with their places, without what is about the run at its top."""
    if isinstance(contents, Mapping):
        contents = {key: value for key, value in contents.items() if key not in about_the_run}
    return dict(_values(contents))


def _read_recording(path: str | os.PathLike[str]) -> dict[Place, Any]:
    """Time, channels, units and meta of a recording."""
    recording = files.read(path)
    said = {f"meta {name}": value for name, value in recording.meta.items() if name != "trace"}
    units = {f"unit of {name}": unit for name, unit in recording.units.items()}
    return dict(_values({"time": recording.time, **recording.channels, **units, **said}))


def _equal(one: Any, other: Any) -> bool:
    """Whether two values are of the same bits: zeros with other signs are not, NaN with the same bits are."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray | float):
        a, b = np.asarray(one), np.asarray(other)
        return (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    return one == other
