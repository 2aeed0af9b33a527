"""Drive assists through a suite of conditions, and tell in which they are unstable.

The exit code is 1 where one is unstable.
"""

import argparse

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.options import SHIPPED
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.pages import car_options


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = (
        "baselines by name, a policy.zip of 'steer-env train', or "
        f"{SHIPPED!r} for the policy that is shipped with the id (default: every baseline)"
    )
    parser.add_argument("controllers", metavar="CONTROLLER", nargs="*", help=text)
    options.add(parser, "--env", "of an assist", otherwise="that of the first policy.zip")
    options.add_out(parser, "for the results", form="FILE.json", otherwise="none is written")
    text = "print every condition, not only the worst of each drive and those that fail"
    parser.add_argument("--all", action="store_true", help=text)
    car_options.add(parser, default=None, usual="those of the suite")
    add_sweep(parser)


def run(args: argparse.Namespace) -> int:
    """Print the results, and write them where --out says; the exit code."""
    from steer_env.experiments.cli.common.extras import require
    from steer_env.experiments.learning.controllers import controller_named, is_policy, policy_path

    controllers = args.controllers or [*names.assists()]
    policies = [name for name in controllers if is_policy(name)]
    if policies:
        require("train", "evaluating a policy")

    from steer_env.experiments.cli.common.policies import caution, env_id_of, trace
    from steer_env.experiments.cli.common.tables import print_suite
    from steer_env.experiments.learning import assist_suite, policy
    from steer_env.experiments.pages.files import write_json
    from steer_env.experiments.pages.options import progress

    env_id = env_id_of(args.env, controllers)
    assist_suite.task_named(env_id)
    for path in (policy_path(name, env_id) for name in policies):
        caution(path, policy.read_description(path))
    makers = {name: controller_named(name, env_id) for name in controllers}
    car = car_options.load(args) if car_options.any_given(args) else None
    with progress("driving") as notify:
        found = assist_suite.examine_all(makers, env_id, notify, runner(args), car)
    for name, results in found.items():
        print_suite(results, f"{name} in {env_id}", whole=args.all)
    if args.out:
        kept = trace(args, {} if car is None else {"vehicle": car.data()})
        write_json(args.out, {**assist_suite.as_json(env_id, found), "trace": kept})
        print(args.out)
    return int(not all(result.holds for results in found.values() for result in results))
