"""Files of a training run, consistent at every moment at which the process may be killed.

Model and scaling of a checkpoint are named by their step, and ``state.json``, which a rename replaces, says which of
them count. The curve is replaced as a whole. The best policy is replaced by a rename after its row stands in the curve,
so that its reward is that of its own step there. A checkpoint comes before each validation: no row is ahead of the
checkpoint, and the time of a resumed run does not run back.
"""

import csv
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from steer_env.experiments.learning import policy
from steer_env.experiments.pages.files import write_json, write_text

FOLDER, STATE, CURVE, BEST = "checkpoint", "state.json", "learning.csv", "policy.zip"
KEYS = ("env", "algo", "seed", "friction", "seconds", "steps", "model", "scaling")


def save(out: Path, state: Mapping[str, Any], model: Any, scaling: Any) -> None:
    """Write what resuming needs; ``state`` has the entries of ``KEYS`` but for the two file names."""
    folder = out / FOLDER
    folder.mkdir(exist_ok=True)
    names = {"model": f"model-{state['steps']}.zip", "scaling": f"scaling-{state['steps']}.pkl"}
    if not (folder / STATE).is_file() or load(out)["steps"] != state["steps"]:  # else these files are in use, and right
        model.save(folder / names["model"], exclude=policy.SCHEDULE)
        scaling.save(str(folder / names["scaling"]))
    write_json(folder / STATE, {**state, **names})
    for path in folder.iterdir():
        if path.name not in (STATE, *names.values()):
            path.unlink()


def load(out: Path) -> dict[str, Any]:
    """State of a run at its checkpoint; ValueError if there is none or something is missing."""
    kept = out / FOLDER / STATE
    if not kept.is_file():
        raise ValueError(f"{out} holds no checkpoint to resume")
    state = json.loads(kept.read_text(encoding="utf-8"))
    for key in KEYS:
        if key not in state:
            raise ValueError(f"{kept} has no entry {key}, as with older versions: train from the start")
    return state


def append(out: Path, row: Mapping[str, Any]) -> None:
    """Add a row to the curve."""
    path, text = out / CURVE, io.StringIO(newline="")
    writer = csv.DictWriter(text, row, lineterminator="\n")
    if not path.exists():
        writer.writeheader()
    writer.writerow(row)
    write_text(path, (path.read_text(encoding="utf-8") if path.exists() else "") + text.getvalue())


def best(out: Path) -> float:
    """Reward of the best policy when it was validated; minus infinity where there is none yet."""
    if not (out / BEST).is_file():
        return -np.inf
    steps = policy.about(out / BEST)["steps"]
    with (out / CURVE).open(encoding="utf-8", newline="") as file:
        return max(float(row["reward"]) for row in csv.DictReader(file) if int(row["steps"]) == steps)
