"""Command line ``steer-env``: a bad value ends in one line on stderr and exit code 2, never in a traceback."""

import argparse
import importlib
import json
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any, NoReturn

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

import friction
from experiments import evaluate_cli, provenance
from experiments.evaluation import entries
from experiments.files import write_json, write_text
from experiments.tables import print_metrics
from friction.check import number
from steer_env import manoeuvres, recording_files
from steer_env.metrics import evaluate
from vehicle import cars, road, tyre
from vehicle.assist import SAMPLE_TIME

KPH = 1.0 / 3.6  # [m/s]
DEFAULT_RATE = {"slow-ramp": 100.0, "parking": 100.0}  # of the file [Hz]; the others are written as simulated
FRICTION = "LAW[,key=value...], a list of numbers as a:b:c"


class Friction:
    """A friction law from the command line: its label and its parameters."""

    def __init__(self, text: str) -> None:
        self.label = text
        name, *pairs = text.split(",")
        given: dict[str, Any] = {}
        for pair in pairs:
            key, equals, value = pair.partition("=")
            if not equals or key in given:
                raise argparse.ArgumentTypeError(f"expected {FRICTION}, each key once, got {text!r}")
            given[key] = value.split(":") if ":" in value else value
        try:
            self.parameters = friction.make(name, **given)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None


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

    text = "Drive a manoeuvre; write the recording as CSV and its metrics as JSON, and print the metrics."
    run = commands.add_parser("run", help=text, description=text, parents=[_outside()])
    run.add_argument(
        "manoeuvre", metavar="MANOEUVRE", choices=manoeuvres.available(), help=", ".join(manoeuvres.available())
    )
    run.add_argument(
        "--friction", metavar="LAW", type=Friction, default="lugre", help=f"{FRICTION}; laws: {laws} (default lugre)"
    )
    names = ", ".join(cars.available())
    run.add_argument("--vehicle", default="compact", help=f"{names}, or a .toml or .json file (default compact)")
    run.add_argument("--tyre", metavar="FILE.tir", help="in place of the car's own; or the name of a packaged tyre")
    run.add_argument(
        "--road", metavar="CLASS", choices=tuple(road.ROUGHNESS), help="ISO 8608 road A to H, for two_track"
    )
    run.add_argument("--seed", metavar="N", type=int, help="of the road (default 0)")
    run.add_argument("--chassis", choices=tuple(cars.SPEEDS), help="default single_track; parking needs two_track")
    run.add_argument("--speed_kph", metavar="KPH", help="held speed [km/h] (default: the manoeuvre's)")
    run.add_argument(
        "--rate_hz",
        "--rate-hz",
        metavar="HZ",
        help="sampling rate of the CSV, low-passed before (default 1000; slow-ramp, parking 100); metrics: full rate",
    )
    text = "FILE.csv, or a directory for MANOEUVRE.csv, made if need be; the JSON goes beside it (default .)"
    run.add_argument("--out", metavar="PATH", default=".", help=text)
    run.add_argument(
        "--compare",
        choices=("commonroad",),
        help="step-steer on two tracks: also our car with CommonRoad's parameters against their model, table and SVG",
    )
    run.set_defaults(function=_run)

    evaluate_cli.add(commands, _outside())

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


@contextmanager
def _progress(what: str, total: float | None = 1.0) -> Iterator[Callable[[float, str], None]]:
    """A bar on stderr, if that is a terminal; yields what sets the part that is done and what comes next.

    Without a total it only shows that something goes on.
    """
    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(what, total=total)
        yield lambda part, text: progress.update(task, completed=part, description=text)


def _run(args: argparse.Namespace) -> None:
    if args.compare:
        _check_comparable(args)
    out = Path(args.out)
    if out.suffix == ".csv":
        if not out.parent.is_dir():
            raise ValueError(f"--out {out}: there is no directory {out.parent}")
    elif out.suffix:
        raise ValueError(f"--out must be a directory or end in .csv, got {str(out)!r}")
    else:
        out.mkdir(parents=True, exist_ok=True)
        out /= f"{args.manoeuvre}.csv"
    manoeuvre = manoeuvres.make(args.manoeuvre)
    if args.chassis not in (None, manoeuvre.chassis):
        if manoeuvre.chassis == "two_track":
            raise ValueError(f"--chassis {args.chassis} cannot stand still; {manoeuvre.name} needs two_track")
        manoeuvre = replace(manoeuvre, chassis=args.chassis)
    if args.road is None and args.seed is not None:
        raise ValueError("--seed draws a road; give its class with --road")
    if args.road is not None:
        if manoeuvre.chassis != "two_track":
            raise ValueError("--road needs --chassis two_track")
        manoeuvre = replace(manoeuvre, road=road.iso8608(args.seed or 0, args.road))
    car = cars.load(args.vehicle)
    if args.tyre is not None:
        car = car._replace(tyre=tyre.load(args.tyre))
    if args.speed_kph is not None:
        if manoeuvre.speed == 0.0:
            raise ValueError(f"--speed_kph has no place in {manoeuvre.name}, which stands still; leave it out")
        if manoeuvre.rig:
            raise ValueError(f"--speed_kph has no effect on {manoeuvre.name}, which stands on a rig; leave it out")
        low, high = cars.SPEED_MIN / KPH, cars.SPEED_MAX / KPH
        manoeuvre = replace(manoeuvre, speed=KPH * number("--speed_kph", args.speed_kph, minimum=low, maximum=high))
    fastest = 1.0 / SAMPLE_TIME
    wanted = DEFAULT_RATE.get(manoeuvre.name, fastest) if args.rate_hz is None else args.rate_hz
    rate = number("--rate_hz", wanted, minimum=20.0, maximum=fastest)
    with _progress("driving", total=None) as notify:
        recording = manoeuvres.drive(car, manoeuvre, args.friction.parameters)
        notify(0.0, "metrics")
        values = evaluate(recording)
        notify(0.0, f"writing {out}")
        recording_files.write(recording.filtered(0.4 * rate).resampled(rate) if rate < fastest else recording, out)
    write_json(
        out.with_suffix(".json"),
        {
            "metrics": entries(values),
            "meta": dict(recording.meta),
            "friction": provenance.law(args.friction.parameters),
            "versions": provenance.versions(),
        },
    )
    about = manoeuvre.name, args.friction.label, f"{car.name} on {car.tyre.name}", manoeuvre.chassis
    print_metrics(values, ", ".join(about))
    print(out)
    if args.compare:
        _compare(args, out.parent)


def _check_comparable(args: argparse.Namespace) -> None:
    """ValueError unless there is a stored run of ``--compare`` for what is asked for."""
    from experiments import cross_validation  # integrates with scipy, which no other command needs

    car = cross_validation.load().about["car"]
    allowed = {"MANOEUVRE": "step-steer", "--chassis": "two_track", "--vehicle": car}
    given = dict(zip(allowed, (args.manoeuvre, args.chassis or "single_track", args.vehicle)))
    for name, needed in allowed.items():
        if given[name] != needed:
            raise ValueError(f"--compare {args.compare} needs {name} {needed}, got {given[name]}")
    for name, value in (("--tyre", args.tyre), ("--speed_kph", args.speed_kph), ("--road", args.road)):
        if value is not None:
            raise ValueError(f"--compare {args.compare} has its own tyre, speeds and road; leave out {name}")


def _compare(args: argparse.Namespace, directory: Path) -> None:
    """Print the comparison in the step steers, and write it with its figure into a directory."""
    from experiments import cross_validation, figures

    with _progress("comparing", total=None):
        results = cross_validation.collect(cross_validation.STEPS)
    path = directory / f"{args.manoeuvre}-{args.compare}"
    write_text(path.with_suffix(".svg"), figures.cross_validation(results))
    write_json(path.with_suffix(".json"), cross_validation.entries(results))
    print(f"\n{cross_validation.table(results)}\n\n{path.with_suffix('.svg')}")


def _report(args: argparse.Namespace) -> None:
    from experiments import report  # draws with matplotlib, which the other commands need not wait for

    first = ("lugre", "masing")  # the two that the literature compares
    laws = args.friction or [
        Friction(name) for name in sorted(friction.available(), key=lambda name: name not in first)
    ]
    labels = [law.label for law in laws]
    for label in labels:
        if labels.count(label) > 1:
            raise ValueError(f"--friction names {label!r} twice")
    with _progress("compiling and driving") as notify:
        report.build(args.out, {law.label: law.parameters for law in laws}, notify=notify)
    print(Path(args.out) / "index.html")


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the exit code is 0, 2 for a bad value, 130 where it was interrupted."""
    _import(argv)
    args = _parser().parse_args(argv)
    if threading.current_thread() is threading.main_thread():
        # A polite end, as Ctrl-C is: workers stop and nothing half-written stays.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        args.function(args)
    except (ValueError, OSError) as error:
        print(f"steer-env {args.command}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"steer-env {args.command}: interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
