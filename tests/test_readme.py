"""Every Python example of the README runs and prints what the README says."""

import re
from pathlib import Path

import pytest

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```)?", README, flags=re.DOTALL | re.MULTILINE)


def test_there_are_examples():
    assert len(EXAMPLES) >= 2
    assert any(printed for _, printed in EXAMPLES)


@pytest.mark.parametrize(("code", "printed"), EXAMPLES, ids=lambda text: text.splitlines()[0] if text else "")
def test_example(code, printed, capsys):
    exec(compile(code, "README.md", "exec"), {"__name__": "readme"})
    out = capsys.readouterr().out
    assert out == printed if printed else out
