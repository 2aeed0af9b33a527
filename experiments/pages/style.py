"""The look that all pictures share, one colour and one dash for each law throughout, and how they become files."""

import functools
import io
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import chain, count
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter

from steer_env import friction
from steer_env.experiments.pages.files import csv_text, write_bytes, write_text

Style = dict[str, Any]
P = ParamSpec("P")

# Okabe and Ito's palette, which colour-blind readers tell apart, four of Tol's, and three for laws of one's own; the
# dashes serve print in grey.
PALETTE = (
    *("#0072B2", "#D55E00", "#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9"),
    *("#882255", "#999933", "#332288", "#AA4499"),
    *("#7A4A21", "#7FB800", "#9467BD"),
)
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), "-.", (0, (7, 2, 1.5, 2, 1.5, 2)))
# These keep their colours whatever else is drawn.
_FIRST = (
    *("lugre", "masing", "dahl", "coulomb", "viscous"),
    *("gms", "stribeck", "exponential_spring", "elasto_plastic", "bouc_wen"),
    "masing_position",
)
LEGEND_COLUMNS = 5  # that a row has room for
DOTS = 200  # of a PNG in an inch
LETTERS, HANDLE = 13.0, 6  # of a legend in an inch, and those that a line with its margins takes the room of

STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica Neue", "Helvetica", "Arial", "Liberation Sans", "DejaVu Sans"],  # as the page
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    **{
        "xtick.major.size": 0,
        "ytick.major.size": 0,
        "xtick.minor.size": 0,
        "ytick.minor.size": 0,
    },  # as the grid
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "svg.fonttype": "none",  # text stays text: small files, and the font of the page
    "svg.hashsalt": "steer-env",  # the same picture is the same file
    "pdf.fonttype": 42,  # whole fonts, as publishers ask for
    "path.simplify_threshold": 0.3,
}

_kept: ContextVar[tuple[Path, set[str]] | None] = ContextVar("folder of the pictures and their names", default=None)


@contextmanager
def picture_folder(folder: Path | None) -> Iterator[None]:
    """Write every picture drawn meanwhile into a folder as SVG, PDF and PNG, with its data as CSV; None: nowhere."""
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    token = _kept.set(None if folder is None else (folder, set()))
    try:
        yield
    finally:
        _kept.reset(token)


def as_svg(draw: Callable[P, Figure]) -> Callable[P, str]:
    """Make a function that draws a figure one that gives it as SVG text, in the style of all pictures.

    The file of a picture (:func:`picture_folder`) is named by the figure's label, or by the function.
    """

    @functools.wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> str:
        with matplotlib.rc_context(STYLE):
            figure = draw(*args, **kwargs)
            text = _save(figure, "svg").decode()
            if place := _kept.get():
                _write(*place, str(figure.get_label()) or draw.__name__, figure, text)
        return text

    return drawn


def styles(laws: Iterable[str]) -> dict[str, Style]:
    """Colour and dash of every law, laws of one's own too; a label of another name takes what they leave free."""
    laws = list(laws)
    known = (*_FIRST, *(law for law in friction.available() if law not in _FIRST))
    others = [law for law in laws if law not in known]
    free = [i for i in range(len(PALETTE)) if i >= len(known) or known[i] not in laws] or range(len(PALETTE))
    looks = {law: (PALETTE[i % len(PALETTE)], DASHES[i % len(DASHES)]) for i, law in enumerate(known) if law in laws}
    for k, law in enumerate(others):
        i = free[k % len(free)]
        # Round after round a colour comes back with another dash.
        looks[law] = PALETTE[i], DASHES[(i + 1 + k // len(free)) % len(DASHES)]
    return {
        law: {"color": colour, "linestyle": dash, "label": law, "zorder": 3.0 - 0.1 * i}
        for i, (law, (colour, dash)) in enumerate(looks.items())
    }


def colours(labels: Iterable[str]) -> list[str]:
    """Colour of every label."""
    labels = list(labels)
    return [styles(labels)[label]["color"] for label in labels]


class _Picture(Figure):
    """A figure that ``savefig`` draws once; it would draw another one only to lay it out, and throw that away."""

    def draw(self, renderer: Any) -> None:
        """Lay the figure out where it has an engine for that, which ``savefig`` then takes away to draw it."""
        if isinstance(engine := self.get_layout_engine(), ConstrainedLayoutEngine):
            engine.execute(self)
        else:
            super().draw(renderer)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of a size [inch]."""
    return _Picture(figsize=(width, height), layout="constrained")


def legend(figure: Figure, axes: Axes, columns: int | None = None) -> None:
    """A legend of one pair of axes above the whole figure, in rows of ``LEGEND_COLUMNS`` or fewer."""
    add_legend_of(figure, *axes.get_legend_handles_labels(), columns or LEGEND_COLUMNS)


def add_legend_of(figure: Figure, handles: Sequence[Any], labels: Sequence[str], columns: int) -> None:
    """A legend above the whole figure: ``columns`` of the labels in a row, or fewer where they are long."""
    room = int(LETTERS * figure.get_figwidth() / (max(map(len, labels), default=0) + HANDLE))
    figure.legend(handles, labels, loc="outside upper center", ncols=max(1, min(columns, len(labels), room)))


def _save(figure: Figure, form: str) -> bytes:
    file = io.BytesIO()
    own = {"svg": ("Date", "Creator"), "pdf": ("CreationDate", "Creator"), "png": ("Software",)}[form]
    figure.savefig(file, format=form, dpi=DOTS, metadata=dict.fromkeys(own))
    return file.getvalue()


def _write(folder: Path, written: set[str], label: str, figure: Figure, svg: str) -> None:
    """Write a picture and its data; the second of a name is ``name_2``."""
    name = re.sub(r"\W+", "_", label).strip("_").lower()
    name = next(each for each in chain([name], (f"{name}_{k}" for k in count(2))) if each not in written)
    written.add(name)
    write_text(folder / f"{name}.svg", svg)
    for form in ("pdf", "png"):
        write_bytes(folder / f"{name}.{form}", _save(figure, form))
    write_text(folder / f"{name}.csv", _data(figure))


def _data(figure: Figure) -> str:
    """What a figure shows, a row for each point, end of a bar or cell of a map, in the units of its axes."""
    rows: list[Sequence[Any]] = [("panel", "title", "x_axis", "y_axis", "label", "x", "y", "value", "x_name", "y_name")]
    for k, axes in enumerate(figure.axes, 1):
        words = (axes.get_xlabel() or figure.get_supxlabel(), axes.get_ylabel() or figure.get_supylabel())
        columns, rows_of = _names(axes.xaxis), _names(axes.yaxis)
        for label, points in _points(axes):
            about = (k, axes.get_title(loc="left"), *words, "" if label.startswith("_") else label)
            for x, y, *value in points:
                rows.append((*about, x, y, *(value or [""]), _nearest(columns, x), _nearest(rows_of, y)))
    return csv_text(rows)


def _names(axis: Axis) -> dict[float, str]:
    """Place -> what stands there on an axis of names, as of laws; nothing on an axis of numbers."""
    if not isinstance(axis.get_major_formatter(), FuncFormatter):
        return {}
    return dict(zip(axis.get_majorticklocs().tolist(), (text.get_text() for text in axis.get_majorticklabels())))


def _nearest(names: dict[float, str], place: float) -> str:
    return names[min(names, key=lambda each: abs(each - place))] if names else ""


def _points(axes: Axes) -> Iterator[tuple[str, Any]]:
    """Label and rows (n, 2), or (n, 3) with a value, of everything that is drawn in the units of the axes."""
    for line in axes.lines:
        if line.get_transform() == axes.transData:  # a limit across the whole axes is not
            yield str(line.get_label()), line.get_xydata()
    for marks in axes.collections:
        if isinstance(marks, PathCollection):
            yield str(marks.get_label()), marks.get_offsets()
        elif isinstance(marks, LineCollection):
            for segment in marks.get_segments():
                yield str(marks.get_label()), segment
    for bar in (patch for patch in axes.patches if isinstance(patch, Rectangle)):
        yield str(bar.get_label()), [(bar.get_x() + bar.get_width(), bar.get_y() + 0.5 * bar.get_height())]
    for image in axes.images:
        values: Any = np.ma.filled(np.ma.asarray(image.get_array(), float), np.nan)
        left, right, bottom, top = image.get_extent()
        (n, m), half = values.shape, 0.5
        x = left + (right - left) * (np.arange(m) + half) / m
        y = bottom + (top - bottom) * (np.arange(n) + half) / n
        yield str(image.get_label()), [(a, b, values[j, i]) for j, b in enumerate(y) for i, a in enumerate(x)]


_PLACES = re.compile(r'(?<=\s)(x|y|transform)="([^"]*)"')  # attributes that hold coordinates
_PATH = re.compile(r'(?<=\s)d="([^"]*)"')
_LONG = re.compile(r"-?\d+\.\d+")
_COMMAND = re.compile(r"([A-Za-z])([^A-Za-z]*)")
_LEFT_OUT = re.compile(
    r'<\?.*?\?>|<!.*?>|<metadata>.*?</metadata>|(?<=>)\s+(?=<)|(?<=\n) +| transform="rotate\(-0 [^"]*"', re.DOTALL
)
_GROUP = re.compile(r"<g>|<g [^>]*>|</g>")
_FAMILY = re.compile(r"font-family: [^;]*; ")
_CLIPPED = re.compile(r'clip-path="url\(#([^)]*)\)" class="([^"]*)"')
_ID_PATTERN = re.compile(r' id="([^"]*)"')
_STYLE = re.compile(r'style="([^"]*)"')
_REFERENCE = re.compile(r'="#([^"]*)"|url\(#([^)]*)\)')


def smaller(svg: str) -> str:
    """A picture that looks the same with about a third of the text.

    Coordinates are rounded to a tenth of a point of paper and given from one point to the next, every style, every edge
    that cuts and the first family of fonts are written once, names that are referred to are short, and what has no
    effect goes: metadata, other names, bare and empty groups.
    """
    used = dict.fromkeys(name for pair in _REFERENCE.findall(svg) for name in pair if name)
    short = {name: f"i{k}" for k, name in enumerate(used)}
    styles: dict[str, str] = {}

    def named(found: re.Match[str]) -> str:
        return f' id="{short[found[1]]}"' if found[1] in short else ""

    def referred(found: re.Match[str]) -> str:
        return f'="#{short[found[1]]}"' if found[1] else f"url(#{short[found[2]]})"

    def classed(found: re.Match[str]) -> str:
        return f'class="{styles.setdefault(found[1], f"s{len(styles)}")}"'

    text = _REFERENCE.sub(referred, _ID_PATTERN.sub(named, _LEFT_OUT.sub("", svg)))
    text = _PATH.sub(_stepwise, _PLACES.sub(_round, _STYLE.sub(classed, text))).replace("<g/>", "")
    clips = dict.fromkeys(found[1] for found in _CLIPPED.finditer(text))
    text = _CLIPPED.sub(r'class="\2 \1"', text)
    sheet = "".join(f".{name}{{{style}}}" for style, name in styles.items())
    sheet += "".join(f".{name}{{clip-path: url(#{name})}}" for name in clips)
    if family := _FAMILY.search(sheet):
        sheet = f"text{{{family[0]}}}{sheet.replace(family[0], '')}"
    return re.sub(r"(<svg[^>]*>)", rf"\1<style>{sheet}</style>", _remove_groups(text), count=1)


def _round(place: re.Match[str]) -> str:
    text = _LONG.sub(lambda found: f"{float(found[0]):.1f}".removesuffix(".0"), place[2])
    return f'{place[1]}="{text}"'


def _stepwise(path: re.Match[str]) -> str:
    """A path in tenths of a point, every segment relative to the end of the one before it."""
    text, last = "", [0, 0]
    for command, numbers in _COMMAND.findall(path[1]):  # one for each segment
        points = [round(10.0 * float(number)) for number in numbers.split()]
        start = [0, 0] if command == "M" else last
        steps = (place - start[i % 2] for i, place in enumerate(points))  # x and y in turn
        shown = " ".join([f"{0.1 * step:.1f}".removesuffix(".0") for step in steps])
        text += (command if command == "M" else command.lower()) + shown
        last = points[-2:] or last  # a closed path begins anew with an M
    short = re.sub(r"(?<!\d)0\.", ".", text).replace(" -", "-")
    return f'd="{short}"'


def _remove_groups(svg: str) -> str:
    """A picture without the groups that have no attribute."""
    kept: list[bool] = []

    def group(found: re.Match[str]) -> str:
        if found[0] != "</g>":
            kept.append(found[0] != "<g>")
            return found[0] if kept[-1] else ""
        return "</g>" if kept.pop() else ""

    return _GROUP.sub(group, svg)
