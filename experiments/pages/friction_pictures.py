"""Pictures of the friction study as SVG text. What they show is handed over."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from steer_env.experiments.pages.style import PALETTE, legend, new_figure, styled, styles, svg

Array = NDArray[np.float64]

LEAST = 1e-5  # share at which smaller ones are drawn [1]


@styled
def strips(shares: Mapping[str, Mapping[str, Sequence[float]]], large: float) -> str:
    """What each case changes: a row for each case, a mark for each metric at its share [1], on a logarithmic axis.

    Parameters
    ----------
    shares : factor -> case -> shares of the metrics [1]
    large : float
        Share below which a difference counts as small; shaded [1].
    """
    rows = [(factor, case, of[case]) for factor, of in shares.items() for case in of]
    figure = new_figure(9.6, 0.6 + 0.2 * len(rows))
    axes = figure.subplots()
    colours = dict(zip(shares, PALETTE * len(shares)))
    for place, (factor, _, values) in enumerate(rows):
        x = np.maximum(np.abs(np.array(values, float)), LEAST)
        axes.plot(100.0 * x, np.full(x.size, place), "|", color=colours[factor], markersize=8, alpha=0.6)
        if x.size:
            axes.plot(100.0 * x.max(), place, "o", color=colours[factor], markersize=4)
    axes.axvspan(100.0 * LEAST, 100.0 * large, color="#f0f0f0", zorder=0)
    axes.set(xscale="log", xlabel="difference from the base [% of the metric]", ylim=(len(rows) - 0.4, -0.6))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_yticks(range(len(rows)), [f"{factor}: {case}" for factor, case, _ in rows], fontsize=8)
    axes.grid(visible=False, axis="y")
    return svg(figure)


@styled
def record_loops(measured: tuple[Array, Array], laws: Mapping[str, tuple[Array, Array]]) -> str:
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
    return svg(figure)
