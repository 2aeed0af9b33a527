"""The test of recordings and its conditions: what a file, a mapping and the options say of them has to agree."""

import math
from collections.abc import Mapping
from typing import Any

from steer_env.friction.numerics.check import number

SCALE = "torque_scale_error"
# Condition -> how far two recordings that are compared may be apart, as far as one may be from what its test
# prescribes; its option, the unit of that, and how many of it are one SI.
APART = {"speed_m_s": (0.03, "--speed-kph", "km/h", 3.6), "frequency_hz": (0.1, "--frequency-hz", "Hz", 1.0)}
TEXTS = ("edition", "mirrored")  # conditions that are no numbers


def check(recordings: Mapping[str, Any], asked: str | None, given: Mapping[str, float]) -> None:
    """Refuse recordings of another test than the one asked for, bad values of conditions, and unlike conditions.

    Parameters
    ----------
    recordings : mapping of str to Recording
        Where each comes from, in the user's words -> one or two recordings.
    asked : str or None
        The test that the options name; None if they name none.
    given : mapping of str to float
        Conditions that the options give, in place of those of the recordings [SI].

    Raises
    ------
    ValueError
        With the file, the key, the value and what is allowed, or with both values of two recordings.
    """
    from steer_env import metrics

    tests = {place: _test(place, recording.meta.get("manoeuvre"), asked) for place, recording in recordings.items()}
    if len(set(tests.values())) > 1:
        said = " and ".join(f"{place} is of {test!r}" for place, test in tests.items())
        raise ValueError(f"{said}: only recordings of the same test can be compared")
    (test,) = set(tests.values())
    prescribed = metrics.conditions(test)
    found = {place: _conditions(place, recording.meta, prescribed) for place, recording in recordings.items()}
    for key, (share, option, unit, size) in APART.items():
        if key not in prescribed:
            continue
        if key in given:
            number(option, size * given[key], minimum=0.0, above=bool(prescribed[key]))
            continue
        values = [size * conditions[key] for conditions in found.values()]
        if max(values) - min(values) > share * max(values) * (1 + 1e-9):
            said = " and ".join(f"{place} at {value:.4g} {unit}" for place, value in zip(found, values))
            raise ValueError(
                f"{said} are more than {share:.0%} apart, so that their metrics differ by the test already: compare "
                f"recordings of one {key}, or correct the meta in a mapping, [meta] {key}"
            )


def _test(place: str, named: Any, asked: str | None) -> str:
    """The test of a recording by its own meta and the options."""
    from steer_env import metrics

    tests = metrics.tests()
    if named is not None and not isinstance(named, str):
        raise ValueError(f"{place}: manoeuvre must be text, one of {', '.join(tests)}; got {named!r}")
    if asked is None:
        if named not in tests:
            raise ValueError(f"{place} names no known test, {named!r}: give --manoeuvre, one of {', '.join(tests)}")
        return named
    if named in tests and named != asked:
        raise ValueError(
            f"{place} is of {named!r} by its meta, not of {asked!r}: leave --manoeuvre {asked} out, or, where the "
            f'meta is wrong, correct it in a mapping, [meta] manoeuvre = "{asked}"'
        )
    return asked


def _conditions(place: str, meta: Mapping[str, Any], prescribed: Mapping[str, Any]) -> dict[str, Any]:
    """The conditions of a recording: those of its meta, else those of the test."""
    found = {**prescribed, **{key: meta[key] for key in prescribed if meta.get(key) is not None}}
    for key, value in found.items():
        if key in meta and key not in TEXTS and value is not None:
            least = 0.0 if key in APART or prescribed[key] else -math.inf
            number(f"{place}: {key}", value, minimum=least, above=bool(prescribed[key]))
    if SCALE in meta:
        number(f"{place}: {SCALE}", meta[SCALE], minimum=0.0, maximum=1.0)
    return found
