"""Rows of the tables of requirements."""

from typing import Any, NamedTuple

import numpy as np


class Row(NamedTuple):
    """One requirement."""

    what: str
    measured: str
    required: str
    verdict: str  # "pass", "FAIL", or "deviates" where the title of the table gives the reason


def verdict(passed: bool) -> str:
    """The verdict on a requirement."""
    return "pass" if passed else "FAIL"


def at_most(what: str, errors: Any, limit: float, unit: str = "") -> Row:
    """A row for the largest of some errors."""
    error = np.max(errors)  # NaN stays NaN, and fails
    return Row(what, f"{error:.1e}", f"<= {limit:g} {unit}".strip(), verdict(error <= limit))


def as_printed(what: str, values: Any, source: str, known: str = "") -> Row:
    """A row for values against a printed table, to its last digit; ``known`` is a known deviation from it."""
    digits = len(source.split()[0].partition(".")[2])
    measured = " ".join(f"{value:.{digits}f}" for value in np.ravel(values))
    return Row(what, measured, source, "deviates" if measured == known else verdict(measured == source))
