"""The look that all pictures share: one colour and one dash for each law throughout."""

import io
import re
from collections.abc import Iterable
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

Style = dict[str, Any]

# Okabe and Ito's palette, which colour-blind readers tell apart, and three of Tol's; the dashes serve print in grey.
PALETTE = (
    *("#0072B2", "#D55E00", "#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9"),
    *("#882255", "#999933", "#332288"),
)
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), "-.", (0, (7, 2, 1.5, 2, 1.5, 2)))
# These keep their colours whatever else is drawn.
_FIRST = (
    *("lugre", "masing", "dahl", "coulomb", "viscous"),
    *("gms", "stribeck", "exponential_spring", "elasto_plastic", "bouc_wen"),
)
LEGEND_COLUMNS = 5  # that a row has room for

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
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "svg.fonttype": "none",  # text stays text: small files, and the font of the page
    "svg.hashsalt": "steer-env",  # the same picture is the same file
    "path.simplify_threshold": 0.3,
}

styled = matplotlib.rc_context(STYLE)  # as a decorator


def styles(laws: Iterable[str]) -> dict[str, Style]:
    """Colour and dash of every law; a label of another name takes what the packaged laws beside it leave free."""
    laws = list(laws)
    others = [law for law in laws if law not in _FIRST]
    free = [i for i in range(len(PALETTE)) if i >= len(_FIRST) or _FIRST[i] not in laws] or range(len(PALETTE))
    looks = {law: (PALETTE[i], DASHES[i % len(DASHES)]) for i, law in enumerate(_FIRST) if law in laws}
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


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of a size [inch]."""
    return Figure(figsize=(width, height), layout="constrained")


def legend(figure: Figure, axes: Axes, columns: int | None = None) -> None:
    """A legend of one pair of axes above the whole figure, in rows of ``LEGEND_COLUMNS`` or fewer."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(columns or LEGEND_COLUMNS, len(labels)))


def svg(figure: Figure) -> str:
    """A figure as SVG text."""
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()


_PLACES = re.compile(r'(?<=\s)(d|x|y|transform)="([^"]*)"')  # attributes that hold coordinates
_LONG = re.compile(r"-?\d+\.\d+")
_COMMAND = re.compile(r"\s*([A-Za-z])\s*")
_LEFT_OUT = re.compile(r"<\?.*?\?>|<!.*?>|<metadata>.*?</metadata>|(?<=>)\s+(?=<)|(?<=\n) +", re.DOTALL)
_NAME = re.compile(r' id="([^"]*)"')
_STYLE = re.compile(r'style="([^"]*)"')
_REFERENCE = re.compile(r'="#([^"]*)"|url\(#([^)]*)\)')


def smaller(svg: str) -> str:
    """A picture that looks the same with about half the text.

    Coordinates are rounded to a tenth of a point of paper, every style is written once, and metadata and the names of
    what nothing refers to go.
    """
    used = {name for pair in _REFERENCE.findall(svg) for name in pair}
    styles: dict[str, str] = {}

    def named(found: re.Match[str]) -> str:
        return found[0] if found[1] in used else ""

    def classed(found: re.Match[str]) -> str:
        return f'class="{styles.setdefault(found[1], f"s{len(styles)}")}"'

    text = _NAME.sub(named, _LEFT_OUT.sub("", svg))
    text = _PLACES.sub(_rounded, _STYLE.sub(classed, text))
    sheet = "".join(f".{name}{{{style}}}" for style, name in styles.items())
    return re.sub(r"(<svg[^>]*>)", rf"\1<style>{sheet}</style>", text, count=1)


def _rounded(place: re.Match[str]) -> str:
    text = _LONG.sub(lambda found: f"{float(found[0]):.1f}".removesuffix(".0"), place[2])
    short = _COMMAND.sub(r"\1", " ".join(text.split()))
    return f'{place[1]}="{short}"'
