"""The command line ``steer-env``.

Each command is one file in this folder, found by its name: its docstring is its help, the first sentence in the list of
all commands; ``GROUP`` is the kind of work that it is listed under; ``add(parser)`` adds its options, and ``run(args)``
does the work. A folder is a word with commands of its own, ``steer-env policy evaluate``. The modules of the commands
import what is slow to import inside the functions that run, so that ``--help`` answers at once. A bad value ends in one
line on standard error and exit code 2, never in a traceback; a warning is one line there, too.
"""

import argparse
import importlib
import inspect
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from steer_env.experiments.cli.common.messages import in_options, shorten
from steer_env.experiments.cli.common.options import figures
from steer_env.experiments.cli.common.sweeping import forget, unswept
from steer_env.friction.numerics.registry import modules_by_name, with_dashes

# Kind of work -> its heading in the list of commands, in this order.
GROUPS = {
    "car": "Analyse a car",
    "test": "Tests and metrics",
    "friction": "Friction",
    "learn": "Learn",
    "couple": "Couple with other programs",
    "drive": "Drive",
}
PACKAGE, PROGRAM = "steer_env.experiments.cli", "steer-env"
# Commands that last longer than ten seconds and begin anew where they were killed, and why.
BRIEF = ("analyse", "bench", "car", "explore", "export-fmu", "fit-friction", "fit-steering", "real-time", "validate")
UNKEPT = "There is no --resume: it usually ends within five minutes, and writes all or nothing."
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


def imported_modules(argv: Sequence[str]) -> list[str]:
    """The modules that ``--import`` names."""
    return without_imports(argv)[0]


def without_imports(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """The modules that ``--import`` names, and the words without it."""
    found, others = _common().parse_known_args(words)
    return found.modules, others


def import_modules(argv: Sequence[str]) -> None:
    """Import the modules that ``--import`` names, before ``--friction`` is read.

    A worker process imports them before it works on a case.
    """
    parser = _common()
    for module in imported_modules(argv):
        if module.endswith(".py"):
            name = Path(module).stem
            parser.error(f"--import {module}: give the name of the module, --import {name}, where {name}.py lies")
        sys.path.insert(0, str(Path.cwd()))
        try:
            importlib.import_module(module)
        except (Exception, SystemExit) as error:  # whatever the module does
            told = " ".join(str(error).split()) or "no more is known"
            kind = "" if isinstance(error, (ImportError, SyntaxError, ValueError)) else f"{type(error).__name__}: "
            parser.error(f"--import {module}: {kind}{told}")


def commands(package: str = PACKAGE) -> dict[str, ModuleType]:
    """The commands of a folder by name, each the module of its file, or the package that holds further words."""
    found = modules_by_name(package, with_dashes)
    return {name: importlib.import_module(module) for name, module in found.items() if name.strip("-") != "main"}


def parser(package: str = PACKAGE, prog: str = PROGRAM) -> argparse.ArgumentParser:
    """The parser of a whole command line: of the program, or of the commands of another folder."""
    there = commands(package)
    made = _Parser(
        prog=prog,
        usage=f"{prog} COMMAND [OPTION ...]",
        description=f"Simulate and report steering feel. '{prog} COMMAND --help' tells the options of a command,\n"
        f"'{prog} --version' the version.",
        epilog=_command_list(there),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        add_help=False,
    )
    # Both are told in a sentence, so that the list of commands fits a screen.
    made.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)
    made.add_argument("--version", action=_Version, nargs=0, help=argparse.SUPPRESS)
    _add_commands(made, there, help=argparse.SUPPRESS)
    return made


def _command_list(there: Mapping[str, ModuleType]) -> str:
    """The list of commands, each below the heading of its kind of work."""
    lines = []
    for group in dict.fromkeys([*GROUPS, *(command.GROUP for command in there.values())]):
        of_group = [(name, command) for name, command in there.items() if group == command.GROUP]
        if of_group:
            lines.append(f"\n{GROUPS.get(group, group)}")
        lines += [f"  {name:14s} {_paragraphs(command)[0].rstrip('.')}" for name, command in of_group]
    return "\n".join(lines)


def _paragraphs(command: ModuleType) -> list[str]:
    """What the docstring of a command says: the line of the lists, then what its own help says beside it."""
    return (inspect.getdoc(command) or "").split("\n\n")


def _add_commands(to: argparse.ArgumentParser, there: Mapping[str, ModuleType], **more: Any) -> None:
    """Add commands, and those of folders, to a parser."""
    words = to.add_subparsers(dest="command", metavar="COMMAND", required=True, prog=to.prog, **more)
    for name, command in there.items():
        told, *further = _paragraphs(command)
        if hasattr(command, "__path__"):
            folder = words.add_parser(name, help=told, description=told)
            _add_commands(folder, commands(command.__name__))
            continue
        made = words.add_parser(name, help=told, description=" ".join([told, *further]), parents=[_common()])
        command.add(made)
        made.epilog = UNKEPT if name in BRIEF else None
        made.set_defaults(function=command.run, prog=made.prog)


def parsed(argv: Sequence[str], package: str = PACKAGE, prog: str = PROGRAM) -> argparse.Namespace:
    """The options of a command line, with the words themselves as ``argv``; SystemExit for what a parser refuses."""
    args = parser(package, prog).parse_args(argv, argparse.Namespace(argv=list(argv)))
    args.argv = unswept(args)  # results do not depend on where they were computed
    return args


@contextmanager
def _warnings_in_one_line(program: str) -> Iterator[None]:
    """Show a warning that is meant for users as one line on standard error, without the place in the code."""
    with warnings.catch_warnings():
        show = warnings.showwarning

        def one_line(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
            if issubclass(category, UserWarning):
                print(f"{program}: warning: {message}", file=sys.stderr)
            else:
                show(message, category, *place, **more)

        warnings.showwarning = one_line
        yield


def _run(argv: Sequence[str], package: str, prog: str) -> int:
    """Run a command; its exit code."""
    import_modules(argv)
    with _warnings_in_one_line(f"{prog} {argv[0] if argv else ''}"):
        args = parsed(argv, package, prog)
    if threading.current_thread() is threading.main_thread():
        # SIGTERM is handled as Ctrl-C is: the workers stop and no file stays half-written.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    done = False
    try:
        from steer_env.friction.numerics.thread_pool import one_blas_thread

        with _warnings_in_one_line(args.prog), one_blas_thread(), figures(args):
            code = args.function(args) or 0
        done = True
        return code
    except BrokenPipeError:
        raise
    except (ValueError, OSError) as error:
        message = f"{error.filename}: {error.strerror}" if isinstance(error, OSError) and error.filename else str(error)
        print(f"{args.prog}: {shorten(in_options(message))}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{args.prog}: interrupted", file=sys.stderr)
        return 130
    finally:
        forget(args, done)


def main(argv: Sequence[str] | None = None, package: str = PACKAGE, prog: str = PROGRAM) -> int:
    """Run a command of the program, or of the folder of commands ``package``, which is started as ``prog``.

    Returns
    -------
    int
        Exit code: 0; 1 where a recording gives no metric or a requirement is missed; 2 for a bad value; 130 when
        interrupted; 141 when the reader of standard output has gone, as in ``steer-env ... | head``.
    """
    try:
        try:
            return _run(sys.argv[1:] if argv is None else argv, package, prog)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes standard output once more when it exits, which would fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED


if __name__ == "__main__":
    sys.exit(main())
