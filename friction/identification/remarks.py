"""What a user has to know about an estimate: the warnings of a fit."""

from typing import TYPE_CHECKING

from steer_env.friction.identification.determined import Estimate
from steer_env.friction.identification.problem import Problem
from steer_env.friction.law import Law

if TYPE_CHECKING:
    from steer_env.friction.identification.fit import Fit, Prepared


def remarks(found: "Fit", ready: "Prepared", law: Law, problem: Problem, estimate: Estimate) -> tuple[str, ...]:
    """All warnings of a fit, in whole sentences."""
    return (*_undetermined(found, law), *_memory(found, ready, law))


def _undetermined(found: "Fit", law: Law) -> list[str]:
    values = [f"{name} = {getattr(found.parameters, name):g} {law.units[name]}" for name in found.undetermined]
    if not values:
        return []
    return [f"the record does not determine {', '.join(values)}: kept there; record several speeds and wider loops"]


def _memory(found: "Fit", ready: "Prepared", law: Law) -> list[str]:
    branches = ready.branches
    texts = []
    if "F_c" in found.intervals and not branches.saturates:
        texts.append("the weighed torque never saturates, so F_c is a lower bound: record wider loops")
    remembers = law.memory_size(found.parameters) > 0
    if branches.one_way:
        texts.append(
            "the record goes one way: its memory at the start is taken as none, and what the zero of the torque sensor "
            "adds counts as friction; record a reversal"
        )
    elif remembers and not branches.saturated[branches.first - 1]:
        texts.append("no reversal from saturation: the memory at the start is taken as none, which biases the rest")
    return texts
