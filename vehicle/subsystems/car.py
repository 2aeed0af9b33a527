"""The whole car as a subsystem: the plant as the environments and manoeuvres run it."""

import numpy as np

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle import chassis, plant
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND, HAND_SPEED, INPUTS, TARGET_SPEED
from steer_env.vehicle.layout import plant_layout, state_names, state_size
from steer_env.vehicle.steering.column import HANDWHEEL_ANGLE, HANDWHEEL_SPEED
from steer_env.vehicle.subsystems.subsystem import Signal, Subsystem, channel_signals, interpolate_hands

# Bounds of inputs are far beyond what a car meets, all assumed: nearly five turns of the handwheel, for example. What
# is beyond is the mistake of a unit or a sensor, and would leave a state behind that takes seconds to return.
TORQUE, FORCE = (-200.0, 200.0), (-1e5, 1e5)  # [N m], [N] or [N m]
ANGLE_BOUNDS, TURN_BOUNDS, SPEED_CHANGE_BOUNDS = (
    (-30.0, 30.0),
    (-200.0, 200.0),
    (-150.0, 150.0),
)  # [rad], [rad/s], [m/s]
PEDAL = (0.0, 1.0)  # [1]
HAND_SIGNALS = (
    Signal("hand_torque", "N m", "torque of the hands, positive to the left; acts without robot", 0.0, *TORQUE),
    Signal(
        "hand_angle",
        "rad",
        "handwheel angle at the step's end, positive to the left; acts with robot",
        0.0,
        *ANGLE_BOUNDS,
    ),
    Signal(
        "hand_speed",
        "rad/s",
        "handwheel speed at the step's end, positive to the left; acts with robot",
        0.0,
        *TURN_BOUNDS,
    ),
)
# Name, description and bounds by the name of the plant's input. The plain names of throttle and brake are those of
# channels.
NAMED = {
    "assist_request": ("assist_request", "torque on top of the assist's command, positive to the left", TORQUE),
    "wind_force": ("wind_force", "force of the wind at the body's centre of gravity, positive to the left", FORCE),
    "wind_moment": ("wind_moment", "moment of the wind, positive where it turns left", FORCE),
    "rack_disturbance": ("rack_disturbance", "road's force on the rack, positive where it resists a left turn", FORCE),
    "target_speed": ("target_speed", "change of the held speed, positive where it increases", SPEED_CHANGE_BOUNDS),
    "throttle": ("throttle_request", "throttle, 0 to 1, on top of that of the speed hold", PEDAL),
    "brake": ("brake_request", "service brake, 0 to 1, on top of that of the speed hold", PEDAL),
    "hand_brake": ("hand_brake", "hand brake on the rear wheels, 0 to 1", PEDAL),
    "coast": ("coast", "above 0 where the speed hold is off, 0 to 1", PEDAL),
}
_UNITS = dict(INPUTS)


def input_signal(name: str) -> Signal:
    """The input of a subsystem for an input of the plant."""
    own, meaning, bounds = NAMED[name]
    return Signal(own, _UNITS[name], meaning, 0.0, *bounds)


def input_index(place: int) -> int:
    """Place among what a subsystem is given of an input of the plant; that of the hands is their torque."""
    return place if place == HAND else place + 1


@kernel
def advance(p, state, given, inputs, outputs, samples):
    """Advance the car by a communication step of so many samples; whether its state is finite."""
    start, start_speed = state[HANDWHEEL_ANGLE], state[HANDWHEEL_SPEED]
    u = inputs[0]
    for i in range(ASSIST_REQUEST, u.size):
        u[i] = given[i + 1]
    for i in range(samples):
        if p.robot > 0.0:
            u[HAND], u[HAND_SPEED] = interpolate_hands(start, start_speed, given[1], given[2], i + 1, samples)
        else:
            u[HAND], u[HAND_SPEED] = given[0], 0.0
        if not plant.run(p, state, inputs, outputs, 1):
            return False
    return True


def subsystem(p: plant.Plant) -> Subsystem:
    """The car of a plant."""
    start, shown = plant.settled(p)
    return without_start_state(p)._replace(start=start, shown=shown)


def without_start_state(p: plant.Plant) -> Subsystem:
    """The car of a plant with zeros in place of its settled state: enough to compile it, and nothing is run."""
    kind = chassis.chassis_of(p.chassis)
    first = plant_layout(p).chassis
    positions = tuple(i for i, (name, _) in enumerate(kind.states) if name in ("x", "y", "distance"))
    # A chassis that does not report its speed holds it; inputs that would change the speed have no effect.
    end = len(INPUTS) if "longitudinal_speed" in dict(kind.channels) else TARGET_SPEED
    inputs = tuple(input_signal(name) for name, _ in INPUTS[ASSIST_REQUEST:])
    return Subsystem(
        name="car",
        title="Car with its steering: hands, throttle, brake and wind in, every channel out",
        parameters=p,
        sections=p._fields,
        states=tuple(name for name, _ in state_names(p)),
        given=(*HAND_SIGNALS, *inputs[: end - ASSIST_REQUEST]),
        given_size=len(INPUTS) + 1,
        outputs=channel_signals(plant.channels(p), plant.meanings(p)),
        inputs=len(INPUTS),
        start=np.zeros(state_size(p)),
        shown=np.zeros(len(plant.channels(p))),
        zero_states=tuple(first + i for i in positions),
        zero_outputs=(plant.CHANNEL["x"], plant.CHANNEL["y"]),
    )
