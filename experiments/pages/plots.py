"""Panels of lines, cross plots and time histories of recordings, as a picture or as an interactive plot."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from markupsafe import escape
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from steer_env.experiments.pages.pages import image
from steer_env.experiments.pages.style import add_legend_of, as_svg, colours, new_figure
from steer_env.metrics import CHANNELS, UNITS, RefusedError, frequency_response_curve
from steer_env.recording.recording import FILE_UNITS, Recording

Array = NDArray[np.float64]
Curves = Mapping[str, Array]  # channel, or "time" -> (n,) [SI]
POINTS = 3000  # of a line, at most
_WIDTH = 0.007  # of a line, 1.5 point, as a share of the picture's extent [1]
STILL = 240  # of a line of a picture, at most: the width of a panel in points of paper
_DASHES = ("solid", "dash", "dot", "dashdot", "longdash")
_STILL: dict[str, Any] = {
    **{"solid": "-", "dash": (0, (5, 1.5)), "dot": (0, (1.5, 1.2)), "dashdot": "-.", "longdash": (0, (7, 2))}
}
_SHOWN_UNITS = {"rad": "deg", "rad/s": "deg/s", "rad/s2": "deg/s²", "m/s2": "m/s²"}


class Line(NamedTuple):
    """One line of a panel."""

    label: str
    x: Array  # (n,) [reporting unit]
    y: Array  # (n,) [reporting unit]
    colour: str
    dash: str = "solid"


class Panel(NamedTuple):
    """One pair of axes."""

    x: str
    y: str
    lines: list[Line]
    band: tuple[Array, Array] | None = None  # two boundaries (n, 2) [reporting unit]
    logarithmic: bool = False  # x


def script() -> str:
    """The plotting library, which a page holds once."""
    from plotly.offline import get_plotlyjs  # takes long to import

    return get_plotlyjs()


def axis(name: str) -> tuple[str, float]:
    """Title of a channel with the unit that it is shown in, and the size of that unit in SI."""
    if name == "time":
        return "time [s]", 1.0
    unit = CHANNELS[name]
    return f"{name.replace('_', ' ')} [{_SHOWN_UNITS.get(unit, unit)}]", FILE_UNITS[unit][1]


def thin_out(values: Array, points: int) -> Array:
    """At most ``points`` of the rows, evenly spaced, with the first and the last."""
    return values[np.linspace(0, len(values) - 1, min(len(values), points)).round().astype(int)]


def panels(curves: Mapping[str, Curves], pairs: Sequence[tuple[str, str]]) -> list[Panel]:
    """A panel for each pair (x, y) of channels, with a line for every label that has both."""
    found = []
    styles = dict(zip(curves, zip(colours(list(curves)), _DASHES * len(curves))))
    for x, y in pairs:
        (x_title, x_size), (y_title, y_size) = axis(x), axis(y)
        lines = [
            Line(label, thin_out(curve[x], POINTS) / x_size, thin_out(curve[y], POINTS) / y_size, *styles[label])
            for label, curve in curves.items()
            if {x, y} <= curve.keys()
        ]
        if lines:
            found.append(Panel(x_title, y_title, lines))
    return found


def differences(curves: Mapping[str, Curves], base: str, pairs: Sequence[tuple[str, str]]) -> list[Panel]:
    """A panel for each pair (x, y): y of every label less that of the base at the same phase of the cycle."""
    moved = {
        label: {**curve, **{y: curve[y] - curves[base][y] for _, y in pairs}}
        for label, curve in curves.items()
        if all(len(curve[y]) == len(curves[base][y]) for _, y in pairs)
    }
    return [panel._replace(y=panel.y.replace("[", f"less {base}'s [")) for panel in panels(moved, pairs)]


def coincide(line: Array, others: Sequence[Array]) -> list[bool]:
    """Whether the whole of each other line (m, 2) lies within the width of a line (n, 2) on a picture of that."""
    if not np.isfinite(line).all():
        return [False] * len(others)
    extent = np.ptp(line, axis=0)
    scale = np.where(extent > 0.0, extent, 1.0)
    dense = np.linspace(0.0, len(line) - 1.0, 20 * len(line))
    drawn = np.column_stack([np.interp(dense, np.arange(len(x)), x) for x in (line / scale).T])
    near = cKDTree(drawn)
    return [
        bool(np.isfinite(other).all() and near.query(other / scale, distance_upper_bound=_WIDTH)[0].max() < _WIDTH)
        for other in others
    ]


def without_coincident(shown: Sequence[Panel], base: str) -> tuple[list[Panel], list[str]]:
    """Panels without the lines that coincide with the base's, and the labels that are then in none of them."""
    kept = []
    for panel in shown:
        points = {line.label: np.column_stack((line.x, line.y)) for line in panel.lines}
        same = coincide(points[base], list(points.values()))
        lines = [line for line, each in zip(panel.lines, same) if line.label == base or not each]
        kept.append(panel._replace(lines=lines))
    before, after = ({line.label: 0 for panel in of for line in panel.lines} for of in (shown, kept))
    return kept, [label for label in before if label not in after]


def boundaries(pair: Any, labels: tuple[str, str]) -> Panel:
    """A cross plot of two recordings with the band that the tolerances make around the first.

    ``pair`` is a :class:`steer_env.experiments.studies.common.simulation_vs_measurement.Pair`.
    """
    (x_title, x_size), (y_title, y_size) = axis(pair.x), axis(pair.y)
    size = np.array((x_size, y_size))
    shades = colours(list(labels))
    lines = [
        Line(label, thin_out(curve, POINTS)[:, 0] / x_size, thin_out(curve, POINTS)[:, 1] / y_size, colour, dash)
        for label, curve, colour, dash in zip(labels, (pair.reference, pair.other), shades, _DASHES)
    ]
    return Panel(x_title, y_title, lines, (thin_out(pair.left, POINTS) / size, thin_out(pair.right, POINTS) / size))


# Gains of the frequency responses to the handwheel angle, in the units of their metrics.
_GAINS = {"yaw_rate": "1/s", "lateral_acceleration": "g/100 deg", "handwheel_torque": "N m/deg"}


def responses(recordings: Mapping[str, Recording], test: str) -> list[Panel]:
    """Gain, phase and coherence over frequency, with 95 % intervals, for each output that a recording carries."""
    found = []
    for name, unit in _GAINS.items():
        curves = {}
        for label, recording in recordings.items():
            try:
                curves[label] = frequency_response_curve(recording, name, test)
            except RefusedError:
                continue  # the metrics give the reason
        rows = [Panel("frequency [Hz]", y, [], None, True) for y in _response_titles(name, unit)]
        for (label, c), colour in zip(curves.items(), colours(list(curves))):
            size = UNITS[unit]
            phase = np.unwrap(np.angle(c.response))
            drawn = (
                (size * np.abs(c.response), size * c.gain_low, size * c.gain_high),
                tuple(np.degrees(each) for each in (phase, c.phase_low, c.phase_high)),
                (c.coherence,),
            )
            for panel, (middle, *edges) in zip(rows, drawn):
                panel.lines.append(Line(label, c.frequency, middle, colour))
                panel.lines.extend(Line(f"{label}, 95 %", c.frequency, edge, colour, "dot") for edge in edges)
        found += rows if curves else []
    return found


def _response_titles(name: str, unit: str) -> tuple[str, str, str]:
    shown = name.replace("_", " ")
    return f"{shown}, gain [{unit}]", "phase [deg]", "squared coherence [1]"


@as_svg
def draw(shown: Sequence[Panel], name: str, height: float = 2.7, columns: int = 2) -> Figure:
    """Panels as one picture; ``height`` is that of a row [inch], ``name`` that of its file."""
    columns = min(columns, len(shown))
    rows = -(-len(shown) // columns)
    figure = new_figure(4.8 * columns, height * rows + 0.3)
    figure.set_label(name)
    places = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes, panel in zip(places, shown):
        _panel(axes, panel)
    for axes in places[len(shown) :]:
        axes.remove()
    shown_once = {
        label: handle for axes in places[: len(shown)] for handle, label in zip(*axes.get_legend_handles_labels())
    }
    add_legend_of(figure, list(shown_once.values()), list(shown_once), 7)
    return figure


def _panel(axes: Axes, panel: Panel) -> None:
    for line in panel.lines:
        style = {"color": line.colour, "linestyle": _STILL[line.dash], "linewidth": 1.2, "label": line.label}
        axes.plot(thin_out(line.x, STILL), thin_out(line.y, STILL), **style)  # type: ignore[arg-type]
    for edge in panel.band or ():
        axes.plot(*thin_out(edge, STILL).T, color="#9aa5b1", linestyle=":", linewidth=0.9)
    axes.set(xlabel=panel.x, ylabel=panel.y, xscale="log" if panel.logarithmic else "linear")
    if panel.logarithmic:
        axes.xaxis.set_major_formatter("{x:g}")  # powers of ten would be more than plain text


def markup(shown: Sequence[Panel], name: str, full: bool, columns: int = 2) -> str:
    """Panels as HTML: interactive on a ``full`` page, which holds :func:`script`, else as a picture; empty for none."""
    if not shown:
        return ""
    if full:
        return interactive(shown, columns=columns)
    alt = f"{name.replace('-', ' ')}: {'; '.join(f'{panel.y} over {panel.x}' for panel in shown)}"
    return f'<img src="{image(draw(shown, name, columns=columns))}" alt="{escape(alt)}">'


def interactive(shown: Sequence[Panel], height: int = 330, columns: int = 2) -> str:
    """Panels as HTML; a click on a label hides its lines in all of them."""
    from plotly.subplots import make_subplots  # takes long to import

    columns = min(columns, len(shown))
    rows = -(-len(shown) // columns)
    figure = make_subplots(rows=rows, cols=columns, horizontal_spacing=0.09, vertical_spacing=0.22 / rows)
    known: set[str] = set()
    for i, panel in enumerate(shown):
        place = {"row": i // columns + 1, "col": i % columns + 1}
        for k, edge in enumerate(panel.band or ()):
            label, style = "tolerance", {"color": "#9aa5b1", "width": 1, "dash": "dot"}
            figure.add_scatter(
                x=edge[:, 0], y=edge[:, 1], name=label, legendgroup=label, line=style, mode="lines",
                showlegend=k == 0 and label not in known, hoverinfo="skip", **place,
            )  # fmt: skip
            known |= {label} if k else set()
        for line in panel.lines:
            style = {"color": line.colour, "width": 1.6, "dash": line.dash}
            figure.add_scatter(
                x=line.x, y=line.y, name=line.label, legendgroup=line.label, line=style, mode="lines",
                showlegend=line.label not in known, **place,
            )  # fmt: skip
            known.add(line.label)
        figure.update_xaxes(title_text=panel.x, type="log" if panel.logarithmic else "linear", **place)
        figure.update_yaxes(title_text=panel.y, **place)
    font = {"family": "Helvetica Neue, Helvetica, Arial, Liberation Sans, sans-serif", "size": 12, "color": "#1d2530"}
    figure.update_layout(
        template="simple_white", font=font, height=height * rows, margin={"l": 60, "r": 10, "t": 40, "b": 50},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.5, "xanchor": "center"}, hovermode="closest",
    )  # fmt: skip
    figure.update_xaxes(showgrid=True, gridcolor="#e4e4e4", title_standoff=6)
    figure.update_yaxes(showgrid=True, gridcolor="#e4e4e4", title_standoff=6)
    html = figure.to_html(
        full_html=False,
        include_plotlyjs=False,
        config={"displaylogo": False, "responsive": True, "displayModeBar": "hover"},
    )
    return f'<div class="drawn">{html}</div>'  # as the style calls it
