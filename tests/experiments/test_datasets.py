"""Data sets in Minari's format: recorded by the command, reloaded, replayed to the bit."""

import json

import minari
import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.cli.main import main
from steer_env.experiments.learning import controllers
from steer_env.experiments.learning.constants import QUALITIES
from steer_env.registration import DRIVEN

WEAVE = "steer_env/AssistWeave-v3"


def _recorded(out, *options):
    assert main(["policy", "record", *options, "--out", str(out)]) == 0
    return minari.MinariDataset(out / "data")


def _replay(dataset, env):
    """Every episode again from its seed and its actions."""
    episodes = list(dataset.iterate_episodes())
    about = list(dataset.storage.get_episode_metadata(dataset.episode_indices))
    for episode, own in zip(episodes, about, strict=True):
        observation, info = env.reset(seed=own["seed"])
        np.testing.assert_array_equal(observation, episode.observations[0])
        assert own["conditions"]["load"] == info["conditions"]["load"]
        for k, action in enumerate(episode.actions):
            observation, reward, terminated, truncated, info = env.step(action)
            np.testing.assert_array_equal(observation, episode.observations[k + 1])
            assert reward == episode.rewards[k]
            assert (terminated, truncated) == (episode.terminations[k], episode.truncations[k])
            assert info["cost"] == episode.infos["cost"][k + 1]
        assert terminated or truncated
        assert own["metrics"] == {key: value for key, value in info["metrics"].items() if not np.isnan(value)}
    return episodes


@pytest.mark.parametrize(
    ("env_id", "name"),
    [
        (WEAVE, "lqg"),
        (WEAVE, "shipped"),
        pytest.param("steer_env/DriverParking-v3", "random", marks=pytest.mark.whole),
    ],
)
def test_a_recovered_environment_replays_the_set_to_the_bit(env_id, name, tmp_path):
    law = ["--friction", "masing,elements=5"] if name == "lqg" else []
    dataset = _recorded(tmp_path / "set", "--env", env_id, "--policy", name, "--episodes", "2", "--seed", "5", *law)
    env = dataset.recover_environment()
    episodes = _replay(dataset, env)
    assert len(episodes) == 2
    assert env.spec.id == env_id
    task = env.unwrapped.task
    assert set(episodes[0].infos["cost_terms"]) == {term.name for term in task.costs}
    assert set(episodes[0].infos["reward_terms"]) == {term.name for term in task.rewards}
    assert episodes[0].infos["cost"][0] == 0.0
    stored = dataset.storage.metadata["friction"]
    expected = friction.make("masing", elements=5) if law else friction.resolve("lugre@column_eps")
    assert friction.as_mapping(expected) == stored


def test_the_folder_is_replaced_as_a_whole(tmp_path):
    out = tmp_path / "set"
    for _ in range(2):
        _recorded(out, "--env", WEAVE, "--policy", "zero", "--episodes", "1")
    assert [path.name for path in tmp_path.iterdir()] == ["set"]
    assert [path.name for path in out.iterdir()] == ["data"]
    assert json.loads((out / "data" / "metadata.json").read_text())["total_episodes"] == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--policy", "nobody"], "neither a policy.zip nor a controller of .*zero, random, active_return"),
        (["--policy", "zero", "--seed", "999999", "--episodes", "2"], "reaches the held-out seeds, 1000000 on"),
        (["--policy", "nothing.zip"], "no file nothing.zip"),
    ],
)
def test_bad_commands(options, message, tmp_path, monkeypatch, capsys):
    import re

    monkeypatch.chdir(tmp_path)
    assert main(["policy", "record", "--env", WEAVE, *options]) == 2
    assert re.search(message, capsys.readouterr().err)
    assert not list(tmp_path.iterdir())


def test_a_set_takes_full_infos(tmp_path):
    from steer_env.experiments.learning import dataset

    with pytest.raises(ValueError, match=r"info_level must be 'full' for a data set, .*, got 'none'"):
        dataset.record(tmp_path / "set", WEAVE, "zero", lambda env: None, 1, 0, info_level="none")
    assert not list(tmp_path.iterdir())


def test_qualities_are_reproducible_by_seed_and_in_order(tmp_path):
    def quality(name, seed, episodes):
        options = ["--env", WEAVE, "--quality", name, "--seed", str(seed), "--episodes", str(episodes)]
        return _recorded(tmp_path / f"{name}{seed}", *options)

    sets = {name: quality(name, 5, 2) for name in QUALITIES}
    scores = []
    for name, dataset in sets.items():
        episodes = _replay(dataset, dataset.recover_environment())
        actions = np.concatenate([episode.actions for episode in episodes])
        assert actions.dtype == np.float32
        assert 0.1 < np.abs(actions).max() <= 1.0
        about = dataset.storage.metadata
        assert (about["quality"], about["random_share"], about["controller"]) == (name, QUALITIES[name], "lqg")
        reward = np.array([episode.rewards.sum() for episode in episodes])
        scores.append(minari.get_normalized_score(dataset, reward).mean())
    assert scores[0] < -1.0 < scores[1] < 0.2 < 0.6 < scores[2] < 1.0
    (alone,) = quality("medium", 6, 1).iterate_episodes()
    np.testing.assert_array_equal(alone.actions, sets["medium"][1].actions)


def test_every_id_has_a_reference_among_its_baselines():
    for env_id in DRIVEN:
        assert controllers.reference(env_id) in controllers.baselines(env_id)
