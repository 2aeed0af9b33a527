"""The advice on an extra works where it is printed."""

from pathlib import Path

from steer_env.friction.numerics import extras

ROOT = Path(__file__).parents[2]


def test_in_the_checkout_and_beside_it(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    assert extras.install("fmu") == "pip install '.[fmu]'"
    monkeypatch.chdir(tmp_path)
    assert extras.install("fmu") == f"pip install '{ROOT}[fmu]'"


def test_an_installed_package_needs_no_checkout(monkeypatch, tmp_path):
    monkeypatch.setattr(extras, "__file__", str(tmp_path / "steer_env" / "friction" / "numerics" / "extras.py"))
    assert extras.install("fmu") == "pip install 'steer-env[fmu]'"
