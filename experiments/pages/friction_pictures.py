"""Pictures of the friction study as SVG text. What they show is handed over."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from steer_env.experiments.pages.pictures import dots
from steer_env.experiments.pages.plots import thin_out
from steer_env.experiments.pages.style import PALETTE, as_svg, legend, new_figure, styles

Array = NDArray[np.float64]

LEAST_DRAWN_SHARE = 1e-5  # share at which smaller ones are drawn [1]


@as_svg
def strips(
    shares: Mapping[str, Mapping[str, Sequence[float]]],
    large: float,
    label: str = "difference from the base [% of the metric]",
    width: float = 9.6,
) -> Figure:
    """What each case changes: a row for each case, a mark for each metric at its share [1], on a logarithmic axis.

    Parameters
    ----------
    shares : factor -> case -> shares of the metrics [1]
    large : float
        Share below which a difference counts as small; shaded [1].
    label : str
        Of the axis.
    width : float
        Of the picture [inch].
    """
    rows = [(factor, case, of[case]) for factor, of in shares.items() for case in of]
    figure = new_figure(width, 0.6 + 0.2 * len(rows))
    axes = figure.subplots()
    colours = dict(zip(shares, PALETTE * len(shares)))
    for place, (factor, _, values) in enumerate(rows):
        x = np.maximum(np.abs(np.array(values, float)), LEAST_DRAWN_SHARE)
        axes.plot(100.0 * x, np.full(x.size, place), "|", color=colours[factor], markersize=8, alpha=0.6)
        if x.size:
            axes.plot(100.0 * x.max(), place, "o", color=colours[factor], markersize=4)
    axes.axvspan(100.0 * LEAST_DRAWN_SHARE, 100.0 * large, color="#f0f0f0", zorder=0)
    axes.set(xscale="log", xlabel=label, ylim=(len(rows) - 0.4, -0.6))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_yticks(range(len(rows)), [f"{factor}: {case}" for factor, case, _ in rows], fontsize=8)
    axes.grid(visible=False, axis="y")
    return figure


@as_svg
def record_loops(measured: tuple[Array, Array], laws: Mapping[str, tuple[Array, Array]]) -> Figure:
    """Friction over displacement, measured and by each law, and what each law leaves of it.

    Parameters
    ----------
    measured : displacement (T,), friction (T,)
    laws : law -> displacement (T,), friction (T,)
    """
    figure = new_figure(9.6, 3.4)
    loop, left = figure.subplots(1, 2)
    loop.plot(*measured, color="#777777", linewidth=3.0, label="measured")
    for law, style in styles(laws).items():
        loop.plot(*laws[law], **{**style, "linewidth": 1.1})
        left.plot(laws[law][0], laws[law][1] - measured[1], **{**style, "linewidth": 1.0})
    loop.set(title="one period", xlabel="displacement [deg]", ylabel="friction [N m]")
    left.set(title="law less measurement", xlabel="displacement [deg]", ylabel="friction [N m]")
    legend(figure, loop, 6)
    return figure


POINTS = 1500  # of a line over the whole record, at most
LOOP = 300  # of a loop in a small panel, at most
_LOOP = "#b9c1cb"
_MEASURED = "#5b6675"


class ShownRecord(NamedTuple):
    """A record in the units in which it is shown."""

    t: Array  # (T,) [s]
    x: Array  # (T,) [units]
    friction: Array  # (T,) [units]
    x_unit: str
    friction_unit: str
    loop: slice  # samples whose loop is drawn
    known: int  # first sample at which the memory of a law no longer depends on what was before the record
    held_out: int  # first sample that judges; T if none does


@as_svg
def fitted_loops(
    shown: ShownRecord, curves: Mapping[str, Array], titles: Mapping[str, str], columns: int = 6
) -> Figure:
    """The last loop, measured in grey with a law over it, a panel for each law.

    Parameters
    ----------
    shown : Shown
    curves : law -> (T,) its friction [units]
    titles : law -> title of its panel
    columns : int
        Panels side by side, at most.
    """
    few, narrow, rows = len(curves) <= 2, columns == 2, -(-len(curves) // columns)
    columns = -(-len(curves) // rows)
    size = (2.3, 1.85) if narrow else (3.3, 2.5) if few else (9.6 / columns, 1.45 if columns > 3 else 2.4)
    figure = new_figure(size[0] * columns, size[1] * rows + 0.4)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    part = shown.loop
    places, x = list(grid.flat), thin_out(shown.x[part], LOOP)
    look = styles(curves)
    for axes, law in zip(places, curves):
        style = look[law]
        axes.plot(x, thin_out(shown.friction[part], LOOP), color=_LOOP, linewidth=3.2, label="measured")
        axes.plot(x, thin_out(curves[law][part], LOOP), **{**style, "linewidth": 1.2, "linestyle": "-"})
        axes.set_title(titles[law], color=style["color"], fontsize=8.5 if columns < 6 else 7.5)
    for place, axes in enumerate(places[len(curves) :], len(curves)):
        axes.set_axis_off()
        places[place - columns].xaxis.set_tick_params(labelbottom=True)  # the lowest of its column
    low, high = places[0].get_ylim()
    places[0].set_ylim(low, high + 0.18 * (high - low))
    places[0].text(0.03, 0.98, "measured", transform=places[0].transAxes, va="top", fontsize=8, color=_MEASURED)
    figure.supxlabel(f"displacement [{shown.x_unit}]", fontsize=8.5)
    figure.supylabel(f"friction [{shown.friction_unit}]", fontsize=8.5)
    return figure


def residuals(rows: Mapping[str, tuple[float, float, float]], repeats: float | None) -> str:
    """What each law leaves of the friction: value and ends of the interval [%], and how far the record repeats [%]."""
    line = (repeats, "the record repeats so far") if repeats else None
    return dots(rows, "RMS of what is left on the judging part, of the mean [%]", line, True, "residuals")


@as_svg
def law(title: str, shown: ShownRecord, fitted: Array, level: float, colour: str) -> Figure:
    """One law: the loop, measured and fitted, and what is left over time [% of the mean friction, ``level``]."""
    figure = new_figure(9.6, 2.9)
    figure.set_label(f"law {title}")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.55))
    part = shown.loop
    for values, shade, label, dash in ((shown.friction, _MEASURED, "measured", "-"), (fitted, colour, title, "--")):
        left.plot(
            thin_out(shown.x[part], POINTS),
            thin_out(values[part], POINTS),
            dash,
            color=shade,
            label=label,
            linewidth=1.3,
        )
    left.set(xlabel=f"displacement [{shown.x_unit}]", ylabel=f"friction [{shown.friction_unit}]")
    left.legend(loc="best", fontsize=8)
    rest = 100.0 * (fitted - shown.friction)[shown.known :] / level
    right.plot(thin_out(shown.t[shown.known :], POINTS), thin_out(rest, POINTS), color=colour, linewidth=0.9)
    right.set_xlim(shown.t[0], shown.t[-1])
    if shown.held_out < shown.t.size:
        right.axvspan(shown.t[shown.held_out], shown.t[-1], color="#eef2f7", zorder=0)
        right.annotate(
            "judges", (shown.t[shown.held_out], 1.0), xycoords=("data", "axes fraction"), xytext=(4, -2),
            textcoords="offset points", va="top", fontsize=8, color=_MEASURED,
        )  # fmt: skip
    right.set(xlabel="time [s]", ylabel="law less measured [%]")
    return figure
