"""docs/recordings.md: what it runs prints what it says."""

import re
import shlex
from pathlib import Path

import pytest

from steer_env.experiments.cli.main import main
from tests.needs import needs

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")
RUNS = re.findall(
    r"^```(sh|python)\n(.*?)^```\n\n?(?:.*?\n\n)??^```text\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE
)


pytestmark = needs("can", "cantools")


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A directory from which the examples are found, and in which files may be written."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(("kind", "code", "printed"), RUNS, ids=[f"{k}-{kind}" for k, (kind, _, _) in enumerate(RUNS)])
def test_what_the_page_runs(kind, code, printed, checkout, capsys):
    if kind == "sh":
        program, *arguments = shlex.split(code)
        assert program == "steer-env"
        assert main(arguments) == (1 if "every metric refused" in printed else 0)
    else:
        exec(compile(code, "recordings.md", "exec"), {"__name__": "page"})
    assert capsys.readouterr().out == printed
