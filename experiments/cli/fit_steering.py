"""Identify hand torque and friction from a free drive, judged on what was not fitted.

The drive holds handwheel angle, torque of the torsion bar and speed. Every friction law is fitted in turn. Writes a
page and a car that was fitted to the drive, with its friction: above the torsion bar and below it where the torque of
the hands was recorded beside that of motor or torsion bar (docs/road_drive.md).
"""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import inputs, names, options
from steer_env.experiments.cli.common.extras import require_format
from steer_env.experiments.cli.common.recordings import add_reading, check_can, mapping_of, packaged, read
from steer_env.experiments.pages import car_options

GROUP = "friction"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    packaged = ", ".join(names.road_drives())
    text = f"the drive: {packaged} (packaged), or a file: .csv.gz, {names.RECORDED}"
    parser.add_argument("drive", metavar="DRIVE", help=text)
    text = (
        f"laws to fit: all dry ones (default), or some of {', '.join(law for law in names.laws() if law != 'viscous')}"
    )
    parser.add_argument("--law", metavar="LAW", nargs="+", action="extend", help=text)
    options.add_page(
        parser, "for index.html, fit.json, car.toml, friction.json, replaced as a whole", otherwise="steering_NAME"
    )
    options.add_live(parser, "the fitted car with its law")
    text = "share of the record, its last part, that judges and is not fitted (default: 0.35)"
    parser.add_argument("--held-out", metavar="SHARE", type=options.real, default=0.35, help=text)
    options.add(parser, "--seed", "of the draws of the intervals", 0)
    add_reading(parser.add_argument_group("reading"))
    car_options.add(parser)


def run(args: argparse.Namespace) -> None:
    """Identify, judge and write."""
    path, name = _place(args.drive, args)
    require_format([path])
    check_can([path], args)
    if len(args.mapping) > 1:
        raise ValueError(f"{len(args.mapping)} mappings are given for one drive")

    from steer_env.experiments.calibration.column_fit import ColumnFit, fit_column
    from steer_env.experiments.cli.common.tables import print_steering
    from steer_env.experiments.pages import files, provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.reports import steering_fit
    from steer_env.friction.sites import named
    from steer_env.hand_torque import identify, prepared

    out = Path(args.out or f"steering_{name}")
    live = options.live(args)
    files.usable(out, steering_fit.contents())
    car = car_options.load(args)
    drive = prepared(read(path, 0, args))
    for note in drive.notes:
        print(f"{args.drive}: {note}")
    with progress("fitting") as notify:
        found = identify(drive, laws=args.law, held_out=args.held_out, seed=args.seed, notify=notify)
    print_steering(found, name)
    of_car: ColumnFit | str
    try:
        with progress("fitting the car") as notify:
            of_car = fit_column(found, car, args.seed, notify)
        print(f"the car, fitted with boost and friction, leaves {of_car.residual:.3f} N m where nothing was fitted")
        print(steering_fit.sites_said(of_car))
    except ValueError as error:
        of_car = str(error)
        print(f"no car is written: {of_car}")
    trace = provenance.trace(
        command=args.argv,
        result=out.name,
        car=car,
        friction={row.name: row.model.friction for row in found.dry if row.model.friction is not None},
        inputs=inputs.of(args),
        seed=args.seed,
        mapping=mapping_of(0, args).plain(),
    )
    beside = None
    if live and isinstance(of_car, ColumnFit):
        beside = live(steering_fit.fitted_car(of_car, name), {named(of_car.friction): of_car.friction})
    steering_fit.write(out, found, name, of_car, trace, beside)
    print(out / "index.html")


def _place(given: str, args: Any) -> tuple[str, str]:
    """Path of a drive that is packaged, whose mapping is then set, or of a file; and its name."""
    path = packaged(given, args)
    if path == given and not Path(given).suffix:
        raise ValueError(f"{given!r} is no packaged drive ({', '.join(names.road_drives())}) and no file's name")
    return path, Path(path).name.partition(".")[0]
