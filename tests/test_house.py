"""The house rules that a machine can check: format, lint, types, direction of imports, what is installed."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
import tomllib

ROOT = Path(__file__).parents[1]
PACKAGES = ("friction", "vehicle", "steer_env", "experiments")


@pytest.mark.parametrize(
    "command",
    [
        ["ruff", "check", "."],
        ["ruff", "format", "--check", "."],
        ["mypy"],
        ["importlinter.cli", "lint_imports"],
    ],
    ids=lambda command: command[0],
)
def test_tools_are_content(command):
    if command[0] == "importlinter.cli":
        arguments = [sys.executable, "-c", "from importlinter.cli import lint_imports_command; lint_imports_command()"]
    else:
        arguments = [sys.executable, "-m", *command]
    done = subprocess.run(arguments, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_core_does_not_import_torch():
    names = "friction, vehicle, steer_env.vehicle.steering.margins, steer_env, steer_env.experiments.cli.main, steer_env.experiments.report.build"
    code = f"import sys, {names}; assert not {{'torch', 'stable_baselines3'}} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_every_package_is_installed_and_tests_are_not():
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    found = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for package in PACKAGES
        for path in (ROOT / package).rglob("__init__.py")
    }
    assert set(listed) == found


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
                for field in node.body:
                    text = ast.unparse(field.annotation) if isinstance(field, ast.AnnAssign) else ""
                    if re.search(r"float|Array", text) and "#" not in lines[field.end_lineno - 1]:
                        bare.append(f"{path.relative_to(ROOT)}:{field.lineno} field {ast.unparse(field)}")
    assert not bare, "\n".join(bare)
