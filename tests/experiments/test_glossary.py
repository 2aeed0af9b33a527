"""The page of tests and metrics is what their definitions say."""

from experiments import glossary


def test_the_page_is_up_to_date():
    assert glossary.PATH.read_text(encoding="utf-8") == glossary.page(), "run python -m experiments.glossary"
