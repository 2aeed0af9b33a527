"""Pictures of computing times as SVG text. What they show is handed over; nothing is computed here."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from steer_env.experiments.pages.style import DASHES, PALETTE, as_svg, new_figure

_OTHERS = "#8a949e"
_PLAIN_FORMATTER = FuncFormatter(lambda x, _: f"{x:g}")


@as_svg
def ratios(rows: Mapping[str, tuple[float, float, float, bool]]) -> Figure:
    """Ratios with their intervals (median, low, high) [1], the smallest first; whether a row is of this project."""
    figure = new_figure(6.4, 0.24 * len(rows) + 0.8)
    axes = figure.subplots()
    ordered = sorted(rows.items(), key=lambda item: item[1][0])
    for k, (_, (median, low, high, own)) in enumerate(ordered):
        colour = PALETTE[0] if own else _OTHERS
        axes.plot([low, high], [k, k], "|-", color=colour, markersize=6)
        axes.plot(median, k, "o", color=colour, markersize=5)
    axes.axvline(1.0, color=_OTHERS, linewidth=0.8)
    axes.set(xscale="log", yticks=range(len(ordered)), yticklabels=[name for name, _ in ordered])
    axes.set(xlabel="time of a row's step over that of CartPole-v1")
    axes.xaxis.set_major_formatter(_PLAIN_FORMATTER)
    axes.grid(visible=False, axis="y")
    axes.invert_yaxis()
    return figure


@as_svg
def rows(lines: Mapping[str, tuple[Sequence[int], Sequence[float]]]) -> Figure:
    """Ratio of a row [1] over the number of rows, a line for each environment with its threads."""
    figure = new_figure(6.4, 3.2)
    axes = figure.subplots()
    looks = [(colour, dash) for colour in PALETTE for dash in DASHES[:2]]
    for (label, (x, y)), (colour, dash) in zip(lines.items(), looks):
        axes.plot(x, y, "o", color=colour, linestyle=dash, markersize=4, label=label)
    axes.set(xscale="log", yscale="log", xlabel="rows", ylabel="time of a row over CartPole-v1")
    axes.set_xticks(sorted({n for x, _ in lines.values() for n in x}))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(_PLAIN_FORMATTER)
        axis.set_minor_formatter(NullFormatter())
    figure.legend(loc="outside right upper", fontsize=8)
    return figure


@as_svg
def shares(bars: Mapping[str, Mapping[str, float]]) -> Figure:
    """What parts take of a step as a bar for each chassis [1]."""
    figure = new_figure(6.4, 0.5 * len(bars) + 1.3)
    axes = figure.subplots()
    left = np.zeros(len(bars))
    for name, colour in zip(next(iter(bars.values()), {}), PALETTE):
        width = 100.0 * np.array([max(of[name], 0.0) for of in bars.values()])
        axes.barh(list(bars), width, left=left, color=colour, height=0.6, label=name)
        left += width
    axes.set(xlabel="share of a step of the environment [%]")
    axes.grid(visible=False, axis="y")
    axes.invert_yaxis()
    figure.legend(loc="outside upper center", ncols=2, fontsize=8)
    return figure
