"""What a user has to know about an estimate: the warnings of a fit. All numbers are in the units of the record."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.determined import FLOOR, Estimate, half_widths
from steer_env.friction.identification.problem import Optimum, Problem
from steer_env.friction.identification.quality import DRIFT, MATTERS, clipped
from steer_env.friction.identification.scales import scaled
from steer_env.friction.identification.space import EDGE, Space, sought_parameters
from steer_env.friction.law import Law
from steer_env.friction.level import Level

if TYPE_CHECKING:
    from steer_env.friction.identification.fit import Fit, Prepared

UNLIKE = 1.5  # residual over the record's own noise, of a law that does not describe it [1] ...
DOMINANT = 0.1  # noise of x, of the length over which the torque follows a reversal [1]
FEWEST_STEPS_IN_REVERSAL = 5.0  # steps between samples, within which the torque follows a reversal [1]
# Cosines that a zero may wander along, of half a period to three in the record; one for two branches at most
WANDERING_COSINES = 6
WANDERS = 0.5  # of the sum of squares, that they must leave less than; assumed [1]
CERTAIN_RATIO = 2.0  # drift, or fall with the load, over half its interval [1]
DIFFERENCE = 1e-4  # of the level, for its derivative by the load [1]


def remarks(found: "Fit", ready: "Prepared", law: Law, optimum: Optimum) -> tuple[str, ...]:
    """All warnings of a fit, in whole sentences; ``optimum`` is in the record's scales."""
    return (
        *_undetermined(found, ready, law),
        *_bounds(found, ready, law),
        *_misfit(found, ready),
        *_memory(found, ready, law),
        *_sensors(ready, optimum),
    )


def _undetermined(found: "Fit", ready: "Prepared", law: Law) -> list[str]:
    values = [f"{name} = {getattr(found.parameters, name):g}" for name in found.undetermined]
    if not values:
        return []
    text = f"the record does not determine {', '.join(values)}: kept at these values; "
    texts = [text + "record several speeds and wider loops"]
    step = float(np.median(np.abs(np.diff(ready.record.x))))
    if (
        any(law.units[name] == "N m/rad" for name in found.undetermined)
        and ready.scales.displacement < FEWEST_STEPS_IN_REVERSAL * step
    ):
        texts.append(
            f"the torque follows a reversal within about a step of x between samples ({step:g}), so its stiffness "
            "has only a lower bound: sample faster or move slower"
        )
    return texts


def _bounds(found: "Fit", ready: "Prepared", law: Law) -> list[str]:
    """What ends where the search does or the law allows no more; zero is no such end, but a value like another."""
    scales, values = ready.scales, found.parameters._asdict()
    free = {*found.intervals, *found.undetermined}
    held = {name: value for name, value in scaled(law, values, scales).items() if name not in free}
    space = Space(law, sought_parameters(law, held), held, {}, np.empty(0), np.empty(0))
    q = space.coordinates(law.parameters(**scaled(law, values, scales)))
    texts = []
    for s, each in zip(space.sought, q.tolist()):
        if each > s.highest - EDGE or (not s.bounded and each < s.lowest + EDGE):
            side = "largest" if each > s.highest - EDGE else "least"
            limit = f" ({1.0 + s.highest:g} {s.base})" if s.base else ""
            end = f"ends at the {side} value of the search{limit}"
            texts.append(f"{_value(found, s.name)} {end}: give it with fixed=, or try another law")
    at = [_value(found, name) for name in space.edges(q) if name in found.intervals]
    if at:
        texts.append(
            f"{', '.join(at)} end at the edge of what the law allows: the record may be of another law; give what is "
            "known with fixed=, or try another law"
        )
    return texts


def _value(found: "Fit", name: str) -> str:
    return f"{name} = {getattr(found.parameters, name):.3g}"


def _misfit(found: "Fit", ready: "Prepared") -> list[str]:
    level = ready.scales.torque
    if found.residual <= max(UNLIKE * ready.own_noise, MATTERS * level):
        return []
    times = f", {found.residual / ready.own_noise:.3g} times the record's own noise" if ready.own_noise > 0.0 else ""
    return [
        f"the law does not describe the record: it leaves {found.residual:.3g} RMS in the fitted samples, "
        f"{found.residual / level:.1%} of the saturated level{times}; the intervals are of the law that fits best, "
        "not of the friction: try another law with friction.compare"
    ]


def _memory(found: "Fit", ready: "Prepared", law: Law) -> list[str]:
    branches = ready.branches
    texts = []
    if "F_c" in found.intervals and not branches.saturates:
        texts.append("the weighed torque never saturates, so F_c is a lower bound: record wider loops")
    remembers = law.memory_size(found.parameters) > 0
    if branches.one_way:
        texts.append(
            "the record goes one way: its memory at the start is taken as none, and the zero of the torque sensor as "
            "true; record a reversal"
        )
    elif remembers and not branches.saturated[branches.first - 1]:
        texts.append("no reversal from saturation: the memory at the start is taken as none, which biases the rest")
    return texts


def _sensors(ready: "Prepared", optimum: Optimum) -> list[str]:
    scales, texts = ready.scales, []
    if ready.noise > DOMINANT * scales.displacement:
        texts.append(
            f"noise of x ({ready.noise:.3g}) is {ready.noise / scales.displacement:.0%} of the length over which "
            "the torque follows a reversal: stiffness and damping are those of the filtered motion; use a finer sensor"
        )
    if ready.hides:
        texts.append(
            f"noise or steps of x (deviation {ready.noise:.3g}) leave about {ready.by_noise:.2g} of the torque, more "
            "than the noise of the torque does: small loops are those of the filtered motion, no law is judged by less "
            "than that, and the intervals do not allow for it; use a finer sensor, or fit a part with wider loops"
        )
    if told := clipped(ready.record.torque):
        texts.append(told)
    return [*texts, *_wandering(optimum, ready)]


def _wandering(optimum: Optimum, ready: "Prepared") -> list[str]:
    """Whether the zero of the torque drifts along a straight line, or wanders otherwise, beside the other parameters.

    It wanders where slow cosines take away more than half of what the law leaves.
    """
    level, branches = ready.scales.torque, len(ready.branches.saturated) - ready.branches.first
    e, way = optimum.weakened, np.linspace(-0.5, 0.5, optimum.residual.size)
    drift, half, left = _fit_further_column(optimum.jacobian, way, e)
    slow = np.column_stack(
        [way, np.cos(np.pi * np.outer(way + 0.5, np.arange(min(WANDERING_COSINES, branches // 2) + 1)))]
    )
    zero = slow @ np.linalg.lstsq(slow, e, rcond=None)[0]
    over = float(np.ptp(zero))
    if ready.branches.saturates and over > DRIFT and np.sum((e - zero) ** 2) < WANDERS * (left @ left):
        return [
            f"the zero of the torque wanders over {over * level:.3g} in the course of the record, not along a "
            "straight line: subtract it, or fit shorter parts"
        ]
    if abs(drift) > max(DRIFT, CERTAIN_RATIO * half):
        return [
            f"the zero of the torque drifts by {drift * level:.3g} over the record: subtract it, or fit shorter parts"
        ]
    return []


def _fit_further_column(J: NDArray, column: NDArray, e: NDArray, floor: float = 0.0) -> tuple[float, float, NDArray]:
    """One more number in a linear step, half the width of its interval (F35), and what the step leaves."""
    A = np.column_stack([J, column])
    change = np.linalg.lstsq(A, -e, rcond=None)[0]
    left = e + A @ change
    return float(change[-1]), float(half_widths(A, left, np.eye(change.size)[-1:], floor)[0]), left


def told_of_load(problem: Problem, estimate: Estimate) -> list[str]:
    """What is told of the growth of the level with a load (F38)."""
    load, end = estimate.level.load, estimate.optimum
    if "load" not in estimate.undetermined and load > EDGE:
        return []
    levels = [Level(load=load), Level(load=load + DIFFERENCE)]
    ends = [problem.at(each).response(estimate.space.law, estimate.parameters) for each in levels]
    column = end.weight * (ends[1] - ends[0])[problem.weighed] / DIFFERENCE
    change, half, _ = _fit_further_column(estimate.beside_level, column, end.weakened, FLOOR)
    if change < -CERTAIN_RATIO * half:
        return [
            "the friction falls with the load, which the level does not describe (its rate stands at its bound 0): "
            "check the load's channel, or fit parts of equal load"
        ]
    if "load" in estimate.undetermined:
        kept = f"kept at {load:.3g} of the level at the mean load" if load else "taken as none"
        return [f"the record does not determine the influence of the load: {kept}; record loads that differ more"]
    return [
        f"the record shows no growth of the friction with the load (at most {half:.2g} of the level at the mean load)"
    ]
