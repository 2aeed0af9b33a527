"""Every Python example of the README and of the pages that it opens prints what stands there; its doors open."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.needs import needs

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "docs/analysis.md", "docs/friction_laws.md", "docs/learning.md", "docs/robot_joints.md")
EXAMPLES = [
    (page, code, printed)
    for page in PAGES
    for code, printed in re.findall(
        r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```)?",
        (ROOT / page).read_text(encoding="utf-8"),
        flags=re.DOTALL | re.MULTILINE,
    )
]


@pytest.mark.parametrize("page", PAGES)
def test_there_are_examples(page):
    assert any(page == where for where, _, _ in EXAMPLES)


PACKAGES = {"docs/learning.md": ["stable_baselines3"], "docs/robot_joints.md": ["mujoco"]}


@pytest.mark.parametrize(
    ("page", "code", "printed"),
    [pytest.param(*each, marks=needs(*PACKAGES.get(each[0], [])), id=each[0]) for each in EXAMPLES],
)
def test_example(page, code, printed, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, page, "exec"), {"__name__": "readme"})
    out = capsys.readouterr().out
    assert out == printed if printed else out


# What a test does not wait for, or has not: fifteen minutes of training, and hands.
SHORTENED = {"--minutes 15": "--minutes 0.1 --episodes 4", "drive ": "drive --device fake --headless --seconds 3 "}
DOORS = re.findall(
    r"^```sh\nsteer-env (.*?)(?: +#.*)?\n```",
    (ROOT / "README.md").read_text(encoding="utf-8").partition("## Five doors")[2].partition("\n## ")[0],
    flags=re.MULTILINE,
)


def test_every_door_has_a_first_command():
    assert [command.split()[0] for command in DOORS] == ["report", "run", "train", "export-fmu", "drive"]


@pytest.mark.whole
@pytest.mark.parametrize("command", DOORS, ids=[command.split()[0] for command in DOORS])
def test_a_stranger_succeeds_within_five_minutes(command, tmp_path):
    for long, short in SHORTENED.items():
        command = command.replace(long, short)
    words = [sys.executable, "-m", "steer_env.experiments.cli.main", *command.split()]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300.0)
    assert done.returncode == 0, done.stdout + done.stderr
    assert any(tmp_path.iterdir()) or "--out" not in command
