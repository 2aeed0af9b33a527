"""The examples run, in short."""

import importlib.util
import re
import runpy
import sys
import threading
from pathlib import Path

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.cli.main import main
from steer_env.experiments.learning import held_out
from steer_env.experiments.learning.controllers import ZeroAction
from steer_env.friction import law
from steer_env.registration import id_of
from steer_env.vehicle import cars
from tests.needs import needs

FOLDER = Path(__file__).parents[1] / "examples"


def load(name):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@needs("stable_baselines3", "pygame")
def test_train_a_policy(tmp_path):
    found = load("train_a_policy").main(64 * 128, str(tmp_path / "frame.png"))
    assert 0.4 < found["boost table"] < 0.55
    assert np.isfinite(found["policy"])
    assert (tmp_path / "frame.png").stat().st_size > 10_000


@pytest.mark.whole
@pytest.mark.parametrize("script", sorted((FOLDER / "gallery").glob("*.py")), ids=lambda path: path.stem)
def test_a_script_of_the_gallery_draws_a_picture(script, tmp_path, monkeypatch):
    """What it shows is finite and varies, has axes with units and a legend, and is in the file of its name."""
    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    figure = runpy.run_path(str(script))["figure"]
    for axes in figure.axes:
        drawn = axes.dataLim.get_points()
        assert np.isfinite(drawn).all()
        assert (np.ptp(drawn, axis=0) > 0.0).all()
        assert all(re.search(r"\[.+\]$", label) for label in (axes.get_xlabel(), axes.get_ylabel()))
    assert figure.axes
    assert figure.legends
    assert len(re.findall("<path", (tmp_path / f"{script.stem}.svg").read_text(encoding="utf-8"))) > 20
    plt.close(figure)


def test_tune_assist(tmp_path):
    """The best set is a car file, which the command line drives."""
    path = tmp_path / "tuned.toml"
    own, best = load("tune_assist").main(40, str(path))
    assert best > own
    assert cars.load(path).name == "compact_tuned"
    assert main(["run", "rig", "--vehicle", str(path), "--out", str(tmp_path)]) == 0


def test_plan_by_cross_entropy():
    found = load("plan_by_cross_entropy").main(4.0)
    assert found["cross-entropy"] > found["zero action"]


@needs("fmpy")
def test_fmu_controller(tmp_path, monkeypatch):
    """It earns what a class with the equation of the FMU earns: the force of a spring of 0.02 in place of an assist."""
    from tests.connect.external import foreign

    foreign.write(tmp_path, {"modelDescription.xml": foreign.description(), foreign.BINARY: foreign.library(tmp_path)})
    example = load("fmu_controller")
    monkeypatch.setattr(example, "FMU", tmp_path / "foreign.fmu")
    monkeypatch.setattr(example, "INPUTS", {"torsion_bar_torque": "Rack.q"})
    monkeypatch.setattr(example, "OUTPUT", "Rack.force")
    env = gym.make_vec(id_of("AssistRelease"), num_envs=2)
    found, zero = (held_out.drive(env, make(env), (1, 2)) for make in (example.FmuAssist, ZeroAction))

    class Own(ZeroAction):
        def act(self, observation):
            units, largest = env.unwrapped.observation_scale, env.unwrapped.task.action.scale
            return 0.02 * (observation[:, 2:3] * units[2]) / largest

    np.testing.assert_allclose(found.reward, held_out.drive(env, Own(env), (1, 2)).reward, rtol=1e-6)
    assert (found.reward != zero.reward).all()
    env.close()


def test_process_controller(monkeypatch):
    """It earns what a class of the same equation earns, to the bit, and says when the process is gone."""
    example = load("process_controller")
    with example.socketserver.ThreadingTCPServer(("127.0.0.1", 0), example.Program) as server:
        monkeypatch.setattr(example, "ADDRESS", server.server_address)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        env = gym.make_vec(id_of("AssistRelease"), num_envs=2)
        controller = example.ProcessAssist(env)
        found = held_out.drive(env, controller, (1, 2))
        monkeypatch.setattr(example.Program, "handle", lambda self: None)
        with pytest.raises(ConnectionError):
            example.ProcessAssist(env)
        server.shutdown()
        controller.lines.close()

    class Own(ZeroAction):
        def act(self, observation):
            seen = observation * env.unwrapped.observation_scale
            gain = np.where(seen[:, 7:8] < 3.0, 3.0, 0.15)  # speed [m/s]
            return gain * seen[:, 2:3] / env.unwrapped.task.action.scale

    np.testing.assert_array_equal(found.reward, held_out.drive(env, Own(env), (1, 2)).reward)
    assert (found.reward != held_out.drive(env, ZeroAction(env), (1, 2)).reward).all()
    env.close()


@needs("mujoco")
def test_joint_friction():
    """Laws hold a constant load; one with a true stick holds an oscillating load too. MuJoCo's own friction creeps."""
    example = load("joint_friction")
    found = example.main()
    coulomb, lugre, elasto_plastic = (found[law] for law in example.LAWS)
    assert max(coulomb[0], lugre[0], elasto_plastic[0]) < 1e-9
    assert max(coulomb[1], elasto_plastic[1]) < 1e-9 < lugre[1]
    assert found["frictionloss, default"][0] > 1e-3


@pytest.fixture
def own_laws(monkeypatch):
    """The module of the example, importable in other processes too, and forgotten afterwards."""
    monkeypatch.syspath_prepend(str(FOLDER))
    with law.LAWS.restored():
        yield importlib.import_module("own_friction_laws")
        del sys.modules["own_friction_laws"]


@pytest.mark.whole
def test_own_friction_laws(own_laws, capsys):
    own_laws.main()
    assert capsys.readouterr().out.count("keeps every contract") == 2


@pytest.mark.parametrize("i", [1.5, 2.0, 3.0])
def test_the_equation_of_the_example_has_dahls_closed_form(own_laws, i):
    """(1 - F/F_c)^(1-i) = 1 + (i - 1) sigma_0 x/F_c on loading."""
    x = np.linspace(0.0, 0.05, 30)
    F = friction.response({"law": "dahl_exponent", "i": i}, x, 1e-3)
    np.testing.assert_allclose((1.0 - F / 0.9) ** (1.0 - i), 1.0 + (i - 1.0) * 100.0 * x / 0.9, rtol=1e-7)


def test_the_page_on_own_laws_shows_the_example():
    page = (FOLDER.parent / "docs" / "own_friction_law.md").read_text()
    code = page.split("```python\n")[1].split("```")[0]
    assert code in (FOLDER / "own_friction_laws.py").read_text()
