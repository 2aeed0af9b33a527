"""Learning curves of the shipped policies, docs/learning.svg: every seed that was tried.

python -m experiments.learning_picture
"""

from pathlib import Path

from experiments import policy
from experiments.figures import learning
from experiments.policy_report import aim, read_curve
from steer_env import tasks
from steer_env.ids import VERSION

if __name__ == "__main__":
    shown = {}
    for folder in sorted(policy.SHIPPED_IN.iterdir()):
        runs = {f.stem.replace("-", " "): read_curve(f) for f in sorted(folder.glob("seed-*.csv"))}
        name = aim(next(iter(runs.values())))
        unit = {f.name: f.unit for f in tasks.task(folder.name.removesuffix(f"-{VERSION}")).figures}[name]
        shown[folder.name] = (
            f"{name.replace('_', ' ')} [{unit}]",
            {label: {**run, "figure": run[name]} for label, run in runs.items()},
        )
    Path("docs/learning.svg").write_text(learning(shown), encoding="utf-8")
