"""Everything that the friction study rests on, computed as sweeps of cases; no text or picture is made here."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from steer_env import friction
from steer_env.experiments.studies import friction_laws, held_torque, real_time
from steer_env.experiments.studies.common import (
    battery,
    computing_time,
    friction_cases,
    friction_distinction,
    friction_records,
    scaling,
)
from steer_env.experiments.studies.common.computing_time import Times
from steer_env.experiments.studies.common.friction_cases import (
    BASE_LAW,
    DRIVER_TASKS,
    SERVO_TASKS,
    Case,
    DriverEpisodes,
    Effect,
)
from steer_env.experiments.studies.common.friction_records import Confusion, Judged
from steer_env.experiments.studies.held_torque import Ripple
from steer_env.experiments.sweep import Runner, run
from steer_env.hand_torque import Identified
from steer_env.metrics.common import just_noticeable
from steer_env.recording.friction_record import FrictionRecord
from steer_env.vehicle.cars import Car

Notify = Callable[[float, str], None]


class Scope(NamedTuple):
    """Extent of the study."""

    tests: tuple[str, ...]
    steps: tuple[float, ...]  # of the column alone [s]
    records: tuple[str, ...]  # kinds of synthetic records, of ``friction_records.RECORDS``
    noises: tuple[float, ...]  # of the synthetic records, over F_c [1]
    seeds: int  # synthetic records of each law and noise
    episodes: int  # with a driver, of each law and task


_ONE_STROKE, _MANY_STROKES = friction_records.RECORDS
QUICK_SCOPE = Scope(("weave", "slow-ramp", "release"), (1e-4, 1e-3, 2e-3, 5e-3), (_MANY_STROKES,), (0.01,), 1, 2)


def full() -> Scope:
    """The whole study: every test of the battery except the rig, which has neither car nor road."""
    tests = tuple(name for name in battery.SCRIPTED if name != "rig")
    return Scope(tests, real_time.STEP_LENGTHS, (_ONE_STROKE, _MANY_STROKES), friction_records.NOISES, 10, 12)


class Job(NamedTuple):
    """A part of the study that a worker computes."""

    kind: str  # of ``_JOB_FUNCTIONS``
    of: str  # in words
    arguments: tuple[Any, ...]


_JOB_FUNCTIONS: Mapping[str, Callable[[Any], Any]] = {
    "record": friction_records.judge,
    "road": friction_records.judge_on_road,
    "steps": lambda job: real_time.accuracy(*job),
    "battery": friction_cases.drives,
    "held torque": lambda job: held_torque.of_every_law(*job),
    "driver": friction_cases.with_driver,
    "confusion": friction_records.confuse,
}


def perform(job: Job) -> Any:
    """The result of one job."""
    return _JOB_FUNCTIONS[job.kind](job.arguments)


class Results(NamedTuple):
    """All numbers of the study."""

    car: Car
    scope: Scope
    noticed: float  # just-noticeable difference of sustained torque and angle [1]
    laws: dict[str, Any]  # name -> parameters of the calibration that the defaults share
    record: FrictionRecord
    judged: list[Judged]  # the best first, those without a fit last
    repeatability: float  # of the record [1]
    road: Identified  # the hand torque of a drive
    tables: dict[str, list[real_time.SchemeRow]]  # of the column alone
    times: Times
    cases: list[Case]
    effects: list[Effect]
    apart: dict[str, dict[str, float]]  # experiment -> law -> difference from the base law [1]
    held: list[Ripple]
    driven: list[DriverEpisodes]
    confusion: list[Confusion]

    def remembers(self) -> list[str]:
        """The dry laws whose torque does not jump where motion begins, without the base law."""
        return [
            law
            for law, p in self.laws.items()
            if law != BASE_LAW and friction_laws.dry(p) and not friction_laws.set_valued(p)
        ]

    def known(self) -> list[Judged]:
        """The laws that could be fitted to the record."""
        return [each for each in self.judged if each.parameters is not None]


def _words(job: Job) -> str:
    return f"{job.kind}, {job.of}"


def collect(
    car: Car,
    scope: Scope,
    noticed: float = just_noticeable.SHARE,
    sweep: Runner = run,
    notify: Notify = lambda *_: None,
) -> Results:
    """Run everything; times are taken at the end in this process, when no worker runs."""
    laws = {name: friction.make(name) for name in sorted(friction.available(), key=lambda name: name != BASE_LAW)}
    scaling.check(laws.values())
    record = friction_records.rig()
    fittable = friction_records.fittable(list(laws))

    def swept(jobs: list[Job], start: float, end: float) -> list[Any]:
        return sweep(perform, jobs, notify=lambda part, of: notify(start + (end - start) * part, of), words=_words)

    first = [Job("record", "laws", (record, fittable)), Job("road", "laws", tuple(laws))]
    first += [Job("steps", law, (p, scope.steps)) for law, p in laws.items()]
    judged, road, *tables = swept(first, 0.0, 0.15)
    measured = {each.law: each.parameters for each in judged if _usable(each)}
    cases = friction_cases.cases(laws, measured)
    true = friction_records.true_laws(fittable)
    jobs = [Job("battery", case.label, (car, case, scope.tests)) for case in cases]
    jobs += [Job("held torque", law, (car, law)) for law in laws]
    jobs += [
        Job("driver", f"{law}, {task}", (law, p, task, scope.episodes))
        for task in (*DRIVER_TASKS, *SERVO_TASKS)
        for law, p in laws.items()
    ]
    jobs += [
        Job("confusion", f"{truth}, {record_of}, noise {noise:g}", (record_of, true, truth, noise, seed))
        for record_of in scope.records
        for noise in scope.noises
        for truth in true
        for seed in range(scope.seeds)
    ]
    later = swept(jobs, 0.15, 0.9)
    of_kind = {kind: [result for job, result in zip(jobs, later) if job.kind == kind] for kind in _JOB_FUNCTIONS}
    return Results(
        car=car,
        scope=scope,
        noticed=noticed,
        laws=laws,
        record=record,
        judged=judged,
        repeatability=friction_records.repeatability(record),
        road=road,
        tables=dict(zip(laws, tables)),
        times=computing_time.of_laws(laws, car, lambda part: notify(0.9 + 0.08 * part, "timing")),
        cases=cases,
        effects=friction_cases.effects(cases, of_kind["battery"], noticed),
        apart=friction_distinction.differences(laws, BASE_LAW),
        held=[each for of in of_kind["held torque"] for each in of],
        driven=of_kind["driver"],
        confusion=of_kind["confusion"],
    )


def _usable(each: Judged) -> bool:
    """Whether a law could be fitted and is dry; a parameter that the record leaves open is without effect or zero."""
    return each.parameters is not None and friction_laws.dry(each.parameters)
