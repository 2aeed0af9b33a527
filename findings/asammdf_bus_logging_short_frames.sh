#!/usr/bin/env bash
# MDF.extract_bus_logging of asammdf 8.8.28 (with canmatrix 1.2) fills frames that are shorter than the database says
# with ones, so that a signal that was not sent has values.
#
# A frame may be shorter than the message of the database: a control unit of another year leaves the last signals out.
# The bytes that are missing are taken as 0xFF and not flagged: a signed torque of 0.01 N m a bit becomes -0.01 N m in
# every sample, which looks like a sensor at rest; an unsigned one becomes the largest value of its bits. Where longer
# frames share the group, the bytes behind the length that the frame states are taken instead.
# Seen for frames of 2 of 8 bytes: ANGLE as sent, TORQUE -0.01 in all of 50 samples, LOAD 65535, none invalid.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet asammdf==8.8.28 canmatrix==1.2
cd "$folder"
venv/bin/python - <<'PYTHON'
import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.source_utils import Source
from asammdf.blocks.v4_constants import BUS_TYPE_CAN, SOURCE_BUS

with open("car.dbc", "w", encoding="utf-8") as file:
    file.write(
        'VERSION ""\nNS_ :\nBS_:\nBU_: ECU\nBO_ 256 STEER: 8 ECU\n'
        ' SG_ ANGLE : 0|16@1- (0.1,0) [-800|800] "deg" ECU\n'
        ' SG_ TORQUE : 16|16@1- (0.01,0) [-20|20] "Nm" ECU\n'
        ' SG_ LOAD : 32|16@1+ (1,0) [0|65535] "N" ECU\n'
    )
count, sent = 50, np.arange(50, dtype="<i2")
fields = [("BusChannel", "u1"), ("ID", "<u4"), ("IDE", "u1"), ("DLC", "u1"), ("DataLength", "u1")]
kinds = [(f"CAN_DataFrame.{name}", kind) for name, kind in fields] + [("CAN_DataFrame.DataBytes", "u1", (2,))]
frames = np.zeros(count, dtype=kinds)
frames["CAN_DataFrame.BusChannel"], frames["CAN_DataFrame.ID"] = 1, 256
frames["CAN_DataFrame.DLC"] = frames["CAN_DataFrame.DataLength"] = 2
frames["CAN_DataFrame.DataBytes"] = sent.view("u1").reshape(-1, 2)
source = Source(name="CAN", path="CAN", comment="", source_type=SOURCE_BUS, bus_type=BUS_TYPE_CAN)
with MDF(version="4.10") as file:
    file.append(
        [Signal(frames, 0.01 * np.arange(count), name="CAN_DataFrame", source=source)], acq_source=source, comment="CAN"
    )
    file.groups[-1].channel_group.flags |= 0x6  # a group of bus events
    file.save("drive.mf4", overwrite=True)
with MDF("drive.mf4") as file:
    decoded = file.extract_bus_logging({"CAN": [("car.dbc", 0)]})
    found = {name: decoded.get(name) for name in ("ANGLE", "TORQUE", "LOAD")}
for name, signal in found.items():
    invalid = 0 if signal.invalidation_bits is None else int(np.count_nonzero(signal.invalidation_bits))
    print(f"{name}: {len(signal)} samples, {signal.samples.min():g} to {signal.samples.max():g}, {invalid} invalid")
    assert len(signal) == count
    assert invalid == 0
assert np.allclose(found["ANGLE"].samples, 0.1 * sent)
assert np.allclose(found["TORQUE"].samples, -0.01)
assert np.all(found["LOAD"].samples == 65535)
PYTHON
