"""From results to a page: a template of the folder ``templates`` and what it says; beside it the numbers as JSON.

Every template extends ``base.html.j2``; sentences, tables and captions stand in templates, unless a report makes them
beside its numbers. A report is ``reports/NAME.py`` or ``studies/NAME.py``, its template ``templates/NAME.html.j2``. A
page whose verdict is to be quoted has its sentences in elements of the class ``finding``.
"""

import argparse
import json
import re
import shlex
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, Protocol
from urllib.parse import quote

import jinja2
from markupsafe import Markup

from steer_env.experiments.pages import own_modules, provenance, words
from steer_env.experiments.pages.files import replaced_directory, usable, write_json, write_text
from steer_env.experiments.pages.style import smaller

_FINDING = re.compile(r'(<!-- measured -->)?<div class="finding">(.*?)</div>', re.DOTALL)
_HEADING = re.compile(r'<h2 id="[^"]*">(.*?)</h2>')
LIVE_FOLDER = "live"  # folder of the page to explore, beside another page
# May stand in a quoted attribute of HTML and in an address of data as they are
_KEPT_CHARACTERS = " !$'()*+,-./:;<=>?@[]^_`{|}~"


def image(svg: str) -> Markup:
    """A picture as the source of an image, which needs no other file."""
    text = re.sub(r'="([^"\']*)"', r"='\1'", smaller(svg))  # the other quotes need no escape
    return Markup("data:image/svg+xml," + quote(text, safe=_KEPT_CHARACTERS))


def anchor(title: str) -> str:
    """The name of a place in a page, from its heading."""
    return re.sub(r"\W+", "-", title.lower()).strip("-")


def titles(html: str) -> list[str]:
    """The headings of a part of a page that have a name."""
    return [Markup(each).unescape() for each in _HEADING.findall(html)]


def text_columns(rows: Sequence[Sequence[object]]) -> set[int]:
    """Places of the columns of a table after the first in which no cell has a digit: text, not numbers."""
    columns = enumerate(zip(*rows))
    return {place for place, cells in columns if place and not any(re.search(r"\d", str(cell)) for cell in cells)}


@lru_cache
def environment() -> jinja2.Environment:
    """The templates, with the filters for numbers and names."""
    found = jinja2.Environment(
        loader=jinja2.PackageLoader("steer_env.experiments.pages"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    filters = (
        words.number,
        words.percent,
        words.change,
        words.label,
        words.law_name,
        words.unit,
        words.prose,
        words.span,
        words.plain,
        words.within,
        words.capital,
        anchor,
        titles,
        text_columns,
    )
    found.filters |= {f.__name__: f for f in filters}
    found.globals |= {"image": image, "version": metadata.version("steer-env"), "script": ""}
    return found


class Page(NamedTuple):
    """A page: what its template says.

    Parameters
    ----------
    name : str
        Of the template, without suffix; of a study also of its JSON file.
    values : mapping
        What the template refers to.
    """

    name: str
    values: Mapping[str, Any]

    def html(self, trace: Mapping[str, Any] | None = None, live: Sequence[tuple[str, str]] = ()) -> str:
        """The page with the trace of its results, by default none, and with links (label, address) to be tried."""
        found = {"sources": "", **(trace or {})}
        element = json.dumps(trace or {}, ensure_ascii=False).replace("</", "<\\/")
        command = shlex.join(["steer-env", *found["command"]]) if found.get("command") else ""
        template = environment().get_template(f"{self.name}.html.j2")
        made = {"name": self.name, "live": live, "trace": found, "command": command, "trace_element": Markup(element)}
        return template.render({**made, **self.values})

    def _findings(self, measured: bool) -> list[str]:
        found = _FINDING.findall(self.html())
        return [Markup(text).unescape() for mark, text in found if bool(mark) == measured]

    @property
    def verdict(self) -> list[str]:
        """The sentences to quote, without those that rest on computing times."""
        return self._findings(measured=False)

    @property
    def timing(self) -> list[str]:
        """The sentences to quote that rest on computing times."""
        return self._findings(measured=True)

    def text(self) -> str:
        """The words of the page, without marks."""
        body = re.sub(r"<(style|script).*?</\1>", "", self.html(), flags=re.DOTALL)
        return Markup(body).striptags()


class OtherPage(Protocol):
    """What writes another page beside a page; :class:`steer_env.experiments.explore.beside.PageBeside`."""

    def write(self, folder: Path) -> Sequence[tuple[str, str]]:
        """Write it into the folder, and give a label and an address of each link; an empty one where there is none."""


def write_page(
    folder: Path,
    page: Page,
    files: Mapping[str, Mapping[str, Any]],
    trace: Mapping[str, Any],
    beside: OtherPage | None = None,
) -> None:
    """Write ``index.html`` and JSON files by name into a folder that is there, each as a whole and with the trace.

    Where there is something to write beside it, the page links into that.
    """
    write_text(folder / "index.html", page.html(trace, beside.write(folder) if beside else ()))
    for name, data in files.items():
        write_json(folder / name, {**data, "trace": dict(trace)})


def write(out: Path, page: Page, data: Mapping[str, Any], trace: Mapping[str, Any]) -> Path:
    """Write the page of a study with its verdict and numbers as JSON; returns the path of the page.

    Raises
    ------
    ValueError
        If ``out`` holds other files or cannot be written.
    """
    with replaced_directory(out, contents(page.name)) as part:
        write_page(part, page, numbers(page, data), trace)
    return out / "index.html"


def numbers(page: Page, data: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The JSON file of a study; its verdict is without what rests on times, so that a rerun gives the same."""
    return {f"{page.name}.json": {"verdict": page.verdict, **data}}


def contents(name: str) -> frozenset[str]:
    """Files of the page of a study."""
    return frozenset({"index.html", f"{name}.json"})


def check(out: Path, name: str) -> None:
    """ValueError for a directory that cannot take the page of a study, to be called before the work."""
    usable(out, contents(name))


def parser(study: str, description: str | None) -> argparse.ArgumentParser:
    """A parser with the option ``--out``, the directory of the page."""
    found = argparse.ArgumentParser(prog=f"steer-env study {study}", description=description)
    text = f"directory, replaced as a whole (default {study})"
    found.add_argument("--out", metavar="DIR", type=Path, default=Path(study), help=text)
    return found


def study_trace(study: str, argv: Sequence[str] | None, out: Path, **made: Any) -> dict[str, Any]:
    """The trace of a study's result, as :func:`steer_env.experiments.pages.provenance.trace`.

    ``argv`` are the study's own words, None for those of this process, which is no command to be run again. The
    command of the trace has no ``--out``, as the page does not depend on its place, and imports the laws of the user's
    own.
    """
    placed = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    placed.add_argument("--out")
    laws = own_modules.of_laws()
    imports = [word for name in laws for word in ("--import", name)]
    command = None if argv is None else ["study", study, *imports, *placed.parse_known_args(argv)[1]]
    inputs = [{"module": name, "sha256": digest} for name, digest in own_modules.digests(laws).items()]
    return provenance.trace(command=command, result=out.name, inputs=inputs, **made)
