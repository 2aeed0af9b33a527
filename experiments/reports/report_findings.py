"""Comparisons between the laws on which the sentences of the report rest; the templates have the words."""

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from steer_env import targets
from steer_env.experiments.pages.words import change, in_words, label, percent, plain
from steer_env.experiments.reports.report_results import Drives, Results
from steer_env.experiments.studies import friction_laws, real_time
from steer_env.experiments.studies.common import assist_margins, battery
from steer_env.experiments.studies.common.assist_margins import TARGETS, Cell
from steer_env.experiments.studies.common.battery import LEAST, MATTERS
from steer_env.experiments.studies.friction_laws import HeldTest, Residual, Verdict
from steer_env.experiments.studies.real_time import SchemeRow
from steer_env.friction import sites
from steer_env.friction.law import law_of
from steer_env.manoeuvres import Manoeuvre
from steer_env.metrics import Value
from steer_env.metrics.common import just_noticeable
from steer_env.vehicle.steering.eps import SAMPLE_TIME

WANTED = "compact"  # target bands that the summary rates the laws by

__all__ = ["LEAST", "MATTERS", "TARGETS", "plain"]  # the templates reach these through this module


def dry(results: Results) -> list[str]:
    """The laws with dry friction, except the base law."""
    return [law for law, p in results.laws.items() if law != results.base and friction_laws.dry(p)]


def undry(results: Results) -> list[str]:
    """The laws without dry friction, except the base law."""
    return [law for law, p in results.laws.items() if law != results.base and not friction_laws.dry(p)]


class Feel(NamedTuple):
    """Differences between the laws in one test; None where there is no law to compare."""

    table: dict[str, dict[str, battery.Difference]]  # metric -> law
    dry: battery.Largest | None
    undry: battery.Largest | None

    @property
    def matters(self) -> bool:
        """Whether the choice among dry laws changes a metric by a share that matters."""
        return self.dry is not None and self.dry.share > MATTERS


def feel(results: Results, test: str, noticed: float = just_noticeable.SHARE) -> Feel:
    """Differences between the laws in one test; ``noticed`` is the just-noticeable difference [1]."""
    table = battery.differences(results.drives[test], results.base, noticed)
    return Feel(table, battery.largest(table, dry(results)), battery.largest(table, undry(results)))


class Differing(NamedTuple):
    """A metric of one law that differs from that of the base law."""

    test: str
    metric: str
    law: str
    base: Value
    found: battery.Difference

    @property
    def of_base(self) -> float:
        """The difference as a share of the base law's value [1]."""
        return self.found.value / abs(self.base.value)


class Differences(NamedTuple):
    """Every comparison of a metric with the base law by what it means, the largest differences first."""

    perceptible: list[Differing]
    large: list[Differing]  # real and above MATTERS, but not perceptible, or without a known threshold
    small: int  # real, but neither perceptible nor above MATTERS
    none: int  # the interval of the difference contains zero
    refused: int
    known: list[Differing]  # those for which a threshold of perception is known, perceptible or not
    rows: list[Differing]  # all of them

    def laws(self) -> list[str]:
        """The laws that differ perceptibly."""
        return list(dict.fromkeys(row.law for row in self.perceptible))

    def mostly(self) -> str:
        """The tests that most of the large differences are in, with how many."""
        counts = Counter(row.test for row in self.large).most_common(3)
        return ", ".join(f"{test.replace('-', ' ')} ({count})" for test, count in counts)


def differences(drives: Drives, base: str, noticed: float = just_noticeable.SHARE) -> Differences:
    """The differences from a base law in all tests together; ``noticed`` is the just-noticeable difference [1]."""
    rows = [
        Differing(test, metric, law, of[base].values[metric], found)
        for test, of in drives.items()
        for metric, of_law in battery.differences(of, base, noticed).items()
        for law, found in of_law.items()
    ]
    rows.sort(key=lambda row: -abs(row.found.share) if math.isfinite(row.found.share) else 0.0)
    kinds: dict[str, list[Differing]] = defaultdict(list)
    for row in rows:
        kinds[_kind(row.found)].append(row)
    return Differences(
        kinds["perceptible"],
        kinds["large"],
        small=len(kinds["small"]),
        none=len(kinds["none"]),
        refused=len(kinds["refused"]),
        known=[row for row in rows if row.found.perception.verdict != just_noticeable.UNKNOWN],
        rows=rows,
    )


def _kind(found: battery.Difference) -> str:
    if math.isnan(found.value):
        return "refused"
    if found.real and found.perception.verdict == just_noticeable.PERCEPTIBLE:
        return "perceptible"
    if found.matters:
        return "large"
    return "small" if found.real else "none"


class Compared(NamedTuple):
    """What a law changes against the base law, on one term."""

    compared: int  # metrics with a value of both
    large: int  # of them, real and above ``MATTERS``
    known: list[Differing]  # those with a threshold of perception
    perceptible: list[Differing]
    largest: Differing | None  # the real difference with the largest share


def by_law(found: Differences) -> dict[str, Compared]:
    """What each law changes."""
    laws: dict[str, list[Differing]] = defaultdict(list)
    for row in found.rows:
        if math.isfinite(row.found.value):
            laws[row.law].append(row)
    return {
        law: Compared(
            len(rows),
            sum(row.found.matters for row in rows),
            [row for row in found.known if row.law == law],
            [row for row in found.perceptible if row.law == law],
            next((row for row in rows if row.found.real), None),
        )
        for law, rows in laws.items()
    }


class OnTerm(NamedTuple):
    """The laws on one term, compared with a base law."""

    title: str
    base: str
    differences: Differences
    laws: dict[str, Compared]  # without the base law

    @property
    def felt(self) -> list[str]:
        """The laws that a driver would tell from the base law."""
        return [law for law, of in self.laws.items() if of.perceptible]

    @property
    def most(self) -> str:
        """Where a driver would notice most, and by how much; empty where no law is noticed."""
        if not self.differences.perceptible:
            return ""
        row = self.differences.perceptible[0]
        return f"most in {row.test.replace('-', ' ')}: {label(row.metric)} {change(row.of_base)}"


def terms(results: Results, noticed: float = just_noticeable.SHARE) -> list[OnTerm]:
    """One calibration for all laws, and each fitted to the same measurement where that holds for two or more."""
    shared = differences(results.drives, results.base, noticed)
    found = [OnTerm("one calibration for all laws", results.base, shared, by_law(shared))]
    own = law_of(results.laws[results.base]).name
    if own in results.fitted.laws and len(results.fitted.laws) > 1:
        fitted = differences(results.fitted.drives, own, noticed)
        found.append(OnTerm("each law fitted to the same measurement", own, fitted, by_law(fitted)))
    return found


def verdict(results: Results, found: Sequence[OnTerm]) -> str:
    """Which laws a driver would notice in place of the base law, where and by how much, in at most 25 words."""
    base, (shared, *fitted) = results.base, found
    if not shared.laws:
        counts = rated(results, targets.load(WANTED), base)
        return (
            f"With {base} friction {counts['green']} of {sum(counts.values())} rated metrics of this car are in their "
            f"good band, {counts['amber']} in the fair band and {counts['red']} outside it."
        )
    if not shared.differences.known:
        row = next(iter(shared.differences.rows), None)
        if row is None or not math.isfinite(row.found.share):
            return "Whether a driver would notice a difference is not known for what was driven here."
        what = f"most differs {label(row.metric)} in {row.test.replace('-', ' ')}, by {change(row.found.share)}"
        return f"Whether a driver would notice is not known for what was driven here; {what} with {row.law}."
    own = fitted[0].felt if fitted else []
    if shared.felt:
        after = f"; once fitted, {_few_names(own, 1) if own else 'none'} would" if fitted else ""
        return f"Replacing {base} by {_few_names(shared.felt)} would be noticed, {shared.most}{after}."
    if own:
        names = _few_names(own)
        return f"Replacing {base} would go unnoticed; once each law is fitted, {names} would be, {fitted[0].most}."
    largest = max(abs(row.of_base) for term in found for row in term.differences.known)
    return (
        f"Replacing {base} by another law would go unnoticed: steady hand torques and angles change by at most "
        f"{percent(largest)}."
    )


def _few_names(laws: Sequence[str], most: int = 2) -> str:
    """Laws by name, or their number where there are more than ``most``."""
    return in_words(laws) if len(laws) <= most else f"{len(laws)} laws"


class SmallTurns(NamedTuple):
    """The work that is lost at the hands in a cycle of small turns, with the laws that lose least and most."""

    lost: dict[str, float]  # law -> work [J]
    least: str
    most: str
    weave: float  # ratio of the same two works in the weave of the standard, NaN without it [1]

    @property
    def ratio(self) -> float:
        """Most over least [1]."""
        return self.lost[self.most] / self.lost[self.least]


def small_turns(results: Results) -> SmallTurns | None:
    """What the laws with dry friction lose in small turns; None where fewer than two were driven."""
    driven = [results.base, *dry(results)]
    lost = {law: results.small_turns[law].values["loop_area"].value for law in driven}
    lost = {law: work for law, work in lost.items() if work > 0.0}  # a refused one is not a number
    if len(lost) < 2:
        return None
    least, most = min(lost, key=lost.__getitem__), max(lost, key=lost.__getitem__)
    weave = results.drives.get("weave", {})
    works = [weave[law].values["loop_area"].value if weave else math.nan for law in (most, least)]
    return SmallTurns(lost, least, most, works[0] / works[1])


def rated(results: Results, wanted: targets.Targets, law: str) -> dict[str, int]:
    """How many metrics of a law have each colour of rating."""
    counts = dict.fromkeys(targets.COLOURS, 0)
    for test, bands in wanted.bands.items():
        if test in results.drives:
            for rating in targets.ratings(results.drives[test][law].values, bands).values():
                if rating:
                    counts[rating.colour] += 1
    return counts


def residuals(results: Results) -> dict[str, Residual]:
    """Distance of every law from the base law on the saturated branches and in nested loops."""
    base = results.torques[results.base]["nested_loops"]
    return {law: friction_laws.residual(found["nested_loops"], base) for law, found in results.torques.items()}


def farthest(results: Results) -> tuple[str, float] | None:
    """The dry law that is farthest from the base law in nested loops, and its distance; None if there is no other."""
    found = residuals(results)
    return max(((law, found[law].nested) for law in dry(results)), key=lambda pair: pair[1], default=None)


def calibrated(results: Results) -> list[str]:
    """Dry laws that agree with the base law on the saturated branches far better than in nested loops."""
    laws = residuals(results)
    return [law for law in dry(results) if laws[law].saturated < 0.01 and laws[law].nested > 2.0 * laws[law].saturated]


class HeldTorque(NamedTuple):
    """The cause of the vibration of Masing friction under a held torque."""

    worst: Verdict  # where Masing's ripple without a damper is largest; with the light damper
    unassisted: Verdict  # the same without assist
    frequency: float  # of the vibration there [Hz]
    step_change: float  # relative change of that ripple with a tenth of the step [1]
    # Least and largest share of the difference between the laws that the damper removes, by damping ratio.
    removed: dict[float, tuple[float, float]]  # [1]
    masing: list[HeldTest]  # all tests with Masing

    @property
    def vibrates(self) -> bool:
        """Whether Masing's ripple is well above LuGre's when neither has a damper."""
        return self.worst.masing.ripple > 2.0 * self.worst.lugre.ripple

    @property
    def lasting(self) -> dict[tuple[str, str], list[HeldTest]]:
        """State of the assist and calibration in which Masing's vibration lasts without a damper -> all its dampers."""
        return {
            bare[:2]: [test for test in self.masing if test[:2] == bare[:2]]
            for bare in self.masing
            if not bare.damping_ratio and lasts(bare)
        }

    @property
    def of_the_step(self) -> bool:
        """Whether the step length contributes to the ripple."""
        return self.step_change > 0.02

    @property
    def damper_explains(self) -> bool:
        """Whether the stronger damper removes nearly all of the difference in every case."""
        return self.removed[friction_laws.DAMPING_RATIOS[-1]][0] > 0.9

    @property
    def fed_by_assist(self) -> bool:
        """Whether the vibration persists with assist and decays without."""
        return lasts(self.worst.masing) and self.unassisted.masing.lasting < 0.5


def lasts(test: HeldTest) -> bool:
    """Whether a vibration hardly decays in the two seconds over which it is read."""
    return test.lasting > 0.9


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
        [test for test in results.held if test.law == "masing"],
    )


def at_sample(results: Results) -> dict[str, SchemeRow]:
    """Midpoint scheme with every law at the step of the controller, or at the nearest step in the table."""
    rows = {law: [row for row in table if row.scheme == "midpoint"] for law, table in results.tables.items()}
    return {law: min(found, key=lambda row: abs(row.step - SAMPLE_TIME)) for law, found in rows.items() if found}


def accurate(rows: list[SchemeRow]) -> bool:
    """Whether all errors are below the usable error."""
    return all(row.error is not None and row.error < real_time.USABLE for row in rows)


def title(manoeuvre: Manoeuvre) -> str:
    """Name of a manoeuvre with its frequency and speed."""
    frequency = f" at {manoeuvre.frequency:.3g} Hz" if manoeuvre.frequency else ""
    if manoeuvre.rig or not manoeuvre.speed:
        return manoeuvre.name.replace("-", " ") + frequency
    speed = f"{3.6 * manoeuvre.speed:.4g} km/h"
    return manoeuvre.name.replace("-", " ") + (f"{frequency} and {speed}" if frequency else f" at {speed}")


def usable(results: Results, scheme: str) -> dict[float | None, list[str]]:
    """Laws grouped by the longest usable step of a scheme, the longest first; None for laws with none."""
    groups: dict[float | None, list[str]] = {}
    for law, rows in results.tables.items():
        groups.setdefault(real_time.usable_step(rows, scheme), []).append(law)
    return dict(sorted(groups.items(), key=lambda pair: -(pair[0] or 0.0)))


def bounded(results: Results, laws: list[str], scheme: str) -> bool:
    """Whether a scheme stays bounded at every step length with each of the laws."""
    return all(row.bounded for law in laws for row in results.tables.get(law, ()) if row.scheme == scheme)


def least_margin(results: Results) -> tuple[str, Cell]:
    """Speed and cell of the boost table with the least phase margin."""
    cells = [(speed, cell) for speed, found in results.margins.items() for cell in found]
    return min(cells, key=lambda pair: pair[1].phase_deg)


def on_target(results: Results) -> bool:
    """Whether the assist loop keeps the usual margins in every cell at every speed."""
    return all(assist_margins.on_target(cell) for cells in results.margins.values() for cell in cells)


def driven_back_db(results: Results) -> float:
    """By which a worm gear that is driven back raises the gain of the assist loop, the most of all laws [dB]."""
    return 20.0 * math.log10(max(max(sites.transmissions(p)) for p in results.laws.values()))


def usual_interval(results: Results) -> float:
    """Half width of an interval relative to the value that nine metrics of ten do not exceed.

    The largest says nothing: it belongs to a value near zero.
    """
    values = [v for drives in results.drives.values() for drive in drives.values() for v in drive.values.values()]
    widths = [(v.high - v.low) / 2.0 / abs(v.value) for v in values if v.value and math.isfinite(v.high - v.low)]
    return float(np.quantile(widths, 0.9)) if widths else math.nan


def refusals(results: Results, test: str) -> dict[str, list[str]]:
    """Reason -> the metrics that are refused for it, each as "metric (law, law)"."""
    refused: dict[tuple[str, str], list[str]] = {}
    for law, drive in results.drives[test].items():
        for name, value in drive.values.items():
            if value.reason:
                refused.setdefault((value.reason, name), []).append(law)
    reasons: dict[str, list[str]] = {}
    for (reason, name), laws in refused.items():
        reasons.setdefault(reason, []).append(f"{label(name)} ({', '.join(laws)})")
    return reasons
