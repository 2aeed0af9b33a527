"""What the commands that evaluate policies share."""

import argparse
import sys
from collections.abc import Collection, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from steer_env.experiments.cli.common import inputs
from steer_env.experiments.cli.common.options import SHIPPED
from steer_env.friction.numerics.extras import install

if TYPE_CHECKING:
    from steer_env.experiments.sweep import Runner


def env_id_of(given: str | None, controllers: Sequence[str]) -> str:
    """The id that ``--env`` gives, or else that of the first policy.zip among the controllers.

    Raises
    ------
    ValueError
        Where neither is given, or a controller is a folder.
    """
    from steer_env.experiments.learning import policy
    from steer_env.experiments.learning.controllers import SIMPLE, is_policy
    from steer_env.experiments.learning.controllers import baselines as of_id

    own = next((name for name in controllers if is_policy(name) and name != SHIPPED), None)
    known: Collection[str] = SIMPLE if given is None else {**SIMPLE, **of_id(given)}
    folder = next((name for name in controllers if name not in known and Path(name).is_dir()), None)
    if folder is not None:
        raise ValueError(f"{folder} is a folder: give the policy.zip in it")
    if given is None and own is None:
        raise ValueError("--env must name the environment where no policy.zip is given")
    return given or str(policy.read_description(Path(str(own)))["env"])


def caution(path: Path, about: Mapping[str, Any]) -> None:
    """Say on standard error that a policy file is code, unless it is a shipped one; to be called before loading it."""
    from steer_env.experiments.learning import policy

    if text := policy.caution(path, about):
        print(f"steer-env: caution: {text}", file=sys.stderr)


def trace(args: argparse.Namespace, made: Mapping[str, Any]) -> dict[str, Any]:
    """The trace of an evaluation with these arguments of the environment."""
    from steer_env.experiments.pages import provenance
    from steer_env.friction import resolve
    from steer_env.friction.sites import friction_name
    from steer_env.vehicle import cars

    car = cars.load(made.get("vehicle", "compact"))
    law = resolve(made.get("friction") or car.friction)
    laws = {friction_name(law): law}
    name = args.out.name
    return provenance.trace(command=args.argv, result=name, car=car, friction=laws, inputs=inputs.trace_inputs(args))


def evaluate_and_report(
    args: argparse.Namespace,
    env_id: str,
    controllers: Mapping[str, Any],
    out: Path,
    made: dict[str, Any],
    curves: dict[str, Path],
    sweep: "Runner | None" = None,
) -> None:
    """Evaluate controllers beside the baselines of an id, print the table and write the report.

    Parameters
    ----------
    args : Namespace
        Options of the command: ``episodes``, the number of held-out ones, and the words for the trace.
    env_id : str
    controllers : mapping
        Label -> callable that makes a controller for an environment; the first is the one that is evaluated.
    out : Path
        Directory of the report.
    made : dict
        Arguments of ``gymnasium.make_vec``.
    curves : dict
        Label -> file of a learning curve.
    sweep : Runner, optional
        What runs the evaluations; this process by default.
    """
    from steer_env.experiments.cli.common.tables import print_estimates
    from steer_env.experiments.learning import policy_report
    from steer_env.experiments.learning.controllers import baselines
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.sweep import run

    if find_spec("pygame") is None:
        print(f"steer-env: no pictures of episodes, which need pygame: {install('render')}", file=sys.stderr)
    controllers = {**controllers, **{k: v for k, v in baselines(env_id).items() if k not in controllers}}
    with progress("evaluating") as notify:
        found = policy_report.evaluate(env_id, controllers, args.episodes, notify, sweep=sweep or run, **made)
    words = "".join(f", {name} {value}" for name, value in policy_report.conditions(made).items())
    print_estimates(found.values, found.units, f"{env_id}, {args.episodes} held-out episodes{words}")
    policy_report.write(out, found, controllers, curves, trace(args, made))
    print(out / "index.html")
