"""The panels of :mod:`plots` as pictures that do not move, for pages that have to be small and for print."""

from collections.abc import Sequence

from matplotlib.axes import Axes

from steer_env.experiments.pages.plots import Panel, thinned
from steer_env.experiments.pages.style import new_figure, styled, svg

POINTS = 240  # of a line, at most: the width of a panel in points of paper
_DASHES = {"solid": "-", "dash": (0, (5, 1.5)), "dot": (0, (1.5, 1.2)), "dashdot": "-.", "longdash": (0, (7, 2))}


@styled
def draw(shown: Sequence[Panel], height: float = 2.7, columns: int = 2) -> str:
    """Panels as one SVG picture; ``height`` is that of a row [inch]."""
    columns = min(columns, len(shown))
    rows = -(-len(shown) // columns)
    figure = new_figure(4.8 * columns, height * rows + 0.3)
    places = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes, panel in zip(places, shown):
        _panel(axes, panel)
    for axes in places[len(shown) :]:
        axes.remove()
    shown_once = {
        label: handle for axes in places[: len(shown)] for handle, label in zip(*axes.get_legend_handles_labels())
    }
    figure.legend(shown_once.values(), shown_once.keys(), loc="outside upper center", ncols=min(len(shown_once), 7))
    return svg(figure)


def _panel(axes: Axes, panel: Panel) -> None:
    for line in panel.lines:
        style = {"color": line.colour, "linestyle": _DASHES[line.dash], "linewidth": 1.2, "label": line.label}
        axes.plot(thinned(line.x, POINTS), thinned(line.y, POINTS), **style)  # type: ignore[arg-type]
    for edge in panel.band or ():
        axes.plot(*thinned(edge, POINTS).T, color="#9aa5b1", linestyle=":", linewidth=0.9)
    axes.set(xlabel=panel.x, ylabel=panel.y, xscale="log" if panel.logarithmic else "linear")
    if panel.logarithmic:
        axes.xaxis.set_major_formatter("{x:g}")  # powers of ten would be more than plain text
