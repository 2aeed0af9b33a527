"""docs/recordings.md: its table names every format, and what it runs prints what it says."""

import re
import shlex
from pathlib import Path

import pytest

from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.main import main
from steer_env.recording import channel_mapping

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")
RUNS = re.findall(
    r"^```(sh|python)\n(.*?)^```\n\n?(?:.*?\n\n)??^```text\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE
)


def test_the_table_names_every_format_with_its_extra():
    rows = [line for line in PAGE.splitlines() if line.startswith("| `.")]
    for suffix in (*names.FORMATS, *names.CAN_FORMATS):
        extra = names.EXTRA_OF_FORMAT.get(suffix)
        (row,) = (row for row in rows if f"`{suffix}`" in row.split("|")[1] and ("CAN" in row) == (extra == "can"))
        assert (f"| `{extra}` |" if extra else "| none") in row


def test_the_mapping_of_the_page_is_one(tmp_path):
    (text,) = re.findall(r"^```toml\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
    (tmp_path / "map.toml").write_text(text)
    entry = channel_mapping.load(tmp_path / "map.toml").channels["handwheel_angle"]
    assert entry == channel_mapping.Entry("handwheel_angle", "SWA", "deg", -1.0, 0.01, 0.3, 1.02)


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A directory from which the examples are found, and in which files may be written."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)


def test_the_page_has_a_walk_through():
    assert [kind for kind, _, _ in RUNS] == ["sh", "sh", "python"]


@pytest.mark.parametrize(("kind", "code", "printed"), RUNS, ids=[f"{k}-{kind}" for k, (kind, _, _) in enumerate(RUNS)])
def test_what_the_page_runs(kind, code, printed, checkout, capsys):
    if kind == "sh":
        program, *arguments = shlex.split(code)
        assert program == "steer-env"
        assert main(arguments) == (1 if "every metric refused" in printed else 0)
    else:
        exec(compile(code, "recordings.md", "exec"), {"__name__": "page"})
    assert capsys.readouterr().out == printed
