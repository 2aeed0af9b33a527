"""Compute the metrics of recordings, measured or simulated, or compare up to eight.

A folder stands for the recordings in it. One that cannot be read is named, and the others are evaluated. The exit code
is 1 where a recording gives no metric.
"""

import argparse
from pathlib import Path

from steer_env.experiments.cli.common import names, options, recordings
from steer_env.experiments.cli.common.extras import require_format

GROUP = "test"

# Channels of a mapping to fill in: those that are measured in a car and that metrics read.
MEASURED = (
    "handwheel_angle",
    "handwheel_torque",
    "vehicle_speed",
    "lateral_acceleration",
    "yaw_rate",
    "handwheel_speed",
    "roll_angle",
    "sideslip_angle",
)


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    drives = ", ".join(names.road_drives())
    text = f"a recording, or a folder of them: {names.RECORDED}; or {drives}, a packaged drive for --manoeuvre road"
    parser.add_argument("file", metavar="FILE", nargs="?", help=text)
    text = "two to eight recordings, or folders of them; the differences are those to the first"
    parser.add_argument("--compare", metavar="FILE", nargs="+", help=text)
    recordings.add_options(parser)
    options.add(parser, "--template")


def run(args: argparse.Namespace) -> int:
    """Print the metrics, and write them where --out says; the exit code."""
    if (args.file is None) == (args.compare is None):
        raise ValueError("give one FILE, or two to eight with --compare")
    if args.file:
        args.file = recordings.use_packaged_drive(args.file, args)
    if args.template:
        return _write_template(args)
    return recordings.assess([args.file] if args.file else args.compare, args, None, compare=args.file is None)


def _write_template(args: argparse.Namespace) -> int:
    if args.file is None:
        raise ValueError("--template is of one FILE, not of --compare")
    if Path(args.template).exists():
        raise ValueError(f"--template {args.template} exists already: name another file, or remove it")
    require_format([args.file])

    from steer_env.experiments.pages.files import write_text
    from steer_env.metrics import CHANNELS
    from steer_env.recording import mapping_template

    wanted = {name: CHANNELS[name] for name in MEASURED}
    write_text(Path(args.template), mapping_template.text(args.file, wanted, recordings.can_options(args)))
    print(args.template)
    return 0
