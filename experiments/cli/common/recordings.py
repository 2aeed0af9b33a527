"""What ``evaluate`` and ``validate`` share: options of recorded files, and the assessment that both print and write."""

import argparse
import json
import math
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import inputs, names, options
from steer_env.experiments.cli.common.extras import require_format
from steer_env.experiments.cli.common.options import KPH
from steer_env.experiments.cli.common.sweeping import unswept
from steer_env.experiments.pages.options import progress
from steer_env.friction.numerics.check import number

# Key of a recording's meta -> what it tells, printed before the metrics.
NOTES = {
    "not_read": "columns that are not read",
    "uncalibrated": "in counts of the sensor, uncalibrated",
    "seconds_assumed": "without a unit, read in seconds",
    "no_value": "samples that are no values, and why",
    "doubled_stamps": "samples left out, as the next one has the same time stamp",
    "torn": "cut off where the drive ended, and left out",
}

TORQUE_SCALE_KEY = "torque_scale_error"
# Condition -> how far two recordings that are compared may be apart, as far as one may be from what its test
# prescribes; its option, the unit of that, and how many of it are one SI.
CONDITION_TOLERANCES = {
    "speed_m_s": (0.03, "--speed-kph", "km/h", 3.6),
    "frequency_hz": (0.1, "--frequency-hz", "Hz", 1.0),
}
MOST_RECORDINGS = 8  # recordings that are compared
NO_NUMBERS = ("edition", "mirrored", "motor")  # conditions that the metrics check themselves


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how files are read and what is made of them."""
    options.add(parser, "--manoeuvre", otherwise="that of the recording's meta", choices=names.manoeuvres())
    options.add(parser, "--targets", ", by which the metrics are rated", otherwise="none")
    add_reading(parser)
    options.add(parser, "--speed-kph", "at which the test was driven", otherwise="that of the recording, or the test's")
    text = "frequency of the steering in the test [Hz]"
    parser.add_argument("--frequency-hz", metavar="HZ", type=options.real, help=text)
    text = (
        "bound on the unknown delay between channels, in either direction [ms] (default: what the recording says, or 0)"
    )
    parser.add_argument("--timing-ms", metavar="MS", type=options.real, help=text)
    options.add_noticed(parser)
    text = "for index.html and evaluation.json, replaced as a whole"
    options.add_page(parser, text, otherwise="none is written", full=True)


def add_reading(parser: argparse._ActionsContainer, every: bool = False) -> None:
    """Add the options that say how a file is read, and which part of it is used; ``every``: --map is for all files."""
    parser.set_defaults(every=every)
    text = (
        "names, units, signs and delays of a file's channels; one for each recording in order, the last may have none"
    )
    parser.add_argument("--mapping", metavar="FILE.toml", nargs="+", action="extend", default=[], help=text)
    whose = "all recordings" if every else "the first recording"
    text = f"one channel of {whose}, e.g. handwheel_angle=SWA[deg],sign=-1,delay_ms=10; may be repeated"
    parser.add_argument("--map", dest="entries", metavar="ENTRY", action="append", default=[], help=text)
    text = "databases (.dbc, .kcd, .sym, .arxml) of CAN logs, which say what their frames hold"
    parser.add_argument("--dbc", metavar="FILE", nargs="+", action="extend", default=[], help=text)
    text = "the bus of a CAN log, where a message occurs on several"
    parser.add_argument("--bus", metavar="NAME", help=text)
    text = "use only this part of the recording [s]"
    parser.add_argument("--between", metavar=("T0", "T1"), type=options.real, nargs=2, help=text)
    text = "leave a channel out, e.g. one with gaps; may be repeated"
    parser.add_argument("--without", metavar="CHANNEL", action="append", default=[], help=text)


def assess(given: list[str], args: argparse.Namespace, tolerances: str | None, compare: bool) -> int:
    """Assess recordings, print the result and write it.

    The exit code is 1 where a recording gives no metric at all, or where two do not agree within the tolerances.
    """
    from steer_env import targets
    from steer_env.experiments.pages.files import usable
    from steer_env.experiments.reports import assessment
    from steer_env.experiments.studies.common import simulation_vs_measurement

    paths = _expand_folders(given)
    require_format(paths)
    if compare and not 2 <= len(paths) <= MOST_RECORDINGS:
        raise ValueError(f"--compare takes two to {MOST_RECORDINGS} recordings, got {len(paths)}")
    if len(args.mapping) > len(given):
        raise ValueError(f"{len(args.mapping)} mappings are given for {len(given)} recordings")
    check_can([*paths], args)
    if args.out:
        usable(args.out, assessment.CONTENTS)
    labels = _labels([*paths])
    places = dict(zip(labels, paths.values()))
    recordings, broken = _read_all(dict(zip(labels, paths)), places, args, 2 if compare else 1)
    if tolerances and broken:
        raise ValueError("; ".join(broken.values()))
    wanted = targets.load(args.targets) if args.targets else None
    allowed = simulation_vs_measurement.tolerances(tolerances) if tolerances else None
    conditions = _conditions(args)
    told = {label: path + _mapping_of(places[label], args) for label, path in zip(labels, paths) if label in recordings}
    _check_conditions({told[label]: each for label, each in recordings.items()}, args.manoeuvre, conditions, compare)
    timing = None if args.timing_ms is None else 1e-3 * number("--timing-ms", args.timing_ms, minimum=0.0)
    with progress("driving variants of the simulation", total=None) if tolerances else nullcontext():
        found = assessment.assess(
            recordings,
            args.manoeuvre,
            wanted,
            allowed,
            timing,
            options.noticeable_share(args),
            compare=compare,
            **conditions,
        )._replace(broken=broken)
    agree = not found.pairs or simulation_vs_measurement.passes(found.pairs)
    _print(found, agree, tolerances)
    if getattr(args, "suggest", None):
        _suggest(found, args)
    if args.out:
        out = args.out
        assessment.write(out, found, recordings, _trace(args, places, out.name), args.full)
        print(out / "index.html")
    readable = all(any(not value.reason for value in values.values()) for values in found.values.values())
    return int(not (agree and readable) or bool(broken))


def _expand_folders(given: list[str]) -> dict[str, int]:
    """The files, a folder's recordings in its place -> place of what was given."""
    paths = dict[str, int]()
    for place, path in enumerate(given):
        within = [str(each) for each in inputs.recordings_in(path)]
        if Path(path).is_dir() and not within:
            raise ValueError(f"{path} holds no recording: {names.RECORDED}")
        for each in within or [path]:
            if each in paths:
                raise ValueError(f"{each} is given twice")
            paths[each] = place
    return paths


def _read_all(
    paths: Mapping[str, str], places: Mapping[str, int], args: argparse.Namespace, least: int
) -> tuple[dict[str, Any], dict[str, str]]:
    """The recordings by label, and why others cannot be read; ValueError where fewer than ``least`` are left."""
    found, broken = dict[str, Any](), dict[str, str]()
    for label, path in paths.items():
        try:
            measured = next(iter(found.values()), None)
            found[label] = (
                _driven(path, measured, args) if _car(path) and measured else _read(path, places[label], args)
            )
        except (ValueError, OSError) as error:
            if len(paths) == least:
                raise
            broken[label] = str(error)
            print(f"{path} is left out: {error}")
    if len(found) < least:
        raise ValueError(f"only {len(found)} of {len(paths)} recordings can be read: {'; '.join(broken.values())}")
    return found, broken


def _car(path: str) -> bool:
    """Whether a file is that of a car, and not a recording."""
    return Path(path).suffix in (".toml", ".json")


def _driven(path: str, measured: Any, args: argparse.Namespace) -> Any:
    """The recording of a car that is driven as another one was."""
    from steer_env import metrics
    from steer_env.experiments.studies.common import explanation
    from steer_env.vehicle import cars

    car = cars.load(path)
    law = options.friction(args, car).parameters
    test = metrics.evaluation_of(measured, args.manoeuvre).name
    return explanation.driven_as(measured, explanation.Setting(car, law), test, **_conditions(args))


def _suggest(found: Any, args: argparse.Namespace) -> None:
    """Write the car of the nearest explanation, with its friction beside it, and print how to validate it."""
    from steer_env import friction
    from steer_env.experiments.pages.files import write_json
    from steer_env.experiments.studies.common import explanation
    from steer_env.vehicle import cars

    if found.nearest is None or not found.nearest.best.changes:
        print(f"{args.suggest} is not written: there is no change to suggest")
        return
    car, law = explanation.suggested(found.nearest)
    cars.write(car, args.suggest)
    words = ["steer-env", "validate", args.measured, str(args.suggest)]
    if friction.as_mapping(law) != friction.as_mapping(friction.resolve(car.friction)):
        beside = args.suggest.with_name(f"{args.suggest.stem}_friction.json")
        write_json(beside, {"friction": friction.as_mapping(law)})
        words += ["--friction", str(beside)]
    if late := found.nearest.setting.late:
        words += ["--map", f"handwheel_torque=NAME,delay_ms={1e3 * late:.3g}"]
    print(shlex.join([*words, *(word for path in args.mapping for word in ("--mapping", path))]))


def _print(found: Any, agree: bool, tolerances: str | None) -> None:
    """Print what was found."""
    from steer_env.experiments.cli.common.tables import print_differences, print_metrics
    from steer_env.experiments.studies.common import comparison_power, explanation

    labels, wanted = list(found.values), found.targets
    if wanted and not found.bands:
        print(f"targets {wanted.name!r} have no bands for {found.test}; they have some for {', '.join(wanted.bands)}")
    for label in labels:
        print_metrics(found.shown(label), f"{found.test}, {label}", found.ratings[label])
    for label, differences in found.differences.items():
        if differences:
            print_differences(differences, f"{label} less {labels[0]}")
        else:
            print(f"{label} is not compared: no metric is read from both it and {labels[0]}")
    for label, notes in found.zeros.items():
        for note in notes:
            print(f"{label}: {note}")
    for pair in found.pairs:
        print(f"{pair.y} over {pair.x}: {pair.inside:.1%} inside, largest distance {pair.worst:.2f} tolerances")
    if found.pairs:
        said = "agree" if agree else "do not agree"
        print(f"{labels[0]} and {labels[1]} {said} within the tolerances {tolerances}")
        if found.power is not None:
            print(comparison_power.in_words(found.power))
        if found.nearest:
            print(explanation.verdict(found.nearest))
            for change in found.nearest.best.changes:
                print(f"{change.name}: {explanation.amount(change)}, 95 % interval {explanation.ends(change)}")
            print(*explanation.sentences(found.nearest), sep="\n")
        if found.unexplained:
            print(f"What would explain the difference is unknown: {found.unexplained}.")


def _notes(meta: Mapping[str, Any], frames: bool) -> Iterator[str]:
    """What to know of a recording before its metrics: columns without values, counts, gaps of ``frames``."""
    for key, label in NOTES.items():
        if key in meta:
            text = meta[key]
            yield f"{label}: {json.dumps(text, ensure_ascii=False)[1:-1] if isinstance(text, dict) else text}"
    for name, told in meta["can"]["messages"].items() if frames else ():
        missed = told.get("missed_by_counter", 0)
        if told.get("gaps") or missed:
            counted = f"; {missed} frames are missing by its counter" if missed else ""
            longest = f"{told['longest_step_s']:.3g} s at {told['longest_step_at_s']:.2f} s"
            yield f"gaps of {name}: {told['gaps']}, longest step {longest}{counted}"
    yield from meta["can"].get("notes", ()) if frames else ()


def _of_drive(found: Any) -> Iterator[str]:
    """What to know of a person's drive: whether the simulation kept up with the clock."""
    from steer_env.recording import driven

    if driven.is_drive(found) and (share := driven.share_missed(found)) > driven.MANY_MISSED:
        yield f"{share:.1%} of the deadlines were missed, by which the person was too fast for the simulation"


def use_packaged_drive(given: str, args: argparse.Namespace) -> str:
    """Path of a packaged drive, whose mapping is then set unless one is given; any other name as it is."""
    from importlib.resources import files

    if given not in names.road_drives():
        return given
    folder = files("steer_env.experiments").joinpath("data", "road")
    args.mapping = args.mapping or [str(folder.joinpath(f"{given}.toml"))]
    return str(folder.joinpath(f"{given}.csv.gz"))


def can_options(args: argparse.Namespace) -> Any:
    """How CAN logs are read, by the options."""
    from steer_env.recording import can_log

    return can_log.Options(tuple(args.dbc), args.bus, args.between[1] if args.between else float("inf"))


def check_can(paths: list[str], args: argparse.Namespace) -> None:
    """ValueError where options of CAN logs are given and none of the files is one."""
    from steer_env.recording import can_log

    for option, value in (("--dbc", args.dbc), ("--bus", args.bus)):
        if value and not any(can_log.is_can_log(path, can_options(args)) for path in paths):
            logs = f"CAN logs ({', '.join(names.CAN_FORMATS)}, or raw frames in .mf4 with --dbc)"
            raise ValueError(f"{option} is for {logs}, not {' or '.join(paths)}")


def _labels(paths: list[str]) -> list[str]:
    """File names without suffix, or the paths where those are the same."""
    labels = [Path(path).stem for path in paths]
    return paths if len(set(labels)) < len(labels) else labels


def _mapping_of(place: int, args: argparse.Namespace) -> str:
    """The mapping of a recording, for messages about its meta."""
    return f" (mapping {args.mapping[place]})" if place < len(args.mapping) else ""


def load_mapping(place: int, args: argparse.Namespace) -> Any:
    """The mapping of a recording by its place among those that are given."""
    from steer_env.recording import channel_mapping

    given = args.mapping[place] if place < len(args.mapping) else None
    chosen = channel_mapping.load(given) if given else channel_mapping.Mapping()
    if place == 0 or args.every:
        chosen = chosen.with_entries(channel_mapping.parse_entry(text) for text in args.entries)
    return chosen


def _trace(args: argparse.Namespace, places: Mapping[str, int], result: str) -> dict[str, Any]:
    """What an assessment is made from, with what each recording was read through."""
    from steer_env.experiments.pages import provenance

    chosen = {label: load_mapping(place, args) for label, place in places.items()}
    mapping = {label: one.plain() for label, one in chosen.items()}
    return provenance.trace(
        command=unswept(args, "--suggest"), result=result, inputs=inputs.trace_inputs(args), mapping=mapping
    )


def read(path: str, place: int, args: argparse.Namespace, lacks: bool = False) -> Any:
    """A recording from a file, read through its mapping, without the channels and the part that are not wanted.

    Where it ``lacks`` may be, as it is one of several, a channel that it has not and that is left out is told.
    """
    from steer_env.recording import can_log, files
    from steer_env.recording.recording import require_moderate

    found = files.read(path, load_mapping(place, args), can=can_options(args))
    lacking = [name for name in args.without if name not in found.channels] if lacks else []
    if lacking:
        print(f"{path}: has no {', '.join(lacking)}, which is left out of the others")
    with _with_file_name(path):
        found = found.without(*(name for name in args.without if name not in lacking))
        require_moderate(found)
    for note in (*_notes(found.meta, can_log.is_can_log(path, can_options(args))), *_of_drive(found)):
        print(f"{path}: {note}")
    with _with_file_name(path):
        return found.between(*args.between) if args.between else found


@contextmanager
def _with_file_name(path: str) -> Iterator[None]:
    """Errors of a recording with the name of its file."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _read(path: str, place: int, args: argparse.Namespace) -> Any:
    """A recording of a test, with short drop-outs bridged, but where the test leaves gaps out itself."""
    from steer_env import metrics

    found = read(path, place, args)
    if args.manoeuvre is None and found.meta.get("manoeuvre") is None:
        raise ValueError(f"{path} does not name its test: give --manoeuvre, one of {', '.join(names.manoeuvres())}")
    test = _test(path + _mapping_of(place, args), found.meta.get("manoeuvre"), args.manoeuvre)
    with _with_file_name(path):
        return found if metrics.evaluation_by_name(test).gaps else found.bridged()


def _conditions(args: argparse.Namespace) -> dict[str, float]:
    """The conditions of the test that the options give, as keywords of :func:`steer_env.metrics.evaluate`."""
    given = {"speed_m_s": args.speed_kph and KPH * args.speed_kph, "frequency_hz": args.frequency_hz}
    return {name: value for name, value in given.items() if value is not None}


def _check_conditions(
    recordings: Mapping[str, Any], asked: str | None, given: Mapping[str, float], compare: bool
) -> None:
    """Refuse recordings of another test than the one asked for, bad values of conditions, and unlike conditions.

    Parameters
    ----------
    recordings : mapping of str to Recording
        Where each comes from, in the user's words -> a recording.
    asked : str or None
        The test that the options name; None if they name none.
    given : mapping of str to float
        Conditions that the options give, in place of those of the recordings [SI].
    compare : bool
        Whether conditions must be alike.

    Raises
    ------
    ValueError
        With the file, the key, the value and what is allowed, or with both values of two recordings.
    """
    from steer_env import metrics

    tests = {place: _test(place, recording.meta.get("manoeuvre"), asked) for place, recording in recordings.items()}
    if len(set(tests.values())) > 1:
        said = " and ".join(f"{place} is of {test!r}" for place, test in tests.items())
        raise ValueError(f"{said}: only recordings of the same test {'can be compared' if compare else 'share a page'}")
    (test,) = set(tests.values())
    prescribed = metrics.conditions(test)
    found = {place: _conditions_of(place, recording.meta, prescribed) for place, recording in recordings.items()}
    for key, (share, option, unit, size) in CONDITION_TOLERANCES.items():
        if key not in prescribed:
            continue
        if key in given:
            number(option, size * given[key], minimum=0.0, above=bool(prescribed[key]))
            continue
        values = [size * conditions[key] for conditions in found.values()]
        if compare and max(values) - min(values) > share * max(values) * (1 + 1e-9):
            said = " and ".join(f"{place} at {value:.4g} {unit}" for place, value in zip(found, values))
            raise ValueError(
                f"{said} are more than {share:.0%} apart, so that their metrics differ by the test already: compare "
                f"recordings of one {key}, or correct the meta in a mapping, [meta] {key}"
            )


def _test(place: str, named: Any, asked: str | None) -> str:
    """The test of a recording by its own meta and the options."""
    from steer_env import metrics

    tests = metrics.tests()
    if named is not None and not isinstance(named, str):
        raise ValueError(f"{place}: manoeuvre must be text, one of {', '.join(tests)}; got {named!r}")
    if asked is None:
        if named not in tests:
            raise ValueError(f"{place} names no known test, {named!r}: give --manoeuvre, one of {', '.join(tests)}")
        return named
    if named in tests and named != asked:
        raise ValueError(
            f"{place} is of {named!r} by its meta, not of {asked!r}: leave --manoeuvre {asked} out, or, where the "
            f'meta is wrong, correct it in a mapping, [meta] manoeuvre = "{asked}"'
        )
    return asked


def _conditions_of(place: str, meta: Mapping[str, Any], prescribed: Mapping[str, Any]) -> dict[str, Any]:
    """The conditions of a recording: those of its meta, else those of the test."""
    found = {**prescribed, **{key: meta[key] for key in prescribed if meta.get(key) is not None}}
    for key, value in found.items():
        if key in meta and key not in NO_NUMBERS and value is not None:
            least = 0.0 if key in CONDITION_TOLERANCES or prescribed[key] else -math.inf
            number(f"{place}: {key}", value, minimum=least, above=bool(prescribed[key]))
    if TORQUE_SCALE_KEY in meta:
        number(f"{place}: {TORQUE_SCALE_KEY}", meta[TORQUE_SCALE_KEY], minimum=0.0, maximum=1.0)
    return found
