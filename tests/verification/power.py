"""Energy and power of steering and chassis."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import simpson
from scipy.optimize import brentq

from steer_env import friction
from steer_env.vehicle import cars, plant
from steer_env.vehicle.chassis import available, two_track
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.layout import plant_layout
from tests.verification.common import power
from tests.verification.common.rows import Row, at_most
from tests.verification.common.two_track_power import at_tie_rods, energies, powers

Array = NDArray[np.float64]

SLIPPERY = 1e-9  # friction of the road at which a parked tyre has its load only [1]
MOST = 0.005  # of the work


def rows() -> Iterator[Row]:
    """Parked rack against the energy stored; power of the steering, worst law; work in weave and lane change."""
    car = cars.load()
    rack = np.linspace(0.0, car.steering["rack_limit"], 15)
    for name, parked in (("single_track", _parked_single_track), ("two_track", _parked_two_track)):
        force, stored = parked(car, rack)
        work = simpson(force, x=rack)
        yield at_most(f"parked to the lock, {name}", abs(work / stored - 1.0), MOST, "of the energy stored")
    hands = {name: power.hands(car, name) for name in ("weave", "double-lane-change")}
    for chassis in available():
        for name, (speed, u, _) in hands.items():
            errors = []
            for law in friction.available():
                p = car.plant(law, speed, robot=True, chassis=chassis)
                error, given = power.error(power.steering(p, *power.recorded(p, u, plant.initial_state(p))))
                errors.append(error / abs(given))
            yield at_most(f"steering, {name}, {chassis}", errors, MOST, "of the work of hand and motor")
    works = [_work_on_two_tracks(car, speed, u) for speed, u, _ in hands.values()]
    for term in works[0]:
        both = " ".join(f"{round(work[term], 1) + 0.0:.1f}" for work in works)
        yield Row(f"two_track, work: {term}", f"{both} J", "no limit", "pass")


def _rack_force(p: plant.Plant, x: Array, rack: float) -> tuple[Array, float]:
    """Derivative of the chassis states (S,) and rack force [N] at a rack position [m], without inputs."""
    kind = plant.chassis.chassis_of(p.chassis)
    dx, u = np.zeros(len(x)), np.zeros(len(plant.INPUTS))
    return dx, kind.derivative(p.chassis, p.strut, p.tyre[0], x, rack, 0.0, u, dx, np.zeros(len(kind.outputs)))


def _load_only(p: plant.Plant) -> plant.Plant:
    """The plant with tyres that carry load only: without friction, overturning moment and rolling resistance."""
    tyre, d = p.tyre.copy(), p.chassis
    for name in tyre.dtype.names:
        if name.startswith(("QSX", "QSY")):
            tyre[name] = 0.0
    if not isinstance(d, two_track.TwoTrack):
        return p._replace(tyre=tyre, chassis=d._replace(mu=SLIPPERY))
    body = d.body.copy()
    body["mu"] = SLIPPERY
    return p._replace(tyre=tyre, chassis=d._replace(body=body))


def _parked_single_track(car: cars.Car, rack: Array) -> tuple[Array, float]:
    """Rack force (N,) [N] of loads at the travel of this chassis, and their work at constant strut lengths [J]."""
    p = _load_only(car.plant(speed=3.0))
    d = p.chassis
    load, weight = 0.5 * GRAVITY * d.m * d.b / (d.a + d.b), 0.5 * GRAVITY * d.m_uf

    def stored(q: float, length: float) -> float:
        s = brentq(lambda s: float(car.strut.solve(q, s).strut_length) - length, -0.01, 0.01, xtol=1e-14)
        pose = car.strut.solve(q, s)
        return weight * float(pose.wheel_centre[2]) - load * float(pose.contact[2])

    def slope(q: float) -> float:
        length = float(car.strut.solve(q, 0.0).strut_length)
        return (stored(q + 1e-4, length) - stored(q - 1e-4, length)) / 2e-4

    x = np.zeros(len(plant.chassis.chassis_of(d).states))
    force = [_rack_force(p, x, q)[1] for q in rack]
    return np.array(force), float(simpson([slope(q) - slope(-q) for q in rack], x=rack))


def _parked_two_track(car: cars.Car, rack: Array) -> tuple[Array, float]:
    """Rack force (N,) [N] of the car that settles at each rack position, and the change of its energy [J]."""
    t, p = two_track, _load_only(car.plant(speed=0.0, chassis="two_track"))
    x, force, settled = np.zeros(len(t.STATES)), [], []
    t.begin(p.chassis, p.strut, p.tyre[0], x)
    free, rates = (
        [t.Z, t.ROLL, t.PITCH, *range(t.TRAVEL, t.TRAVEL + 4)],
        [t.W, t.P, t.Q, *range(t.TRAVEL_RATE, t.OMEGA)],
    )

    def left_over(y: Array) -> Array:
        x[free] = y
        return _rack_force(p, x, q)[0][rates]

    for q in rack:
        y = x[free].copy()
        for _ in range(6):  # Newton's method
            y -= np.linalg.solve(
                np.transpose([(left_over(y + e) - left_over(y - e)) / 2e-6 for e in 1e-6 * np.eye(7)]), left_over(y)
            )
        left_over(y)
        force.append(_rack_force(p, x, q)[1])
        settled.append(x.copy())
    stored = np.sum(
        list(energies(p.chassis.body[0], p.strut, np.array(settled), np.stack([rack, rack], -1)).values()), axis=0
    )
    return np.array(force), float(stored[-1] - stored[0])


def _work_on_two_tracks(car: cars.Car, speed: float, u: Array) -> dict[str, float]:
    """Work of each term of the power balance over a run, changes of energy, and what is left of the balance [J]."""
    p = car.plant("lugre", speed, robot=True, chassis="two_track")
    _, passed = power.recorded(p, u, plant.initial_state(p))
    at = plant_layout(p)
    passed = passed[passed[:, at.steps] == 0.0]  # at the evaluations of the chassis
    x, dx, out = (
        passed[:, a:b] for a, b in ((at.chassis, at.rate), (at.rate, at.rate_before), (at.outputs, at.outputs_before))
    )
    rack, force = at_tie_rods(p.chassis.body[0], x, dx, p.pinion_radius * passed[:, [2, 3]])
    rate = {"rack": (force * rack[..., 1]).sum(1), **powers(p.chassis, p.strut, x, dx, out, rack)}
    work = {name: float(np.trapezoid(value, dx=plant.CHASSIS_STEP)) for name, value in rate.items()}
    change = {
        f"change of {name}": float(e[-1] - e[0])
        for name, e in energies(p.chassis.body[0], p.strut, x, rack[..., 0]).items()
    }
    return {**work, **change, "rest": sum(work.values()) - sum(change.values())}
