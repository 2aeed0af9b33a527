"""The command line ``steer-env``.

Each command is one file in this folder with ``add(commands, common)``, found by its name. The modules of the commands
import what is slow to import inside the functions that run, so that ``--help`` answers at once. A bad value ends in one
line on standard error and exit code 2, never in a traceback; a warning is one line there, too.
"""

import argparse
import importlib
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any, NoReturn

from steer_env.experiments.cli.common.messages import in_options
from steer_env.experiments.cli.common.sweeping import unswept
from steer_env.friction.numerics.registry import dashed, listed
from steer_env.friction.numerics.renamed import REMOVED_IN

# Former names of options, with an underscore before the unit -> present ones.
RENAMED = {
    "--speed_kph": "--speed-kph",
    "--frequency_hz": "--frequency-hz",
    "--timing_ms": "--timing-ms",
    "--rate_hz": "--rate-hz",
}
PIPE_CLOSED = 141  # exit code of a program that SIGPIPE ends, 128 + 13


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (try --help)\n")


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        print(f"steer-env {metadata.version('steer-env')}")
        parser.exit()


def _common() -> _Parser:
    """The option that every command has: modules with friction laws of the user's own."""
    parser = _Parser(prog="steer-env", add_help=False, allow_abbrev=False)
    text = "Python module that registers friction laws, from the working directory or installed; may be repeated"
    parser.add_argument("--import", dest="modules", metavar="MODULE", action="append", default=[], help=text)
    return parser


def modules_of(argv: Sequence[str]) -> list[str]:
    """The modules that ``--import`` names."""
    return _common().parse_known_args(argv)[0].modules


def import_modules(argv: Sequence[str]) -> None:
    """Import the modules that ``--import`` names, before ``--friction`` is read.

    A worker process imports them before it works on a case.
    """
    parser = _common()
    for module in modules_of(argv):
        sys.path.insert(0, str(Path.cwd()))
        try:
            importlib.import_module(module)
        except Exception as error:  # whatever the module does
            parser.error(f"--import {module}: {error}")


def _parser() -> argparse.ArgumentParser:
    text = "Simulate, evaluate and report steering feel with a selectable friction law."
    parser = _Parser(prog="steer-env", description=text, parents=[_common()])
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in listed(__package__ or "steer_env.experiments.cli", dashed).items():
        if name != "main":
            importlib.import_module(module).add(commands, _common())
    return parser


def parsed(argv: Sequence[str]) -> argparse.Namespace:
    """The options of a command line, with the words themselves as ``argv``; SystemExit for what a parser refuses."""
    args = _parser().parse_args(argv, argparse.Namespace(argv=list(argv)))
    args.argv = unswept(args)  # results do not depend on where they were computed
    return args


def _renamed(text: str) -> str:
    """An argument by its present name; of a former one, a line on standard error tells it."""
    name, equals, value = text.partition("=")
    if name not in RENAMED:
        return text
    new = RENAMED[name]
    print(f"steer-env: {name} is now {new}; release {REMOVED_IN} removes the old name", file=sys.stderr)
    return new + equals + value


@contextmanager
def _warnings_in_one_line(command: str) -> Iterator[None]:
    """Show a warning that is meant for users as one line on standard error, without the place in the code."""
    with warnings.catch_warnings():
        show = warnings.showwarning

        def one_line(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
            if issubclass(category, UserWarning):
                print(f"steer-env {command}: warning: {message}", file=sys.stderr)
            else:
                show(message, category, *place, **more)

        warnings.showwarning = one_line
        yield


def _run(argv: Sequence[str]) -> int:
    """Run a command; its exit code."""
    argv = [_renamed(text) for text in argv]
    import_modules(argv)
    with _warnings_in_one_line(argv[0] if argv else ""):
        args = parsed(argv)
    if threading.current_thread() is threading.main_thread():
        # SIGTERM is handled as Ctrl-C is: the workers stop and no file stays half-written.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        from steer_env.friction.numerics.thread_pool import one_blas_thread

        with _warnings_in_one_line(args.command), one_blas_thread():
            return args.function(args) or 0
    except BrokenPipeError:
        raise
    except (ValueError, OSError) as error:
        message = f"{error.filename}: {error.strerror}" if isinstance(error, OSError) and error.filename else str(error)
        print(f"steer-env {args.command}: {in_options(message)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"steer-env {args.command}: interrupted", file=sys.stderr)
        return 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Returns
    -------
    int
        Exit code: 0; 1 where a recording gives no metric or a requirement is missed; 2 for a bad value; 130 when
        interrupted; 141 when the reader of standard output has gone, as in ``steer-env ... | head``.
    """
    try:
        try:
            return _run(sys.argv[1:] if argv is None else argv)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes standard output once more when it exits, which would fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED


if __name__ == "__main__":
    sys.exit(main())
