"""Kill commands at random moments and resume them: the result is that of a run that nobody disturbed.

``python tests/tools/kills.py --kills 200 --seed 0`` takes one command after the other, each with a cache folder of its
own but for the kernels. It is started, killed after a random time, resumed and killed again, until it ends; where it
was killed before it kept anything, which it says, it is started anew. A tuning has one process, as several share out
its sets by chance. A command fails where it does not resume, its result differs, or processes are left 10 s after a
kill. Every other kill is of the command's process alone, which leaves its workers to themselves.
"""

import argparse
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
STEER_ENV = (sys.executable, "-c", "import sys; from steer_env.experiments.cli.main import main; sys.exit(main())")
WORKERS = ("--workers", "2")
POLICY = str(ROOT / "experiments" / "data" / "policies" / "DriverOnCentre-v3" / "policy.zip")
KERNELS = Path(tempfile.gettempdir()) / "steer-env-kills"  # compiled code, which the commands share
GONE = 10.0  # time in which the workers of a killed command end [s]
NOTHING = ("has no study that could be resumed", "holds no checkpoint to resume")
# In JSON: times, which differ in every run, and numbers in a database in which a killed set has one, too.
TIMES = {"computing_time", "created", "date", "seconds", "set", "timing", "trace", "times"}


class Command(NamedTuple):
    """A command that resumes."""

    words: tuple[str, ...]
    out: bool = True  # whether it takes --out; otherwise its result is what it prints


COMMANDS = {
    "run": Command((*STEER_ENV, "run", "all", "--friction", "masing", *WORKERS)),
    "sensitivity": Command(
        (*STEER_ENV, "sensitivity", "--parameters", "column.K_tb", "load", "--samples", "4", *WORKERS)
    ),
    "production": Command((*STEER_ENV, "sensitivity", "--method", "production", "--samples", "40", *WORKERS)),
    "study": Command((*STEER_ENV, "study", "loop-width", *WORKERS), out=False),
    "evaluate": Command((*STEER_ENV, "policy", "evaluate", POLICY, "--episodes", "4", *WORKERS)),
    "train": Command(
        (*STEER_ENV, "train", "--env", "steer_env/DriverOnCentre-v3", "--steps", "20000", "--episodes", "2")
    ),
    "audit": Command(
        (sys.executable, "-m", "tests.maintain", "audit", "--env", "steer_env/AssistWeave-v3", "--rounds", "2",
         "--steps", "0", *WORKERS),
        out=False,
    ),
    "tune": Command((*STEER_ENV, "tune", "--parameters", "damping_level", "--budget", "4", "--workers", "1")),
    "report": Command((*STEER_ENV, "report", "--friction", "masing", *WORKERS)),
}  # fmt: skip


class Killed(NamedTuple):
    """How a command fared that was killed."""

    kills: int
    problem: str


def result(folder: Path, printed: str) -> dict[str, str]:
    """Digests of what a command has computed: recordings, numbers and weights, by file."""
    found = {"": printed} if not folder.exists() else {}
    for path in sorted(folder.rglob("*.*")):
        if path.name == "learning.csv":  # has the time that each row took
            continue
        if path.suffix in (".csv", ".toml"):
            data = [path.read_bytes()]
        elif path.suffix == ".json":
            data = [json.dumps(_timeless(json.loads(path.read_text(encoding="utf-8")))).encode()]
        elif path.name == "policy.zip":
            with zipfile.ZipFile(path) as archive:
                data = [archive.read(name) for name in archive.namelist() if name == "policy.pth"]
        else:
            continue
        found[str(path.relative_to(folder))] = hashlib.sha256(b"".join(data)).hexdigest()
    return found


def _timeless(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _timeless(each) for key, each in value.items() if key not in TIMES}
    return [_timeless(each) for each in value] if isinstance(value, list) else value


def started(command: Command, folder: Path, resume: bool) -> "subprocess.Popen[str]":
    """The command in a group of its own, with the cache of a folder."""
    out = ("--out", str(folder / "out")) if command.out else ()
    return subprocess.Popen(
        [*command.words, *out, *(["--resume"] if resume else [])],
        cwd=ROOT,
        env={**os.environ, "XDG_CACHE_HOME": str(folder), "NUMBA_CACHE_DIR": str(KERNELS), "STEER_ENV_QUIET": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finished(process: "subprocess.Popen[str]", folder: Path) -> dict[str, str]:
    """The result of a command that has ended; RuntimeError where it has failed."""
    printed, told = process.communicate()
    if process.returncode:
        raise RuntimeError(f"exit code {process.returncode}: {told[-1000:]}")
    return result(folder / "out", printed)


def killed(process: "subprocess.Popen[str]", group: bool) -> None:
    """Kill a command, and see its workers end; RuntimeError where they do not."""
    with process:
        os.killpg(process.pid, signal.SIGKILL) if group else process.kill()
        process.communicate() if group else process.wait()
    until = time.monotonic() + GONE
    while members := _members(process.pid):
        if time.monotonic() > until:
            os.killpg(process.pid, signal.SIGKILL)
            raise RuntimeError(f"{len(members)} processes are left {GONE:g} s after a kill")
        time.sleep(0.1)


def _members(group: int) -> list[int]:
    """Living processes of a group."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, its_group = stat.read_text().rpartition(")")[2].split()[:3]
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(its_group) == group and state != "Z":
            found.append(int(stat.parent.name))
    return found


def disturbed(command: Command, kills: int, draw: random.Random) -> Killed:
    """Kill a command so many times, finish it as often as that takes, and compare each result."""
    done = 0
    with tempfile.TemporaryDirectory() as name:
        begin = time.monotonic()
        whole = finished(started(command, Path(name), False), Path(name))
        lasts = time.monotonic() - begin
    while done < kills:
        with tempfile.TemporaryDirectory() as name:
            resume = False
            while True:
                process = started(command, Path(name), resume)
                resume = True
                try:
                    if done < kills:
                        process.wait(draw.uniform(0.0, lasts))
                    found = finished(process, Path(name))
                except subprocess.TimeoutExpired:
                    done += 1
                    try:
                        killed(process, group=done % 2 == 0)
                    except RuntimeError as error:
                        return Killed(done, str(error))
                    continue
                except RuntimeError as error:
                    if not any(text in str(error) for text in NOTHING):
                        return Killed(done, str(error))
                    resume = False
                    continue
                if found != whole:
                    names = [each for each in {**whole, **found} if whole.get(each) != found.get(each)]
                    return Killed(done, f"the result differs: {', '.join(names) or 'what is printed'}")
                break
    return Killed(done, "")


def main() -> int:
    """The exit code is 1 where a command has failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200, help="of all commands together")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", nargs="+", choices=tuple(COMMANDS), default=list(COMMANDS))
    args = parser.parse_args()
    draw, failed = random.Random(args.seed), False
    for number, name in enumerate(args.commands):
        share = (args.kills + number) // len(args.commands)
        found = disturbed(COMMANDS[name], share, draw)
        failed |= bool(found.problem)
        print(f"{name}: {found.kills} kills, {found.problem or 'the results are equal'}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
