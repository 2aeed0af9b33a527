"""The two-track car against CommonRoad's multi-body model."""

from collections.abc import Iterator

from tests.verification.common.commonroad_manoeuvres import MANOEUVRES
from tests.verification.common.cross_validation import MOST_RMS, MOST_STEADY, compare
from tests.verification.common.rows import Row


def rows() -> Iterator[Row]:
    """Two tracks against CommonRoad's model: RMS over the peak, steady values; as published peculiarities deviate."""
    required = f"<= {100.0 * MOST_RMS:g} % RMS, {100.0 * MOST_STEADY:g} % steady"
    for name in MANOEUVRES:
        result = compare(name)
        for case, found in result.items():
            rms, steady = max(found.rms.values()), max(abs(gap) for *_, gap in found.steady.values())
            explained = "deviates" if result["reconciled"].passed else "FAIL"
            measured = f"{100.0 * rms:.2f} % RMS, {100.0 * steady:.2f} % steady"
            yield Row(f"{name}, {case}", measured, required, "pass" if found.passed else explained)
