"""The command ``evaluate``: the metrics of a recording, or of two with their differences."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names, recordings
from steer_env.experiments.cli.common.extras import require_format

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


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Compute the metrics of a recording, measured or simulated; with --compare those of two recordings."
    more = f"{text} The exit code is 1 where a recording gives no metric."
    evaluate = commands.add_parser("evaluate", help=text, description=more, parents=[common])
    evaluate.add_argument("file", metavar="FILE", nargs="?", help=f"the recording: {names.RECORDED}")
    text = "two recordings; the differences are B less A"
    evaluate.add_argument("--compare", metavar=("A", "B"), nargs=2, help=text)
    recordings.add_options(evaluate)
    text = "write a mapping to fill in, which lists every column of FILE with its unit and range, and do no more"
    evaluate.add_argument("--template", metavar="FILE.toml", help=text)
    evaluate.set_defaults(function=_evaluate)


def _evaluate(args: argparse.Namespace) -> int:
    if (args.file is None) == (args.compare is None):
        raise ValueError("give one FILE, or two with --compare A B")
    if args.template:
        return _write_template(args)
    return recordings.assess([args.file] if args.file else args.compare, args, None)


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
