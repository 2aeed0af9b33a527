"""The example of offline learning, in short: what it learns enters the benchmark."""

from importlib import import_module
from pathlib import Path

import pytest

pytest.importorskip("tianshou")
pytest.importorskip("minari")

from steer_env.experiments.cli.main import main
from steer_env.experiments.learning import benchmark, controllers

EXAMPLE = Path(__file__).parents[2] / "examples" / "learn_offline.py"
KEEPING, PARKING = "steer_env/DriverLaneKeeping-v3", "steer_env/DriverParking-v3"


def _reward(make, env_id):
    drive = benchmark.Drive(env_id, controllers.reference(env_id))
    return benchmark.run_episodes(benchmark.Case("", drive, make, (1_000_000, 1_000_001))).reward.mean()


def test_what_is_learned_enters_the_benchmark(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["policy", "record", "--env", KEEPING, "--quality", "good", "--episodes", "4", "--out", "set"]) == 0
    suite = benchmark.suite("drivers")
    entries = {name: benchmark.entry(f"{EXAMPLE}:{name}", suite).makers for name in ("Cloning", "TD3BC", "CQL")}
    nothing = {env_id: _reward(controllers.ZeroAction, env_id) for env_id in (KEEPING, PARKING)}
    import_module(EXAMPLE.stem).main(Path("set"), steps=400)
    rewards = {name: _reward(makers[KEEPING], KEEPING) for name, makers in entries.items()}
    assert rewards["Cloning"] > 2.0 * nothing[KEEPING]
    assert all(reward != nothing[KEEPING] for reward in rewards.values())
    assert _reward(entries["CQL"][PARKING], PARKING) == nothing[PARKING]
