"""The options of the baseline assists that a search has found for each assist task, and the baselines with them."""

import json
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from steer_env import assists, experiments
from steer_env.experiments.pages.files import write_json

FILE = Path(experiments.__file__).parent / "data" / "baselines" / "assists.json"


def _kept(path: Path) -> dict[str, dict[str, dict[str, Any]]]:
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def keep(env_id: str, found: Mapping[str, dict[str, Any]], path: Path = FILE) -> None:
    """Put what searches for an id have found, by baseline, into a file; what it has of other searches stays."""
    every = _kept(path)
    every[env_id] = {**every.get(env_id, {}), **found}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, dict(sorted(every.items())))


def options(env_id: str, path: Path = FILE) -> dict[str, dict[str, float]]:
    """The options that a search has found for an id, by baseline; empty without a search."""
    return {name: found["options"] for name, found in _kept(path).get(env_id, {}).items()}


def makers(env_id: str, path: Path = FILE) -> dict[str, Any]:
    """Every baseline assist by name as a maker (env -> controller), with the options found for an id."""
    found = options(env_id, path)
    return {name: partial(assists.make, name, **found.get(name, {})) for name in assists.available()}
