"""Pages of the site that are made of declarations and data, as of friction laws, cars, commands and scores.

Each function gives pages by their place in the site, as Markdown; :mod:`tests.tools.site` writes them.
"""

import argparse
import ast
import importlib
import inspect
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from steer_env import REGISTERED, friction, metrics
from steer_env.environments import table
from steer_env.experiments.cli.main import parser
from steer_env.experiments.pages import pictures
from steer_env.experiments.studies.friction_laws import HISTORIES
from steer_env.friction.law import LAWS
from steer_env.vehicle import cars
from steer_env.vehicle.keys import declared_keys
from tests.tools import glossary, scores

ROOT = Path(__file__).resolve().parents[2]
GALLERY = sorted((ROOT / "examples" / "gallery").glob("*.py"))
Pages = dict[str, str]  # place in the site -> text
# The modules whose names are public: those of `__all__`, of the others those without an underscore.
PUBLIC = (
    "steer_env",
    "steer_env.friction",
    "steer_env.vehicle",
    "steer_env.vehicle.tyre",
    "steer_env.vehicle.suspension",
    "steer_env.vehicle.chassis",
    "steer_env.manoeuvres",
    "steer_env.metrics",
    "steer_env.recording",
    "steer_env.tasks",
    "steer_env.drivers",
    "steer_env.assists",
    "steer_env.tuning",
    "steer_env.testing",
    "steer_env.connect.fmu",
    "steer_env.connect.udp",
    "steer_env.connect.external",
    "steer_env.live.real_time",
    "steer_env.live.devices",
    "steer_env.targets",
    "steer_env.sb3",
)
WHOLE = ("steer_env.targets", "steer_env.sb3")  # public modules without `__all__`
HISTORY = HISTORIES["growing_sine"]  # through which every law is drawn
LONG = 4  # numbers that a cell of a table shows


def as_markdown(docstring: str) -> str:
    """A docstring in Markdown: what is indented after an empty line is a block of code, roles and ``x`` are code."""
    blocks: list[str] = []
    for block in inspect.cleandoc(docstring).split("\n\n"):
        if block.startswith("    "):
            text = inspect.cleandoc(block)
            joined = bool(blocks) and blocks[-1].endswith("\n```")
            blocks.append(blocks.pop().removesuffix("```") + f"\n{text}\n```" if joined else f"```text\n{text}\n```")
        else:
            text = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", block).replace("``", "`")
            section = re.fullmatch(r"(\w+)\n-+\n(.*)", text, re.DOTALL)  # Raises, in numpydoc's form
            if section:
                text = f"**{section[1]}**\n\n" + "\n".join(_entries(section[2].splitlines()))
            blocks.append(text)
    return linked("\n\n".join(blocks)) + "\n"


def linked(text: str) -> str:
    """Text of a page in a folder, in which the pages of ``docs`` that it names are links."""
    return re.sub(
        r"(?<![\w/`(\[])docs/([\w\\]+)\.md", lambda found: f"[{found[0]}](../docs/{_bare(found[1])}.md)", text
    )


def _bare(text: str) -> str:
    return text.replace("\\", "")


def _entries(lines: list[str]) -> Iterator[str]:
    """Entries of a section of a docstring as a list."""
    for line in lines:
        yield f"  {line.strip()}" if line.startswith(" ") else f"* `{line.replace('`', '')}`:"


def cell(value: Any) -> str:
    """A value in a cell of a table."""
    if value is None:
        return "none"
    if isinstance(value, bool | str):
        return str(value)
    numbers = np.asarray(value)
    if not numbers.size:
        return "none"
    if numbers.size > LONG:
        return f"table of {' by '.join(map(str, numbers.shape))}"
    return ", ".join(f"{number:.6g}" for number in numbers.ravel())


def contents(title: str, text: str, pages: Iterable[str]) -> str:
    """A page that lists others of its folder."""
    names = "\n".join(Path(place).stem for place in pages if place.endswith(".md"))
    return f"# {title}\n\n{text}\n\n```{{toctree}}\n:titlesonly:\n\n{names}\n```\n"


def meanings(parameters: type, units: bool = False) -> dict[str, str]:
    """Field of a class of parameters -> the comment at its line, with its unit or without."""
    found = re.findall(r"^    (\w+): .*?# (.*)$", inspect.getsource(parameters), re.MULTILINE)
    return {name: comment if units else re.sub(r" ?\[[^\]]*\]$", "", comment) for name, comment in found}


def laws() -> Pages:
    """A page for every friction law, with its loop."""
    pages: Pages = {}
    for name in friction.available():
        law = LAWS[name]
        module = inspect.getmodule(law.make)
        assert module is not None
        p, told = law.make(), meanings(law.parameters)
        rows = [
            (
                f"`{key}`",
                told.get(key, "").replace("|", "\\|"),
                law.units.get(key, ""),
                cell(getattr(p, key, argument.default)),
            )
            for key, argument in inspect.signature(law.make).parameters.items()
        ]
        torques = {name: friction.response(p, HISTORY.x, HISTORY.dt)}
        pages[f"laws/{name}.svg"] = str(pictures.loops(HISTORY.x, torques))
        pages[f"laws/{name}.md"] = "\n".join(
            [
                f"# {name}\n",
                f"`friction.make({name!r})`, `--friction {name}`\n",
                as_markdown(module.__doc__ or ""),
                f"![Friction torque of {name} over displacement]({name}.svg)\n",
                f"*Its torque in {HISTORY.title}, with the default parameters.*\n",
                "## Parameters\n",
                table(("parameter", "meaning", "unit", "default"), rows) + "\n",
                as_markdown(law.make.__doc__ or ""),
            ]
        )
    text = "Each page is made of the file of its law. [Choose, compare, fit](../docs/friction_laws.md) compares them."
    pages["laws/index.md"] = contents("Every friction law", text, pages)
    return pages


def packaged_cars() -> Pages:
    """A page for every packaged car, with every key."""
    pages: Pages = {}
    for name in cars.available():
        data = cars.load(name).data()
        assumed = set(data.get("assumed", ()))
        parts = [f"# {name}\n", f"{_sentence(data['description'])}\n", f"Source: {linked(data['source'])}.\n"]
        parts.append(f"Tyre `{data['tyre']}`, strut `{data['strut']}`. `steer-env car {name}` prints the whole car.\n")
        for section, keys in declared_keys().items():
            if section not in data:
                continue
            rows = [
                (
                    f"`{key}`",
                    cell(value),
                    keys[key].unit,
                    keys[key].meaning,
                    "assumed" if {section, key} & assumed else "",
                )
                for key, value in data[section].items()
            ]
            parts += [f"## {section}\n", table(("key", "value", "unit", "meaning", ""), rows) + "\n"]
        pages[f"cars/{name}.md"] = "\n".join(parts)
    text = "Each page is made of the file of its car. [Packaged cars](../docs/cars.md) says where they come from."
    pages["cars/index.md"] = contents("Every packaged car", text, pages)
    return pages


def environments() -> Pages:
    """A page for every id."""
    pages: Pages = {}
    for name in REGISTERED:
        made = f'`gymnasium.make("{name}")`'
        text = glossary.environment(name).replace("\n### ", "\n## ")
        pages[f"environments/{name.partition('/')[2]}.md"] = f"# {name}\n\n{made}\n\n{text.rstrip()}\n"
    text = "Each page is made of a task. [Environments](../docs/environments.md) has what all of them share."
    pages["environments/index.md"] = contents("Every environment", text, pages)
    return pages


def manoeuvres() -> Pages:
    """A page for every test with its metrics."""
    pages = {f"manoeuvres/{test}.md": f"# {test}\n\n{glossary.metrics_of(test)}\n" for test in metrics.tests()}
    text = "Each page is made of a manoeuvre and of the definitions of its metrics. "
    text += "[Tests and metrics](../docs/metrics.md) says what intervals hold and what is refused."
    pages["manoeuvres/index.md"] = contents("Every manoeuvre with its metrics", text, pages)
    return pages


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:].rstrip(".") + "."


def commands() -> Pages:
    """A page for every command: its help."""
    pages: Pages = {}
    for words, made in _parsers("steer-env", parser()):
        place = words.removeprefix("steer-env ").replace(" ", "-")
        pages[f"commands/{place}.md"] = _help(words, made)
    text = "Each page is the help of its command, which `steer-env COMMAND --help` prints."
    pages["commands/index.md"] = contents("Every command", text, pages)
    return pages


def _help(words: str, made: argparse.ArgumentParser) -> str:
    """What the parser of a command tells, without the width of a terminal."""
    formatter = made._get_formatter()
    told = " ".join((made.description or "").split())
    parts = [f"# {words}\n", f"{linked(_plain(told))}\n"]
    usage = re.sub(r"\n +", "\n    ", made.format_usage().removeprefix("usage: ").rstrip())
    parts.append(f"```text\n{usage}\n```\n")
    for group in made._action_groups:
        shown = [action for action in group._group_actions if action.help != argparse.SUPPRESS]
        if shown:
            parts.append(f"## {_plain(group.title or '').capitalize()}\n")
        for action in shown:
            told = " ".join(formatter._expand_help(action).split())
            parts.append(f"* `{formatter._format_action_invocation(action)}`: {linked(_plain(told))}\n")
    return "\n".join([*parts, linked(_plain(made.epilog or ""))]).rstrip() + "\n"


def _plain(text: str) -> str:
    """Text in which nothing is Markdown."""
    return re.sub(r"([\\`*_\[\]<>|])", r"\\\1", text)


def _parsers(words: str, made: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Words of every command -> its parser."""
    below = [action.choices for action in made._actions if isinstance(action, argparse._SubParsersAction)]
    for name, further in (below[0] if below else {}).items():
        yield from _parsers(f"{words} {name}", further)
    if not below:
        yield words, made


def api() -> Pages:
    """A page for every public module: the docstring of each public name."""
    pages: Pages = {}
    for name in PUBLIC:
        parts = [f"# {name}\n", "```{eval-rst}"]
        if name in WHOLE:
            parts += [f".. automodule:: {name}", "   :members:"]
        else:
            module = importlib.import_module(name)
            parts += [f".. automodule:: {name}", "   :no-members:", ""]
            parts += [line for key in module.__all__ for line in _directive(name, key, getattr(module, key))]
        pages[f"api/{name}.md"] = "\n".join([*parts, "```", ""])
    text = "The public names by package, from their docstrings. "
    text += "[CONTRIBUTING](../CONTRIBUTING.md#what-is-public) says what else is public."
    pages["api/index.md"] = contents("Python names", text, pages)
    return pages


def _directive(module: str, key: str, thing: Any) -> list[str]:
    """Lines that document a public name."""
    if isinstance(thing, ModuleType):
        return []
    if not callable(thing):
        return [f".. py:data:: {module}.{key}", f"   :type: {type(thing).__name__}", ""]
    if inspect.isclass(thing):
        return [f".. autoclass:: {module}.{key}", "   :members:", ""]
    return [f".. autofunction:: {module}.{key}", ""]


def examples() -> Pages:
    """The gallery, a page for each of its scripts, and the first sentence of every other example."""
    pages, shown, lines = {}, [], []
    for path in sorted((ROOT / "examples").rglob("*")):
        if not path.is_file() or "__pycache__" in path.parts:
            continue
        place, told, rest = path.relative_to(ROOT / "examples").as_posix(), "", ""
        if path.suffix == ".py":
            docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
            first, _, rest = docstring.partition("\n\n")
            told = " ".join(first.split())
        elif path.suffix == ".ipynb":
            told = json.loads(path.read_text(encoding="utf-8"))["cells"][0]["source"][0].removeprefix("# ").strip()
        if path in GALLERY:
            pages[f"examples/gallery/{path.stem}.md"] = _of_gallery(path, told, rest)
            shown.append(f'<a href="gallery/{path.stem}.html"><img src="gallery/{path.stem}.svg" alt="">{told}</a>')
        else:
            lines.append(f"* [{place}]({place})" + (f": {told}" if told else ""))
    listed = [place.removeprefix("examples/") for place in pages] + ["can_log/SOURCES.md"]
    parts = [
        "# Examples",
        "Every picture is drawn by its script when this site is built; its page has the script.",
        '<div class="gallery">\n' + "\n".join(shown) + "\n</div>",
        "## Longer examples, and files",
        "\n".join(lines),
        "```{toctree}\n:hidden:\n\n" + "\n".join(listed) + "\n```\n",
    ]
    return pages | {"examples/index.md": "\n\n".join(parts)}


def _of_gallery(script: Path, title: str, text: str) -> str:
    """The page of a script: what it answers, its picture and its code."""
    code = script.read_text(encoding="utf-8").partition('"""\n\n')[2]
    picture = f'<img src="{script.stem}.svg" alt="{title}">'
    link = f"[{script.name}]({script.name})"
    return f"# {title}\n\n{text}\n\n{picture}\n\n{link}:\n\n```python\n{code}```\n"


def files() -> Pages:
    """The licence and the citation data as pages."""
    licence, citation = ((ROOT / name).read_text(encoding="utf-8").rstrip() for name in ("LICENSE", "CITATION.cff"))
    return {
        "licence.md": f"# Licence\n\n```text\n{licence}\n```\n",
        "citation.md": f"# How to cite\n\nThe citation data of `CITATION.cff`:\n\n```yaml\n{citation}\n```\n",
    }


def table_of_scores() -> Pages:
    """The scores of the benchmark, of their file."""
    return {"scores.md": scores.markdown(scores.read())}


def generated() -> Pages:
    """Every page that is made of declarations and of files with data."""
    parts = (laws, packaged_cars, environments, manoeuvres, commands, api, examples, table_of_scores, files)
    return {place: text for part in parts for place, text in part().items()}
