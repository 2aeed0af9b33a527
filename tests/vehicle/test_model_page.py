"""docs/model.md: every equation has a number, a row that names its file, and that number in a comment of the file.

Every file and test that a table names stands where it says.
"""

import io
import re
import subprocess
import sys
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "model.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"\(([FCEPSTVBDRNLW]\d+)\)")
# Rows of the tables of equations: | (C1), (C2) | `file`: `function` | test |
ROWS = [
    (NUMBER.findall(numbers), file)
    for numbers, file in re.findall(r"^\| ((?:\(\w+\)(?:, )?)+) \| `([^`]+)`", PAGE, re.M)
]


def test_every_number_is_in_a_row():
    listed = {number for numbers, _ in ROWS for number in numbers}
    assert listed == set(NUMBER.findall(PAGE))


@pytest.mark.parametrize(("numbers", "file"), ROWS, ids=lambda value: value if isinstance(value, str) else None)
def test_file_names_its_equations(numbers, file):
    source = io.StringIO((ROOT / file).read_text(encoding="utf-8"))
    tokens = tokenize.generate_tokens(source.readline)
    comments = " ".join(token.string for token in tokens if token.type == tokenize.COMMENT)  # not the docstrings
    assert not [number for number in numbers if f"({number})" not in comments]


def test_every_named_path_exists():
    paths = set(re.findall(r"`((?:friction|vehicle|steer_env|experiments|tests)/[\w/.]+)", PAGE))
    assert not [path for path in sorted(paths) if not (ROOT / path).exists()]


def test_every_named_test_exists():
    for file, name in re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", PAGE):
        assert f"def {name}(" in (ROOT / file).read_text(encoding="utf-8"), f"{file}::{name}"
    for name in re.findall(r"`(test_\w+)`", PAGE):
        assert any(f"def {name}(" in file.read_text(encoding="utf-8") for file in (ROOT / "tests").rglob("*.py")), name


@pytest.mark.whole
@pytest.mark.parametrize(
    ("block", "printed"), re.findall(r"```python\n(.*?)```\n(?:\n```text\n(.*?)```)?", PAGE, re.S), ids=lambda _: ""
)
def test_blocks_run_by_themselves_and_print_what_stands_there(block, printed):
    """Numbers within 1 %, as a last digit is rounded otherwise on another processor."""
    done = subprocess.run([sys.executable, "-c", block], check=True, cwd=ROOT, capture_output=True, text=True)
    if printed:
        number = re.compile(r"-?\d+\.?\d*")
        assert number.sub("", done.stdout).split() == number.sub("", printed).split()
        found, expected = ([float(x) for x in number.findall(text)] for text in (done.stdout, printed))
        assert found == pytest.approx(expected, rel=0.01, abs=0.006)
