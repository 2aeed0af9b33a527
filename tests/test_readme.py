"""Every Python example of the README and of the pages that it opens runs and prints what stands there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "docs/friction_laws.md", "docs/learning.md", "docs/robot_joints.md")
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


@pytest.mark.parametrize(("page", "code", "printed"), EXAMPLES, ids=[page for page, _, _ in EXAMPLES])
def test_example(page, code, printed, capsys):
    if "import mujoco" in code:
        pytest.importorskip("mujoco")  # from Python 3.11 on
    exec(compile(code, page, "exec"), {"__name__": "readme"})
    out = capsys.readouterr().out
    assert out == printed if printed else out
