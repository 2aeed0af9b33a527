"""The page of the friction study: sentences and tables that follow from the results."""

import math
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from steer_env import friction
from steer_env.experiments.pages import friction_pictures
from steer_env.experiments.pages.study_page import Picture, Section, Table
from steer_env.experiments.pages.words import label, number, percent, within
from steer_env.experiments.studies import real_time
from steer_env.experiments.studies.common import friction_cases as cases
from steer_env.experiments.studies.common import friction_records as records
from steer_env.experiments.studies.common.battery import MATTERS
from steer_env.experiments.studies.common.friction_cases import BASE_LAW, Effect
from steer_env.experiments.studies.common.friction_results import SAMPLE, SCHEME, Results
from steer_env.friction.identification import periods
from steer_env.recording.recording import DEGREE


def named(words: Sequence[str]) -> str:
    """A list in words: "a, b and c"."""
    words = list(words)
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words) or "none"


def _span(values: Sequence[float]) -> str:
    low, high = percent(min(values), 2), percent(max(values), 2)
    return low if low == high else f"{low} to {high}"


def _of_the_literature(known: Sequence[records.Judged]) -> str:
    """LuGre against Masing, the two laws that the literature compares."""
    of = {each.law: each for each in known}
    if not {"lugre", "masing"} <= of.keys():
        return ""
    lugre, masing = of["lugre"], of["masing"]
    text = (
        f" Of the two that the literature compares, LuGre leaves {number(lugre.error / masing.error, 2)} times as much "
    )
    text += "as Masing"
    if lugre.undetermined:
        text += f", and the record does not determine its {named(lugre.undetermined)}"
    return f"{text}."


def accuracy(r: Results) -> Section:
    """Which law describes the measured record best."""
    known = r.known()
    best, others = known[0], known[1:]
    seconds = r.record.dt * r.record.x.size
    ranks = "; ".join(f"{each.law} {percent(each.error, 3)}" for each in others)
    ratio = best.error / r.repeatability
    verdict = (
        f"Of the mean friction {best.law} leaves {percent(best.error, 3)} (95 % interval {percent(best.low, 3)} to "
        f"{percent(best.high, 3)}), {number(ratio, 2)} times the {percent(r.repeatability, 2)} by which one period "
        f"differs from the next. The others leave: {ranks}."
    )
    leaders = [each for each in known if each is best or each.law in best.alike]
    left = [each for each in known if each not in leaders]
    headline = (
        f"Most accurate on the measured record: {named([e.law for e in leaders])}, which "
        f"{'leaves' if len(leaders) == 1 else 'leave'} {_span([e.error for e in leaders])} of the mean friction in "
        f"seconds that were not fitted; one period differs from the next by {percent(r.repeatability, 2)}. The others: "
        + ", ".join(f"{each.law} {percent(each.error, 2)}" for each in left)
        + f".{_of_the_literature(known)}"
    )
    sure = [each for each in known if not each.undetermined]
    if sure and sure[0] is not best:
        verdict += (
            f" The record does not determine every parameter of {named([e.law for e in known if e.undetermined])}; of "
            f"the laws that it determines, {sure[0].law} leaves the least, {percent(sure[0].error, 3)}."
        )
    period = periods.period(r.record.motion) or r.record.x.size
    x, F = r.record.x[-period:] / DEGREE, r.record.friction[-period:]
    loops = {
        each.law: (x, friction.response(each.parameters, r.record.x, r.record.dt)[-period:])
        for each in known
        if each.error < 0.5
    }
    rows = [
        (each.law, percent(each.error, 3), f"{percent(each.low, 3)} to {percent(each.high, 3)}",
         number(each.error / r.repeatability, 2), ", ".join(each.undetermined) or "–")
        for each in known
    ]  # fmt: skip
    rows += [(each.law, *("–" * 4)) for each in r.judged if each.parameters is None]
    head = ("law", "error, held out", "95 % interval", "over repeatability", "not determined")
    remarks = [(each.law, "; ".join(each.remarks)) for each in r.judged if each.remarks]
    return Section(
        "Which law is more accurate?",
        "A law with more memory describes measured friction better than one with a single bristle.",
        f"Every law is fitted to the first {(1.0 - records.HELD_OUT) * seconds:.3g} s of a measured record of "
        f"{seconds:.3g} s and judged by the RMS of what it leaves on the rest while the record moves, over the mean "
        "friction, as by steer-env fit-friction; half of the time it stands still, of which laws without memory say "
        "nothing.",
        verdict,
        "The record has one stroke, one speed and one load, and comes from a reciprocating rig, not from a steering "
        "gear. It says nothing of speed, of small strokes after large ones, or of load. It is stretched to the level "
        "and "
        "the pre-sliding distance of a column, which changes no error.",
        [Picture(friction_pictures.record_loops((x, F), loops), "The last period of the record, and every law with an "
                 "error below 50 %, which were fitted to other periods.")],
        [Table("Laws on the held-out part of the measured record", head, rows),
         Table("Remarks of the fits", ("law", "remarks"), remarks, folded=True)],
        headline,
    )  # fmt: skip


def cost(r: Results) -> tuple[Section, str, str]:
    """Cost and longest step of each law; beside the section the sentence on times and the one that rests on none."""
    at = {
        law: next(row for row in rows if (row.scheme, row.step) == (SCHEME, SAMPLE)) for law, rows in r.tables.items()
    }
    base, whole = at[BASE_LAW].ns_per_step or math.nan, r.sample_ns[BASE_LAW]
    ratio = {law: (row.ns_per_step or math.nan) / base for law, row in at.items()}
    worst = {law: 1e-9 * (row.worst_step_ns or math.nan) / SAMPLE for law, row in at.items()}
    slow, long = (max(of, key=lambda law: of[law]) for of in (ratio, worst))
    cheap = min(ratio, key=lambda law: ratio[law])
    fast = worst[long] < 0.1
    timed = (
        f"{'All laws run' if fast else 'Not every law runs'} in real time: at a step of 1 ms the worst step of the "
        f"column takes {percent(worst[long], 2)} of the step ({long}). A step costs from {number(ratio[cheap], 2)} "
        f"({cheap}) to {number(ratio[slow], 2)} times ({slow}) that of {BASE_LAW}, a sample of the whole car up to "
        f"{number(max(r.sample_ns.values()) / whole, 3)} times."
    )
    if "masing" in ratio:
        timed += f" Masing costs {number(ratio['masing'], 2)} times what LuGre does."
    longest = {law: real_time.usable_step(rows, SCHEME) for law, rows in r.tables.items()}
    explicit = {law: real_time.usable_step(rows, "explicit Euler") for law, rows in r.tables.items()}
    steps = (
        f"Longest step with an error of at most {percent(real_time.USABLE)} in the project's scheme: "
        f"{_steps(longest)}; "
        f"with explicit Euler {_steps(explicit)}."
    )
    rows = [
        (law, number(ratio[law], 2), number(r.sample_ns[law] / whole, 3), percent(worst[law], 2),
         percent(at[law].error, 2), _ms(longest[law]), _ms(explicit[law]))
        for law in r.laws
    ]  # fmt: skip
    head = ("law", "step of the column, over LuGre's", "sample of the car, over LuGre's", "worst step, share of 1 ms",
            "error at 1 ms", "longest step", "with explicit Euler")  # fmt: skip
    section = Section(
        "Which law runs in real time?",
        "A law that is more accurate is too slow for real time.",
        "The column alone under 2.5 N m of hand torque at 0.5 Hz, with the project's step equation and with explicit "
        "Euler, against a reference at a tight tolerance; compiled code of one processor, in one process. Ratios "
        "within "
        "one run carry over between machines better than times.",
        f"{timed} {steps}",
        "Steps longer than those of the table were not tried, and steps between them were not either. The worst step "
        "excludes what the operating system adds.",
        (),
        [Table("Cost and longest step", head, rows)],
        measured=True,
    )
    return section, timed, steps


def _ms(step: float | None) -> str:
    return f"{1e3 * step:g} ms" if step else "none"


def _steps(of: dict[str, float | None]) -> str:
    groups = groupby(sorted(of, key=lambda law: -(of[law] or 0.0)), key=lambda law: of[law])
    return ", ".join(f"{_ms(step)} ({', '.join(laws)})" for step, laws in groups)


def in_words(row: Effect) -> str:
    """An effect in words: metric, test, share and case."""
    test, level = row.test.replace("-", " "), row.case.level
    return f"{label(row.metric)} in the {test} by {percent(abs(row.found.share), 2)} ({level})"


def counts(rows: Sequence[Effect]) -> str:
    """How many metrics change, in words."""
    s = cases.summary(rows)
    text = f"{s.large} of {s.compared} compared metrics by more than {percent(MATTERS)}"
    if not s.known:
        return f"{text} (no threshold of perception is known for any)"
    return f"{text}, {s.noticed or 'none'} of {s.known} with a known threshold perceptibly"


def case_table(caption: str, of: dict[str, list[Effect]]) -> Table:
    """Counts of large and perceptible differences, a row for each case."""
    rows = []
    for name, effects in of.items():
        s = cases.summary(effects)
        largest = in_words(s.largest).rpartition(" (")[0] if s.largest else "–"
        rows.append((name, str(s.compared), str(s.large), f"{s.noticed} of {s.known}", largest))
    head = ("case", "metrics compared", f"above {percent(MATTERS)}", "perceptible, of known", "largest share")
    return Table(caption, head, rows)


def _metric_table(caption: str, rows: Sequence[Effect]) -> Table:
    """Every perceptible or large effect, the largest first."""
    kept = sorted((row for row in rows if row.noticed or row.found.matters), key=lambda row: -abs(row.found.share))
    text = [
        (row.test, label(row.metric), row.case.label, number(row.base.value),
         within(row.found.value, row.found.half_width), row.base.unit,
         percent(row.found.share, 2), str(row.found.perception))
        for row in kept
    ]  # fmt: skip
    head = ("test", "metric", "case", "base", "difference", "unit", "share", "perception")
    return Table(caption, head, text, folded=True)


def of_laws(r: Results) -> Section:
    """What the law alone changes in the battery."""
    factors = cases.by_factor(r.effects)
    levels = cases.by_level(factors[cases.LAW])
    remembering = [row for law in r.remembers() for row in levels.get(law, [])]
    verdict = (
        f"With one calibration the choice among the laws with pre-sliding ({named(r.remembers())} against {BASE_LAW}) "
        f"changes {counts(remembering)}"
    )
    headline = f"{verdict}."
    largest = cases.summary(remembering).largest
    verdict += f"; most, the {in_words(largest)}." if largest else "."
    other = [law for law in levels if law not in r.remembers()]
    for law in other:
        verdict += f" {law} changes {counts(levels[law])}."
    measured = [row for row in factors.get(cases.MEASURED, []) if row.case.level in r.remembers()]
    if measured:
        base = measured[0].case.base.rpartition(" ")[2]
        laws = named(sorted({row.case.level for row in measured}))
        verdict += f" Calibrated to the measured record, {laws} against {base} change {counts(measured)}."
    tables = [case_table("Each law with the shared calibration, against LuGre", levels)]
    if cases.MEASURED in factors:
        text = "Each law that the measured record determines, calibrated to it, against the best of them"
        tables.append(case_table(text, cases.by_level(factors[cases.MEASURED])))
    tables.append(_metric_table("Every large or perceptible difference between laws", factors[cases.LAW]))
    return Section(
        "What the choice of the law changes in the car",
        "The friction law decides how a steering feels.",
        f"The car '{r.car.name}' drives {len(r.scope.tests)} tests of the battery with every law, once with the "
        "calibration that the default laws share (saturated torque, branch after a reversal from saturation) and once "
        "with every law that the measured record determines calibrated to it. A difference counts where its 95 % "
        "interval excludes zero.",
        verdict,
        "A threshold of perception is known for sustained torques and angles only "
        f"({percent(r.noticed)} of the smaller value). The simulation has no noise, so that the intervals are narrow.",
        (),
        tables,
        headline,
    )


def of_factors(r: Results) -> Section:
    """What level, pre-sliding distance, damping, step, site and load change beside the law."""
    factors = {
        factor: rows
        for factor, rows in cases.by_factor(r.effects).items()
        if factor not in (cases.LAW, cases.MEASURED, cases.UNASSISTED)
    }
    remembering = set(r.remembers())
    law_rows = [row for row in r.effects if row.case.factor == cases.LAW and row.case.level in remembering]
    ranked = sorted(
        {**factors, f"{cases.LAW} (with pre-sliding)": law_rows}.items(), key=lambda pair: -_mean_large(pair[1])
    )
    order = ", ".join(f"{factor} {number(100.0 * _mean_large(rows), 2)} %" for factor, rows in ranked)
    noticed = [factor for factor, rows in ranked if cases.summary(rows).noticed]
    law = next(k for k, (factor, _) in enumerate(ranked) if factor.startswith(cases.LAW))
    of_law = number(100.0 * _mean_large(law_rows), 2)
    stronger = [f"{factor} ({number(100.0 * _mean_large(rows), 2)} %)" for factor, rows in ranked[:law]]
    weaker = [factor for factor, _ in ranked[law + 1 :]]
    headline = (
        f"The law changes {of_law} % of the metrics by more than {percent(MATTERS)}; stronger: {named(stronger)}; "
        f"weaker: {named(weaker)}."
    )
    verdict = (
        f"Share of the metrics that a factor changes by more than {percent(MATTERS)}, mean over its cases: {order}. "
        f"A perceptible difference of a sustained torque or angle comes from {named(noticed)}."
    )
    levels = {
        f"{factor}: {level}": of for factor, rows in factors.items() for level, of in cases.by_level(rows).items()
    }
    every = {factor: cases.by_level(rows) for factor, rows in cases.by_factor(r.effects).items()}
    shares = {
        factor: {
            level: [row.found.share for row in rows if row.found.real and math.isfinite(row.found.share)]
            for level, rows in of.items()
        }
        for factor, of in every.items()
    }
    return Section(
        "What else changes it",
        "The law matters more than its parameters and than where friction acts.",
        f"One factor at a time against {BASE_LAW} with the shared calibration: level by a third, pre-sliding distance "
        "and "
        "micro-damping within their assumed ranges, step length, friction above the torsion bar in place of below it, "
        "and the part of the friction that grows with the rack force.",
        verdict,
        "One factor at a time shows no interaction. Ranges differ: those of level are measured, those of pre-sliding "
        "distance and micro-damping assumed. Friction above the torsion bar is left out of tests with free hands. The "
        "metrics of the battery are means of left and right, which hide what depends on the direction.",
        [Picture(friction_pictures.strips(shares, MATTERS), f"Every real difference of a metric from the base of its "
                 f"factor; dots: the largest. Shaded: below {percent(MATTERS)}.")],
        [case_table("Each case", levels), _metric_table("Every large or perceptible difference",
                                                         [row for rows in factors.values() for row in rows])],
        headline,
    )  # fmt: skip


def _mean_large(rows: Sequence[Effect]) -> float:
    """Share of the compared metrics above ``MATTERS``, mean over the cases [1]."""
    found = [cases.summary(of) for of in cases.by_level(rows).values()]
    return float(np.mean([s.large / s.compared for s in found if s.compared])) if found else 0.0
