"""Manoeuvres: what the hands do, defined once for the environments and for the test battery.

A manoeuvre prescribes the handwheel angle (steering robot) or the hand torque over time, at a held speed. Its amplitude
is given, or found so that the car reaches a lateral acceleration. Test conditions are after the named standards; no
conformance is claimed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from friction.check import positive
from friction.law import law_of
from steer_env.recording import Recording
from vehicle import plant
from vehicle.assist import SAMPLE_TIME
from vehicle.cars import Car
from vehicle.road import Road

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Manoeuvre:
    """One manoeuvre.

    ``hand(t, amplitude)`` gives the handwheel angle [rad] and speed [rad/s] (robot) or the hand torque [N m] and zero.
    """

    name: str
    hands: str  # what they do
    source: str
    speed: float  # [m/s]
    duration: float  # [s]
    hand: Callable[[Array, float], tuple[Array, Array]]
    robot: bool = True
    amplitude: float | None = None  # [rad] or [N m]; None: found for the lateral acceleration
    lateral_acceleration: float | None = None  # peak to reach [m/s2]
    frequency: float | None = None  # of a periodic manoeuvre [Hz]
    rig: bool = False  # steering on a rig: no rack load, assist off
    lock: bool = False  # the amplitude is all that the rack has
    chassis: str = "single_track"  # two_track where the car must be able to stand
    road: Road | None = None  # heights, split friction, grade, bank; two_track only

    @property
    def definition(self) -> str:
        """What is driven, in words."""
        aim = f", amplitude for {self.lateral_acceleration:g} m/s2" if self.lateral_acceleration else ""
        place = "on a rig" if self.rig else f"at {3.6 * self.speed:.4g} km/h" if self.speed else "at standstill"
        return f"{self.hands}{aim} {place}."


def sine(t: Array, amplitude: float, frequency: float) -> tuple[Array, Array]:
    """Sine that grows over its first cycle, so that the handwheel starts without a jerk; value and rate."""
    omega = 2.0 * np.pi * frequency
    s = np.clip(t * frequency, 0.0, 1.0)
    envelope = s * s * (3.0 - 2.0 * s)
    growth = 6.0 * s * (1.0 - s) * frequency
    return (
        amplitude * envelope * np.sin(omega * t),
        amplitude * (envelope * omega * np.cos(omega * t) + growth * np.sin(omega * t)),
    )


def ramp_and_hold(t: Array, amplitude: float, rise: float) -> tuple[Array, Array]:
    """Smooth rise to a level that is held; value and rate."""
    s = np.clip(t / rise, 0.0, 1.0)
    return amplitude * s * s * (3.0 - 2.0 * s), amplitude * 6.0 * s * (1.0 - s) / rise


def triangle(t: Array, amplitude: float, frequency: float) -> tuple[Array, Array]:
    """Triangle wave with rounded corners: nearly constant speed from end to end; value and rate."""
    omega, blunt = 2.0 * np.pi * frequency, 0.995
    s, scale = blunt * np.sin(omega * t), amplitude / np.arcsin(blunt)
    return scale * np.arcsin(s), scale * blunt * omega * np.cos(omega * t) / np.sqrt(1.0 - s * s)


def weave(frequency: float = 0.2, cycles: int = 12) -> Manoeuvre:
    """On-centre weave; the first and last cycle are for the metrics to drop."""
    return Manoeuvre(
        name="weave",
        hands=f"Sine of handwheel angle at {frequency:g} Hz, {cycles} cycles",
        source="after ISO 13674-1",
        speed=100.0 / 3.6,
        duration=cycles / frequency,
        hand=lambda t, amplitude: sine(t, amplitude, frequency),
        lateral_acceleration=2.0,
        frequency=frequency,
    )


def slow_ramp(frequency: float = 0.02, cycles: int = 5) -> Manoeuvre:
    """Weave so slow that vehicle lag and damping stay out of the loop: what is left of its width is friction."""
    return replace(
        weave(frequency, cycles),
        name="slow-ramp",
        source="after the slow-ramp test of steering-feel practice",
        speed=50.0 / 3.6,
    )


def hold(torque: float = 2.0) -> Manoeuvre:
    """Held-torque test: the hands pull to a torque and hold it; what still moves is the friction law's doing."""
    return Manoeuvre(
        name="hold",
        hands=f"Hand torque rises to {torque:g} N m in 0.5 s and is held for 5 s",
        source="after the held-steering comparison of LuGre and Masing, JSME D&D 2021, paper 557",
        speed=50.0 / 3.6,
        duration=5.5,
        hand=lambda t, amplitude: ramp_and_hold(t, amplitude, 0.5),
        robot=False,
        amplitude=torque,
    )


def rig(frequency: float = 0.2, cycles: int = 5, amplitude: float = 0.35) -> Manoeuvre:
    """Steering on a rig: rack unloaded, assist off, so the hand feels friction and inertia alone."""
    return Manoeuvre(
        name="rig",
        hands=f"Sine of handwheel angle, {np.degrees(amplitude):.0f} deg at {frequency:g} Hz, {cycles} cycles",
        source="steering-rig practice",
        speed=10.0,
        duration=cycles / frequency,
        hand=lambda t, amplitude: sine(t, amplitude, frequency),
        amplitude=amplitude,
        frequency=frequency,
        rig=True,
    )


def step_steer(start: float = 0.5, rise: float = 0.2) -> Manoeuvre:
    """Step steer: the handwheel turns as fast as people do, and stays."""
    return Manoeuvre(
        name="step-steer",
        hands=f"Handwheel angle rises in {rise:g} s and stays",
        source="after ISO 7401",
        speed=80.0 / 3.6,
        duration=6.0,
        hand=lambda t, amplitude: ramp_and_hold(t - start, amplitude, rise),
        lateral_acceleration=4.0,
    )


def _from_rest(t: Array, amplitude: float, frequency: float) -> tuple[Array, Array]:
    """Triangle wave whose first quarter is a smooth rise, so that the handwheel starts without a jerk."""
    quarter = 0.25 / frequency
    first, then = ramp_and_hold(t, amplitude, quarter), triangle(t, amplitude, frequency)
    return np.where(t < quarter, first[0], then[0]), np.where(t < quarter, first[1], then[1])


def parking(frequency: float = 1.0 / 24.0, cycles: int = 2) -> Manoeuvre:
    """Parking: from lock to lock with the car standing, at some 80 deg/s."""
    return Manoeuvre(
        name="parking",
        hands=f"Handwheel from lock to lock in {0.5 / frequency:g} s, {cycles} cycles, service brake released",
        source="parking test of steering-feel practice, 60 to 90 deg/s",
        speed=0.0,
        duration=cycles / frequency,
        hand=lambda t, amplitude: _from_rest(t, amplitude, frequency),
        frequency=frequency,
        lock=True,
        chassis="two_track",
    )


_MANOEUVRES: dict[str, Callable[[], Manoeuvre]] = {
    "weave": weave,
    "slow-ramp": slow_ramp,
    "step-steer": step_steer,
    "parking": parking,
    "hold": hold,
    "rig": rig,
}


def available() -> tuple[str, ...]:
    """Names of the manoeuvres."""
    return tuple(_MANOEUVRES)


def make(name: str) -> Manoeuvre:
    """A manoeuvre by name, as the standard has it; ValueError listing the names for any other."""
    if name not in _MANOEUVRES:
        raise ValueError(f"unknown manoeuvre {name!r}; available: {', '.join(available())}")
    return _MANOEUVRES[name]()


def build_plant(car: Car, manoeuvre: Manoeuvre, friction: Any) -> plant.Plant:
    """The plant that a manoeuvre needs: robot or free hands, on the road or on the rig."""
    p = car.plant(
        friction, speed=manoeuvre.speed, robot=manoeuvre.robot, chassis=manoeuvre.chassis, road=manoeuvre.road
    )
    if not manoeuvre.rig:
        return p
    a = p.assist
    return p._replace(pinion_radius=0.0, assist=a._replace(boost=0.0 * a.boost, damping=0.0 * a.damping))


def inputs(manoeuvre: Manoeuvre, amplitude: float, duration: float) -> Array:
    """Rows of plant inputs, one a millisecond; each row holds the hand at the end of its sample."""
    t: Array = SAMPLE_TIME * np.arange(1.0, round(duration / SAMPLE_TIME) + 1.0)
    u = np.zeros((t.size, len(plant.INPUTS)))
    u[:, plant.HAND], u[:, plant.HAND_SPEED] = manoeuvre.hand(t, amplitude)
    return u


def find_amplitude(p: plant.Plant, manoeuvre: Manoeuvre) -> float:
    """Handwheel amplitude that reaches the manoeuvre's lateral acceleration [rad].

    The second cycle's peak counts, or the mean of the last second where the manoeuvre has no cycles.

    Raises
    ------
    ValueError
        If the car does not reach that acceleration.
    """
    target = positive("lateral_acceleration", manoeuvre.lateral_acceleration)
    duration = 2.0 / manoeuvre.frequency if manoeuvre.frequency else manoeuvre.duration
    amplitude = 0.2
    for _ in range(10):  # the response is nearly proportional, so each round leaves a small part of the error
        record = _run(p, inputs(manoeuvre, amplitude, duration))
        acceleration = record[:, plant.CHANNEL["lateral_acceleration"]]
        if manoeuvre.frequency:
            reached = 0.5 * float(np.ptp(acceleration[len(record) // 2 :]))
        else:
            reached = float(np.mean(acceleration[-round(1.0 / SAMPLE_TIME) :]))
        if abs(reached / target - 1.0) < 1e-5:
            return amplitude
        amplitude *= target / reached
        if not 0.0 < amplitude < 6.0:
            break
    raise ValueError(f"{manoeuvre.name}: no handwheel amplitude reaches {target:g} m/s2 at {manoeuvre.speed:g} m/s")


def _amplitude(p: plant.Plant, manoeuvre: Manoeuvre) -> float:
    if manoeuvre.amplitude is not None:
        return manoeuvre.amplitude
    return p.rack_limit / p.pinion_radius if manoeuvre.lock else find_amplitude(p, manoeuvre)


def _text(value: Any) -> str:
    """A friction parameter as the command line takes it: a number, or numbers joined by colons."""
    return ":".join(map(repr, np.ravel(value).tolist()))


def _run(p: plant.Plant, u: Array) -> Array:
    record = np.zeros((len(u), len(plant.channels(p))))
    state = plant.initial_state(p)
    plant.run(p, state, u, record, 1)
    return record


def drive(car: Car, manoeuvre: Manoeuvre, friction: Any = "lugre") -> Recording:
    """Drive a manoeuvre and record every channel at 1 kHz.

    Parameters
    ----------
    car : Car
    manoeuvre : Manoeuvre
    friction : str or parameters
        A law's name, for its defaults, or parameters from ``friction.make``.

    Returns
    -------
    Recording
        Channels in SI with their units; ``meta`` names manoeuvre, car, law with its parameters, speed and amplitude.

    Raises
    ------
    ValueError
        Unknown law, an amplitude that cannot be found, a car that spins, or a run that does not stay finite (the state
        is named).
    """
    p = build_plant(car, manoeuvre, friction)
    amplitude = _amplitude(p, manoeuvre)
    u = inputs(manoeuvre, amplitude, manoeuvre.duration)
    record = _run(p, u)
    if not np.isfinite(record[-1]).all():
        raise ValueError(f"{manoeuvre.name} diverged: {plant.first_non_finite(p, plant.initial_state(p), u)} first")
    names = plant.channels(p)
    channels = {name: record[:, i].copy() for i, (name, _) in enumerate(names)}
    channels["vehicle_speed"] = channels.get("longitudinal_speed", np.full(len(u), manoeuvre.speed))
    if manoeuvre.speed and np.any(np.abs(channels["lateral_speed"]) > channels["vehicle_speed"]):
        raise ValueError(f"{manoeuvre.name}: the car spins; ask for less than {amplitude:g}, or for less speed")
    return Recording(
        time=SAMPLE_TIME * np.arange(1, len(u) + 1),
        channels=channels,
        units={**dict(names), "vehicle_speed": "m/s"},
        meta={
            "manoeuvre": manoeuvre.name,
            "vehicle": car.name,
            "chassis": manoeuvre.chassis,
            "tyre": car.tyre.name,
            "friction": law_of(p.friction).name,
            "friction_parameters": ",".join(f"{key}={_text(value)}" for key, value in p.friction._asdict().items()),
            "speed_m_s": manoeuvre.speed,
            "amplitude_rad" if manoeuvre.robot else "amplitude_nm": amplitude,
            "frequency_hz": manoeuvre.frequency,
        },
    )
