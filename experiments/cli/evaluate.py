"""The commands that take recordings: ``evaluate``, for one or for two side by side, and ``validate``."""

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from steer_env import metrics, targets
from steer_env.experiments.cli.tables import print_metrics
from steer_env.friction.numerics.check import number
from steer_env.recording import channel_mapping, files
from steer_env.recording.recording import Recording

KPH = 1.0 / 3.6  # [m/s]
FORMATS = ", ".join(files.FORMATS)


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the commands to a parser's."""
    text = (
        "Read the metrics of a recording, measured or simulated; with --compare those of two, and their differences. "
        "The exit code is 1 where a recording gives none."
    )
    one = commands.add_parser("evaluate", help=text, description=text, parents=[common])
    one.add_argument("file", metavar="FILE", nargs="?", help=FORMATS)
    one.add_argument("--compare", metavar=("A", "B"), nargs=2, help="two recordings; differences are B less A")
    _recording_options(one)
    one.set_defaults(function=_evaluate)

    text = "Hold a simulation against a measurement of the same test: cross plots with tolerance boundaries."
    two = commands.add_parser("validate", help=text, description=text, parents=[common])
    two.add_argument("measured", metavar="MEASURED", help=FORMATS)
    two.add_argument("simulated", metavar="SIMULATED", help=FORMATS)
    two.add_argument("--tolerances", metavar="FILE.toml", default="default", help="by channel (default: packaged ones)")
    _recording_options(two)
    two.set_defaults(function=_validate)


def _recording_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--manoeuvre", metavar="TEST", choices=metrics.tests(), help=", ".join(metrics.tests()))
    text = f"bands for the metrics: {', '.join(targets.available())}, or a .toml file"
    parser.add_argument("--targets", metavar="NAME", help=text)
    text = (
        "names, units, signs, delays of a file's channels; one for each recording, in order, those left over need none"
    )
    parser.add_argument("--mapping", metavar="FILE.toml", nargs="+", default=[], help=text)
    text = "one channel of the first recording, e.g. handwheel_angle=SWA[deg],sign=-1,delay_ms=10; may be repeated"
    parser.add_argument("--map", dest="entries", metavar="ENTRY", action="append", default=[], help=text)
    parser.add_argument("--speed_kph", metavar="KPH", type=float, help="at which the test was driven")
    parser.add_argument("--frequency_hz", metavar="HZ", type=float, help="at which it was steered")
    parser.add_argument("--timing_ms", metavar="MS", type=float, default=0.0, help="unknown delay between channels, +-")
    parser.add_argument("--between", metavar=("T0", "T1"), type=float, nargs=2, help="the part that is the test [s]")
    parser.add_argument("--out", metavar="DIR", help="index.html and evaluation.json; replaced as a whole")


def _read(path: str, place: int, args: argparse.Namespace) -> Recording:
    """A recording from a file, as the mapping has it and with short drop-outs bridged."""
    chosen = channel_mapping.load(args.mapping[place]) if place < len(args.mapping) else channel_mapping.Mapping()
    if place == 0:
        chosen = chosen.with_entries(channel_mapping.parse_entry(text) for text in args.entries)
    found = files.read(path, chosen)
    if args.manoeuvre is None and found.meta.get("manoeuvre") is None:
        raise ValueError(f"{path} does not name its test: give --manoeuvre, one of {', '.join(metrics.tests())}")
    return (found.between(*args.between) if args.between else found).bridged()


def _given(args: argparse.Namespace) -> dict[str, float]:
    given = {"speed_m_s": args.speed_kph and KPH * args.speed_kph, "frequency_hz": args.frequency_hz}
    return {name: value for name, value in given.items() if value is not None}


def _assess(paths: list[str], args: argparse.Namespace, tolerances: str | None) -> int:
    from steer_env.experiments.report import assessment  # draws
    from steer_env.experiments.studies import simulation_vs_measurement  # draws

    labels = [Path(path).stem for path in paths]
    if len(set(labels)) < len(labels):
        labels = paths
    if len(set(labels)) < len(labels):
        raise ValueError(f"{paths[0]} is given twice")
    if len(args.mapping) > len(paths):
        raise ValueError(f"{len(args.mapping)} mappings for {len(paths)} recordings")
    recordings = {label: _read(path, place, args) for place, (label, path) in enumerate(zip(labels, paths))}
    wanted = targets.load(args.targets) if args.targets else None
    allowed = simulation_vs_measurement.tolerances(tolerances) if tolerances else None
    timing = 1e-3 * number("--timing_ms", args.timing_ms, minimum=0.0)
    found = assessment.assess(recordings, args.manoeuvre, wanted, allowed, timing, **_given(args))
    if wanted and not found.bands:
        print(f"targets {wanted.name!r} have no bands for {found.test}; they have some for {', '.join(wanted.bands)}")
    for label in labels:
        print_metrics(found.values[label], f"{found.test}, {label}", found.lights[label])
    if found.differences:
        _print_differences(found, labels)
    for pair in found.pairs:
        print(f"{pair.y} over {pair.x}: {pair.inside:.1%} inside, largest distance {pair.worst:.2f} tolerances")
    if args.out:
        out = Path(args.out)
        assessment.write(out, found, recordings)
        print(out / "index.html")
    return int(any(all(value.reason for value in values.values()) for values in found.values.values()))


def _evaluate(args: argparse.Namespace) -> int:
    if (args.file is None) == (args.compare is None):
        raise ValueError("give one FILE, or two with --compare A B")
    return _assess([args.file] if args.file else args.compare, args, None)


def _validate(args: argparse.Namespace) -> int:
    return _assess([args.measured, args.simulated], args, args.tolerances)


def _print_differences(found: Any, labels: list[str]) -> None:
    table = Table(title=f"{labels[1]} less {labels[0]}", title_justify="left", box=None, pad_edge=False)
    for heading, justify in {"metric": "left", "difference": "right", "95 % interval": "right", "unit": "left"}.items():
        table.add_column(heading, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    for name, (gap, low, high) in found.differences.items():
        interval = f"{low:.3g} .. {high:.3g}" if low == low else ""
        table.add_row(name, f"{gap:.3g}", interval, metrics.definition(name).unit)
    Console().print(table)
