"""Figures of the report as SVG text: one colour and one dash for each law throughout."""

import io
from collections.abc import Iterable, Mapping
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from steer_env.experiments.studies.friction_laws import CALIBRATIONS, DAMPING_RATIOS, HISTORIES, SETTLING, THIN, Held
from steer_env.experiments.studies.integrators import SCHEMES
from steer_env.experiments.studies.real_time import USABLE, Row
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE
from steer_env.recording.recording import DEGREE
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]
Style = dict[str, Any]

SECOND_CYCLE = (1000, 1500)  # samples of the growing sine around a reversal before saturation

# Okabe and Ito's palette, which colour-blind readers tell apart; the dashes serve print in grey.
_PALETTE = ("#0072B2", "#D55E00", "#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), "-.", (0, (7, 2, 1.5, 2, 1.5, 2)))
_FIRST = ("lugre", "masing", "dahl", "coulomb", "viscous")  # keep their colours whatever else is drawn

STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica Neue", "Helvetica", "Arial", "Liberation Sans", "DejaVu Sans"],  # as the page
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "svg.fonttype": "none",  # text stays text: small files, the page's font
    "svg.hashsalt": "steer-env",  # the same figure is the same file
    "path.simplify_threshold": 0.3,
}


_styled = matplotlib.rc_context(STYLE)  # as a decorator


def styles(laws: Iterable[str]) -> dict[str, Style]:
    """Colour and dash of every law."""
    laws = list(laws)
    order = [*_FIRST, *(law for law in laws if law not in _FIRST)]
    return {
        law: {
            "color": _PALETTE[i % len(_PALETTE)],
            "linestyle": _DASHES[i % len(_DASHES)],
            "label": law,
            "zorder": 3.0 - 0.1 * i,
        }
        for i, law in enumerate(order)
        if law in laws
    }


def _svg(figure: Figure) -> str:
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


@_styled
def characteristics(torques: dict[str, dict[str, Array]]) -> str:
    """Torque over displacement for every law: a growing sine above, nested loops below."""
    style = styles(torques)
    figure = _figure(9.6, 4.6)
    grid = figure.subplots(2, len(torques), sharex="row", sharey="row", squeeze=False)
    for row, name in zip(grid, ("growing_sine", "nested_loops")):
        x = HISTORIES[name].x / DEGREE
        for axes, law in zip(row, torques):
            axes.plot(x, torques[law][name], color=style[law]["color"], linewidth=1.0)
            axes.set_title(law if name == "growing_sine" else "")
            axes.set_xlabel("displacement [deg]")
        row[0].set_ylabel("torque [N m]")
    return _svg(figure)


@_styled
def reversal_and_hold(torques: dict[str, dict[str, Array]]) -> str:
    """A reversal of the growing sine, over displacement and over time, and a displacement that is held."""
    figure = _figure(9.6, 3.2)
    over_x, over_t, held = figure.subplots(1, 3)
    sine, hold = HISTORIES["growing_sine"], HISTORIES["held"]
    turn = SECOND_CYCLE[0] + int(np.argmax(sine.x[slice(*SECOND_CYCLE)]))
    part = slice(turn - 80, turn + 81)
    for law, style in styles(torques).items():
        held.plot(np.arange(hold.x.size) * hold.dt, torques[law]["held"], **style)
        if torques[law]["held"][-1] != 0.0:  # laws with a memory: the others jump, or follow the speed alone
            torque = torques[law]["growing_sine"]
            over_x.plot(sine.x[part] / DEGREE, (torque - torque[turn])[part], **style)
            over_t.plot((np.arange(torque.size) - turn)[part] * sine.dt, (torque - torque[turn])[part], **style)
    over_x.set(title="reversal", xlabel="displacement [deg]", ylabel="torque less that at the reversal [N m]")
    over_t.set(title="the same over time", xlabel="time from the reversal [s]")
    held.set(title="displacement held", xlabel="time [s]", ylabel="torque [N m]")
    at_rest = np.flatnonzero(np.diff(hold.x) == 0.0) * hold.dt
    for part_at_rest in np.split(at_rest, np.flatnonzero(np.diff(at_rest) > 1.5 * hold.dt) + 1):
        held.axvspan(part_at_rest[0], part_at_rest[-1], color="#f0f0f0", zorder=0)
    _legend(figure, held)
    return _svg(figure)


@_styled
def held_torque(tests: list[Held], assist: str) -> str:
    """Torsion-bar torque after the hold has begun, less its final mean, for every calibration and damper."""
    figure = _figure(9.6, 4.0)
    grid = figure.subplots(len(CALIBRATIONS), len(DAMPING_RATIOS), sharex=True, sharey="row", squeeze=False)
    style = styles(test.law for test in tests)
    for row, calibration in zip(grid, CALIBRATIONS):
        for axes, ratio in zip(row, DAMPING_RATIOS):
            for test in reversed([test for test in tests if test[:2] == (assist, calibration.title)]):
                if test.damping_ratio == ratio:
                    t = np.arange(test.torque.size) * THIN * SAMPLE_TIME
                    torque = test.torque - test.torque[t > t[-1] - 1.0].mean()
                    axes.plot(t, torque, **{**style[test.law], "linestyle": "-", "linewidth": 1.0})
            axes.axvspan(SETTLING, t[-1], color="#f0f0f0", zorder=0)
            axes.set_title(f"{calibration.title}, " + (f"damping ratio {ratio:g}" if ratio else "no micro-damper"))
        row[0].set_ylabel("torque [N m]")
    for axes in grid[-1]:
        axes.set_xlabel("time held [s]")
    _legend(figure, grid[0, 0])
    return _svg(figure)


@_styled
def cross_plots(loops: dict[str, dict[str, Array]], base: str) -> str:
    """Torque over handwheel angle and over lateral acceleration; below, the torque less the base law's.

    Parameters
    ----------
    loops : law -> channel -> (n,) mean cycle, closed, SI
    base : str
        The law that the others are compared with, at the same phase of the cycle.
    """
    figure = _figure(9.6, 6.2)
    grid = figure.subplots(2, 2, sharex="col", height_ratios=(2, 1))
    for law, style in styles(loops).items():
        cycle = loops[law]
        gap = cycle[TORQUE] - loops[base][TORQUE]
        for (above, below), x in zip(grid.T, (cycle[ANGLE] / DEGREE, cycle[AY] / GRAVITY)):
            above.plot(x, cycle[TORQUE], **style)
            below.plot(x, gap, **style)
    grid[0, 0].set(ylabel="handwheel torque [N m]", title="torque over handwheel angle")
    grid[0, 1].set(title="torque over lateral acceleration")
    grid[1, 0].set(xlabel="handwheel angle [deg]", ylabel=f"torque less {base}'s [N m]")
    grid[1, 1].set(xlabel="lateral acceleration [g]")
    _legend(figure, grid[0, 0])
    return _svg(figure)


@_styled
def real_time(tables: dict[str, list[Row]]) -> str:
    """Error over step for every scheme; a cross at the top where a run does not stay bounded."""
    figure = _figure(9.6, 3.4)
    grid = figure.subplots(1, len(SCHEMES), sharex=True, sharey=True)
    for axes, scheme in zip(grid, SCHEMES):
        for (law, style), height in zip(styles(tables).items(), np.geomspace(300.0, 5000.0, len(tables))):
            rows = [row for row in tables[law] if row.scheme == scheme]
            kept = [row for row in rows if row.bounded]
            axes.loglog([1e3 * row.step for row in kept], [100 * (row.error or 0.0) for row in kept], **style)
            lost = [1e3 * row.step for row in rows if not row.bounded]
            axes.plot(lost, [height] * len(lost), "x", color=style["color"], markersize=5)
        axes.axhline(100 * USABLE, color="#999999", linewidth=0.8)
        axes.set(title=scheme, xlabel="step [ms]")
        axes.set_xticks([0.1, 1.0, 10.0], ["0.1", "1", "10"])
    grid[0].set(ylabel="RMS error of friction torque [%]", ylim=(None, 1e4))
    _legend(figure, grid[0])
    return _svg(figure)


@_styled
def margins(points: dict[str, list[Any]], targets: tuple[float, float]) -> str:
    """Phase margin [deg] and gain margin [dB] over torsion-bar torque, one line a speed."""
    figure = _figure(9.6, 3.0)
    panels = figure.subplots(1, 2, sharex=True)
    for (speed, cells), colour, marker in zip(points.items(), _PALETTE, "osD^v"):
        torque = [cell.torque for cell in cells]
        for axes, values in zip(panels, zip(*((cell.phase_deg, cell.gain_db) for cell in cells))):
            axes.plot(torque, values, marker=marker, markersize=4, color=colour, label=speed)
    for axes, target, label in zip(panels, targets, ("phase margin [deg]", "gain margin [dB]")):
        axes.axhline(target, color="#999999", linewidth=0.8)
        axes.annotate("usual target", (0.01, target), xycoords=("axes fraction", "data"), fontsize=8, va="bottom")
        axes.set(xlabel="torsion-bar torque [N m]", ylabel=label, ylim=(0.0, None))
    _legend(figure, panels[0])
    return _svg(figure)


@_styled
def chassis(cycles: dict[str, dict[str, Array]]) -> str:
    """The same weave on both chassis: torque, rack force and roll over their natural partners."""
    figure = _figure(9.6, 3.2)
    panels = figure.subplots(1, 3)
    pairs = (
        ("torque over lateral acceleration", AY, GRAVITY, "lateral acceleration [g]", TORQUE, 1.0, "torque [N m]"),
        ("rack force over handwheel angle", ANGLE, DEGREE, "handwheel angle [deg]", "rack_force", 1, "rack force [N]"),
        ("roll over lateral acceleration", AY, GRAVITY, "lateral acceleration [g]", "roll_angle", DEGREE, "roll [deg]"),
    )
    for axes, (title, x, per_x, x_label, y, per_y, y_label) in zip(panels, pairs):
        for (name, cycle), colour, dash in zip(cycles.items(), _PALETTE, _DASHES):
            axes.plot(cycle[x] / per_x, cycle[y] / per_y, color=colour, linestyle=dash, label=name)
        axes.set(title=title, xlabel=x_label, ylabel=y_label)
    _legend(figure, panels[0])
    return _svg(figure)


@_styled
def parking(found: dict[str, Any]) -> str:
    """Rack force and hand torque over the handwheel angle, from lock to lock and back."""
    figure = _figure(9.6, 3.2)
    panels = figure.subplots(1, 2)
    for (state, drive), colour, dash in zip(found.items(), _PALETTE, _DASHES):
        angle = np.append(drive.angle, drive.angle[0]) / DEGREE
        for axes, y in zip(panels, (1e-3 * drive.rack_force, drive.torque)):
            axes.plot(angle, np.append(y, y[0]), color=colour, linestyle=dash, label=state)
    for axes, label in zip(panels, ("rack force [kN]", "handwheel torque [N m]")):
        axes.set(xlabel="handwheel angle [deg]", ylabel=label)
    _legend(figure, panels[0])
    return _svg(figure)


@_styled
def cross_validation(results: Mapping[str, Mapping[str, Any]]) -> str:
    """Yaw rate and lateral acceleration of both models, a column a manoeuvre of ``results``."""
    figure = _figure(9.6, 4.6)
    grid = figure.subplots(2, len(results), sharex="col", sharey="row", squeeze=False)
    for column, result in zip(grid.T, results.values()):
        published, reconciled = result["published"], result["reconciled"]
        lines = (
            (published.theirs, "CommonRoad as published", {"color": _PALETTE[1], "linewidth": 1.0}),
            (reconciled.theirs, "CommonRoad reconciled", {"color": _PALETTE[3], "linewidth": 1.0}),
            (published.ours, "two tracks", {"color": _PALETTE[6], "linestyle": (0, (2, 3)), "linewidth": 1.8}),
        )
        for run, label, style in lines:
            column[0].plot(run.time, run["yaw_rate"] / DEGREE, label=label, **style)
            column[1].plot(run.time, run["lateral_acceleration"], label=label, **style)
        column[0].set_title(f"{run.meta['manoeuvre']}, {run.meta['speed_m_s']:g} m/s")
        column[1].set_xlabel("time [s]")
    grid[0, 0].set_ylabel("yaw rate [deg/s]")
    grid[1, 0].set_ylabel("lateral acceleration [m/s²]")
    _legend(figure, grid[0, 0])
    return _svg(figure)


@_styled
def loop_width(panels: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """Signed widths over friction, a row a metric and a column a test; thin and dashed the part of lag and damping."""
    figure = _figure(9.6, 5.4)
    grid = figure.subplots(len(panels), len(next(iter(panels.values()))), sharex=True, sharey="row", squeeze=False)
    for row, (metric, of_test) in zip(grid, panels.items()):
        for axes, (test, of_car) in zip(row, of_test.items()):
            axes.axhline(0.0, color="#999999", linewidth=0.8)
            for (car, curve), colour in zip(of_car.items(), _PALETTE):
                F_c = [width.F_c for width in curve]
                axes.plot(F_c, [width.total for width in curve], "o-", color=colour, markersize=3, label=car)
                axes.plot(F_c, [width.rest for width in curve], color=colour, linewidth=1.0, linestyle=(0, (4, 2)))
            axes.set_title(test if axes in grid[0] else "")
        row[0].set_ylabel(f"{metric}, signed [N m]")
    for axes in grid[-1]:
        axes.set_xlabel("friction torque [N m]")
    _legend(figure, grid[0, 0])
    return _svg(figure)


@_styled
def learning(tasks: Mapping[str, tuple[str, Mapping[str, Mapping[str, Array]]]]) -> str:
    """Learning curves: for each task the title of its figure and the runs: columns reward, figure and steps."""
    figure = _figure(9.6, 2.4 * len(tasks))
    grid = figure.subplots(len(tasks), 2, squeeze=False)
    for (task, (title, runs)), row in zip(tasks.items(), grid):
        for axes, column, label in zip(row, ("reward", "figure"), ("reward", title)):
            for k, (name, run) in enumerate(runs.items()):
                axes.plot(1e-6 * run["steps"], run[column], color=_PALETTE[k], linestyle=_DASHES[k], label=name)
            axes.set_xlabel("steps of training [millions]")
            axes.set_ylabel(label)
        row[0].set_title(task)
    _legend(figure, grid[0][0])
    return _svg(figure)
