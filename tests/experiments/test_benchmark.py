"""The benchmark: what a score is, result files that anybody can repeat, the table, and the tutorial's controller."""

import copy
import hashlib
import json
import re
import sys
import zipfile
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from steer_env import assists, drivers, friction
from steer_env.experiments.cli.main import main
from steer_env.experiments.learning import benchmark, held_out, policy, records, tuners
from steer_env.experiments.learning.benchmark import CONTROLLER, REFERENCE, ZERO, Result
from steer_env.experiments.learning.constants import SUITES
from steer_env.experiments.learning.controllers import ZeroAction
from steer_env.experiments.learning.held_out import Episodes
from steer_env.experiments.pages import own_modules
from steer_env.experiments.reports import benchmark_page
from steer_env.friction.numerics import toml
from steer_env.registration import DRIVEN, id_of
from tests.maintain.__main__ import run as maintain
from tests.needs import needs
from tests.tools import scores

DOCS = Path(__file__).parents[2] / "docs"
TUTORIAL = (DOCS / "benchmark.md").read_text(encoding="utf-8")
CODE = re.search(r"^```python\n(.*?)^```", TUTORIAL, flags=re.DOTALL | re.MULTILINE)[1]
RELEASE = id_of("AssistRelease")
NAME = "assists-class-my_assist-MoreAssist.json"


@pytest.fixture
def there(tmp_path, monkeypatch):
    """A working directory with the controller of the tutorial; its module is forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path[:])
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda name: str(tmp_path / "cache" / name))
    (tmp_path / "my_assist.py").write_text(CODE)
    yield tmp_path
    for name in ("my_assist", "other"):
        sys.modules.pop(name, None)
        own_modules._sources.pop(name, None)


@pytest.fixture
def short(monkeypatch):
    """A suite of one id, the quickest one."""
    monkeypatch.setitem(SUITES, "assists", {"AssistRelease": "active_return"})


def made(rewards, references, zeros, costs=0.0):
    """Episodes of an id with these rewards; no own ones for None."""

    def episodes(reward):
        reward = np.asarray(reward, float)
        return Episodes(
            reward, np.full(reward.size, costs), np.zeros(reward.size, np.int64), {"rms_feel_error": reward}
        )

    own = {} if rewards is None else {CONTROLLER: episodes(rewards)}
    return own | {ZERO: episodes(zeros), REFERENCE: episodes(references)}


def result_of(*found):
    """A result with these episodes of the first ids of the assists."""
    whole = benchmark.suite("assists")
    of = whole._replace(drives=dict(list(whole.drives.items())[: len(found)]))
    n = found[0][ZERO].reward.size
    about = {"name": "own", "kind": "class", "terms": {}, "sha256": {}}
    return Result(of, about, tuple(range(n)), dict(zip(of.drives, found)))


def test_zero_action_scores_0_and_the_reference_1_without_an_interval():
    references, zeros = [3.0, 4.5, 9.0], [1.0, 2.0, 2.5]
    assert benchmark.score(result_of(made(zeros, references, zeros))) == (0.0, 0.0, 0.0)
    assert benchmark.score(result_of(made(references, references, zeros))) == (1.0, 1.0, 1.0)
    assert benchmark.score(result_of(made([0.0, 1.0, 1.5], references, zeros))).value == pytest.approx(-3.0 / 11.0)


def test_the_interval_is_that_of_a_bootstrap_over_the_seeds():
    """Of a ratio whose terms depend on the seed, in two ids that share the seeds; the third is not entered."""
    rng = np.random.default_rng(1)
    seeds = rng.normal(size=400)
    zeros, spans = rng.normal(5.0, 2.0, 400), 3.0 + 0.5 * seeds
    gains = [0.8 * spans + 0.4 * seeds + rng.normal(0.0, 0.3, 400), 1.1 * spans + rng.normal(0.0, 0.5, 400)]
    found = benchmark.score(
        result_of(*(made(zeros + gain, zeros + spans, zeros) for gain in gains), made(None, zeros + spans, zeros))
    )
    drawn = rng.integers(0, 400, (4000, 400))
    values = sum(gain[drawn].mean(axis=1) / spans[drawn].mean(axis=1) for gain in gains) / 3.0
    assert found.value == pytest.approx(sum(gain.mean() for gain in gains) / spans.mean() / 3.0)
    assert found.high - found.low == pytest.approx(np.diff(np.quantile(values, [0.025, 0.975]))[0], rel=0.1)


def test_a_cost_above_the_limit_is_told():
    above, below = (result_of(made([1.0, 2.0], [3.0, 3.5], [0.0, 0.5], cost)) for cost in (1.1, 0.9))
    assert [part.beyond_limit for each in (above, below) for part in benchmark.parts(each).values()] == [True, False]


@pytest.mark.parametrize("name", SUITES)
def test_the_references_are_baselines_of_ids_of_today(name):
    assert all(drive.reference in drive.baselines for drive in benchmark.suite(name).drives.values())


def test_drivers_and_assists_have_all_ids_of_their_kind_and_the_friction_of_the_car():
    for name, kind in (("drivers", "Driver"), ("assists", "Assist")):
        assert set(benchmark.suite(name).drives) == {env_id for env_id in DRIVEN if kind in env_id}


def test_a_drive_has_its_law_and_one_policy_enters_all_drives_of_its_id(monkeypatch):
    of = benchmark.suite("friction")
    shipped = benchmark.entry("shipped", of)
    assert set(shipped.makers) == set(of.ids) == {id_of("DriverOnCentre"), id_of("AssistWeave")}
    monkeypatch.setitem(SUITES, "friction", {f"AssistRelease {law}": "damping" for law in ("coulomb", "viscous")})
    of = benchmark.suite("friction")
    (result,) = benchmark.enter([benchmark.entry("damping", of)], of, benchmark.held_out_seeds(2))
    for name, law in zip(of.drives, ("coulomb", "viscous")):
        env = gym.make_vec(RELEASE, num_envs=2, friction=law)
        alone = held_out.drive(env, assists.make("damping", env), benchmark.held_out_seeds(2))
        env.close()
        assert name == f"{RELEASE} {law}"
        assert result.episodes[name][CONTROLLER].reward.tolist() == alone.reward.tolist()
    assert len({each[ZERO].reward[0] for each in result.episodes.values()}) == 2
    assert scores.thresholds([benchmark.score_entry(benchmark.document(result))]) == {}


def test_a_tuner_is_worth_its_best_set_and_a_search_comes_near_the_own_assist():
    """In another context for each seed."""
    found = {}
    for make in (ZeroAction, tuners.OwnAssist, tuners.GaussNewton):
        env = benchmark.suite("tuners").drives[id_of("TuneOnCentre")].environment(2)
        found[make] = tuners.tune(env, make(env), (1, 2))
        contexts = [each._drawn[1].context for each in env.envs]
        assert contexts[0] != contexts[1]
        env.close()
    zero, own, search = (found[make].reward for make in found)
    assert (own > zero + 5.0).all()
    assert ((search - zero) / (own - zero) > 0.6).all()
    assert (found[ZeroAction].cost >= 0.0).all()


def test_the_search_of_a_tuner_solves_a_linear_problem_by_its_first_full_step():
    rng = np.random.default_rng(0)
    J, solution = rng.normal(size=(6, 3)), np.array([0.1, -0.2, 0.15])
    search = tuners._search(3)
    action = next(search)
    for _ in range(4):  # the start and a step of each parameter
        action = search.send(J @ (action - solution))
    np.testing.assert_allclose(action, solution, atol=2e-3)  # but for the ridge


def test_a_prediction_is_rewarded_in_decibels_of_its_error():
    env = records.Records("masing", 3)
    seen, _ = env.reset(seed=(1, 2, 3))
    assert np.isfinite(seen[:, 1, : env.fitted]).all()
    assert np.isnan(seen[:, 1, env.fitted :]).all()
    assert not np.array_equal(seen[0, 1, : env.fitted], seen[1, 1, : env.fitted])
    truth = env._truth
    for prediction, reward in (
        (0.0, 0.0),
        (0.9 * truth, 20.0),
        (truth, records.LARGEST_REWARD),
        (-truth, -20.0 * np.log10(2.0)),
    ):
        again, _ = env.reset(seed=(1, 2, 3))
        np.testing.assert_array_equal(again, seen)
        np.testing.assert_allclose(env.step(prediction)[1], reward, atol=1e-9)
        with pytest.raises(RuntimeError, match="the episodes are over"):  # or the reward would tell the torque
            env.step(prediction)


def test_contacts_of_one_seed_are_others_with_another_law():
    seen = [records.Records(law, 1).reset(seed=(1,))[0] for law in ("dahl", "masing")]
    level = [np.nanmax(np.abs(each[0, 1])) for each in seen]
    assert abs(level[0] / level[1] - 1.0) > 0.05


@pytest.mark.whole
def test_a_tuner_is_entered_and_repeated(there, monkeypatch, capsys):
    monkeypatch.setitem(SUITES, "tuners", {"TuneOnCentre": "own_assist"})
    assert main(["benchmark", "gauss_newton", "--suite", "tuners", "--episodes", "2", "--out", "out"]) == 0
    file = there / "out" / "tuners-baseline-gauss_newton.json"
    assert 0.5 < json.loads(file.read_text())["score"]["value"] < 1.5
    assert main(["benchmark", "--verify", str(file), "--workers", "2"]) == 0
    assert "driven again, all 6 episodes are the same" in capsys.readouterr().out


@pytest.mark.parametrize("law", [law for name in SUITES["identification"] for law in name.split()[1:]])
def test_the_fit_of_the_true_law_predicts_a_contact_best(law):
    env, rewards = records.Records(law, 1), {}
    for name, make in records.BASELINES.items():
        seen, _ = env.reset(seed=(5,))
        rewards[name] = env.step(make(env).act(seen))[1][0]
    assert max(rewards, key=rewards.get) == law
    assert rewards[law] > 35.0 > 10.0 > rewards["coulomb"]


def test_a_record_is_predicted_by_dahls_law_where_its_fit_is_refused(monkeypatch):
    asked, fit = [], friction.fit

    def refused(*given, law, **more):
        asked.append(law)
        if law == "lugre":
            raise ValueError("did not converge")
        return fit(*given, law=law, **more)

    env = records.Records("lugre", 1)
    seen, _ = env.reset(seed=(5,))
    expected = records.BASELINES["dahl"](env).act(seen)
    monkeypatch.setattr(friction, "fit", refused)
    np.testing.assert_array_equal(records.BASELINES["lugre"](env).act(seen), expected)
    assert asked == ["lugre", "dahl"]


LEVEL = """
import numpy as np

class Level:
    def __init__(self, env): self.fitted = env.fitted
    def reset(self, rows=None): pass
    def act(self, seen):
        level = np.abs(seen[:, 1, :self.fitted]).max(axis=1, keepdims=True)
        return level * np.sign(np.gradient(seen[:, 0], axis=1)[:, self.fitted:])
"""


def test_who_identifies_friction_enters_as_any_controller(there, monkeypatch, capsys):
    monkeypatch.setitem(SUITES, "identification", {"FrictionRecord masing": "dahl"})
    (there / "other.py").write_text(LEVEL)
    enter = ["benchmark", "other.py:Level", "--suite", "identification", "--episodes", "2", "--out", "out"]
    assert main(enter) == 0
    value = json.loads((there / "out" / "identification-class-other-Level.json").read_text())["score"]["value"]
    assert 0.0 < value < 0.5
    assert main(["benchmark", "other.py:Level", "--verify", "out/identification-class-other-Level.json"]) == 0
    assert "driven again, all 6 episodes are the same" in capsys.readouterr().out
    assert "friction record, masing" in (there / "out" / "index.html").read_text(encoding="utf-8").lower()


def test_every_baseline_states_its_terms():
    told = toml.loads(benchmark.TERMS_FILE.read_text(encoding="utf-8"))
    known = {"zero", "random", *assists.available(), *drivers.available(), *tuners.BASELINES, "fit"}
    assert known - {"free"} <= set(told)
    assert benchmark.entry("dahl", benchmark.suite("identification")).terms == told["fit"]
    assert all(set(terms) <= set(benchmark_page.TERMS) and terms["information"] for terms in told.values())
    assert all(terms["tuning"] for terms in told.values())
    lqg = benchmark.entry("lqg", benchmark.suite("assists"))
    assert lqg.terms["tuning"] == "1920 episodes in 4 of 6 ids"


def test_the_controller_of_the_tutorial_is_entered_and_repeated(there, short, capsys):
    """By the commands of the page, in two episodes of one id; the same file to the bit, also on two workers."""
    assert len(CODE.splitlines()) <= 20
    commands = re.findall(r"^steer-env (benchmark my_assist.py:MoreAssist .*)$", TUTORIAL, flags=re.MULTILINE)[:2]
    enter, verify = (command.split() for command in commands)
    assert main([*enter, "--episodes", "2"]) == 0
    first = (there / "benchmark" / NAME).read_bytes()
    said = capsys.readouterr().out
    assert re.match(rf"benchmark/{NAME}: score -?−?[\d.]+ ± ", said)
    assert main(verify) == 0
    assert "driven again, all 6 episodes are the same" in capsys.readouterr().out
    assert main([*enter, "--episodes", "2", "--workers", "2", "--out", "again"]) == 0
    assert (there / "again" / NAME).read_bytes() == first
    page = (there / "benchmark" / "index.html").read_text(encoding="utf-8")
    assert "Torsion-bar torque, handwheel angle, speed" in page
    assert "by hand, a dozen trials" in page


@pytest.fixture(scope="module")
def entered(tmp_path_factory):
    """A result file of a baseline in the short suite, as JSON."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SUITES, "assists", {"AssistRelease": "active_return"})
        of = benchmark.suite("assists")
        (result,) = benchmark.enter([benchmark.entry("damping", of)], of, benchmark.held_out_seeds(2))
        return json.loads(benchmark.result_text(benchmark.document(result)))


def changed(entered, place, value):
    """A copy of a result file with another value at a place."""
    found = copy.deepcopy(entered)
    *way, last = place
    inner = found
    for key in way:
        inner = inner[key]
    inner[last] = value
    return found


def written(path, found):
    """The path of a file with this result."""
    path.write_text(benchmark.result_text(found), encoding="utf-8")
    return str(path)


CHANGED = {
    "reward": ((CONTROLLER, "reward", 0), 99.0, f"{RELEASE}, controller, seed 1000000"),
    "cost": ((ZERO, "cost", 1), 7.0, f"{RELEASE}, zero, seed 1000001"),
    "failure": ((REFERENCE, "failure", 0), 3, f"{RELEASE}, reference, seed 1000000"),
    "metric": ((CONTROLLER, "metrics", "rms_feel_error", 1), 0.0, f"{RELEASE}, controller, seed 1000001"),
}


@pytest.mark.parametrize("name", CHANGED)
def test_an_episode_that_is_another_is_named(name, entered, short, tmp_path, capsys):
    place, value, told = CHANGED[name]
    file = written(tmp_path / "result.json", changed(entered, ("episodes", RELEASE, *place), value))
    assert main(["benchmark", "--verify", file]) == 1
    assert f"{file}: driven again, 1 of 6 episodes are others: {told}\n" in capsys.readouterr().out


def test_a_result_is_driven_again_on_its_own_seeds(entered, short, tmp_path):
    of = benchmark.suite("assists")
    (result,) = benchmark.enter([benchmark.entry("damping", of)], of, (7, 8))
    file = written(tmp_path / "result.json", benchmark.document(result))
    assert main(["benchmark", "--verify", file]) == 0
    file = written(tmp_path / "other.json", changed(entered, ("seeds", 0), 7))
    assert main(["benchmark", "--verify", file]) == 1


def test_a_class_is_compared_with_the_one_that_is_given(there, short, capsys):
    enter = ["benchmark", "--suite", "assists", "--episodes", "2", "--out", "out"]
    assert main([*enter, "my_assist:MoreAssist"]) == 0
    (there / "other.py").write_text(CODE.replace("0.3", "0.4").replace("MoreAssist", "Other"))
    assert main(["benchmark", "other.py:Other", "--verify", f"out/{NAME}"]) == 1
    assert f"2 of 6 episodes are others: {RELEASE}, controller, seed 1000000; " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[:500], "line"),
        (lambda text: "[]", "is no result of 'steer-env benchmark'"),
        (lambda text: '{"suite": "assists"}', "which holds suite, controller, seeds, score, parts, episodes, trace"),
        (lambda text: text.replace('"suite": "assists"', '"suite": "cranes"'), "the suite must be one of"),
        (lambda text: text.replace(RELEASE, "steer_env/AssistRelease-v1"), "its episodes are not those of the suite"),
        (lambda text: text.replace('"reward": [', '"rewards": [', 1), "is no result as 'steer-env benchmark'"),
        (lambda text: text.replace('"kind": "baseline"', '"sort": "baseline"'), "writes it: KeyError('kind')"),
        (lambda text: text.replace("1000001", '"x"'), "a seed must be"),
        (lambda text: text.replace('"packages"', '"parcels"'), "its trace holds no packages"),
        (lambda text: b"\xff\xfe" + text.encode(), "expected text in UTF-8"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_result_is_refused_in_one_sentence(change, message, entered, short, tmp_path, capsys):
    path, text = tmp_path / "broken.json", change(benchmark.result_text(entered))
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert main(["benchmark", "--verify", str(path)]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert str(path) in told
    assert told.count("\n") == 1


def test_what_the_program_writes_of_a_class_it_also_reads(there, short):
    """Its author's words may have tabs, and signs that are not printed."""
    (there / "other.py").write_text(CODE.replace('"""Torsion-bar', '"""Of\t\u200btwo'), encoding="utf-8")
    enter = ["benchmark", "other.py:MoreAssist", "--suite", "assists", "--episodes", "2", "--workers", "1"]
    assert main([*enter, "--out", "out"]) == 0


@pytest.mark.parametrize("kind", benchmark.CONTROLLER_KINDS)
def test_no_code_that_a_result_names_is_run(kind, entered, short, tmp_path, monkeypatch, capsys):
    """It would judge itself."""
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text("import os\nos._exit(0)\n", encoding="utf-8")
    named = {**entered["controller"], "kind": kind, "name": "own.py:Own"}
    assert main(["benchmark", "--verify", written(Path("result.json"), {**entered, "controller": named})]) == 2
    assert "result.json is of 'own.py:Own': give this controller beside --verify" in capsys.readouterr().err


def test_a_result_of_another_program_is_driven_with_a_caution(entered, short, tmp_path, capsys):
    file = written(tmp_path / "then.json", changed(entered, ("trace", "sources"), "0123456789abcdef"))
    assert main(["benchmark", "--verify", file]) == 0
    assert "was made by another program: sources 0123456789abcdef then" in capsys.readouterr().err


FAILING = {
    "shape": ("def act(self, observation): return observation", r"its act must give numbers \(2, 1\), got float32"),
    "nan": ("def act(self, observation): return observation[:, :1] * float('nan')", "its act gave nan, which is"),
    "huge": ("def act(self, observation): return [[1e300]] * len(observation)", "its act gave 1e.300, which is"),
    "act": ("def act(self, observation): return {}['gain']", r"its act raised KeyError: 'gain' \(other.py, line 4\)"),
    "ragged": ("def act(self, observation): return [[1], [1, 2]]", "its act raised ValueError"),
    "mute": (
        "class Mute(BaseException):\n  def __str__(self): 1 / 0\n def act(self, observation): raise self.Mute",
        r"its act raised Mute \(other.py, line 6\)",
    ),
    "exit": ("def act(self, observation): raise SystemExit(3)", r"its act raised SystemExit: 3 \(other.py, line 4\)"),
    "reset": ("def act(self, observation): pass\n def reset(self, rows=None): 1 / 0", "its reset raised ZeroDivision"),
    "init": ("act = print\n def __init__(self, env): env.no", "its constructor raised AttributeError"),
    "no act": ("pass", "has no class Own with the methods reset and act"),
    "import": ("pass\nraise OSError('gone')", r"cannot be imported: OSError: gone \(other.py, line 5\)"),
    "syntax": ("def", r"cannot be imported: SyntaxError: .* \(other.py, line 4\)$"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAILING)
def test_a_controller_that_fails_is_told_in_one_sentence(name, there, short, capsys):
    body, message = FAILING[name]
    (there / "other.py").write_text(
        f"class Own:\n def __init__(self, env): pass\n def reset(self, rows=None): pass\n {body}\n"
    )
    enter = ["benchmark", "--suite", "assists", "--episodes", "2", "--workers", "1", "--out", "out"]
    assert main([*enter, "other.py:Own"]) == 2
    told = capsys.readouterr().err
    assert re.search(message, told)
    assert told.count("\n") == 1
    assert not (there / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["zero"], "give one of --suite (drivers, assists, friction, tuners, identification), --env and --verify"),
        (["zero", "--suite", "assists", "--env", RELEASE], "give one of --suite"),
        (["zero", "--env", "steer_env/AssistRelease-v1"], "it is replaced by steer_env/AssistRelease-v4"),
        (["zero", "--verify", "some.json", "--episodes", "3"], "--episodes has no effect here"),
        (["zero", "zero", "--suite", "assists"], "entries need names of their own, got zero, zero"),
        (["zero", "--suite", "assists", "--out", "broken"], "assists-class-x.json: is no result"),
        (["nothing", "--suite", "assists"], "'nothing' is no controller: give FILE.py:CLASS"),
        (["absent.py:Own", "--suite", "assists"], "no file absent.py"),
        (["absent:Own", "--suite", "assists"], "the module absent cannot be imported: ModuleNotFoundError"),
        (["json.py:MoreAssist", "--suite", "assists"], "already: give"),
        ([str(policy.SHIPPED_IN / "DriverOnCentre-v3"), "--suite", "assists"], "holds no policy of an id of the suite"),
        (["zero", "lqg", "--verify", "some.json"], "--verify repeats one result"),
    ],
)
def test_a_bad_command_is_refused_in_one_sentence(words, message, there, capsys):
    (there / "json.py").write_text(CODE)
    (there / "broken").mkdir()
    (there / "broken" / "assists-class-x.json").write_text("{}")
    assert main(["benchmark", *words]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1


def test_policies_enter_the_ids_of_their_training():
    of = benchmark.suite("assists")
    found = benchmark.entry("shipped", of)
    files = {env_id: policy.shipped_policy(env_id) for env_id in found.makers}
    assert set(files) == {id_of("AssistAllRound"), id_of("AssistWeave")}
    assert found.sha256 == {env_id: hashlib.sha256(file.read_bytes()).hexdigest() for env_id, file in files.items()}
    assert found.cautions == ()
    one = benchmark.entry(str(files[id_of("AssistWeave")]), of)
    assert (set(one.makers), one.name) == ({id_of("AssistWeave")}, "AssistWeave-v3")


def test_an_id_is_a_suite_of_its_own(there, capsys):
    enter = [
        "benchmark",
        "zero",
        "active_return",
        "--env",
        RELEASE,
        "--episodes",
        "2",
        "--workers",
        "1",
        "--out",
        "out",
    ]
    assert main(enter) == 0
    said = capsys.readouterr().out
    name = RELEASE.removeprefix("steer_env/")
    for controller, score in (("zero", 0.0), ("active_return", 1.0)):
        path = Path("out") / f"{name}-baseline-{controller}.json"
        assert str(path) in said
        assert benchmark.read(path)["score"]["value"] == pytest.approx(score)
    assert main(["benchmark", "--verify", str(path)]) == 0


@needs("stable_baselines3", "sb3_contrib")
@pytest.mark.parametrize("name", ["PPO", "A2C", "SAC", "TD3", "RecurrentPPO", "TQC"])
def test_a_policy_of_any_script_acts_as_its_model_does(name, tmp_path):
    import sb3_contrib
    import stable_baselines3

    from steer_env.sb3 import SteerVecEnv

    kind = getattr(stable_baselines3, name, None) or getattr(sb3_contrib, name)
    words = "MlpLstmPolicy" if name == "RecurrentPPO" else "MlpPolicy"
    model = kind(words, SteerVecEnv(RELEASE, 2), policy_kwargs={"net_arch": [8]}, device="cpu", seed=3)
    model.save(tmp_path / "own")
    env = gym.make_vec(RELEASE, num_envs=3)
    found = benchmark.entry(str(tmp_path / "own.zip"), benchmark.of_id(RELEASE)).makers[RELEASE](env)
    observations, _ = env.reset(seed=1)
    state, starts = None, np.ones(3, bool)
    for _ in range(4):
        expected, state = model.predict(observations, state, starts, deterministic=True)
        np.testing.assert_array_equal(found.act(observations), expected)
        observations, *_ = env.step(expected)
        starts[:] = False


@needs("stable_baselines3")
def test_a_policy_of_a_script_is_entered_and_repeated(there, capsys):
    from stable_baselines3 import PPO

    from steer_env.sb3 import SteerVecEnv

    model = PPO("MlpPolicy", SteerVecEnv(RELEASE, 2), n_steps=8, batch_size=16, n_epochs=1, device="cpu", seed=3)
    model.learn(16).save("own")
    end = ["--episodes", "2", "--workers", "1", "--out", "out"]
    assert main(["benchmark", "own.zip", "--env", RELEASE, *end]) == 0
    assert "caution: own.zip is taken to see the observations of" in capsys.readouterr().err.replace(f"{there}/", "")
    path = f"out/{RELEASE.removeprefix('steer_env/')}-policy-own.json"
    assert main(["benchmark", "own.zip", "--verify", path]) == 0
    assert benchmark.read(Path(path))["controller"]["terms"]["tuning"] == "16 steps of training in 1 id"
    assert main(["benchmark", "own.zip", "--suite", "assists", *end]) == 2
    assert "does not say of which id it is: give --env ID" in capsys.readouterr().err
    assert main(["benchmark", "own.zip", "--env", id_of("AssistWeave"), *end]) == 2
    assert "own.zip was trained with the observation space" in capsys.readouterr().err.replace(f"{there}/", "")


def test_an_archive_that_is_no_policy_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("data", "{}")
    with pytest.raises(ValueError, match=r"other\.zip is no policy of Stable-Baselines3"):
        benchmark.entry(str(tmp_path / "other.zip"), benchmark.of_id(RELEASE))


def test_two_policies_of_an_id_are_refused(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "policy.zip").write_bytes(policy.shipped_policy(id_of("AssistWeave")).read_bytes())
    with pytest.raises(ValueError, match="an entry has one policy for each id"):
        benchmark.entry(str(tmp_path), benchmark.suite("assists"))
    assert len(benchmark.entry(str(tmp_path / "one"), benchmark.suite("assists")).cautions) == 1


def test_the_table_ranks_the_entries_by_their_scores(short):
    zeros, references = [0.0, 0.5], [3.0, 3.5]
    found = {"good": [2.0, 2.6], "bad": [1.0, 1.4]}
    results = []
    for name, rewards in found.items():
        result = result_of(made(rewards, references, zeros, 1.5))
        result = result._replace(controller={**result.controller, "name": name})
        results.append(benchmark.score_entry(benchmark.document(result)))
    (standing,) = benchmark_page.standings(results[::-1])
    assert standing.names == ["good", "bad"]
    rows = standing.summary().rows
    assert [row[0] for row in rows] == ["good", "bad"]
    assert all(row[2].endswith(benchmark_page.MARK) for row in rows)


@pytest.mark.parametrize(("value", "expected"), [(2.3456, 2.34), (-2.3456, -2.35), (812.34, 812.0), (0.0, 0.0)])
def test_a_threshold_is_rounded_down(value, expected):
    assert scores.rounded_down(value) == expected


def test_scores_and_thresholds_come_from_a_folder_of_results(entered, short, tmp_path):
    folder, kept, thresholds = tmp_path / "out", tmp_path / "scores.json", tmp_path / "thresholds.json"
    folder.mkdir()
    written(folder / "assists-baseline-damping.json", entered)
    thresholds.write_text(json.dumps({"other": 1.0, RELEASE: 5.0}))
    assert maintain(["scores", str(folder), "--out", str(kept), "--thresholds", str(thresholds)]) == 0
    (entry,) = scores.read(kept)
    assert entry.score == benchmark.score_entry(entered).score
    reward = entered["parts"][RELEASE]["summary"]["reward"]["value"]
    assert json.loads(thresholds.read_text()) == {"other": 1.0, RELEASE: scores.rounded_down(reward)}
    assert f"`reward_threshold`: {scores.rounded_down(reward):g}." in scores.markdown([entry])


def test_the_ids_have_the_thresholds_of_the_scores():
    assert scores.thresholds(scores.read()) == {env_id: gym.spec(env_id).reward_threshold for env_id in DRIVEN}
