"""The comparison of LuGre and Masing under a held torque (JSME D&D 2021, paper 557), repeated, and its cause.

:mod:`steer_env.experiments.studies.friction_laws` has the tests; this study adds every other law and writes the page.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from steer_env import friction
from steer_env.experiments.pages import car_options, pages, pictures
from steer_env.experiments.pages.options import progress
from steer_env.experiments.pages.words import number, percent
from steer_env.experiments.studies import friction_laws
from steer_env.experiments.studies.common.scaling import check, scale_record
from steer_env.experiments.studies.friction_laws import (
    ASSIST,
    CALIBRATIONS,
    DAMPING_RATIOS,
    HELD_LAWS,
    HeldTest,
    Verdict,
)
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.defaults import F_C, SIGMA_0
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME

PAGE_NAME = "held-torque"
LASTS = 0.9  # part of the ripple's first second that is left in its last, from which on a vibration lasts [1]
SMOOTH = 2.0  # ripple of Masing over that of LuGre from which on the first vibrates and the second does not; assumed
STEP_EFFECT = 0.05  # change of the ripple with a tenth of the step up to which the step is not its cause, assumed [1]
RIPPLE_HEAD = ("assist", "calibration", "Masing", "LuGre", "Masing, damped", "LuGre, damped", "removed by the damper")


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
        p = scale_record(friction.make(law), calibration.F_c / F_C, distance)
        found.append(Ripple(law, calibration.title, *friction_laws.ripple(friction_laws.torsion_bar(car, p))))
    return found


def _case(job: tuple[str, Car, str]) -> Any:
    kind, car, law = job
    return friction_laws.held_torque(car, law) if kind == "damped" else of_every_law(car, law)


class Results(NamedTuple):
    """All tests."""

    tests: list[HeldTest]  # LuGre and Masing with every damper
    laws: list[Ripple]  # every law as it is


def collect(car: Car, laws: Sequence[str], sweep: Runner = run, notify: Any = lambda *_: None) -> Results:
    """All tests of a car as a sweep; ValueError for a law that declares no units."""
    check(map(friction.make, laws))
    jobs = [("damped", car, law) for law in HELD_LAWS] + [("every", car, law) for law in laws]
    found = sweep(_case, jobs, notify=notify, words=lambda job: job[2])
    tests, ripples = found[: len(HELD_LAWS)], found[len(HELD_LAWS) :]
    return Results([test for of in tests for test in of], [each for of in ripples for each in of])


class Compared(NamedTuple):
    """What the tests say of LuGre and Masing, and of the other laws."""

    bare: HeldTest  # undamped Masing in the case with its largest ripple
    smooth: HeldTest  # undamped LuGre there
    frequency: float  # of the vibration there [Hz]
    removed: float  # least share of the difference that the heavier damper removes [1]
    cases: int  # with the heavier damper
    light: int  # with the lighter damper
    fed: list[Verdict]  # cases in which the lighter damper does not end the vibration
    unassisted_lasting: float  # part of the undamped ripple that lasts without assist, the largest [1]
    step_change: float  # largest change of a ripple with a tenth of the step [1]
    shaking: list[Ripple]  # laws that vibrate as they are

    @property
    def vibrates(self) -> bool:
        """Whether Masing vibrates where LuGre does not."""
        return self.bare.ripple > SMOOTH * self.smooth.ripple

    @property
    def damper_is_cause(self) -> bool:
        """Whether the same damper removes the difference in every case."""
        return self.removed > LASTS

    @property
    def step_is_small(self) -> bool:
        """Whether the step of integration is not the cause."""
        return self.step_change < STEP_EFFECT


def compare(results: Results) -> Compared:
    """The comparison of LuGre and Masing."""
    light, heavy = (friction_laws.verdicts(results.tests, ratio) for ratio in DAMPING_RATIOS[1:])
    worst = max(light, key=lambda verdict: verdict.masing.ripple)
    large = [test for test in results.tests if test.ripple > 1e-4]  # below, rounding and the tail of a decay count
    return Compared(
        bare=worst.masing,
        smooth=worst.lugre,
        frequency=friction_laws.ringing(worst.masing.torque),
        removed=min(verdict.share_of_damper for verdict in heavy),
        cases=len(heavy),
        light=len(light),
        fed=[verdict for verdict in light if verdict.masing_damped.lasting > LASTS],
        unassisted_lasting=max(verdict.masing.lasting for verdict in light if verdict.masing.assist == "off"),
        step_change=max((abs(test.ripple_fine / test.ripple - 1.0) for test in large), default=0.0),
        shaking=[each for each in results.laws if each.lasting > LASTS and each.ripple > 1e-3],
    )


def _damping(results: Results, ratio: float) -> list[tuple[str, ...]]:
    rows = []
    for verdict in friction_laws.verdicts(results.tests, ratio):
        four = (verdict.masing, verdict.lugre, verdict.masing_damped, verdict.lugre_damped)
        row = [number(1e3 * test.ripple, 3) for test in four]
        share = percent(verdict.share_of_damper, 3)
        rows.append((ASSIST[verdict.masing.assist], verdict.masing.calibration, *row, share))
    return rows


def build_page(results: Results, car: str) -> tuple[pages.Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    thin, c = friction_laws.THINNING * SAMPLE_TIME, compare(results)
    first = [
        test
        for test in results.tests
        if (test.assist, test.calibration) == (c.bare.assist, c.bare.calibration)
        and test.damping_ratio in (DAMPING_RATIOS[0], DAMPING_RATIOS[-1])
    ]
    values = {
        "car": car,
        "study": friction_laws,
        "ratios": DAMPING_RATIOS,
        "c": c,
        "first": pictures.held_torque(first, thin, friction_laws.SETTLING),
        "ripple_head": RIPPLE_HEAD,
        "pictures": {
            words: pictures.held_torque(
                [test for test in results.tests if test.assist == state], thin, friction_laws.SETTLING
            )
            for state, words in ASSIST.items()
        },
        "damping": {ratio: _damping(results, ratio) for ratio in DAMPING_RATIOS[1:]},
        "laws": [(e.law, e.calibration, number(1e3 * e.ripple, 3), percent(e.lasting, 3)) for e in results.laws],
    }
    data = {
        "tests": [{key: value for key, value in test._asdict().items() if key != "torque"} for test in results.tests],
        "laws": [each._asdict() for each in results.laws],
        "units": {"ripple": "N m", "ripple_fine": "N m"},
    }
    return pages.Page(PAGE_NAME, values), data


def main(argv: Sequence[str] | None = None, sweep: Runner = run, car: Car | None = None) -> None:
    """Repeat the held-torque comparison of LuGre and Masing with every law, and write a page."""
    parser = pages.parser(PAGE_NAME, main.__doc__)
    car_options.add(parser)
    args = parser.parse_args(argv)
    pages.check(args.out, PAGE_NAME)
    car, laws = car or car_options.load(args), list(friction.available())
    with progress("driving") as notify:
        results = collect(car, laws, sweep, notify)
    found, data = build_page(results, car.name)
    print("\n".join(found.verdict))
    trace = pages.study_trace(PAGE_NAME, argv, args.out, car=car, friction={law: friction.make(law) for law in laws})
    print(pages.write(args.out, found, data, trace))
