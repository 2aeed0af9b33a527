"""Draw docs/learning.svg, the learning curves of the shipped policies with every seed that was tried.

python -m steer_env.experiments.learning.learning_picture
"""

from pathlib import Path

from steer_env import tasks
from steer_env.experiments.learning import policy
from steer_env.experiments.learning.policy_report import aim, read_curve
from steer_env.experiments.pages.pictures import LearningCurves, learning

if __name__ == "__main__":
    shown = {}
    for folder in sorted(policy.SHIPPED_IN.iterdir()):
        runs = {f.stem.replace("-", " "): read_curve(f) for f in sorted(folder.glob("seed-*.csv"))}
        name = aim(next(iter(runs.values())))
        unit = {f.name: f.unit for f in tasks.task(folder.name.rpartition("-")[0]).metrics}[name]
        shown[folder.name] = LearningCurves(f"{name.replace('_', ' ')} [{unit}]", name, runs)
    Path("docs/learning.svg").write_text(learning(shown), encoding="utf-8")
