"""The chassis alone as a subsystem: the motion of the rack in, the rack force and the motion of the car out.

The kernels are those of the plant, whose column becomes the rack itself: with a pinion radius of 1 the angle of the
column is the travel of the rack. The end stops belong to the steering.
"""

import numpy as np

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle import plant
from steer_env.vehicle.chassis.common.interface import RACK_DISTURBANCE, WIND_FORCE, derivative
from steer_env.vehicle.layout import layout_in_kernels
from steer_env.vehicle.steering.column import COLUMN_ANGLE, COLUMN_SPEED
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import car
from steer_env.vehicle.subsystems.steering import RACK, RACK_MEANINGS
from steer_env.vehicle.subsystems.subsystem import Signal, Subsystem, channel_signals, interpolate_hands, is_finite

SECTIONS = ("chassis", "tyre")
LARGEST_RACK_MOTION = (1.0, 10.0)  # travel [m] and speed [m/s] that are taken; far beyond those of a rack, assumed
NO_STOP = 1e9  # travel that no rack reaches [m]
HELD_SPEED = ("chassis.v_x", "chassis.body.speed")  # names of the parameter, by chassis
_NOT_HERE = ("assist_request", "rack_disturbance")
_RACK_FORCE = plant.CHANNEL["rack_force"]


@kernel
def advance(p, state, given, inputs, outputs, samples):
    """Advance the chassis by a communication step of so many samples; whether its state is finite."""
    at = layout_in_kernels(p)
    start, start_speed = state[COLUMN_ANGLE], state[COLUMN_SPEED]
    u = inputs[0]
    u[WIND_FORCE], u[WIND_FORCE + 1] = given[2], given[3]
    for i in range(RACK_DISTURBANCE + 1, u.size):
        u[i] = given[i - RACK_DISTURBANCE + 3]
    for i in range(samples):
        s = (state[at.steps] + 0.5) / plant.STEPS_PER_CHASSIS_STEP
        plant.roll(p, at, state, s, u, SAMPLE_TIME)
        state[COLUMN_ANGLE], state[COLUMN_SPEED] = interpolate_hands(
            start, start_speed, given[0], given[1], i + 1, samples
        )
        if state[at.steps] == plant.STEPS_PER_CHASSIS_STEP:
            plant.evaluate(p, at, state, u, derivative)
            state[at.steps] = 0.0
    plant.report_chassis(p, at, state, u, outputs[0])
    return is_finite(state)


def subsystem(p: plant.Plant) -> Subsystem:
    """The chassis of a plant, in straight running."""
    whole = car.subsystem(p)
    alone = p._replace(pinion_radius=1.0, rack_limit=NO_STOP)
    given = (
        *(
            Signal(name, unit, RACK_MEANINGS[name], 0.0, -most, most)
            for (name, unit), most in zip(RACK, LARGEST_RACK_MOTION)
        ),
        *(s for s in whole.given[len(car.HAND_SIGNALS) :] if s.name not in _NOT_HERE),
    )
    return whole._replace(
        name="chassis",
        title="Chassis: rack travel, wind, throttle and brake in; rack force and motion of the car out",
        parameters=alone,
        sections=SECTIONS,
        given=given,
        given_size=2 + len(plant.INPUTS) - len(car.HAND_SIGNALS) + 1 - len(_NOT_HERE),
        outputs=channel_signals(plant.channels(p)[_RACK_FORCE:], plant.meanings(p)),
        shown=np.ascontiguousarray(whole.shown[_RACK_FORCE:]),
        zero_outputs=tuple(i - _RACK_FORCE for i in whole.zero_outputs),
    )
