"""Evaluate policies and baselines against the baselines on held-out episodes, and write a report."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.options import SHIPPED
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.pages import car_options
from steer_env.registration import DRIVEN

if TYPE_CHECKING:
    from steer_env.experiments.learning.controllers import Maker


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = (
        f"a policy.zip that 'steer-env train' wrote, {SHIPPED!r} for the policy that is shipped with the id, or the "
        "name of a baseline"
    )
    parser.add_argument("file", metavar="FILE", nargs="+", help=text)
    options.add(parser, "--env", f": {', '.join(DRIVEN)}", otherwise="that of the first policy.zip")
    options.add_evaluation(parser, "evaluation")
    options.add(parser, "--friction", otherwise="that of the training")
    car_options.add(parser, default=None)
    add_sweep(parser)


def run(args: argparse.Namespace) -> None:
    """Evaluate, print the table and write the report."""
    from steer_env.experiments.learning.controllers import is_policy

    if any(map(is_policy, args.file)):
        require("train", "evaluating a policy")

    from steer_env.experiments.cli.common.policies import env_id_of, evaluate_and_report
    from steer_env.experiments.learning import policy, policy_report
    from steer_env.experiments.pages.files import usable

    env_id = env_id_of(args.env, args.file)
    policy.check_driven(env_id)
    sweep = runner(args)
    usable(args.out, policy_report.CONTENTS)
    controllers, paths, made = _controllers(args, env_id)
    curves = {
        title: file for label, path in paths.items() for title, file in policy.learning_curves(path, label).items()
    }
    if car_options.any_given(args):
        made["vehicle"] = car_options.load(args).data()
    evaluate_and_report(args, env_id, controllers, args.out, made, curves, sweep)


def _controllers(args: argparse.Namespace, env_id: str) -> "tuple[dict[str, Maker], dict[str, Path], dict[str, Any]]":
    """Controllers by label, the files of the policies among them, and the arguments of the environment.

    The policies must have been trained under the same conditions.
    """
    from steer_env.experiments.cli.common.policies import caution
    from steer_env.experiments.learning import policy, policy_report
    from steer_env.experiments.learning.controllers import baselines, is_policy, policy_path

    known = baselines(env_id)
    alone = sum(map(is_policy, args.file)) == 1
    controllers: dict[str, Maker] = {}
    made: dict[str, Any] = {}
    words: dict[str, str] = {}
    paths: dict[str, Path] = {}
    for name in args.file:
        if not is_policy(name):
            if name not in known:
                raise ValueError(f"{name!r} is neither a policy.zip nor a baseline of {env_id}: {', '.join(known)}")
            if name in controllers:
                raise ValueError(f"{name!r} is given twice: give it once")
            controllers[name] = known[name]
            continue
        path = policy_path(name, env_id)
        about = policy.read_description(path)
        policy.check_observations(path, about, env_id)
        law = args.friction or policy.law(about["friction"], path)
        found = policy_report.conditions({**policy.conditions(about), "friction": law.label})
        if paths:
            _check_same(next(iter(paths.values())), words, path, found)
        made, words = {**policy.conditions(about), "friction": law.parameters}, found
        label = "policy" if alone else path.resolve().parent.name
        if label in known:
            raise ValueError(f"the directory of {path} has the name of a baseline, {label}: rename it")
        if label in paths:
            raise ValueError(f"policies are labelled by their directories, and {label!r} comes twice: rename one")
        caution(path, about)
        paths[label], controllers[label] = path, policy.load(path)
    if args.friction:
        made["friction"] = args.friction.parameters
    return controllers, paths, made


def _check_same(first: Path, words: Mapping[str, str], second: Path, others: Mapping[str, str]) -> None:
    """ValueError that names the first condition in which the trainings of two policies differ."""
    for name in {**words, **others}:
        one, other = words.get(name, "the default"), others.get(name, "the default")
        if one != other:
            advice = "give --friction LAW to compare them on one law" if name == "friction" else "evaluate them apart"
            raise ValueError(f"{first} was trained with {name} {one}, {second} with {name} {other}: {advice}")
