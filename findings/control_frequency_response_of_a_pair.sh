#!/usr/bin/env bash
# control.frequency_response of python-control 0.10.2 takes a list of two frequencies for the ends of a range.
#
# For `omega` of two elements it answers at about a thousand frequencies between them, for three and more at those that
# were asked for; the method `frequency_response` of a system answers at both. Whoever asks for the gain at two
# frequencies gets the right first and last value among a thousand, and zips them with others in silence.
# Seen: 1000 frequencies for [1, 10], 3 for [1, 2, 10]; 2 by the method.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet control==0.10.2
"$folder/venv/bin/python" - <<'PYTHON'
import control

system = control.tf([1.0], [1.0, 1.0])
pair, three = (len(control.frequency_response(system, asked).omega) for asked in ([1.0, 10.0], [1.0, 2.0, 10.0]))
method = len(system.frequency_response([1.0, 10.0]).omega)
print(f"control {control.__version__}: function {pair} for two and {three} for three, method {method} for two")
assert pair == 1000, "a pair is taken as two frequencies now"
assert (three, method) == (3, 2)
PYTHON
