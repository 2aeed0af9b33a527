"""The source hash of a kernel changes with all that its machine code depends on, and not with what it does not use."""

import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest

from steer_env.friction.numerics.kernel import COMPILED, kernel, part
from steer_env.friction.numerics.source_hash import UndecidableError, source_hash
from steer_env.vehicle import plant

pytestmark = pytest.mark.skipif(not COMPILED, reason="nothing is compiled")

ROOT = Path(__file__).parents[2]


FACTOR = 2.0


@kernel
def inner(x):
    return FACTOR * x


@part
def outer(x, offset=1.0):
    return inner(x) + offset


def test_everything_that_is_frozen_into_a_kernel_counts(monkeypatch):
    """Constants, the function behind a name, the compiler; not the names of other things."""
    before = source_hash(outer, (), "numba")
    assert before != source_hash(outer, (), "fast")
    for changed in (3.0, 2, np.float32(2.0), -2.0, np.array([2.0])):
        monkeypatch.setattr(sys.modules[__name__], "FACTOR", changed)
        assert source_hash(outer, (), "numba") != before
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", factors := np.array([2.0]))
    of_two = source_hash(outer, (), "numba")
    factors[0] = 3.0  # the same array
    assert source_hash(outer, (), "numba") not in (before, of_two)
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", 2.0)
    assert source_hash(outer, (), "numba") == before


def test_a_module_counts_after_its_package(monkeypatch):
    """The package has the module under the name by which the module itself is known."""
    before = source_hash(plant.begin_rows, (), "numba")
    module = importlib.import_module("steer_env.vehicle.tyre.magic_formula.forces")
    monkeypatch.setattr(module, "ADDED", 1.0, raising=False)
    assert source_hash(plant.begin_rows, (), "numba") != before


class Pair(NamedTuple):
    x: float
    y: float


class Swapped(NamedTuple):
    y: float
    x: float


Swapped.__qualname__ = Pair.__qualname__


def test_the_order_of_fields_counts(monkeypatch):
    """Of parameters, and of a constant whose values stand in the same order by other names."""
    given, frozen = [], []
    for kind in (Pair, Swapped):
        given.append(source_hash(outer, (numba.typeof(kind(1.0, 2.0)),), "numba"))
        with monkeypatch.context() as changed:
            changed.setattr(sys.modules[__name__], "FACTOR", kind(1.0, 2.0))
            frozen.append(source_hash(outer, (), "numba"))
    assert given[0] != given[1]
    assert frozen[0] != frozen[1]


def closure(factor):
    @kernel
    def scaled(x):
        return factor * x

    return scaled


def test_what_a_kernel_closes_over_counts_or_is_refused():
    assert source_hash(closure(1.0), (), "numba") != source_hash(closure(2.0), (), "numba")
    with pytest.raises(UndecidableError, match="closes over"):
        source_hash(closure(inner), (), "numba")


@pytest.mark.parametrize("date", [1e9, None], ids=["old", "new"])
def test_a_file_that_changed_while_the_process_runs_is_refused(date, tmp_path, monkeypatch):
    """By its date, or because a file with an old date was put in its place."""
    file = tmp_path / f"changed_{date is None}.py"
    file.write_text("from steer_env.friction.numerics.kernel import kernel\n\n@kernel\ndef f(x):\n    return x\n")
    if date:
        os.utime(file, (date, date))
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UndecidableError, match="changed while the process was running"):
        source_hash(importlib.import_module(file.stem).f, (), "numba")


FOLDERS = ("friction", "vehicle", "steer_env", "experiments")
STEPS = """
{imports}
import gymnasium, numpy as np, steer_env
env = gymnasium.make("steer_env/AssistWeave-v3", friction="lugre")
env.reset(seed=0)
print([float(x) for _ in range(30) for x in env.step(np.array([0.1], np.float32))[0]])
from steer_env.engine.kernels import advance
print(sum(advance.stats.cache_misses.values()))
"""
EVERYTHING = "from steer_env import drivers, manoeuvres, metrics, tasks\nimport steer_env.friction.models.masing"


@pytest.fixture
def copy(tmp_path):
    """A copy of the packages, and a function that takes steps in it with a cache of its own."""
    for folder in FOLDERS:
        ignored = shutil.ignore_patterns("__pycache__", "report", "data" if folder == "experiments" else "")
        shutil.copytree(ROOT / folder, tmp_path / folder, symlinks=True, ignore=ignored)

    def steps(imports=""):
        settings = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
        command = [sys.executable, "-W", "error", "-c", STEPS.format(imports=imports)]
        done = subprocess.run(
            command, env={**os.environ, **settings}, cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    return tmp_path, steps


def _edit(file, old, new):
    text = file.read_text()
    assert text.count(old) == 1, (file, old)
    file.write_text(text.replace(old, new))


@pytest.mark.whole
def test_an_edited_metric_recompiles_nothing_and_an_edited_kernel_changes_the_result(copy):
    """Edits of a law, of a line of the step and of a constant of the plant, of one checkout with one cache."""
    folder, steps = copy
    first, compiled = steps()
    assert compiled == "1"
    for file in (folder / "steer_env" / "metrics").glob("*.py"):
        file.write_text(file.read_text() + "\nEDITED = True\n")
    assert steps(EVERYTHING) == [first, "0"]
    _edit(folder / "friction" / "models" / "lugre.py", "z_mean = z * p1 + h", "z_mean = 1.01 * z * p1 + h")
    edited, compiled = steps()
    assert compiled == "0"  # the plant calls the law, which alone is compiled anew
    assert edited != first
    _edit(folder / "vehicle" / "plant.py", "STOP_STIFFNESS = 2e6", "STOP_STIFFNESS = 3e6")
    assert steps() == [edited, "1"]  # the end stops are out of reach
