"""The benchmark of friction shift: losses by hand, a training of some steps, what is kept and what is refused."""

import json

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecFrameStack, VecNormalize

from steer_env.experiments.cli.main import main
from steer_env.experiments.learning import friction_shift, policy
from steer_env.experiments.learning.friction_shift import OverLaws, Shift, rows
from steer_env.experiments.learning.friction_shift_cases import CANDIDATES, ENTRIES, LAWS, SET, Case
from steer_env.registration import id_of
from steer_env.sb3 import SteerVecEnv

ON_CENTRE = id_of("DriverOnCentre")
CASE = Case("DriverOnCentre", {"control_dt": 0.05}, "lugre", 64, {"num_envs": 4, "n_steps": 8, "batch_size": 32})
# Rewards of two seeds on each law: the range is 10 on LuGre, 5 on Coulomb and 8 on the viscous law.
FOUND = {
    "zero": [{"lugre": 10.0, "coulomb": 10.0, "viscous": 10.0}],
    "one-law": [
        {"lugre": 19.0, "coulomb": 12.0, "viscous": 18.0},
        {"lugre": 18.0, "coulomb": 14.0, "viscous": 18.0},
    ],
    "set-of-laws": [{"lugre": 20.0, "coulomb": 15.0, "viscous": 17.8}],
}


@pytest.fixture
def small(monkeypatch):
    """A case of 64 steps in place of the benchmark's own."""
    monkeypatch.setattr(friction_shift, "CANDIDATES", {"small": CASE})
    return CASE


def test_a_loss_is_the_share_of_the_range_from_zero_action_to_the_best():
    zero, one, several = rows(CASE, FOUND)
    assert (zero.loss["coulomb"].value, zero.laws, zero.shifted) == (1.0, (), 0)
    assert one.loss["coulomb"].value == pytest.approx(0.5 * (3.0 / 5.0 + 1.0 / 5.0))
    assert one.loss["lugre"].value == pytest.approx(0.15)
    assert (one.worst, one.laws, one.seeds) == ("coulomb", ("lugre",), 2)
    assert one.shifted == 1  # the second seed has lost 0.2 on the law of its training already
    assert not one.robust
    assert (several.worst, several.laws, several.robust) == ("viscous", SET, True)
    assert several.loss["viscous"].value == pytest.approx(0.2 / 8.0)


def test_the_interval_is_that_of_student_over_the_seeds():
    e = rows(CASE, FOUND)[1].loss["coulomb"]
    half = 12.706 * np.std([0.6, 0.2], ddof=1) / np.sqrt(2.0)  # t of one degree of freedom, from a table
    assert (e.high - e.low) / 2.0 == pytest.approx(half, rel=1e-4)


def test_a_case_is_decided_where_all_seeds_but_one_are_shifted():
    found = Shift({"case": rows(CASE, FOUND)}, tuple(FOUND["zero"][0]), 2, 0)
    assert (found.decided, found.robust) == (["case"], {"case": ["set-of-laws"]})
    seeds = [{**FOUND["one-law"][1], "coulomb": 15.0}] * 2
    found = Shift({"case": rows(CASE, {**FOUND, "one-law": seeds})}, found.laws, 2, 0)
    assert found.decided == []


def test_every_case_and_entry_can_be_made():
    for case in CANDIDATES.values():
        gym.make_vec(id_of(case.task), num_envs=2, friction=case.law, **case.arguments).close()
        assert case.law in LAWS
    for entry in ENTRIES.values():
        assert set(entry.laws) <= set(LAWS)
        policy.algorithm(entry.algorithm)


def test_the_parts_of_an_environment_over_laws_are_those_of_each_law():
    both = OverLaws([SteerVecEnv(ON_CENTRE, 2, friction=law) for law in ("lugre", "viscous")])
    alone = SteerVecEnv(ON_CENTRE, 2, friction="viscous")
    both.seed(3)
    alone.seed(5)  # that of the third sub-environment
    assert np.array_equal(both.reset()[2:], alone.reset())
    action = np.array([[0.2], [-0.3]], np.float32)
    for _ in range(5):
        observations, rewarded, done, infos = both.step(np.vstack([np.zeros_like(action), action]))
        expected = alone.step(action)
        assert np.array_equal(observations[2:], expected[0])
        assert np.array_equal(rewarded[2:], expected[1])
        assert infos[2:] == expected[3]
    assert not done.any()
    assert both.get_attr("control_dt") == [0.05] * 4
    both.close()
    alone.close()


def test_a_policy_with_a_history_acts_as_stable_baselines_does(tmp_path):
    path = tmp_path / "policy.zip"
    friction_shift.train(CASE, ENTRIES["history"], 1, path)
    about = policy.read_description(path)
    assert (about["laws"], about["settings"]["algorithm"]["frames"]) == (list(SET), 8)
    vector = gym.make_vec(ON_CENTRE, num_envs=2)
    found = policy.Policy(path, vector)
    raw = VecNormalize(SteerVecEnv(ON_CENTRE, 2), norm_reward=False, training=False)
    raw.obs_rms.mean, raw.obs_rms.var = (np.array(about["scaling"][key]) for key in ("mean", "deviation"))
    raw.obs_rms.var = raw.obs_rms.var**2 - raw.epsilon
    stacked, model = VecFrameStack(raw, 8), policy.algorithm("ppo").load(path, device="cpu")
    stacked.seed(7)
    seen, (observations, _) = stacked.reset(), vector.reset(seed=7)
    found.reset()
    for _ in range(12):
        expected, action = model.predict(seen, deterministic=True)[0], found.act(observations)
        np.testing.assert_allclose(action, expected, atol=1e-5)
        seen, *_ = stacked.step(action)
        observations, *_ = vector.step(action)


def test_what_is_finished_is_taken_and_other_settings_are_refused(small, tmp_path, monkeypatch):
    laws = ("lugre", "viscous")
    first = friction_shift.collect(tmp_path, ["small"], ["one-law"], 1, laws, 2)
    assert [row.entry for row in first.cases["small"]] == ["one-law", "zero", "angle_servo"]
    monkeypatch.setattr(friction_shift, "train", None)  # nothing is trained again
    assert friction_shift.collect(tmp_path, ["small"], ["one-law"], 1, laws, 2) == first
    wider = friction_shift.collect(tmp_path, ["small"], ["one-law"], 1, (*laws, "coulomb"), 2)
    assert wider.cases["small"][0].reward["lugre"] == first.cases["small"][0].reward["lugre"]
    partly = friction_shift.collect(tmp_path, ["small"], ["one-law"], 3, laws, 2, training_allowed=False)
    assert partly == first
    monkeypatch.setattr(friction_shift, "CANDIDATES", {"small": small._replace(steps=65)})
    with pytest.raises(ValueError, match=r"small\.one-law\.0\.json was made with other settings \(case\)"):
        friction_shift.collect(tmp_path, ["small"], ["one-law"], 1, laws, 2)


def test_the_file_holds_the_losses(small, tmp_path):
    laws = ("lugre", "viscous")
    made = {name: [{law: of[law] for law in laws} for of in seeds] for name, seeds in FOUND.items()}
    friction_shift.write(tmp_path, Shift({"small": rows(CASE, made)}, laws, 2, 0), {})
    data = json.loads((tmp_path / "friction_shift.json").read_text())
    assert data["cases"]["small"]["entries"][1]["loss"]["lugre"]["value"] == pytest.approx(0.15)


def test_a_directory_with_files_needs_resume(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    assert main(["policy", "friction-shift", "--out", str(tmp_path)]) == 2
    assert "is not empty" in capsys.readouterr().err
