"""The whole car as a subsystem: the plant as the environments and manoeuvres run it."""

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle import chassis, plant
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND, HAND_SPEED, INPUTS, TARGET_SPEED
from steer_env.vehicle.layout import layout, layout_of, states
from steer_env.vehicle.steering.column import HANDWHEEL_ANGLE, HANDWHEEL_SPEED
from steer_env.vehicle.subsystems.subsystem import Signal, Subsystem, channel_signals, reached

HANDS = (
    Signal("hand_torque", "N m", "torque of the hands, where the hand torque is given (robot is false)"),
    Signal("hand_angle", "rad", "handwheel angle at the end of the step, where it is prescribed (robot is true)"),
    Signal("hand_speed", "rad/s", "handwheel speed at the end of the step, where the angle is prescribed"),
)
# Name and description by the name of the plant's input. The plain names of throttle and brake are those of channels.
NAMED = {
    "assist_request": ("assist_request", "torque that is added to the command of the assist, at the column"),
    "wind_force": ("wind_force", "side wind, at the centre of gravity of the body, to the left"),
    "wind_moment": ("wind_moment", "yaw moment of the wind, to the left"),
    "rack_disturbance": ("rack_disturbance", "force of the road on the rack, positive where it resists a left turn"),
    "target_speed": ("target_speed", "change of the held speed"),
    "throttle": ("throttle_request", "0 to 1, on top of the throttle of the speed hold"),
    "brake": ("brake_request", "service brake, 0 to 1, on top of that of the speed hold"),
    "hand_brake": ("hand_brake", "0 to 1"),
    "coast": ("coast", "1 where the speed hold is off"),
}
SETTLING = 5000  # samples that `plant.settled` runs straight


@kernel
def begin(p, state):
    """Write the state from which straight running settles: all zero but for the chassis, which has its held speed."""
    at = layout(p)
    for i in range(state.size):
        state[i] = 0.0
    chassis.begin(p.chassis, state[at.chassis : at.rate])


@kernel
def advance(p, state, given, inputs, outputs, samples):
    """Advance the car by a communication step of so many samples; whether its state is finite."""
    start, start_speed = state[HANDWHEEL_ANGLE], state[HANDWHEEL_SPEED]
    u = inputs[0]
    for i in range(ASSIST_REQUEST, u.size):
        u[i] = given[i + 1]
    for i in range(samples):
        if p.robot > 0.0:
            u[HAND], u[HAND_SPEED] = reached(start, start_speed, given[1], given[2], i + 1, samples)
        else:
            u[HAND], u[HAND_SPEED] = given[0], 0.0
        if not plant.run(p, state, inputs, outputs, 1):
            return False
    return True


def subsystem(p: plant.Plant) -> Subsystem:
    """The car of a plant."""
    kind = chassis.chassis_of(p.chassis)
    first = layout_of(p).chassis
    start, shown = plant.settled(p)
    positions = tuple(i for i, (name, _) in enumerate(kind.states) if name in ("x", "y", "distance"))
    # A chassis that does not report its speed holds it; inputs that would change the speed have no effect.
    end = len(INPUTS) if "longitudinal_speed" in dict(kind.channels) else TARGET_SPEED
    inputs = tuple(Signal(NAMED[name][0], unit, NAMED[name][1]) for name, unit in INPUTS[ASSIST_REQUEST:])
    return Subsystem(
        name="car",
        title="Car with its steering: hands, throttle, brake and wind in, every channel out",
        parameters=p,
        sections=p._fields,
        states=tuple(name for name, _ in states(p)),
        given=(*HANDS, *inputs[: end - ASSIST_REQUEST]),
        given_size=len(INPUTS) + 1,
        outputs=channel_signals(plant.channels(p)),
        inputs=len(INPUTS),
        start=start,
        shown=shown,
        zero_states=tuple(first + i for i in positions),
        zero_outputs=(plant.CHANNEL["x"], plant.CHANNEL["y"]),
        settling=SETTLING,
    )
