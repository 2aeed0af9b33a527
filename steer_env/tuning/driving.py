"""A parameter set driven through the tests of a scenario: the metrics of them all, and the margins of the loop."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from steer_env import metrics
from steer_env.episode.randomise import Conditions, with_level
from steer_env.friction.numerics.thread_pool import one_blas_thread
from steer_env.friction.sites import transmissions
from steer_env.manoeuvres.common.driving import (
    FoundAmplitude,
    OpenLoop,
    build_plant,
    drive_plant,
    open_loops,
    run_beside,
)
from steer_env.metrics import Value
from steer_env.recording.recording import Recording
from steer_env.tuning.context import Reference, measure_context
from steer_env.tuning.scenarios.common.definition import Drive, Scenario
from steer_env.vehicle import layout, plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.steering.eps import Assist
from steer_env.vehicle.steering.margins import Margins, worst_margins


class PreparedDrive(NamedTuple):
    """A drive in a context: what is the same for every parameter set."""

    drive: Drive  # with the context's speed and chassis
    car: Car  # with its load
    plant: Plant  # with the car's own assist
    course: OpenLoop | None  # with which the car's own assist reaches the test's lateral acceleration; None of a driver


class SetResult(NamedTuple):
    """What the tests of a parameter set give."""

    metrics: dict[str, Value]  # by name; those of a run that diverges or spins out are refused
    margins: Margins  # the smallest ones over the speeds of the tests


def adapt_drives(given: Iterable[Drive], chassis: str, drawn: Conditions) -> list[Drive]:
    """Drives with the chassis, and those at the context's speed with that speed."""
    drives = []
    for drive in given:
        m = drive.manoeuvre
        if m.chassis == "single_track":  # otherwise the test needs two tracks
            m = replace(m, chassis=chassis)
        if drive.at_context_speed:
            m = replace(m, speed=drawn.speed)
        drives.append(drive._replace(manoeuvre=m))
    return drives


def prepare_drives(scenario: Scenario, car: Car, chassis: str, drawn: Conditions) -> tuple[PreparedDrive, ...]:
    """The drives in a context, with amplitudes found for the car's own assist.

    Every parameter set is driven with the same handwheel angles, so that sets are compared on one input and a set
    costs one run.

    Raises
    ------
    ValueError
        The car does not reach the lateral acceleration of a test.
    """
    loaded = car.loaded(drawn.load)
    return tuple(prepare_drive(drive, loaded, drawn) for drive in adapt_drives(scenario.drives, chassis, drawn))


def prepare_drive(drive: Drive, loaded: Car, drawn: Conditions) -> PreparedDrive:
    """A drive in a context, with the car that has its load; ValueError as of :func:`prepare_drives`."""
    (found,) = prepare_beside([(drive, loaded, drawn)])
    if isinstance(found, ValueError):
        raise found
    return found


def prepare_beside(
    given: Sequence[tuple[Drive, Car, Conditions]], near: FoundAmplitude | None = None
) -> list[PreparedDrive | ValueError]:
    """:func:`prepare_drive` of a test of up to four cars, which go side by side, or why a car cannot be driven.

    The search for an amplitude begins ``near`` that of a similar car.
    """
    plants: dict[int, Plant] = {}
    found: dict[int, PreparedDrive | ValueError] = {}
    for i, (drive, loaded, drawn) in enumerate(given):
        try:
            plants[i] = build_test(drive, loaded, drawn)
        except ValueError as error:
            found[i] = error
    courses: Iterable[OpenLoop | ValueError | None] = [None] * len(plants)
    if plants and not given[0][0].manoeuvre.driver:
        courses = open_loops([(p, given[i][0].manoeuvre) for i, p in plants.items()], near=near)
    for (i, p), course in zip(plants.items(), courses):
        drive, loaded, _ = given[i]
        found[i] = course if isinstance(course, ValueError) else PreparedDrive(drive, loaded, p, course)
    return [found[i] for i in range(len(given))]


def build_test(drive: Drive, loaded: Car, drawn: Conditions) -> Plant:
    """The plant of a drive in a context, with the car that has its load."""
    return with_level(build_plant(loaded, drive.manoeuvre, drawn.friction, drawn.road_friction), drawn)


def drive_set(drives: tuple[PreparedDrive, ...], assist: Assist) -> SetResult:
    """Drive an assist through the tests; the result does not depend on the number of processors."""
    with one_blas_thread():
        return SetResult(evaluate(drives, assist), margins(drives, assist))


def margins(drives: tuple[PreparedDrive, ...], assist: Assist) -> Margins:
    """The smallest margins of an assist over the speeds of drives."""
    speeds = {each.drive.manoeuvre.speed for each in drives}
    passed = transmissions(drives[0].plant.friction)
    every = [worst_margins(drives[0].car.column, assist, speed, passed) for speed in sorted(speeds)]
    worst = min(every, key=lambda m: m.phase)
    return worst._replace(gain=min(m.gain for m in every), stable=all(m.stable for m in every))


def measure_reference(drives: tuple[PreparedDrive, ...], car: Car, chassis: str, drawn: Conditions) -> Reference:
    """What is the same for every parameter set of a context, whose drives are prepared."""
    with one_blas_thread():
        return Reference(measure_context(car, chassis, drawn), evaluate(drives, car.assist))


def evaluate(drives: tuple[PreparedDrive, ...], assist: Assist) -> dict[str, Value]:
    """Every metric of the drives with an assist, without intervals."""
    found: dict[str, Value] = {}
    for each in drives:
        found |= evaluate_beside([each], [assist])[0]
    return found


def evaluate_beside(prepared: Sequence[PreparedDrive], assists: Sequence[Assist]) -> list[dict[str, Value]]:
    """Every metric of a test of up to four cars, which go side by side, each with an assist, without intervals."""
    plants = [each.plant._replace(assist=assist) for each, assist in zip(prepared, assists)]
    courses = [each.course and _started(each.course, p) for each, p in zip(prepared, plants)]
    ready = [course for course in courses if course]
    if len(ready) > 1:
        u, straight = np.array([each.inputs for each in ready]), [each.straight for each in ready]
        records = run_beside(plants, prepared[0].drive.manoeuvre, u, straight)
        courses = [course._replace(record=record) for course, record in zip(ready, records)]
    return [_metrics(each, p, course) for each, p, course in zip(prepared, plants, courses)]


def _started(course: OpenLoop, p: Plant) -> OpenLoop:
    """A course from the state of a plant, which may have functions that the car's own assist does not have."""
    same = layout.state_size(p) == course.straight.size
    return course if same else course._replace(straight=plant.initial_state(p))


def _metrics(prepared: PreparedDrive, p: Plant, course: OpenLoop | None) -> dict[str, Value]:
    manoeuvre = prepared.drive.manoeuvre
    try:
        recording = drive_plant(prepared.car, p, manoeuvre, course)
    except ValueError as error:
        names = metrics.available(manoeuvre.name)
        return {n: Value(np.nan, np.nan, np.nan, metrics.definition(n).unit, str(error)) for n in names}
    return metrics.evaluate(thin_out(recording, prepared.drive.thinning), intervals=False)


def thin_out(recording: Recording, thinning: int) -> Recording:
    """A recording with one of every ``thinning`` samples."""
    kept = slice(thinning - 1, None, thinning)
    channels = {name: values[kept] for name, values in recording.channels.items()}
    return replace(recording, time=recording.time[kept], channels=channels)
