#!/usr/bin/env bash
# python-can 4.6.1 reads an ASC log whose header says "timestamps relative" as if its times were absolute.
#
# In such a log, as Vector's CANalyzer writes it, each time is the step since the event before. The reader keeps the
# word of the header in `timestamps_format` and gives the steps unchanged, with the option `relative_timestamp` on or
# off, so that 500 frames in 5 s all lie within 10 ms, most at the same instant.
# Seen: 500 frames, first times 0.0, 0.01, 0.01, 0.01 s, last time 0.01 s (expected 4.99 s).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet python-can==4.6.1
cd "$folder"
venv/bin/python - <<'PYTHON'
import can

lines = ["date Thu Jan 1 10:00:00.000 am 2026", "base hex  timestamps relative", "internal events logged"]
lines += [f"   {0.01 * (i > 0):.6f} 1  100             Rx   d 8 00 00 00 00 00 00 00 {i % 256:02x}" for i in range(500)]
with open("log.asc", "w", encoding="utf-8") as file:
    file.write("\n".join(lines) + "\n")

for relative in (True, False):
    with can.ASCReader("log.asc", relative_timestamp=relative) as reader:
        messages = list(reader)
    times = [message.timestamp - messages[0].timestamp for message in messages]
    print(f"relative_timestamp={relative}: {reader.timestamps_format}, {len(times)} frames, "
          f"first {[round(t, 6) for t in times[:4]]}, last {times[-1]:.6f} s")
    assert reader.timestamps_format == "relative"
    assert len(times) == 500
    assert abs(times[-1] - 0.01) < 1e-6, "the steps are summed now"
PYTHON
