"""The command ``run``: drive a manoeuvre, or the whole battery, and write recordings and metrics."""

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from steer_env import friction, manoeuvres
from steer_env.experiments.cli.tables import print_metrics
from steer_env.experiments.output import provenance
from steer_env.experiments.output.files import write_json, write_text
from steer_env.experiments.output.metrics_json import entries
from steer_env.experiments.output.options import FRICTION, Friction, progress
from steer_env.friction.numerics.check import number
from steer_env.manoeuvres import Manoeuvre
from steer_env.metrics import Value, evaluate
from steer_env.recording import files
from steer_env.vehicle import cars, road, tyre
from steer_env.vehicle.steering.eps import SAMPLE_TIME

KPH = 1.0 / 3.6  # [m/s]
ALL = "all"
FASTEST = 1.0 / SAMPLE_TIME  # rate of a file [Hz]
SLOW = 100.0  # rate where the file would be large [Hz]
LONG = 60.0  # duration from which on it would be [s]


class Run(NamedTuple):
    """One manoeuvre, driven and written."""

    title: str
    values: dict[str, Value]
    path: Path | None  # None where it could not be driven
    failure: str = ""


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Drive a manoeuvre; write the recording as a file and its metrics as JSON, and print the metrics."
    run = commands.add_parser("run", help=text, description=text, parents=[common])
    names = *manoeuvres.available(), ALL
    run.add_argument("manoeuvre", metavar="MANOEUVRE", choices=names, help=", ".join(names))
    laws = ", ".join(friction.available())
    run.add_argument(
        "--friction", metavar="LAW", type=Friction, default="lugre", help=f"{FRICTION}; laws: {laws} (default lugre)"
    )
    packaged = ", ".join(cars.available())
    run.add_argument("--vehicle", default="compact", help=f"{packaged}, or a .toml or .json file (default compact)")
    run.add_argument("--tyre", metavar="FILE.tir", help="in place of the car's own; or the name of a packaged tyre")
    run.add_argument(
        "--road", metavar="CLASS", choices=tuple(road.ROUGHNESS), help="ISO 8608 road A to H, for two_track"
    )
    run.add_argument("--seed", metavar="N", type=int, help="of the road (default 0)")
    run.add_argument("--chassis", choices=tuple(cars.SPEEDS), help="default: what the manoeuvre needs")
    run.add_argument("--speed_kph", metavar="KPH", help="held speed [km/h] (default: the manoeuvre's)")
    text = (
        f"sampling rate of the file, low-passed before (default {FASTEST:g}; {SLOW:g} on two tracks and for more than "
        f"{LONG:g} s); metrics are of the full rate"
    )
    run.add_argument("--rate_hz", "--rate-hz", metavar="HZ", help=text)
    suffixes = ", ".join(files.FORMATS)
    text = f"a file ({suffixes}), or a directory for MANOEUVRE.csv, made if need be; the JSON goes beside (default .)"
    run.add_argument("--out", metavar="PATH", default=".", help=text)
    run.add_argument(
        "--compare",
        choices=("commonroad",),
        help="step-steer on two tracks: also our car with CommonRoad's parameters against their model, table and SVG",
    )
    run.set_defaults(function=_run)


def _run(args: argparse.Namespace) -> None:
    if args.compare:
        _check_comparable(args)
    out = Path(args.out)
    if args.manoeuvre == ALL:
        _run_all(args, out)
        return
    if out.suffix in files.FORMATS:
        if not out.parent.is_dir():
            raise ValueError(f"--out {out}: there is no directory {out.parent}")
    elif out.suffix:
        allowed = ", ".join(files.FORMATS)
        raise ValueError(f"--out must be a directory or end in one of {allowed}, got {str(out)!r}")
    else:
        out.mkdir(parents=True, exist_ok=True)
        out /= f"{args.manoeuvre}.csv"
    with progress("driving", total=None):
        done = drive(args, _manoeuvre(args, args.manoeuvre), out)
    print_metrics(done.values, done.title)
    print(out, out.with_suffix(".json"), sep="\n")
    if args.compare:
        _compare(args, out.parent)


def _run_all(args: argparse.Namespace, out: Path) -> None:
    """Every manoeuvre, side by side in processes; one that cannot be driven says why and the others go on."""
    from concurrent.futures import as_completed

    from steer_env.experiments.report.results import pool_of, uninterrupted  # brings the studies

    for name, value in (("--chassis", args.chassis), ("--speed_kph", args.speed_kph), ("--road", args.road)):
        if value is not None:
            raise ValueError(f"{name} does not suit every manoeuvre; leave it out of {ALL}")
    if out.suffix:
        raise ValueError(f"--out of {ALL} must be a directory, got {str(out)!r}")
    out.mkdir(parents=True, exist_ok=True)
    names = sorted(manoeuvres.available(), key=lambda name: -manoeuvres.make(name).duration)
    found: dict[str, Run] = {}
    args = argparse.Namespace(**{key: value for key, value in vars(args).items() if key != "function"})
    with progress("driving") as notify, pool_of() as pool:
        with uninterrupted():
            jobs = {pool.submit(_drive_by_name, args, name, out / f"{name}.csv"): name for name in names}
        for job in as_completed(jobs):
            found[jobs[job]] = job.result()
            notify(len(found) / len(names), "driving")
    for name in manoeuvres.available():
        if found[name].failure:
            print(f"\n{name} could not be driven: {found[name].failure}")
        else:
            print()
            print_metrics(found[name].values, found[name].title)
    print(f"\n{out}")


def _drive_by_name(args: argparse.Namespace, name: str, out: Path) -> Run:
    try:
        return drive(args, _manoeuvre(args, name), out)
    except ValueError as error:
        return Run(name, {}, None, str(error))


def _manoeuvre(args: argparse.Namespace, name: str) -> Manoeuvre:
    """A manoeuvre as the options have it."""
    manoeuvre = manoeuvres.make(name)
    if args.speed_kph is not None:
        if manoeuvre.speed == 0.0:
            raise ValueError(f"--speed_kph has no place in {manoeuvre.name}, which stands still; leave it out")
        if manoeuvre.rig:
            raise ValueError(f"--speed_kph has no effect on {manoeuvre.name}, which stands on a rig; leave it out")
        low, high = cars.SPEED_MIN / KPH, cars.SPEED_MAX / KPH
        speed = KPH * number("--speed_kph", args.speed_kph, minimum=low, maximum=high)
        # A gust or a course may depend on it.
        manoeuvre = manoeuvres.make(name, speed=speed) if "speed" in manoeuvres.options(name) else manoeuvre
        manoeuvre = replace(manoeuvre, speed=speed)
    if args.chassis not in (None, manoeuvre.chassis):
        if manoeuvre.chassis == "two_track":
            raise ValueError(f"--chassis {args.chassis} will not do; {manoeuvre.name} needs two_track")
        manoeuvre = replace(manoeuvre, chassis=args.chassis)
    if args.road is None and args.seed is not None:
        raise ValueError("--seed draws a road; give its class with --road")
    if args.road is not None:
        if manoeuvre.chassis != "two_track":
            raise ValueError("--road needs --chassis two_track")
        manoeuvre = replace(manoeuvre, road=road.iso8608(args.seed or 0, args.road))
    return manoeuvre


def drive(args: argparse.Namespace, manoeuvre: Manoeuvre, out: Path) -> Run:
    """Drive a manoeuvre with the options' law, car and tyre; write the recording, and its metrics beside it."""
    car = cars.load(args.vehicle)
    if args.tyre is not None:
        car = car._replace(tyre=tyre.load(args.tyre))
    large = manoeuvre.duration > LONG or manoeuvre.chassis == "two_track"
    wanted = (SLOW if large else FASTEST) if args.rate_hz is None else args.rate_hz
    rate = number("--rate_hz", wanted, minimum=20.0, maximum=FASTEST)
    recording = manoeuvres.drive(car, manoeuvre, args.friction.parameters)
    values = evaluate(recording)
    files.write(recording.filtered(0.4 * rate).resampled(rate) if rate < FASTEST else recording, out)
    write_json(
        out.with_suffix(".json"),
        {
            "metrics": entries(values),
            "meta": {key: value for key, value in recording.meta.items() if not _nan(value)},
            "friction": provenance.law(args.friction.parameters),
            "versions": provenance.versions(),
        },
    )
    about = manoeuvre.name, args.friction.label, f"{car.name} on {car.tyre.name}", manoeuvre.chassis
    return Run(", ".join(about), values, out)


def _nan(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)


def _check_comparable(args: argparse.Namespace) -> None:
    """ValueError unless there is a stored run of ``--compare`` for what is asked for."""
    from steer_env.experiments.studies import (
        commonroad_cross_validation,  # integrates with scipy, which no other command needs
    )

    car = commonroad_cross_validation.load().about["car"]
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
    from steer_env.experiments.drawing import figures
    from steer_env.experiments.studies import commonroad_cross_validation

    with progress("comparing", total=None):
        results = commonroad_cross_validation.collect(commonroad_cross_validation.STEPS)
    path = directory / f"{args.manoeuvre}-{args.compare}"
    write_text(path.with_suffix(".svg"), figures.cross_validation(results))
    write_json(path.with_suffix(".json"), commonroad_cross_validation.entries(results))
    print(f"\n{commonroad_cross_validation.table(results)}\n\n{path.with_suffix('.svg')}")
