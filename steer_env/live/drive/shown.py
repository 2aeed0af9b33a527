"""What a session shows at a moment, as plain numbers and words, for a window or for a line of text."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class ConfigurationInfo(NamedTuple):
    """A configuration in words."""

    label: str
    car: str
    law: str  # with its parameters where they were given
    assist: str
    chassis: str


class History(NamedTuple):
    """The last seconds, every 10 ms."""

    pose: NDArray[np.float64]  # (N, 3) x, y [m], yaw angle [rad] on the road
    angle: NDArray[np.float64]  # (N,) of the handwheel [rad]
    torque: NDArray[np.float64]  # (N,) of the torsion bar [N m]
    configurations: NDArray[np.int64]  # (N,) that acted


class DriveMoment(NamedTuple):
    """A moment of a drive."""

    time: float  # since the begin [s]
    channels: NDArray[np.float64]  # (C,) in the order of steer_env.vehicle.plant.CHANNELS, with the pose on the road
    speed: float  # [m/s]
    held: float  # speed that is held; NaN behind pedals [m/s]
    wanted: float  # angle to which arms turn the handwheel; NaN with a wheel [rad]
    torque: float  # of the motor at the wheel [N m]
    phase: str  # of the watchdog
    gain: float  # share of the torque that reaches the motor [1]
    clipped: float  # share of the time in which the torque was limited [1]
    late: float  # lateness at the deadlines that 99 of 100 keep, in the last seconds [s]
    missed: float  # share of the deadlines that were missed [1]
    configurations: tuple[ConfigurationInfo, ...]
    chosen: int  # configuration that acts
    pair: tuple[int, int]  # configurations that swap
    waits: str  # what the torque waits for, empty for nothing
    note: str  # last thing that happened
    file: str  # of the recording
    device: str
    motor: bool  # whether the device has one
    keyboard: bool  # whether its keys steer
    dead_man: bool  # whether the torque needs the dead-man key
    history: History
