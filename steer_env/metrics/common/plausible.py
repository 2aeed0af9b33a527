"""Whether the sizes of handwheel angle, torque, yaw rate and lateral acceleration fit each other, as in any car.

A unit that a file names wrongly makes a channel 57 times (degrees, radians), 9.8 times (g) or 3.6 times (km/h) too
large or too small. The yaw rate of a car in a steady turn is

    r/delta = v/(i l (1 + (v/v_ch)^2))        a_y = v r

with steering ratio i, wheelbase l and characteristic speed v_ch. The bounds below contain every passenger car; a factor
of two beyond them is left for the dynamics of a car and for the noise of its sensors.

The torque bounds the angle also where nothing tells how the car moves. Even if the rack were held fast, the handwheel
would turn by the twist of the torsion bar, and the rest of the steering only adds to it:

    |T| <= K_tb |delta| + T_f

with the stiffness K_tb of the bar and the friction T_f above it. The inertia of the handwheel adds less than a tenth of
K_tb up to 2 Hz.
"""

import numpy as np

from steer_env.metrics.common.definitions import RefusedError
from steer_env.metrics.common.filtered_channels import ANGLE, AY, PLAUSIBLE, SPEED, TORQUE, YAW
from steer_env.recording.recording import DEGREE, Recording

# i l [m], least and largest, and the lowest characteristic speed [m/s] of passenger cars; assumed.
QUICK, SLOW, LOWEST_CHARACTERISTIC = 8.0 * 2.2, 25.0 * 3.6, 15.0
BEYOND = 2.0  # factor on the bounds for what is not steady; assumed [1]
APART = 4.0  # factor between lateral acceleration and speed times yaw rate that a test may reach; assumed [1]
LEAST_SPEED = 5.0  # at which the motion tells enough; assumed [m/s]
# Torsion bar, above any of passenger cars, and the friction of the column above it; assumed [N m/rad], [N m].
STIFFEST, COLUMN_FRICTION = 2.5 / DEGREE, 0.5
GRIP = 12.0  # lateral acceleration that no road tyre gives; assumed [m/s2]


def check(recording: Recording, speed: float | None) -> None:
    """Refuse a recording whose sizes contradict each other, and name the channel with the unit that would fit.

    ``speed`` is the condition of the test [m/s]; the recorded speed is used where there is one.

    Raises
    ------
    RefusedError
        If a channel is in another unit than it says.
    """
    _check_motion(recording, speed)
    angle, torque = (_size(recording, name) for name in (ANGLE, TORQUE))
    most = BEYOND * (STIFFEST * angle + COLUMN_FRICTION)
    if angle > 0.0 and most < torque <= PLAUSIBLE[TORQUE]:  # beyond that the torque is wrong
        raise RefusedError(
            f"{ANGLE} reaches {angle / DEGREE:.3g} deg, at which the torsion bar of any car twists with less than "
            f"{most:.2g} N m, and {TORQUE} reaches {torque:.3g} N m: {_remedy(ANGLE, 'rad')}, or check that of {TORQUE}"
        )


def _check_motion(recording: Recording, speed: float | None) -> None:
    """Refuse a recording whose motion and handwheel angle contradict each other."""
    angle, yaw, ay = (_size(recording, name) for name in (ANGLE, YAW, AY))
    v = abs(float(np.nanmean(recording[SPEED]))) if recording.units.get(SPEED) == "m/s" else speed
    if v is None or not v >= LEAST_SPEED or not angle > 0.0:
        return
    low, high = v / (SLOW * (1.0 + (v / LOWEST_CHARACTERISTIC) ** 2)) / BEYOND, v / QUICK * BEYOND
    gains = {name: turn / angle for name, turn in ((YAW, yaw), (AY, ay / v)) if turn > 0.0}  # [1/s]
    reach = f"{ANGLE} reaches {angle / DEGREE:.3g} deg"
    if len(gains) == 2 and not 1.0 / APART <= gains[AY] / gains[YAW] <= APART:
        wrong = max(gains, key=lambda name: abs(np.log(gains[name] ** 2 / (low * high))))
        unit = {YAW: ("rad/s", "deg/s"), AY: ("g", "m/s2")}[wrong][int(gains[wrong] ** 2 > low * high)]
        text = f"{AY} is {gains[AY] / gains[YAW]:.3g} times speed and {YAW}, and about once in a car"
        raise RefusedError(f"{text}: {_remedy(wrong, unit)}")
    if gains and not any(low <= gain <= high for gain in gains.values()):
        name, gain = next(iter(gains.items()))
        text = f"{reach}, and by {name} the car yaws at {gain:.3g} 1/s for every angle, where cars have {low:.2g} to"
        unit = "rad" if gain > high else "deg"
        raise RefusedError(f"{text} {high:.2g} 1/s at {3.6 * v:.0f} km/h: {_remedy(ANGLE, unit)}")
    if not gains and low * angle * v > GRIP:
        text = f"{reach}, for which any car has at least {low * angle * v:.2g} m/s2 at {3.6 * v:.0f} km/h"
        raise RefusedError(f"{text}: {_remedy(ANGLE, 'deg')}")


def _remedy(name: str, unit: str) -> str:
    return f'check the unit of {name} in the file; a mapping corrects it, [channels.{name}] unit = "{unit}"'


def _size(recording: Recording, name: str) -> float:
    """Half the span of a channel [SI], without its outermost hundredths; 0 where the channel says nothing."""
    values = recording.channels.get(name, np.zeros(0))
    values = values[np.isfinite(values)]
    if values.size == 0 or recording.units[name] not in ("rad", "rad/s", "m/s2", "N m"):
        return 0.0
    low, high = np.quantile(values, [0.01, 0.99])
    return float(high - low) / 2.0
