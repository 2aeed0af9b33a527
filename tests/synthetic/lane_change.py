"""Lane changes through cones on a path of half cosines, while the handwheel angle is a sine."""

from typing import NamedTuple

import numpy as np

from steer_env.recording.recording import DEGREE
from tests.synthetic.recordings import Array, Example, half_cosine, recording

SPEED = 80.0 / 3.6  # [m/s]
# Size of the car, and place of its middle ahead of the point that x and y describe [m].
WIDTH, LENGTH, CENTRE = 1.8, 4.5, -0.3
FRONT, REAR = CENTRE + LENGTH / 2, CENTRE - LENGTH / 2
ANGLE, TORQUE, AY, YAW = 60 * DEGREE, 4.0, 5.0, 15 * DEGREE
YAW_LAG, AY_LAG = 0.08, 0.12  # [s]
PLACE = {
    "entry_x_m": 60.0,
    "entry_y_m": 0.0,
    "vehicle_width_m": WIDTH,
    "vehicle_length_m": LENGTH,
    "vehicle_centre_m": CENTRE,
}


class Way(NamedTuple):
    """The straight sections of the car's path through a course, in the course's axes."""

    edition: str
    entry: float  # end of the entry lane [m]
    side: tuple[float, float]  # begin and end of the side lane [m]
    leave: float  # begin of the exit lane [m]
    length: float  # of the course [m]
    middle: float  # lateral position in the side lane, positive to the left [m]
    back: float  # lateral position in the exit lane, positive to the left [m]
    clearance: float  # distance of the cones from a car in the middle of the side lane [m]
    cycles: int  # number of steering cycles in a pass


WAYS = {
    "double-lane-change": Way("2018", 15.0, (45.0, 70.0), 95.0, 125.0, 3.59, 0.28, 0.305, 3),
    "obstacle-avoidance": Way("2011", 12.0, (25.5, 36.5), 49.0, 61.0, 3.515, -0.385, 0.5, 2),
}


def lane_change(rate: float, test: str, passes: int = 4, clearance: float = 0.105, hit: float = 0.0) -> Example:
    """Passes at 80 km/h with half-cosine lane changes that no cone is near; the car drives backwards between them.

    In the side lane the car has the distance ``clearance`` to the cones on the left [m], and hits ``hit`` cones.
    """
    way, span, run = WAYS[test], 245.0, 245.0 / SPEED
    time = np.arange(int(2 * passes * run * rate)) / rate
    x = 0.5 * span - np.arcsin(np.cos(np.pi * time / run)) * span / np.pi  # forwards and backwards
    side = way.middle + way.clearance - clearance

    def step(start: float, end: float) -> tuple[Array, Array]:
        u = (x - 60.0 - start) / (end - start)
        return half_cosine(u), 0.5 * np.pi / (end - start) * np.sin(np.pi * np.clip(u, 0.0, 1.0))

    # The outline is outside the lanes while it moves sideways.
    first = step(way.entry - REAR + 0.5, way.side[0] - FRONT - 0.5)
    second = step(way.side[1] - REAR + 0.5, way.leave - FRONT - 0.5)
    omega = 2 * np.pi * way.cycles * SPEED / (way.length + LENGTH)
    phase = omega * (
        np.mod(time - (60.0 - FRONT) / SPEED + run / 2, 2 * run) - run / 2
    )  # zero at the begin of each pass

    def wave(delay: float = 0.0) -> Array:
        """A sine whose first half cycle is the largest; among equal ones noise would decide which is the largest."""
        p = phase - omega * delay
        return np.sin(p) * np.where(p < np.pi, 1.0, 0.8) * ((p > 0) & (p < 2 * np.pi * way.cycles))

    steering = (phase > 0) & (phase < 2 * np.pi * way.cycles)
    fastest = steering * np.cos(phase) * np.where(np.abs(phase - 2 * np.pi) < np.pi / 2, 1.0, 0.8)
    clean = recording(
        test,
        time,
        {**PLACE, "edition": way.edition},
        x=x,
        y=side * first[0] + (way.back - side) * second[0],
        yaw_angle=np.arctan(side * first[1] + (way.back - side) * second[1]),
        handwheel_angle=ANGLE * wave(),
        handwheel_speed=ANGLE * omega * fastest,  # largest after a cycle
        handwheel_torque=TORQUE * wave(),
        lateral_acceleration=AY * wave(AY_LAG),
        yaw_rate=YAW * wave(YAW_LAG),
        vehicle_speed=np.full(time.size, SPEED),
    )
    quarters = 4 * way.cycles
    return clean, {
        "course_completed": 1.0,
        "cones_hit": hit,
        "smallest_cone_margin": clearance,
        "lane_change_entry_speed": 80.0,
        "lane_change_exit_speed": 80.0,
        "lane_change_lateral_acceleration": AY,
        "lane_change_yaw_rate": YAW / DEGREE,
        "lane_change_handwheel_angle": ANGLE / DEGREE,
        "lane_change_handwheel_speed": ANGLE * omega / DEGREE,
        "lane_change_handwheel_torque": TORQUE,
        "lane_change_torque_rms": TORQUE * np.sqrt(0.5 * (2 + 0.64 * (quarters - 2)) / quarters),
        "lane_change_steering_effort": 0.5 * TORQUE * ANGLE * (4 * 0.8 + 0.64 * (quarters - 4)),
        "lane_change_yaw_lag": 1e3 * YAW_LAG,
    }


def double_lane_change(rate: float) -> Example:
    """Passes that hit no cone."""
    return lane_change(rate, "double-lane-change")


def hitting(rate: float) -> Example:
    """Passes that hit the six cones to the left of the side lane."""
    return lane_change(rate, "double-lane-change", clearance=-0.095, hit=6.0)


def obstacle_avoidance(rate: float) -> Example:
    """Passes through the shorter course."""
    return lane_change(rate, "obstacle-avoidance")
