"""The command ``assist-suite``: whether an assist is stable in every drive of the suite."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.arguments import SHIPPED
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.pages import car_options


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Drive assists through a suite of conditions, and tell in which they are unstable; the exit code is then 1."
    suite = commands.add_parser("assist-suite", help=text, description=text, parents=[common])
    text = (
        "baselines by name, a policy.zip of 'steer-env train', or "
        f"{SHIPPED!r} for the policy that is shipped with the id (default: every baseline)"
    )
    suite.add_argument("controllers", metavar="CONTROLLER", nargs="*", help=text)
    text = "environment that the controllers are for, an assist's (default: that of the first policy.zip)"
    suite.add_argument("--env", metavar="ID", help=text)
    text = "file for the results as JSON (default: none is written)"
    suite.add_argument("--out", metavar="FILE.json", type=Path, help=text)
    text = "print every condition, not only the worst of each drive and those that fail"
    suite.add_argument("--all", action="store_true", help=text)
    car_options.add(suite, default=None, usual="those of the suite")
    add_sweep(suite)
    suite.set_defaults(function=_suite)


def _suite(args: argparse.Namespace) -> int:
    from steer_env.experiments.cli.common.extras import require
    from steer_env.experiments.learning.controllers import is_policy, named

    controllers = args.controllers or [*names.assists()]
    policies = [name for name in controllers if is_policy(name)]
    if policies:
        require("train", "evaluating a policy")

    from steer_env.experiments.cli.common.policies import trace
    from steer_env.experiments.cli.common.tables import print_suite
    from steer_env.experiments.learning import assist_suite, policy
    from steer_env.experiments.pages.files import write_json
    from steer_env.experiments.pages.options import progress

    own = next((name for name in policies if name != SHIPPED), None)
    if args.env is None and own is None:
        raise ValueError("--env must name the environment where no policy.zip is given")
    env_id = args.env or policy.about(Path(str(own)))["env"]
    assist_suite.task_named(env_id)
    makers = {name: named(name, env_id) for name in controllers}
    car = car_options.load(args) if car_options.given(args) else None
    with progress("driving") as notify:
        found = assist_suite.examine_all(makers, env_id, notify, runner(args), car)
    for name, results in found.items():
        print_suite(results, f"{name} in {env_id}", whole=args.all)
    if args.out:
        kept = trace(args, {} if car is None else {"vehicle": car.data()})
        write_json(args.out, {**assist_suite.as_json(env_id, found), "trace": kept})
        print(args.out)
    return int(not all(result.holds for results in found.values() for result in results))
