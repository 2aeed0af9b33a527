"""The command ``friction-shift``: a policy on friction laws that it was not trained on."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.arguments import FRICTION, SHIPPED, add_evaluation, friction_law
from steer_env.experiments.cli.common.extras import require


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Evaluate a policy that was trained on one friction law on every other law, and write the table."
    shift = commands.add_parser("friction-shift", help=text, description=text, parents=[common])
    text = f"a policy.zip that 'steer-env train' wrote, or {SHIPPED!r} with --env ID"
    shift.add_argument("file", metavar="FILE", help=text)
    text = f"environment whose shipped policy is meant (default: that of FILE), for {SHIPPED!r}"
    shift.add_argument("--env", metavar="ID", help=text)
    add_evaluation(shift, "shift")
    text = (
        f"{FRICTION}; default: {', '.join(names.laws())}, and the laws identified from a noisy record of the "
        "training's law that describe it"
    )
    shift.add_argument("--friction", metavar="LAW", type=friction_law, nargs="+", help=text)
    shift.set_defaults(function=_shift)


def _shift(args: argparse.Namespace) -> None:
    if args.file in (*names.assists(), *names.drivers()):
        raise ValueError(f"{args.file!r} is a baseline, which was trained on no law: give a policy.zip")
    if args.file != SHIPPED and not args.file.endswith(".zip"):
        raise ValueError(f"{args.file!r} is no policy: give a policy.zip of train, or {SHIPPED!r} with --env ID")
    if args.file == SHIPPED and args.env is None:
        raise ValueError(f"{SHIPPED!r} needs --env ID, the environment whose shipped policy is meant")
    require("train", "evaluating a policy")

    from steer_env import friction
    from steer_env.experiments.cli.common.tables import print_laws
    from steer_env.experiments.learning import friction_shift, policy, policy_report
    from steer_env.experiments.output.files import usable
    from steer_env.experiments.output.options import Friction, progress

    path = policy.shipped(args.env) if args.file == SHIPPED else Path(args.file)
    about = policy.about(path)
    if args.env not in (None, about["env"]):
        raise ValueError(f"{path} was trained for {about['env']}, not {args.env}: leave --env out")
    usable(Path(args.out), friction_shift.CONTENTS)
    laws = args.friction or [
        *(Friction(name) for name in friction.available()),
        *friction_shift.identified(policy.law(about["friction"], path)),
    ]
    with progress("evaluating") as notify:
        found = friction_shift.collect(path, laws, args.episodes, notify)
    title = (
        f"{found.env_id}, trained on {found.trained}, {args.episodes} held-out episodes: means ± half the 95 % interval"
    )
    print_laws(found.values, found.lost, policy_report.aim(found.units), found.units, title)
    friction_shift.write(Path(args.out), found)
    print(Path(args.out) / "index.html")
