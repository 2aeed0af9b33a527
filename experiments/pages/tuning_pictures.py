"""Pictures of calibration as SVG text. What they show is handed over; nothing is computed here."""

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from steer_env.experiments.pages.style import DASHES, PALETTE, as_svg, new_figure

Array = NDArray[np.float64]

_SHADE, _GOOD = "#8a949e", "#e3f2ea"
_MARKS = ("s", "#555f69"), ("D", "#b00020"), ("^", "#882255"), ("v", "#332288")  # shape and colour


@as_svg
def front(
    sets: Mapping[str, Array],
    chosen: Array,
    marks: Mapping[str, Sequence[float]],
    names: Sequence[str],
    ends: Sequence[float],
) -> Figure:
    """Pareto front, in a panel for each pair of objectives.

    Parameters
    ----------
    sets : mapping of str to (N, K) array
        Objectives of the sets of each optimiser that keep the constraints [1].
    chosen : (M, K) array
        Those on the front.
    marks : mapping of str to (K,)
        Sets with a name of their own, at most four.
    names : sequence of str
        Of the objectives.
    ends : (K,) sequence of float
        Of the axes; a set beyond the end of any of them is not drawn [1].
    """
    pairs = list(combinations(range(len(names)), 2)) or [(0, 0)]
    figure = new_figure(3.6 * len(pairs) + 0.4, 3.9)
    for axes, (i, j) in zip(figure.subplots(1, len(pairs), squeeze=False)[0], pairs):
        for (label, values), colour in zip(sets.items(), PALETTE):
            x, y = _inside(values, ends)[:, [i, j]].T
            axes.plot(x, y, "o", color=colour, markersize=5, markeredgewidth=0, alpha=0.6, label=label)
        x, y = _inside(chosen, ends)[:, [i, j]].T
        axes.plot(x, y, "o", markerfacecolor="none", color="black", markersize=8, label="Pareto front of all")
        for (label, point), (shape, colour) in zip(marks.items(), _MARKS):
            axes.plot(point[i], point[j], shape, color=colour, markersize=10, markeredgecolor="white", label=label)
        axes.set(xlabel=f"{names[i]}: widths off the bands", ylabel=f"{names[j]}: widths off the bands")
        axes.set(xlim=(-0.04 * ends[i], ends[i]), ylim=(-0.04 * ends[j], ends[j]))
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5)
    return figure


def _inside(values: Array, ends: Sequence[float]) -> Array:
    found: Array = values[np.all(values <= np.asarray(ends), axis=1)]
    return found


@as_svg
def importances(shares: Mapping[str, Mapping[str, float]], parameters: Sequence[str]) -> Figure:
    """Share of each parameter in the spread of each objective, as bars [1]."""
    figure = new_figure(3.3 * len(shares) + 1.2, 0.28 * len(parameters) + 0.9)
    panels = figure.subplots(1, len(shares), squeeze=False, sharey=True)[0]
    places = np.arange(len(parameters))
    for axes, (title, each) in zip(panels, shares.items()):
        axes.barh(places, [100.0 * each.get(name, 0.0) for name in parameters], color=PALETTE[0])
        axes.set(title=title, xlabel="share [%]", yticks=places, yticklabels=parameters, xlim=(0.0, 100.0))
        axes.grid(visible=False, axis="y")
    panels[0].invert_yaxis()
    return figure


@as_svg
def ranking(shares: Mapping[str, float]) -> Figure:
    """Mean change by parameter as bars, in per cent of a band [1]."""
    figure = new_figure(5.0, 0.28 * len(shares) + 0.9)
    axes = figure.subplots()
    axes.barh(list(shares), [100.0 * share for share in shares.values()], color=PALETTE[0])
    axes.set(xlabel="mean change over its range [% of a band]")
    axes.grid(visible=False, axis="y")
    axes.invert_yaxis()
    return figure


@as_svg
def course(curves: Mapping[str, Array], own: float) -> Figure:
    """The best set so far over the number of evaluated sets, a line for each optimiser [1]."""
    figure = new_figure(6.4, 2.8)
    axes = figure.subplots()
    for (label, y), colour, dash in zip(curves.items(), PALETTE, DASHES):
        axes.step(np.arange(1, len(y) + 1), y, color=colour, linestyle=dash, where="post", label=label)
    axes.axhline(own, color=_SHADE, linewidth=1.0, label="starting point")
    most = np.nanmax([own, *(y for each in curves.values() for y in each)]) if curves else own
    axes.set(
        xlabel="evaluated sets", ylabel="widths off the bands, in all", ylim=(0.0, 1.1 * most if most > 0.0 else None)
    )
    axes.legend(fontsize=8, loc="lower left")
    return figure


@as_svg
def boost(torques: Array, speeds: Sequence[str], before: Array, after: Array) -> Figure:
    """Boost (V, T) before and after over the torsion-bar torque (T,) [N m], a panel for each speed [km/h]."""
    figure = new_figure(9.6, 2.6)
    for axes, speed, a, b in zip(np.ravel(figure.subplots(1, len(speeds), sharey=True)), speeds, before, after):
        axes.plot(torques, a, color=_SHADE, label="start")
        axes.plot(torques, b, color=PALETTE[0], label="tuned")
        axes.set(title=f"{speed} km/h", xlabel="torsion-bar torque [N m]", xlim=(0.0, torques[-1]), ylim=(0.0, None))
    figure.axes[0].set_ylabel("boost [N m]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


@as_svg
def bands(rows: Mapping[str, Mapping[str, tuple[float, float]]], never: Collection[str]) -> Figure:
    """Span of each metric over the conditions beside its band, which is shaded, in widths of the band.

    ``rows`` has for each metric the spans of two sets, from 0 at the lower end of the band to 1 at the upper [1];
    ``never`` has those that no set reaches.
    """
    figure = new_figure(4.5, 0.25 * len(rows) + 0.8)
    axes = figure.subplots()
    axes.axvspan(0.0, 1.0, color=_GOOD, zorder=0)
    for k, (metric, spans) in enumerate(rows.items()):
        for (label, (low, high)), colour, shift in zip(spans.items(), (_SHADE, PALETTE[0]), (-0.17, 0.17)):
            ends = np.clip([low, high], -0.95, 1.95)
            name = label if k == 0 else None
            axes.plot(ends, [k + shift] * 2, "|-", color=colour, linewidth=3.0, markersize=6, label=name)
            if low < -0.95:
                axes.plot(-0.95, k + shift, "<", color=colour, markersize=6)
            if high > 1.95:
                axes.plot(1.95, k + shift, ">", color=colour, markersize=6)
        if metric in never:
            axes.text(2.05, k, "no set", va="center", fontsize=8, color=_MARKS[1][1])
    axes.set(yticks=range(len(rows)), yticklabels=list(rows), xlim=(-1.0, 2.0), xticks=(0.0, 1.0))
    axes.set(xticklabels=("lower", "upper"), xlabel="end of the good band")
    axes.grid(visible=False, axis="y")
    axes.invert_yaxis()
    figure.legend(loc="outside upper center", ncols=2)
    return figure


@as_svg
def shares(rows: Mapping[str, tuple[float, float, float]]) -> Figure:
    """Shares with the ends of their intervals as bars, a row for each (share, low, high) [1]."""
    figure = new_figure(5.0, 0.28 * len(rows) + 0.9)
    axes = figure.subplots()
    value, low, high = 100.0 * np.array(list(rows.values())).T
    reach = np.maximum([value - low, high - value], 0.0)
    axes.barh(list(rows), value, color=PALETTE[0], xerr=reach, error_kw={"elinewidth": 1.2, "capsize": 2.5})
    axes.set(xlabel="cars in the good band [%]", xlim=(0.0, 101.0))
    axes.grid(visible=False, axis="y")
    axes.invert_yaxis()
    return figure


class Spread(NamedTuple):
    """A metric of many cars beside its bands, all from 0 at the lower end of the good band to 1 at the upper [1]."""

    places: Array  # (n,) of the cars [1]
    nominal: float  # of the nominal car [1]
    fair: tuple[float, float]  # ends of the fair band [1]


@as_svg
def distributions(rows: Mapping[str, Spread]) -> Figure:
    """Histograms of metrics beside their bands, a row for each; what lies beyond the axis is in the outermost bin."""
    low, high, bins = -0.75, 1.75, 75
    figure = new_figure(9.0, 0.36 * len(rows) + 0.8)
    axes = figure.subplots()
    edges = np.linspace(low, high, bins + 1)
    axes.axvspan(0.0, 1.0, color=_GOOD, zorder=0, label="good band")
    for k, row in enumerate(rows.values()):
        ends = np.clip(row.fair, low, high)
        for side, end in enumerate(ends):
            axes.plot([end, end], [k - 0.8, k], color=_SHADE, linewidth=0.9, label="" if k or side else "fair band")
        counts, _ = np.histogram(np.clip(row.places, low, high), edges)
        top = k - 0.8 * counts / max(counts.max(), 1)
        axes.stairs(top, edges, baseline=k, fill=True, color=PALETTE[0], alpha=0.75, label="" if k else "cars")
        if low <= row.nominal <= high:
            axes.plot(row.nominal, k, "^", color="black", markersize=4.5, label="" if k else "nominal car")
    axes.set(yticks=range(len(rows)), yticklabels=list(rows), xlim=(low, high), ylim=(len(rows) - 0.75, -0.95))
    axes.set(xticks=(0.0, 1.0), xticklabels=("lower", "upper"), xlabel="end of the good band")
    axes.grid(visible=False)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(*zip(*((h, la) for h, la in zip(handles, labels) if la)), loc="outside upper center", ncols=4)
    return figure


_MIXED_COLOUR, _MISSING_COLOUR, _PALE_COLOUR = "#b9a7c9", "#f4f4f4", "#9a9a9a"
_ROW_HEIGHT, _COLUMN_WIDTH, _LEFT_WIDTH, _HEAD_HEIGHT = 0.25, 0.72, 4.05, 1.0  # heights and widths [inch]
_KEY_HEIGHT = 3.6  # height of the key of the colours [rows]
_KEY_STEPS = 11  # of the key


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


@as_svg
def heat_map(
    columns: Sequence[tuple[str, str]],
    groups: Mapping[str, Sequence[Line]],
    heads: tuple[str, str],
    pale: str,
    top: float = 100.0,
) -> Figure:
    """Rows by group; the colour ends at ``top`` per cent.

    A column has a name and its range; ``heads`` stand above the labels of the rows and above what is about them;
    ``pale`` tells what is grey in the key of the colours below.
    """
    height = sum(len(lines) + 1.4 for lines in groups.values()) + _KEY_HEIGHT
    figure = new_figure(_LEFT_WIDTH + _COLUMN_WIDTH * len(columns) + 0.1, _HEAD_HEIGHT + _ROW_HEIGHT * height)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    left, head = _LEFT_WIDTH / _COLUMN_WIDTH, _HEAD_HEIGHT / _ROW_HEIGHT
    axes.set(xlim=(-left, len(columns) + 0.1 / _COLUMN_WIDTH), ylim=(height, -head))
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
                fill: Any = _MISSING_COLOUR
                ink = _PALE_COLOUR
                if cell.matters:
                    share = float(np.clip(cell.share / top, -1.0, 1.0))
                    fill = _colour(share) if share else _MIXED_COLOUR
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
    _key(axes, height - _KEY_HEIGHT + 0.6, -left + 0.15, heads[0].replace("\n", " "), pale, top)
    return figure


def _colour(share: float) -> Any:
    """The colour of a change from -1 to 1 of the end of the scale."""
    return colormaps["RdBu"](0.5 + 0.42 * share)


def _key(axes: Axes, y: float, left: float, what: str, pale: str, top: float) -> None:
    """The key of the colours below a height: a bar from falling to rising, then the two that are not on it."""
    axes.text(
        left, y + 0.1, f"Colours: {what}, from the low to the high end of the parameter", va="center", fontsize=8.5
    )
    for k in range(_KEY_STEPS):
        share = 2.0 * k / (_KEY_STEPS - 1) - 1.0
        axes.add_patch(Rectangle((left + 0.5 * k, y + 0.7), 0.5, 0.8, facecolor=_colour(share), edgecolor="none"))
    for share, text in ((0.0, f"−{top:.0f} %\nor more: falls"), (1.0, f"+{top:.0f} %\nor more: rises"), (0.5, "0")):
        align = {0.0: "left", 1.0: "right"}.get(share, "center")
        axes.text(left + 0.5 * _KEY_STEPS * share, y + 1.6, text, ha=align, va="top", fontsize=8.5, color="#333333")
    for k, (colour, text) in enumerate(((_MIXED_COLOUR, "±: rises and falls"), (_MISSING_COLOUR, pale))):
        at = left + 0.5 * _KEY_STEPS + 0.6, y + 0.7 + 1.0 * k
        axes.add_patch(Rectangle(at, 0.5, 0.8, facecolor=colour, edgecolor="#c4ccd4", linewidth=0.5))
        axes.text(at[0] + 0.65, at[1] + 0.4, text, va="center", fontsize=8.5, color="#333333")
