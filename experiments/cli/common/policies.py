"""What the commands that evaluate policies share."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from steer_env.experiments.sweep import Runner


def caution(path: Path, about: Mapping[str, Any]) -> None:
    """Say on standard error that a policy file is code, unless it is a shipped one; to be called before loading it."""
    from steer_env.experiments.learning import policy

    if text := policy.caution(path, about):
        print(f"steer-env: caution: {text}", file=sys.stderr)


def evaluate_and_report(
    env_id: str,
    controllers: Mapping[str, Any],
    episodes: int,
    out: Path,
    made: dict[str, Any],
    curves: dict[str, Path],
    sweep: "Runner | None" = None,
) -> None:
    """Evaluate controllers beside the baselines of an id, print the table and write the report.

    Parameters
    ----------
    env_id : str
    controllers : mapping
        Label -> callable that makes a controller for an environment; the first is the one that is evaluated.
    episodes : int
        Held-out episodes.
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
    from steer_env.experiments.output.options import progress
    from steer_env.experiments.sweep import run

    controllers = {**controllers, **{k: v for k, v in baselines(env_id).items() if k not in controllers}}
    with progress("evaluating") as notify:
        found = policy_report.evaluate(env_id, controllers, episodes, notify, sweep=sweep or run, **made)
    print_estimates(found.values, found.units, f"{env_id}, {episodes} held-out episodes")
    policy_report.write(out, found, controllers, curves)
    print(out / "index.html")
