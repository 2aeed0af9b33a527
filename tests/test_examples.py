"""The examples run, in short."""

import ast
import importlib.util
import json
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
from steer_env.testing import check_friction_law
from steer_env.testing.histories import memory_after
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


@needs("pandas")
@pytest.mark.whole
@pytest.mark.parametrize("path", sorted((FOLDER / "notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_something_in_each_code_cell_that_ends_in_a_result(path, monkeypatch):
    """Each cell in turn, as plain Python; what ends a cell has a text that fits on a screen, or a table."""
    monkeypatch.chdir(path.parent)
    plt.switch_backend("agg")
    names, shown = {}, []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]))
        result = ast.Expression(tree.body.pop().value) if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, path.name, "exec"), names)
        if result is not None:
            shown.append(eval(compile(result, path.name, "eval"), names))
    assert len(shown) >= 4
    assert all(hasattr(each, "_repr_html_") or len(repr(each)) < 500 for each in shown)
    assert any(axes.lines for number in plt.get_fignums() for axes in plt.figure(number).axes)
    plt.close("all")


@needs("stable_baselines3", "tensorboard")
def test_own_wrapper(tmp_path, monkeypatch):
    """Its training writes a curve; its class acts without the wrapper as the policy does behind it."""
    monkeypatch.chdir(tmp_path)
    example = load("own_wrapper")
    example.main(64 * 128)
    assert list((tmp_path / "own_wrapper").rglob("events.out.tfevents*"))
    name = id_of("AssistWeave")
    plain, wrapped = gym.make_vec(name, num_envs=2), gym.make_vec(name, num_envs=2, wrapper=example.Calm)
    controller = example.Trained(plain)
    controller.reset()
    seen, expected = plain.reset(seed=1)[0], wrapped.reset(seed=1)[0]
    for _ in range(5):
        action = controller.act(seen)
        np.testing.assert_array_equal(action, controller.model.predict(expected, deterministic=True)[0])
        seen, expected = plain.step(action)[0], wrapped.step(action)[0]


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
    """Laws hold a constant load; one with a true stick holds an oscillating load too. MuJoCo's default creeps."""
    example = load("joint_friction")
    found = example.main()
    coulomb, lugre, elasto_plastic = (found[f"here: {law}"] for law in example.LAWS)
    noslip, bristle = (found[f"MuJoCo: {name}"] for name in ("frictionloss, one noslip iteration", "dcmotor"))
    assert max(coulomb[0], lugre[0], elasto_plastic[0], noslip[0], bristle[0]) < 1e-9
    assert max(coulomb[1], elasto_plastic[1], noslip[1]) < 1e-9 < min(lugre[1], bristle[1])
    assert found["MuJoCo: frictionloss, default"][0] > 1e-3
    # Elastic and damped: pi d w (F/k)^2. MuJoCo takes the spring at the angle before the step, which undoes k h/2 of d.
    damping = 1.0 - 0.5 * 1000.0 * example.STEP
    assert found["MuJoCo: springyield"][3] == pytest.approx(2.0 * np.pi**2 * damping * (0.5 / 1000.0) ** 2, rel=1e-2)


def imported(monkeypatch, name):
    """The module of an example with laws, importable in other processes too, and forgotten afterwards."""
    monkeypatch.syspath_prepend(str(FOLDER))
    with law.LAWS.restored():
        yield importlib.import_module(name)
        del sys.modules[name]


@pytest.fixture
def own_laws(monkeypatch):
    yield from imported(monkeypatch, "own_friction_laws")


@pytest.fixture
def rate_and_state(monkeypatch):
    yield from imported(monkeypatch, "rate_and_state")


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


RATE_AND_STATE = {"F_0": 0.9, "a": 0.02, "b": 0.025, "D_c": 0.1, "v_0": 0.1, "theta_0": 3.0}
STIFF = {"law": "rate_and_state", "k": 1e4, **RATE_AND_STATE}  # a/k is 2e-5 of D_c: the slip follows the motion


@pytest.mark.whole
def test_rate_and_state_keeps_every_contract(rate_and_state):
    check_friction_law("rate_and_state")


@pytest.mark.parametrize("v", [1e-3, 0.1, 0.7, -5.0])
def test_rate_and_state_slides_with_the_steady_torque_of_the_literature(rate_and_state, v):
    """mu = mu_0 + (a - b) ln(v/v_0) of Dieterich and Ruina; the regularisation is below exp(-2 F_0/a)."""
    T = friction.response({"law": "rate_and_state", **RATE_AND_STATE}, [0.0, np.sign(v) * 5.0], 5.0 / abs(v))[-1]
    assert T == pytest.approx(np.sign(v) * (0.9 + (0.02 - 0.025) * np.log(abs(v) / 0.1)), rel=1e-8)


def test_rate_and_state_answers_a_jump_of_the_speed_as_the_literature_does(rate_and_state):
    """At once by a ln(v2/v1), then with theta = D_c/v2 + (D_c/v1 - D_c/v2) exp(-v2 t/D_c) of the ageing law."""
    p, v1, v2, dt, D_c = friction.resolve(STIFF), 0.1, 1.0, 1e-4, 0.1
    memory = memory_after(p, [(v1, 0.5)] * 40)
    slow, t, found = law.torque(p, 1.0, memory, v1), dt * np.arange(1, 4000), []
    for _ in t:
        law.advance(p, 1.0, memory, v2, dt)
        found.append(law.torque(p, 1.0, memory, v2))
    theta = D_c / v2 + (D_c / v1 - D_c / v2) * np.exp(-v2 * t / D_c)
    expected = 0.9 + 0.02 * np.log(v2 / 0.1) + 0.025 * np.log(0.1 * theta / D_c)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert found[0] - slow == pytest.approx(0.02 * np.log(v2 / v1), abs=1e-4)


@pytest.mark.parametrize("hold", [1.0, 10.0, 100.0, 1000.0])
def test_rate_and_state_heals_with_the_logarithm_of_a_hold(rate_and_state, hold):
    """The peak after it is above the steady torque by b ln(1 + v t/D_c), as the age grows by t."""
    p, v, dt = friction.resolve(STIFF), 0.1, 1e-5
    memory = memory_after(p, [(v, 0.5)] * 40)
    steady = law.torque(p, 1.0, memory, v)
    law.advance(p, 1.0, memory, 0.0, hold)
    assert memory[1] + 3.0 == pytest.approx(0.1 / v + hold, rel=1e-3)
    torques = []
    for _ in range(1000):
        law.advance(p, 1.0, memory, v, dt)
        torques.append(law.torque(p, 1.0, memory, v))
    assert max(torques) - steady == pytest.approx(0.025 * np.log(1.0 + v * hold / 0.1), abs=1e-3 * 0.9)


def test_a_motion_starts_with_the_age_of_rest(rate_and_state):
    """The first torque with which a young and an old contact slide differs by b times the logarithm of their ages."""
    peaks = [friction.response(STIFF | {"theta_0": age}, 1e-6 * np.arange(200), 1e-5).max() for age in (1.0, 100.0)]
    assert peaks[1] - peaks[0] == pytest.approx(0.025 * np.log(100.0), rel=0.01)


@pytest.mark.parametrize("vector", [False, True])
def test_an_environment_starts_with_the_age_of_rest(rate_and_state, vector):
    """Two rows and one alone, each with its age; an older contact holds the handwheel more firmly."""
    found = []
    for age in (0.01, 1e6):
        given = {"law": "rate_and_state", "b": 0.1, "theta_0": age}
        name = id_of("AssistWeave")
        env = gym.make_vec(name, num_envs=2, friction=given) if vector else gym.make(name, friction=given)
        env.reset(seed=1)
        actions = np.zeros(env.action_space.shape, np.float32)
        rows = [np.atleast_2d(env.step(actions)[0]) for _ in range(200)]
        assert np.isfinite(rows).all()
        found.append(np.array(rows)[:, 0])
        env.close()
    assert not np.array_equal(found[0], found[1])


def test_a_record_of_reversals_determines_rate_and_state(rate_and_state):
    """At three speeds, stiffness, sliding torque and both effects; the distance and the ages are given."""
    true, dt = RATE_AND_STATE | {"k": 80.0, "F_0": 1.2, "D_c": 0.02}, 5e-3
    pieces = [s * w * dt * np.ones(int(0.16 / (w * dt))) for w in (0.05, 0.2, 0.6) for s in (1.0, -1.0, 1.0, -1.0)]
    x = np.concatenate([[0.0], np.cumsum(np.concatenate(pieces))])
    record = friction.response({"law": "rate_and_state", **true}, x, dt) + 0.05
    fixed = {name: true[name] for name in ("D_c", "v_0", "theta_0")}
    fit = friction.fit(x, record, "rate_and_state", dt=dt, fixed=fixed)
    assert fit.residual < 1e-6
    assert fit.offset == pytest.approx(0.05, rel=1e-4)
    for name in ("k", "F_0", "a", "b"):
        assert getattr(fit.parameters, name) == pytest.approx(true[name], rel=1e-5)


@pytest.mark.parametrize(
    ("given", "message"),
    [({"b": 3.0}, r"b must be less than k D_c = 2, .* got 3"), ({"theta_0": 0.0}, "theta_0 must be")],
)
def test_rate_and_state_refuses_what_does_not_hold(rate_and_state, given, message):
    with pytest.raises(ValueError, match=message):
        friction.make("rate_and_state", **given)
