"""What the page lets its reader change: parameters of a friction law and of a car, with their ranges and refusals.

A slider goes over the usual range that the keys of a car file declare, where they declare one. The words that refuse a
value are those of the constructor that refuses it in Python: it is asked once, for a value that is no number. A
parameter that follows others by default, as the break-away torque follows the sliding torque, follows them here.
"""

import inspect
import itertools
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from steer_env.connect.variables import comment_and_unit
from steer_env.friction import defaults, make, sites
from steer_env.friction.law import LAWS
from steer_env.friction.numerics.check import not_negative, number
from steer_env.friction.numerics.packing import leaves, pack
from steer_env.vehicle import cars, step_limit
from steer_env.vehicle.cars import Car
from steer_env.vehicle.keys import checked, declared_keys
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.steering import column, eps
from steer_env.vehicle.steering.by_wire import SECTION, Wire
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.steering.kinds import common as kinds

KPH = 1.0 / 3.6  # [m/s]
Values = Mapping[str, float]


class Parameter(NamedTuple):
    """A slider with its number field."""

    name: str  # section and key of a car file, friction.KEY, friction.SITE.KEY, or one of the names of the drive
    group: str
    label: str
    unit: str
    low: float  # of the slider [unit]
    high: float  # of the slider [unit]
    value: float  # of the car or the law [unit]
    refusal: str  # of a value that Python refuses, with {} in its place
    least: float  # that Python takes [unit]
    most: float  # that Python takes [unit]
    above: bool  # whether the least value itself is refused


# Keys with one number: from their usual range.
_SINGLE_KEYS = {
    "column.K_tb": "Torsion bar",
    "column.I1": "Inertia of the handwheel",
    "column.I2": "Inertia below the torsion bar",
    "column.C2": "Damping below the torsion bar",
    "steering.pinion_radius": "Pinion radius (steering ratio)",
    "steering.friction_load": "Friction by load",
    "chassis.front_cornering_stiffness_factor": "Front tyre stiffness",
    "chassis.rear_cornering_stiffness_factor": "Rear tyre stiffness",
}
# Keys with a value for each speed of the boost table, whose largest the slider gives: the page's ranges are assumed.
_BY_SPEED = {
    "boost_scale": ("Boost", 0.5, 1.5),
    "damping": ("Damping of the motor", 0.0, 8.0),
    "handwheel_damping": ("Damping of the handwheel", 0.0, 1.0),
    "friction_share": ("Friction compensation", 0.0, 1.0),
    "return_gain": ("Active return", 0.0, 10.0),
}
# Numbers of a steer-by-wire, in place of those of the assist.
_OF_WIRE = {"feel_scale": "Feel", "feedback_limit": "Largest torque of the feedback motor"}
SCALE_NAME, LOAD_NAME, SPEED_NAME = "friction_scale", "load", "speed_kph"
BOOST = "boost_scale"  # whose factor at each speed has a slider too
_LAW_SPAN = 3.0  # factor on the default of a law's parameter, either way, over which its slider goes; assumed
_SPANS = {"x_c": 2.0}  # of others; assumed
# Of a site of friction beside its law: meaning, unit, range of the slider, and value by default; assumed.
_OF_SITE = {
    "efficiency": ("of both directions", "1", 0.6, 1.0, 1.0),
    "driving": ("growth with the motor's torque that drives", "1/(N m)", 0.0, 0.5, 0.0),
    "driven": ("growth with the motor's torque against the motion", "1/(N m)", 0.0, 0.5, 0.0),
    "load": ("growth with the rack force", "1/N", 0.0, 2e-4, 0.0),
    "asymmetry": ("increase to the left, decrease to the right", "1", -0.3, 0.3, 0.0),
    "position": ("increase by the position at its peak", "1", 0.0, 0.5, 0.0),
}
# Of all ranges, the first with which the step equation of every plant has one solution (vehicle/step_limit.py).
_SHARES = (1.0, 0.7, 0.5, 0.35, 0.25)
_LIMIT = re.compile(r"(greater than|at least|at most|from|to) (-?[\d.]+(?:e[+-]?\d+)?)")


def of_law(law: str) -> dict[str, float]:
    """The parameters of a law that have a slider, with their defaults."""
    taken = inspect.signature(LAWS[law].make).parameters
    found = {key: p.default for key, p in taken.items() if isinstance(p.default, float)}
    own = {"F_c": defaults.F_C, "x_c": defaults.F_C / (2.0 * defaults.SIGMA_0)}  # as the law takes them itself
    return {key: value for key, value in own.items() if key in taken} | found


def every(car: Car, law: str, chassis: str) -> list[Parameter]:
    """The parameters of the page for a car with a law, or sites as text, on a chassis, in the order of the page.

    ValueError where no ranges are narrow enough for the step equations to have one solution in all of them.
    """
    whole = [*_of_friction(law), *_of_drive(chassis), *_of_assist(car), *_of_car(car)]
    for share in _SHARES:
        found = [_narrowed(q, share) for q in whole]
        if _single(car, law, chassis, found):
            return found
    raise ValueError(f"friction law {law!r} falls too steeply with the speed for the sliders of a page")


def _narrowed(q: Parameter, share: float) -> Parameter:
    return q._replace(low=q.value - share * (q.value - q.low), high=q.value + share * (q.high - q.value))


def _single(car: Car, law: str, chassis: str, parameters: list[Parameter]) -> bool:
    """Whether the step equation has one solution where the sliders make that least likely."""
    ends = {q.name: q.low if q.name.startswith("column.") else q.high for q in parameters}

    def fall(own: dict[str, float]) -> float:
        p = plant(car, law, chassis, {**ends, **own})
        load, level = step_limit.LARGEST_RACK_FORCE, p.friction_torque_scale
        return sum(sites.falls(p.friction, p.level, level, load, p.assist.limit, SAMPLE_TIME))

    own = [q for q in parameters if q.name.startswith("friction.")]
    try:
        # The falls of sites add up, and each has its corner where its own is largest.
        for _, group in itertools.groupby(own, lambda q: q.group):
            spans = [[(q.name, end) for end in (q.low, q.high)] for q in group]
            corners = [dict(corner) for corner in itertools.product(*spans)]
            steepest = max(corners, key=fall)
            ends |= steepest
        plant(car, law, chassis, ends)
    except ValueError:
        return False
    return True


def _parameter(
    name: str, group: str, label: str, unit: str, span: tuple[float, float], value: float, refuse: Callable[[Any], Any]
) -> Parameter:
    """A parameter, with what ``refuse`` says of a value that is no number; its span is within what that takes."""
    try:
        refuse(np.nan)
    except ValueError as error:
        words = str(error)
    limits = {word: float(text) for word, text in _LIMIT.findall(words)}
    least = limits.get("greater than", limits.get("at least", limits.get("from", -np.inf)))
    most = limits.get("at most", limits.get("to", np.inf))
    low, high = max(min(span[0], value), least), min(max(span[1], value), most)
    refusal, above = words.replace("nan", "{}"), "greater than" in words
    return Parameter(name, group, label, unit, low, high, value, refusal=refusal, least=least, most=most, above=above)


def _of_friction(law: str) -> Iterator[Parameter]:
    """The parameters of a law, or of sites as text."""
    if law in LAWS.available():
        for key, value in of_law(law).items():
            yield _of_law(law, law, f"friction.{key}", "Friction law", value)
        return
    resolved = sites.resolve(law)
    for site, given in sites.as_given(law).items():
        if site in resolved._fields and not sites.acts(resolved, site, "law"):
            continue  # a module leaves out what gives no friction at all
        for key, value in _of_site(site, given).items():
            # One that is given otherwise, as elements in place of F_c, or that another given one bounds, has no slider.
            if _numbers_with(law, {f"{site}.{key}": value}) != _numbers_with(law, {}):
                continue
            found = _of_law(law, given["law"], f"friction.{site}.{key}", f"Friction: {site.replace('_', ' ')}", value)
            if all(_numbers_with(law, {f"{site}.{key}": end}) for end in (found.low, found.high)):
                yield found


def friction_argument(law: str) -> dict[str, Any]:
    """What ``friction=`` takes for a law, or for sites as text, with the parameters that follow another without it."""
    found: dict[str, Any] = {"law": law} if law in LAWS.available() else {**sites.as_given(law)}
    for q in _of_friction(law):
        *site, key = q.name.split(".")[1:]
        if key == "x_c":  # of which the page has a value of its own
            (found[site[0]] if site else found)[key] = q.value
    return found


def _of_site(site: str, given: Mapping[str, Any]) -> dict[str, float]:
    """The parameters of a site that may have a slider, with their values."""
    found = of_law(given["law"])
    if "x_c" in found and "F_c" in given:
        found["x_c"] = given["F_c"] / (2.0 * defaults.SIGMA_0)  # as the law takes it itself
    own = ["asymmetry", "position"] if site == sites.ABOVE else ["load", "asymmetry", "position"]
    if site == "gear" or site in defaults.SHARES:
        own = [*(("driving", "driven") if {"driving", "driven"} & given.keys() else ("efficiency",)), *own]
    found |= {key: _OF_SITE[key][-1] for key in own}
    if "efficiency" in own and site != "gear":
        found["efficiency"] = defaults.GEAR_EFFICIENCY[site]
    found = {key: given.get(key, value) for key, value in found.items()}
    return {key: value for key, value in found.items() if isinstance(value, float)}  # no lists


def _numbers_with(law: str, values: Values) -> list[float] | None:
    """The packed numbers of sites with other values; None where they are refused."""
    try:
        return pack(sites.varied(law, values)).numbers.tolist()
    except ValueError:
        return None


def _of_law(friction: str, law: str, name: str, group: str, value: float) -> Parameter:
    """A parameter of a law, by itself or at a site of ``friction``."""
    own = name.removeprefix("friction.")
    key = own.rpartition(".")[2]
    known = {leaf.path[0]: comment_and_unit(leaf, leaf.path[0], leaf.owner) for leaf in leaves(make(law))}
    told = {"F_c": ("sliding torque", "N m"), "x_c": ("deflection scale of the virgin curve", "rad"), **known}
    text, unit = told.get(key, (key, ""))
    factor = _SPANS.get(key, _LAW_SPAN)
    span = (value / factor, value * factor) if value else (0.0, _zero_span(unit))
    if key in _OF_SITE:
        text, unit, *ends, _ = _OF_SITE[key]
        span = (ends[0], ends[1])

    def refuse(value: Any) -> Any:
        return sites.varied(friction, {own: value})

    return _parameter(name, group, f"{own}, {text}", unit, span, value, refuse)


def _zero_span(unit: str) -> float:
    """End of the slider of a law's parameter that is 0 by default; assumed."""
    return {"N m s/rad": defaults.SIGMA_1, "N m/rad": defaults.SIGMA_0}.get(unit, 1.0)


def _of_drive(chassis: str) -> list[Parameter]:
    return [
        _parameter(SCALE_NAME, "Drive", "Friction scale", "1", (0.25, 3.0), 1.0, partial(not_negative, SCALE_NAME)),
        _parameter(LOAD_NAME, "Drive", "Load", "kg", (0.0, 500.0), 0.0, partial(not_negative, LOAD_NAME)),
        _parameter(SPEED_NAME, "Drive", "Speed", "km/h", (40.0, 160.0), 100.0, partial(_speed, chassis)),
    ]


def _speed(chassis: str, kph: Any) -> float:
    """A held speed [km/h], checked."""
    low, high = (speed / KPH for speed in cars.SPEEDS[chassis])
    return number(SPEED_NAME, kph, minimum=low, maximum=high)


def _of_assist(car: Car) -> list[Parameter]:
    found: list[Parameter] = []
    refuse: Callable[[Any], Any]
    if isinstance(car.assist.wire, Wire):
        for key, label in _OF_WIRE.items():
            about, refuse = declared_keys()[SECTION][key], partial(checked, SECTION, key)
            value = car.given[SECTION][key]
            found.append(
                _parameter(f"{SECTION}.{key}", "By wire", label, about.unit, about.usual or (0.0, 1.0), value, refuse)
            )
        return found
    for key, (label, *span) in _BY_SPEED.items():
        unit, value = declared_keys()["assist"][key].unit, float(np.max(_profile(car, key)))
        refuse = partial(_by_speed, car, key)
        found.append(_parameter(f"assist.{key}", "Assist", label, unit, (span[0], span[1]), value, refuse))
    refuse = partial(checked, "assist", BOOST)
    for i, speed in enumerate(car.assist.speeds):
        label = f"Boost at {speed / KPH:.3g} km/h"
        found.append(_parameter(f"assist.{BOOST}.{i}", "Boost by speed", label, "1", (0.5, 1.5), 1.0, refuse))
    return found


def _of_car(car: Car) -> list[Parameter]:
    found = []
    follows = kinds.follows(car.kind)  # and could not be in the car file of the page, nor the radius that changes them
    follows |= {"steering.pinion_radius"} if follows else set()
    for name, label in _SINGLE_KEYS.items():
        if name in follows:
            continue
        section, key = name.split(".")
        about = declared_keys()[section][key]
        group = "Tyres" if section == "chassis" else "Steering"
        refuse = partial(checked, section, key)
        found.append(_parameter(name, group, label, about.unit, about.usual or (0.0, 1.0), _value(car, name), refuse))
    return found


def _value(car: Car, name: str) -> float:
    section, key = name.split(".")
    values = getattr(car, section)
    return float(values[key] if isinstance(values, dict) else getattr(values, key))


def _profile(car: Car, key: str) -> np.ndarray:
    """Values (V,) of a key of the assist for each speed."""
    given = car.given["assist"].get(key, inspect.signature(eps.make).parameters[key].default)
    return np.broadcast_to(np.asarray(given, float), car.assist.speeds.shape)


def profiles(car: Car) -> dict[str, list[float]]:
    """Values of the car at each speed of the boost table, by the names of the parameters that give the largest."""
    return {f"assist.{key}": _profile(car, key).tolist() for key in _BY_SPEED}


def _by_speed(car: Car, key: str, most: float) -> np.ndarray:
    """Values (V,) of a key of the assist whose largest is ``most``, in the proportions of the car; checked."""
    most = checked("assist", key, most)
    profile = _profile(car, key)
    return profile * (most / profile.max()) if profile.max() > 0.0 else np.full(profile.size, most)


def plant(car: Car, law: str, chassis: str, values: Values) -> Plant:
    """The plant of a car whose handwheel angle is prescribed, with values of the parameters in place of its own.

    It has every function of the assist, also where all of them are off, as one module serves all values.

    Raises
    ------
    ValueError
        A value that the car file or the law refuses.
    """
    own = {name.removeprefix("friction."): v for name, v in values.items() if name.startswith("friction.")}
    made = changed(car, values).loaded(not_negative(LOAD_NAME, values.get(LOAD_NAME, 0.0)))
    speed = _speed(chassis, values.get(SPEED_NAME, 100.0)) * KPH
    p = made.plant(sites.varied(law, own), speed, robot=True, chassis=chassis)
    return step_limit.checked(p._replace(friction_torque_scale=not_negative(SCALE_NAME, values.get(SCALE_NAME, 1.0))))


def changed(car: Car, values: Values) -> Car:
    """The car with values of its keys, and with every function of the assist."""

    def keys(section: str) -> dict[str, float]:
        names = (name for name in _SINGLE_KEYS if name.startswith(f"{section}."))
        return {name.split(".")[1]: values.get(name, _value(car, name)) for name in names}

    def table(section: str) -> dict[str, float]:
        return {key: checked(section, key, value) for key, value in keys(section).items()}

    return car._replace(
        column=column.make(**{**car.given["column"], **keys("column")}),
        assist=_assist(car, values),
        chassis={**car.chassis, **table("chassis")},
        steering={**car.steering, **table("steering")},
    )


def _assist(car: Car, values: Values) -> eps.Assist:
    keys = dict(car.given["assist"])
    for key in _BY_SPEED:
        keys[key] = _by_speed(car, key, values.get(f"assist.{key}", float(np.max(_profile(car, key)))))
    factors = (values.get(f"assist.{BOOST}.{i}", 1.0) for i in range(car.assist.speeds.size))
    keys[BOOST] = keys[BOOST] * [checked("assist", BOOST, factor) for factor in factors]
    share = keys.pop("friction_share")
    made = eps.make(**{**keys, "friction_share": 1.0})  # on, so that all functions are there
    functions: Any = made.functions
    observer = functions.friction_compensation._replace(gain=share)
    made = made._replace(functions=functions._replace(friction_compensation=observer))
    if not isinstance(car.assist.wire, Wire):
        return made
    own = {key: checked(SECTION, key, values.get(f"{SECTION}.{key}", car.given[SECTION][key])) for key in _OF_WIRE}
    given = {**car.given, SECTION: {**car.given[SECTION], **own}}
    return made._replace(wire=kinds.wire(given))
