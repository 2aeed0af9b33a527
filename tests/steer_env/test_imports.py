"""Importing the package, and listing what is registered in it, loads little."""

import subprocess
import sys

import pytest

HEAVY = ("numba", "scipy", "matplotlib", "control", "stable_baselines3")


def test_importing_the_package_loads_little():
    """It registers the ids; compiler, numerics, pictures and the tasks wait until an environment is made."""
    code = (
        "import sys, gymnasium, steer_env; assert len(steer_env.REGISTERED) == 15; "
        "assert set(steer_env.REGISTERED) < set(gymnasium.registry); "
        "print(*sys.modules)"
    )
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert not {module for module in loaded if module.split(".")[0] in HEAVY}
    assert not {module for module in loaded if module.startswith("steer_env.tasks.")}


@pytest.mark.parametrize(
    ("package", "attribute"),
    [("tasks", "TASKS"), ("drivers", "DRIVERS"), ("assists", "BASELINES")],
)
def test_listing_imports_nothing_that_is_listed(package, attribute):
    code = (
        f"import sys; from steer_env.{package}.common import definition; names = definition.{attribute}.available(); "
        f"files = definition.{attribute}._files(); assert sorted(files) == list(names); "
        "assert not set(files.values()) & set(sys.modules), set(files.values()) & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(("package", "names"), [("manoeuvres", "available"), ("metrics", "tests")])
def test_listing_the_tests_of_a_car_imports_none_of_them(package, names):
    code = (
        f"import sys; from steer_env import {package}; assert 'step-steer' in {package}.{names}(); "
        f"assert not {{'numba', 'scipy', 'steer_env.{package}.step_steer'}} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
