"""The steering alone as a subsystem: hands, column, friction, assist and end stops, under a rack force."""

import numpy as np

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle import plant
from steer_env.vehicle.layout import layout_in_kernels, state_names, state_size
from steer_env.vehicle.steering.column import COLUMN_ANGLE, COLUMN_SPEED, HANDWHEEL_ANGLE, HANDWHEEL_SPEED
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems.car import FORCE, HAND_SIGNALS, input_signal
from steer_env.vehicle.subsystems.subsystem import Signal, Subsystem, channel_signals, interpolate_hands, is_finite

# Fields of the plant that belong to the chassis.
OF_CHASSIS = ("chassis", "strut", "tyre")
FASTEST = 150.0  # vehicle speed that is taken; far beyond that of a car, assumed [m/s]
_COLUMN = 8  # channels of the plant that are those of column and assist

RACK = (("rack_travel", "m"), ("rack_speed", "m/s"))
RACK_MEANINGS = {
    "rack_travel": "travel of the rack at the end of the step, positive where it steers left",
    "rack_speed": "speed of the rack at the end of the step, positive where it steers left",
}


@kernel
def begin(p, state):
    """Write the state of rest."""
    for i in range(state.size):
        state[i] = 0.0


@kernel
def advance(p, state, given, inputs, outputs, samples):
    """Advance the steering by a communication step of so many samples; whether its state is finite."""
    at = layout_in_kernels(p)
    start, start_speed = state[HANDWHEEL_ANGLE], state[HANDWHEEL_SPEED]
    row = outputs[0]
    for i in range(samples):
        hand, hand_speed = given[0], 0.0
        if p.robot > 0.0:
            hand, hand_speed = interpolate_hands(start, start_speed, given[1], given[2], i + 1, samples)
        before, after = plant.sample(p, at, state, given[5], given[3])
        rack = p.pinion_radius * state[COLUMN_ANGLE]  # (P1)
        beyond = rack - within(rack, -p.rack_limit, p.rack_limit)
        force = given[4] + plant.STOP_STIFFNESS * beyond  # (P4)
        plant.steer(p, at, state, hand, hand_speed, before, after, 0.0, force, SAMPLE_TIME)
    plant.report_column(p, at, state, row)
    row[_COLUMN] = p.pinion_radius * state[COLUMN_ANGLE]  # (P1)
    row[_COLUMN + 1] = p.pinion_radius * state[COLUMN_SPEED]
    return is_finite(state)


def subsystem(p: plant.Plant, speed: float) -> Subsystem:
    """The steering of a plant; ``speed`` is the start value of the vehicle's [m/s]."""
    given = (
        *HAND_SIGNALS,
        input_signal("assist_request"),
        Signal(
            "rack_force", "N", "force on the rack over the step, positive where it resists a left turn", 0.0, *FORCE
        ),
        Signal("vehicle_speed", "m/s", "speed that the assist sees, positive ahead", speed, -FASTEST, FASTEST),
    )
    outputs = channel_signals((*plant.CHANNELS[:_COLUMN], *RACK), plant.meanings(p) | RACK_MEANINGS)
    return Subsystem(
        name="steering",
        title="Steering: hands, rack force and vehicle speed in; handwheel, hand torque, rack travel and friction out",
        parameters=p,
        sections=tuple(field for field in p._fields if field not in OF_CHASSIS),
        states=tuple(name for name, _ in state_names(p)),
        given=given,
        given_size=len(given),
        outputs=outputs,
        inputs=1,
        start=np.zeros(state_size(p)),
        shown=np.zeros(len(outputs)),
        zero_states=(),
        zero_outputs=(),
    )
