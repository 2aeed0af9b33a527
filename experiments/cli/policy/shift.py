"""Evaluate a policy beside the baselines under conditions that its training did not draw."""

import argparse
from pathlib import Path

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.options import SHIPPED
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.learning.constants import SHIFTS
from steer_env.experiments.pages import car_options


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = f"a policy.zip that 'steer-env train' wrote, or {SHIPPED!r} with --env ID"
    parser.add_argument("file", metavar="FILE", help=text)
    text = "conditions that are replaced, one at a time (default: all)"
    parser.add_argument("--over", choices=SHIFTS, nargs="+", default=list(SHIFTS), help=text)
    options.add(parser, "--env", f"whose policy is meant by {SHIPPED!r}", otherwise="that of FILE")
    options.add_evaluation(parser, "shift")
    add_sweep(parser)
    text = (
        f"{', '.join(names.laws())}, and the laws identified from a noisy record of the training's law that describe it"
    )
    options.add(parser, "--friction", ", for --over law", otherwise=text, nargs="+", action="extend")
    car_options.add(parser, default=None, usual="none beside the packaged ones, for --over car")


def run(args: argparse.Namespace) -> None:
    """Evaluate, print the table and write the report."""
    if args.file in (*names.assists(), *names.drivers()):
        raise ValueError(f"{args.file!r} is a baseline, which was not trained: give a policy.zip")
    if args.file != SHIPPED and not args.file.endswith(".zip"):
        raise ValueError(f"{args.file!r} is no policy: give a policy.zip of train, or {SHIPPED!r} with --env ID")
    if args.file == SHIPPED and args.env is None:
        raise ValueError(f"{SHIPPED!r} needs --env ID, the environment whose shipped policy is meant")
    if args.friction and "law" not in args.over:
        raise ValueError(f"--friction names the laws of --over law, and --over is {', '.join(args.over)}")
    if car_options.any_given(args) and "car" not in args.over:
        raise ValueError(f"--vehicle, --tyre and --set are of --over car, and --over is {', '.join(args.over)}")
    require("train", "evaluating a policy")
    own = car_options.load(args) if car_options.any_given(args) else None

    from steer_env.experiments.cli.common.policies import caution, trace
    from steer_env.experiments.cli.common.tables import print_shift
    from steer_env.experiments.learning import policy, policy_report
    from steer_env.experiments.learning import shift as shifted
    from steer_env.experiments.pages.files import usable
    from steer_env.experiments.pages.options import progress

    sweep = runner(args)
    path = policy.shipped_policy(args.env) if args.file == SHIPPED else Path(args.file)
    about = policy.read_description(path)
    if args.env not in (None, about["env"]):
        raise ValueError(f"{path} was trained for {about['env']}, not {args.env}: leave --env out")
    policy.check_observations(path, about, about["env"])
    out, home = args.out, policy.law(about["friction"], path)
    usable(out, shifted.CONTENTS)
    caution(path, about)
    with progress("evaluating") as notify:
        asked = {over: shifted.changes(over, about["env"], home, args.friction or (), own) for over in args.over}
        chosen = {over: changes for over, changes in asked.items() if changes}
        if not chosen:
            words = " or ".join(asked)
            raise ValueError(f"{about['env']} has nothing to replace for --over {words}: give another condition")
        found = shifted.collect(path, chosen, args.episodes, notify, sweep)
    title = f"{found.env_id}, {args.episodes} held-out episodes: means ± half the 95 % interval"
    rows = {shifted.HOME: {found.trained: found.home}, **found.cells}
    for label, why in found.refused.items():
        print(f"{label} is left out: {why}")
    print_shift(rows, policy_report.aim(found.units), found.units, title)
    made = {**policy.conditions(about), "friction": home.parameters}
    shifted.write(out, found, trace(args, made if own is None else {**made, "vehicle": own.data()}))
    print(out / "index.html")
