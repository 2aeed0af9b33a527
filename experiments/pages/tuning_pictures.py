"""Pictures of a tuning as SVG text. What they show is handed over; nothing is computed here."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from steer_env.experiments.pages.style import DASHES, PALETTE, new_figure, styled, svg

Array = NDArray[np.float64]

_SHADE, _GOOD = "#8a949e", "#e3f2ea"
_MARKS = ("s", "#555f69"), ("D", "#b00020"), ("^", "#882255"), ("v", "#332288")  # shape and colour


@styled
def front(
    sets: Mapping[str, Array],
    chosen: Array,
    marks: Mapping[str, Sequence[float]],
    names: Sequence[str],
    ends: Sequence[float],
) -> str:
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
    return svg(figure)


def _inside(values: Array, ends: Sequence[float]) -> Array:
    found: Array = values[np.all(values <= np.asarray(ends), axis=1)]
    return found


@styled
def importances(shares: Mapping[str, Mapping[str, float]], parameters: Sequence[str]) -> str:
    """Share of each parameter in the spread of each objective, as bars [1]."""
    figure = new_figure(3.3 * len(shares) + 1.2, 0.28 * len(parameters) + 0.9)
    panels = figure.subplots(1, len(shares), squeeze=False, sharey=True)[0]
    places = np.arange(len(parameters))
    for axes, (title, each) in zip(panels, shares.items()):
        axes.barh(places, [100.0 * each.get(name, 0.0) for name in parameters], color=PALETTE[0])
        axes.set(title=title, xlabel="share [%]", yticks=places, yticklabels=parameters, xlim=(0.0, 100.0))
        axes.grid(visible=False, axis="y")
    panels[0].invert_yaxis()
    return svg(figure)


@styled
def course(curves: Mapping[str, Array], own: float) -> str:
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
    return svg(figure)


@styled
def bands(rows: Mapping[str, Mapping[str, tuple[float, float]]]) -> str:
    """Span of each metric over the conditions beside its band, which is shaded, in widths of the band.

    ``rows`` has for each metric the spans before and after, from 0 at the lower end of the band to 1 at the upper [1].
    """
    figure = new_figure(7.4, 0.3 * len(rows) + 0.9)
    axes = figure.subplots()
    axes.axvspan(0.0, 1.0, color=_GOOD, zorder=0)
    for k, spans in enumerate(rows.values()):
        for (label, (low, high)), colour, shift in zip(spans.items(), ("#8a949e", PALETTE[0]), (-0.14, 0.14)):
            ends = np.clip([low, high], -0.98, 1.98)
            name = label if k == 0 else None
            axes.plot(ends, [k + shift] * 2, "|-", color=colour, linewidth=3.0, markersize=7, label=name)
    axes.set(yticks=range(len(rows)), yticklabels=list(rows), xlim=(-1.0, 2.0))
    axes.set(xlabel="place in the band: 0 its lower end, 1 its upper; spans over friction and load")
    axes.grid(visible=False, axis="y")
    axes.invert_yaxis()
    figure.legend(loc="outside upper center", ncols=2)
    return svg(figure)
