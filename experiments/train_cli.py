"""The commands ``train``, ``evaluate-policy`` and ``friction-shift``."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import friction
from experiments import friction_shift, policy, policy_report
from experiments.options import FRICTION, Friction, progress
from experiments.tables import print_estimates
from steer_env import REGISTERED


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the commands to a parser's."""
    text = "Train a policy, keep the best by validation, and evaluate it against the baselines on other seeds."
    train = commands.add_parser("train", help=text, description=text, parents=[common])
    _env(train)
    train.add_argument("--algo", choices=policy.ALGORITHMS, default="ppo", help="default ppo")
    length = train.add_mutually_exclusive_group()
    length.add_argument("--minutes", metavar="N", type=float, help="wall time of training (default 15)")
    length.add_argument("--steps", metavar="N", type=int, help="steps of all lanes together; repeatable elsewhere")
    train.add_argument("--seed", metavar="N", type=int, default=0, help="default 0")
    train.add_argument(
        "--friction", metavar="LAW", type=Friction, default=Friction("lugre"), help=f"{FRICTION} (default lugre)"
    )
    train.add_argument("--resume", action="store_true", help="go on from the checkpoint in --out")
    train.add_argument("--episodes", metavar="N", type=int, default=200, help="of the evaluation (default 200)")
    train.add_argument("--out", metavar="DIR", default="training", help="default training")
    train.set_defaults(function=_train)

    text = "Evaluate policies, or a baseline, on held-out seeds against the baselines; write a report."
    evaluate = commands.add_parser("evaluate-policy", help=text, description=text, parents=[common])
    evaluate.add_argument(
        "file",
        metavar="FILE",
        nargs="+",
        help=f"a policy.zip of train, {policy.SHIPPED!r} for the one that comes with the id, or the name of a baseline",
    )
    _env(evaluate)
    _evaluation(evaluate, "evaluation")
    evaluate.add_argument(
        "--friction", metavar="LAW", type=Friction, help=f"{FRICTION} (default: that of the training)"
    )
    evaluate.set_defaults(function=_evaluate)

    text = "Take a policy that was trained on one friction law to every other law; write the table."
    shift = commands.add_parser("friction-shift", help=text, description=text, parents=[common])
    shift.add_argument("file", metavar="FILE", help=f"a policy.zip of train; {policy.SHIPPED!r} with --env ID")
    shift.add_argument("--env", metavar="ID", help="whose shipped policy is meant")
    _evaluation(shift, "shift")
    shift.add_argument(
        "--friction",
        metavar="LAW",
        type=Friction,
        nargs="+",
        help=f"{FRICTION}; default: {', '.join(friction.available())}",
    )
    shift.set_defaults(function=_shift)


def _env(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--env", metavar="ID", required=True, help=", ".join(REGISTERED))


def _evaluation(parser: argparse.ArgumentParser, out: str) -> None:
    parser.add_argument("--episodes", metavar="N", type=int, default=200, help="default 200")
    parser.add_argument("--out", metavar="DIR", default=out, help=f"replaced as a whole (default {out})")


def _train(args: argparse.Namespace) -> None:
    from experiments.training import Training  # brings torch

    policy.check_id(args.env)
    out = Path(args.out)
    run = Training(args.env, args.algo, out, seed=args.seed, resume=args.resume, friction=args.friction)
    with progress("training") as notify:
        run.run(None if args.steps else args.minutes or 15.0, args.steps, notify)
    made = {**policy.conditions({"settings": run.settings}), "friction": args.friction.parameters}
    path = out / "policy.zip"
    controllers = {"policy": policy.load(path)}
    _report(args.env, controllers, args.episodes, out / "report", made, policy.learning_curves(path))


def _report(
    env_id: str,
    controllers: Mapping[str, policy_report.Maker],
    episodes: int,
    out: Path,
    made: dict[str, Any],
    curves: dict[str, Path],
) -> None:
    """Evaluate controllers and the baselines, print the table, write the report."""
    controllers = {**controllers, **{k: v for k, v in policy_report.baselines(env_id).items() if k not in controllers}}
    with progress("evaluating") as notify:
        found = policy_report.evaluate(env_id, controllers, episodes, notify, **made)
    print_estimates(found.values, found.units, f"{env_id}, {episodes} held-out episodes")
    policy_report.write(out, found, controllers, curves)
    print(out / "index.html")


def _evaluate(args: argparse.Namespace) -> None:
    policy.check_id(args.env)
    known = policy_report.baselines(args.env)
    controllers: dict[str, policy_report.Maker] = {}
    made: dict[str, Any] = {}
    paths: list[Path] = []
    for name in args.file:
        if name in known:
            controllers[name] = known[name]
        elif name == policy.SHIPPED or name.endswith(".zip"):
            path = policy.shipped(args.env) if name == policy.SHIPPED else Path(name)
            about = policy.about(path)
            own = {**policy.conditions(about), "friction": Friction(about["friction"]).parameters}
            if made and str(own) != str(made):
                raise ValueError(f"{path} was trained under other conditions than {paths[0]}")
            made = own
            paths.append(path)
            controllers["policy" if len(args.file) == 1 else path.parent.name or str(path)] = policy.load(path)
        else:
            raise ValueError(f"{name!r} is neither a policy.zip nor a baseline of {args.env}: {', '.join(known)}")
    if len(controllers) < len(args.file):
        raise ValueError("policies are told apart by the names of their directories, of which two are alike")
    if args.friction:
        made["friction"] = args.friction.parameters
    curves = {name: file for path in paths for name, file in policy.learning_curves(path).items()}
    _report(args.env, controllers, args.episodes, Path(args.out), made, curves)


def _shift(args: argparse.Namespace) -> None:
    if args.file == policy.SHIPPED and args.env is None:
        raise ValueError("--env tells whose shipped policy is meant")
    path = policy.shipped(args.env) if args.file == policy.SHIPPED else Path(args.file)
    about = policy.about(path)
    laws = args.friction or [Friction(name) for name in friction.available()]
    with progress("evaluating") as notify:
        found = friction_shift.collect(path, laws, args.episodes, notify)
    for law, values in found.values.items():
        print_estimates(values, found.units, f"{about['env']}, trained on {found.trained}, on {law}")
    friction_shift.write(Path(args.out), found)
    print(Path(args.out) / "index.html")
