#!/usr/bin/env bash
# In numba 0.68.1 (and 0.61.2) a function has the options of whoever compiles it first, for all later callers.
#
# The options error_model, fastmath and forceinline, where a function does not name them, are those of the caller during
# whose compilation it is compiled; the machine code is then kept with the function. Whether 1/0 raises and whether
# (1 + 1e16) - 1e16 is 0 depends on which function was called first, in both directions: a callee that was called by
# itself before keeps the caller from what it asks for, and a caller that comes first changes the callee for everybody.
# Seen: callee first: ZeroDivisionError from both, and 0.0 from both; caller first: inf from both, and 1.0 from both.
# Named options, also error_model="python" and fastmath=False, are not inherited.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 0.61.2 0.68.1; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet "numba==$version"
  "$folder/$version/bin/python" - <<'PYTHON'
import numba
from numba import njit


def inverse(**named):
    callee = njit(**named)(lambda x: 1.0 / x)
    return callee, njit(error_model="numpy")(lambda x: callee(x))


def lost(**named):
    callee = njit(**named)(lambda x: (x + 1e16) - 1e16)
    return callee, njit(fastmath=True)(lambda x: callee(x))


def told(function, x):
    try:
        return function(x)
    except ZeroDivisionError:
        return "ZeroDivisionError"


def results(functions, x, caller_first):
    """What callee and caller give."""
    ordered = functions[::-1] if caller_first else functions
    found = [told(function, x) for function in ordered]
    return found[::-1] if caller_first else found


print("numba", numba.__version__)
for made, x, alone, inherited, named in (
    (inverse, 0.0, "ZeroDivisionError", float("inf"), {"error_model": "python"}),
    (lost, 1.0, 0.0, 1.0, {"fastmath": False}),
):
    first, last = results(made(), x, False), results(made(), x, True)
    print(f"{made.__name__}: callee first {first}, caller first {last}")
    assert first == [alone, alone]
    assert last == [inherited, inherited]
    assert results(made(**named), x, True)[0] == alone
PYTHON
done
