"""The options of commands that sweep over many cases: ``--workers``, ``--cluster`` and ``--resume``."""

import argparse
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.options import whole_number

if TYPE_CHECKING:
    from steer_env.experiments.sweep import Runner

OPTIONS = ("workers", "cluster", "resume")
FOLDER = "sweeps"  # in the user's cache folder
UNUSED = 30 * 24 * 3600.0  # time after which what an interrupted sweep has left is deleted [s]


def add_sweep(parser: argparse.ArgumentParser, cases: str = "") -> None:
    """Add the options to a parser; ``cases`` says what they are for where that is not the whole command."""
    group = parser.add_argument_group("workers (docs/many_machines.md)")
    of = f" {cases}" if cases else ""
    text = f"worker processes{of} on this machine (default: one for each processor, up to 4)"
    group.add_argument("--workers", metavar="N", type=whole_number(1), help=text)
    text = "Dask workers in their place: those of a scheduler, tcp://HOST:PORT, or new ones here, local or local:N"
    group.add_argument("--cluster", metavar="ADDRESS", help=text)
    text = "go on from where the same command was interrupted, whatever the workers were"
    group.add_argument("--resume", action="store_true", help=text)


def unswept(args: argparse.Namespace, *others: str) -> list[str]:
    """The words of a command line that its result depends on.

    These are all but those that say where its cases run and where its pictures go, and ``others`` with their values.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    if hasattr(args, "cluster"):
        add_sweep(parser)
    if hasattr(args, "figures"):
        options.add_figures(parser)
    for name in others:
        parser.add_argument(name)
    return parser.parse_known_args(args.argv)[1]


def refuse_sweep(args: argparse.Namespace, reason: str) -> None:
    """ValueError if one of the options is given where it has no effect."""
    for name in OPTIONS:
        if getattr(args, name):
            raise ValueError(f"--{name} has no effect here, as {reason}")


def runner(args: argparse.Namespace) -> "Runner":
    """What runs the cases of a command, as its options ask; finished ones are kept until :func:`forget`.

    Raises
    ------
    ValueError
        For options that contradict each other, or without the extra that a cluster needs.
    """
    if args.cluster is not None:
        require("cluster", f"--cluster {args.cluster}")

    from steer_env.experiments import sweep
    from steer_env.experiments.sweep.sweep import case_key
    from steer_env.experiments.sweep.work import identity, importable_name

    where = sweep.Where.parse(args.workers, args.cluster)

    def run(function: Callable[[Any], Any], cases: Iterable[Any], **options: Any) -> list[Any]:
        cases, options = list(cases), {**options, "where": where, "modules": args.modules}
        place = _folder() / case_key(importable_name(function), cases, {})
        try:
            store = sweep.Store(place, identity([function.__module__, *args.modules]), args.resume)
        except OSError as error:
            if args.resume:
                raise
            print(f"steer-env: nothing is kept for --resume: {error}", file=sys.stderr)
            return sweep.run(function, cases, **options)
        _prune(place)
        args.stores.append((store, len(cases)))
        return sweep.run(function, cases, store=store, **options)

    args.stores = []
    return run


def forget(args: argparse.Namespace, done: bool) -> None:
    """A command has ended: its finished cases go where it is done, else they stay, which is told."""
    for store, cases in getattr(args, "stores", ()):
        if not done and (finished := store.count()):
            text = f"{finished} of {cases} cases are finished and kept"
            print(f"steer-env: {text}: the same command with --resume goes on from there", file=sys.stderr)
        else:
            store.remove()


def _folder() -> Path:
    import platformdirs

    return Path(platformdirs.user_cache_dir("steer_env")) / FOLDER


def _prune(place: Path) -> None:
    """Delete what sweeps have left long ago."""
    from steer_env.experiments.sweep.store import ABOUT_FILE

    for folder in place.parent.iterdir():
        if folder != place and (folder / ABOUT_FILE).is_file() and time.time() - folder.stat().st_mtime > UNUSED:
            for file in folder.iterdir():
                file.unlink(missing_ok=True)
            folder.rmdir()
