"""Fit friction laws to a measured record, and judge which of them describes it.

The record holds displacement and friction. The laws are judged on the part that was not fitted. Writes a page, and a
file of each law that --friction and gym.make take (docs/friction_measurement.md).
"""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from steer_env.experiments.cli.common import inputs, names, options
from steer_env.experiments.cli.common.extras import require_format
from steer_env.experiments.cli.common.recordings import add_reading, can_options, check_can, load_mapping, read
from steer_env.experiments.pages import car_options

if TYPE_CHECKING:
    from steer_env.recording.friction_record import FrictionRecord
    from steer_env.vehicle.cars import Car

GROUP = "friction"
ALL_LAWS = "all"
COLUMN = ("level", "presliding_deg")  # keys of --to-column


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    packaged = ", ".join(names.friction_records())
    text = f"the record: {packaged} (packaged), or a file: .csv.gz, {names.RECORDED}"
    parser.add_argument("file", metavar="DATA", help=text)
    text = f"laws to fit: {ALL_LAWS} (default), or some of {', '.join(names.laws())}"
    parser.add_argument("--law", metavar="LAW", nargs="+", action="extend", help=text)
    text = "for index.html, fit.json and LAW.json, replaced as a whole"
    options.add_page(parser, text, otherwise="friction_NAME")
    options.add_live(parser, "--vehicle, or the default car, with the fitted laws")
    text = "share of the record, its last part, that judges and is not fitted (default: 0.4, where enough is left)"
    parser.add_argument("--held-out", metavar="SHARE", type=options.real, help=text)
    _add_reading(parser)
    _add_record(parser)
    _add_fit(parser)


def _add_reading(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("reading")
    add_reading(group)
    text = "that are fitted, where the record has many more than the motion needs"
    options.add(group, "--rate-hz", text, otherwise="all")
    options.add(group, "--template")


def _add_record(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what the record is of")
    text = "1 where the friction is positive when it resists positive motion, -1 else (default: by the work it takes)"
    group.add_argument("--sign", type=int, choices=(1, -1), help=text)
    text = "inertia that the sensor of the friction accelerates along, whose torque is subtracted [kg m2, or kg]"
    group.add_argument("--inertia", metavar="I", type=options.real, help=text)
    text = "low-pass before the displacement is differentiated for the torque of inertia and damping [Hz] (default: 10)"
    group.add_argument("--cutoff-hz", metavar="HZ", type=options.real, help=text)
    text = "subtract the straight line along which the zero of the friction drifts"
    group.add_argument("--without-drift", action="store_true", help=text)
    text = "radius at which the force acts, 0.00686 for the rack of the default car: m and N become rad and N m [m]"
    group.add_argument("--lever", metavar="METRES", type=options.real, help=text)
    text = (
        "stretch a record of another contact, whose shape is wanted, to the level [N m] and the pre-sliding distance "
        "[deg] of a steering column: level=0.9,presliding_deg=0.516, which are those of the default laws"
    )
    group.add_argument("--to-column", metavar="KEY=VALUE,...", nargs="?", const="", help=text)
    text = "of a record of a car: a channel that is known to be zero, motor_torque or rack_force; may be repeated"
    group.add_argument("--zero", metavar="CHANNEL", action="append", default=[], help=text)
    car_options.add(parser, default=None, usual="none; with one, the friction of its column is separated")


def _add_fit(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("search")
    text = (
        "let the level grow with the load, of which the record needs a channel that varies (rack force, normal force)"
    )
    group.add_argument("--by-load", action="store_true", help=text)
    text = (
        "let the level change over the position (F11), with ORDER periods in a turn; without a number the order is"
        " sought. Beside each law stands what it leaves without"
    )
    group.add_argument("--by-position", metavar="ORDER", nargs="?", const="fitted", type=_order, help=text)
    text = "starting points of the search for each law (default: 3)"
    group.add_argument("--starts", metavar="N", type=options.whole_number(1), default=3, help=text)
    text = "look for a better optimum of each law by differential evolution, which takes minutes"
    group.add_argument("--global-search", action="store_true", help=text)
    options.add(group, "--seed", "of the draws of --global-search", 0)


def _order(text: str) -> float | str:
    return text if text == "fitted" else options.real(text)


def run(args: argparse.Namespace) -> None:
    """Fit, judge and write."""
    path, name = _record_path(args.file)
    require_format([path])
    if args.template:
        _write_template(path, args)
        return

    from steer_env.experiments.cli.common.tables import print_fits
    from steer_env.experiments.pages import files, provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.reports import friction_fit, friction_fit_page
    from steer_env.friction.law import LAWS
    from steer_env.friction.numerics.check import number
    from steer_env.vehicle import cars

    laws = list(LAWS.available()) if args.law in (None, [ALL_LAWS]) else list(dict.fromkeys(args.law))
    for law in laws:
        LAWS[law]  # refuses an unknown one with those that are known
    held_out = None
    if args.by_load and args.by_position is not None:
        raise ValueError("--by-load and --by-position are not sought together: leave one of them out")
    if args.held_out is not None:
        held_out = number("--held-out", args.held_out, minimum=0.0, maximum=0.9)
    out = Path(args.out or f"friction_{name}")
    live = options.live_page_beside(args)
    files.usable(out, friction_fit.contents())
    car = car_options.load(args) if car_options.any_given(args) else None
    record = _record(path, args, car)
    if args.by_position not in (None, "fitted") and not record.of_a_column:
        raise ValueError("--by-position ORDER counts periods in a turn, and the record has none: give --lever too")
    if live and not record.of_a_column:
        raise ValueError("--live needs friction of a column, in rad and N m: give --lever or --to-column too")
    with progress("fitting") as notify:
        found = friction_fit.collect(
            record, name, laws, held_out=held_out, by_load=args.by_load, options=_options(args), notify=notify
        )
    print_fits(found)
    fitted = {each.law: each.fit.parameters for each in found.laws if each.fit is not None}
    trace = provenance.trace(
        command=args.argv,
        result=out.name,
        car=car,
        friction=fitted,
        inputs=inputs.trace_inputs(args),
        seed=args.seed,
        mapping=load_mapping(0, args).plain(),
    )
    beside = live(car or cars.load(), fitted) if live and fitted else None
    friction_fit_page.write(out, found, trace, beside)
    print(out / "index.html")
    if found.best is None:
        raise ValueError("no law was fitted: the table and the page say why")
    files_of = [str(out / f"{each.law}.json") for each in found.equals]
    if record.of_a_column:
        if len(files_of) > 1:
            print(f"{', '.join(files_of)} hold laws that the record cannot tell apart; --friction takes any")
        else:
            print(f"{files_of[0]} holds the law that leaves least: --friction {files_of[0]}")
        if shape := friction_fit_page.car_options(found.best.fit):
            print(f"the level over the position is of the car: {shape}")
        if not args.by_load:
            print(
                "a car's own steering.friction_load (0.03 in most packaged cars) raises this level with the rack force,"
                " as that of every law: --set steering.friction_load=0 leaves it as it was fitted"
            )
    else:
        units = " and ".join(record.units.values())
        print(f"the laws are in {units}: give --lever or --to-column for a steering column")


def _record_path(given: str) -> tuple[str, str]:
    """Path of a record that is packaged or a file, and its name."""
    from importlib.resources import files

    if given in names.friction_records():
        return str(files("steer_env.friction").joinpath("data", f"{given}.csv.gz")), given
    if not Path(given).suffix:
        raise ValueError(f"{given!r} is no packaged record ({', '.join(names.friction_records())}) and no file's name")
    return given, Path(given).name.partition(".")[0]


def _record(path: str, args: argparse.Namespace, car: "Car | None") -> "FrictionRecord":
    """The record of friction that a file holds, in the units that the options ask for."""
    from steer_env.friction.numerics.check import number
    from steer_env.recording import column_balance, friction_record

    check_can([path], args)
    if len(args.mapping) > 1:
        raise ValueError(f"{len(args.mapping)} mappings are given for one record")
    if args.zero and car is None:
        raise ValueError("--zero is of a record of a car: give its --vehicle")
    inertia = 0.0 if args.inertia is None else number("--inertia", args.inertia, minimum=0.0)
    recording = read(path, 0, args)
    kept: dict[str, Any] = {"sign": args.sign, "without_drift": args.without_drift}
    if args.cutoff_hz is not None:
        kept["cutoff_hz"] = number("--cutoff-hz", args.cutoff_hz, minimum=0.0, above=True)
    if args.rate_hz is not None:
        rate = number("--rate-hz", args.rate_hz, minimum=0.0, above=True)
        recording = recording.bridged().resampled(rate)
    if car is None:
        found = friction_record.from_recording(recording, inertia=inertia, **kept)
    elif inertia:
        raise ValueError("--inertia is of a rig: the inertia of a column is that of its --vehicle")
    else:
        found = column_balance.separated(recording, car, zero=args.zero, **kept)
    if args.lever is not None and args.to_column is not None:
        raise ValueError("give --lever or --to-column: both lead to rad and N m")
    if args.lever is not None:
        found = found.with_lever(number("--lever", args.lever, minimum=0.0, above=True))
    elif args.to_column is not None:
        found = found.to_column(**_column(args.to_column))
    for note in found.notes:
        print(f"{args.file}: {note}")
    return found


def _column(text: str) -> dict[str, float]:
    """Level [N m] and pre-sliding distance [rad] of ``--to-column``."""
    from steer_env.friction.numerics.check import positive, read_number

    given: dict[str, float] = {}
    for pair in text.split(",") if text else []:
        key, equals, value = pair.partition("=")
        if key not in COLUMN or not equals or key in given:
            raise ValueError(f"--to-column takes {' and '.join(COLUMN)} as KEY=VALUE, each once, got {pair!r}")
        given[key] = positive(f"--to-column {key}", read_number(value))
    found = {"level": given["level"]} if "level" in given else {}
    return found | ({"distance": math.radians(given["presliding_deg"])} if "presliding_deg" in given else {})


def _write_template(path: str, args: argparse.Namespace) -> None:
    """A mapping to fill in."""
    from steer_env.experiments.pages.files import write_text
    from steer_env.recording import mapping_template
    from steer_env.recording.channel_mapping import FRICTION

    if Path(args.template).exists():
        raise ValueError(f"--template {args.template} exists already: name another file, or remove it")
    write_text(Path(args.template), mapping_template.text(path, FRICTION, can_options(args)))
    print(args.template)


def _options(args: argparse.Namespace) -> dict[str, Any]:
    """Arguments of ``friction.fit`` that the options give."""
    return {
        "starts": args.starts,
        "global_search": args.global_search,
        "seed": args.seed,
        "order": args.by_position,
    }
