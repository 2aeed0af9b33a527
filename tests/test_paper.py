"""The paper holds the tables that its command makes, and its references and equations are complete."""

import re

import pytest

from tests.tools import paper
from tests.verification.common.rows import Row

TEXT = paper.PAGE.read_text(encoding="utf-8")
ON_PAGE = {name: text.strip() for name, text in paper.MADE.findall(TEXT)}
NUMBERED = [line for line in TEXT.splitlines() if re.search(r"\\text\{\([A-Z]\d+\)", line)]


def test_every_place_is_filled_by_the_command():
    assert TEXT.count("<!-- made: ") == TEXT.count("<!-- end -->") == len(ON_PAGE)
    assert set(ON_PAGE) == {"checks", "schemes", *paper.TAKEN}
    assert all(ON_PAGE.values())
    for name in set(ON_PAGE) - {"verdict"}:
        _, *rows = paper.cells(next(block for block in ON_PAGE[name].split("\n\n") if block.startswith("|")))
        assert rows


@pytest.mark.parametrize("name", paper.TAKEN)
def test_what_is_taken_stands_on_its_page(name):
    assert ON_PAGE[name] == paper.TAKEN[name](), "run python -m tests.maintain paper --taken"


@pytest.mark.whole
def test_a_measured_table_is_that_of_the_page():
    """The errors of the schemes, to their two digits, below which processors differ."""
    assert ON_PAGE["schemes"] == paper.schemes()


def test_references_are_cited_and_citations_have_one():
    defined = re.findall(r"^\[\^(\w+)\]: ", TEXT, re.MULTILINE)
    assert len(defined) == len(set(defined)) == TEXT.count("\n[^")
    assert set(re.findall(r"\[\^(\w+)\](?!: )", TEXT)) == set(defined)


@pytest.mark.parametrize("line", NUMBERED, ids=lambda line: re.findall(r"\(\w\d+\)", line)[0])
def test_an_equation_is_that_of_the_model_page(line):
    def plain(text):
        return re.sub(r"\\\\$|&|\\qquad|\s", "", text)

    assert plain(line) in {plain(each) for each in (paper.DOCS / "model.md").read_text(encoding="utf-8").splitlines()}


@pytest.mark.parametrize(
    ("measured", "required", "share"),
    [
        ("2.0e-05", "<= 0.001 of 4 A f(A)", 0.02),
        ("0.58 % RMS, 1.5 % steady", "<= 5 % RMS, 3 % steady", 0.5),
        ("40 deg, 8 dB", ">= 30 deg, 6 dB", 0.75),
        ("0.0e+00", "<= 0 N m", 0.0),
        ("16.3", "9.5 to 24.5 N m/g", 0.0),
    ],
)
def test_how_near_a_requirement_is_to_its_limit(measured, required, share):
    assert paper.closeness(Row("", measured, required, "pass")) == pytest.approx(share)
