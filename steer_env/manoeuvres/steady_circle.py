"""Steady circle of constant radius."""

from collections.abc import Callable

import numpy as np

from steer_env.manoeuvres.common.definition import Array, Manoeuvre, register
from steer_env.vehicle import plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import TARGET_SPEED
from steer_env.vehicle.constants import GRAVITY as G

# Entry into the circle, return to the first speed at its exit, straight ahead [s].
ENTRY, SLOWING, REST = 4.0, 12.0, 4.0
PERIOD = 0.01  # time step of the driver [s]
CROSSOVER = 3.0  # crossover frequency of the curvature loop of a neutral car, assumed; lower with understeer [rad/s]
LAG = 0.1  # lag of the hand, assumed [s]


def _curvature_driver(sign: Callable[[float], float], radius: float) -> Callable:
    """Driver that holds a curvature with the angle that a neutral car needs and with the integral of the error."""

    def build(car: Car, p: plant.Plant) -> Callable[[float, Array], tuple[float, float]]:
        # Handwheel angle per curvature [rad m].
        neutral = (car.chassis["front_axle"] + car.chassis["rear_axle"]) / car.steering_gain()
        names = [name for name, _ in plant.channels(p)]
        yaw, speed = names.index("yaw_rate"), names.index("longitudinal_speed")
        angle, integral = 0.0, 0.0

        def decide(t: float, row: Array) -> tuple[float, float]:
            nonlocal angle, integral
            wanted = sign(t) / radius
            error = wanted - row[yaw] / max(float(row[speed]), 1.0)
            integral += CROSSOVER * PERIOD * error * neutral
            rate = (neutral * wanted + integral - angle) / LAG
            angle += PERIOD * rate
            return angle, rate

        return decide

    return build


@register("steady-circle")
def steady_circle(
    radius: float = 100.0, slow: float = 7.0, highest: float = 0.7, climb: float = 0.3, repeats: int = 1
) -> Manoeuvre:
    """Steady circle, constant radius: the speed rises slowly while the driver holds the circle; left, then right.

    Parameters
    ----------
    radius : float
        Radius of the circle [m].
    slow : float
        Speed at the entry into the circle [m/s].
    highest : float
        Lateral acceleration at the end, assumed: below the limit of the tyres on a dry road [g].
    climb : float
        Increase of the speed per time [m/s2].
    repeats : int
        Number of circles to each side.
    """
    rise = (np.sqrt(highest * G * radius) - slow) / climb
    each = REST + ENTRY + rise + 1.0 + SLOWING  # the highest speed is held for a second
    times = np.array([REST, REST + ENTRY, REST + ENTRY + rise + 1.0, REST + ENTRY + rise + 5.0])

    def smooth(s: float) -> float:
        s = min(max(s, 0.0), 1.0)
        return s * s * (3.0 - 2.0 * s)

    def sign(t: float) -> float:
        i, s = divmod(t, each)
        into, out = smooth((s - times[0]) / ENTRY), smooth((s - times[2]) / (times[3] - times[2]))
        return (-1.0) ** i * (into - out)

    def extra(t: Array) -> Array:
        s = np.mod(t, each)
        knots = [0.0, times[1], times[1] + rise, times[2], each]
        return np.interp(s, knots, [0.0, 0.0, rise * climb, rise * climb, 0.0])

    return Manoeuvre(
        name="steady-circle",
        hands=f"Handwheel holds a circle of {radius:g} m while the speed rises by {climb:g} m/s2, left and right, "
        "entered",
        source="after ISO 4138, constant radius",
        speed=slow,
        duration=2 * repeats * each,
        hand=lambda t, amplitude: (np.zeros_like(t), np.zeros_like(t)),
        amplitude=0.0,
        driver=_curvature_driver(sign, radius),
        chassis="two_track",
        others={TARGET_SPEED: extra},
        meta={"radius_m": radius},
    )
