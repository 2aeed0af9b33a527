"""The pages of metrics, environments and car files are what their definitions say."""

import pytest

from tests.tools import glossary


@pytest.mark.parametrize("path", glossary.PAGES, ids=lambda path: path.name)
def test_the_page_is_up_to_date(path):
    assert path.read_text(encoding="utf-8") == glossary.PAGES[path](), "run python -m tests.maintain glossary"
