"""The picture of durations: the share that is longer than each length."""

from collections.abc import Mapping

import numpy as np
from matplotlib.ticker import FormatStrFormatter

from steer_env.experiments.pages.style import DASHES, PALETTE, legend, new_figure, styled, svg
from steer_env.live.real_time.measure import Durations


@styled
def exceeded(panels: Mapping[str, Mapping[str, Durations]]) -> str:
    """Share of durations that exceed a length, over that length, both logarithmic; a panel for each title.

    Parameters
    ----------
    panels : title -> label -> durations
    """
    figure = new_figure(9.6, 3.4)
    grid = figure.subplots(1, len(panels), squeeze=False, sharey=True).ravel()
    for axes, (title, lines) in zip(grid, panels.items()):
        for k, (label, durations) in enumerate(lines.items()):
            filled = np.flatnonzero(durations.histogram)
            longer = durations.histogram.sum() - np.cumsum(durations.histogram)[filled]
            axes.step(
                1e6 * durations.width * (filled + 1),
                np.where(longer > 0, longer, np.nan) / durations.histogram.sum(),
                where="post",
                color=PALETTE[k % len(PALETTE)],
                linestyle=DASHES[k % len(DASHES)],
                label=label,
            )
        axes.set(xscale="log", yscale="log", xlabel="[µs]", title=title)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FormatStrFormatter("%g"))  # powers would be set by matplotlib itself
    grid[0].set_ylabel("share that is longer")
    legend(figure, grid[0])
    return svg(figure)
