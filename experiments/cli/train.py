"""The commands ``train``, ``evaluate-policy`` and ``friction-shift``."""

import argparse
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from steer_env import assists, drivers, friction
from steer_env.experiments.cli.tables import print_estimates, print_laws
from steer_env.experiments.learning import friction_shift, held_out, policy, policy_report
from steer_env.experiments.output.files import usable
from steer_env.experiments.output.options import FRICTION, Friction, progress
from steer_env.friction.numerics.check import number
from steer_env.registration import DRIVEN

EPISODES = held_out.VALIDATION - held_out.HELD_OUT  # beyond, seeds of the validation would come


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the commands to a parser's."""
    text = "Train a policy, keep the best by validation, and evaluate it against the baselines on other seeds."
    train = commands.add_parser("train", help=text, description=text, parents=[common])
    train.add_argument("--env", metavar="ID", required=True, help=", ".join(DRIVEN))
    kept = "default: that of the checkpoint, or else"
    train.add_argument("--algo", choices=policy.ALGORITHMS, help=f"{kept} ppo")
    length = train.add_mutually_exclusive_group()
    length.add_argument("--minutes", metavar="N", type=_minutes, help="wall time of all sessions together (default 15)")
    text = "steps of all lanes and all sessions together; can be repeated"
    length.add_argument("--steps", metavar="N", type=_whole(1), help=text)
    train.add_argument("--seed", metavar="N", type=_whole(0, 2**32 - 1), help=f"{kept} 0")
    train.add_argument("--friction", metavar="LAW", type=Friction, help=f"{FRICTION} ({kept} lugre)")
    train.add_argument("--resume", action="store_true", help="go on from the checkpoint in --out, with its settings")
    text = "of the evaluation (default 200)"
    train.add_argument("--episodes", metavar="N", type=_whole(1, EPISODES), default=200, help=text)
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
    text = f"default: that of the first policy.zip; {', '.join(DRIVEN)}"
    evaluate.add_argument("--env", metavar="ID", help=text)
    _evaluation(evaluate, "evaluation")
    evaluate.add_argument(
        "--friction", metavar="LAW", type=Friction, help=f"{FRICTION} (default: that of the training)"
    )
    evaluate.set_defaults(function=_evaluate)

    text = "Take a policy that was trained on one friction law to every other law; write the table."
    shift = commands.add_parser("friction-shift", help=text, description=text, parents=[common])
    shift.add_argument("file", metavar="FILE", help=f"a policy.zip of train; {policy.SHIPPED!r} with --env ID")
    shift.add_argument("--env", metavar="ID", help="whose shipped policy is meant; with a FILE, its own")
    _evaluation(shift, "shift")
    shift.add_argument(
        "--friction",
        metavar="LAW",
        type=Friction,
        nargs="+",
        help=f"{FRICTION}; default: {', '.join(friction.available())}, and those that fit a noisy record of the "
        "training's law, identified from it",
    )
    shift.set_defaults(function=_shift)


def _whole(least: int, most: float = math.inf) -> Callable[[str], int]:
    """What reads a whole number of a range."""

    def read(text: str) -> int:
        try:
            value = int(text)
            if least <= value <= most:
                return value
        except ValueError:
            pass
        upper = f" and at most {most:.0f}" if most < math.inf else ""
        raise argparse.ArgumentTypeError(f"must be a whole number of at least {least}{upper}, got {text!r}")

    return read


def _minutes(text: str) -> float:
    try:
        return number("minutes", text, minimum=0.0, above=True)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _evaluation(parser: argparse.ArgumentParser, out: str) -> None:
    parser.add_argument("--episodes", metavar="N", type=_whole(1, EPISODES), default=200, help="default 200")
    parser.add_argument("--out", metavar="DIR", default=out, help=f"replaced as a whole (default {out})")


def _train(args: argparse.Namespace) -> None:
    from steer_env.experiments.learning.training import Training  # brings torch

    out = Path(args.out)
    run = Training(args.env, args.algo, out, seed=args.seed, resume=args.resume, friction=args.friction)
    usable(out / "report", policy_report.CONTENTS)
    with progress("training") as notify:
        run.run(None if args.steps else args.minutes or 15.0, args.steps, notify)
    made = {**policy.conditions({"settings": run.settings}), "friction": run.friction.parameters}
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
    files = [name for name in args.file if name == policy.SHIPPED or name.endswith(".zip")]
    own = next((name for name in files if name != policy.SHIPPED), None)
    if args.env is None and own is None:
        raise ValueError("--env must tell the environment where no policy.zip does")
    env_id = args.env or policy.about(Path(own))["env"]  # type: ignore[arg-type]
    policy.check_driven(env_id)
    usable(Path(args.out), policy_report.CONTENTS)
    known = policy_report.baselines(env_id)
    controllers: dict[str, policy_report.Maker] = {}
    made: dict[str, Any] = {}
    words: dict[str, str] = {}
    paths: dict[str, Path] = {}
    for name in args.file:
        if name not in files and name not in known:
            raise ValueError(f"{name!r} is neither a policy.zip nor a baseline of {env_id}: {', '.join(known)}")
        label, make = name, known.get(name)
        if make is None:
            path = policy.shipped(env_id) if name == policy.SHIPPED else Path(name)
            about = policy.about(path)
            policy.check_observations(path, about, env_id)
            law = args.friction or policy.law(about["friction"], path)
            found = policy_report.conditions({**policy.conditions(about), "friction": law.label})
            if paths:
                _check_same(next(iter(paths.values())), words, path, found)
            made, words = {**policy.conditions(about), "friction": law.parameters}, found
            label = "policy" if len(files) == 1 else path.resolve().parent.name
            make = policy.load(path)
            if label in known:
                raise ValueError(f"{path} lies in a directory with the name of a baseline, {label}: rename it")
            if label in paths:
                raise ValueError(
                    f"policies are told apart by the names of their directories, and {label!r} comes twice: rename one"
                )
            paths[label] = path
        elif label in controllers:
            raise ValueError(f"{label!r} is given twice: give it once")
        controllers[label] = make
    if args.friction:
        made["friction"] = args.friction.parameters
    curves = {
        title: file for label, path in paths.items() for title, file in policy.learning_curves(path, label).items()
    }
    _report(env_id, controllers, args.episodes, Path(args.out), made, curves)


def _check_same(first: Path, words: Mapping[str, str], second: Path, others: Mapping[str, str]) -> None:
    """ValueError where two policies were trained under other conditions, with the first of these."""
    for name in {**words, **others}:
        one, other = words.get(name, "the usual one"), others.get(name, "the usual one")
        if one != other:
            mend = "give --friction LAW to compare them on one law" if name == "friction" else "evaluate each by itself"
            raise ValueError(f"{first} was trained with {name} {one}, {second} with {name} {other}: {mend}")


def _shift(args: argparse.Namespace) -> None:
    if args.file in (*assists.available(), *drivers.available()):
        raise ValueError(f"{args.file!r} is a baseline, which no law trained: it cannot be shifted; give a policy.zip")
    if args.file != policy.SHIPPED and not args.file.endswith(".zip"):
        raise ValueError(f"{args.file!r} is no policy: give a policy.zip of train, or {policy.SHIPPED!r} with --env ID")
    if args.file == policy.SHIPPED and args.env is None:
        raise ValueError("--env tells whose shipped policy is meant")
    path = policy.shipped(args.env) if args.file == policy.SHIPPED else Path(args.file)
    about = policy.about(path)
    if args.env not in (None, about["env"]):
        raise ValueError(f"{path} was trained for {about['env']}, not {args.env}: leave --env away")
    usable(Path(args.out), friction_shift.CONTENTS)
    laws = args.friction or [
        *(Friction(name) for name in friction.available()),
        *friction_shift.identified(policy.law(about["friction"], path)),
    ]
    with progress("evaluating") as notify:
        found = friction_shift.collect(path, laws, args.episodes, notify)
    aim = policy_report.aim(found.units)
    title = (
        f"{found.env_id}, trained on {found.trained}, {args.episodes} held-out episodes, mean ± half the 95 % interval"
    )
    print_laws(found.values, found.lost, aim, found.units, title)
    friction_shift.write(Path(args.out), found)
    print(Path(args.out) / "index.html")
