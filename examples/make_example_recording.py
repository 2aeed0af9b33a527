"""Make weave_example.csv: a weave as a logger would have stored it. SYNTHETIC: simulated, not driven.

python examples/make_example_recording.py [FOLDER]

The default car with LuGre friction weaves at 100 km/h; a logger at 50 Hz low-passes every channel alike. Sensors add
noise, offsets, the steps of their digits, a lateral acceleration 10 ms late, and two short drop-outs. Names and units
are those of a measurement; weave_example.toml says how to read them.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import signal

from steer_env import manoeuvres
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle import cars
from steer_env.vehicle.constants import GRAVITY as G

SEED = 13674
RATE = 50.0  # Hz
DELAY = 0.010  # of the lateral acceleration [s]


class Column(NamedTuple):
    """A column of the file; noise and offset are in its unit."""

    name: str  # with the unit
    channel: str
    size: float  # SI value of one unit
    noise: float  # standard deviation
    offset: float  # reading at zero
    digits: int  # after the point


COLUMNS = (
    Column("SWA [deg]", "handwheel_angle", DEGREE, 0.05, 0.4, 1),
    Column("SWT [Nm]", "handwheel_torque", 1.0, 0.05, 0.08, 2),
    Column("AY [g]", "lateral_acceleration", G, 0.002, 0.004, 3),
    Column("YAWRATE [deg/s]", "yaw_rate", DEGREE, 0.1, -0.15, 2),
    Column("VEHSPD [km/h]", "vehicle_speed", 1 / 3.6, 0.15, 0.0, 1),
)
DROP_OUTS = {"SWT [Nm]": (21.30, 0.06), "YAWRATE [deg/s]": (43.74, 0.04)}  # from [s], for [s]
HEADER = (
    "# origin: SYNTHETIC, simulated by examples/make_example_recording.py, not driven\n"
    "# logger: 50 Hz, low-pass at 20 Hz\n"
)


def logged(recording: Recording) -> Recording:
    """Each channel through the same low-pass at 20 Hz, then every n-th sample; the lateral acceleration late."""
    step = round(recording.rate / RATE)
    low_pass = signal.butter(4, 20.0, fs=recording.rate, output="sos")
    late = np.interp(recording.time - DELAY, recording.time, recording["lateral_acceleration"])
    channels = {**recording.channels, "lateral_acceleration": late}
    zi = signal.sosfilt_zi(low_pass)
    kept = {
        c.channel: signal.sosfilt(low_pass, channels[c.channel], zi=zi * channels[c.channel][0])[0] for c in COLUMNS
    }
    return Recording(
        recording.time[::step],
        {name: values[::step] for name, values in kept.items()},
        {name: recording.units[name] for name in kept},
    )


def text() -> str:
    """The whole file."""
    found = logged(manoeuvres.drive(cars.load(), manoeuvres.make("weave"), "lugre"))
    rng = np.random.default_rng(SEED)
    time = found.time - found.time[0]
    cells = [[f"{t:.2f}" for t in time]]
    for column in COLUMNS:
        values = found[column.channel] / column.size + column.offset + column.noise * rng.standard_normal(time.size)
        begin, length = DROP_OUTS.get(column.name, (np.inf, 0.0))
        gone = (time > begin - 1e-9) & (time < begin + length - 1e-9)
        values = np.round(values, column.digits) + 0.0  # no minus zero
        cells.append(["NaN" if lost else f"{value:.{column.digits}f}" for value, lost in zip(values, gone)])
    rows = (";".join(row) for row in zip(*cells))
    return HEADER + ";".join(["Time [s]", *(column.name for column in COLUMNS)]) + "\n" + "\n".join(rows) + "\n"


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    (folder / "weave_example.csv").write_text(text(), encoding="utf-8", newline="\n")
