"""The tables of docs/model.md: every file, function and test that they name stands where they say."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "model.md"


def defined(path):
    """Names of functions, classes and constants of a file, those of a class with its name before them."""
    found = set()

    def walk(node, before):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                found.add(before + child.name)
                walk(child, f"{before}{child.name}.")
            elif isinstance(child, ast.Assign):
                found.update(before + name.id for name in ast.walk(child) if isinstance(name, ast.Name))
            elif not isinstance(child, ast.expr):
                walk(child, before)

    walk(ast.parse(path.read_text(encoding="utf-8")), "")
    return found


def named():
    """Line of the page, file and name (or nothing) of everything that a row of a table names.

    A file is named with its folder, or without it after another of the same folder; names follow their file.
    """
    for number, line in enumerate(PAGE.read_text(encoding="utf-8").splitlines(), start=1):
        for cell in re.split(r"(?<!\\)\|", line) if line.startswith("|") else []:
            path = None
            for text in re.findall(r"`([^`]+)`", cell):
                if file := re.fullmatch(r"([\w./]+\.py)(?:::(\w+))?", text):
                    path = path.parent / file[1] if path and "/" not in file[1] else ROOT / file[1]
                    yield number, path, file[2]
                elif path and re.fullmatch(r"[\w.]+", text):
                    yield number, path, text


NAMED = sorted({(path.relative_to(ROOT).as_posix(), name or "") for _, path, name in named()})


def test_the_tables_are_read():
    assert len(NAMED) > 300
    assert ("vehicle/plant.py", "evaluate") in NAMED
    assert ("vehicle/tyre/magic_formula/aligning.py", "pneumatic_trail") in NAMED  # named without its folder, too


@pytest.mark.parametrize("path", sorted({path for path, _ in NAMED}))
def test_what_the_page_names_stands_there(path):
    assert (ROOT / path).is_file()
    assert {name for other, name in NAMED if other == path and name} <= defined(ROOT / path)
