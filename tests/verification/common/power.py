"""Power balance of the steering, from a recorded run.

    hand + motor = friction + dampers + compliance + rack + change of the stored energy            (N6)

All terms are work over each sample of 1 ms, from the channels that a user records and one state, the travel of the
compliance. Source: (C9), (P2) and (P3), derived here.
"""

import numpy as np
from numpy.typing import NDArray

from steer_env import manoeuvres
from steer_env.manoeuvres.common.driving import run, run_closed
from steer_env.vehicle import cars, plant
from steer_env.vehicle.layout import state_names
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

COMPLIANCE = {"compliance_travel", "compliance_travel_left", "compliance_travel_right"}
GIVEN = ("hand", "motor")  # the terms of :func:`steering` that give work; the others take it


def hands(car: cars.Car, name: str) -> tuple[float, Array, Array]:
    """Speed [m/s], inputs of a robot (N, I), and its torque (N,) [N m].

    Two cycles of a weave, or a lane change as the driver steers it.
    """
    manoeuvre = manoeuvres.make(name)
    p = manoeuvres.build_plant(car, manoeuvre, "lugre")
    if manoeuvre.driver is None:
        u = manoeuvres.inputs(manoeuvre, 0.25, 10.0)
        record = run(p, manoeuvre, u)
    else:
        record = run_closed(car, p, manoeuvre)
        u = np.zeros((len(record), len(plant.INPUTS)))
        u[:, [plant.HAND, plant.HAND_SPEED]] = record[:, [plant.CHANNEL[f"handwheel_{k}"] for k in ("angle", "speed")]]
    return manoeuvre.speed, u, record[:, plant.CHANNEL["handwheel_torque"]]


def recorded(p: plant.Plant, inputs: Array, state: Array) -> tuple[Array, Array]:
    """Channels (N, C) and states (N, S) of a plant at the end of each sample.

    Parameters
    ----------
    p : Plant
    inputs : (N, I) array
        As in ``plant.INPUTS``.
    state : (S,) array
        Advanced in place.
    """
    record, passed = np.zeros((len(inputs), len(plant.channels(p)))), np.zeros((len(inputs), len(state)))
    for i in range(len(inputs)):
        plant.run(p, state, inputs[i : i + 1], record[i : i + 1], 1)
        passed[i] = state
    return record, passed


def steering(p: plant.Plant, record: Array, passed: Array) -> dict[str, Array]:
    """Work of each term of the power balance of the steering over each sample (N - 1,) [J].

    Parameters
    ----------
    p : Plant
        Without contact of the end stops and without rack disturbance, which the channel ``rack_force`` does not tell
        apart.
    record, passed : (N, C), (N, S) arrays
        From :func:`recorded`.

    Returns
    -------
    dict
        ``GIVEN``, then what takes work: friction, the dampers of handwheel, column and torsion bar, the lag of the
        compliance, the rack at the tie rods, and the changes of the energy of column and arms and of the compliance.
        The work of hand and motor less that of the others is the error of the balance.
    """
    c, k = p.column, p.chassis.body[0] if hasattr(p.chassis, "body") else p.chassis

    def channel(name: str) -> Array:
        return record[:, plant.CHANNEL[name]]

    def mean(x: Array) -> Array:
        return 0.5 * (x[1:] + x[:-1])

    def damper(coefficient: float, x: Array) -> Array:
        return coefficient * np.diff(x) ** 2 / SAMPLE_TIME

    angle, column = channel("handwheel_angle"), channel("column_angle")
    # On two tracks the mean of both wheels. What their difference stores and loses the wheels give, not the rack.
    give = passed[:, [name in COMPLIANCE for name, _ in state_names(p)]].mean(1)
    hand = channel("handwheel_torque")
    held = p.robot == 0.0 and p.column.K_arm == 0.0  # a given torque holds over its sample
    kinetic = c.I1 * channel("handwheel_speed") ** 2 + c.I2 * channel("column_speed") ** 2
    # (N6)
    return {
        "hand": (hand[1:] if held else mean(hand)) * np.diff(angle),
        "motor": mean(channel("motor_torque")) * np.diff(column),
        "friction": mean(channel("friction_torque")) * np.diff(column),
        "handwheel damper": damper(c.C1, angle),
        "column damper": damper(c.C2, column),
        "torsion-bar damper": damper(c.C_tb, angle - column),
        "compliance lag": damper(float(k.K_rack) * float(k.T_rack), give),  # force K (c + T c')
        "rack": mean(channel("rack_force")) * np.diff(p.pinion_radius * column - give),
        "column energy": 0.5 * np.diff(kinetic + c.K_tb * (angle - column) ** 2),
        "compliance energy": 0.5 * float(k.K_rack) * np.diff(give**2),
    }


def error(terms: dict[str, Array]) -> tuple[float, float]:
    """Largest sum of the error of a balance up to any time, and the work of hand and motor over the run [J]."""
    given = sum(terms[name] for name in GIVEN)
    taken = sum(work for name, work in terms.items() if name not in GIVEN)
    return float(np.abs(np.cumsum(given - taken)).max()), float(np.sum(given))
