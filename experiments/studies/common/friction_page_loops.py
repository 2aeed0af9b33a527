"""The second half of the friction study's page: where laws can be told apart, and in which loop."""

import numpy as np

from steer_env.experiments.pages.study_page import Section, Table
from steer_env.experiments.pages.words import label, number, percent, within
from steer_env.experiments.studies.common import friction_cases as cases
from steer_env.experiments.studies.common import friction_records as records
from steer_env.experiments.studies.common.battery import MATTERS
from steer_env.experiments.studies.common.friction_cases import BASE_LAW
from steer_env.experiments.studies.common.friction_distinction import TOLD, experiments
from steer_env.experiments.studies.common.friction_page import case_table, counts, in_words, named
from steer_env.experiments.studies.common.friction_results import Results

BOTH = ("weave", "slow-ramp")  # at 0.2 and at 0.02 Hz


def apart(r: Results) -> Section:
    """Where laws can be told apart with one calibration."""
    remembering = r.remembers()
    told = {name: [law for law in remembering if of[law] > TOLD] for name, of in r.apart.items()}
    titles = {name: each.title for name, each in experiments().items()}
    short = {name: each.short for name, each in experiments().items()}
    where = "; ".join(f"{titles[name]}: {named(laws)}" for name, laws in told.items() if laws)
    alike = [titles[name] for name, laws in told.items() if not laws]
    lasting = [each for each in r.held if each.lasting > 0.9 and each.ripple > 1e-3]
    shaking = sorted({each.law for each in lasting})
    verdict = (
        f"Laws of one calibration differ from {BASE_LAW} by more than {percent(TOLD)} of F_c in: {where or 'none'}."
    )
    if alike:
        verdict += f" They cannot be told apart in: {'; '.join(alike)}."
    groups: dict[tuple[str, ...], list[str]] = {}
    for law in remembering:
        groups.setdefault(tuple(short[name] for name, laws in told.items() if law in laws), []).append(law)
    headline = f"With one calibration, {BASE_LAW} is told from " + "; from ".join(
        f"{named(laws)} in {named(where_)}" if where_ else f"{named(laws)} nowhere" for where_, laws in groups.items()
    )
    headline += f" (by more than {percent(TOLD)} of F_c)."
    vibrate = f"{named(shaking)} {'vibrate' if len(shaking) > 1 else 'vibrates'}" if shaking else "no law vibrates"
    verdict += f" Under a held torque {vibrate} lastingly."
    free = [row for row in r.effects if row.case.factor == cases.LAW and row.test in ("release", "returnability")]
    free = [row for row in free if row.case.level in remembering]
    verdict += f" When the hands let go, the choice among the laws with pre-sliding changes {counts(free)}."
    columns = [law for law in r.laws if law != BASE_LAW]
    rows = [(titles[name], *(percent(of[law], 2) for law in columns)) for name, of in r.apart.items()]
    ripples = {(each.law, each.calibration): 1e3 * each.ripple for each in r.held}
    held = [
        (f"ripple of a held torque, {title} [mN m]", *(number(ripples[law, title], 2) for law in columns))
        for title in dict.fromkeys(each.calibration for each in r.held)
    ]
    return Section(
        "Where laws can be told apart",
        "Laws of one calibration are the same in use.",
        "The same displacement is imposed on every law: the RMS difference of the torque from that of LuGre over the "
        "saturated torque. A held torque is that of the page 'held-torque'.",
        verdict,
        f"The mark of {percent(TOLD)} is three times a noise of 1 % (assumed). A law's own micro-damping or viscous "
        "part adds to the differences at 0.2 and 2 Hz.",
        (),
        [Table("Difference from LuGre over F_c", ("experiment", *columns), [*rows, *held])],
        headline,
    )


def speeds(r: Results) -> Section:
    """0.2 against 0.02 Hz."""
    remembering = set(r.remembers())
    shares: dict[str, dict[str, dict[str, float]]] = {}
    for row in r.effects:
        factor, level = row.case.factor, row.case.level
        counts_here = factor == cases.LEVEL or (factor == cases.LAW and level in remembering)
        if row.test in BOTH and row.found.real and counts_here:
            of = shares.setdefault(row.metric, {}).setdefault(row.test, {})
            of[factor] = max(of.get(factor, 0.0), abs(row.found.share))
    common = {metric: of for metric, of in shares.items() if set(of) == set(BOTH)}
    rows: list[tuple[str, ...]] = []
    ratios: dict[str, list[float]] = {test: [] for test in BOTH}
    for metric, both in common.items():
        cells = [both[test].get(factor, 0.0) for test in BOTH for factor in (cases.LAW, cases.LEVEL)]
        rows.append((label(metric), *(percent(cell, 2) for cell in cells)))
        for test in BOTH:
            ratios[test].append(both[test].get(cases.LAW, 0.0))
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
    every = [row for row in r.effects if row.case.factor == cases.UNASSISTED]
    bare = [row for row in every if row.case.level in remembering]
    assisted = [row for row in r.effects if row.case.factor == cases.LAW and row.case.level in remembering]
    largest = cases.summary(bare).largest
    headline = f"Without assist the choice among the laws with pre-sliding changes {counts(bare)}; with assist, "
    headline += f"{counts(assisted)}."
    most = f" Without assist the largest is the {in_words(largest)}." if largest else ""
    rows, shares = _with_driver(r)
    large = sorted((key for key, share in shares.items() if share > MATTERS), key=lambda key: -shares[key])
    most_of: dict[str, float] = {}
    for key in large:
        most_of.setdefault(key[1], shares[key])  # the largest first
    told = ", ".join(f"{label(metric)} (up to {percent(share, 2)})" for metric, share in most_of.items())
    driver = (
        f"With a driver model in the loop they differ by more than {percent(MATTERS)} in {len(large) or 'none'} of "
        f"{len(remembering) * len(rows)} comparisons{f': {told}' if told else ''}."
    )
    head = ("task", "metric", BASE_LAW, *(f"{law} less {BASE_LAW}" for law in r.laws if law != BASE_LAW))
    episodes = r.scope.episodes
    return Section(
        "Driver and assist in the loop",
        "Assist and driver hide the difference between the laws.",
        f"The battery without assist; and {episodes} episodes of each task with a driver model whose arms hold the "
        "handwheel, with the car's own assist, the same seeds for every law.",
        f"{headline}{most} {driver}",
        "The driver models are not persons. The perception of a driver in the loop is not known.",
        (),
        [
            case_table("Each law without assist, against LuGre without assist", cases.by_level(every)),
            Table(f"Driver in the loop, {episodes} episodes: mean difference by seed ± half the 95 % interval",
                  head, rows, folded=True),
        ],
        f"{headline} {driver}",
    )  # fmt: skip


def _with_driver(r: Results) -> tuple[list[tuple[str, ...]], dict[tuple[str, str, str], float]]:
    """Rows of the table, and the real differences of laws with pre-sliding by task, metric and law, as shares [1]."""
    rows, shares = [], {}
    for task in dict.fromkeys(each.task for each in r.driven):
        mine = {each.law: each.metrics for each in r.driven if each.task == task}
        for metric, base in mine[BASE_LAW].items():
            scale, cells = abs(float(np.mean(base))), []
            for law in r.laws:
                if law == BASE_LAW:
                    continue
                gap, half = cases.paired(mine[law][metric], base)
                cells.append(within(gap, half))
                if law in r.remembers() and not abs(gap) <= half and scale > 0.0:
                    shares[task, metric, law] = abs(gap) / scale
            rows.append((task.removeprefix("steer_env/"), label(metric), number(float(np.mean(base))), *cells))
    return rows, shares


def confusion(r: Results) -> Section:
    """Which law is taken for which on synthetic records."""
    tables, sentences, summaries = [], [], []
    for record in r.scope.records:
        for noise in r.scope.noises:
            table = records.shares(r.confusion, record, noise)
            laws = list(table)
            text = [(truth, *(percent(of[law], 2) for law in laws)) for truth, of in table.items()]
            caption = f"{record}, noise {percent(noise)} of F_c: share of the records for which a law remains"
            tables.append(Table(caption, ("true law", *laws), text, folded=noise != r.scope.noises[0]))
            taken = {truth: [law for law in laws if law != truth and table[truth][law] > 0.5] for truth in laws}
            words = "; ".join(f"{truth} for {named(others)}" for truth, others in taken.items() if others)
            sentences.append(f"{record.capitalize()}, noise {percent(noise)}: {words or 'no law is taken for another'}")
            others = float(np.mean([sum(of.values()) - of[truth] for truth, of in table.items()]))
            own = float(np.mean([table[truth][truth] for truth in laws]))
            summaries.append(
                f"A record of {record} with a noise of {percent(noise)} of F_c leaves {number(others, 2)} of "
                f"{len(laws) - 1} other laws possible on the mean, and the true one in {percent(own, 2)}."
            )
    return Section(
        "Who is told from whom",
        "A record tells which law is the true one.",
        f"Synthetic records of each law, {r.scope.seeds} for each noise; every law is fitted to the first part and "
        "judged on the rest. A law remains where friction.compare cannot tell it from the best one: the 95 % interval "
        "of the difference of their mean squares holds zero, or it leaves at most 2 % more. Taken for another: that "
        "one remains in more than half of the records.",
        ". ".join(sentences) + ".",
        "The records have white noise of the torque only. Laws with a break-away torque have one of 1.4 F_c here. A "
        "law that contains another, as GMS contains Masing and LuGre with a Stribeck curve contains Dahl, remains by "
        "right where the other is the true one.",
        (),
        tables,
        " ".join(summaries),
    )
