"""Every requirement of ``python -m tests.maintain verify`` is kept but those on times, policies and tuning."""

import importlib

import pytest

from tests import verification as requirements
from tests.maintain.__main__ import run as maintain
from tests.verification import feel
from tests.verification.common import rows

APART = ("explanation", "page", "policies", "synthetic", "time", "tuning")  # by command; two have tests of their own
LONG = ("assist", "column", "coupling", "hands_off", "linear", "power", "straight")
# Regression: what README.md and docs tell beyond the limits, as printed.
TOLD = {
    "assist": {"default car, 0 km/h, least": "35.0 deg, 8.4 dB"},
    "commonroad": {"brake_30, published": "10.58 % RMS, 26.69 % steady"},
    "coupling": {
        "lugre, a step of delay: largest change of a metric": "1.4e-02",
        "lugre, a step of delay: energy lost": "-0.19 %",
    },
    "feel": {
        "torque at 0 g": "1.378",
        "torque gradient at 0 g": "16.29",
        "lateral acceleration at 0 N m": "0.07398",
        "steering sensitivity at 0.1 g": "1.404",
    },
    "hands_off": {
        "single_track, own friction, 3 N m: settles": "60 m/s",
        "single_track, own friction, 5 N m: does not spin": "56 m/s",
        "single_track, no friction, 3 N m: settles": "44 m/s",
        "two_track, no friction, 3 N m: settles": "47 m/s",
    },
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.whole] * (name in LONG))
        for name in requirements.groups()
        if name not in APART
    ],
)
def test_a_group_of_requirements_is_kept(name):
    rows = [*importlib.import_module(f"tests.verification.{name}").rows()]
    assert rows
    assert [row for row in rows if row.verdict == "FAIL"] == []
    told = TOLD.get(name, {})
    measured = {row.what.replace("\u00a0", " "): row.measured for row in rows}  # names of metrics have such blanks
    assert {what: measured.get(what) for what in told} == told


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
