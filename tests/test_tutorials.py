"""Every block of the tutorials in its order: files are written, commands run, and print what the page says.

docs/walkthrough.md is one as a whole, other pages are one below their heading "In ten minutes". A block that begins
with the name of a file is that file.
"""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.needs import needs

DOCS = Path(__file__).parents[1] / "docs"
PAGES = ("walkthrough", "friction_laws", "make_a_law", "learning", "make_a_task", "fmu", "driving")
# What a test has, and what it does not wait for: the package with its extras, and minutes of training.
SHORTENED = {"pip install": ": pip install", "--minutes 1 ": "--minutes 0.1 "}
CLOCK = "<!-- by the clock -->"  # before what is printed with other digits each time; no reader sees it
COMMANDS = (
    f"steer-env() {{ '{sys.executable}' -m steer_env.experiments.cli.main \"$@\"; }}\n"
    f"fmpy() {{ '{sys.executable}' -m fmpy \"$@\"; }}\n"
)
# What this machine did to a drive in real time, which is no fault of the page; every other refusal is one.
BUSY = re.compile(
    r"every metric refused: (the torque was off or faded|the simulation stood still|\S+ of the deadlines were missed)"
)
SECONDS = 600.0
FEWEST = 3  # lines that a page shows of what is printed


def blocks(page):
    """Language, text and whether its digits differ each time, of every block of a tutorial."""
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    if page != "walkthrough":
        text = text.split("\n## In ten minutes\n")[1].partition("\n## ")[0]
    found = re.findall(rf"^({CLOCK}\n)?```(\w+)\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    return [(language, block, bool(clock)) for clock, language, block in found]


def output(command, folder, until):
    environment = {**os.environ, "COLUMNS": "200", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    left = until - time.monotonic()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment, timeout=left)
    assert done.returncode == 0 or BUSY.search(done.stdout), done.stdout + done.stderr
    return done.stdout


def words(line, clock):
    """A line as it is compared: whatever the spaces, and of numbers by the clock no more than that they are some."""
    line = " ".join(line.split())
    return re.sub(r"[-\d.]+", "0", line) if clock else line


PACKAGES = {
    "learning": ["stable_baselines3"],
    "make_a_law": ["hypothesis"],
    "fmu": ["fmpy"],
    "driving": ["pygame"],
}


@pytest.mark.whole
@pytest.mark.parametrize("page", [pytest.param(page, marks=needs(*PACKAGES.get(page, []))) for page in PAGES])
def test_tutorial(page, tmp_path):
    """Its commands run in ten minutes."""
    out, compared, until = "", 0, time.monotonic() + SECONDS
    for language, text, clock in blocks(page):
        match language:
            case "toml" | "python" if named := re.match(r"# (\w+\.(?:toml|py))\n", text):
                (tmp_path / named[1]).write_text(text, encoding="utf-8")
            case "python":
                out = output([sys.executable, "-c", text], tmp_path, until)
            case "sh":
                for long, short in SHORTENED.items():
                    text = text.replace(long, short)
                out = output(["bash", "-c", COMMANDS + text], tmp_path, until)
            case "text" if clock and BUSY.search(out):
                continue
            case "text":
                printed = [words(line, clock) for line in out.splitlines()]
                for line in text.splitlines():
                    assert words(line, clock) in printed, out
                    compared += 1
    assert compared >= FEWEST
