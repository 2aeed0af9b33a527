"""Make a result once more by its own trace, and tell whether it is equal to the bit.

Car, tyre and friction laws are those of the trace, not those of the files that the command named. Measurements,
policies and modules are looked up by name, here and beside the result, and checked by their digest. Dates and durations
are not compared. The exit code is 1 where the result is another.
"""

import argparse
import contextlib
import hashlib
import io
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names, options

GROUP = "test"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("file", metavar="FILE", help=f"a result: {', '.join(names.FORMATS)}, .json or .html")
    text = "in which what is made is kept; it must not hold anything yet"
    options.add_out(parser, text, otherwise="it is not kept")
    text = "go on with another version of the program or of its packages, and say so"
    parser.add_argument("--any-version", action="store_true", help=text)


def run(args: argparse.Namespace) -> int:
    """Make the result again and compare it; the exit code."""
    from steer_env.experiments.cli.common.extras import require_format
    from steer_env.experiments.pages import traces

    file = Path(args.file)
    require_format([file])
    trace = traces.read(file)
    if "command" not in trace:
        raise ValueError(f"{file}: its trace holds no command, as a Python program or 'benchmark' wrote it")
    _check_versions(file, trace, args.any_version)
    with contextlib.ExitStack() as stack:
        if args.out and args.out.exists() and (not args.out.is_dir() or any(args.out.iterdir())):
            raise ValueError(f"--out {args.out} is there already: give a new directory")
        out = Path(args.out or stack.enter_context(tempfile.TemporaryDirectory()))
        out.mkdir(parents=True, exist_ok=True)
        made = _make_again(file, trace, out / trace["result"])
        found = traces.differences(file, made)
    print(f"steer-env {' '.join(trace['command'])}")
    if not found:
        print(f"{file}: equal to the bit")
        return 0
    shown = ", ".join(found[:5]) + (f" and {len(found) - 5} more" if len(found) > 5 else "")
    print(f"{file}: {len(found)} values are others: {shown}")
    return 1


def _check_versions(file: Path, trace: Mapping[str, Any], go_on: bool) -> None:
    """Refuse, or say, that another version made the result."""
    from steer_env.experiments.pages import traces

    if not (others := traces.other_program(trace)):
        return
    text = f"{file} was made by another program: {others}"
    if not go_on:
        raise ValueError(f"{text}. Check out that version, or go on with --any-version")
    print(f"{text}; going on, as --any-version asks")


def _make_again(file: Path, trace: Mapping[str, Any], out: Path) -> Path:
    """The result that stands for ``file``, made once more at ``out``."""
    from steer_env.experiments.cli import main

    inputs = trace.get("inputs", [])
    given = [each for each in inputs if "name" in each]
    with tempfile.TemporaryDirectory() as folder, _path_with(file.parent):
        places = {each["name"]: _locate_input(each, file, Path(folder, str(i))) for i, each in enumerate(given)}
        words = list(trace["command"])
        _check_modules(file, {each["module"]: each["sha256"] for each in inputs if "module" in each}, words)
        main.import_modules(words)
        again = main.parsed([_replace_input(word, places) for word in words])
        again.argv, again.out = words, str(out) if isinstance(again.out, str) else out
        if "car" in trace:
            again.vehicle, again.tyre, again.changes = trace["car"], None, []
        with contextlib.redirect_stdout(io.StringIO()):
            again.function(again)
    # What it wrote under the name of the file; or, where that was renamed, what is of its kind.
    there = [out, *out.parent.glob(f"{out.stem}.*"), *sorted(out.rglob("*"))]
    alike = [path for path in there if path.is_file() and path.suffix == file.suffix]
    if not alike:
        raise ValueError(f"{file}: its command writes no {file.suffix} file")
    return next((path for path in alike if path.name == file.name), alike[0])


@contextlib.contextmanager
def _path_with(folder: Path) -> Iterator[None]:
    """Let modules be found in the working directory first, as in the command itself, and in ``folder`` last."""
    before = sys.path[:]
    sys.path[:] = [str(Path.cwd()), *before, str(folder.resolve())]
    try:
        yield
    finally:
        sys.path[:] = before


def _check_modules(file: Path, then: Mapping[str, str], words: Sequence[str]) -> None:
    """ValueError unless ``import`` will take the very modules with which the result was made."""
    from steer_env.experiments.cli import main
    from steer_env.experiments.pages import own_modules

    for name in then:
        if own_modules.find_spec(name) is None:
            raise ValueError(
                f"{file} needs the module {name}, which is neither in the working directory, nor installed, nor beside "
                "the result: put it there"
            )
    now = own_modules.digests(main.imported_modules(words))
    for name in {**then, **now}:
        if now.get(name) != then.get(name):
            place = getattr(own_modules.find_spec(name), "origin", None)
            known = f"that one's SHA-256 begins with {then[name][:12]}" if name in then else "there was none"
            raise ValueError(f"the module {name}, {place}, is another than {file} was made with: {known}")


def _replace_input(word: str, places: Mapping[str, Path]) -> str:
    """A word of the command line with the place of the input that it names, also after an equals sign."""
    option, equals, value = word.partition("=")
    return str(places[word]) if word in places else f"{option}{equals}{places.get(value, value)}"


def _locate_input(given: Mapping[str, str], file: Path, folder: Path) -> Path:
    """Where an input is: written from the trace that holds its text, or looked up and checked by its digest."""
    name = Path(given["name"])
    if "text" in given:
        folder.mkdir()
        (folder / name.name).write_bytes(given["text"].encode("utf-8"))
        return folder / name.name
    tried = [name, file.parent / name.name]
    there = [path for path in tried if path.is_file()]
    if not there:
        raise ValueError(f"{file} needs {name}, which is neither there nor beside the result: put it there")
    for path in there:
        if hashlib.sha256(path.read_bytes()).hexdigest() == given["sha256"]:
            return path
    raise ValueError(
        f"{there[0]} is another file than {file} was made from: its SHA-256 begins with {given['sha256'][:12]}"
    )
