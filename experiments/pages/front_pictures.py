"""The three pictures on the first screen of the report, as SVG text. Nothing is simulated or evaluated here."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from steer_env.experiments.pages.style import legend, new_figure, styled, styles, svg
from steer_env.metrics.common.filtered_channels import ANGLE, TORQUE
from steer_env.recording.recording import DEGREE

Array = NDArray[np.float64]

_SIZE = (4.0, 3.4)  # [inch]
_WIDE = 5.0  # line of the law that the others are compared with [point]
_LINE = 0.007  # width of a usual line, 1.5 point, as a share of the picture's extent [1]
_NOT_NOTICED = "#e3f2ea"
_WIDEST = 4.0  # half the width of the axis of the differences at most, in thresholds; what is beyond is at its edge


class Share(NamedTuple):
    """A difference as a share of the value that it is compared with."""

    title: str
    law: str
    value: float  # [1]
    half_width: float  # of its 95 % interval; NaN where there is none [1]


@styled
def weave(curves: Mapping[str, Mapping[str, Array]]) -> str:
    """Hand torque over handwheel angle in a test that repeats itself, a line for each law (SI).

    The first law's line is wide and light and lies below the others, so that they are seen where they coincide.
    """
    figure = new_figure(*_SIZE)
    axes = figure.subplots()
    look, first = styles(curves), next(iter(curves))
    look[first] |= {"linewidth": _WIDE, "alpha": 0.35, "zorder": 1.0}
    for law, style in look.items():
        axes.plot(curves[law][ANGLE] / DEGREE, curves[law][TORQUE], **style)
    axes.set(xlabel="handwheel angle [deg]", ylabel="hand torque [N m]")
    legend(figure, axes, 3)
    return svg(figure)


def coincident(curves: Mapping[str, Mapping[str, Array]]) -> list[str]:
    """The laws whose whole line in :func:`weave` lies within the width of a line from that of the first law."""
    lines = {law: np.column_stack((of[ANGLE], of[TORQUE])) for law, of in curves.items()}
    first, *others = lines
    scale = np.ptp(lines[first], axis=0)
    dense = np.linspace(0.0, len(lines[first]) - 1.0, 20 * len(lines[first]))
    drawn = np.column_stack([np.interp(dense, np.arange(len(x)), x) for x in (lines[first] / scale).T])
    places = cKDTree(drawn)
    return [law for law in others if places.query(lines[law] / scale)[0].max() < _LINE]


@styled
def loops(x: Array, torques: Mapping[str, Array]) -> str:
    """Friction torque (T,) [N m] over displacement (T,) [rad], a line for each law."""
    figure = new_figure(*_SIZE)
    axes = figure.subplots()
    for law, style in styles(torques).items():
        axes.plot(x / DEGREE, torques[law], **{**style, "linewidth": 1.0})
    axes.set(xlabel="displacement [deg]", ylabel="friction torque [N m]")
    legend(figure, axes, 3)
    return svg(figure)


@styled
def noticed(found: Sequence[Share], threshold: float) -> str:
    """Differences with their 95 % intervals beside the just-noticeable difference, which is shaded [1]."""
    figure = new_figure(*_SIZE)
    axes = figure.subplots()
    titles = list(dict.fromkeys(share.title for share in found))
    style = styles(share.law for share in found)
    edge = min(max([1.6, *(1.1 * abs(share.value) / threshold for share in found)]), _WIDEST) * 100.0 * threshold
    step = 0.6 / max(len(style), 1)
    for k, (law, look) in enumerate(style.items()):
        mine = [share for share in found if share.law == law]
        places = [titles.index(share.title) + step * (k - 0.5 * (len(style) - 1)) for share in mine]
        values = np.clip([100.0 * share.value for share in mine], -edge, edge)
        widths = np.nan_to_num([100.0 * share.half_width for share in mine])
        axes.errorbar(values, places, xerr=widths, fmt="o", color=look["color"], markersize=4, capsize=2, label=law)
    axes.axvspan(-100.0 * threshold, 100.0 * threshold, color=_NOT_NOTICED, zorder=0)
    axes.axvline(0.0, color="#999999", linewidth=0.8)
    axes.set(xlabel="difference [%]", xlim=(-edge, edge), yticks=range(len(titles)), ylim=(len(titles) - 0.4, -0.6))
    axes.set_yticklabels(titles, fontsize=6.5, linespacing=0.95, multialignment="right")  # two lines each
    axes.grid(visible=False, axis="y")
    legend(figure, axes, 3)
    return svg(figure)
