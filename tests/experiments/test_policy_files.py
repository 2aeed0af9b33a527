"""A policy file is read without running what it holds, and acts as Stable-Baselines3 would."""

import io
import json
import os
import zipfile

import numpy as np
import pytest
import stable_baselines3
import torch

from steer_env.experiments.cli.main import main
from steer_env.experiments.learning import network, policy
from steer_env.experiments.learning.training import Training
from steer_env.experiments.pages.options import Friction

WEAVE = "steer_env/AssistWeave-v3"
SHIPPED = sorted(
    f"steer_env/{folder.name}" for folder in policy.SHIPPED_IN.iterdir() if (folder / "policy.zip").is_file()
)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A policy of a few steps."""
    run = Training(WEAVE, "ppo", tmp_path_factory.mktemp("training") / "run", friction=Friction("lugre"))
    run.settings["algorithm"] |= {"num_envs": 4, "n_steps": 16, "batch_size": 64}
    run.run(steps=128)
    return run.out / "policy.zip"


def _changed(source, target, members):
    """A copy of a policy file with other contents of some members."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            new.writestr(name, members.get(name, old.read(name)))
    return target


def test_a_damaged_policy_is_refused_or_whole(tmp_path):
    """Bytes changed, and the end cut off: a sentence that names the file, unless nothing that counts was hit."""
    whole, path = policy.shipped_policy(SHIPPED[0]).read_bytes(), tmp_path / "policy.zip"
    rng, refused = np.random.default_rng(4), 0
    for case in range(120):
        damaged = bytearray(whole)
        for place in rng.integers(len(whole) - 1500 if case % 2 else 0, len(whole), 3):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged[: len(whole) - (case % 5 == 0) * int(rng.integers(1, 1500))])
        try:
            network.load(path, policy.read_description(path))
        except ValueError as error:
            refused += str(path) in str(error)
    assert refused > 80


def test_a_description_of_another_form_is_refused(tmp_path):
    shipped = policy.shipped_policy(SHIPPED[0])
    about = policy.read_description(shipped)
    for changes, message in (
        ({"friction": 1}, "friction in steer_env.json must be of the type str, got 1"),
        ({"settings": []}, "settings.environment in"),
        ({"algorithm": "a"}, "algorithm must be one of"),
        ({"scaling": {**about["scaling"], "deviation": [0.0]}}, "deviation must hold"),
    ):
        path = _changed(shipped, tmp_path / "policy.zip", {policy.DESCRIPTION_NAME: json.dumps({**about, **changes})})
        with pytest.raises(ValueError, match=rf"policy\.zip: {message}"):
            policy.read_description(path)


def _equal(path, model):
    about = policy.read_description(path)
    act = network.load(path, about)
    for n in (1, 2, 33):
        seen = np.random.default_rng(n).normal(0.0, 3.0, (n, len(about["observations"]))).astype(np.float32)
        np.testing.assert_array_equal(act(seen), model.load(path, device="cpu").predict(seen, deterministic=True)[0])


@pytest.mark.parametrize("env_id", SHIPPED)
def test_shipped_policies_act_as_stable_baselines3_to_the_bit(env_id):
    _equal(policy.shipped_policy(env_id), stable_baselines3.PPO)


@pytest.mark.whole
def test_a_squashed_policy_acts_as_stable_baselines3_to_the_bit(tmp_path):
    run = Training(WEAVE, "sac", tmp_path / "run", friction=Friction("lugre"))
    run.settings["algorithm"] |= {"num_envs": 4, "learning_starts": 64, "gradient_steps": 1, "buffer_size": 1000}
    run.run(steps=200)
    _equal(run.out / "policy.zip", stable_baselines3.SAC)


class Poison:
    """Makes a directory where it is unpickled."""

    def __init__(self, mark):
        self.mark = str(mark)

    def __reduce__(self):
        return os.mkdir, (self.mark,)


def _poisoned_data(data, mark):
    """The member ``data`` of a policy file with an object in it that runs when it is loaded."""
    import base64
    import pickle

    members = json.loads(data)
    members["policy_class"][":serialized:"] = base64.b64encode(pickle.dumps(Poison(mark))).decode()
    return json.dumps(members)


@pytest.mark.whole
def test_a_poisoned_file_is_not_executed(trained, tmp_path, capsys):
    mark = tmp_path / "mark"
    with zipfile.ZipFile(trained) as archive:
        data = archive.read("data")
    path = _changed(trained, tmp_path / "policy.zip", {"data": _poisoned_data(data, mark)})
    command = ["policy", "evaluate", str(path), "--episodes", "1", "--out", str(tmp_path / "out")]
    assert main(command) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "policy.zip is not shipped with steer-env. A policy file is code" in line
    assert not mark.exists()
    with pytest.raises(Exception):  # noqa: B017, PT011 (whatever follows from the wrong class)
        stable_baselines3.PPO.load(path, device="cpu")
    assert mark.exists()  # the poison works where it is unpickled


def test_poisoned_weights_are_refused(trained, tmp_path):
    mark = tmp_path / "mark"
    file = io.BytesIO()
    torch.save({"action_net.bias": Poison(mark)}, file)
    path = _changed(trained, tmp_path / "policy.zip", {"policy.pth": file.getvalue()})
    with pytest.raises(ValueError, match="does not hold the weights that it describes"):
        network.load(path, policy.read_description(path))
    assert not mark.exists()


@pytest.mark.parametrize("hidden", [[64], [64, 64, 64], [64, 32]], ids=["fewer layers", "more layers", "another size"])
def test_weights_that_do_not_fit_the_description_are_refused(hidden, trained):
    about = policy.read_description(trained)
    about["settings"]["algorithm"]["net_arch"] = hidden
    with pytest.raises(ValueError, match="does not hold the weights that it describes"):
        network.load(trained, about)


def test_shipped_policies_need_no_caution(trained):
    path = policy.shipped_policy(SHIPPED[0])
    assert policy.caution(path, policy.read_description(path)) == ""
    assert "(as it does here)" in policy.caution(trained, {"algorithm": "recurrent-ppo"})
