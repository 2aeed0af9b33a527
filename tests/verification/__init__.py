"""The requirements on accuracy, feel and cost: one file for each group, ``common`` for their rows.

A group has a function ``rows()`` that yields every requirement with its measured value; the function's docstring is the
title of the table. ``python -m tests.maintain verify`` prints the tables.
"""

import importlib
from collections.abc import Iterable

from steer_env.friction.numerics.registry import modules_by_name


def groups() -> tuple[str, ...]:
    """Names of the groups."""
    return tuple(modules_by_name(__name__))


def table(group: str) -> str:
    """The table of a group as text, with its title."""
    measure = importlib.import_module(f"{__name__}.{group}").rows
    rows = list(measure())
    widths = [max(map(len, cells)) for cells in zip(*rows)]
    lines = ("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)
    text = "\n".join((f"{group}: {measure.__doc__}", *(f"  {line}" for line in lines)))
    return text.replace("\u00a0", " ")  # on a terminal a line is searched for by what it looks like


def print_tables(chosen: Iterable[str]) -> int:
    """Print the tables of some groups; 1 if a requirement is missed, else 0."""
    missed = False
    for group in chosen:
        text = table(group)
        print(text, end="\n\n", flush=True)
        missed = missed or "FAIL" in text
    return int(missed)
