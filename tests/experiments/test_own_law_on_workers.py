"""A friction law of the user's own reaches the workers of every command that has some."""

import argparse
import functools
import importlib
import pickle
import sys
from unittest.mock import Mock

import pytest

from steer_env.experiments import sweep
from steer_env.experiments.cli import study
from steer_env.experiments.cli.main import main, parser
from steer_env.experiments.pages import own_modules
from steer_env.experiments.sweep import sweep as sweeping
from steer_env.friction import law as laws
from tests.experiments import sweep_cases

# Two elements of Dahl in parallel, the second with half the stiffness and twice the distance.
LAW = """
import math
from typing import NamedTuple
from steer_env import friction
from steer_env.friction.numerics.check import positive
from steer_env.friction.numerics.kernel import kernel

class TwoStates(NamedTuple):
    k: float
    F_c: float

def make(*, k: float = 100.0, F_c: float = 0.9) -> TwoStates:
    return TwoStates(positive("k", k), positive("F_c", F_c))

@kernel
def torque(p, torque_scale, memory, w):
    return 0.5 * p.k * (memory[0] + 0.5 * memory[1])

@kernel
def rate(p, torque_scale, memory, w, out):
    a = p.k * memory[0] / (torque_scale * p.F_c)
    b = 0.5 * p.k * memory[1] / (torque_scale * p.F_c)
    out[0] = w * max(1.0 - math.copysign(a, a * w), 0.0)
    out[1] = w * max(1.0 - math.copysign(b, b * w), 0.0)

@kernel
def energy(p, memory):
    return 0.25 * p.k * (memory[0] ** 2 + 0.5 * memory[1] ** 2)

@kernel
def cut_back(p, torque_scale, memory):
    z = torque_scale * p.F_c / p.k
    memory[0] = min(max(memory[0], -z), z)
    memory[1] = min(max(memory[1], -2.0 * z), 2.0 * z)

friction.register(
    "two_states", TwoStates, make=make, memory_size=lambda p: 2, torque=torque, rate=rate, stored_energy=energy,
    cut_back=cut_back, fitted=("k", "F_c"), units=UNITS,
)
"""
UNITS = '{"k": "N m/rad", "F_c": "N m"}'
NAME, MODULE = "two_states", "own_law"
ASSIST = "steer_env/AssistWeave-v3"
IMPORT = ["--import", MODULE]

# Command -> its words with the law, where it has a place for one. A study takes '--import' before its name or after it.
COMMANDS = {
    "benchmark": ["benchmark", "zero", "--suite", "assists", "--episodes", "2", *IMPORT],
    "run": ["run", "all", "--friction", NAME, *IMPORT],
    "report": ["report", "--friction", NAME, *IMPORT],
    "tune": ["tune", "--friction", NAME, "--budget", "2", *IMPORT],
    "sensitivity": ["sensitivity", "--friction", NAME, "--samples", "4", *IMPORT],
    "policy evaluate": [
        "policy", "evaluate", "damping", "--env", ASSIST, "--friction", NAME, "--episodes", "2", *IMPORT
    ],
    "policy friction-shift": ["policy", "friction-shift", "--friction", NAME, "--seeds", "1", *IMPORT],
    "policy shift": [
        "policy", "shift", "shipped", "--env", ASSIST, "--over", "law", "--friction", NAME, "--episodes", "2", *IMPORT
    ],
    "policy suite": ["policy", "suite", "damping", "--env", ASSIST, *IMPORT],
    "study architecture": ["study", "architecture", "--laws", NAME, "--tests", "weave", *IMPORT],
    "study friction": ["study", *IMPORT, "friction", "--quick"],
    "study friction-sites": ["study", "friction-sites", *IMPORT],
    "study held-torque": ["study", "held-torque", *IMPORT],
    "study loop-width": ["study", "loop-width", "--cars", "compact", *IMPORT],
    "audit": ["audit", "--env", ASSIST, "--rounds", "1", "--steps", "0", *IMPORT],
    "tune-baselines": ["tune-baselines", "--env", ASSIST, "--budget", "1", "--episodes", "1", *IMPORT],
}  # fmt: skip
# One command for each kind of case: a recording, an environment, and laws that nobody names. Each compiles the law.
DRIVEN = ("run", "policy evaluate", "study friction")
DRIVING_FIRST = ("tune",)  # before their sweeps, with the law, which is compiled each time
OF_MAINTAINERS = ("audit", "tune-baselines")


class StoppedError(Exception):
    """The results of some cases, in place of all that a command would do."""


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Writes the law into the working directory; it is forgotten afterwards."""

    def write(units=UNITS):
        (tmp_path / f"{MODULE}.py").write_text(LAW.replace("UNITS", units))
        importlib.invalidate_caches()

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path[:])
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda name: str(tmp_path / "cache" / name))
    with laws.LAWS.restored():
        yield write
        sys.modules.pop(MODULE, None)
        own_modules._sources.pop(MODULE, None)


def run(words):
    """Run a command on two workers."""
    words = [*words, "--workers", "2"]
    return main(words, package="tests.maintain", prog="maintain") if words[0] in OF_MAINTAINERS else main(words)


def of_workers(made, folder=""):
    """The names of the commands of a parser that have workers."""
    found = []
    for action in made._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, each in action.choices.items():
                found += of_workers(each, f"{folder} {name}".strip())
    return [*found, folder] if "--workers" in made._option_string_actions else found


def test_every_command_that_has_workers_is_here():
    found = [
        *of_workers(parser()),
        *of_workers(parser("tests.maintain")),
        *(f"study {name}" for name in study.SWEEPING),
    ]
    assert sorted(COMMANDS) == sorted(found)


@pytest.fixture(scope="module")
def asked():
    """What a sweep of two cases makes of the law, asked for by its name, with the options that a command gives."""
    return functools.partial(sweep.run, sweep_cases.knows_law, [NAME, NAME])


@pytest.mark.whole
@pytest.mark.parametrize("command", [command for command in COMMANDS if command not in DRIVING_FIRST])
def test_workers_import_the_law_before_they_work(command, written, monkeypatch, asked):
    """In place of each command's first cases; the tasks go to worker processes, and each names the module."""
    written()

    def sent(function, tasks, workers):
        raise StoppedError(workers, [task.modules for task in tasks])

    monkeypatch.setattr(sweeping, "run_in_processes", sent)
    monkeypatch.setattr(
        sweep, "run", lambda _, cases, *, notify=None, words=None, store=None, cost=None, **given: asked(**given)
    )
    with pytest.raises(StoppedError) as found:
        run(COMMANDS[command])
    workers, modules = found.value.args
    assert (workers, len(modules)) == (2, 2)
    assert all(MODULE in each for each in modules)


@pytest.mark.whole
@pytest.mark.parametrize("command", DRIVEN)
def test_workers_drive_with_the_law(command, written, monkeypatch):
    """Two of each command's own cases with the law run on its workers."""
    written()
    whole = sweep.run

    def some(function, cases, *, store=None, **options):
        held = [(case, pickle.dumps(case)) for case in cases]
        of_law = [case for case, data in held if NAME.encode() in data or MODULE.encode() in data]  # by name, or itself
        if len(of_law) == 1:
            of_law *= 2  # one case alone would be driven in this process
        raise StoppedError(whole(function, of_law[-2:], **options))

    monkeypatch.setattr(sweep, "run", some)
    monkeypatch.setattr(sweeping, "run_in_processes", counted := Mock(wraps=sweeping.run_in_processes))
    with pytest.raises(StoppedError) as found:
        run(COMMANDS[command])
    assert (len(found.value.args[0]), counted.call_count) == (2, 1)


def test_a_law_that_is_imported_by_a_script_reaches_workers(written, tmp_path):
    """Also where nobody names its module, as in a sweep of one's own."""
    written()
    sys.path.insert(0, str(tmp_path))
    importlib.import_module(MODULE)
    run_here = functools.partial(sweep.run, where=sweep.Where(2))
    assert {knows for _, knows in run_here(sweep_cases.knows_law, [NAME, NAME])} == {(100.0, MODULE)}


@pytest.mark.parametrize("name", ["friction", "held-torque"])
def test_a_law_without_units_is_refused_before_work_begins(name, written, monkeypatch, capsys):
    """These studies stretch every law to other levels."""
    written("None")
    monkeypatch.setattr(sweep, "run", lambda *_, **__: pytest.fail("work has begun"))
    assert run(["study", name, *IMPORT]) == 2
    told = capsys.readouterr().err
    assert f"friction law '{NAME}' declares no unit of k; give units= in its register" in told
    assert told.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "module", "message"),
    [
        ("import no_such_module", MODULE, "No module named 'no_such_module'"),
        ("def make(:", MODULE, "invalid syntax"),
        ("raise SystemExit", MODULE, "SystemExit: no more is known"),
        ("{}['units']", MODULE, "KeyError: 'units'"),
        ("", "own_law.py", f"give the name of the module, --import {MODULE}"),
    ],
)
def test_a_module_that_cannot_be_imported_is_one_sentence(text, module, message, written, tmp_path, capsys):
    written()
    (tmp_path / f"{MODULE}.py").write_text(text)
    with pytest.raises(SystemExit) as stop:
        main(["study", "friction", "--import", module])
    told = capsys.readouterr().err
    assert (stop.value.code, told.count("\n")) == (2, 1)
    assert f"--import {module}: {message}" in told
