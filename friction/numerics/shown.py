"""How results show themselves in a notebook: a table in HTML, and a frame of pandas where that is installed."""

from collections.abc import Mapping, Sequence
from html import escape
from importlib.util import find_spec
from typing import Any

Rows = Sequence[Mapping[str, Any]]  # of a table: name of the column -> value, each with the same columns

LONG = 40  # rows of a table that is folded


def html(title: str, rows: Rows) -> str:
    """The HTML of a table under its title, folded where it is long; numbers have five digits."""
    head = "".join(f"<th>{escape(name)}</th>" for name in (rows[0] if rows else ()))
    body = "".join("<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row.values()) + "</tr>" for row in rows)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f"<details{' open' * (len(rows) <= LONG)}><summary>{escape(title)}</summary>{table}</details>"


def _cell(value: Any) -> str:
    return escape(f"{value:.5g}" if isinstance(value, float) else str(value))


def frame(columns: Any, **arguments: Any) -> Any:
    """A ``pandas.DataFrame`` of columns or rows, with the arguments of its class.

    Raises
    ------
    ImportError
        pandas is not installed.
    """
    if find_spec("pandas") is None:
        raise ImportError("to_frame needs the package pandas, which is not installed: pip install pandas")
    import pandas  # here, as no part of the package needs it

    return pandas.DataFrame(columns, **arguments)


def new_axes() -> Any:
    """Axes of a new figure of pyplot, which a notebook shows by itself."""
    from matplotlib import pyplot  # here, because it takes long to import

    return pyplot.subplots(figsize=(5.5, 3.8), layout="constrained")[1]
