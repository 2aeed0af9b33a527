"""The command ``record``: a data set of episodes in Minari's format."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common.arguments import FRICTION, SHIPPED, friction_law, whole_number
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.learning.constants import HELD_OUT
from steer_env.experiments.pages import car_options
from steer_env.registration import DRIVEN


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Record episodes of a controller as a Minari data set, with costs, for learning without an environment."
    record = commands.add_parser("record", help=text, description=text, parents=[common])
    record.add_argument("--env", metavar="ID", required=True, help=", ".join(DRIVEN))
    text = f"the name of a baseline, zero, random, {SHIPPED!r}, or a policy.zip that 'steer-env train' wrote"
    record.add_argument("--policy", metavar="NAME", required=True, help=text)
    text = "number of episodes (default 100)"
    record.add_argument("--episodes", metavar="N", type=whole_number(1, HELD_OUT), default=100, help=text)
    text = f"seed of the first episode (default 0); all stay below {HELD_OUT}, where held-out episodes begin"
    record.add_argument("--seed", metavar="N", type=whole_number(0, HELD_OUT - 1), default=0, help=text)
    text = f"{FRICTION} (default: lugre, or that of the training)"
    record.add_argument("--friction", metavar="LAW", type=friction_law, help=text)
    car_options.add(record, default=None)
    text = "directory of the data set, replaced as a whole (default dataset)"
    record.add_argument("--out", metavar="DIR", default="dataset", help=text)
    record.set_defaults(function=_record)


def _record(args: argparse.Namespace) -> None:
    if args.seed + args.episodes > HELD_OUT:
        raise ValueError(f"--seed {args.seed} with {args.episodes} episodes reaches the held-out seeds, {HELD_OUT} on")
    require("integrations", "recording a data set")

    from steer_env.experiments.cli.common.policies import caution
    from steer_env.experiments.learning import controllers, dataset, policy
    from steer_env.experiments.pages.files import usable
    from steer_env.experiments.pages.options import progress

    policy.check_driven(args.env)
    out, made = Path(args.out), {}
    if controllers.is_policy(args.policy):
        require("train", "a trained policy")
        path = controllers.path_of(args.policy, args.env)
        about = policy.about(path)
        made = {**policy.conditions(about), "friction": policy.law(about["friction"], path).parameters}
        caution(path, about)
    make = controllers.named(args.policy, args.env)
    if args.friction:
        made["friction"] = args.friction.parameters
    if car_options.given(args):
        made["vehicle"] = car_options.load(args).data()
    usable(out, dataset.CONTENTS)
    with progress("recording") as notify:
        dataset.record(out, args.env, Path(args.policy).stem, make, args.episodes, args.seed, notify, **made)
    print(out / dataset.DATA)
