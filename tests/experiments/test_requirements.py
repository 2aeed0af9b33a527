"""Every requirement of ``python -m tests.maintain verify`` is kept but those on times, policies and tuning."""

import pytest

from tests import verification as requirements
from tests.maintain.__main__ import run as maintain
from tests.verification import feel
from tests.verification.common import rows

APART = ("synthetic", "time", "page", "policies", "tuning")  # by command; synthetic in test_synthetic.py
LONG = ("assist", "column", "coupling", "hands_off", "linear", "power", "straight")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.whole] * (name in LONG))
        for name in requirements.groups()
        if name not in APART
    ],
)
def test_a_group_of_requirements_is_kept(name):
    assert "FAIL" not in requirements.table(name)


@pytest.mark.parametrize(("error", "code"), [(0.5, 0), (2.0, 1), (float("nan"), 1)])
def test_the_exit_code_says_whether_a_requirement_is_missed(monkeypatch, capsys, error, code):
    def measure():
        """Something measured."""
        yield rows.at_most("size", [0.1, error], 1.0, "m")

    monkeypatch.setattr(feel, "rows", measure)
    assert maintain(["verify", "feel"]) == code
    assert ("FAIL" if code else "pass") in capsys.readouterr().out


def test_a_deviation_from_a_source_is_named_and_nothing_else_passes():
    found = {x: rows.as_printed("toe", x, "0.198", known="0.197").verdict for x in (0.1978, 0.1968, 0.1955)}
    assert list(found.values()) == ["pass", "deviates", "FAIL"]
