"""A heat map of changes as SVG text: outputs in rows by group, parameters in columns. Nothing is computed here."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from steer_env.experiments.pages.style import new_figure, styled, svg

_MIXED, _NONE, _PALE = "#b9a7c9", "#f4f4f4", "#9a9a9a"
_ROW, _COLUMN, _LEFT, _HEAD = 0.25, 0.72, 4.05, 1.0  # heights and widths [inch]
_KEY = 3.6  # height of the key of the colours [rows]
_STEPS = 11  # of the key


class Cell(NamedTuple):
    """A change, in per cent of what the row is told as a share of."""

    text: str
    share: float  # with its sign, 0 for one that both rises and falls [%]
    strength: float  # its size [%]
    matters: bool  # otherwise it is pale


class Line(NamedTuple):
    """A row."""

    label: str
    about: str  # its value and band
    cells: Sequence[Cell]  # one for each column; none where the output is refused
    note: str = ""  # in place of the cells


@styled
def heat_map(
    columns: Sequence[tuple[str, str]],
    groups: Mapping[str, Sequence[Line]],
    heads: tuple[str, str],
    pale: str,
    top: float = 100.0,
) -> str:
    """Rows by group; the colour ends at ``top`` per cent.

    A column has a name and its range; ``heads`` stand above the labels of the rows and above what is about them;
    ``pale`` tells what is grey in the key of the colours below.
    """
    height = sum(len(lines) + 1.4 for lines in groups.values()) + _KEY
    figure = new_figure(_LEFT + _COLUMN * len(columns) + 0.1, _HEAD + _ROW * height)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    left, head = _LEFT / _COLUMN, _HEAD / _ROW
    axes.set(xlim=(-left, len(columns) + 0.1 / _COLUMN), ylim=(height, -head))
    axes.axis("off")
    for j, (name, span) in enumerate(columns):
        axes.text(j + 0.5, -1.55, name, ha="center", va="bottom", fontsize=9, fontweight="bold", linespacing=1.1)
        axes.text(j + 0.5, -1.35, span, ha="center", va="top", fontsize=8, color="#555555", linespacing=1.1)
    look: Any = {"va": "top", "fontsize": 8.5, "color": "#555555", "linespacing": 1.1}
    axes.text(-left + 0.05, -1.35, heads[0], ha="left", **look)
    axes.text(-0.12, -1.35, heads[1], ha="right", **look)
    y = 0.0
    for title, lines in groups.items():
        axes.text(-left + 0.05, y + 0.75, title, ha="left", va="center", fontsize=10, fontweight="bold")
        y += 1.2
        for line in lines:
            axes.text(-left + 0.15, y + 0.5, line.label, ha="left", va="center", fontsize=9.5)
            axes.text(-0.12, y + 0.5, line.about, ha="right", va="center", fontsize=8.5, color="#555555")
            for j, cell in enumerate(line.cells):
                fill: Any = _NONE
                ink = _PALE
                if cell.matters:
                    share = float(np.clip(cell.share / top, -1.0, 1.0))
                    fill = _colour(share) if share else _MIXED
                    ink = "white" if share and abs(share) > 0.6 else "black"
                axes.add_patch(Rectangle((j + 0.02, y + 0.04), 0.96, 0.92, facecolor=fill, edgecolor="none"))
                weight = "bold" if cell.matters else "normal"
                axes.text(
                    j + 0.5, y + 0.52, cell.text, ha="center", va="center", fontsize=9.5, color=ink, weight=weight
                )
            if line.note:
                axes.text(
                    0.1, y + 0.5, line.note, ha="left", va="center", fontsize=8.5, style="italic", color="#7a4a00"
                )
            y += 1.0
        y += 0.2
    _key(axes, height - _KEY + 0.6, -left + 0.15, heads[0].replace("\n", " "), pale, top)
    return svg(figure)


def _colour(share: float) -> Any:
    """The colour of a change from -1 to 1 of the end of the scale."""
    return colormaps["RdBu"](0.5 + 0.42 * share)


def _key(axes: Axes, y: float, left: float, what: str, pale: str, top: float) -> None:
    """The key of the colours below a height: a bar from falling to rising, then the two that are not on it."""
    axes.text(
        left, y + 0.1, f"Colours: {what}, from the low to the high end of the parameter", va="center", fontsize=8.5
    )
    for k in range(_STEPS):
        share = 2.0 * k / (_STEPS - 1) - 1.0
        axes.add_patch(Rectangle((left + 0.5 * k, y + 0.7), 0.5, 0.8, facecolor=_colour(share), edgecolor="none"))
    for share, text in ((0.0, f"−{top:.0f} %\nor more: falls"), (1.0, f"+{top:.0f} %\nor more: rises"), (0.5, "0")):
        align = {0.0: "left", 1.0: "right"}.get(share, "center")
        axes.text(left + 0.5 * _STEPS * share, y + 1.6, text, ha=align, va="top", fontsize=8.5, color="#333333")
    for k, (colour, text) in enumerate(((_MIXED, "±: rises and falls"), (_NONE, pale))):
        at = left + 0.5 * _STEPS + 0.6, y + 0.7 + 1.0 * k
        axes.add_patch(Rectangle(at, 0.5, 0.8, facecolor=colour, edgecolor="#c4ccd4", linewidth=0.5))
        axes.text(at[0] + 0.65, at[1] + 0.4, text, va="center", fontsize=8.5, color="#333333")
