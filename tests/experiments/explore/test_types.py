"""The types of the page's scripts, which stand in comments (JSDoc), by the compiler of TypeScript."""

import shutil
import subprocess
from importlib.resources import files

import pytest

TSC = shutil.which("tsc")


@pytest.mark.skipif(TSC is None, reason="no TypeScript on this machine: npm install --global typescript")
def test_scripts_keep_their_types():
    folder = files("steer_env.experiments.explore") / "page"
    scripts = sorted(str(file) for file in folder.iterdir() if file.name.endswith(".js") and file.name != "uplot.js")
    options = (
        "--allowJs",
        "--checkJs",
        "--noEmit",
        "--strict",
        "--target",
        "es2022",
        "--lib",
        "es2022,dom,dom.iterable",
    )
    done = subprocess.run([TSC, *options, *scripts], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
