"""Identify hand torque and friction from free drives of one car, judged on what was not fitted.

A drive holds handwheel angle, torque of the torsion bar and speed. Every friction law is fitted in turn. Writes a
page and a car that was fitted to the drives, with its friction: above the torsion bar and below it where the torque of
the hands was recorded beside that of motor or torsion bar (docs/road_drive.md).
"""

import argparse
from itertools import count
from pathlib import Path

from steer_env.experiments.cli.common import inputs, names, options
from steer_env.experiments.cli.common.extras import require_format
from steer_env.experiments.cli.common.recordings import add_reading, check_can, load_mapping, read, use_packaged_drive
from steer_env.experiments.pages import car_options

GROUP = "friction"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    packaged = ", ".join(names.road_drives())
    text = (
        f"a drive: {packaged} (packaged), or a file: .csv.gz, {names.RECORDED}; several of one car are fitted together"
    )
    parser.add_argument("drives", metavar="DRIVE", nargs="+", help=text)
    text = (
        f"laws to fit: all dry ones (default), or some of {', '.join(law for law in names.laws() if law != 'viscous')}"
    )
    parser.add_argument("--law", metavar="LAW", nargs="+", action="extend", help=text)
    options.add_page(
        parser, "for index.html, fit.json, car.toml, friction.json, replaced as a whole", otherwise="steering_NAME"
    )
    options.add_live(parser, "the fitted car with its law")
    text = "share of each drive, its last part, that judges and is not fitted (default: 0.35)"
    parser.add_argument("--held-out", metavar="SHARE", type=options.real, default=0.35, help=text)
    options.add(parser, "--seed", "of the draws of the intervals", 0)
    add_reading(parser.add_argument_group("reading"), every=True)
    car_options.add(parser)


def run(args: argparse.Namespace) -> None:
    """Identify, judge and write."""
    places = _places(args)
    require_format([*places])
    check_can([*places], args)
    stems = [Path(path).name.partition(".")[0] for path in places]
    labels: list[str] = []
    for stem in stems:
        others = (f"{stem}_{i}" for i in count(2))
        labels.append(stem if stem not in labels else next(each for each in others if each not in labels + stems))

    from steer_env.experiments.calibration.column_fit import ColumnFit, fit_column
    from steer_env.experiments.cli.common.tables import print_steering
    from steer_env.experiments.pages import files, provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.reports import steering_fit
    from steer_env.friction.sites import friction_name
    from steer_env.hand_torque import identify, prepared

    out = Path(args.out or f"steering_{'_'.join(labels)}")
    live = options.live_page_beside(args)
    files.usable(out, steering_fit.contents())
    car = car_options.load(args)
    drives = []
    for place, (path, given) in enumerate(zip(places, args.drives)):
        try:
            drives.append(prepared(read(path, place, args, lacks=len(places) > 1)))
        except ValueError as error:
            raise ValueError(str(error) if given in str(error) or path in str(error) else f"{given}: {error}") from None
        for note in drives[-1].notes:
            print(f"{given}: {note}")
    with progress("fitting") as notify:
        found = identify(drives, laws=args.law, held_out=args.held_out, seed=args.seed, notify=notify)
    print_steering(found, labels)
    of_car: ColumnFit | str
    try:
        with progress("fitting the car") as notify:
            of_car = fit_column(found, car, args.seed, notify)
        without = of_car.residual + of_car.adds
        print(
            f"the car, fitted with boost and friction, leaves {of_car.residual:.3f} N m where nothing was fitted, and "
            f"{without:.3f} N m without dry friction"
        )
        print(steering_fit.sites_said(of_car))
    except ValueError as error:
        of_car = str(error)
        print(f"no car is written: {of_car}")
    trace = provenance.trace(
        command=args.argv,
        result=out.name,
        car=car,
        friction={row.name: row.model.friction for row in found.dry if row.model.friction is not None},
        inputs=inputs.trace_inputs(args),
        seed=args.seed,
        mapping={name: load_mapping(place, args).plain() for place, name in enumerate(labels)},
    )
    beside = None
    if live and isinstance(of_car, ColumnFit):
        beside = live(steering_fit.fitted_car(of_car, labels), {friction_name(of_car.friction): of_car.friction})
    steering_fit.write(out, found, labels, of_car, trace, beside)
    print(out / "index.html")


def _places(args: argparse.Namespace) -> list[str]:
    """Paths of the drives, of which packaged ones have their own mappings unless one is given for each drive.

    ValueError for mappings or a ``--map`` that are not told which drive they are for.
    """
    asked, found = list(args.mapping), list[str]()
    given = list(asked)
    every = len(given) == len(args.drives)
    args.mapping = []
    for name in args.drives:
        own = argparse.Namespace(mapping=[])
        path = use_packaged_drive(name, own)
        if path == name and not Path(name).suffix:
            raise ValueError(f"{name!r} is no packaged drive ({', '.join(names.road_drives())}) and no file's name")
        found.append(path)
        if every or (given and not own.mapping):
            args.mapping.append(given.pop(0))
        else:
            args.mapping.append(own.mapping[0] if own.mapping else None)
    whose = [name for name in args.drives if name in names.road_drives()]
    if given:
        told = f", of which {len(whose)} packaged with mappings of their own" if whose else ""
        raise ValueError(f"{len(asked)} mappings are given for {len(args.drives)} drives{told}")
    if args.entries and whose and len(whose) < len(args.drives) and not every:
        raise ValueError(
            f"--map is for all drives, and {whose[0]}, which is packaged, has names of its own: give those of the "
            "other drives in a --mapping"
        )
    return found
