"""The table of scores, and the reward thresholds that come from it."""

import json
import re
from pathlib import Path

import gymnasium as gym
import pytest

from steer_env import assists, drivers
from steer_env.experiments.learning.held_out import Estimate
from steer_env.experiments.learning.training import Training
from steer_env.experiments.pages.options import Friction
from steer_env.friction.numerics import toml
from steer_env.registration import REGISTERED
from tests.maintain.__main__ import run as maintain
from tests.tools import scores

RELEASE, TUNE = "steer_env/AssistRelease-v4", "steer_env/TuneOnCentre-v3"


def _score(reward, trained=False):
    return scores.Score({"reward": Estimate(reward, reward, reward)}, {}, trained)


@pytest.mark.whole
def test_one_command_prints_the_page_and_writes_the_thresholds(tmp_path, capsys):
    run = Training(RELEASE, None, tmp_path / "seed-0", friction=Friction("lugre"))
    run.settings["algorithm"] |= {"num_envs": 4, "n_steps": 16, "batch_size": 64}
    run.run(steps=64)
    page, thresholds = tmp_path / "scores.md", tmp_path / "thresholds.json"
    thresholds.write_text(json.dumps({"other": 1.0, RELEASE: 5.0}))
    command = ["scores", "--env", RELEASE, TUNE, "--episodes", "2", "--policies", str(tmp_path)]
    assert maintain([*command, "--out", str(page), "--thresholds", str(thresholds)]) == 0
    printed = capsys.readouterr()
    assert page.read_text(encoding="utf-8") == printed.out
    assert "policy.zip is not shipped" in printed.err
    for name in ("zero", "random", "lqg", "active return", "policy, seed-0"):
        assert f"\n| {name} | " in printed.out
    assert re.search(
        r"\| policy, seed-0 \|.*10 N m \| 10 ms \|.*the observations; trained with load .*, friction lugre", printed.out
    )
    found = json.loads(thresholds.read_text())
    assert found["other"] == 1.0
    assert found[RELEASE] != 5.0
    assert f"`reward_threshold`: {found[RELEASE]:g}." in printed.out
    assert TUNE not in found  # which has no baseline


def test_the_threshold_is_the_best_baseline():
    found = {"zero": _score(9.0), "one": _score(2.3456), "other": _score(1.0), "policy": _score(8.0, True)}
    made = scores.Scores("id", "", {}, found, {}, {})
    assert scores.threshold(made) == 2.34
    assert scores.threshold(made._replace(scores={"one": _score(-2.3456)})) == -2.35
    assert scores.threshold(made._replace(scores={"zero": _score(9.0), "policy": _score(812.34, True)})) == 812.0
    assert scores.threshold(made._replace(scores={"zero": _score(9.0)})) is None


def test_a_policy_of_the_librarys_defaults_has_its_gap_to_the_best_baseline(tmp_path):
    parking = "steer_env/DriverParking-v3"
    run = Training(parking, None, tmp_path / "plain", library=True)
    assert run.settings["environment"] == {"control_dt": 0.05}
    run.settings["algorithm"] |= {"num_envs": 2, "n_steps": 16, "batch_size": 32}
    run.run(steps=32)
    (found,) = scores.collect([parking], 2, {parking: [tmp_path / "plain" / "policy.zip"]})
    baseline, gap = found.gaps["policy, plain"]
    values = {name: score.values["reward"].value for name, score in found.scores.items()}
    assert baseline == "angle_servo"
    assert gap.value == pytest.approx(values["policy, plain"] - values["angle_servo"])
    page = scores.markdown([found], 2)
    assert "Trained with Stable-Baselines3's own defaults (policy, plain): " in page
    assert " short of angle servo." in page
    assert re.search(r"Stable-Baselines3's own defaults, best by validation at step \d+ \|", page)


@pytest.mark.whole
def test_a_task_with_scenarios_has_a_table_of_them():
    (found,) = scores.collect(["steer_env/AssistAllRound-v3"], 2)
    assert list(found.scenarios) == ["weave", "release", "parking", "lane change"]
    assert all(set(by) == set(found.scores) for by in found.scenarios.values())
    assert found.scenarios["release"]["zero"].value < 9.0 < found.scenarios["weave"]["zero"].value  # of 9 and 20 s
    assert "| controller | weave | release | parking | lane change |" in scores.markdown([found], 2)


def test_every_controller_states_its_terms():
    told = toml.loads(scores.TOLD.read_text(encoding="utf-8"))
    names = {"zero", "random", *assists.available(), *drivers.available()} - {"free"}
    assert names <= set(told)
    assert all(set(entry) <= set(scores.TERMS) and entry["information"] for entry in told.values())


def test_the_ids_have_the_thresholds_of_the_page():
    page = (Path(__file__).parents[2] / "docs" / "scores.md").read_text(encoding="utf-8")
    for env_id in REGISTERED:
        section = page.partition(f"## `{env_id}`")[2].partition("\n## ")[0]
        assert "| zero |" in section
        solved = gym.spec(env_id).reward_threshold
        assert ("`reward_threshold`" in section) == (solved is not None)
        assert solved is None or f"`reward_threshold`: {solved:g}." in section


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--env", "steer_env/Nothing-v1"], "unknown environment 'steer_env/Nothing-v1'"),
        (["--episodes", "1"], "must be a whole number of at least 2"),
        (["--policies", "."], "holds no policy.zip"),
    ],
)
def test_bad_commands(options, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    try:
        code = maintain(["scores", *options])
    except SystemExit as end:
        code = end.code
    assert code == 2
    assert re.search(message, capsys.readouterr().err)
