"""Pages drawn from the one place that defines their content: docs/metrics.md and docs/environments.md.

python -m experiments.glossary
"""

import inspect
from collections.abc import Callable
from pathlib import Path

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator

from steer_env import REGISTERED, manoeuvres, metrics
from steer_env.env import SteerEnv

DOCS = Path(__file__).parents[1] / "docs"
_METRICS = """# Tests and metrics

Written by `python -m experiments.glossary` from the definitions in `steer_env/manoeuvres/` and `steer_env/metrics/`; no
conformance with any standard is claimed. A value is the mean over the repeats of a recording (cycles, steps, sweeps,
segments), with a 95 % interval where there are several. What a recording cannot carry is refused with a reason. Usual
ranges are for passenger cars, engineering judgement.
"""
_ENVIRONMENTS = """# Environments

Written by `python -m experiments.glossary` from the tasks in `steer_env/tasks/`. `import steer_env` registers the ids;
`gymnasium.make(id)` makes one, `gymnasium.make_vec(id, num_envs=N)` many in one. Every id takes the arguments that are
listed at the end.
"""


def metrics_page() -> str:
    """Tests and metrics as Markdown."""
    parts = [_METRICS]
    for test in metrics.tests():
        about = manoeuvres.make(test) if test in manoeuvres.available() else None
        parts.append(f"\n## {test}\n")
        if about:
            parts.append(f"{about.definition} {about.source[0].upper()}{about.source[1:]}.\n")
        parts.append("| metric | unit | definition | usual | source |\n|---|---|---|---|---|")
        for name in metrics.available(test):
            entry = metrics.definition(name)
            usual = f"{entry.usual[0]:g} to {entry.usual[1]:g}" if entry.usual and test == "weave" else ""
            text = entry.definition.replace("+-", "±").replace("|", "\\|")
            parts.append(f"| `{name}` | {entry.unit} | {text} | {usual} | {entry.source} |")
    return "\n".join(parts) + "\n"


def _documentation(name: str) -> str:
    entry_point = gym.spec(name).entry_point
    assert isinstance(entry_point, str)
    return (load_env_creator(entry_point).__doc__ or "").strip()


def environments_page() -> str:
    """Every id with its tables as Markdown."""
    sections = [_ENVIRONMENTS, *(f"- [`{name}`](#{_anchor(name)})" for name in REGISTERED)]
    for name in REGISTERED:
        sections.append(f"\n## `{name}`\n\n" + _documentation(name).replace("\n## ", "\n### "))
    sections.append(f"\n## Arguments\n\n```text\n{inspect.getdoc(SteerEnv)}\n```")
    return "\n".join(sections) + "\n"


def _anchor(name: str) -> str:
    """Of a heading, as GitHub makes it."""
    return name.lower().replace("/", "")


PAGES: dict[Path, Callable[[], str]] = {DOCS / "metrics.md": metrics_page, DOCS / "environments.md": environments_page}

if __name__ == "__main__":
    for path, page in PAGES.items():
        path.write_text(page(), encoding="utf-8")
