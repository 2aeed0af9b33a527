"""The picture of a policy and the baselines under conditions that the training did not draw."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from steer_env.experiments.pages.style import DASHES, PALETTE, legend, new_figure, styled, svg

COLUMNS = 3


class Point(NamedTuple):
    """A mean and its 95 % interval under one condition [unit of the value]."""

    label: str
    x: float | None
    value: float
    low: float
    high: float


@styled
def shifts(panels: Mapping[str, Mapping[str, Sequence[Point]]], home: Mapping[str, float]) -> str:
    """The reward over each condition, a panel for each, with a dotted line at the policy's reward as trained.

    Parameters
    ----------
    panels : condition -> controller -> points
        The first controller is the policy. Points without a number stand side by side.
    home : controller -> reward as trained
    """
    rows = -(-len(panels) // COLUMNS)
    figure = new_figure(9.6, 0.6 + 2.6 * rows)
    grid = figure.subplots(rows, min(COLUMNS, len(panels)), squeeze=False).ravel()
    for axes, (over, controllers) in zip(grid, panels.items()):
        for k, (name, points) in enumerate(controllers.items()):
            named = any(point.x is None for point in points)
            x = [float(i) if named else point.x for i, point in enumerate(points)]
            value = np.array([point.value for point in points])
            ends = np.array(
                [[point.value - point.low for point in points], [point.high - point.value for point in points]]
            )
            axes.errorbar(
                x,
                value,
                None if np.isnan(ends).any() else ends,
                color=PALETTE[k % len(PALETTE)],
                linestyle="none" if named else DASHES[k % len(DASHES)],
                marker="o" if k == 0 else ".",
                label=name.replace("_", " "),
                zorder=3.0 - 0.1 * k,
            )
            if named:
                axes.set_xticks(x, [point.label.replace(", ", ",\n") for point in points], rotation=45, ha="right")
        axes.axhline(next(iter(home.values())), color="#888888", linestyle=":", linewidth=1.0)
        unit = next(iter(controllers.values()))[0].label.partition(" ")[2] if not named else ""
        axes.set_xlabel(f"[{unit}]" if unit else "")
        axes.set_title(over)
    for axes in grid[:: min(COLUMNS, len(panels))]:
        axes.set_ylabel("reward")
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    legend(figure, grid[0])
    return svg(figure)
