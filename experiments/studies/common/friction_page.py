"""The page of the friction study: sentences and tables that follow from the results."""

import math
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from steer_env import friction
from steer_env.experiments.drawing import friction_pictures
from steer_env.experiments.output.words import label, number, percent, within
from steer_env.experiments.studies import real_time
from steer_env.experiments.studies.common import friction_cases as cases
from steer_env.experiments.studies.common import friction_records as records
from steer_env.experiments.studies.common.battery import MATTERS
from steer_env.experiments.studies.common.friction_cases import BASE_LAW, Effect
from steer_env.experiments.studies.common.friction_distinction import TOLD, experiments
from steer_env.experiments.studies.common.friction_results import SAMPLE, SCHEME, Results
from steer_env.experiments.studies.common.page import Picture, Section, Table
from steer_env.recording.recording import DEGREE

BOTH = ("weave", "slow-ramp")  # at 0.2 and at 0.02 Hz


def named(words: Sequence[str]) -> str:
    """A list in words: "a, b and c"."""
    words = list(words)
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words) or "none"


def accuracy(r: Results) -> Section:
    """Which law describes the measured record best."""
    known = r.known()
    best, others = known[0], known[1:]
    seconds = r.record.dt * r.record.x.size
    ranks = "; ".join(f"{each.law} {percent(each.error, 3)}" for each in others)
    ratio = best.error / r.repeatability
    verdict = (
        f"On the measured record {best.law} is the most accurate law: of the mean friction it leaves "
        f"{percent(best.error, 3)} (95 % interval {percent(best.low, 3)} to {percent(best.high, 3)}), "
        f"{number(ratio, 2)} times the {percent(r.repeatability, 2)} by which one period differs from the next. "
        f"The others leave: {ranks}."
    )
    period = round(records.REPEATS / r.record.dt)
    x, F = r.record.x[-period:] / DEGREE, r.record.friction[-period:]
    loops = {
        each.law: (x, friction.response(each.parameters, r.record.x, r.record.dt)[-period:])
        for each in known
        if each.error < 0.5
    }
    rows = [
        (each.law, percent(each.error, 3), f"{percent(each.low, 3)} to {percent(each.high, 3)}",
         percent(each.fitted, 3), number(each.error / r.repeatability, 2), "; ".join(each.remarks) or "–")
        for each in known
    ] + [(each.law, "–", "–", "–", "–", "; ".join(each.remarks)) for each in r.judged if each.parameters is None]  # fmt: skip
    head = ("law", "error, held out", "95 % interval", "error, fitted part", "over repeatability", "remarks of the fit")
    return Section(
        "Which law is more accurate?",
        "A law with more memory describes measured friction better than one with a single bristle.",
        f"Every law is fitted to the first {records.FITTED:g} s of a measured record of {seconds:g} s and judged by the "
        "RMS of what it leaves on the rest, over the mean friction there. The interval is that of the mean over the "
        f"periods of {records.REPEATS:g} s.",
        verdict,
        "The record has one stroke, one speed and one load, and comes from a reciprocating rig, not from a steering "
        "gear. It says nothing of speed, of small strokes after large ones, or of load. It is stretched to the level and "
        "the pre-sliding distance of a column, which changes no error.",
        [Picture(friction_pictures.record_loops((x, F), loops), "The last period of the record, and every law with an "
                 "error below 50 %, which were fitted to other periods.")],
        [Table("Laws on the held-out part of the measured record", head, rows)],
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
    longest = {law: real_time.usable_step(rows, SCHEME) for law, rows in r.tables.items()}
    explicit = {law: real_time.usable_step(rows, "explicit Euler") for law, rows in r.tables.items()}
    steps = f"Longest step with an error of at most {percent(real_time.USABLE)}: {_steps(longest)}; with explicit Euler {_steps(explicit)}."
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
        "Euler, against a reference at a tight tolerance; compiled code of one processor, in one process. Ratios within "
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


def _words(row: Effect) -> str:
    test, level = row.test.replace("-", " "), row.case.level
    return f"{label(row.metric)} in the {test} by {percent(abs(row.found.share), 2)} ({level})"


def _counts(rows: Sequence[Effect]) -> str:
    s = cases.summary(rows)
    return (
        f"{s.large} of {s.compared} metrics by more than {percent(MATTERS)}, and perceptibly {s.noticed} of the {s.known} "
        "for which a threshold of perception is known"
    )


def _case_table(caption: str, of: dict[str, list[Effect]], folded: bool = False) -> Table:
    rows = []
    for name, effects in of.items():
        s = cases.summary(effects)
        largest = _words(s.largest).rpartition(" (")[0] if s.largest else "–"
        rows.append((name, str(s.compared), str(s.large), f"{s.noticed} of {s.known}", largest))
    head = ("case", "metrics compared", f"above {percent(MATTERS)}", "perceptible, of known", "largest share")
    return Table(caption, head, rows, folded=folded)


def _metric_table(caption: str, rows: Sequence[Effect]) -> Table:
    """Every perceptible or large effect, the largest first."""
    kept = sorted((row for row in rows if row.noticed or row.found.matters), key=lambda row: -abs(row.found.share))
    text = [
        (row.test, label(row.metric), row.case.label, number(row.base.value), within(row.found.value, row.found.half_width),
         row.base.unit, percent(row.found.share, 2), str(row.found.perception))
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
        f"changes {_counts(remembering)}"
    )
    largest = cases.summary(remembering).largest
    verdict += f"; most, the {_words(largest)}." if largest else "."
    other = [law for law in levels if law not in r.remembers()]
    for law in other:
        verdict += f" {law} changes {_counts(levels[law])}."
    measured = [row for row in factors.get(cases.MEASURED, []) if row.case.level in r.remembers()]
    if measured:
        verdict += f" With every law calibrated to the measured record it is {_counts(measured)}."
    tables = [_case_table("Each law with the shared calibration, against LuGre", levels)]
    if cases.MEASURED in factors:
        text = "Each law calibrated to the measured record, against LuGre calibrated to it"
        tables.append(_case_table(text, cases.by_level(factors[cases.MEASURED])))
    tables.append(_metric_table("Every large or perceptible difference between laws", factors[cases.LAW]))
    return Section(
        "What the choice of the law changes in the car",
        "The friction law decides how a steering feels.",
        f"The car '{r.car.name}' drives {len(r.scope.tests)} tests of the battery with every law, once with the "
        "calibration that the default laws share (saturated torque, branch after a reversal from saturation) and once "
        "with every law calibrated to the measured record. A difference counts where its 95 % interval excludes zero.",
        verdict,
        "A threshold of perception is known for sustained torques and angles only "
        f"({percent(r.noticed)} of the smaller value). The simulation has no noise, so that the intervals are narrow.",
        (),
        tables,
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
    verdict = (
        f"Share of the metrics that a factor changes by more than {percent(MATTERS)}, mean over its cases: {order}. "
        f"Perceptible differences of sustained torque or angle come from {named(noticed)}."
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
        f"One factor at a time against {BASE_LAW} with the shared calibration: level by a third, pre-sliding distance and "
        "micro-damping within their assumed ranges, step length, friction above the torsion bar in place of below it, "
        "and the part of the friction that grows with the rack force.",
        verdict,
        "One factor at a time shows no interaction. Ranges differ: those of level are measured, those of pre-sliding "
        "distance and micro-damping assumed. Friction above the torsion bar is left out of tests with free hands.",
        [Picture(friction_pictures.strips(shares, MATTERS), f"Every real difference of a metric from the base of its "
                 f"factor; dots: the largest. Shaded: below {percent(MATTERS)}.")],
        [_case_table("Each case", levels), _metric_table("Every large or perceptible difference",
                                                         [row for rows in factors.values() for row in rows])],
    )  # fmt: skip


def _mean_large(rows: Sequence[Effect]) -> float:
    """Share of the compared metrics above ``MATTERS``, mean over the cases [1]."""
    found = [cases.summary(of) for of in cases.by_level(rows).values()]
    return float(np.mean([s.large / s.compared for s in found if s.compared])) if found else 0.0


def apart(r: Results) -> Section:
    """Where laws can be told apart with one calibration."""
    remembering = r.remembers()
    told = {name: [law for law in remembering if of[law] > TOLD] for name, of in r.apart.items()}
    titles = {name: each.title for name, each in experiments().items()}
    where = "; ".join(f"{titles[name]}: {named(laws)}" for name, laws in told.items() if laws)
    alike = [titles[name] for name, laws in told.items() if not laws]
    lasting = [each for each in r.held if each.lasting > 0.9 and each.ripple > 1e-3]
    shaking = sorted({each.law for each in lasting})
    verdict = (
        f"Laws of one calibration differ from {BASE_LAW} by more than {percent(TOLD)} of F_c in: {where or 'none'}."
    )
    if alike:
        verdict += f" They cannot be told apart in: {'; '.join(alike)}."
    verdict += f" Under a held torque {named(shaking)} {'vibrate' if len(shaking) > 1 else 'vibrates'} lastingly."
    free = [row for row in r.effects if row.case.factor == cases.LAW and row.test in ("release", "returnability")]
    free = [row for row in free if row.case.level in remembering]
    verdict += f" When the hands let go, the choice among the laws with pre-sliding changes {_counts(free)}."
    columns = [law for law in r.laws if law != BASE_LAW]
    rows = [(titles[name], *(percent(of[law], 2) for law in columns)) for name, of in r.apart.items()]
    held = [
        (f"ripple of a held torque, {title} [mN m]",
         *(number(1e3 * next(e.ripple for e in r.held if (e.law, e.calibration) == (law, title)), 2) for law in columns))
        for title in dict.fromkeys(each.calibration for each in r.held)
    ]  # fmt: skip
    return Section(
        "Where laws can be told apart",
        "Laws of one calibration are the same in use.",
        "The same displacement is imposed on every law: the RMS difference of the torque from that of LuGre over the "
        "saturated torque. A held torque is that of the page 'held-torque'.",
        verdict,
        f"The mark of {percent(TOLD)} is three times a noise of 1 % (assumed). A law's own micro-damping or viscous part "
        "adds to the differences at 0.2 and 2 Hz.",
        (),
        [Table("Difference from LuGre over F_c", ("experiment", *columns), [*rows, *held])],
    )


def speeds(r: Results) -> Section:
    """0.2 against 0.02 Hz."""
    remembering = set(r.remembers())
    shares: dict[str, dict[str, dict[str, float]]] = {}
    for row in r.effects:
        if row.test in BOTH and row.found.real and row.case.factor in (cases.LAW, cases.LEVEL):
            if row.case.factor == cases.LEVEL or row.case.level in remembering:
                of = shares.setdefault(row.metric, {}).setdefault(row.test, {})
                of[row.case.factor] = max(of.get(row.case.factor, 0.0), abs(row.found.share))
    common = {metric: of for metric, of in shares.items() if set(of) == set(BOTH)}
    rows, ratios = [], {test: [] for test in BOTH}
    for metric, of in common.items():
        cells = [of[test].get(factor, 0.0) for test in BOTH for factor in (cases.LAW, cases.LEVEL)]
        rows.append((label(metric), *(percent(cell, 2) for cell in cells)))
        for test in BOTH:
            ratios[test].append(of[test].get(cases.LAW, 0.0))
    most = {test: max(values, default=0.0) for test, values in ratios.items()}
    more = "more" if most[BOTH[1]] > most[BOTH[0]] else "less"
    verdict = (
        f"At 0.02 Hz the laws with pre-sliding differ {more} than at 0.2 Hz: by up to {percent(most[BOTH[1]], 2)} of a "
        f"metric against {percent(most[BOTH[0]], 2)}, over the {len(rows)} metrics that both tests have."
    )
    head = ("metric", "law, 0.2 Hz", "level, 0.2 Hz", "law, 0.02 Hz", "level, 0.02 Hz")
    return Section(
        "0.2 against 0.02 Hz",
        "The slow ramp shows friction better than the weave.",
        "The largest share by which a law with pre-sliding, and a third more or less friction, changes a metric in the "
        "weave (0.2 Hz, 100 km/h) and in the slow ramp (0.02 Hz, 50 km/h).",
        verdict,
        "The two tests differ in speed, too. 'steer-env study loop-width' separates friction from vehicle lag.",
        (),
        [Table("Largest change of a metric", head, rows)],
    )


def in_loop(r: Results) -> Section:
    """Driver and assist in the loop."""
    remembering = r.remembers()
    bare = [row for row in r.effects if row.case.factor == cases.UNASSISTED and row.case.level in remembering]
    assisted = [row for row in r.effects if row.case.factor == cases.LAW and row.case.level in remembering]
    largest = cases.summary(bare).largest
    verdict = (
        f"Without assist the choice among the laws with pre-sliding changes {_counts(bare)} (with assist: "
        f"{_counts(assisted)})"
    )
    verdict += f"; most, the {_words(largest)}. " if largest else ". "
    rows, shares = [], {}
    for task in dict.fromkeys(each.task for each in r.driven):
        mine = {each.law: each.metrics for each in r.driven if each.task == task}
        for metric, base in mine[BASE_LAW].items():
            cells = []
            for law in r.laws:
                if law == BASE_LAW:
                    continue
                gap, half = cases.paired(mine[law][metric], base)
                cells.append(within(gap, half))
                scale = abs(float(np.mean(base)))
                if law in remembering and not abs(gap) <= half and scale > 0.0:
                    shares[task, metric, law] = abs(gap) / scale
            rows.append((task.removeprefix("steer_env/"), label(metric), number(float(np.mean(base))), *cells))
    large = [key for key, share in shares.items() if share > MATTERS]
    verdict += f"With a driver model in the loop they differ by more than {percent(MATTERS)} in "
    told = "; ".join(
        f"{label(key[1])} ({key[2]}, {percent(shares[key], 2)})" for key in sorted(large, key=lambda k: -shares[k])[:3]
    )
    verdict += f"{len(large)} of {len(remembering) * len(rows)} comparisons{f', most in {told}' if told else ''}."
    head = ("task", "metric", BASE_LAW, *(f"{law} less {BASE_LAW}" for law in r.laws if law != BASE_LAW))
    return Section(
        "Driver and assist in the loop",
        "Assist and driver hide the difference between the laws.",
        f"The battery without assist; and {r.scope.episodes} episodes of each task with a driver model whose arms hold "
        "the handwheel, with the car's own assist, the same seeds for every law.",
        verdict,
        "The driver models are not persons. The perception of a driver in the loop is not known.",
        (),
        [
            _case_table("Each law without assist, against LuGre without assist",
                        cases.by_level([row for row in r.effects if row.case.factor == cases.UNASSISTED])),
            Table(f"Driver in the loop: mean difference by seed ± half the 95 % interval, {r.scope.episodes} episodes",
                  head, rows, folded=True),
        ],
    )  # fmt: skip


def confusion(r: Results) -> Section:
    """Which law is taken for which on synthetic records."""
    tables, sentences = [], []
    for record in records.RECORDS:
        for noise in r.scope.noises:
            table = records.shares(r.confusion, record, noise)
            laws = list(table)
            text = [(truth, *(percent(of[law], 2) for law in laws)) for truth, of in table.items()]
            caption = f"{record}, noise {percent(noise)} of F_c: share of the records for which a law remains"
            tables.append(Table(caption, ("true law", *laws), text, folded=noise != r.scope.noises[0]))
            taken = [f"{truth} for {law}" for truth in laws for law in laws if truth != law and table[truth][law] > 0.5]
            sentences.append(f"{record}, noise {percent(noise)}: {'; '.join(taken) or 'no law is taken for another'}")
    return Section(
        "Who is told from whom",
        "A record tells which law is the true one.",
        f"Synthetic records of each law, {r.scope.seeds} for each noise; every law is fitted to the first part and judged "
        "on the rest. A law remains where it is not worse than the best one by more than the 95 % interval of their "
        "difference in blocks of a second. Taken for another: it remains in more than half of the records.",
        ". ".join(sentences) + ".",
        "The records have white noise of the torque only. Laws with a break-away torque have one of 1.4 F_c here.",
        (),
        tables,
    )
