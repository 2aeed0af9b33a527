"""How often the known answers of a recording are in the metrics' 95 % intervals after a fault."""

import zlib
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env import metrics
from steer_env.recording.recording import Recording
from tests.synthetic.cases import CASES, Case
from tests.synthetic.faults import FAULTS, Fault
from tests.synthetic.recordings import Example


class Coverage(NamedTuple):
    """Result of the trials of one metric with one fault."""

    kept: float  # fraction whose interval contains the truth, or that was refused for a right reason [1]
    refused: float  # fraction that was refused for any reason [1]
    width: float  # median width of the intervals, over the size of the truth [1]


def trial(clean: Recording, fault: Fault, seed: int | Sequence[int]) -> dict[str, metrics.Value] | str:
    """Metrics of a recording after a fault, or the reason for which there are none."""
    try:
        found = fault.apply(clean, np.random.default_rng(seed))
    except ValueError as error:
        return str(error)
    return metrics.evaluate(found, timing=fault.timing)


def coverage(
    make: Callable[[int], Example], fault: Fault, trials: int, stream: int = 0, refusals: Sequence[str] = ()
) -> dict[str, Coverage]:
    """Coverage of every metric with an answer, over seeded trials of one fault.

    Parameters
    ----------
    make : callable
        Recording and answers for the number of a trial.
    fault : Fault
    trials : int
    stream : int
        Number of the random stream; another stream has other noise.
    refusals : sequence of str
        Parts of reasons that are right for every metric, besides those of the fault and of the answers.
    """
    kept: dict[str, list[bool]] = {}
    refused: dict[str, list[bool]] = {}
    width: dict[str, list[float]] = {}
    for k in range(trials):
        clean, answers = make(k)
        values = trial(clean, fault, (stream, k))
        for name, truth in answers.items():
            value = None if isinstance(values, str) else values[name]
            reason = value.reason if value else str(values)
            right = [fault.refused] if fault.refused else [*refusals, *([truth] if isinstance(truth, str) else [])]
            refused.setdefault(name, []).append(bool(reason))
            if value is None or value.reason or isinstance(truth, str):
                kept.setdefault(name, []).append(any(text in reason for text in right))
            else:
                kept.setdefault(name, []).append(not fault.refused and value.low <= truth <= value.high)
                width.setdefault(name, []).append((value.high - value.low) / max(abs(truth), 1e-12))
    return {
        name: Coverage(
            float(np.mean(kept[name])), float(np.mean(refused[name])), float(np.median(width.get(name, [0.0])))
        )
        for name in kept
    }


def examples(case: Case, rate: float) -> Callable[[int], Example]:
    """The recording and answers of a case at a rate, as a function of the number of a trial."""
    if case.reseeded:
        return lambda k: case.make(rate, k)
    one = case.make(rate)
    return lambda k: one


def _job(job: tuple[str, str, int]) -> dict[str, Coverage]:
    name, of, trials = job
    case, fault = CASES[name], FAULTS[of]
    stream = zlib.crc32(f"{name}, {of}".encode())  # every pair of case and fault has its own noise
    return coverage(examples(case, fault.rate), fault, trials, stream, case.refusals)


def collect(trials: int, each: Callable[..., Iterable[Any]] = map) -> dict[str, dict[str, dict[str, Coverage]]]:
    """Coverage by case, fault and metric; ``each`` is ``map``, or does the same in several processes."""
    test = {case: entry.make(200.0)[0].meta["manoeuvre"] for case, entry in CASES.items()}
    jobs = [
        (case, name, trials)
        for case in CASES
        for name, fault in FAULTS.items()
        if not fault.tests or test[case] in fault.tests
    ]
    found = dict(zip(jobs, each(_job, jobs)))
    return {
        case: {fault: found[case, fault, trials] for fault in FAULTS if (case, fault, trials) in found}
        for case in CASES
    }
