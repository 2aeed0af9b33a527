"""Record episodes of a controller as a Minari data set, with costs, to learn without an environment."""

import argparse
from pathlib import Path

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.options import SHIPPED
from steer_env.experiments.learning.constants import HELD_OUT, QUALITIES
from steer_env.experiments.pages import car_options
from steer_env.registration import DRIVEN


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add(parser, "--env", f": {', '.join(DRIVEN)}", required=True)
    text = f"the name of a baseline, zero, random, {SHIPPED!r}, or a policy.zip that 'steer-env train' wrote"
    who = parser.add_mutually_exclusive_group(required=True)
    who.add_argument("--policy", metavar="NAME", help=text)
    text = (
        "the benchmark's reference of the id with a share of random action: "
        + ", ".join(f"{name} {share:g}" for name, share in QUALITIES.items())
        + "; prints the score of the set"
    )
    who.add_argument("--quality", choices=tuple(QUALITIES), help=text)
    options.add(parser, "--episodes", default=100, type=options.whole_number(1, HELD_OUT))
    text = f"of the first episode; all stay below {HELD_OUT}, where held-out episodes begin"
    options.add(parser, "--seed", text, 0, type=options.whole_number(0, HELD_OUT - 1))
    options.add(parser, "--friction", otherwise=f"{options.OF_CAR}, or that of the training")
    car_options.add(parser, default=None)
    options.add_out(parser, "of the data set, replaced as a whole", "dataset")


def run(args: argparse.Namespace) -> None:
    """Write the data set."""
    if args.seed + args.episodes > HELD_OUT:
        raise ValueError(f"--seed {args.seed} with {args.episodes} episodes reaches the held-out seeds, {HELD_OUT} on")
    require("datasets", "recording a data set")

    from steer_env.experiments.cli.common.policies import caution
    from steer_env.experiments.learning import controllers, dataset, policy
    from steer_env.experiments.pages.files import usable
    from steer_env.experiments.pages.options import progress

    policy.check_driven(args.env)
    out, made = args.out, {}
    name = args.policy or controllers.reference(args.env)
    if controllers.is_policy(name):
        require("train", "a trained policy")
        path = controllers.policy_path(name, args.env)
        about = policy.read_description(path)
        made = {**policy.conditions(about), "friction": policy.law(about["friction"], path).parameters}
        caution(path, about)
    make = controllers.controller_named(name, args.env)
    if args.friction:
        made["friction"] = args.friction.parameters
    if car_options.any_given(args):
        made["vehicle"] = car_options.load(args).data()
    usable(out, dataset.CONTENTS)
    with progress("recording") as notify:
        dataset.record(out, args.env, Path(name).stem, make, args.episodes, args.seed, notify, args.quality, **made)
    print(out / dataset.DATA_FOLDER)
    if args.quality:
        print("score {:.2f}, mean cost {:.2f}".format(*dataset.mean_score(out)))
