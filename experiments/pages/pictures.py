"""Pictures of the report as SVG text. What they show is handed over; nothing is simulated or evaluated here."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple, Protocol

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import NDArray

from steer_env.experiments.pages.plots import coincide
from steer_env.experiments.pages.style import DASHES, PALETTE, as_svg, legend, new_figure, styles
from steer_env.experiments.pages.words import law_name
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE
from steer_env.recording.recording import DEGREE
from steer_env.vehicle.constants import GRAVITY

Array = NDArray[np.float64]

SECOND_CYCLE = (1000, 1500)  # samples of the growing sine around a reversal before saturation
LAWS_IN_A_ROW = 5  # of panels that are wide enough to read
CROSSES = (300.0, 5000.0)  # heights of the crosses for runs that are not bounded [%]


class History(Protocol):
    """A displacement over time."""

    @property
    def x(self) -> Array:
        """Displacement (T,) [rad]."""

    @property
    def dt(self) -> float:
        """Time between the samples [s]."""


@as_svg
def characteristics(histories: Mapping[str, History], torques: Mapping[str, Mapping[str, Array]]) -> Figure:
    """Torque over displacement for every law: a growing sine above, nested loops below; ``LAWS_IN_A_ROW`` side by side.

    Parameters
    ----------
    histories : name -> history with ``x`` [rad] and ``dt`` [s]
        ``growing_sine`` and ``nested_loops``.
    torques : law -> name of the history -> (T,) torque [N m]
    """
    style = styles(torques)
    laws, columns = list(torques), min(len(torques), LAWS_IN_A_ROW)
    blocks = [laws[i : i + columns] for i in range(0, len(laws), columns)]
    figure = new_figure(9.6, 4.6 * len(blocks))
    grid = figure.subplots(2 * len(blocks), columns, sharex="row", sharey="row", squeeze=False)
    for row, (block, name) in zip(grid, product(blocks, ("growing_sine", "nested_loops"))):
        x = histories[name].x / DEGREE
        for axes, law in zip(row, block):
            axes.plot(x, torques[law][name], color=style[law]["color"], linewidth=1.0)
            axes.set_title(law if name == "growing_sine" else "")
            axes.set_xlabel("displacement [deg]")
        for axes in row[len(block) :]:
            axes.set_axis_off()
        row[0].set_ylabel("torque [N m]")
    return figure


@as_svg
def reversal_and_hold(histories: Mapping[str, History], torques: Mapping[str, Mapping[str, Array]]) -> Figure:
    """A reversal of the growing sine, over displacement and over time, and a displacement that is held.

    The arguments are those of :func:`characteristics`, with the history ``held``.
    """
    figure = new_figure(9.6, 3.2)
    over_x, over_t, held = figure.subplots(1, 3)
    sine, hold = histories["growing_sine"], histories["held"]
    turn = SECOND_CYCLE[0] + int(np.argmax(sine.x[slice(*SECOND_CYCLE)]))
    part = slice(turn - 80, turn + 81)
    for law, style in styles(torques).items():
        held.plot(np.arange(hold.x.size) * hold.dt, torques[law]["held"], **style)
        if torques[law]["held"][-1] != 0.0:  # only laws with a memory; the others jump, or follow the speed alone
            torque = torques[law]["growing_sine"]
            over_x.plot(sine.x[part] / DEGREE, (torque - torque[turn])[part], **style)
            over_t.plot((np.arange(torque.size) - turn)[part] * sine.dt, (torque - torque[turn])[part], **style)
    over_x.set(title="reversal", xlabel="displacement [deg]", ylabel="torque less that at the reversal [N m]")
    over_t.set(title="the same over time", xlabel="time from the reversal [s]")
    held.set(title="displacement held", xlabel="time [s]", ylabel="torque [N m]")
    at_rest = np.flatnonzero(np.diff(hold.x) == 0.0) * hold.dt
    for part_at_rest in np.split(at_rest, np.flatnonzero(np.diff(at_rest) > 1.5 * hold.dt) + 1):
        held.axvspan(part_at_rest[0], part_at_rest[-1], color="#f0f0f0", zorder=0)
    legend(figure, held)
    return figure


@as_svg
def held_torque(tests: Sequence[Any], sample_time: float, settling: float) -> Figure:
    """Torsion-bar torque during a hold, less its final mean: a row for each calibration, a column for each damper.

    Parameters
    ----------
    tests : sequence of held-torque tests
        With ``calibration``, ``law``, ``damping_ratio`` and ``torque`` (T,) [N m] from the start of the hold on.
    sample_time : float
        Between the samples of the torque [s].
    settling : float
        Time from which on the ripple is read [s].
    """
    calibrations = dict.fromkeys(test.calibration for test in tests)
    ratios = dict.fromkeys(test.damping_ratio for test in tests)
    figure = new_figure(3.2 * len(ratios), 0.8 + 1.6 * len(calibrations))
    grid = figure.subplots(len(calibrations), len(ratios), sharex=True, sharey="row", squeeze=False)
    style = styles(test.law for test in tests)
    for row, calibration in zip(grid, calibrations):
        for axes, ratio in zip(row, ratios):
            shown = [test for test in tests if (test.calibration, test.damping_ratio) == (calibration, ratio)]
            for test in reversed(shown):
                t = np.arange(test.torque.size) * sample_time
                torque = test.torque - test.torque[t > t[-1] - 1.0].mean()
                axes.plot(t, torque, **{**style[test.law], "linestyle": "-", "linewidth": 1.0})
            axes.axvspan(settling, t[-1], color="#f0f0f0", zorder=0)
            axes.set_title(f"{calibration}, " + (f"damping ratio {ratio:g}" if ratio else "no micro-damper"))
        row[0].set_ylabel("torque [N m]")
    for axes in grid[-1]:
        axes.set_xlabel("time held [s]")
    legend(figure, grid[0, 0])
    return figure


@as_svg
def readme(tests: Mapping[str, Mapping[str, Mapping[str, Array]]]) -> Figure:
    """Hand torque over handwheel angle, a panel for each test and a line for each law.

    Parameters
    ----------
    tests : title -> law -> channel -> (n,) mean cycle, closed, SI
    """
    figure = new_figure(9.6, 3.4)
    panels = figure.subplots(1, len(tests))
    for axes, (title, curves) in zip(panels, tests.items()):
        for law, style in styles(curves).items():
            axes.plot(curves[law][ANGLE] / DEGREE, curves[law][TORQUE], **{**style, "label": law_name(law)})
        axes.set(title=title, xlabel="handwheel angle [deg]")
    panels[0].set_ylabel("hand torque [N m]")
    legend(figure, panels[0])
    return figure


@as_svg
def real_time(tables: Mapping[str, Sequence[Any]], usable: float) -> Figure:
    """Error over step length, a panel for each scheme; a cross at the top where a run does not stay bounded.

    Parameters
    ----------
    tables : law -> rows
        With ``scheme``, ``step`` [s], ``error`` [1] or None, and ``bounded``.
    usable : float
        Error up to which a scheme counts as usable, drawn as a line [1].
    """
    schemes = dict.fromkeys(row.scheme for rows in tables.values() for row in rows)
    figure = new_figure(9.6, 3.4)
    grid = figure.subplots(1, len(schemes), sharex=True, sharey=True)
    for axes, scheme in zip(grid, schemes):
        for (law, style), height in zip(styles(tables).items(), np.geomspace(*CROSSES, len(tables))):
            rows = [row for row in tables[law] if row.scheme == scheme]
            kept = [row for row in rows if row.bounded]
            axes.loglog([1e3 * row.step for row in kept], [100 * (row.error or 0.0) for row in kept], **style)
            lost = [1e3 * row.step for row in rows if not row.bounded]
            axes.plot(lost, [height] * len(lost), "x", color=style["color"], markersize=5)
        axes.axhline(100 * usable, color="#999999", linewidth=0.8)
        axes.set(title=scheme, xlabel="step [ms]")
        axes.set_xticks([0.1, 1.0, 10.0], ["0.1", "1", "10"])
    grid[0].set(ylabel="RMS error of friction torque [%]", ylim=(None, 1e4))
    legend(figure, grid[0])
    return figure


@as_svg
def margins(points: dict[str, list[Any]], targets: tuple[float, float]) -> Figure:
    """Phase margin [deg] and gain margin [dB] over torsion-bar torque, one line for each speed."""
    figure = new_figure(9.6, 3.0)
    panels = figure.subplots(1, 2, sharex=True)
    for (speed, cells), colour, marker in zip(points.items(), PALETTE, "osD^v"):
        torque = [cell.torque for cell in cells]
        for axes, values in zip(panels, zip(*((cell.phase_deg, cell.gain_db) for cell in cells))):
            axes.plot(torque, values, marker=marker, markersize=4, color=colour, label=speed)
    for axes, target, label in zip(panels, targets, ("phase margin [deg]", "gain margin [dB]")):
        axes.axhline(target, color="#999999", linewidth=0.8)
        axes.annotate("usual target", (0.01, target), xycoords=("axes fraction", "data"), fontsize=8, va="bottom")
        axes.set(xlabel="torsion-bar torque [N m]", ylabel=label, ylim=(0.0, None))
    legend(figure, panels[0])
    return figure


@as_svg
def chassis(cycles: dict[str, dict[str, Array]]) -> Figure:
    """The same weave on both chassis: hand torque, rack force and roll angle as cross plots."""
    figure = new_figure(9.6, 3.2)
    panels = figure.subplots(1, 3)
    pairs = (
        ("torque over lateral acceleration", AY, GRAVITY, "lateral acceleration [g]", TORQUE, 1.0, "torque [N m]"),
        ("rack force over handwheel angle", ANGLE, DEGREE, "handwheel angle [deg]", "rack_force", 1, "rack force [N]"),
        ("roll over lateral acceleration", AY, GRAVITY, "lateral acceleration [g]", "roll_angle", DEGREE, "roll [deg]"),
    )
    for axes, (title, x, per_x, x_label, y, per_y, y_label) in zip(panels, pairs):
        for (name, cycle), colour, dash in zip(cycles.items(), PALETTE, DASHES):
            axes.plot(cycle[x] / per_x, cycle[y] / per_y, color=colour, linestyle=dash, label=name)
        axes.set(title=title, xlabel=x_label, ylabel=y_label)
    legend(figure, panels[0])
    return figure


@as_svg
def parking(found: dict[str, Any]) -> Figure:
    """Rack force and hand torque over the handwheel angle, from lock to lock and back."""
    figure = new_figure(9.6, 3.2)
    panels = figure.subplots(1, 2)
    for (state, drive), colour, dash in zip(found.items(), PALETTE, DASHES):
        angle = np.append(drive.angle, drive.angle[0]) / DEGREE
        for axes, y in zip(panels, (1e-3 * drive.rack_force, drive.torque)):
            axes.plot(angle, np.append(y, y[0]), color=colour, linestyle=dash, label=state)
    for axes, label in zip(panels, ("rack force [kN]", "handwheel torque [N m]")):
        axes.set(xlabel="handwheel angle [deg]", ylabel=label)
    legend(figure, panels[0])
    return figure


@as_svg
def loop_width(panels: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Figure:
    """Signed loop widths over friction, a row for each metric and a column for each test."""
    figure = new_figure(9.6, 5.4)
    grid = figure.subplots(len(panels), len(next(iter(panels.values()))), sharex=True, sharey="row", squeeze=False)
    without: dict[str, Any] = {"linewidth": 1.0, "linestyle": (0, (4, 2))}
    for row, (metric, of_test) in zip(grid, panels.items()):
        for axes, (test, of_car) in zip(row, of_test.items()):
            axes.axhline(0.0, color="#999999", linewidth=0.8)
            for (car, curve), colour in zip(of_car.items(), PALETTE):
                F_c = [width.F_c for width in curve]
                axes.plot(F_c, [width.total for width in curve], "o-", color=colour, markersize=3, label=car)
                axes.plot(F_c, [width.rest for width in curve], color=colour, **without)
            axes.plot([], [], color="#666666", label="without friction: vehicle lag and motor damping", **without)
            axes.set_title(test if axes in grid[0] else "")
        row[0].set_ylabel(f"{metric}, signed [N m]")
    for axes in grid[-1]:
        axes.set_xlabel("friction torque [N m]")
    legend(figure, grid[0, 0])
    return figure


@as_svg
def architecture(found: Mapping[str, Mapping[str, Any]]) -> Figure:
    """The largest difference of a law [%] with its interval, a line for each metric and a mark for each steering."""
    names, ticks = list(next(iter(found.values()))), range(len(found))
    figure = new_figure(9.6, 1.5 + 0.16 * len(found))
    axes = figure.subplots()
    for k, (name, colour) in enumerate(zip(names, PALETTE)):
        seen = [(i, row[name]) for i, row in zip(ticks, found.values()) if row[name]]
        places, sizes, reaches = zip(*((i, 100.0 * abs(each.share), 100.0 * each.reach) for i, each in seen))
        y = np.array(places) + 0.15 * (k - 0.5 * (len(names) - 1))
        axes.errorbar(np.maximum(sizes, 0.1), y, xerr=reaches, fmt="o", color=colour, markersize=3, label=name)
    axes.axvline(5.0, color="#999999", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_xlim(0.1, None)
    axes.set_yticks(ticks, list(found), fontsize=7)
    axes.set_ylim(len(found) - 0.3, -0.7)
    axes.set_xlabel("largest difference of a law from LuGre [%]; 5 % counts")
    legend(figure, axes)
    return figure


class LearningCurves(NamedTuple):
    """Curves of one task."""

    title: str  # of the metric that the training is for, with its unit
    metric: str  # its name among the columns
    runs: Mapping[str, Mapping[str, Array]]  # label -> column ("steps", "reward", metrics) -> (n,)


@as_svg
def learning(tasks: Mapping[str, LearningCurves]) -> Figure:
    """Learning curves, a row for each task: the reward, and the metric that the training is for."""
    figure = new_figure(9.6, 1.9 * len(tasks))
    grid = figure.subplots(len(tasks), 2, squeeze=False)
    for (task, curves), row in zip(tasks.items(), grid):
        for axes, column, title in zip(row, ("reward", curves.metric), ("reward", curves.title)):
            for k, (name, run) in enumerate(curves.runs.items()):
                axes.plot(1e-6 * run["steps"], run[column], color=PALETTE[k], linestyle=DASHES[k], label=name)
            axes.set_xlabel("steps of training [millions]")
            axes.set_ylabel(title)
        row[0].set_title(task)
    legend(figure, max(grid[:, 0], key=lambda axes: len(axes.lines)))
    return figure


_PANEL_SIZE = (4.0, 3.4)  # [inch]
_LAWS_TOGETHER, _PANELS_ACROSS = 5, 3  # laws that one pair of axes shows, and panels side by side where there are more
_BASE_LINE_WIDTH = 5.0  # line of the law that the others are compared with [point]
_NOT_NOTICED = "#e3f2ea"
_WIDEST = 4.0  # half the width of the axis of the differences at most, in thresholds; what is beyond is at its edge


@as_svg
def weave(curves: Mapping[str, Mapping[str, Array]]) -> Figure:
    """Hand torque over handwheel angle in a test that repeats itself, a line for each law (SI).

    The first law's line is wide and light and lies below the others, so that they are seen where they coincide.
    """
    figure = new_figure(*_PANEL_SIZE)
    axes = figure.subplots()
    look, first = styles(curves), next(iter(curves))
    look[first] |= {"linewidth": _BASE_LINE_WIDTH, "alpha": 0.35, "zorder": 1.0}
    for law, style in look.items():
        axes.plot(curves[law][ANGLE] / DEGREE, curves[law][TORQUE], **style)
    axes.set(xlabel="handwheel angle [deg]", ylabel="hand torque [N m]")
    legend(figure, axes, 3)
    return figure


def coincident(curves: Mapping[str, Mapping[str, Array]]) -> list[str]:
    """The laws whose whole line in :func:`weave` lies within the width of a line from that of the first law."""
    lines = {law: np.column_stack((of[ANGLE], of[TORQUE])) for law, of in curves.items()}
    (_, first), *others = lines.items()
    return [law for (law, _), same in zip(others, coincide(first, [line for _, line in others])) if same]


@as_svg
def loops(x: Array, torques: Mapping[str, Array]) -> Figure:
    """Friction torque (T,) [N m] over displacement (T,) [rad], a line for each law.

    More than ``_LAWS_TOGETHER`` laws have a panel each, with the first law in grey below.
    """
    look, (first, *others) = styles(torques), torques
    if len(torques) <= _LAWS_TOGETHER:
        figure = new_figure(*_PANEL_SIZE)
        axes = figure.subplots()
        for law, style in look.items():
            axes.plot(x / DEGREE, torques[law], **{**style, "linewidth": 1.0})
        axes.set(xlabel="displacement [deg]", ylabel="friction torque [N m]")
        legend(figure, axes, 3)
        return figure
    rows = -(-len(others) // _PANELS_ACROSS)
    figure = new_figure(_PANEL_SIZE[0], 1.1 * rows + 0.4)
    places = figure.subplots(rows, _PANELS_ACROSS, sharex=True, sharey=True).flat
    for axes, law in zip(places, others):
        axes.plot(x / DEGREE, torques[first], color="#b9c1cb", linewidth=1.6)
        axes.plot(x / DEGREE, torques[law], **{**look[law], "linewidth": 0.9, "linestyle": "-"})
        axes.set_title(law_name(law), color=look[law]["color"], fontsize=8)
    for place, axes in enumerate(places[len(others) :], len(others)):
        axes.set_axis_off()
        places[place - _PANELS_ACROSS].xaxis.set_tick_params(labelbottom=True)  # the lowest of its column
    figure.supxlabel(f"displacement [deg]; grey: {first}", fontsize=8.5)
    figure.supylabel("friction torque [N m]", fontsize=8.5)
    return figure


@as_svg
def terms(shares: Mapping[str, Mapping[str, Sequence[float]]], threshold: float, narrow: bool = False) -> Figure:
    """Differences from the base law beside the just-noticeable difference, which is shaded: a row for each law.

    Parameters
    ----------
    shares : term -> law -> differences [1]
        A panel for each term.
    threshold : float
        Just-noticeable difference [1].
    narrow : bool
        Whether the panels stand below each other, for a narrow screen.
    """
    laws = list(dict.fromkeys(law for of in shares.values() for law in of))
    look = styles(laws)
    height, rows = 1.0 + 0.26 * len(laws), len(shares) if narrow else 1
    figure = new_figure(4.6 if narrow else 9.6, rows * height)
    farthest = max(abs(value) for of in shares.values() for values in of.values() for value in values)
    edge = 100.0 * min(max(1.6 * threshold, 1.1 * farthest), _WIDEST * threshold)
    panels = figure.subplots(rows, len(shares) // rows, sharey=True, squeeze=False)
    for axes, (title, of) in zip(panels.flat, shares.items()):
        axes.axvspan(-100.0 * threshold, 100.0 * threshold, color=_NOT_NOTICED, zorder=0)
        axes.axvline(0.0, color="#999999", linewidth=0.8)
        for place, law in enumerate(laws):  # not in the order of their styles
            x = np.clip(100.0 * np.array(of.get(law, ()), float), -edge, edge)
            axes.plot(x, np.full(x.size, place), "o", color=look[law]["color"], markersize=5, alpha=0.7, label=law)
        axes.set(title=title, xlabel="difference [%]", xlim=(-1.04 * edge, 1.04 * edge), ylim=(len(laws) - 0.4, -0.6))
        axes.set_yticks(range(len(laws)), [law_name(law) for law in laws])
    return figure


@as_svg
def differences(rows: Mapping[str, Mapping[str, tuple[float, float]]], large: float) -> Figure:
    """Differences of metrics from a base recording, a row for each metric, a mark for each recording.

    Parameters
    ----------
    rows : metric -> recording -> difference and half width of its interval [1]
    large : float
        From which on a difference is called large; less is shaded [1].
    """
    names = list(dict.fromkeys(name for of in rows.values() for name in of))
    figure = new_figure(5.0, 1.0 + 0.3 * len(rows))
    axes = figure.subplots()
    axes.axvspan(-100.0 * large, 100.0 * large, color=_NOT_NOTICED, zorder=0)
    axes.axvline(0.0, color="#999999", linewidth=0.8)
    for k, name in enumerate(names):
        found = [(row, *of[name]) for row, of in enumerate(rows.values()) if name in of]
        y, x, reach = np.array(found).T
        axes.errorbar(
            100.0 * x, y, xerr=100.0 * reach, linestyle="", elinewidth=1.0, label=name,
            color=PALETTE[k % len(PALETTE)], marker="osD^vP*"[k % 7], markersize=5, alpha=0.8,
        )  # fmt: skip
    axes.set(xlabel="difference [%]", ylim=(len(rows) - 0.4, -0.6))
    axes.set_yticks(range(len(rows)), list(rows))
    if len(names) > 1:
        legend(figure, axes)
    return figure


@as_svg
def dots(
    rows: Mapping[str, tuple[float, float, float]],
    label: str,
    line: tuple[float, str] | None = None,
    logarithmic: bool = False,
    name: str = "dots",
) -> Figure:
    """A value and the ends of its interval for each row; an interval that is not known is left out.

    Parameters
    ----------
    rows : name -> value, low, high
    label : str
        Of the axis, with its unit.
    line : (float, str), optional
        A value to compare with, and its name.
    logarithmic : bool
    name : str
        Of the picture's file.
    """
    figure = new_figure(5.6, 0.9 + 0.32 * len(rows))
    figure.set_label(name)
    axes = figure.subplots()
    places = np.arange(len(rows))[::-1]
    values = np.array(list(rows.values()))
    axes.hlines(places, values[:, 1], values[:, 2], color=PALETTE[0], linewidth=2.2)
    axes.plot(values[:, 0], places, "o", color=PALETTE[0], markersize=5)
    if line is not None:
        axes.axvline(line[0], color=PALETTE[2], linestyle="--", linewidth=1.2)
        axes.annotate(
            line[1], (line[0], 1.0), xycoords=("data", "axes fraction"), xytext=(4, -2),
            textcoords="offset points", va="top", fontsize=8, color=PALETTE[2],
        )  # fmt: skip
    axes.set_yticks(places, [name.replace("_", " ") for name in rows])
    axes.set(ylim=(-0.6, len(rows) - 0.2), xlabel=label)
    if logarithmic:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
    return figure
