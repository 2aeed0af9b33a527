"""Every block of docs/walkthrough.md in its order: files are written, commands run, and print what the page says."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[1] / "docs" / "walkthrough.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
COMMANDS = f"steer-env() {{ '{sys.executable}' -m steer_env.experiments.cli.main \"$@\"; }}\n"


def _output(command: list[str], folder: Path) -> str:
    environment = {**os.environ, "COLUMNS": "200", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.whole
def test_walkthrough(tmp_path):
    out, compared = "", 0
    for language, text in BLOCKS:
        match language:
            case "toml":
                (tmp_path / text.split()[1]).write_text(text, encoding="utf-8")
            case "python":
                out = _output([sys.executable, "-c", text], tmp_path)
            case "sh":
                out = _output(["bash", "-c", COMMANDS + text], tmp_path)
            case "text":
                printed = [line.rstrip() for line in out.splitlines()]
                for line in text.splitlines():
                    assert line.rstrip() in printed, out
                    compared += 1
    assert compared > 10
    assert (tmp_path / "report" / "index.html").stat().st_size < 1e6
