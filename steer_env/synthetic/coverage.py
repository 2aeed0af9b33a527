"""How often the metrics find the known answers of a recording behind a fault, each within its own 95 % interval."""

import multiprocessing
import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from steer_env import metrics
from steer_env.recording.recording import Recording
from steer_env.synthetic.cases import CASES, Case
from steer_env.synthetic.faults import FAULTS, Fault
from steer_env.synthetic.recordings import Made


class Coverage(NamedTuple):
    """What became of the trials of one metric under one fault."""

    kept: float  # share whose interval holds the truth, or that was refused for a right reason [1]
    refused: float  # share that was refused, for whatever reason [1]
    width: float  # median width of the intervals over the size of the truth [1]


def trial(clean: Recording, fault: Fault, seed: int | Sequence[int]) -> dict[str, metrics.Value] | str:
    """Metrics of a recording behind a fault, or why there are none."""
    try:
        found = fault.spoil(clean, np.random.default_rng(seed))
    except ValueError as error:
        return str(error)
    return metrics.evaluate(found, timing=fault.timing)


def coverage(
    make: Callable[[int], Made], fault: Fault, trials: int, stream: int = 0, refusals: Sequence[str] = ()
) -> dict[str, Coverage]:
    """Every metric with an answer, over seeded trials of one fault.

    Parameters
    ----------
    make : callable
        Recording and answers, from the number of the trial.
    fault : Fault
    trials : int
    stream : int
        Another one draws other noise.
    refusals : sequence of str
        Parts of reasons that are right for any metric, besides those of the fault and of the answers.
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


def made(case: Case, rate: float) -> Callable[[int], Made]:
    """A case at a rate, by the number of the trial."""
    if case.anew:
        return lambda k: case.make(rate, k)
    one = case.make(rate)
    return lambda k: one


def _job(job: tuple[str, str, int]) -> dict[str, Coverage]:
    name, of, trials = job
    case, fault = CASES[name], FAULTS[of]
    stream = zlib.crc32(f"{name}, {of}".encode())  # no luck is shared between faults
    return coverage(made(case, fault.rate), fault, trials, stream, case.refusals)


def collect(trials: int, workers: int | None = None) -> dict[str, dict[str, dict[str, Coverage]]]:
    """Case, fault, metric: everything, side by side in processes."""
    jobs = [(case, fault, trials) for case in CASES for fault in FAULTS]
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        found = dict(zip(jobs, pool.map(_job, jobs)))
    return {case: {fault: found[case, fault, trials] for fault in FAULTS} for case in CASES}
