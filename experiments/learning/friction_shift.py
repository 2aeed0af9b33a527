"""Friction shift: a policy that was trained on one friction law, evaluated on every other law beside the baselines."""

from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction
from steer_env.experiments.learning import held_out, policy, policy_report
from steer_env.experiments.learning.constants import HELD_OUT
from steer_env.experiments.learning.held_out import Estimate
from steer_env.experiments.output import provenance
from steer_env.experiments.output.files import replaced_directory, write_json
from steer_env.experiments.output.options import Friction
from steer_env.experiments.output.pages import environment
from steer_env.friction.law import law_of

CONTENTS = frozenset({"index.html", "shift.json"})


# The record from which laws are identified: slow sweeps of a steering system in a rig, the widest first; assumed.
AMPLITUDES, PERIOD, SAMPLE, NOISE = (3.0, 3.0, 1.0, 0.5), 20.0, 0.01, 0.02  # [deg], [s], [s], [N m]
FITS = 2.0 * NOISE  # residual above which a law does not describe the record [N m]


class Labelled(NamedTuple):
    """A law with its parameters, as :class:`steer_env.experiments.output.options.Friction`."""

    label: str
    parameters: Any


class Shift(NamedTuple):
    """The same held-out episodes on every law."""

    env_id: str
    trained: str  # law of the training
    episodes: int
    values: dict[str, dict[str, dict[str, Estimate]]]  # law -> controller -> metric
    lost: dict[str, Estimate]  # law -> the policy's reward less its reward on the law of the training, paired by seed
    gained: dict[str, dict[str, Estimate]]  # law -> baseline -> the policy's reward less the baseline's
    units: dict[str, str]
    conditions: dict[str, str]  # other than the law, in words


def identified(home: Friction) -> list[Labelled]:
    """Laws identified from a noisy quasi-static record of ``home``: those that describe it, with their parameters."""
    phase = 2.0 * np.pi * np.arange(0.0, 1.0, SAMPLE / PERIOD)
    x = np.concatenate([np.radians(amplitude) * np.sin(phase) for amplitude in AMPLITUDES])
    torque = friction.response(home.parameters, x, SAMPLE) + np.random.default_rng(0).normal(0.0, NOISE, x.size)
    fits = [
        friction.fit(x, torque, name, dt=SAMPLE)
        for name in friction.available()
        if law_of(friction.make(name)).fitted  # a law that is not fitted has no parameters to identify
    ]
    return [Labelled(f"{found.law}, identified", found.parameters) for found in fits if found.residual < FITS]


def collect(
    path: Path,
    laws: Sequence[Friction | Labelled],
    episodes: int,
    notify: Callable[[float, str], None] = lambda *_: None,
) -> Shift:
    """Evaluate the policy and every baseline of its id on the law of the training and on other laws."""
    about = policy.about(path)
    env_id, home = about["env"], policy.law(about["friction"], path)
    controllers: dict[str, Any] = {"policy": policy.load(path), **policy_report.baselines(env_id)}
    chosen: dict[str, Friction | Labelled] = {law.label: law for law in (home, *laws)}
    found: dict[str, policy_report.Evaluation] = {}
    for k, (label, law) in enumerate(chosen.items()):
        notify(k / len(chosen), label)
        made = {**policy.conditions(about), "friction": law.parameters}
        found[label] = policy_report.evaluate(env_id, controllers, episodes, **made)
    own = found[home.label].found["policy"].reward
    return Shift(
        env_id,
        home.label,
        episodes,
        {label: each.values for label, each in found.items()},
        {label: held_out.mean(each.found["policy"].reward - own) for label, each in found.items()},
        {label: {name: gaps["reward"] for name, gaps in each.gaps.items()} for label, each in found.items()},
        found[home.label].units,
        policy_report.conditions(policy.conditions(about)),
    )


def as_json(found: Shift) -> dict[str, Any]:
    """The table as JSON."""
    return {
        "env": found.env_id,
        "trained": found.trained,
        "episodes": found.episodes,
        "first_seed": HELD_OUT,
        "laws": {
            law: {
                "metrics": {
                    name: {metric: policy_report.entry(e, found.units[metric]) for metric, e in values.items()}
                    for name, values in controllers.items()
                },
                "lost": policy_report.entry(found.lost[law], ""),
                "gained": {name: policy_report.entry(e, "") for name, e in found.gained[law].items()},
            }
            for law, controllers in found.values.items()
        },
        "provenance": provenance.versions(),
    }


def write(out: Path, found: Shift) -> None:
    """Write ``index.html`` and ``shift.json`` into a directory, which appears or is replaced as a whole."""
    page = (
        environment(__package__)
        .get_template("shift.html.j2")
        .render(
            f=found,
            names=list(found.values[found.trained]),
            conditions=found.conditions,
            shade=policy_report.shade,
            version=metadata.version("steer-env"),
            first_seed=HELD_OUT,
        )
    )
    with replaced_directory(out, CONTENTS) as part:
        (part / "index.html").write_text(page, encoding="utf-8")
        write_json(part / "shift.json", as_json(found))
