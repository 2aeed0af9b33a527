"""The checks that users run on friction laws of their own."""

import subprocess
import sys

import pytest

from steer_env.friction import law
from steer_env.friction.models.lugre import LuGre
from steer_env.testing import check_friction_law


@pytest.mark.whole
def test_a_law_from_outside_passes_by_name(toy):
    check_friction_law("toy_jenkins")


@pytest.mark.whole
def test_what_fails_is_named():
    motor = LuGre(sigma_0=100.0, sigma_1=2.0, sigma_2=-5.0, F_c=0.9, F_s=0.9, v_s=0.1)
    with pytest.raises(AssertionError, match=r"sigma_2=-5.0.* fails check_passivity: The work done on the law"):
        check_friction_law(motor)


def test_a_law_of_the_script_that_runs_is_told_to_move(monkeypatch, toy):
    from steer_env.testing import check_plain_python

    p = law.make("toy_jenkins")
    monkeypatch.setattr(toy.Jenkins, "__module__", "__main__")
    with pytest.raises(ValueError, match="Jenkins stands in the script that runs; put the law into a module"):
        check_plain_python([p])


@pytest.mark.parametrize(
    ("options", "before", "told"),
    [
        ([], "import sys; sys.modules['hypothesis'] = None", "pip install hypothesis"),
        (["-O"], "", "run Python without -O"),
    ],
)
def test_what_the_checks_need_is_told(options, before, told):
    """The package itself runs without it."""
    code = f"{before}\nimport steer_env.environments, steer_env.friction\nimport steer_env.testing"
    done = subprocess.run([sys.executable, *options, "-c", code], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("ImportError: steer_env.testing")
    assert told in done.stderr
