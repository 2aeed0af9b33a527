"""The comparison of LuGre and Masing under a held torque (JSME D&D 2021, paper 557), repeated, and its cause.

:mod:`steer_env.experiments.studies.friction_laws` has the tests; this study adds every other law and writes the page.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from steer_env import friction
from steer_env.experiments.pages import car_options, pictures
from steer_env.experiments.pages import study_page as page
from steer_env.experiments.pages.options import progress
from steer_env.experiments.pages.words import number, percent
from steer_env.experiments.studies import friction_laws
from steer_env.experiments.studies.common.scaling import scaled
from steer_env.experiments.studies.friction_laws import ASSIST, CALIBRATIONS, DAMPING_RATIOS, HELD_LAWS, Held, Verdict
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.defaults import F_C, SIGMA_0
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME

NAME = "held-torque"
LASTS = 0.9  # part of the ripple's first second that is left in its last, from which on a vibration lasts [1]
SMOOTH = 2.0  # ripple of Masing over that of LuGre from which on the first vibrates and the second does not; assumed
STEP = 0.05  # change of the ripple with a tenth of the step up to which the step is not its cause, assumed [1]
# What a prototype of the project gave, N m: Masing and LuGre without micro-damping, and with damping ratio 0.1 in both.
PROTOTYPE = (0.114, 0.029, 0.006, 0.002)


class Ripple(NamedTuple):
    """Ripple of a held torque with one law as it is, with assist."""

    law: str
    calibration: str
    ripple: float  # peak to peak of the torsion-bar torque from 2 s into the hold [N m]
    lasting: float  # its part that is left in the last second, over the first [1]


def of_every_law(car: Car, law: str) -> list[Ripple]:
    """Ripple with one law's own damping, at both calibrations."""
    found = []
    for calibration in CALIBRATIONS:
        distance = calibration.F_c / calibration.sigma_0 / (F_C / SIGMA_0)
        p = scaled(friction.make(law), calibration.F_c / F_C, distance)
        found.append(Ripple(law, calibration.title, *friction_laws.ripple(friction_laws.torsion_bar(car, p))))
    return found


def _case(job: tuple[str, Car, str]) -> Any:
    kind, car, law = job
    return friction_laws.held_torque(car, law) if kind == "damped" else of_every_law(car, law)


class Results(NamedTuple):
    """All tests."""

    tests: list[Held]  # LuGre and Masing with every damper
    laws: list[Ripple]  # every law as it is


def collect(car: Car, laws: Sequence[str], sweep: Runner = run, notify: Any = lambda *_: None) -> Results:
    """All tests of a car as a sweep."""
    jobs = [("damped", car, law) for law in HELD_LAWS] + [("every", car, law) for law in laws]
    found = sweep(_case, jobs, notify=notify, words=lambda job: job[2])
    tests, ripples = found[: len(HELD_LAWS)], found[len(HELD_LAWS) :]
    return Results([test for of in tests for test in of], [each for of in ripples for each in of])


def sentences(results: Results) -> list[str]:
    """The verdict in sentences."""
    light, heavy = (friction_laws.verdicts(results.tests, ratio) for ratio in DAMPING_RATIOS[1:])
    worst = max(light, key=lambda verdict: verdict.masing.ripple)
    bare, smooth = worst.masing, worst.lugre
    vibrates = bare.ripple > SMOOTH * smooth.ripple
    first = (
        f"Under a held torque of {friction_laws.HELD_TORQUE:g} N m, undamped Masing friction "
        f"{'vibrates' if vibrates else 'does not vibrate'}: its torsion-bar torque has a ripple of "
        f"{_mnm(bare.ripple)} at {number(friction_laws.ringing(bare.torque), 2)} Hz, undamped LuGre's one of "
        f"{_mnm(smooth.ripple)} ({ASSIST[bare.assist]}, {bare.calibration})."
    )
    removed = [verdict.share_of_damper for verdict in heavy]
    cause = (
        "The cause is the missing damper, not the law" if min(removed) > LASTS else "The damper is not the whole cause"
    )
    second = (
        f"{cause}: the same micro-damper of ratio {DAMPING_RATIOS[-1]:g} in both laws removes "
        f"{percent(min(removed), 3)} or more of their difference in all {len(heavy)} cases."
    )
    return [first, second, _fed(light), _step(results.tests), _every_law(results.laws)]


def _mnm(torque: float) -> str:
    return f"{number(1e3 * torque, 3)} mN m"


def _fed(light: Sequence[Verdict]) -> str:
    """What the lighter damper does, and what the assist has to do with it."""
    fed = [verdict for verdict in light if verdict.masing_damped.lasting > LASTS]
    text = f"A damper of ratio {DAMPING_RATIOS[1]:g} in both laws "
    if not fed:
        return f"{text}ends the vibration in all {len(light)} cases."
    where = "; ".join(f"{ASSIST[verdict.masing.assist]}, {verdict.masing.calibration}" for verdict in fed)
    unassisted = [verdict for verdict in light if verdict.masing.assist == "off"]
    lasting = max(verdict.masing.lasting for verdict in unassisted)
    return (
        f"{text}is not enough in {len(fed)} of {len(light)} cases ({where}), where the assist feeds the vibration: "
        f"without assist the undamped ripple of the last second is {percent(lasting, 2)} or less of that of the first."
    )


def _step(tests: Sequence[Held]) -> str:
    large = [test for test in tests if test.ripple > 1e-4]  # below, rounding and the tail of a decay count
    worst = max((abs(test.ripple_fine / test.ripple - 1.0) for test in large), default=0.0)
    cause = "is not the cause" if worst < STEP else "has a part in it"
    return f"The step of integration {cause}: a tenth of it changes the ripple by {percent(worst, 2)} at most."


def _every_law(laws: Sequence[Ripple]) -> str:
    shaking = [f"{each.law} ({each.calibration})" for each in laws if each.lasting > LASTS and each.ripple > 1e-3]
    if not shaking:
        return "With its usual damping no other law vibrates for long."
    named = ", ".join(shaking)
    return f"As they are by default, with assist, these laws vibrate for as long as the torque is held: {named}."


def _damping_table(results: Results, ratio: float) -> page.Table:
    rows = []
    for verdict in friction_laws.verdicts(results.tests, ratio):
        four = (verdict.masing, verdict.lugre, verdict.masing_damped, verdict.lugre_damped)
        row = [number(1e3 * test.ripple, 3) for test in four]
        share = percent(verdict.share_of_damper, 3)
        rows.append((ASSIST[verdict.masing.assist], verdict.masing.calibration, *row, share))
    head = ("assist", "calibration", "Masing", "LuGre", "Masing, damped", "LuGre, damped", "removed by the damper")
    note = (
        f"The prototype of the project gave {', '.join(number(1e3 * x) for x in PROTOTYPE)} mN m in these four columns "
        "(strong friction, damping ratio 0.1), on a column with other assist."
    )
    return page.Table(f"Ripple [mN m], damping ratio {ratio:g}", head, rows, note)


def _law_table(laws: Sequence[Ripple]) -> page.Table:
    rows = [(each.law, each.calibration, number(1e3 * each.ripple, 3), percent(each.lasting, 3)) for each in laws]
    note = (
        "Part that lasts: ripple of the last second over that of the second that begins 2 s into the hold. A law that "
        "creeps has a torque that drifts, which counts as ripple."
    )
    head = ("law", "calibration", "ripple [mN m]", "part that lasts")
    return page.Table("Every law with its default damping, assist on", head, rows, note)


def build(results: Results, car: str) -> tuple[page.Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    shown = [
        page.Picture(
            pictures.held_torque(
                [test for test in results.tests if test.assist == state],
                friction_laws.THIN * SAMPLE_TIME,
                friction_laws.SETTLING,
            ),
            f"Torsion-bar torque during the hold, less its final mean, {words}. The ripple is read in the grey part.",
        )
        for state, words in ASSIST.items()
    ]
    verdict = sentences(results)
    main_section = page.Section(
        "LuGre and Masing",
        "Under held steering the torque of Masing friction vibrates at a high frequency, and that of LuGre is smooth "
        "(abstract of the paper; its parameters are not public).",
        f"The hand torque of the car '{car}' rises to {friction_laws.HELD_TORQUE:g} N m in 0.5 s at 50 km/h and is "
        "held for 5 s, with both laws at the same saturated torque and the same branch after a reversal, with and "
        "without the same micro-damper, with and without assist, and once more at a tenth of the step.",
        " ".join(verdict[:4]),
        "The paper's car, assist and parameters are not known; the conditions are the project's. A hand torque that is "
        "prescribed has no arms on the handwheel, which would damp the vibration.",
        shown,
        [_damping_table(results, ratio) for ratio in DAMPING_RATIOS[1:]],
    )
    others = page.Section(
        "The other laws",
        "Whether a law vibrates is a property of the law.",
        "The same test with the assist on and every law of the project at both calibrations, with the damping that it "
        "has by default.",
        verdict[4],
        "A law's default micro-damping differs between laws; only the first section gives the same damper to both.",
        (),
        [_law_table(results.laws)],
    )
    data = {
        "tests": [{key: value for key, value in test._asdict().items() if key != "torque"} for test in results.tests],
        "laws": [each._asdict() for each in results.laws],
        "prototype": list(PROTOTYPE),
        "units": {"ripple": "N m", "ripple_fine": "N m", "prototype": "N m"},
    }
    lead = (
        "Japan Society of Mechanical Engineers, Dynamics and Design Conference 2021, paper 557 (abstract), compares "
        "LuGre and Masing friction in a steering model under a held torque."
    )
    return page.Page(NAME, "Held torque: does Masing friction vibrate?", lead, verdict, [main_section, others]), data


def main(argv: Sequence[str] | None = None, sweep: Runner = run, car: Car | None = None) -> None:
    """Repeat the held-torque comparison of LuGre and Masing with every law, and write a page."""
    parser = page.parser(NAME, main.__doc__)
    car_options.add(parser)
    args = parser.parse_args(argv)
    page.check(args.out, NAME)
    car, laws = car or car_options.load(args), list(friction.available())
    with progress("driving") as notify:
        results = collect(car, laws, sweep, notify)
    found, data = build(results, car.name)
    print("\n".join(found.verdict))
    trace = page.trace_of(NAME, argv, args.out, car=car, friction={law: friction.make(law) for law in laws})
    print(page.write(args.out, found, data, trace))
