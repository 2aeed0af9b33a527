"""Derived quantities of a car, each with the range in which those of passenger cars lie, and the source of the range.

The ranges are in ``experiments/data/ranges/car.toml``; those of the on-centre metrics are in the metrics' definitions.
"""

import math
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env import metrics
from steer_env.experiments.pages.words import change, label, number
from steer_env.experiments.reports import car_suspension
from steer_env.experiments.reports.car_simulated import SPEED, SPEEDS, Simulated
from steer_env.friction.numerics import toml
from steer_env.recording.recording import DEGREE
from steer_env.vehicle.analysis import understeer
from steer_env.vehicle.analysis.linear import from_car
from steer_env.vehicle.cars import Car, plausible
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.steering import wire_loops
from steer_env.vehicle.steering.by_wire import Wire
from steer_env.vehicle.steering.eps import boost_curve
from steer_env.vehicle.tyre import cornering_stiffness

RANGES = Path(__file__).parents[1] / "data" / "ranges" / "car.toml"
PUBLISHED, JUDGEMENT, NO_RANGE = "published", "engineering judgement", "no published range"
LIMIT_TRIED = SPEEDS[-1]  # [m/s]
# Quantities of ``plausible`` that the page has in another group.
_MOVED_QUANTITIES = (
    *("roll gradient", "steering ratio"),
    *(f"cornering stiffness over load of a {axle} tyre" for axle in ("front", "rear")),
    *(f"chassis.rear_{key}" for key in ("roll_centre", "bump_steer", "camber_gain", "lateral_compliance")),
)
PER_G = GRAVITY / DEGREE  # [deg/g] of 1 rad s2/m
CHASSIS = {"single_track": "single track", "two_track": "two tracks"}


class Quantity(NamedTuple):
    """A derived quantity of a car."""

    group: str
    name: str
    title: str
    value: float  # NaN where the car has none [unit]
    unit: str
    low: float = -math.inf  # of the range [unit]
    high: float = math.inf  # of the range [unit]
    basis: str = NO_RANGE  # of the range: published, engineering judgement, or none
    source: str = ""  # of the range
    note: str = ""

    @property
    def plausible(self) -> bool | None:
        """Whether the value is in its range; None without a range or a value."""
        return None if self.basis == NO_RANGE or math.isnan(self.value) else self.low <= self.value <= self.high

    @property
    def limits(self) -> str:
        """The range in words."""
        low, high = (number(x, 4) if math.isfinite(x) else "" for x in (self.low, self.high))
        return f"{low} to {high}" if low and high else f"≥ {low}" if low else f"≤ {high}" if high else "–"


@cache
def ranges() -> dict[str, dict[str, Any]]:
    """Range by name of the quantity, with ``low`` or ``high`` or both, ``source``, and ``judgement`` if it is one."""
    return toml.loads(RANGES.read_text(encoding="utf-8"))


class _Group:
    """Quantities under one heading, which get their ranges as they are added."""

    def __init__(self, title: str) -> None:
        self.title, self.found = title, list[Quantity]()

    def add(self, name: str, title: str, value: float, unit: str, note: str = "") -> None:
        given = ranges().get(name)
        limits: dict[str, Any] = {}
        if given:
            limits = {key: given[key] for key in ("low", "high", "source") if key in given}
            limits["basis"] = JUDGEMENT if given.get("judgement") else PUBLISHED
        self.found.append(Quantity(self.title, name, title, float(value) + 0.0, unit, note=note, **limits))


def numbers(car: Car) -> list[Quantity]:
    """Numbers of the car file, and simple ratios of them, beside what is usual; loading an own car warns of these."""
    title = "Numbers of the car file"
    group, c = _Group(title), car.chassis
    unsprung = (c["mass"] - c["sprung_mass"]) * car.strut.loaded_radius
    height, track = (c["sprung_mass"] * c["sprung_height"] + unsprung) / c["mass"], c["front_track"] + c["rear_track"]
    title_of = "track over twice the height of the centre of gravity"
    group.add("static_stability_factor", title_of, 0.25 * track / height, "1")
    radius = math.sqrt(c["roll_inertia"] / c["sprung_mass"])
    group.add("roll_radius", "roll radius of gyration of the body over track", 2.0 * radius / track, "1")
    index = c["pitch_inertia"] / (c["sprung_mass"] * c["front_axle"] * c["rear_axle"])
    group.add("pitch_dynamic_index", "dynamic index of pitch of the body", index, "1")
    for q in plausible.quantities(car):
        if q.name not in _MOVED_QUANTITIES:
            basis = JUDGEMENT if q.source == plausible.JUDGEMENT else PUBLISHED
            source = "" if basis == JUDGEMENT else q.source
            section, _, key = q.name.rpartition(".")
            shown = f"{label(key)} ({section})" if section else q.name
            value = q.value(car)
            note = "no strength of them does" if math.isinf(value) else ""  # such as that of functions that are off
            group.found.append(Quantity(title, q.name, shown, value, q.unit, q.low, q.high, basis, source, note))
    return group.found


def cornering(car: Car, found: Simulated) -> list[Quantity]:
    """Understeer, cornering compliances and the delay of the yaw."""
    group, c = _Group("Cornering at 100 km/h"), car.chassis
    a, b = c["front_axle"], c["rear_axle"]
    for axle, share in (("front", b), ("rear", a)):
        load = 0.5 * GRAVITY * c["mass"] * share / (a + b)
        stiffness = cornering_stiffness(car.tyre.symmetric().coefficients, load)
        stiffness *= c[f"{axle}_cornering_stiffness_factor"]
        title = f"cornering stiffness of a {axle} tyre over its load"
        group.add(f"{axle}_stiffness_over_load", title, stiffness / load, "1/rad")
    front, rear = (PER_G * x for x in understeer.cornering_compliances(car, SPEED))
    group.add("front_cornering_compliance", "cornering compliance of the front axle", front, "deg/g")
    group.add("rear_cornering_compliance", "cornering compliance of the rear axle", rear, "deg/g")
    budget = {term: PER_G * value for term, value in understeer.budget(car, SPEED).items()}
    for term, value in budget.items():
        group.add(f"understeer: {term}", f"understeer from {term}", value, "deg/g")
    total = sum(budget.values())
    group.add("understeer_gradient", "understeer gradient, sum of these terms", total, "deg/g")
    for chassis, steady in found.steady.items():
        title = f"understeer gradient, simulated ({CHASSIS[chassis]})"
        simulated = PER_G * steady.understeer
        linear = PER_G * sum(understeer.budget(car, SPEED, chassis).values())
        note = f"{change(simulated / linear - 1.0)} from the linear model of this chassis"
        group.add(f"understeer_gradient_{chassis}", title, simulated, "deg/g", note)
    twist = PER_G * car.steering_gain() * found.steady["single_track"].twist
    note = "counts as understeer where the handwheel angle is measured"
    group.add("torsion_bar_understeer", "twist of the torsion bar, at the road wheels", twist, "deg/g", note)
    _speed_of_understeer(group, car, total if math.isnan(twist) else total + twist)
    for chassis, steady in found.steady.items():
        title = f"roll gradient, simulated ({CHASSIS[chassis]})"
        group.add(f"roll_gradient_{chassis}", title, PER_G * steady.roll, "deg/g")
    for (chassis, law), lag in found.lag.items():
        name, note = f"yaw_lag_{chassis}", "behind the handwheel"
        title = f"yaw lag at 0.2 Hz, simulated with friction ({CHASSIS[chassis]})"
        if law == "none":
            linear = understeer.yaw_lag(car, SPEED, chassis=chassis)
            note = f"linear model of this chassis {number(1e3 * linear)} ms"
            name, title = f"{name}_without_friction", title.replace("with friction", "without friction")
        group.add(name, title, 1e3 * lag, "ms", note)
    note = "of the cornering compliances, with the yaw inertia m a b"
    group.add("bundorf_lag", "yaw lag by Bundorf's form", 1e3 * understeer.bundorf_lag(car, SPEED), "ms", note)
    return [q._replace(note="the car finds no steady turn") if math.isnan(q.value) else q for q in group.found]


def _speed_of_understeer(group: _Group, car: Car, gradient: float) -> None:
    """The characteristic speed of a car that understeers, or the critical speed of one that oversteers."""
    wheelbase = car.chassis["front_axle"] + car.chassis["rear_axle"]
    speed, note = (
        3.6 * math.sqrt(wheelbase / abs(gradient / PER_G)),
        "handwheel fixed: with the twist of the torsion bar",
    )
    if gradient > 0.0:
        group.add("characteristic_speed", "characteristic speed at the handwheel", speed, "km/h", note)
    else:
        group.add("critical_speed", "critical speed, above which the car is unstable", speed, "km/h", note)


def modes(car: Car) -> list[Quantity]:
    """Natural frequencies and damping ratios of yaw and roll."""
    group = _Group("Natural frequencies and damping at 100 km/h")
    poles = from_car(car, SPEED).state_space().poles()
    square, damping = float(np.prod(poles).real), -float(np.sum(poles).real)
    omega = math.sqrt(square) if square > 0.0 else math.nan
    note = "" if square > 0.0 else "the car is unstable at 100 km/h"
    group.add("yaw_frequency", "natural frequency of the yaw", omega / (2.0 * math.pi), "Hz", note or "handwheel fixed")
    group.add("yaw_damping", "damping ratio of the yaw", damping / (2.0 * omega), "1", note)
    p = car.plant().chassis
    stiffness, rate = p.K_f + p.K_r - p.m_s * GRAVITY * p.h, p.C_f + p.C_r
    omega = math.sqrt(stiffness / p.I_xr) if stiffness > 0.0 else math.nan
    note = "" if stiffness > 0.0 else "the body tips over"
    group.add("roll_frequency", "natural frequency of the roll", omega / (2.0 * math.pi), "Hz", note)
    group.add("roll_damping", "damping ratio of the roll", rate / (2.0 * p.I_xr * omega), "1", note)
    share = 100.0 * p.K_f / (p.K_f + p.K_r)
    group.add("front_roll_stiffness_share", "share of the roll stiffness at the front", share, "%")
    return group.found


def suspension(car: Car) -> list[Quantity]:
    """Kinematics and compliance of both axles straight ahead."""
    group, slopes, pose = _Group("Kinematics and compliance"), car_suspension.slopes(car), car.strut.straight
    heights = float(pose.roll_centre_height), car.chassis["rear_roll_centre"]
    for i, axle in enumerate(("front", "rear")):
        group.add(f"{axle}_roll_centre", f"height of the {axle} roll centre", 1e3 * heights[i], "mm")
        toe, camber = (0.1 / DEGREE * slope[i] for slope in (slopes.toe, slopes.camber))
        group.add(f"{axle}_toe_gain", f"toe-in of a {axle} wheel by travel", toe, "deg/100 mm")
        group.add(f"{axle}_camber_gain", f"camber of a {axle} wheel by travel", camber, "deg/100 mm")
        roll_camber = 100.0 * (1.0 + 0.5 * car.chassis[f"{axle}_track"] * slopes.camber[i])
        group.add(f"{axle}_roll_camber", f"camber by roll, {axle}", roll_camber, "%", "inclination over roll angle")
        roll_steer = 100.0 * slopes.roll_steer[i]
        group.add(f"{axle}_roll_steer", f"roll understeer, {axle}", roll_steer, "%", "steer angle over roll angle")
        lateral = 1e3 / DEGREE * slopes.lateral_steer[i]
        group.add(f"{axle}_lateral_steer", f"understeer by lateral force, {axle}", lateral, "deg/kN", "of each wheel")
    aligning = 100.0 / DEGREE * slopes.aligning_steer[0]
    title = "understeer by aligning torque, front"
    group.add("front_aligning_steer", title, aligning, "deg/(100 N m)", "of each wheel")
    group.add("caster", "caster", float(pose.caster) / DEGREE, "deg")
    group.add("kingpin_inclination", "king-pin inclination", float(pose.kingpin_inclination) / DEGREE, "deg")
    group.add("caster_trail", "mechanical trail", 1e3 * float(pose.trail), "mm")
    group.add("scrub_radius", "scrub radius", 1e3 * float(pose.scrub), "mm", "contact outboard of the axis")
    return group.found


def steering(car: Car, found: Simulated) -> list[Quantity]:
    """Steering ratio, locks, stiffness, and the loop of the assist."""
    group, s, curves = _Group("Steering"), car.steering, car_suspension.curves(car)
    inner, outer = float(curves.left[-1]), float(curves.right[-1])
    ideal = float(curves.ideal_right[-1])
    wheelbase = car.chassis["front_axle"] + car.chassis["rear_axle"]
    # The rear axle's centre turns about the point to which both front wheels point on average.
    radius = 0.5 * wheelbase * (1.0 / math.tan(inner) + 1.0 / math.tan(outer))
    circle = 2.0 * math.hypot(radius + 0.5 * car.chassis["front_track"], wheelbase)
    group.add("steering_ratio", "handwheel over road-wheel angle, straight ahead", car.steering_ratio(), "1")
    group.add("rack_per_turn", "rack travel per turn", 2e3 * math.pi * s["pinion_radius"], "mm")
    group.add("turns", "turns from lock to lock", car.handwheel_lock(0.0) / math.pi, "1")
    group.add("inner_lock", "largest angle of the inner wheel", inner / DEGREE, "deg")
    group.add("outer_lock", "angle of the outer wheel there", outer / DEGREE, "deg")
    group.add("ackermann", "Ackermann at lock", 100.0 * (inner - outer) / (inner - ideal), "%")
    group.add("turning_circle", "turning circle of the outer front wheel", circle, "m", "geometric, without slip")
    if isinstance(wire := car.assist.wire, Wire):
        longest = 1e3 * min(wire_loops.passive_delay(wire, speed) for speed in wire.speeds)
        note = (
            f"beyond it the hand may draw work from the feel; its motor has {1e3 * wire.delay + 1e3 * wire.offset:g} ms"
        )
        group.add("passive_delay", "longest delay of a passive feel, up to 10 Hz", longest, "ms", note)
    for kph in (0.0, 100.0):
        cells = found.assist[kph]
        where = "parking" if kph == 0.0 else f"{kph:g} km/h"
        gain = max((cell.gain for cell in cells), default=0.0)
        if isinstance(wire, Wire):
            damping = float(np.interp(kph / 3.6, wire.speeds, wire.damping))
            group.add(f"feel_stiffness_{kph:g}", f"largest slope of the feel over the angle, {where}", gain, "N m/rad")
            group.add(f"feel_damping_{kph:g}", f"damping of the handwheel, {where}", damping, "N m s/rad")
        else:
            group.add(f"assist_gain_{kph:g}", f"largest slope of the boost curve, {where}", gain, "1")
            damping = float(boost_curve(car.assist, 0.0, kph / 3.6)[1])
            group.add(f"motor_damping_{kph:g}", f"motor damping, {where}", damping, "N m s/rad", "at the column")
        for key, title, unit in (("phase_deg", "phase margin", "deg"), ("gain_db", "gain margin", "dB")):
            least = min((getattr(cell, key) for cell in cells if math.isfinite(getattr(cell, key))), default=math.nan)
            note = "of the column with fixed hands; analyse has the whole car, too" if kph else ""
            note = "the loop is unstable" if any(not cell.stable for cell in cells) else note
            note = "the loop gain stays below one" if math.isnan(least) else note
            group.add(
                f"{key.split('_')[0]}_margin_{kph:g}", f"least {title} of the assist loop, {where}", least, unit, note
            )
    return group.found


def hands_off(found: Simulated) -> list[Quantity]:
    """Free control: the limit speeds after a pulse of the hands, and the damping without friction."""
    group = _Group("Hands off, after a pulse of 3 N m for 0.3 s")
    for chassis, free in found.hands_off.items():
        for law, limit in free.limit.items():
            friction = "without friction" if law == "none" else "with friction"
            name = f"hands_off_limit_{friction.split()[0]}_friction_{chassis}"
            note = (
                "the highest speed tried; it may take longer than 6 s"
                if limit >= LIMIT_TRIED
                else "it may take longer than 6 s"
            )
            title = f"highest speed at which the motion decays or sticks, {friction} ({CHASSIS[chassis]})"
            group.add(name, title, 3.6 * limit, "km/h", note)
        least = float(np.interp(SPEED, SPEEDS, free.damping))
        title = f"least damping ratio at 100 km/h, without friction ({CHASSIS[chassis]})"
        group.add(f"hands_off_damping_{chassis}", title, least, "1")
    return group.found


def parking(found: Simulated) -> list[Quantity]:
    """Effort of parking."""
    group = _Group("Parking, from lock to lock")
    values = {name: value.value for name, value in found.parking["assisted"].values.items()}
    off = found.parking["unassisted"].values["handwheel_torque_mean"].value
    group.add("rack_force_at_centre", "rack force, at the centre", 1e-3 * values["rack_force_at_centre"], "kN")
    group.add("rack_force_peak", "rack force, peak", 1e-3 * values["rack_force_peak"], "kN", "clear of the end stops")
    group.add("parking_torque_mean", "hand torque, mean", values["handwheel_torque_mean"], "N m")
    group.add("parking_torque_peak", "hand torque, peak", values["handwheel_torque_peak"], "N m")
    group.add("parking_torque_unassisted", "hand torque without assist, mean", off, "N m")
    group.add("motor_power_peak", "mechanical power of the motor, peak", values["motor_power_peak"], "W")
    return group.found


def on_centre(found: Simulated) -> Iterator[Quantity]:
    """Metrics of the weave at 100 km/h that have a usual range."""
    group = "On-centre feel, weave at 100 km/h"
    for name, value in found.weave.items():
        definition = metrics.definition(name)
        if definition.usual and name != "yaw_lag":  # which is among the quantities of cornering
            low, high = definition.usual
            source = f"usual range of the metric ({definition.source})"
            yield Quantity(
                group, name, label(name), value.value, value.unit, low, high, JUDGEMENT, source, value.reason
            )


def collect(car: Car, found: Simulated) -> list[Quantity]:
    """Every derived quantity of a car."""
    groups: Iterable[Iterable[Quantity]] = (
        cornering(car, found),
        modes(car),
        suspension(car),
        steering(car, found),
        hands_off(found),
        parking(found),
        on_centre(found),
        numbers(car),
    )
    return [quantity for group in groups for quantity in group]
