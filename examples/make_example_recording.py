"""Write weave_example.csv: a weave as a data logger would have stored it. SYNTHETIC: simulated, not driven.

python examples/make_example_recording.py [FOLDER]

The default car weaves at 100 km/h. The logger samples at 50 Hz and applies the same low-pass filter
to every channel. The sensors add noise, offsets and rounding, a delay of 10 ms to the lateral acceleration, and two
short drop-outs. Names and units are those of a measurement; the channel mapping weave_example.toml tells how to read
them.
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
RATE = 50.0  # [Hz]
DELAY = 0.010  # of the lateral acceleration [s]


class Column(NamedTuple):
    """A column of the file; noise and offset are in its unit."""

    name: str  # with its unit
    channel: str
    size: float  # SI value of one unit
    noise: float  # standard deviation
    offset: float  # reading at zero
    digits: int  # after the decimal point


COLUMNS = (
    Column("SWA [deg]", "handwheel_angle", DEGREE, 0.05, 0.4, 1),
    Column("SWT [Nm]", "handwheel_torque", 1.0, 0.05, 0.08, 2),
    Column("AY [g]", "lateral_acceleration", G, 0.002, 0.004, 3),
    Column("YAWRATE [deg/s]", "yaw_rate", DEGREE, 0.1, -0.15, 2),
    Column("VEHSPD [km/h]", "vehicle_speed", 1 / 3.6, 0.15, 0.0, 1),
)
DROP_OUTS = {"SWT [Nm]": (21.30, 0.06), "YAWRATE [deg/s]": (43.74, 0.04)}  # start [s], duration [s]
HEADER = (
    "# origin: SYNTHETIC, simulated by examples/make_example_recording.py, not driven\n"
    "# logger: 50 Hz, low-pass at 20 Hz\n"
)


def logged(recording: Recording) -> Recording:
    """Every channel low-passed at 20 Hz and sampled at ``RATE``; the lateral acceleration is delayed."""
    step = round(recording.rate / RATE)
    low_pass = signal.butter(4, 20.0, fs=recording.rate, output="sos")
    delayed = np.interp(recording.time - DELAY, recording.time, recording["lateral_acceleration"])
    channels = {**recording.channels, "lateral_acceleration": delayed}
    zi = signal.sosfilt_zi(low_pass)
    filtered = {
        c.channel: signal.sosfilt(low_pass, channels[c.channel], zi=zi * channels[c.channel][0])[0] for c in COLUMNS
    }
    return Recording(
        recording.time[::step],
        {name: values[::step] for name, values in filtered.items()},
        {name: recording.units[name] for name in filtered},
    )


def text() -> str:
    """The text of the file."""
    recording = logged(manoeuvres.drive(cars.load(), manoeuvres.make("weave")))
    rng = np.random.default_rng(SEED)
    time = recording.time - recording.time[0]
    cells = [[f"{t:.2f}" for t in time]]
    for column in COLUMNS:
        values = recording[column.channel] / column.size + column.offset + column.noise * rng.standard_normal(time.size)
        start, duration = DROP_OUTS.get(column.name, (np.inf, 0.0))
        dropped = (time > start - 1e-9) & (time < start + duration - 1e-9)
        values = np.round(values, column.digits) + 0.0  # minus zero becomes zero
        cells.append(["NaN" if lost else f"{value:.{column.digits}f}" for value, lost in zip(values, dropped)])
    rows = (";".join(row) for row in zip(*cells))
    return HEADER + ";".join(["Time [s]", *(column.name for column in COLUMNS)]) + "\n" + "\n".join(rows) + "\n"


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    (folder / "weave_example.csv").write_text(text(), encoding="utf-8", newline="\n")
