"""The pages of metrics, environments and car files are what their definitions say."""

import re

import pytest

from steer_env import REGISTERED
from tests.tools import glossary


@pytest.mark.parametrize("path", glossary.PAGES, ids=lambda path: path.name)
def test_the_page_is_up_to_date(path):
    assert path.read_text(encoding="utf-8") == glossary.PAGES[path](), "run python -m tests.maintain glossary"


def test_every_part_of_an_id_stands_once_among_its_groups_and_its_own_section():
    page = (glossary.DOCS / "environments.md").read_text(encoding="utf-8")
    sections = {each.partition("\n")[0].strip("#` "): each for each in re.split(r"^(?=##+ )", page, flags=re.MULTILINE)}
    for name in REGISTERED:
        places = [sections[title] for title in (*glossary.kinds(name), name)]
        for parts in glossary.document(name).values():
            for head, text in parts:
                found = [place for place in places if text in (place.split("\n") if head else place)]
                assert len(found) == 1, (name, text)
