"""What the page refuses before long work begins, and its command."""

import os
import subprocess
import sys

import pytest

from steer_env.experiments import explore
from steer_env.experiments.cli.main import main
from steer_env.experiments.explore import policies
from tests.needs import needs

pytestmark = needs("ziglang")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"friction": ["stiction"]}, "friction must be one of"),
        ({"chassis": ["tricycle"]}, "chassis must be one of"),
        ({"friction": []}, "needs a friction law and a chassis"),
        ({"friction": [{"law": "lugre", "F_c": 1.2}]}, "by its name alone, or several sites"),
        ({"friction": ["masing@gear+masing@gear"]}, "each site once"),
        ({"friction": ["lugre", {"gear": {"law": "masing", "efficiency": 1.2}}]}, "friction at gear: efficiency must"),
        ({"vehicle": "tank"}, "vehicle must be"),
    ],
)
def test_a_bad_value_is_refused(given, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        explore.explore(tmp_path / "page", **given)
    assert list(tmp_path.iterdir()) == []


def test_kernels_that_are_not_compiled_make_no_page(tmp_path):
    command = [sys.executable, "-m", "steer_env.experiments.cli.main", "explore", "--out", tmp_path / "page"]
    done = subprocess.run(command, env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True)
    assert done.returncode == 2
    assert "the page is made of compiled kernels; unset NUMBA_DISABLE_JIT" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_a_page_and_replaces_it(tmp_path, capsys):
    for _ in range(2):
        words = ["explore", "--friction", "lugre", "--chassis", "single_track", "--out", str(tmp_path / "page")]
        assert main(words) == 0
        assert capsys.readouterr().out.strip() == str(tmp_path / "page" / "index.html")
    found = {str(path.relative_to(tmp_path / "page")) for path in (tmp_path / "page").rglob("*.js")}
    assert {"modules/single_track_lugre.js", "modules/single_track_beginning.js", "declared.js", "tables.js"} <= found
    assert {each["file"] for each in policies.listed()} == {name for name in found if name.startswith("policies/")}
    assert (tmp_path / "page" / "uplot.LICENSE").read_text().startswith("The MIT License")
