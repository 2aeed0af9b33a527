"""Train a policy, and evaluate it against the baselines on held-out episodes.

Validation on other episodes chooses the policy that is kept.
"""

import argparse
import sys

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import OF_ALGORITHM, require
from steer_env.experiments.learning.constants import ALGORITHMS
from steer_env.experiments.pages import car_options
from steer_env.registration import DRIVEN

GROUP = "learn"
MINUTES = 15.0  # of training by default


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add(parser, "--env", f": {', '.join(DRIVEN)}", required=True)
    kept = "that of the checkpoint, or else"
    parser.add_argument("--algo", choices=ALGORITHMS, help=f"training algorithm (default: {kept} ppo)")
    length = parser.add_mutually_exclusive_group()
    text = f"wall time of all sessions together (default: {MINUTES:g})"
    length.add_argument("--minutes", metavar="N", type=options.real, help=text)
    text = "in all sessions together, summed over the sub-environments; such a run can be repeated"
    options.add(length, "--steps", text, type=options.whole_number(1))
    options.add(parser, "--seed", otherwise=f"{kept} 0", type=options.whole_number(0, 2**32 - 1))
    options.add(parser, "--friction", otherwise=f"{kept} {options.OF_CAR}")
    car_options.add(parser, default=None)
    text = "go on from the checkpoint in --out, with its settings"
    parser.add_argument("--resume", action="store_true", help=text)
    text = (
        "train with Stable-Baselines3's own defaults at the id's default settings: no scaling, network sizes, schedule "
        "or drawn conditions of this package"
    )
    parser.add_argument("--library-defaults", action="store_true", help=text)
    text = "keep the cost of an episode within a budget by a Lagrange multiplier; every cost of a task has the budget 1"
    parser.add_argument("--cost-budget", metavar="B", type=options.real, help=text)
    most = options.whole_number(1, options.MOST_EPISODES)
    options.add(parser, "--episodes", "of the evaluation, held out from the training", 200, type=most)
    options.add_page(parser, "of the policy, its checkpoint and its report", "training")


def run(args: argparse.Namespace) -> None:
    """Train, and write the report."""
    more = [OF_ALGORITHM[args.algo]] if args.algo in OF_ALGORITHM else []
    require("train", "training", *more)

    from steer_env.experiments.cli.common.policies import evaluate_and_report
    from steer_env.experiments.learning import policy, policy_report
    from steer_env.experiments.learning.training import Training, finished_steps
    from steer_env.experiments.pages.files import usable
    from steer_env.experiments.pages.options import progress
    from steer_env.friction.numerics.check import number

    out, library = args.out, args.library_defaults
    minutes = MINUTES if args.minutes is None else number("--minutes", args.minutes, minimum=0.0, above=True)
    if library and args.resume:
        raise ValueError("--library-defaults belongs to a new run; a resumed one keeps its settings: leave it out")
    asked = {"seed": args.seed, "resume": args.resume, "friction": args.friction}
    if args.resume and car_options.any_given(args):
        raise ValueError("a resumed run keeps its car: leave --vehicle, --tyre and --set out")
    car = car_options.load(args).data() if car_options.any_given(args) else None
    run = Training(args.env, args.algo, out, **asked, library=library, car=car, cost_budget=args.cost_budget)
    usable(out / "report", policy_report.CONTENTS)
    try:
        with progress("training") as notify:
            run.run(None if args.steps else minutes, args.steps, notify)
    except KeyboardInterrupt:
        print(
            f"steer-env: {out} holds the training up to step {finished_steps(out)}; --resume goes on from there",
            file=sys.stderr,
        )
        raise
    if run.told:
        print(run.told)
    made = {**policy.conditions({"settings": run.settings}), "friction": run.friction.parameters}
    path = out / "policy.zip"
    curves = policy.learning_curves(path)
    evaluate_and_report(args, args.env, {"policy": policy.load(path)}, out / "report", made, curves)
