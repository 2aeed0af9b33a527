"""Drive a manoeuvre, or all of them, and write recordings and metrics."""

import argparse
import math
import warnings
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from steer_env.experiments.cli.common import inputs, names, options
from steer_env.experiments.cli.common.extras import require_format
from steer_env.experiments.cli.common.options import KPH
from steer_env.experiments.cli.common.sweeping import OPTIONS as SWEEP
from steer_env.experiments.cli.common.sweeping import add_sweep, refuse_sweep, runner, unswept
from steer_env.experiments.pages import car_options
from steer_env.experiments.pages.options import progress

if TYPE_CHECKING:
    from steer_env.experiments.pages.options import Friction
    from steer_env.manoeuvres import Manoeuvre
    from steer_env.metrics import Value
    from steer_env.vehicle.cars import Car

GROUP = "test"
ALL_MANOEUVRES = "all"
FASTEST = names.SAMPLE_RATE  # [Hz]
FILE_RATE = 200.0  # default rate of a file [Hz]
FILE_DIGITS = 7  # of the values in a file below the full rate [1]


class Run(NamedTuple):
    """One manoeuvre, driven and written."""

    title: str
    values: "dict[str, Value]"
    path: Path | None  # None where it could not be driven, or was driven by a worker
    failure: str = ""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    known = *names.manoeuvres(), ALL_MANOEUVRES
    parser.add_argument("manoeuvre", metavar="MANOEUVRE", choices=known, help=", ".join(known))
    options.add(parser, "--friction", f"; laws: {', '.join(names.laws())}", otherwise=options.OF_CAR)
    car_options.add(parser)
    text = "class of an ISO 8608 road, A to H, for two_track"
    parser.add_argument("--road", metavar="CLASS", choices=names.ROAD_CLASSES, help=text)
    options.add(parser, "--seed", "of the road", otherwise="0")
    kinds = f": {', '.join(names.chassis())}, or {options.EXTERNAL}"
    options.add(parser, "--chassis", kinds, otherwise="the manoeuvre's", type=options.chassis)
    options.add(parser, "--speed-kph", "that is held", otherwise="the manoeuvre's")
    text = (
        f"of the file, low-passed before and with {FILE_DIGITS} significant digits; at {FASTEST:g} every sample is "
        "written with all digits; the metrics are of the full rate"
    )
    options.add(parser, "--rate-hz", text, FILE_RATE)
    text = (
        f"a file ({', '.join(names.FORMATS)}), or a directory for MANOEUVRE.csv, which is made if it is missing; the "
        "JSON file goes beside it (default: the working directory)"
    )
    parser.add_argument("--out", metavar="PATH", default=".", help=text)
    options.add_csv(parser)
    add_sweep(parser, f"of {ALL_MANOEUVRES}")


def run(args: argparse.Namespace) -> None:
    """Drive, write and print."""
    from steer_env.experiments.cli.common.tables import print_metrics

    out = Path(args.out)
    require_format([out])
    args.inputs = inputs.trace_inputs(args)
    if args.manoeuvre == ALL_MANOEUVRES:
        _run_all(args, out)
        return
    refuse_sweep(args, f"one manoeuvre is one case: use it with {ALL_MANOEUVRES}")
    if out.suffix in names.FORMATS:
        if not out.parent.is_dir():
            raise ValueError(f"--out {out}: there is no directory {out.parent}")
    elif out.suffix:
        allowed = ", ".join(names.FORMATS)
        raise ValueError(f"--out must be a directory or end in one of {allowed}, got {str(out)!r}")
    else:
        out.mkdir(parents=True, exist_ok=True)
        out /= f"{args.manoeuvre}.csv"
    with progress("driving", total=None):
        done = drive(args, _manoeuvre(args, args.manoeuvre), out)
    print_metrics(done.values, done.title)
    print(out, out.with_suffix(".json"), sep="\n")


def _run_all(args: argparse.Namespace, out: Path) -> None:
    """Drive every manoeuvre, side by side; one that cannot be driven says why, and the others go on."""
    from steer_env import manoeuvres
    from steer_env.experiments.cli.common.tables import print_metrics
    from steer_env.experiments.pages.files import write_bytes

    own = args.chassis if args.chassis in names.chassis() else None
    for name, value in (("--chassis", own), ("--speed-kph", args.speed_kph), ("--road", args.road)):
        if value is not None:
            raise ValueError(f"{name} does not suit every manoeuvre: leave it out with {ALL_MANOEUVRES}")
    if out.suffix:
        raise ValueError(f"--out of {ALL_MANOEUVRES} must be a directory, got {str(out)!r}")
    out.mkdir(parents=True, exist_ok=True)
    sweep = runner(args)
    options = {key: value for key, value in vars(args).items() if key not in ("function", "out", *SWEEP)}
    # The case is the car itself, not the file of it: other workers lack the file, and it may change before --resume.
    options |= {"vehicle": car_options.load(args).data(), "steering": None, "tyre": None, "changes": []}
    options["argv"] = unswept(args, "--out")  # a result does not depend on where it lies
    longest_first = sorted(manoeuvres.available(), key=lambda name: -manoeuvres.make(name).duration)
    with progress("driving") as notify:
        drives = sweep(
            drive_manoeuvre, [(name, options) for name in longest_first], notify=notify, words=lambda case: case[0]
        )
    found = {name: run for name, (run, _) in zip(longest_first, drives)}
    for file, contents in (item for _, files in drives for item in files.items()):
        write_bytes(out / file, contents)
    for name in manoeuvres.available():
        if found[name].failure:
            print(f"\n{name} could not be driven: {found[name].failure}")
        else:
            print()
            print_metrics(found[name].values, found[name].title)
    print(f"\n{out}")


def drive_manoeuvre(case: tuple[str, dict[str, Any]]) -> tuple[Run, dict[str, bytes]]:
    """Drive a manoeuvre with options of the command; the run, and the files of it by name.

    The files come back by their contents, as the worker that drives may be another machine.
    """
    from steer_env.vehicle.cars import UnusualCar

    name, options = case
    args = argparse.Namespace(**options)
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UnusualCar)  # told when the command read the car
        try:
            run = drive(args, _manoeuvre(args, name), Path(folder) / f"{name}.csv")
        except ValueError as error:
            return Run(name, {}, None, str(error)), {}
        return run._replace(path=None), {file.name: file.read_bytes() for file in Path(folder).iterdir()}


def _manoeuvre(args: argparse.Namespace, name: str) -> "Manoeuvre":
    """A manoeuvre with the speed, chassis and road of the options."""
    from steer_env import manoeuvres
    from steer_env.friction.numerics.check import number
    from steer_env.vehicle import cars, road

    manoeuvre = manoeuvres.make(name)
    if args.speed_kph is not None:
        if manoeuvre.speed == 0.0:
            raise ValueError(f"--speed-kph has no effect on {manoeuvre.name}, in which the car stands: leave it out")
        if manoeuvre.rig:
            raise ValueError(f"--speed-kph has no effect on {manoeuvre.name}, which is done on a rig: leave it out")
        low, high = cars.SPEED_MIN / KPH, cars.SPEED_MAX / KPH
        speed = KPH * number("--speed-kph", args.speed_kph, minimum=low, maximum=high)
        # The course or the gust of some manoeuvres depends on the speed.
        manoeuvre = manoeuvres.make(name, speed=speed) if "speed" in manoeuvres.options(name) else manoeuvre
        manoeuvre = replace(manoeuvre, speed=speed)
    if args.chassis in names.chassis() and args.chassis != manoeuvre.chassis:
        if manoeuvre.chassis == "two_track":
            raise ValueError(f"--chassis {args.chassis} cannot drive {manoeuvre.name}, which needs two_track")
        manoeuvre = replace(manoeuvre, chassis=args.chassis)
    if args.road is None and args.seed is not None:
        raise ValueError("--seed is of a random road: give its class with --road")
    if args.road is not None:
        if _chassis(args, manoeuvre) != "two_track":
            raise ValueError("--road needs --chassis two_track")
        manoeuvre = replace(manoeuvre, road=road.iso8608(args.seed or 0, args.road))
    return manoeuvre


def _chassis(args: argparse.Namespace, manoeuvre: "Manoeuvre") -> str:
    """The chassis that drives a manoeuvre: the name of one, or the file of an external vehicle."""
    return args.chassis or manoeuvre.chassis


def drive(args: argparse.Namespace, manoeuvre: "Manoeuvre", out: Path) -> Run:
    """Drive a manoeuvre with the law, car and tyre of the options; write the recording, and its metrics beside it."""
    from steer_env import manoeuvres
    from steer_env.connect import external
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages.files import write_json
    from steer_env.experiments.pages.metrics_json import entries
    from steer_env.friction.numerics.check import number
    from steer_env.metrics import evaluate, tests
    from steer_env.recording import files

    car = car_options.load(args)
    rate = number("--rate-hz", args.rate_hz, minimum=20.0, maximum=FASTEST)
    law = options.friction(args, car)
    trace = _trace(args, manoeuvre.name, car, law, out)
    if args.chassis in (None, *names.chassis()):
        recording = manoeuvres.drive(car, manoeuvre, law.parameters)
    else:
        with external.opened(args.chassis, manoeuvre.speed) as simulator:
            recording = manoeuvres.drive(car, manoeuvre, law.parameters, simulator)
    recording = replace(recording, meta={**recording.meta, "trace": trace})
    values = evaluate(recording) if manoeuvre.name in tests() else {}  # a manoeuvre may have no metrics
    if rate < FASTEST:
        files.write(recording.filtered(0.4 * rate).resampled(rate), out, digits=FILE_DIGITS, decimal=args.csv_decimal)
    else:
        files.write(recording, out, decimal=args.csv_decimal)
    write_json(
        out.with_suffix(".json"),
        {
            "metrics": entries(values),
            "meta": {key: value for key, value in recording.meta.items() if key != "trace" and not _nan(value)},
            "friction": provenance.law(law.parameters),
            "versions": provenance.versions(),
            "trace": trace,
        },
    )
    about = manoeuvre.name, law.label, f"{car.name} on {car.tyre.name}", _chassis(args, manoeuvre)
    return Run(", ".join(about), values, out)


def _trace(args: argparse.Namespace, manoeuvre: str, car: "Car", law: "Friction", out: Path) -> dict[str, Any]:
    """What one recording is made from; of several manoeuvres that one command drives, its own."""
    from steer_env.experiments.pages import provenance

    command = [manoeuvre if word == ALL_MANOEUVRES else word for word in args.argv]
    laws = {law.label: law.parameters}
    return provenance.trace(
        command=command, result=out.name, car=car, friction=laws, inputs=args.inputs, seed=args.seed
    )


def _nan(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)
