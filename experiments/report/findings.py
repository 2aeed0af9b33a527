"""What the report's sentences rest on: comparisons between laws, computed; the words are the page's."""

import math
from typing import Any, NamedTuple

from steer_env.experiments.report.results import Cell, Results
from steer_env.experiments.studies import battery, friction_laws, real_time
from steer_env.experiments.studies.battery import MATTERS
from steer_env.experiments.studies.friction_laws import Residual, Verdict
from steer_env.experiments.studies.real_time import Row
from steer_env.manoeuvres import Manoeuvre
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.steering.margins import TARGETS

CHEAP = 0.01  # share of a step's own length that a step may take to compute and count as cheap; assumed
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_WORDS = {"0g": "0 g", "0p1g": "0.1 g", "0nm": "0 N m"}


def number(x: float | None, digits: int = 3, pad: bool = False) -> str:
    """A number for reading, ``pad`` with all its digits; a dash where there is none."""
    if x is None or math.isnan(x):
        return "–"
    if math.isinf(x):
        return "∞" if x > 0 else "−∞"
    text = f"{x:.0f}" if abs(x) >= 10**digits else f"{x:{'#' if pad else ''}.{digits}g}"
    mantissa, _, exponent = text.partition("e")
    power = f"·10{str(int(exponent)).translate(_SUPERSCRIPT)}" if exponent else ""
    return mantissa.rstrip(".").replace("-", "−") + power


def percent(x: float | None, digits: int = 2) -> str:
    """A share in per cent."""
    return number(None if x is None else 100.0 * x, digits) + "\u00a0%"


def change(x: float) -> str:
    """A signed share in per cent, to a hundredth."""
    return "–" if math.isnan(x) else f"{100.0 * x:+.2f}\u00a0%".replace("-", "−")


def label(metric: str) -> str:
    """A metric's name for reading."""
    return " ".join(_WORDS.get(word, word) for word in metric.split("_"))


def plain(value: Any) -> str:
    """A parameter's value for reading."""
    if isinstance(value, list):
        return "[" + ", ".join(plain(x) for x in value) + "]"
    return f"{value:.6g}".replace("-", "−") if isinstance(value, float) else str(value)


def dry(results: Results) -> list[str]:
    """The laws with dry friction, without the base law."""
    return [law for law, p in results.laws.items() if law != results.base and friction_laws.dry(p)]


def undry(results: Results) -> list[str]:
    """The laws without dry friction, without the base law."""
    return [law for law, p in results.laws.items() if law != results.base and not friction_laws.dry(p)]


class Feel(NamedTuple):
    """What the law changes in one test; None where there is no law to compare."""

    table: dict[str, dict[str, battery.Difference]]  # metric -> law
    dry: battery.Largest | None
    undry: battery.Largest | None

    @property
    def matters(self) -> bool:
        """Whether the choice among dry laws changes a metric by a share that matters."""
        return self.dry is not None and self.dry.share > MATTERS


FEEL = ("weave", "slow-ramp")  # tests that the summary words


def feel(results: Results, test: str) -> Feel:
    """Differences between the laws in one test."""
    table = battery.differences(results.drives[test], results.base)
    return Feel(table, battery.largest(table, dry(results)), battery.largest(table, undry(results)))


def residuals(results: Results) -> dict[str, Residual]:
    """Distance of every law from the base law on the saturated branch and on nested loops."""
    base = results.torques[results.base]["nested_loops"]
    return {law: friction_laws.residual(found["nested_loops"], base) for law, found in results.torques.items()}


def parts_most(results: Results) -> tuple[str, float] | None:
    """The dry law that is farthest from the base law on nested loops, and how far; None if there is no other."""
    found = residuals(results)
    return max(((law, found[law].nested) for law in dry(results)), key=lambda pair: pair[1], default=None)


def calibrated(results: Results) -> bool:
    """Whether some dry law equals the base law on the saturated branches far better than on nested loops."""
    found = residuals(results)
    return any(found[law].saturated < 0.01 and found[law].nested > 2.0 * found[law].saturated for law in dry(results))


class HeldTorque(NamedTuple):
    """Where Masing's vibration under held torque comes from."""

    worst: Verdict  # where Masing's ripple without a damper is largest; with the light damper
    unassisted: Verdict  # the same without assist
    frequency: float  # of what rings there [Hz]
    step_change: float  # of that ripple, by a tenth of the step [1]
    removed: dict[
        float, tuple[float, float]
    ]  # damping ratio -> least and largest part of the gap that the damper takes

    @property
    def vibrates(self) -> bool:
        """Whether Masing's ripple is well above LuGre's where neither has a damper."""
        return self.worst.masing.ripple > 2.0 * self.worst.lugre.ripple

    @property
    def of_the_step(self) -> bool:
        """Whether the step has a part in the ripple."""
        return self.step_change > 0.02

    @property
    def damper_explains(self) -> bool:
        """Whether the heavier damper closes nearly all of the gap everywhere."""
        return self.removed[friction_laws.DAMPING_RATIOS[-1]][0] > 0.9

    @property
    def fed_by_assist(self) -> bool:
        """Whether the vibration lasts with assist and dies out without."""
        return self.worst.masing.lasting > 0.9 and self.unassisted.masing.lasting < 0.5


def held_torque(results: Results) -> HeldTorque | None:
    """The held-torque test; None unless the report has both of its laws."""
    if {test.law for test in results.held} != set(friction_laws.HELD_LAWS):
        return None
    ratios = friction_laws.DAMPING_RATIOS[1:]
    verdicts = {ratio: friction_laws.verdicts(results.held, ratio) for ratio in ratios}
    light = verdicts[ratios[0]]
    worst = max(light, key=lambda verdict: verdict.masing.ripple)
    unassisted = next(v for v in light if v.masing[:2] == ("off", worst.masing.calibration))
    shares = {ratio: [verdict.share_of_damper for verdict in found] for ratio, found in verdicts.items()}
    return HeldTorque(
        worst,
        unassisted,
        friction_laws.ringing(worst.masing.torque),
        abs(worst.masing.ripple_fine / worst.masing.ripple - 1.0),
        {ratio: (min(found), max(found)) for ratio, found in shares.items()},
    )


def at_sample(results: Results) -> dict[str, Row]:
    """The midpoint frame of every law at the step of the controller, or the nearest there is."""
    rows = {law: [row for row in table if row.scheme == "midpoint"] for law, table in results.tables.items()}
    return {law: min(found, key=lambda row: abs(row.step - SAMPLE_TIME)) for law, found in rows.items()}


def cheap(row: Row) -> bool:
    """Whether the worst step leaves real time alone."""
    return row.bounded and row.worst_step_ns is not None and 1e-9 * row.worst_step_ns < CHEAP * row.step


def accurate(rows: list[Row]) -> bool:
    """Whether all errors are usable."""
    return all(row.error is not None and row.error < real_time.USABLE for row in rows)


def cheapest(results: Results, scheme: str) -> bool:
    """Whether a scheme takes the shortest mean step, of those timed, with every law."""
    for rows in results.tables.values():
        times = [(row.ns_per_step, row.scheme) for row in rows if row.ns_per_step is not None]
        if times and min(times)[1] != scheme:
            return False
    return True


def title(manoeuvre: Manoeuvre) -> str:
    """A manoeuvre by its name, frequency and speed."""
    frequency = f" at {manoeuvre.frequency:.3g} Hz" if manoeuvre.frequency else ""
    if manoeuvre.rig or not manoeuvre.speed:
        return manoeuvre.name.replace("-", " ") + frequency
    speed = f"{3.6 * manoeuvre.speed:.4g} km/h"
    return manoeuvre.name.replace("-", " ") + (f"{frequency} and {speed}" if frequency else f" at {speed}")


def by_time(results: Results) -> list[str]:
    """The laws, the quickest step first."""
    rows = at_sample(results)
    return sorted(rows, key=lambda law: rows[law].ns_per_step or math.inf)


def usable(results: Results, scheme: str) -> dict[float | None, list[str]]:
    """Laws by the longest usable step of a scheme, the longest first; None where there is none."""
    groups: dict[float | None, list[str]] = {}
    for law, rows in results.tables.items():
        groups.setdefault(real_time.usable_step(rows, scheme), []).append(law)
    return dict(sorted(groups.items(), key=lambda pair: -(pair[0] or 0.0)))


def bounded(results: Results, laws: list[str], scheme: str) -> bool:
    """Whether a scheme stays bounded at every step with every one of the laws."""
    return all(row.bounded for law in laws for row in results.tables[law] if row.scheme == scheme)


def least_margin(results: Results) -> tuple[str, Cell]:
    """Speed and cell of the assist loop with the least phase margin."""
    cells = [(speed, cell) for speed, found in results.margins.items() for cell in found]
    return min(cells, key=lambda pair: pair[1].phase_deg)


def on_target(cell: Cell) -> bool:
    """Whether a cell is stable with the usual margins."""
    return cell.stable and cell.phase_deg >= TARGETS[0] and cell.gain_db >= TARGETS[1]


def widest_interval(results: Results) -> float:
    """Half the widest interval of any metric, relative to its value."""
    values = [v for drives in results.drives.values() for drive in drives.values() for v in drive.values.values()]
    widths = ((v.high - v.low) / 2.0 / abs(v.value) for v in values if v.value)
    return max((width for width in widths if math.isfinite(width)), default=math.nan)


def refusals(results: Results, test: str) -> dict[str, list[str]]:
    """Reason -> what was refused for it, as "metric (law, law)"."""
    refused: dict[tuple[str, str], list[str]] = {}
    for law, drive in results.drives[test].items():
        for name, value in drive.values.items():
            if value.reason:
                refused.setdefault((value.reason, name), []).append(law)
    reasons: dict[str, list[str]] = {}
    for (reason, name), laws in refused.items():
        reasons.setdefault(reason, []).append(f"{label(name)} ({', '.join(laws)})")
    return reasons
