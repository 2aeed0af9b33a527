"""Pictures of the page of a car as SVG text. What they show is handed over; nothing is simulated or evaluated here."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

from steer_env.experiments.pages.style import DASHES, PALETTE, as_svg, legend, new_figure
from steer_env.recording.recording import DEGREE

Array = NDArray[np.float64]
Range = tuple[float, float]

_BAND, _LINE = "#e3f2ea", "#999999"
_MISSING_COLOUR, _LIMIT_COLOUR = "#e8e8e8", "#b00020"
_SPUN = 60.0  # yaw rate from which on the crosses of spins are drawn, above one another [deg/s]
_FORCE, _TORQUE = 3.0, 100.0  # up to which compliance steer is drawn [kN], [N m]


def _lines(axes: Axes, x: Array, of_label: Mapping[str, Array], **style: Any) -> None:
    for (label, y), colour, dash in zip(of_label.items(), PALETTE, DASHES):
        axes.plot(x, y, **{"color": colour, "linestyle": dash, "label": label, **style})


@as_svg
def budget(terms: Mapping[str, float], simulated: Mapping[str, float], limits: Range) -> Figure:
    """Understeer by term as a waterfall, its sum, and the simulated gradients [deg/g]; the range is shaded."""
    figure = new_figure(9.6, 0.9 + 0.28 * (len(terms) + 1 + len(simulated)))
    axes = figure.subplots()
    start, labels = 0.0, list[str]()
    for term, value in terms.items():
        axes.barh(len(labels), value, left=start, height=0.62, color=PALETTE[0] if value >= 0.0 else PALETTE[1])
        axes.annotate(
            f"{value:+.2f}".replace("-", "−"), (max(start, start + value), len(labels)), xytext=(4, 0),
            textcoords="offset points", va="center", fontsize=8,
        )  # fmt: skip
        start += value
        labels.append(term)
    for label, value in {"sum": start, **simulated}.items():
        axes.barh(len(labels), value, height=0.62, color="#555555" if label == "sum" else "#aaaaaa")
        axes.annotate(
            f"{value:.2f}".replace("-", "−"), (max(value, 0.0), len(labels)), xytext=(4, 0),
            textcoords="offset points", va="center", fontsize=8,
        )  # fmt: skip
        labels.append(label)
    axes.axvspan(*limits, color=_BAND, zorder=0)
    axes.axvline(0.0, color=_LINE, linewidth=0.8)
    axes.set(xlabel="understeer [deg/g]", yticks=range(len(labels)), yticklabels=labels)
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set_axisbelow(True)
    axes.margins(x=0.08)
    return figure


@as_svg
def lag(speeds: Array, lags: Mapping[str, Mapping[str, Array]], marked: float, limits: Range) -> Figure:
    """Yaw lag [ms] over speed [km/h], a panel for each chassis; the range at the marked speed is a bar."""
    figure = new_figure(9.6, 3.4)
    panels = figure.subplots(1, len(lags), sharey=True)
    for axes, (title, of_label) in zip(panels, lags.items()):
        _lines(axes, speeds, of_label)
        style = {"linewidth": 7.0, "alpha": 0.25, "solid_capstyle": "butt", "label": "usual range"}
        axes.plot([marked, marked], limits, color=PALETTE[2], **style)
        axes.axhline(0.0, color=_LINE, linewidth=0.8)
        axes.set(title=title, xlabel="speed [km/h]")
    panels[0].set_ylabel("yaw lag at 0.2 Hz [ms]")
    legend(figure, panels[0])
    return figure


@as_svg
def hands_off(speeds: Array, damping: Mapping[str, Array], amplitudes: Mapping[str, Array], allowed: float) -> Figure:
    """Damping ratio without friction, and yaw rate [deg/s] long after a pulse, over speed [km/h].

    An infinite amplitude is a spin, drawn as a cross; ``allowed`` is the amplitude that may remain.
    """
    figure = new_figure(9.6, 3.4)
    left, right = figure.subplots(1, 2)
    _lines(left, speeds, damping)
    left.axhline(0.0, color=_LINE, linewidth=0.8)
    left.set(title="least damped mode, without friction", xlabel="speed [km/h]", ylabel="damping ratio [1]")
    left.legend(fontsize=8)
    for k, ((label, values), colour, dash, marker) in enumerate(zip(amplitudes.items(), PALETTE, DASHES, "osD^")):
        style = {"color": colour, "linestyle": dash, "label": label, "marker": marker, "markersize": 3.5}
        right.semilogy(speeds, np.where(np.isfinite(values), np.maximum(values, 1e-4), np.nan), **style)
        right.plot(
            speeds[np.isinf(values)], [_SPUN * 2.0**k] * int(np.isinf(values).sum()), "x", color=colour, markersize=6
        )
    right.axhline(allowed, color=_LINE, linewidth=0.8)
    right.annotate("may remain", (0.01, allowed), xycoords=("axes fraction", "data"), fontsize=8, va="bottom")
    right.set(
        title="8 to 10 s after a pulse of 3 N m", xlabel="speed [km/h]", ylabel="amplitude of the yaw rate [deg/s]"
    )
    right.set(ylim=(5e-5, 2e3), xlim=left.get_xlim())
    right.set_yticks(10.0 ** np.arange(-4, 3))
    legend(figure, right)
    return figure


@as_svg
def kinematics(c: Any) -> Figure:
    """Toe-in, camber and roll-centre height over the travel of the wheels; ``c`` as in report.car_suspension.Curves."""
    figure = new_figure(9.6, 3.0)
    panels = figure.subplots(1, 3)
    for axes, curves, unit, title in zip(
        panels,
        (c.toe, c.camber, c.roll_centre),
        (DEGREE, DEGREE, 1e-3),
        ("toe-in [deg]", "camber [deg]", "height [mm]"),
    ):
        _lines(axes, 1e3 * c.travel, {axle: y / unit for axle, y in curves.items()})
        axes.set(xlabel="travel, bump positive [mm]", ylabel=title)
    for axes, title in zip(panels, ("toe", "camber", "roll centre")):
        axes.set_title(title)
    legend(figure, panels[0])
    return figure


@as_svg
def steering(c: Any) -> Figure:
    """Angles of both front wheels over the rack with Ackermann, and the steering ratio over the handwheel angle."""
    figure = new_figure(9.6, 3.2)
    angles, ratio = figure.subplots(1, 2)
    wheels = {"left wheel": c.left, "right wheel": c.right, "right wheel by Ackermann": c.ideal_right}
    _lines(angles, 1e3 * c.rack, {label: y / DEGREE for label, y in wheels.items()})
    angles.set(title="wheel angles", xlabel="rack travel [mm]", ylabel="steer angle [deg]")
    angles.legend(fontsize=8)
    ratio.plot(c.handwheel / DEGREE, c.ratio, color=PALETTE[0])
    ratio.set(title="ratio", xlabel="handwheel angle [deg]", ylabel="steering ratio, local [1]")
    return figure


@as_svg
def compliance(lateral: Mapping[str, float], aligning: Mapping[str, float], roll: Mapping[str, float]) -> Figure:
    """Understeer by lateral force [deg/kN], by aligning torque [deg/(N m)] and by roll [1], a line for each axle."""
    figure = new_figure(9.6, 2.9)
    panels = figure.subplots(1, 3, sharey=True)
    for axes, slopes, end, label in zip(
        panels, (lateral, aligning, roll), (_FORCE, _TORQUE, 5.0),
        ("lateral force of each wheel [kN]", "aligning torque of each wheel [N m]", "roll angle [deg]"),
    ):  # fmt: skip
        x = np.array([0.0, end])
        _lines(axes, x, {axle: slope * x for axle, slope in slopes.items()})
        axes.set_xlabel(label)
    panels[0].set_ylabel("steer angle, understeer positive [deg]")
    legend(figure, panels[0])
    return figure


@as_svg
def assist(torques: Array, boost: Mapping[str, Array], speeds: Array, damping: Array) -> Figure:
    """Boost over the torsion-bar torque, a line for each speed, and the motor damping over speed [km/h]."""
    figure = new_figure(9.6, 3.2)
    left, right = figure.subplots(1, 2, width_ratios=(1.6, 1.0))
    shades: Sequence[Any] = [str(x) for x in np.linspace(0.0, 0.7, len(boost))]
    for (label, y), shade in zip(boost.items(), shades):
        left.plot(torques, y, color=shade, label=label)
    left.set(title="boost", xlabel="torsion-bar torque [N m]", ylabel="torque at the column [N m]")
    left.legend(fontsize=8)
    right.plot(speeds, damping, "o-", color=PALETTE[0], markersize=3.5)
    right.set(title="motor damping", xlabel="speed [km/h]", ylabel="at the column [N m s/rad]", ylim=(0.0, None))
    return figure


_MARKS = {
    **{"inside": ("o", "#1d2530"), "outside": ("D", _LIMIT_COLOUR)},
    **{"green": ("o", "#009e73"), "amber": ("^", "#e69f00"), "red": ("s", "#c0392b")},
}


@as_svg
def in_ranges(groups: Mapping[str, Sequence[float]], ratings: Mapping[str, Sequence[str]] | None = None) -> Figure:
    """Quantities by group over their ranges: each as its share of the way from the lower to the upper end.

    One that is far outside stands at the edge of the picture. ``ratings`` are the colours of the target bands by group,
    whose signs are those of the tables; without them a quantity is inside or outside.
    """
    figure = new_figure(5.0, 0.36 * len(groups) + 0.9)
    axes = figure.subplots()
    axes.axvspan(0.0, 1.0, color=_BAND, zorder=0)
    for row, (name, places) in enumerate(groups.items()):
        inside = ["inside" if 0.0 <= x <= 1.0 else "outside" for x in places]
        for x, kind in zip(places, ratings[name] if ratings else inside):
            mark, color = _MARKS[kind]
            axes.plot(min(max(x, -0.45), 1.45), -row, mark, color=color, markersize=5, alpha=0.7)
    axes.set(xlim=(-0.5, 1.5), xticks=(0.0, 1.0), xticklabels=("lower end", "upper end"))
    axes.set(yticks=[-row for row in range(len(groups))], yticklabels=list(groups), ylim=(0.5 - len(groups), 0.5))
    axes.grid(visible=False)
    return figure


@as_svg
def least_margins(found: Mapping[str, tuple[Array, Array, Array]], limits: tuple[float, float]) -> Figure:
    """Smallest phase [deg] and gain margin [dB] over speed [km/h], a line for each label, with their limits."""
    figure = new_figure(5.0, 4.6)
    panels = figure.subplots(2, 1, sharex=True)
    for (label, (speed, *values)), colour, marker in zip(found.items(), PALETTE, "osD"):
        for axes, y in zip(panels, values):
            axes.plot(speed, y, marker=marker, markersize=4, color=colour, label=label)
    for axes, limit, name in zip(panels, limits, ("phase margin [deg]", "gain margin [dB]")):
        axes.axhline(limit, color=_LIMIT_COLOUR, linewidth=1.5)
        axes.set(ylabel=name, ylim=(0.0, None))
    panels[1].set_xlabel("speed [km/h]")
    legend(figure, panels[0])
    return figure


@as_svg
def margin_map(
    maps: Mapping[str, Array], x: Sequence[str], y: Sequence[str], limit: float, top: float, axis: str, columns: int = 2
) -> Figure:
    """A map for each label, with its values (Y, X) as numbers; NaN where there is no point, infinite without crossing.

    The colour ends at ``top``. A red frame is around every value below the limit, which the scale shows as a red line.
    """
    rows = -(-len(maps) // columns)
    figure = new_figure(4.8 * columns, rows * (0.42 * len(y) + 0.9) + 0.2)
    places = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    image: Any = None
    for axes, (label, values) in zip(places.flat, maps.items()):
        axes.set_facecolor(_MISSING_COLOUR)
        shown = np.ma.masked_invalid(np.minimum(np.where(np.isnan(values), np.nan, values), top))
        image = axes.imshow(shown, cmap="YlGnBu_r", vmin=0.0, vmax=top, aspect="auto", origin="lower")
        for (i, j), value in np.ndenumerate(values):
            dark = not np.isnan(value) and value < 0.5 * top
            text = "–" if np.isnan(value) else "∞" if np.isinf(value) else f"{value:.0f}"
            axes.text(j, i, text, ha="center", va="center", fontsize=8.5, color="white" if dark else "black")
            if value < limit:
                place = (j - 0.46, i - 0.46)
                axes.add_patch(
                    Rectangle(place, 0.92, 0.92, edgecolor=_LIMIT_COLOUR, linewidth=2.0, fill=False, zorder=4)
                )
        axes.set(title=label, xticks=range(len(x)), xticklabels=x, yticks=range(len(y)), yticklabels=y)
        axes.grid(visible=False)
    for axes in places[-1]:
        axes.set_xlabel("speed [km/h]")
    for axes in places[:, 0]:
        axes.set_ylabel("torsion-bar torque [N m]")
    scale = figure.colorbar(image, ax=places, label=axis, shrink=0.8, aspect=30)
    scale.ax.axhline(limit, color=_LIMIT_COLOUR, linewidth=2.0)
    return figure


@as_svg
def nyquist(curves: Mapping[str, NDArray[np.complex128]], disk: float, title: str) -> Figure:
    """Open loops in the plane, and the disk around -1 that they must not enter, through its two real ends."""
    figure = new_figure(9.6, 4.4)
    wide, near = figure.subplots(1, 2)
    for axes, half in ((wide, None), (near, 2.0)):
        for (label, L), colour, dash in zip(curves.items(), PALETTE, DASHES * 2):
            axes.plot(L.real, L.imag, color=colour, linestyle=dash, label=label)
        low, high = (1.0 - 0.5 * disk) / (1.0 + 0.5 * disk), (1.0 + 0.5 * disk) / (1.0 - 0.5 * disk)
        ends = -high, -low
        middle, radius = 0.5 * sum(ends), 0.5 * (ends[1] - ends[0])
        axes.add_patch(Circle((middle, 0.0), radius, facecolor="#b0002022", edgecolor=_LIMIT_COLOUR, linewidth=1.0))
        axes.plot(-1.0, 0.0, "+", color=_LIMIT_COLOUR, markersize=9)
        axes.set(xlabel="real part [1]", ylabel="imaginary part [1]")
        axes.set_aspect("equal", adjustable="datalim" if half is None else "box")
        if half is not None:
            axes.set(xlim=(-half - 0.5, half - 0.5), ylim=(-half, half))
    wide.set_title(title)
    near.set_title("near −1")
    handles, labels = wide.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=6)
    return figure


@as_svg
def root_loci(loci: Sequence[tuple[str, str, Array, Sequence[NDArray[np.complex128]], float]]) -> Figure:
    """Modes [1/s] over a parameter, a panel for each (title, name of the parameter, values, modes, highest [Hz])."""
    figure = new_figure(9.6, 4.2)
    for axes, (title, name, values, modes, highest) in zip(figure.subplots(1, len(loci), squeeze=False)[0], loci):
        image = _locus(axes, values, modes, highest)
        axes.set(title=title, xlabel="real part [1/s]", ylabel="imaginary part [Hz]")
        figure.colorbar(image, ax=axes, label=name, location="bottom", aspect=35)
    return figure


def _locus(axes: Axes, values: Array, modes: Sequence[NDArray[np.complex128]], highest: float) -> Any:
    """Points coloured by the parameter; the unstable half is shaded."""
    every = np.concatenate(modes)
    colour = np.repeat(values, [each.size for each in modes])
    kept = (every.imag >= -1e-9) & (every.imag / (2.0 * np.pi) <= highest) & (every.real > -2.0 * np.pi * highest)
    image = axes.scatter(every[kept].real, every[kept].imag / (2.0 * np.pi), c=colour[kept], s=9, cmap="viridis")
    axes.axvspan(0.0, max(axes.get_xlim()[1], 0.05 * abs(axes.get_xlim()[0])), color="#b0002018", zorder=0)
    axes.axvline(0.0, color=_LIMIT_COLOUR, linewidth=0.8)
    axes.margins(x=0.0)
    return image
