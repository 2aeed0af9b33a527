"""Command line ``steer-env``: a bad value ends in one line on stderr and exit code 2, never in a traceback."""

import argparse
import importlib
import json
import signal
import sys
import threading
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import NoReturn

from steer_env import friction
from steer_env.experiments.cli import evaluate, run, train
from steer_env.experiments.output.options import FRICTION, Friction, progress
from steer_env.vehicle import cars


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (try --help)\n")


def _outside() -> _Parser:
    """The option that makes friction laws from elsewhere known, which comes before all others."""
    parser = _Parser(prog="steer-env", add_help=False, allow_abbrev=False)
    text = "Python module that registers friction laws, from the working directory or installed; may be repeated"
    parser.add_argument("--import", dest="modules", metavar="MODULE", action="append", default=[], help=text)
    return parser


def _import(argv: Sequence[str] | None) -> None:
    """Import what ``--import`` names, so that ``--friction`` knows its laws; worker processes do by their classes."""
    parser = _outside()
    for module in parser.parse_known_args(argv)[0].modules:
        sys.path.insert(0, str(Path.cwd()))
        try:
            importlib.import_module(module)
        except Exception as error:  # whatever the module does
            parser.error(f"--import {module}: {error}")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="steer-env", description="Steering feel with a selectable friction law.", parents=[_outside()]
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {metadata.version('steer-env')}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    laws = ", ".join(friction.available())

    run.add(commands, _outside())
    evaluate.add(commands, _outside())
    train.add(commands, _outside())

    text = "Print a packaged car with every key that a car file may set, in SI, as JSON."
    car = commands.add_parser("car", help=text, description=text)
    car.add_argument("name", metavar="NAME", choices=cars.available(), help=", ".join(cars.available()))
    car.set_defaults(function=lambda args: print(json.dumps(cars.every_key(args.name), indent=2)))

    text = "Drive the battery with every law, run the studies, and write index.html and metrics.json."
    report = commands.add_parser("report", help=text, description=text, parents=[_outside()])
    report.add_argument(
        "--friction", metavar="LAW", type=Friction, nargs="+", help=f"{FRICTION}; default: all laws ({laws})"
    )
    report.add_argument("--out", metavar="DIR", default="report", help="replaced as a whole (default report)")
    report.set_defaults(function=_report)
    return parser


def _report(args: argparse.Namespace) -> None:
    from steer_env.experiments.report import build  # draws with matplotlib, which the other commands need not wait for

    first = ("lugre", "masing")  # the two that the literature compares
    laws = args.friction or [
        Friction(name) for name in sorted(friction.available(), key=lambda name: name not in first)
    ]
    labels = [law.label for law in laws]
    for label in labels:
        if labels.count(label) > 1:
            raise ValueError(f"--friction names {label!r} twice")
    with progress("compiling and driving") as notify:
        build.build(args.out, {law.label: law.parameters for law in laws}, notify=notify)
    print(Path(args.out) / "index.html")


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the exit code is 0, 1 where a recording gives no metric, 2 for a bad value, 130 interrupted."""
    _import(argv)
    args = _parser().parse_args(argv)
    if threading.current_thread() is threading.main_thread():
        # A polite end, as Ctrl-C is: workers stop and nothing half-written stays.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return args.function(args) or 0
    except (ValueError, OSError) as error:
        message = f"{error.filename}: {error.strerror}" if isinstance(error, OSError) and error.filename else error
        print(f"steer-env {args.command}: {message}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"steer-env {args.command}: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
