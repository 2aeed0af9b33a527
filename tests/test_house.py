"""The house rules that no tool of ``make check`` knows: what is installed, and how code is written."""

import ast
import itertools
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.by_law import pairs
from tests.needs import needs

ROOT = Path(__file__).parents[1]
PACKAGES = ("friction", "vehicle", "experiments", "steer_env")


def test_core_does_not_import_torch():
    names = ("vehicle.steering.margins", "experiments.cli.main", "experiments.reports.report", "environments")
    modules = ", ".join(f"steer_env.{name}" for name in names)
    code = f"import sys, {modules}; assert not {{'torch', 'stable_baselines3'}} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


@needs("setuptools")
def test_every_package_is_installed_and_tests_are_not():
    """``packages.find`` follows the links that put the four folders into one namespace."""
    import setuptools

    found = set(setuptools.find_packages(str(ROOT), include=["steer_env*"]))
    folders = {
        ".".join(["steer_env"] * (package != "steer_env") + list(path.parent.relative_to(ROOT).parts))
        for package in PACKAGES
        for path in (ROOT / package).rglob("__init__.py")
    }
    assert found == folders


@pytest.mark.parametrize("package", PACKAGES[:-1])
def test_a_bare_name_is_refused_in_one_sentence(package):
    done = subprocess.run([sys.executable, "-c", f"import {package}"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 1
    assert f"import this package as steer_env.{package}" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("name", ["friction", "vehicle", "experiments"])
def test_a_folder_of_the_user_with_our_name_does_no_harm(name, tmp_path):
    """Nothing of the project takes a generic name: a script beside a ``vehicle.py`` or a folder ``friction`` runs."""
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text("raise RuntimeError('the user's own')")
    (tmp_path / f"{name}.py").write_text("raise RuntimeError('the user's own')")
    script = tmp_path / "script.py"
    script.write_text("import steer_env.experiments.cli.main, steer_env.environments\nprint('runs')\n")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path, env=environment)
    assert done.stdout == "runs\n", done.stderr


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_function_and_numeric_field_is_documented(package):
    bare = []
    for path in (ROOT / package).rglob("*.py"):
        lines = path.read_text().splitlines()
        tree = ast.parse("\n".join(lines))
        for node in ast.iter_child_nodes(tree):
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                decorators = {d.id for d in getattr(node, "decorator_list", []) if isinstance(d, ast.Name)}
                # The kernels of a law are described once, by the contract in steer_env.friction.law.register.
                if ast.get_docstring(node) is None and not (path.parent.name == "models" and "kernel" in decorators):
                    bare.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.name}")
            if isinstance(node, ast.ClassDef) and any(getattr(b, "id", "") == "NamedTuple" for b in node.bases):
                if re.search(r"\[[^\]]+\]", ast.get_docstring(node) or ""):
                    continue  # one unit, or a few, for all fields
                for field in node.body:
                    text = ast.unparse(field.annotation) if isinstance(field, ast.AnnAssign) else ""
                    if re.search(r"float|Array", text) and "#" not in lines[field.end_lineno - 1]:
                        bare.append(f"{path.relative_to(ROOT)}:{field.lineno} field {ast.unparse(field)}")
    assert not bare, "\n".join(bare)


LONG_FUNCTION, MANY_ARGUMENTS = 80, 10
# Kernels that the class of the parameters selects: their positional arguments are the contract.
DISPATCHED = {"derivative", "advance", "report", "observe", "evaluate_step"}


def sources():
    """Every source file of the packages with its lines and its syntax tree."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            yield path.relative_to(ROOT), text.splitlines(), ast.parse(text)


def test_functions_and_calls_are_short():
    """A longer function says why in a comment that begins with ``# Long:`` above or within it."""
    found = []
    for path, lines, tree in sources():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                size, text = node.end_lineno - node.lineno + 1, lines[node.lineno - 2 : node.end_lineno]
                if size > LONG_FUNCTION and not any("# Long:" in line for line in text):
                    found.append(f"{path}:{node.lineno} {node.name} has {size} lines")
            if isinstance(node, ast.Call) and len(node.args) > MANY_ARGUMENTS:
                name = ast.unparse(node.func).rpartition(".")[2]
                if name not in DISPATCHED:
                    found.append(f"{path}:{node.lineno} {name} is called with {len(node.args)} positional arguments")
    assert not found, "\n".join(found)


def test_pairs_meet_every_value_of_another_dimension():
    rows = list(itertools.product("ab", range(10), "xyz", (True, False)))
    chosen = pairs(rows)
    assert len(chosen) <= len(rows) / 3
    for i, j in itertools.combinations(range(4), 2):
        assert {(row[i], row[j]) for row in chosen} == {(row[i], row[j]) for row in rows}
    possible = [row for row in rows if row[:2] != ("a", 3)]
    assert set(pairs(possible)) <= set(possible)
