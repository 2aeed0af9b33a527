"""Lane changes through cones on a path of half cosines, while the hands steer sines."""

import numpy as np

from experiments.synthetic.recordings import Array, Made, half_cosine, recording
from steer_env.recording import DEGREE

SPEED = 80.0 / 3.6  # [m/s]
WIDTH, LENGTH, CENTRE = 1.8, 4.5, -0.3  # of the car, and of its middle ahead of where x and y are measured [m]
FRONT, REAR = CENTRE + LENGTH / 2, CENTRE - LENGTH / 2
ANGLE, TORQUE, AY, YAW = 60 * DEGREE, 4.0, 5.0, 15 * DEGREE
YAW_LAG, AY_LAG, CYCLES = 0.08, 0.12, 3
PLACE = {
    "entry_x_m": 60.0,
    "entry_y_m": 0.0,
    "edition": "2018",
    "vehicle_width_m": WIDTH,
    "vehicle_length_m": LENGTH,
    "vehicle_centre_m": CENTRE,
}


def double_lane_change(rate: float, passes: int = 4, aside: float = 0.2) -> Made:
    """Passes at 80 km/h, driven backwards between, in half-cosine lane changes that no cone is near.

    In the side lane the car is ``aside`` to the left of its middle. The hand steers three cycles a pass.
    """
    span, run = 245.0, 245.0 / SPEED
    time = np.arange(int(2 * passes * run * rate)) / rate
    x = 0.5 * span - np.arcsin(np.cos(np.pi * time / run)) * span / np.pi  # to and fro
    side, back = 3.5 - 1.115 + 1.205 + aside, 0.28  # the last lane's middle is 0.18

    def step(start: float, end: float) -> tuple[Array, Array]:
        u = (x - 60.0 - start) / (end - start)
        return half_cosine(u), 0.5 * np.pi / (end - start) * np.sin(np.pi * np.clip(u, 0.0, 1.0))

    # The outline is clear of the lanes while it moves aside.
    first, second = step(15 - REAR + 0.5, 45 - FRONT - 0.5), step(70 - REAR + 0.5, 95 - FRONT - 0.5)
    omega = 2 * np.pi * CYCLES * SPEED / (125.0 + LENGTH)
    phase = omega * (np.mod(time - (60.0 - FRONT) / SPEED + run / 2, 2 * run) - run / 2)  # from the begin of each pass

    def wave(delay: float = 0.0) -> Array:
        """A sine whose first half cycle is the largest: a largest of equals would be the one that noise favours."""
        p = phase - omega * delay
        return np.sin(p) * np.where(p < np.pi, 1.0, 0.8) * ((p > 0) & (p < 2 * np.pi * CYCLES))

    steering = (phase > 0) & (phase < 2 * np.pi * CYCLES)
    fastest = steering * np.cos(phase) * np.where(np.abs(phase - 2 * np.pi) < np.pi / 2, 1.0, 0.8)
    clean = recording(
        "double-lane-change",
        time,
        PLACE,
        x=x,
        y=side * first[0] + (back - side) * second[0],
        yaw_angle=np.arctan(side * first[1] + (back - side) * second[1]),
        handwheel_angle=ANGLE * wave(),
        handwheel_speed=ANGLE * omega * fastest,  # largest after a cycle
        handwheel_torque=TORQUE * wave(),
        lateral_acceleration=AY * wave(AY_LAG),
        yaw_rate=YAW * wave(YAW_LAG),
        vehicle_speed=np.full(time.size, SPEED),
    )
    return clean, {
        "course_completed": 1.0,
        "cones_hit": 0.0 if aside < 0.305 else 6.0,
        "smallest_cone_margin": 0.305 - aside,
        "lane_change_entry_speed": 80.0,
        "lane_change_exit_speed": 80.0,
        "lane_change_lateral_acceleration": AY,
        "lane_change_yaw_rate": YAW / DEGREE,
        "lane_change_handwheel_angle": ANGLE / DEGREE,
        "lane_change_handwheel_speed": ANGLE * omega / DEGREE,
        "lane_change_handwheel_torque": TORQUE,
        "lane_change_torque_rms": TORQUE * np.sqrt(0.5 * (2 + 10 * 0.64) / 12),  # of twelve quarters
        "lane_change_steering_effort": 0.5 * TORQUE * ANGLE * (4 * 0.8 + 8 * 0.64),
        "lane_change_yaw_lag": 1e3 * YAW_LAG,
    }


def hitting(rate: float) -> Made:
    """Passes that hit the six cones to the left of the side lane."""
    return double_lane_change(rate, aside=0.4)
