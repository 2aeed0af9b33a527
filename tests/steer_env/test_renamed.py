"""Old public names answer with the new thing and a warning; importing the package loads little."""

import importlib
import subprocess
import sys

import gymnasium as gym
import pytest

import steer_env
from steer_env import assists, drivers, targets

OLD_NAMES = [
    *((steer_env.__name__, old, new) for old, new in steer_env._OLD_NAMES.items()),
    *((drivers.__name__, old, new) for old, new in drivers._OLD_NAMES.items()),
    *((targets.__name__, old, f"steer_env.targets:{new}") for old, new in (("Light", "Rating"), ("light", "rating"))),
    ("steer_env.targets", "lights", "steer_env.targets:ratings"),
    ("steer_env.targets", "reference_torque", "steer_env.tasks.common.reference_feel:reference_torque"),
    ("steer_env.engine.batch", "Lanes", "steer_env.engine.batch:EnvironmentBatch"),
]


@pytest.mark.parametrize(("module", "old", "new"), OLD_NAMES)
def test_an_old_name_warns_and_gives_the_new_thing(module, old, new):
    place, _, attribute = new.partition(":")
    with pytest.warns(DeprecationWarning, match=rf"{module}\.{old} is now {place}.*release 1\.0") as caught:
        found = getattr(importlib.import_module(module), old)
    assert caught[0].filename == __file__
    expected = importlib.import_module(place)
    assert found is (getattr(expected, attribute) if attribute else expected)


def test_importing_an_old_name_from_the_package_warns():
    with pytest.warns(DeprecationWarning, match=r"steer_env\.bands is now steer_env\.targets"):
        from steer_env import bands
    assert bands is targets


def test_the_old_name_of_a_baseline_still_makes_it():
    env = gym.make("steer_env/AssistWeave-v1")
    with pytest.warns(DeprecationWarning, match="baseline assist 'return' is now 'active_return'") as caught:
        baseline = assists.make("return", env)
    assert caught[0].filename == __file__
    assert type(baseline) is type(assists.make("active_return", env))
    assert "return" not in assists.available()


def test_no_old_name_is_listed():
    assert not {*steer_env._OLD_NAMES} & {*dir(steer_env)}
    assert not {*drivers._OLD_NAMES} & {*dir(drivers)}


HEAVY = ("numba", "scipy", "matplotlib", "control", "stable_baselines3")


def test_importing_the_package_loads_little():
    """It registers the ids; compiler, numerics, pictures and the tasks wait until an environment is made."""
    code = (
        "import sys, gymnasium, steer_env; assert len(steer_env.REGISTERED) == 14; "
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
