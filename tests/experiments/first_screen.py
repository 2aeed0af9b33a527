"""What stands on the first screen of a page, and what it may hold."""

import re


def sentence(page: str) -> str:
    """The sentence that a page begins with, without its tags.

    Raises
    ------
    AssertionError
        It has more than 25 words, not one picture beside it, or a table of more than ten rows.
    """
    (shown,) = re.findall(r'<section class="answer">(.*?)</section>', page, re.S)
    (text,) = re.findall(r'<div class="finding">(.*?)</div>', shown, re.S)
    text = " ".join(re.sub(r"<[^>]+>", " ", text).split())
    assert len(text.split()) <= 25, text
    assert shown.count("<figure") == 1
    assert all(table.count("<tr") <= 10 for table in re.findall(r"<tbody>(.*?)</tbody>", shown, re.S))
    return text
