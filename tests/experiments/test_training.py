"""Training, its files, its evaluation and its commands, in runs of seconds."""

import csv
import json
import re
import shutil
import subprocess
import sys
import zipfile
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
import stable_baselines3

from steer_env import assists
from steer_env.experiments.cli.main import main
from steer_env.experiments.learning import assist_suite, held_out, policy, policy_report, shift, training
from steer_env.experiments.learning.constants import SHIFTS
from steer_env.experiments.learning.training import Training, settings
from steer_env.experiments.pages.options import Friction
from steer_env.registration import id_of
from steer_env.vehicle import cars

WEAVE, ON_CENTRE = "steer_env/AssistWeave-v3", "steer_env/DriverOnCentre-v3"
LUGRE = Friction("lugre")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A run of a few thousand steps."""
    out = tmp_path_factory.mktemp("training") / "run"
    Training(WEAVE, "ppo", out, seed=1, friction=LUGRE).run(steps=8192)
    return out


def test_a_run_leaves_policy_curve_checkpoint_and_settings(trained):
    about = policy.read_description(trained / "policy.zip")
    assert (about["env"], about["algorithm"], about["seed"], about["friction"]) == (WEAVE, "ppo", 1, "lugre")
    with (trained / "learning.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["steps"]) < 100
    assert float(rows[-1]["steps"]) >= 8192
    assert {"reward", "cost", "rms_feel_error"} <= rows[0].keys()
    assert json.loads((trained / "settings.json").read_text())["environment"]["randomise"]["load"] == [0, 300]
    assert len(list((trained / "checkpoint").glob("model-*.zip"))) == 1
    assert any((trained / "tensorboard").rglob("events*"))


def test_the_same_seed_and_steps_train_the_same_policy(tmp_path):
    weights = []
    for seed in (1, 1, 2):
        run = Training(WEAVE, "ppo", tmp_path / f"run{len(weights)}", seed=seed, friction=LUGRE)
        run.settings["algorithm"] |= SMALL
        run.run(steps=128)
        with zipfile.ZipFile(run.out / "policy.zip") as archive:
            weights.append(archive.read("policy.pth"))
    assert weights[0] == weights[1] != weights[2]


def test_a_policy_acts_alike_in_single_and_vector_environments(trained):
    path = trained / "policy.zip"
    single, vector = gym.make(WEAVE), gym.make_vec(WEAVE, num_envs=3)
    one, many = policy.Policy(path, single), policy.Policy(path, vector)
    observations, _ = vector.reset(seed=0)
    observation, _ = single.reset(seed=1)
    actions = many.act(observations)
    assert actions.shape == (3, 1)
    assert one.act(observation) == pytest.approx(actions[1], abs=1e-6)
    assert np.abs(actions).max() <= 1.0


def test_a_policy_acts_alike_on_normalised_observations(trained):
    actions = {}
    for normalise in (False, True):
        env = gym.make(WEAVE, normalise=normalise)
        found = policy.Policy(trained / "policy.zip", env)
        observation, _ = env.reset(seed=1)
        actions[normalise] = [found.act(observation)]
        for _ in range(20):
            observation, *_ = env.step(np.array([0.3], np.float32))
            actions[normalise].append(found.act(observation))
    np.testing.assert_allclose(actions[True], actions[False], atol=1e-5)
    assert np.ptp(actions[False]) > 1e-3


def test_a_policy_holds_its_action_between_its_own_steps(tmp_path):
    env_id = "steer_env/DriverDoubleLaneChange-v3"
    Training(env_id, "ppo", tmp_path / "run", friction=LUGRE).run(steps=2)
    path = tmp_path / "run" / "policy.zip"
    vector = gym.make_vec(env_id, num_envs=2, control_dt=0.01)
    found = policy.Policy(path, vector)
    found.reset()
    observations, _ = vector.reset(seed=0)
    actions = []
    for k in range(12):
        if k == 7:
            found.reset([1])  # whose own steps count from here
        actions.append(found.act(observations)[:, 0])
        observations, *_ = vector.step(actions[-1][:, None])
    moved = np.diff(np.array(actions), axis=0) != 0.0
    assert np.flatnonzero(moved[:, 0]).tolist() == [4, 9]
    assert np.flatnonzero(moved[:, 1]).tolist() == [4, 6]
    with pytest.raises(ValueError, match=r"acts every 0\.05 s; control_dt must be that or a whole fraction of it"):
        policy.Policy(path, gym.make(env_id, control_dt=0.02))


def test_resume_goes_on(tmp_path):
    out = tmp_path / "run"
    first = Training(WEAVE, "ppo", out, friction=LUGRE)
    first.settings["algorithm"] |= SMALL
    first.run(steps=128)
    second = Training(WEAVE, "ppo", out, friction=LUGRE, resume=True)
    assert second.seconds > 0.0
    second.run(steps=256)
    with (out / "learning.csv").open(encoding="utf-8") as file:
        steps = [int(row["steps"]) for row in csv.DictReader(file)]
    assert steps[-1] >= 256
    third = Training(WEAVE, None, out, resume=True)
    curve, best = (out / "learning.csv").read_bytes(), policy.read_description(out / "policy.zip")
    third.run(steps=256)  # as if it had been killed before its report: nothing is trained, nothing validated again
    third.run(minutes=1e-5)
    assert (out / "learning.csv").read_bytes() == curve
    assert policy.read_description(out / "policy.zip") == best
    (out / "latest.zip").write_bytes(b"")  # as if it had been killed in its last validation, which is made again
    Training(WEAVE, None, out, resume=True).run(steps=256)
    with (out / "learning.csv").open(encoding="utf-8") as file:
        assert [int(row["steps"]) for row in csv.DictReader(file)] == [*steps, steps[-1]]
    assert not (out / "latest.zip").exists()
    for more in ({"seed": 5}, {"friction": Friction("coulomb")}):
        with pytest.raises(ValueError, match=r"is of (seed 0, not 5|friction lugre, not coulomb)"):
            Training(WEAVE, "ppo", out, resume=True, **more)
    with pytest.raises(ValueError, match="is not empty: give a new directory, or resume"):
        Training(WEAVE, "ppo", out, friction=LUGRE)
    with pytest.raises(ValueError, match="is of algo ppo, not sac"):
        Training(WEAVE, "sac", out, friction=LUGRE, resume=True)
    with pytest.raises(ValueError, match="holds no checkpoint"):
        Training(WEAVE, "ppo", tmp_path / "other", friction=LUGRE, resume=True)


@pytest.mark.parametrize(("env_id", "budget"), [(WEAVE, None), (ON_CENTRE, None), (WEAVE, 0.01)])
def test_a_killed_training_ends_as_if_it_had_not_been_killed(tmp_path, monkeypatch, env_id, budget):
    """With a guard and without, with a budget of the cost and episodes of 8 steps.

    Killed where a checkpoint lies some steps back, within a rollout of 64 steps.
    """
    monkeypatch.setattr(training, "CHECKPOINT_EVERY", 0.0)
    monkeypatch.setattr(training, "VALIDATE_STEPS", 128)
    monkeypatch.setattr(training, "VALIDATED", 2)
    whole, killed = tmp_path / "whole", tmp_path / "killed"

    def watched(part, text):
        if text in ("100 steps", "180 steps"):
            shutil.copytree(whole, tmp_path / text, dirs_exist_ok=True)

    run = Training(env_id, None, whole, friction=LUGRE, cost_budget=budget)
    run.settings["algorithm"] |= SMALL
    if budget:
        run.settings["environment"] |= {"max_episode_steps": 8}
    run.run(steps=320, notify=watched)
    for text in ("100 steps", "180 steps"):
        (tmp_path / text).rename(killed)
        Training(env_id, None, killed, resume=True).run(steps=320)
        weights = []
        for out in (whole, killed):
            with zipfile.ZipFile(out / "checkpoint" / "model-320.zip") as archive:
                weights.append(archive.read("policy.pth"))
        assert weights[0] == weights[1]
        assert _without_seconds(killed) == _without_seconds(whole)
        if budget:
            states = [
                json.loads((out / "checkpoint" / "state.json").read_text())["constraint"] for out in (whole, killed)
            ]
            assert states[0] == states[1]
            assert (killed / "constraint.csv").read_text() == (whole / "constraint.csv").read_text()
            assert len(states[0]["rows"]) >= 4
        assert (
            policy.read_description(killed / "policy.zip")["steps"]
            == policy.read_description(whole / "policy.zip")["steps"]
        )
        shutil.rmtree(killed)


def _without_seconds(out):
    with (out / "learning.csv").open(encoding="utf-8", newline="") as file:
        return [{key: value for key, value in row.items() if key != "seconds"} for row in csv.DictReader(file)]


def test_what_breaks_training_leaves_a_checkpoint(tmp_path, monkeypatch):
    from steer_env.sb3 import SteerVecEnv

    steps = []

    def broken(self):
        steps.append(1)
        if len(steps) == 30:
            raise RuntimeError("a thread died")
        return whole(self)

    whole = SteerVecEnv.step_wait
    monkeypatch.setattr(SteerVecEnv, "step_wait", broken)
    with pytest.raises(RuntimeError, match="a thread died"):
        Training(WEAVE, "ppo", tmp_path / "run", friction=LUGRE).run(steps=10**6)
    assert len(list((tmp_path / "run" / "checkpoint").glob("model-*.zip"))) == 1


def test_a_checkpoint_keeps_law_seed_settings_and_the_best(tmp_path):
    out = tmp_path / "run"
    first = Training(WEAVE, None, out, seed=3, friction=Friction("coulomb"))
    assert not out.exists()  # nothing before the work
    first.settings["algorithm"] |= SMALL
    first.run(steps=64)
    state = json.loads((out / "checkpoint" / "state.json").read_text())
    assert (state["friction"], state["seed"], state["algo"]) == ("coulomb", 3, "ppo")
    assert json.loads((out / "settings.json").read_text())["friction"] == "coulomb"
    second = Training(WEAVE, None, out, resume=True)
    with (out / "learning.csv").open(encoding="utf-8") as file:
        assert second.best == max(float(row["reward"]) for row in csv.DictReader(file))
    assert (second.friction.label, second.seed, second.settings) == ("coulomb", 3, first.settings)
    state.pop("friction")
    (out / "checkpoint" / "state.json").write_text(json.dumps(state))
    with pytest.raises(ValueError, match="has no entry friction"):
        Training(WEAVE, None, out, resume=True)


def _learning_rate(out):
    """Of the optimizer in a checkpoint, which is that of the last update."""
    import io

    import torch

    (path,) = (out / "checkpoint").glob("model-*.zip")
    with zipfile.ZipFile(path) as archive:
        state = torch.load(io.BytesIO(archive.read("policy.optimizer.pth")), weights_only=True)
    return state["param_groups"][0]["lr"]


SMALL = {"num_envs": 4, "n_steps": 16, "batch_size": 64}  # one update after 64 steps


@pytest.mark.whole
def test_the_learning_rate_falls_to_zero_over_all_sessions(tmp_path):
    out = tmp_path / "run"
    first = Training(WEAVE, None, out, friction=LUGRE)
    assert first.settings["algorithm"]["learning_rate_decay"]
    usual = first.settings["algorithm"]["learning_rate"]
    first.settings["algorithm"] |= SMALL
    first.run(steps=256)
    assert _learning_rate(out) == pytest.approx(usual * (1.0 - 192 / 256))  # the update after three of four rollouts
    Training(WEAVE, None, out, resume=True).run(steps=640)
    assert _learning_rate(out) == pytest.approx(usual * (1.0 - 576 / 640))
    stable_baselines3.PPO.load(out / "policy.zip", device="cpu")  # which holds no schedule
    minutes = Training(WEAVE, None, out, resume=True)
    minutes.run(minutes=(minutes.seconds + 1.0) / 60.0)
    assert 0.0 < _learning_rate(out) < 0.3 * usual


def test_a_constant_learning_rate(tmp_path):
    run = Training(WEAVE, None, tmp_path / "run", friction=LUGRE)
    run.settings["algorithm"] |= {**SMALL, "learning_rate_decay": False}
    run.run(steps=128)
    assert _learning_rate(run.out) == run.settings["algorithm"]["learning_rate"]


KILLED = """
import os, sys
from pathlib import Path
from steer_env.experiments.learning import training
from steer_env.experiments.learning.constants import SHIFTS
from steer_env.experiments.learning.training import Training
from steer_env.experiments.pages.options import Friction
training.VALIDATE_STEPS, training.VALIDATED, training.CHECKPOINT_EVERY = 64, 2, 1e9
left, rename, replace = [int(sys.argv[2])], os.replace, Path.replace
def counted(function):
    def change(*arguments):
        left[0] -= 1
        if not left[0]:
            os._exit(9)  # as a kill: nothing is cleaned up
        return function(*arguments)
    return change
os.replace, Path.replace = counted(rename), counted(replace)
out = Path(sys.argv[1])
resume = out.exists()
run = Training("steer_env/AssistWeave-v3", None, out, resume=resume, friction=None if resume else Friction("lugre"))
run.settings["algorithm"] |= {"num_envs": 4, "n_steps": 16, "batch_size": 64}
run.run(steps=10**6)
"""


@pytest.mark.whole
def test_a_killed_run_stays_consistent(tmp_path):
    """Killed before renames of different files, and resumed after each kill."""
    out = tmp_path / "run"
    for renames in (9, 12, 17):
        assert subprocess.run([sys.executable, "-c", KILLED, str(out), str(renames)], check=False).returncode == 9
        with (out / "learning.csv").open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        for column in ("steps", "seconds"):
            values = [float(row[column]) for row in rows]
            assert values == sorted(values)
        resumed = Training(WEAVE, None, out, resume=True)
        kept = policy.read_description(out / "policy.zip")["steps"]
        assert resumed.best == next(float(row["reward"]) for row in rows if int(row["steps"]) == kept)
        earlier = [float(row["reward"]) for row in rows[:-1]]  # the last row may stand before its policy
        assert resumed.best >= max(earlier, default=resumed.best)
        assert int(rows[-1]["steps"]) <= json.loads((out / "checkpoint" / "state.json").read_text())["steps"]


def _as_trained_on(source, folder, **changes):
    """A copy of a policy that says something else of itself."""
    folder.mkdir()
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(folder / "policy.zip", "w") as new:
        for name in old.namelist():
            data = old.read(name)
            new.writestr(name, json.dumps(json.loads(data) | changes) if name == policy.DESCRIPTION_NAME else data)
    return str(folder / "policy.zip")


@pytest.mark.whole
def test_policies_of_several_laws_are_compared_on_one(trained, tmp_path, capsys):
    ours = str(trained / "policy.zip")
    other = _as_trained_on(ours, tmp_path / "other", friction="masing")
    command = ["policy", "evaluate", ours, other, "--episodes", "1", "--out", str(tmp_path / "out")]
    assert main(command) == 2
    error = capsys.readouterr().err
    assert "trained with friction lugre" in error
    assert "with friction masing: give --friction" in error
    assert not (tmp_path / "out").exists()
    assert main([*command, "--friction", "coulomb"]) == 0
    drawn = {"environment": {"control_dt": 0.01, "randomise": {"load": [0, 100]}}}
    changed = policy.read_description(trained / "policy.zip")["settings"] | drawn
    third = _as_trained_on(ours, tmp_path / "third", settings=changed)
    assert main(["policy", "evaluate", ours, third, "--out", str(tmp_path / "out")]) == 2
    assert "with load 0 to 300 kg, " in capsys.readouterr().err


@pytest.mark.whole
def test_shift_command(trained, tmp_path, capsys):
    path, out = str(trained / "policy.zip"), tmp_path / "shift"
    over = ["--over", "level", "law", "--friction", "coulomb", "--episodes", "2"]
    assert main(["policy", "shift", path, *over, "--out", str(out)]) == 0
    assert "<svg" in (out / "shift.svg").read_text(encoding="utf-8")
    found = json.loads((out / "shift.json").read_text())
    assert list(found["over"]["level"]) == ["0.5", "1", "2", "3", "5"]
    assert list(found["over"]["law"]) == ["coulomb"]
    assert set(found["over"]["level"]["2"]["metrics"]) >= {"policy", "lqg"}
    assert main(["policy", "shift", path, "--env", "steer_env/AssistRelease-v4"]) == 2
    assert "was trained for steer_env/AssistWeave-v3, not steer_env/AssistRelease-v4" in capsys.readouterr().err
    assert main(["policy", "shift", path, "--over", "load", "--friction", "coulomb"]) == 2
    assert "--friction names the laws of --over law, and --over is load" in capsys.readouterr().err


@pytest.mark.whole
def test_a_recurrent_policy_trains_and_acts(tmp_path):
    """Soft actor-critic is trained in test_policy_files.py."""
    run = Training(WEAVE, "recurrent-ppo", tmp_path / "run", friction=LUGRE)
    run.settings["algorithm"] |= {"num_envs": 4, "n_steps": 64, "batch_size": 64, "n_epochs": 1}
    run.run(steps=400)
    vector = gym.make_vec(WEAVE, num_envs=2)
    found = policy.Policy(tmp_path / "run" / "policy.zip", vector)
    observations, _ = vector.reset(seed=0)
    for _ in range(3):
        assert found.act(observations).shape == (2, 1)


def test_episodes_are_those_of_single_environments():
    found = held_out.collect(WEAVE, lambda env: policy_report.baselines(WEAVE)["boost"](env), 3, 7, control_dt=0.1)
    for i in range(3):
        env, total, over = gym.make(WEAVE, control_dt=0.1), 0.0, False
        env.reset(seed=7 + i)
        while not over:
            _, reward, _, over, info = env.step(np.zeros(1, np.float32))
            total += reward
        assert found.reward[i] == pytest.approx(total, rel=1e-12)
        assert found.metrics["rms_feel_error"][i] == info["metrics"]["rms_feel_error"]
    with pytest.raises(ValueError, match=r"info_level must be 'full' for held-out episodes, .*, got 'metrics'"):
        held_out.collect(WEAVE, lambda env: policy_report.baselines(WEAVE)["boost"](env), 1, info_level="metrics")


def test_estimates():
    assert held_out.mean(np.array([1.0, 2.0, 3.0])) == pytest.approx((2.0, 2.0 - 2.4841377, 2.0 + 2.4841377))
    low, high = held_out.share(np.arange(200) >= 4)[1:]
    assert (low, high) == pytest.approx((0.9497, 0.9922), abs=2e-4)  # Wilson's for 196 of 200


@pytest.mark.whole
def test_evaluation_writes_its_report(trained, tmp_path):
    out = tmp_path / "evaluation"
    assert (
        main(["policy", "evaluate", str(trained / "policy.zip"), "--env", WEAVE, "--episodes", "3", "--out", str(out)])
        == 0
    )
    found = json.loads((out / "evaluation.json").read_text())
    assert set(found["metrics"]) >= {"policy", "boost", "lqg"}
    baseline = ["policy", "evaluate", "boost", "--env", WEAVE]
    assert main([*baseline, "--episodes", "2", "--out", str(tmp_path / "boost")]) == 0
    page = (out / "index.html").read_text(encoding="utf-8")
    assert page.count('<img src="data:image/svg+xml') == 2  # rewards with intervals, and the learning curve
    assert page.count('<img src="data:image/png') == 8  # frames of two first episodes


@pytest.mark.whole
def test_identified_laws_are_near_the_one_that_was_recorded():
    found = {law.label: law.parameters for law in shift.identify_laws(LUGRE)}
    assert {"dahl, identified", "lugre, identified", "masing, identified"} <= set(found)
    assert not {"coulomb, identified", "stribeck, identified", "viscous, identified"} & set(found)  # not described
    assert found["lugre, identified"].F_c == pytest.approx(LUGRE.parameters.F_c, rel=0.01)
    assert found["lugre, identified"].sigma_0 == pytest.approx(LUGRE.parameters.sigma_0, rel=0.01)


@pytest.mark.whole
def test_every_condition_is_replaced_in_the_environments(trained):
    """What is handed to the environments, for each condition; the policy is the first controller of each."""
    made = []

    def not_driven(evaluated, jobs, **_):
        made.extend({"options": job.options, **job.arguments} for job in jobs if job.label.endswith(", policy"))
        return [held_out.Episodes(np.zeros(1), np.zeros(1), np.zeros(1, np.int64), {}) for _ in jobs]

    chosen = {over: shift.changes(over, WEAVE, LUGRE) for over in SHIFTS}
    refused = shift.collect(trained / "policy.zip", chosen, 1, sweep=not_driven).refused
    usual = made.pop(0)
    assert usual["randomise"] == settings(WEAVE, "ppo")["environment"]["randomise"]
    assert usual["randomise"]["load"] == [0, 300]
    names = {"level": "friction_level", "noise": "sensor_noise"}
    assert chosen.pop("human") == []  # which is for drivers
    for over, each in chosen.items():
        assert len(each) >= 4
        for change in (change for change in each if change.label not in refused):
            found = made.pop(0)
            assert found["randomise"] == usual["randomise"]
            if over == "car":
                assert found["vehicle"] == change.label
            elif over == "law":
                assert str(found["friction"]) != str(usual["friction"])
            else:
                ((name, value),) = found["options"].items()
                assert name == names.get(over, over)
                size = {"speed": 3.6, "delay": 1e3}.get(over, 1.0)
                assert change.label.startswith(f"{size * value:.4g}")
    assert [change.x for change in chosen["delay"]] == [0.0, 10.0, 20.0, 40.0]


def test_an_own_car_stands_beside_the_packaged_ones():
    stiff = cars.load("compact", changes={"column.K_tb": 143.0})
    *packaged, own = shift.changes("car", WEAVE, LUGRE, own=stiff)
    assert [change.label for change in packaged] == list(cars.available())
    assert (own.label, own.arguments["vehicle"]["column"]["K_tb"]) == ("compact, changed", 143.0)


@pytest.mark.whole
def test_speeds_of_scenarios_are_not_replaced(tmp_path, capsys):
    all_round = "steer_env/AssistAllRound-v3"
    assert shift.changes("speed", all_round, LUGRE) == []
    run = Training(all_round, None, tmp_path / "run", friction=LUGRE)
    run.settings["algorithm"] |= SMALL
    run.run(steps=64)
    assert (
        main(["policy", "shift", str(run.out / "policy.zip"), "--over", "speed", "--out", str(tmp_path / "shift")]) == 2
    )
    assert "has nothing to replace for --over speed" in capsys.readouterr().err


@pytest.mark.whole
def test_a_shift_changes_the_reward(trained):
    chosen = {over: shift.changes(over, WEAVE, LUGRE, [Friction("coulomb")])[:1] for over in ("law", "noise")}
    found = shift.collect(trained / "policy.zip", chosen, 2)
    assert found.home.lost.value == 0.0
    assert found.cells["law"]["coulomb"].lost.value != 0.0
    assert found.cells["noise"]["0"].lost.value != 0.0  # the training draws noise


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["train", "--env", "steer_env/DriverFlying-v3"], "unknown environment 'steer_env/DriverFlying-v3'; there are"),
        (["train", "--env", "steer_env/AssistWeave-v0"], "it is replaced by steer_env/AssistWeave-v3"),
        (["train", "--env", WEAVE, "--minutes", "-1"], "minutes must be .*greater than 0"),
        (["train", "--env", WEAVE, "--steps", "0"], "--steps: must be a whole number of at least 1, got '0'"),
        (["train", "--env", WEAVE, "--seed", "-1"], "--seed: must be a whole number of at least 0"),
        (["train", "--env", WEAVE, "--out", "file/run"], "cannot be made, as .*file is a file"),
        (["train", "--env", WEAVE, "--out", "file"], "file is a file: give a directory"),
        (["train", "--env", "steer_env/TuneOnCentre-v3"], "tunes assist parameters"),
        (["policy", "evaluate", "boost", "boost", "--env", WEAVE], "'boost' is given twice"),
        (["policy", "evaluate", "boost"], "--env must name the environment"),
        (["policy", "evaluate", "."], r"\. is a folder: give the policy\.zip in it"),
        (["train", "--env", "AssistWeave-v3"], "; did you mean steer_env/AssistWeave-v3;"),
        (["policy", "shift", "lqg"], "a baseline, which was not trained"),
        (["train", "--env", WEAVE, "--resume", "--library-defaults"], "a resumed one keeps its settings: leave it out"),
        (["policy", "shift", "weave"], "'weave' is no policy: give a policy.zip"),
        (["policy", "evaluate", "nobody", "--env", WEAVE], "neither a policy.zip nor a baseline .*boost"),
        (["policy", "evaluate", "nothing.zip", "--env", WEAVE], "no file nothing.zip"),
    ],
)
def test_bad_commands(arguments, message, tmp_path, monkeypatch, capsys):

    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    try:
        code = main(arguments)
    except SystemExit as end:
        code = end.code
    assert code == 2
    assert re.search(message, capsys.readouterr().err)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]  # nothing written


def test_an_interrupted_training_tells_from_where_it_goes_on(trained, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Training, "run", interrupted)
    assert main(["train", "--env", WEAVE, "--resume", "--out", str(trained)]) == 130
    assert "run holds the training up to step 8192; --resume goes on from there" in capsys.readouterr().err


def test_a_resumed_training_keeps_its_budget(trained):
    with pytest.raises(ValueError, match=r"keeps its cost_budget, here None, got 1\.0"):
        Training(WEAVE, None, trained, resume=True, cost_budget=1.0)


def test_the_suite_warns_of_a_policy_that_is_not_shipped(trained, monkeypatch, capsys):
    monkeypatch.setattr(assist_suite, "examine_all", lambda *_: {})
    assert main(["policy", "suite", str(trained / "policy.zip")]) == 0
    assert "caution" in capsys.readouterr().err
    assert main(["policy", "suite", "shipped", "--env", WEAVE]) == 0
    assert "caution" not in capsys.readouterr().err


def test_files_of_others_are_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("data", "{}")
    with pytest.raises(ValueError, match="does not say what it was trained for"):
        policy.read_description(tmp_path / "other.zip")


def test_a_policy_of_another_task_is_refused(trained):
    with pytest.raises(
        ValueError, match="was trained for steer_env/AssistWeave-v3 and cannot act in steer_env/DriverLaneK"
    ):
        policy.Policy(trained / "policy.zip", gym.make("steer_env/DriverLaneKeeping-v3"))


def test_settings_of_an_id_stand_over_the_common_ones():
    found = settings("steer_env/DriverDoubleLaneChange-v3", "ppo")
    assert found["environment"]["control_dt"] == 0.05  # of all drivers
    assert found["environment"]["randomise"]["road_friction"] == [0.8, 1.0]  # its own
    assert found["algorithm"]["net_arch"] == [64, 64]  # of all ids
    assert settings("steer_env/DriverParking-v3", "ppo")["environment"] == {"control_dt": 0.05}  # draws nothing
    with pytest.raises(ValueError, match="unknown algorithm 'dqn'"):
        settings(WEAVE, "dqn")


@pytest.mark.parametrize("env_id", [id_of("AssistWeave"), id_of("AssistAllRound")])
def test_a_shipped_assist_knows_no_condition_that_is_no_longer_drawn(env_id):
    drawn = training.conditions(env_id)["randomise"]
    for name, (low, high) in policy.conditions(policy.read_description(policy.shipped_policy(env_id)))[
        "randomise"
    ].items():
        assert drawn[name][0] <= low, name
        assert drawn[name][1] >= high, name


class Louder:
    """LQG whose action is multiplied."""

    def __init__(self, times, env):
        self._lqg, self._times = assists.make("lqg", env), times

    def reset(self, rows=slice(None)):
        self._lqg.reset(rows)

    def act(self, observation):
        return np.clip(self._times * self._lqg.act(observation), -1.0, 1.0).astype(np.float32)


@pytest.mark.whole
@pytest.mark.parametrize("name", ["AssistLaneKeeping", "AssistLaneChange"])
def test_a_loop_gain_without_margins_pays_only_where_no_margin_is_drawn(name):
    """Held-out episodes, paired, LQG with three times its action less LQG."""
    gained = {}
    for where, arguments in [("default", {}), ("training", training.conditions(id_of(name)))]:
        one, thrice = (held_out.collect(id_of(name), partial(Louder, times), 32, **arguments) for times in (1.0, 3.0))
        gained[where] = held_out.differences(thrice, one)["reward"]
    assert gained["default"].low > 0.0
    assert gained["training"].high < 0.0
