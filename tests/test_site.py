"""The site of the documentation builds without a warning, its links lead somewhere, and its search knows its words."""

import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

import pytest

from steer_env import friction, metrics
from steer_env.vehicle import cars
from tests.needs import needs
from tests.tools.site import mathml, repository_pages

ROOT = Path(__file__).parents[1]
MATHML = "{http://www.w3.org/1998/Math/MathML}"
PAGES = repository_pages().values()
BLOCKS = [tex for text in PAGES for tex in re.findall(r"^ *```math\n(.*?)^ *```$", text, re.DOTALL | re.MULTILINE)]
IN_LINES = [tex for text in PAGES for tex in re.findall(r"\$(`.*?`)\$", text)]


class Page(HTMLParser):
    """The places of a page that links lead to, and what it loads and links to."""

    def __init__(self, path):
        super().__init__()
        self.places, self.links, self.loaded = {""}, [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.places.add(found.get("id", ""))
        if tag == "a" and "href" in found:
            self.links.append(found["href"])
        elif tag in ("link", "script", "img"):
            self.loaded += [found[key] for key in ("href", "src") if key in found]


@needs("sphinx", "myst_parser", "furo", "snowballstemmer")
@pytest.mark.whole
def test_the_site_builds_and_its_links_and_search_lead_somewhere(tmp_path):
    """One test, as the site takes most of a minute."""
    out = tmp_path / "docs"
    words = [sys.executable, "-m", "tests.maintain", "site", "--out", str(out)]
    # Plain Python draws the few pictures sooner than it compiles.
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    pages = {path: Page(path) for path in out.rglob("*.html")}
    assert not list(dead(pages))
    assert not [link for page in pages.values() for link in page.loaded if urlsplit(link).netloc]
    first = pages[out / "index.html"]
    loaded = [out / urlsplit(link).path for link in first.loaded]
    assert sum(path.stat().st_size for path in [out / "index.html", *loaded]) < 1.5e6  # before any compression
    require_search((out / "searchindex.js").read_text(encoding="utf-8"))
    drawn = "".join(path.read_text(encoding="utf-8") for path in (out / "docs").glob("*.html"))
    assert drawn.count('<div class="math"><math') == len(BLOCKS)
    assert drawn.count("<math") == len(BLOCKS) + len(IN_LINES)


def dead(pages):
    """Links and anchors within the site that lead nowhere."""
    for path, page in pages.items():
        for link in page.links + page.loaded:
            to = urlsplit(link)
            if to.scheme or to.netloc:
                continue
            target = (path.parent / unquote(to.path)).resolve() if to.path else path
            if not target.is_file() or (target in pages and unquote(to.fragment) not in pages[target].places):
                yield f"{path.name}: {link}"


def require_search(text):
    """The index of the search knows a word of a page, and a page for every declaration."""
    index = json.loads(text.removeprefix("Search.setIndex(").rstrip().removesuffix(")"))
    import snowballstemmer

    stem = snowballstemmer.stemmer("english").stemWord
    found = index["terms"][stem("hysteresis")]
    assert "docs/friction_measurement" in {
        index["docnames"][k] for k in (found if isinstance(found, list) else [found])
    }
    declared = {"laws": friction.available(), "cars": cars.available(), "manoeuvres": metrics.tests()}
    assert {f"{folder}/{name}" for folder, names in declared.items() for name in names} <= set(index["docnames"])


def tree(tex, block):
    return ElementTree.fromstring(mathml(tex, block).replace("&ApplyFunction;", ""))


@needs("docutils")
@pytest.mark.parametrize(
    ("tex", "block"),
    [(tex, True) for tex in BLOCKS] + [(tex, False) for tex in IN_LINES],
    ids=lambda value: " ".join(str(value).split())[:60],
)
def test_an_equation_becomes_mathml(tex, block):
    """No command is left, and no bracket that is opened in one row and closed in another takes rows for its own."""
    made = tree(tex, block)
    assert not re.search(r"[\\^&{}'`]", "".join(made.itertext()))
    for table in made.iter(f"{MATHML}mtable"):
        rows = table.findall(f"{MATHML}mtr")
        assert len(rows) == tex.count(r"\\") + 1
        assert max(map(len, rows)) <= 4  # both sides, an empty column, number and unit
