"""What the driving page shares with ``steer-env drive``: devices, road, exchange of configurations, and recording."""

from typing import Any

from steer_env import manoeuvres
from steer_env.courses import iso3888
from steer_env.friction.numerics.packing import slices
from steer_env.live import devices
from steer_env.live.devices.common import commands, device
from steer_env.live.drive import hands, log, scene
from steer_env.live.real_time import configurations as exchange
from steer_env.recording import driven
from steer_env.recording.units import FILE_UNITS
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import CHANNELS
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Subsystem

DEVICES = ("keyboard", "mouse", "gamepad", "wheel")  # of those of steer_env.live that a browser has
LAG = 25.0  # that the simulated time is behind the clock at most [ms]
PERIOD = 4.0  # between two turns of the worker, the shortest that browsers allow [ms]
DEAD_ZONE = 0.05  # of a stick around its middle; assumed [1]
KEPT_RECORDING_TIME = 1800.0  # time that a recording keeps; assumed [s]
# Of a pad's motor: time of one effect [ms], departure of the torque from its mean that gives the full strength [N m],
# and that strength [1]; assumed.
RUMBLE = {"duration": 60.0, "full": 0.3, "strength": 0.35}
# Of the blind test, whose levels are parts of the way from a value to the farther end of its slider; all assumed but
# the alternatives, X or Y: the share of answers that do not depend on the level, slopes that are equally likely,
# factors on the level before and behind the first wrong answer, thresholds that are thought of, and after what it ends.
BLIND = {
    "chance": 1.0 / 2.0,
    "lapse": 0.02,
    "slopes": [1.0, 1.5, 2.0, 3.0, 4.5],
    "steps": [2.0, 2.0**0.5],
    "least": 2e-3,
    "most": 4.0,
    "confidence": 0.9,
    "trials": 40,
    "reversals": 10,
}


def declared(car: Car) -> dict[str, Any]:
    """What the driving page knows of the program, as JSON holds it; in the units of the names, or in SI units."""
    size = iso3888.footprint(car)
    return {
        "sampleTime": SAMPLE_TIME,
        "pace": {"lag": LAG, "halt": 1e3 * driven.STOOD, "period": PERIOD},
        "devices": {name: devices.options(name) for name in DEVICES},
        "deadZone": DEAD_ZONE,
        "buttons": {str(number): command for number, command in commands.parse_buttons(commands.BUTTONS).items()},
        "hands": {"lag": hands.WANTED_LAG, "recentred": device.RECENTRED},
        "held": {"step": hands.SPEED_STEP, "fastest": hands.FASTEST},
        "exchange": {
            "runIn": exchange.RUN_IN,
            "fade": exchange.FADE,
            "largestStep": exchange.LARGEST_STEP,
            "longest": exchange.LONGEST,
            "implausible": exchange.IMPLAUSIBLE,
            "farthest": exchange.FARTHEST,
            "same": exchange.SAME,
            "fromSettled": list(exchange.FROM_SETTLED),
            "wheelSpeed": exchange.WHEEL_SPEED,
            "carSpeed": exchange.CAR_SPEED,
            "own": exchange.OWN_STATES,
        },
        "road": {
            "lane": scene.LANE,
            "lanes": scene.LANES,
            "first": scene.FIRST,
            "gap": scene.GAP,
            "courses": {name: _course(name, size) for name in scene.COURSES},
        },
        "size": size._asdict(),
        "axles": [car.chassis["front_axle"], car.chassis["rear_axle"]],
        "tracks": [car.chassis["front_track"], car.chassis["rear_track"]],
        "recording": {
            "samples": log.SAMPLES,
            "kept": KEPT_RECORDING_TIME,
            "own": [list(each) for each in log.OWN_COLUMNS.values()],
            "sums": list(log.SUMS),
            "last": list(log.LAST),
            "inputs": list(log.INPUTS),
            "channels": [list(each) for each in CHANNELS],
            "units": {unit: list(each) for unit, each in FILE_UNITS.items()},
            "manoeuvres": list(manoeuvres.available()),
            "meta": {
                "vehicle": car.name,
                "tyre": car.tyre.name,
                "wheelbase_m": car.chassis["front_axle"] + car.chassis["rear_axle"],
                "steering_ratio": car.steering_ratio(),
            },
        },
        "blind": BLIND,
        "rumble": RUMBLE,
    }


def _course(name: str, size: iso3888.Footprint) -> dict[str, Any]:
    """The cones of a course (N, 2) and the way from its begin to that of the next [m]."""
    if name == scene.PLAIN_COURSE:
        return {"cones": [], "period": scene.GAP}
    course = iso3888.course(name, size.width)
    return {"cones": [*course.left.tolist(), *course.right.tolist()], "period": course.length + scene.GAP}


def of_module(subsystem: Subsystem) -> dict[str, Any]:
    """States and inputs of a car by their names, and where fields of its parameters stand among the packed numbers."""
    found = slices(subsystem.parameters)

    def place(field: str) -> list[int]:
        own = [at for name, at in found.items() if name.split(".")[0] == field]
        return [own[0].start, own[-1].stop]

    return {
        "states": list(subsystem.states),
        "inputs": [signal.name for signal in subsystem.given],
        "fields": {field: place(field) for field in ("friction", "chassis", "assist", "robot")},
    }
