"""Damaged files for every reader of files from outside: each is read, or refused in one sentence that names the file.

``python tests/tools/fuzz.py --cases 2000 --seed 0`` changes valid files and gives each to its reader, in this process.
A case fails where the reader raises anything but ValueError and OSError, refuses without the name of the file, warns of
anything that is not meant for users, takes longer than it may, leaves a file behind, or runs foreign code: it
unpickles a class, starts a process, loads a library. ``--first N --cases 1`` repeats
case N, ``--keep DIR`` keeps the files of cases that fail.
"""

import argparse
import faulthandler
import gzip
import io
import json
import logging
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).parents[2]
EXAMPLES, DATA = ROOT / "examples", ROOT / "experiments" / "data"
# The folder of the file, in that of the files that a call needs beside; as a training calls its own
CASE = "checkpoint"
LONGEST, HANGS = 10.0, 60.0  # processor time of a case, with that of its processes, and time on a busy machine [s]
ROWS = 400  # of a recording, which the readers read quickly
ENV_ID = "steer_env/DriverOnCentre-v3"
# Audit events of code that is not a reader's. Libraries that a reader loads are loaded by the seeds before.
FOREIGN = {
    "pickle.find_class",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.fork",
    "subprocess.Popen",
    "ctypes.dlopen",
}
FOREIGN |= {"socket.connect"}
HIDDEN = (UserWarning, DeprecationWarning, PendingDeprecationWarning, ResourceWarning)  # in a sentence, or by Python


class Reader(NamedTuple):
    """A reader of files, and valid files for it by name; other files that a call needs lie in the folder above."""

    read: Callable[[Path], Any]
    seeds: dict[str, bytes]


class HangError(BaseException):
    """A case took too long; no ``except Exception`` of a library stops it."""


class WrongError(Exception):
    """A reader did what it must not do, without an exception."""


# The readers ---------------------------------------------------------------------------------------------------------


def command(*words: str) -> None:
    """Run the command line; ValueError with what it prints when it refuses."""
    from steer_env.experiments.cli import main

    out, told = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(told):
        code = main.main(words)
    if code == 2:
        if out.getvalue().startswith("{"):
            raise WrongError(f"{words[0]} printed part of a result")
        if len(lines := told.getvalue().splitlines()) != 1 or len(lines[0]) > 2000:
            raise WrongError(f"{words[0]} refused in {len(lines)} lines of {len(told.getvalue())} characters")
        raise ValueError(lines[0])
    if words[0] == "car":
        json.loads(out.getvalue())


def _environment(path: Path) -> None:
    import gymnasium

    gymnasium.make(ENV_ID, vehicle=str(path)).close()


def _friction(path: Path) -> None:
    from steer_env import friction

    friction.resolve(str(path))


def _mapped(path: Path) -> None:
    from steer_env.recording import files

    files.read(path.parent.with_name("weave.csv"), str(path))


def _can(log: Path, dbc: Path, mapping: Path) -> None:
    from steer_env.recording import can_log, files

    files.read(log, str(mapping), can=can_log.Options(dbc))


def _record(path: Path) -> None:
    from steer_env.recording import files, friction_record

    found = files.read(path)
    try:
        friction_record.from_recording(found)
    except ValueError as error:  # is about a recording, which the command line names
        raise ValueError(f"{path}: {error}") from None


def _policy(path: Path) -> None:
    from steer_env.experiments.learning import policy

    about = policy.read_description(path)
    policy.check_observations(path, about, ENV_ID)
    policy.law(about["friction"], path)
    policy.Policy(path, _env())


def _env(made: list[Any] = []) -> Any:  # noqa: B006
    """The one environment of all policies."""
    if not made:
        import gymnasium

        made.append(gymnasium.make(ENV_ID))
    return made[0]


def _unit(path: Path) -> None:
    from steer_env.connect.external import fmu_vehicle

    fmu_vehicle._description(path)  # the part that runs no code of the unit


def _trace(path: Path) -> None:
    from steer_env.experiments.cli import rerun
    from steer_env.experiments.pages import traces

    with redirect_stdout(io.StringIO()):
        rerun._check_versions(path, traces.read(path), go_on=True)
    traces.differences(path, path)


def _checkpoint(path: Path) -> None:
    from steer_env.experiments.learning import training

    training._checkpoint(path.parents[1])


def _journal(path: Path) -> None:
    from steer_env.experiments.calibration import storage

    storage.require_whole(path)


def _curve(path: Path) -> None:
    from steer_env.experiments.learning import policy_report

    policy_report.read_curve(path)


def readers(folder: Path) -> dict[str, Reader]:
    """Every reader with valid files, which packaged data, the examples and the project's own writers give."""
    from steer_env import friction, targets
    from steer_env.connect.external import mapping
    from steer_env.experiments.studies.common import simulation_vs_measurement
    from steer_env.recording import files
    from steer_env.vehicle import cars, tyre

    def written(name: str, write: Callable[[Path], Any]) -> dict[str, bytes]:
        write(folder / name)
        return {name: (folder / name).read_bytes()}

    def packaged(*paths: Path) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in paths}

    weave = "".join((EXAMPLES / "weave_example.csv").read_text(encoding="utf-8").splitlines(True)[: ROWS + 3])
    (folder / "weave.csv").write_text(weave, encoding="utf-8")
    recording = files.read(folder / "weave.csv", EXAMPLES / "weave_example.toml")
    formats = {}
    for suffix in files.FORMATS:
        formats |= written(f"recording{suffix}", lambda path: files.write(recording, path))
    x = np.abs(np.arange(ROWS) % 200 - 100) / 500.0 - 0.1
    torque = friction.response(friction.make("dahl"), x, 0.01)
    record = "time_s,displacement_rad,friction_Nm\n" + "".join(
        f"{0.01 * i},{x_i},{T_i}\n" for i, (x_i, T_i) in enumerate(zip(x, torque))
    )
    log = gzip.decompress((EXAMPLES / "can_log" / "rav4_2017_can_60s.log.gz").read_bytes()).splitlines(True)
    (folder / "can.log").write_bytes(b"".join(log[:ROWS]))
    for name in ("rav4.toml", "toyota_rav4_2017.dbc"):
        shutil.copy(EXAMPLES / "can_log" / name, folder / name)
    dbc, can_mapping = folder / "toyota_rav4_2017.dbc", folder / "rav4.toml"
    logs = packaged(folder / "can.log") | {"can.log.gz": gzip.compress((folder / "can.log").read_bytes())}
    for suffix in (".asc", ".blf", ".trc", ".csv"):
        logs |= written(f"can{suffix}", lambda path: _converted(folder / "can.log", path))
    compact = cars.load("compact")
    state = dict.fromkeys(_training_keys(), 0)
    settings = {"environment": {}, "algorithm": {}, "controller": {}}
    (folder / "settings.json").write_text(json.dumps(settings), encoding="utf-8")
    trace = {"trace": _made_trace(compact), "metrics": {"gain": [1.0, 2.0]}}
    page = f'<p>1</p><script type="application/json" id="trace">{json.dumps(trace["trace"])}</script>\n'
    tyres = ROOT / "vehicle" / "data" / "tyres"
    tolerances, bands = DATA / "tolerances", ROOT / "steer_env" / "targets"
    policies = {
        f"{name}.zip": (DATA / "policies" / name / "policy.zip").read_bytes() for name in ("DriverOnCentre-v3",)
    }
    curve = next((DATA / "policies" / "DriverOnCentre-v3").glob("*.csv"))
    fitted = {"friction": {"law": "lugre", "F_c": 1.2}, "units": {"displacement": "rad", "torque": "N m"}}
    fitted |= {"level": {"load": 0.1}, "undetermined": ["F_c"]}
    external = (
        'fmu = "vehicle.fmu"\nstep_ms = 1\nspeed_m_s = 27.8\nown_process = false\n[parameters]\nmass = 1500.0\n'
        '[inputs.rack_speed]\nvariable = "rack"\nunit = "mm/s"\nsign = -1\n[outputs.yaw_rate]\n'
        'variable = "Car.yaw_rate"\nunit = "deg/s"\n[meta]\nwheelbase_m = 2.6\nsteering_ratio = 15.0\n'
    )
    own = {
        "own.toml": (EXAMPLES / "assist_functions.toml").read_bytes(),
        "own.json": json.dumps(compact.data(), indent=1).encode(),
        **written("whole.toml", lambda path: cars.write(compact, path, comments=True)),
    }
    short = {
        "short.toml": b'base = "compact"\ntyre = "example_mf61"\n[column]\nK_tb = 143.0\n[chassis]\nmass = 1400.0\n'
    }
    return {
        "car": Reader(lambda path: command("car", str(path)), own | short),
        "gym.make": Reader(_environment, short),
        "tyre": Reader(tyre.load, packaged(*tyres.glob("*.tir"))),
        "friction": Reader(_friction, {"fitted.json": json.dumps(fitted).encode()}),
        "targets": Reader(lambda path: targets.load(str(path)), packaged(*bands.glob("*.toml"))),
        "tolerances": Reader(
            lambda path: simulation_vs_measurement.tolerances(str(path)), packaged(*tolerances.glob("*.toml"))
        ),
        "recording": Reader(files.read, formats),
        "compressed recording": Reader(files.read, {"recording.csv.gz": gzip.compress(formats["recording.csv"])}),
        "evaluate": Reader(
            lambda path: command("evaluate", str(path), "--manoeuvre", "weave"), {"test.csv": formats["recording.csv"]}
        ),
        "mapping": Reader(_mapped, packaged(EXAMPLES / "weave_example.toml")),
        "friction record": Reader(_record, {"record.csv": record.encode()}),
        "CAN log": Reader(lambda path: _can(path, dbc, can_mapping), logs),
        "CAN database": Reader(lambda path: _can(folder / "can.log", path, can_mapping), packaged(dbc)),
        "policy": Reader(_policy, policies),
        "learning curve": Reader(_curve, packaged(curve)),
        "FMU": Reader(_unit, {"vehicle.fmu": _fmu()}),
        "external vehicle": Reader(mapping.read, {"external.toml": external.encode()}),
        "result": Reader(_trace, {"result.json": json.dumps(trace).encode(), "result.html": page.encode()}),
        "checkpoint": Reader(_checkpoint, {"state.json": json.dumps(state).encode()}),
        "journal": Reader(_journal, {"journal.log": b'{"op_code": 0, "name": "a"}\n' * 5}),
    }


def _converted(log: Path, path: Path) -> None:
    import can

    with can.LogReader(log) as reader, can.Logger(path) as writer:
        for frame in reader:
            writer(frame)


def _made_trace(car: Any) -> dict[str, Any]:
    from steer_env.experiments.pages import provenance

    return provenance.trace(command=["car", "compact"], result="car", car=car)


def _training_keys() -> tuple[str, ...]:
    from steer_env.experiments.learning import training

    return tuple(training.STATE_KEYS)


def _fmu() -> bytes:
    """An archive with a description and a file in the place of the binary, which nobody loads."""
    import fmpy

    text = (
        '<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="car" guid="{1}">'
        '<CoSimulation modelIdentifier="car"/><ModelVariables><ScalarVariable name="v" valueReference="0" '
        'causality="output"><Real/></ScalarVariable></ModelVariables><ModelStructure><Outputs><Unknown index="1"/>'
        "</Outputs></ModelStructure></fmiModelDescription>"
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text)
        archive.writestr(f"binaries/{fmpy.platform}/car{fmpy.sharedLibraryExtension}", b"no library")
    return file.getvalue()


# The changes ---------------------------------------------------------------------------------------------------------

NUMBERS = [b"nan", b"inf", b"-inf", b"-1", b"0", b"1e308", b"-1e308", b"1e-320", b"1e999", b"9" * 400, b"9" * 5000]
WORDS = [
    b'""',
    b'"x"',
    b"[]",
    b"{}",
    b"[[[]]]",
    b"true",
    b"null",
    b'"' + b"x" * 100_000 + b'"',
    b'"\\u0000"',
    b"1979-05-27",
]
PIECES = [
    b"\x00",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\xe9",
    b"\r\n",
    b"\n",
    b"[",
    b"{",
    b'"',
    b"'",
    b"=",
    b",",
    b";",
    b"\x1b[2J",
]
_NUMBER, _WORD = re.compile(rb"-?\d+\.?\d*(?:[eE][+-]?\d+)?"), re.compile(rb'"[^"\n]*"|\b\w+\b')


def _replaced(rng: random.Random, data: bytes, pattern: re.Pattern[bytes], texts: list[bytes]) -> bytes:
    places = list(pattern.finditer(data))
    if not places:
        return data
    place = rng.choice(places)
    return data[: place.start()] + rng.choice(texts) + data[place.end() :]


def _number(rng: random.Random, data: bytes) -> bytes:
    return _replaced(rng, data, _NUMBER, NUMBERS)


def _word(rng: random.Random, data: bytes) -> bytes:
    return _replaced(rng, data, rng.choice((_WORD, _NUMBER)), WORDS)


def _lines(rng: random.Random, data: bytes) -> bytes:
    """A block of lines left out, twice, or exchanged with another."""
    lines = data.splitlines(True)
    a, b = sorted(rng.randrange(len(lines) + 1) for _ in range(2))
    b = min(b, a + rng.choice((1, 2, 10)))
    rest, block = lines[:a] + lines[b:], lines[a:b]
    at = rng.randrange(len(rest) + 1)
    return b"".join(rng.choice((rest, lines[:b] + block + lines[b:], rest[:at] + block + rest[at:])))


def _bits(rng: random.Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 3, 20)) if data else 0):
        changed[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _cut(rng: random.Random, data: bytes) -> bytes:
    """A part left out: the end, or bytes in between."""
    a, b = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    return data[:a] + (b"" if rng.random() < 0.5 else data[b:])


def _piece(rng: random.Random, data: bytes) -> bytes:
    at = rng.choice((0, len(data), rng.randrange(len(data) + 1)))
    return data[:at] + rng.choice(PIECES) + data[at:]


def _whole(rng: random.Random, data: bytes) -> bytes:
    """Another form of all of it."""
    forms: list[Callable[[], bytes]] = [
        lambda: b"",
        lambda: b"\xef\xbb\xbf" + data,
        lambda: data.replace(b"\n", b"\r\n"),
        lambda: data.decode("latin-1").encode("utf-16"),
        lambda: b"[" * 100_000,
        lambda: b"a = " + b"[" * 5_000 + b"]" * 5_000,
        lambda: b'{"a":' * 100_000,
        lambda: rng.choice(NUMBERS + WORDS),
        lambda: rng.randbytes(200),
    ]
    return rng.choice(forms)()


TEXT = (_number, _number, _number, _word, _word, _lines, _lines, _bits, _cut, _piece, _whole)


def _inside(rng: random.Random, data: bytes) -> bytes:
    """A member of a zip archive, or what gzip has compressed, changed and compressed again."""
    if data[:2] == b"\x1f\x8b":
        return gzip.compress(rng.choice(TEXT)(rng, gzip.decompress(data)))
    if data[:2] != b"PK":
        return rng.choice((_bits, _cut, _piece))(rng, data)
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as new:
        names = list(dict.fromkeys(old.namelist()))
        chosen = rng.choice(names)
        for name in names:
            content, target = old.read(name), name
            if name == chosen:
                kind = rng.random()
                if kind < 0.1:
                    continue
                if kind < 0.2:
                    target = rng.choice(("../../out", "/out", "x", name * 2, "C:/out"))
                content = rng.choice(TEXT)(rng, content)
            new.writestr(target, content)
    return file.getvalue()


def changed(rng: random.Random, data: bytes) -> bytes:
    """A file with one to three changes."""
    text = b"\x00" not in data and data[:2] != b"\x1f\x8b"
    for _ in range(rng.choice((1, 1, 2, 3))):
        try:
            data = rng.choice(TEXT)(rng, data) if text else rng.choice((_inside, _inside, _bits, _cut))(rng, data)
        except (
            zipfile.BadZipFile,
            zlib.error,
            OSError,
            EOFError,
            ValueError,
            IndexError,
            RuntimeError,
            NotImplementedError,
        ):
            data = _bits(rng, data)  # an archive that an earlier change has damaged
    return data


# The cases -----------------------------------------------------------------------------------------------------------

_watched = SimpleNamespace(on=False, seen=[])


def _meant() -> bool:
    """Whether numba does it, which unpickles its cache, or what calls a reader in a process of its own."""
    frame = sys._getframe(2)
    while frame is not None and not frame.f_globals.get("__name__", "").startswith(
        ("numba.", "steer_env.recording.own_process")
    ):
        frame = frame.f_back  # type: ignore[assignment]
    return frame is not None


def _audit(event: str, args: tuple[Any, ...]) -> None:
    if _watched.on and event in FOREIGN and not _meant():
        _watched.seen.append(f"{event} {args[:1]}")


@contextmanager
def _within(seconds: float) -> Iterator[None]:
    """HangError after a time; a library in C that does not come back ends the process later."""

    def late(*_: Any) -> None:
        raise HangError(f"takes more than {seconds:g} s")

    before = signal.signal(signal.SIGALRM, late)
    faulthandler.dump_traceback_later(2 * seconds, exit=True)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGALRM, before)


def problem(read: Callable[[Path], Any], path: Path) -> str:
    """What is wrong with how a reader takes a file; empty where it reads it or refuses it as it should."""
    there = {each: each.stat().st_mtime_ns for each in path.parent.iterdir() if each.is_file()}
    _watched.seen.clear()
    begun = os.times()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        _watched.on = True
        try:
            with _within(HANGS):
                read(path)
        except (ValueError, OSError) as error:
            text = str(error)
            told = f"{text} {getattr(error, 'filename', '')}"
            if not any(each.name in told for each in (path, *path.parents[1].iterdir()) if each.is_file()):
                return f"is refused without the name of the file: {traceback.format_exc(limit=-4)}"
            if "\n" in text:
                return f"is refused in several lines: {text[:500]}"
        except (HangError, Exception):  # whatever a reader raises
            return traceback.format_exc(limit=-6)
        finally:
            _watched.on = False
    if (spent := sum(os.times()[:4]) - sum(begun[:4])) > LONGEST:
        return f"takes {spent:.0f} s of the processor"
    if _watched.seen:
        return f"runs foreign code: {', '.join(_watched.seen)}"
    for each in warned:
        if not issubclass(each.category, HIDDEN):
            return f"warns: {each.category.__name__}: {each.message} ({each.filename}:{each.lineno})"
    if left := [each.name for each in path.parent.iterdir() if each.is_file() and each not in there]:
        return f"leaves {', '.join(left)}"
    return ""


def run(cases: range, seed: int, keep: Path | None = None, only: str = "") -> list[str]:
    """Run the cases of a seed; a text for each one that fails."""
    sys.addaudithook(_audit)
    logging.disable()  # python-can, cantools and asammdf tell there what they leave out
    failures, counts = [], Counter[str]()
    with tempfile.TemporaryDirectory() as name:
        folder, case = Path(name), Path(name) / CASE
        case.mkdir()
        known = {name: reader for name, reader in readers(folder).items() if only in name}
        for reader in known.values():  # every seed is read, which also loads the libraries
            for seed_name, data in reader.seeds.items():
                path = case / seed_name
                path.write_bytes(data)
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)
                    reader.read(path)
        for number in cases:
            rng = random.Random(f"{seed}:{number}")
            name = rng.choice(list(known))
            reader = known[name]
            seed_name = rng.choice(list(reader.seeds))
            path = case / seed_name
            data = changed(rng, reader.seeds[seed_name])
            path.write_bytes(data)
            counts[name] += 1
            if found := problem(reader.read, path):
                failures.append(f"case {number} of seed {seed}, {name}, {seed_name}: {found}")
                print(failures[-1], flush=True)
                if keep is not None:
                    keep.mkdir(parents=True, exist_ok=True)
                    (keep / f"{seed}-{number}-{seed_name}").write_bytes(data)
    print(f"{len(failures)} of {counts.total()} cases fail; {dict(counts)}")
    return failures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, metavar="N", help="case with which they begin")
    parser.add_argument("--reader", default="", help="only readers whose name holds this text; the cases are others")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the files of the cases that fail")
    args = parser.parse_args()
    cases = range(args.first, args.first + args.cases)
    os.environ.setdefault("STEER_ENV_QUIET", "1")
    faulthandler.enable()  # a library in C may end the process
    return int(bool(run(cases, args.seed, args.keep, args.reader)))


if __name__ == "__main__":
    sys.exit(main())
