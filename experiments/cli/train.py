"""The command ``train``: train a policy and evaluate it."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common.arguments import (
    FRICTION,
    MOST_EPISODES,
    friction_law,
    minutes,
    whole_number,
)
from steer_env.experiments.cli.common.extras import OF_ALGORITHM, require
from steer_env.experiments.learning.constants import ALGORITHMS
from steer_env.experiments.pages import car_options
from steer_env.registration import DRIVEN

MINUTES = 15.0  # of training by default


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Train a policy, keep the best one by validation, and evaluate it against the baselines on other seeds."
    train = commands.add_parser("train", help=text, description=text, parents=[common])
    train.add_argument("--env", metavar="ID", required=True, help=", ".join(DRIVEN))
    kept = "default: that of the checkpoint, or else"
    train.add_argument("--algo", choices=ALGORITHMS, help=f"training algorithm ({kept} ppo)")
    length = train.add_mutually_exclusive_group()
    text = f"wall time of all sessions together (default {MINUTES:g})"
    length.add_argument("--minutes", metavar="N", type=minutes, help=text)
    text = "environment steps of all sessions together, summed over the sub-environments; such a run can be repeated"
    length.add_argument("--steps", metavar="N", type=whole_number(1), help=text)
    train.add_argument("--seed", metavar="N", type=whole_number(0, 2**32 - 1), help=f"seed of the training ({kept} 0)")
    train.add_argument("--friction", metavar="LAW", type=friction_law, help=f"{FRICTION} ({kept} lugre)")
    car_options.add(train, default=None)
    text = "continue from the checkpoint in --out, with its settings"
    train.add_argument("--resume", action="store_true", help=text)
    text = (
        "train with Stable-Baselines3's own defaults at the id's default settings: no scaling, network sizes, schedule "
        "or drawn conditions of this package"
    )
    train.add_argument("--library-defaults", action="store_true", help=text)
    text = "number of episodes of the evaluation (default 200)"
    train.add_argument("--episodes", metavar="N", type=whole_number(1, MOST_EPISODES), default=200, help=text)
    text = "directory of the policy, its checkpoint and its report (default training)"
    train.add_argument("--out", metavar="DIR", default="training", help=text)
    train.set_defaults(function=_train)


def _train(args: argparse.Namespace) -> None:
    more = [OF_ALGORITHM[args.algo]] if args.algo in OF_ALGORITHM else []
    require("train", "training", *more)

    from steer_env.experiments.cli.common.policies import evaluate_and_report
    from steer_env.experiments.learning import policy, policy_report
    from steer_env.experiments.learning.training import Training
    from steer_env.experiments.pages.files import usable
    from steer_env.experiments.pages.options import progress

    out, library = Path(args.out), args.library_defaults
    if library and args.resume:
        raise ValueError("--library-defaults belongs to a new run; a resumed one keeps its settings: leave it out")
    kept = {"seed": args.seed, "resume": args.resume, "friction": args.friction}
    if args.resume and car_options.given(args):
        raise ValueError("a resumed run keeps its car: leave --vehicle, --tyre and --set out")
    car = car_options.load(args).data() if car_options.given(args) else None
    run = Training(args.env, args.algo, out, **kept, library=library, car=car)
    usable(out / "report", policy_report.CONTENTS)
    with progress("training") as notify:
        run.run(None if args.steps else args.minutes or MINUTES, args.steps, notify)
    made = {**policy.conditions({"settings": run.settings}), "friction": run.friction.parameters}
    path = out / "policy.zip"
    curves = policy.learning_curves(path)
    evaluate_and_report(args, args.env, {"policy": policy.load(path)}, out / "report", made, curves)
