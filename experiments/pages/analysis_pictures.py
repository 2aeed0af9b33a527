"""Pictures of the linearised car as SVG text. What they show is handed over; nothing is computed here."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

from steer_env.experiments.pages.style import DASHES, PALETTE, new_figure, styled, svg

Array = NDArray[np.float64]

_NONE, _LIMIT = "#e8e8e8", "#b00020"


@styled
def margin_map(
    maps: Mapping[str, Array], x: Sequence[str], y: Sequence[str], limit: float, top: float, axis: str, columns: int = 2
) -> str:
    """A map for each label, with its values (Y, X) as numbers; NaN where there is no point, infinite without crossing.

    The colour ends at ``top``. A red frame is around every value below the limit, which the scale shows as a red line.
    """
    rows = -(-len(maps) // columns)
    figure = new_figure(4.8 * columns, rows * (0.42 * len(y) + 0.9) + 0.2)
    places = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    image: Any = None
    for axes, (label, values) in zip(places.flat, maps.items()):
        axes.set_facecolor(_NONE)
        shown = np.ma.masked_invalid(np.minimum(np.where(np.isnan(values), np.nan, values), top))
        image = axes.imshow(shown, cmap="YlGnBu_r", vmin=0.0, vmax=top, aspect="auto", origin="lower")
        for (i, j), value in np.ndenumerate(values):
            dark = not np.isnan(value) and value < 0.5 * top
            text = "–" if np.isnan(value) else "∞" if np.isinf(value) else f"{value:.0f}"
            axes.text(j, i, text, ha="center", va="center", fontsize=8.5, color="white" if dark else "black")
            if value < limit:
                place = (j - 0.46, i - 0.46)
                axes.add_patch(Rectangle(place, 0.92, 0.92, edgecolor=_LIMIT, linewidth=2.0, fill=False, zorder=4))
        axes.set(title=label, xticks=range(len(x)), xticklabels=x, yticks=range(len(y)), yticklabels=y)
        axes.grid(visible=False)
    for axes in places[-1]:
        axes.set_xlabel("speed [km/h]")
    for axes in places[:, 0]:
        axes.set_ylabel("torsion-bar torque [N m]")
    scale = figure.colorbar(image, ax=places, label=axis, shrink=0.8, aspect=30)
    scale.ax.axhline(limit, color=_LIMIT, linewidth=2.0)
    return svg(figure)


@styled
def nyquist(curves: Mapping[str, NDArray[np.complex128]], disk: float, title: str) -> str:
    """Open loops in the plane, and the disk around -1 that they must not enter, through its two real ends."""
    figure = new_figure(9.6, 4.4)
    wide, near = figure.subplots(1, 2)
    for axes, half in ((wide, None), (near, 2.0)):
        for (label, L), colour, dash in zip(curves.items(), PALETTE, DASHES * 2):
            axes.plot(L.real, L.imag, color=colour, linestyle=dash, label=label)
        low, high = (1.0 - 0.5 * disk) / (1.0 + 0.5 * disk), (1.0 + 0.5 * disk) / (1.0 - 0.5 * disk)
        ends = -high, -low
        middle, radius = 0.5 * sum(ends), 0.5 * (ends[1] - ends[0])
        axes.add_patch(Circle((middle, 0.0), radius, facecolor="#b0002022", edgecolor=_LIMIT, linewidth=1.0))
        axes.plot(-1.0, 0.0, "+", color=_LIMIT, markersize=9)
        axes.set(xlabel="real part [1]", ylabel="imaginary part [1]")
        axes.set_aspect("equal", adjustable="datalim" if half is None else "box")
        if half is not None:
            axes.set(xlim=(-half - 0.5, half - 0.5), ylim=(-half, half))
    wide.set_title(title)
    near.set_title("near −1")
    handles, labels = wide.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=6)
    return svg(figure)


@styled
def root_loci(loci: Sequence[tuple[str, str, Array, Sequence[NDArray[np.complex128]], float]]) -> str:
    """Modes [1/s] over a parameter, a panel for each (title, name of the parameter, values, modes, highest [Hz])."""
    figure = new_figure(9.6, 4.2)
    for axes, (title, name, values, modes, highest) in zip(figure.subplots(1, len(loci), squeeze=False)[0], loci):
        image = _locus(axes, values, modes, highest)
        axes.set(title=title, xlabel="real part [1/s]", ylabel="imaginary part [Hz]")
        figure.colorbar(image, ax=axes, label=name, location="bottom", aspect=35)
    return svg(figure)


def _locus(axes: Axes, values: Array, modes: Sequence[NDArray[np.complex128]], highest: float) -> Any:
    """Points coloured by the parameter; the unstable half is shaded."""
    every = np.concatenate(modes)
    colour = np.repeat(values, [each.size for each in modes])
    kept = (every.imag >= -1e-9) & (every.imag / (2.0 * np.pi) <= highest) & (every.real > -2.0 * np.pi * highest)
    image = axes.scatter(every[kept].real, every[kept].imag / (2.0 * np.pi), c=colour[kept], s=9, cmap="viridis")
    axes.axvspan(0.0, max(axes.get_xlim()[1], 0.05 * abs(axes.get_xlim()[0])), color="#b0002018", zorder=0)
    axes.axvline(0.0, color=_LIMIT, linewidth=0.8)
    axes.margins(x=0.0)
    return image
