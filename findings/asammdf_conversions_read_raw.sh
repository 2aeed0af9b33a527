#!/usr/bin/env bash
# asammdf 8.8.28 gives raw samples, or other numbers, for conversions that an MDF file states as formula or as ranges.
#
# A formula goes to numexpr, which knows neither pow nor atan and takes ^ for the exclusive or of whole numbers. Where it
# fails, and sympy is not installed, the samples stay as they are, without an exception or a warning; where sympy happens
# to be there, as beside torch, pow and atan are right. A table of ranges on whole numbers gives the default for what is
# inside its ranges.
# Seen, for raw samples 0 to 5: X1^2 on bytes 2, 3, 0, 1, 6, 7; on floats, and by pow(X1,2), 0 to 5 (right is 0, 1, 4, 9,
# 16, 25); the ranges [0, 5] -> 1 and [6, 10] -> 2, otherwise -1, on 0 to 12: -1, -1, -1, -1, -1, 1, -1, -1, -1, -1, 2,
# 2, 2.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet asammdf==8.8.28
cd "$folder"
venv/bin/python -W error - <<'PYTHON'
from importlib.util import find_spec

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.conversion_utils import from_dict

assert find_spec("sympy") is None
RANGES = {"lower_0": 0.0, "upper_0": 5.0, "phys_0": 1.0, "lower_1": 6.0, "upper_1": 10.0, "phys_1": 2.0, "default": -1.0}


def read_back(raw, conversion):
    time = np.arange(raw.size) / 100.0
    with MDF(version="4.10") as file:
        file.append([Signal(raw, time, name="torque", conversion=from_dict(conversion))])
        file.save("run.mf4", overwrite=True)
    with MDF("run.mf4") as file:
        return file.get("torque").samples.tolist()


whole, real = np.arange(6, dtype="u1"), np.arange(6, dtype="f8")
found = {
    "X1^2 on bytes": read_back(whole, {"formula": "X1^2"}),
    "X1^2 on floats": read_back(real, {"formula": "X1^2"}),
    "pow(X1,2) on floats": read_back(real, {"formula": "pow(X1,2)"}),
    "ranges on bytes": read_back(np.arange(13, dtype="u1"), RANGES),
}
for name, values in found.items():
    print(f"{name}: {values}")
assert found["X1^2 on bytes"] == [2, 3, 0, 1, 6, 7]
assert found["X1^2 on floats"] == [0, 1, 2, 3, 4, 5]
assert found["pow(X1,2) on floats"] == [0, 1, 2, 3, 4, 5]
assert found["ranges on bytes"][:5] == [-1, -1, -1, -1, -1]
PYTHON
