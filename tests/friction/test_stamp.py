"""A kernel's stamp changes with everything that its machine code depends on, and not with what it does not reach."""

import ast
import importlib
import inspect
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numba
import numpy as np
import pytest

import steer_env
from steer_env.friction.numerics import stamp as stamps
from steer_env.friction.numerics.kernel import COMPILED, kernel, part
from steer_env.friction.numerics.stamp import UndecidableError, stamp

pytestmark = pytest.mark.skipif(not COMPILED, reason="nothing is compiled")

ROOT = Path(__file__).parents[2]
FOLDERS = ("friction", "vehicle", "steer_env", "experiments")


def _kernel_modules():
    """Every module of the project that holds kernels, by its name."""
    found = {}
    for folder in FOLDERS:
        for file in sorted((ROOT / folder).rglob("*.py")):
            parts = file.relative_to(ROOT).with_suffix("").parts
            text = file.read_text()
            if "@kernel" in text or "@part" in text:
                name = ".".join(parts if parts[0] == "steer_env" else ("steer_env", *parts)).removesuffix(".__init__")
                found[name] = importlib.import_module(name)
    return found


MODULES = _kernel_modules() if COMPILED else {}


def _kernels(module):
    """The kernels that a module defines."""
    return [k for k in vars(module).values() if hasattr(k, "py_func") and k.py_func.__module__ == module.__name__]


KERNELS = {f"{name}.{k.py_func.__name__}": k for name, module in MODULES.items() for k in _kernels(module)}


def _constants(k):
    """Module constants that a kernel uses: (module, name), read from its source and not from its bytecode."""
    scope = k.py_func.__globals__
    for node in ast.walk(ast.parse(inspect.getsource(k.py_func).lstrip())):
        owner, name = scope, None
        if isinstance(node, ast.Name):
            name = node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            holder = scope.get(node.value.id)
            owner, name = (vars(holder), node.attr) if isinstance(holder, ModuleType) else ({}, "")
        value = owner.get(name) if name and str(owner.get("__name__", "")).startswith("steer_env") else None
        if isinstance(value, int | float | tuple | np.ndarray):
            yield owner, name


def _other(value):
    """Another value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, tuple):
        return (_other(value[0]), *value[1:]) if value else (1.0,)
    return value + 1 if isinstance(value, int | float | np.ndarray) else f"{value}'"


def test_every_kernel_can_be_stamped():
    assert len(KERNELS) > 100
    for k in KERNELS.values():
        stamp(k, (), "numba")


@pytest.mark.parametrize("name", MODULES)
def test_a_changed_constant_changes_the_stamp(name, monkeypatch):
    """Every constant that a kernel of the file uses, changed one by one as if the file said another value."""
    for k in _kernels(MODULES[name]):
        before = stamp(k, (), "numba")
        for owner, constant in _constants(k):
            with monkeypatch.context() as changed:
                changed.setitem(owner, constant, _other(owner[constant]))
                assert stamp(k, (), "numba") != before, (k, constant)
        assert stamp(k, (), "numba") == before


def _plant_types(law, chassis):
    from steer_env.vehicle import cars, plant

    p = cars.load().plant(law, chassis=chassis)
    arrays = np.zeros(2), np.zeros((1, len(plant.INPUTS))), np.zeros((1, 2))
    return tuple(map(numba.typeof, (p, *arrays, 1)))


REACHED = {
    ("lugre", "single_track"): ("friction.models.lugre", "friction.bristle", "vehicle.chassis.single_track"),
    ("masing", "two_track"): ("friction.models.masing", "vehicle.chassis.two_track.derivative"),
}
SHARED = (
    "friction.law",
    "friction.numerics.bounds",
    "vehicle.plant",
    "vehicle.steering.eps",
    "vehicle.steering.column",
)


@pytest.mark.parametrize("kind", REACHED)
def test_the_plant_is_stamped_by_what_it_reaches_and_by_nothing_above_it(kind, monkeypatch):
    """The law and the chassis that its parameters select, not the others, nor anything above ``vehicle``."""
    from steer_env.vehicle import plant

    read = []
    monkeypatch.setattr(stamps, "_code", lambda module, code=stamps._code: read.append(module.__name__) or code(module))
    stamp(plant.run, _plant_types(*kind), "numba")
    reached = {name.removeprefix("steer_env.") for name in read}
    assert reached >= {*REACHED[kind], *SHARED}
    others = {name for other in REACHED if other != kind for name in REACHED[other]} - {"friction.bristle"}
    assert not reached & others
    assert {name.partition(".")[0] for name in reached} == {"friction", "vehicle"}


def test_the_order_of_the_fields_of_parameters_counts():
    from typing import NamedTuple

    class A(NamedTuple):
        x: float
        y: float

    class B(NamedTuple):
        y: float
        x: float

    B.__qualname__ = A.__qualname__
    k = next(iter(KERNELS.values()))
    assert stamp(k, (numba.typeof(A(1.0, 2.0)),), "numba") != stamp(k, (numba.typeof(B(1.0, 2.0)),), "numba")


def test_the_order_of_the_fields_of_a_constant_counts(monkeypatch):
    """Values in the same order, but by other names."""
    from typing import NamedTuple

    class Pair(NamedTuple):
        x: float
        y: float

    class Swapped(NamedTuple):
        y: float
        x: float

    Swapped.__qualname__ = Pair.__qualname__
    found = []
    for kind in (Pair, Swapped):
        monkeypatch.setattr(sys.modules[__name__], "FACTOR", kind(1.0, 2.0))
        found.append(stamp(outer, (), "numba"))
    assert found[0] != found[1]


FACTOR = 2.0


@kernel
def inner(x):
    return FACTOR * x


@part
def outer(x, offset=1.0):
    return inner(x) + offset


def test_everything_that_is_frozen_into_a_kernel_counts(monkeypatch):
    """Constants, the function behind a name, the compiler; not the names of other things."""
    before = stamp(outer, (), "numba")
    assert before != stamp(outer, (), "fast")
    for changed in (3.0, 2, np.float32(2.0), -2.0, np.array([2.0])):
        monkeypatch.setattr(sys.modules[__name__], "FACTOR", changed)
        assert stamp(outer, (), "numba") != before
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", 2.0)
    assert stamp(outer, (), "numba") == before


def closure(factor):
    @kernel
    def scaled(x):
        return factor * x

    return scaled


def test_what_a_kernel_closes_over_counts_or_is_refused():
    assert stamp(closure(1.0), (), "numba") != stamp(closure(2.0), (), "numba")
    with pytest.raises(UndecidableError, match="closes over"):
        stamp(closure(inner), (), "numba")


def test_a_kernel_without_a_source_file_is_refused():
    scope = {"__name__": __name__, "kernel": kernel}
    exec("@kernel\ndef typed(x):\n    return x", scope)
    with pytest.raises(UndecidableError, match="no source file"):
        stamp(scope["typed"], (), "numba")


def test_a_file_that_changed_after_its_import_is_refused(monkeypatch):
    """By its contents, or because a file with an old date was put in its place."""
    from steer_env.vehicle import plant

    types = _plant_types("lugre", "two_track")
    stamp(plant.run, types, "numba")
    monkeypatch.setattr(stamps, "_START", 0.0)
    with pytest.raises(UndecidableError, match="changed while the process was running"):
        stamp(plant.run, types, "numba")


def test_a_file_with_an_old_date_in_the_place_of_the_imported_one_is_refused(tmp_path, monkeypatch):
    file = tmp_path / "replaced_later.py"
    file.write_text("from steer_env.friction.numerics.kernel import kernel\n\n@kernel\ndef f(x):\n    return x\n")
    os.utime(file, (1e9, 1e9))
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UndecidableError, match="changed while the process was running"):
        stamp(importlib.import_module("replaced_later").f, (), "numba")


# Copies of the packages, edited.

STAMPS = """
{imports}
import numba, numpy as np, gymnasium
from steer_env.friction.numerics.stamp import stamp
from steer_env.engine import batch
from steer_env.vehicle import cars, plant
p = cars.load().plant("lugre", chassis="two_track")
arrays = np.zeros(2), np.zeros((1, len(plant.INPUTS))), np.zeros((1, 2))
print(stamp(plant.run, tuple(map(numba.typeof, (p, *arrays, 1))), "numba"))
print([stamp(k, (), "numba") for k in vars(batch).values() if hasattr(k, "py_func")])
"""

STEPS = """
{imports}
import gymnasium, numpy as np, steer_env
env = gymnasium.make("steer_env/AssistWeave-v3", friction="lugre")
env.reset(seed=0)
print([float(x) for _ in range(30) for x in env.step(np.array([0.1], np.float32))[0]])
from steer_env.engine.kernels import advance
print(sum(advance.stats.cache_misses.values()))
"""


@pytest.fixture
def copy(tmp_path):
    """A copy of the packages, and a function that runs code in it with a cache of its own."""
    for folder in FOLDERS:
        ignored = shutil.ignore_patterns("__pycache__", "report", "data" if folder == "experiments" else "")
        shutil.copytree(ROOT / folder, tmp_path / folder, symlinks=True, ignore=ignored)

    def run(code, imports=""):
        settings = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
        command = [sys.executable, "-W", "error", "-c", code.format(imports=imports)]
        done = subprocess.run(
            command, env={**os.environ, **settings}, cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    return tmp_path, run


def _edit(file, old, new):
    text = file.read_text()
    assert text.count(old) >= 1, (file, old)
    file.write_text(text.replace(old, new))


EVERYTHING = "from steer_env import drivers, manoeuvres, metrics, tasks\nimport steer_env.friction.models.masing"


def test_metrics_experiments_and_imports_leave_the_stamps(copy):
    folder, run = copy
    before = run(STAMPS)
    for file in [*(folder / "steer_env" / "metrics").glob("*.py"), *(folder / "experiments").rglob("*.py")]:
        file.write_text(file.read_text() + "\nEDITED = True\n")
    _edit(folder / "vehicle" / "plant.py", "@kernel", "# a comment\n@kernel")
    assert run(STAMPS, EVERYTHING) == before


EDITS = (
    ("friction/law.py", "    return w, R - S * w", "    return 1.01 * w, R - S * w"),
    ("vehicle/steering/eps.py", "    mean = (impulse + ", "    mean = 0.9 * (impulse + "),
)


@pytest.mark.parametrize(("file", "old", "new"), EDITS)
def test_what_is_edited_is_one_line_of_the_kernel(file, old, new):
    assert (ROOT / file).read_text().count(old) == 1


@pytest.mark.whole
def test_an_edited_metric_recompiles_nothing_and_an_edited_kernel_changes_the_result(copy):
    """Edits of a constant or a line, from the law up to the engine, of one checkout with one cache."""
    folder, run = copy
    first, compiled = run(STEPS)
    assert compiled == "1"
    for file in (folder / "steer_env" / "metrics").glob("*.py"):
        file.write_text(file.read_text() + "\nEDITED = True\n")
    assert run(STEPS, EVERYTHING) == [first, "0"]
    seen = {first}
    for file, old, new in EDITS:
        _edit(folder / file, old, new)
        result, compiled = run(STEPS)
        assert compiled == "1", file
        assert result not in seen, file
        seen.add(result)
    _edit(folder / "vehicle" / "plant.py", "STOP_STIFFNESS = 2e6", "STOP_STIFFNESS = 3e6")
    assert run(STEPS) == [result, "1"]  # the end stops are out of reach


def test_the_copy_is_of_this_checkout():
    assert Path(steer_env.__file__).parents[1] == ROOT
