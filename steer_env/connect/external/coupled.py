"""The steering of this project with an external vehicle, split at the rack.

Column, assist and friction law advance in steps of 1 ms by the kernel of the subsystem ``steering``; the vehicle
advances once in each communication step. Its rack force is extrapolated linearly from the last two
communication points to the middle of each step of the steering, as in the undivided plant (N1); it receives the motion
of the rack at the end of its step. With a delay it receives the motion of one communication step earlier, as where both
run at the same time.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env.connect.external.fmu_vehicle import FmuVehicle
from steer_env.connect.external.vehicle import (
    OF_PLANT,
    RACK,
    START_SPEED,
    VEHICLE_OUTPUT_UNITS,
    Array,
    CouplingError,
    Vehicle,
)
from steer_env.friction.numerics.kernel import bind
from steer_env.manoeuvres import Manoeuvre
from steer_env.vehicle import plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import (
    ASSIST_REQUEST,
    COAST,
    HAND,
    HAND_SPEED,
    RACK_DISTURBANCE,
    TARGET_SPEED,
    Names,
)
from steer_env.vehicle.layout import state_size
from steer_env.vehicle.steering.column import COLUMN_ANGLE, COLUMN_SPEED
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import steering

_COLUMN = plant.CHANNEL["rack_force"]  # channels of column and assist, which come first
_MOTION = [name for name in plant.CHANNEL if name in VEHICLE_OUTPUT_UNITS]
_INPUT = {name: i for i, (name, _) in enumerate(plant.INPUTS)}
SPEED = ("vehicle_speed", "m/s")  # the last channel
TARGET = plant.INPUTS[TARGET_SPEED][0]
SPREAD, STANDING = 0.03, 0.01  # largest deviation from the speed that is asked for, assumed [1], [m/s]
STEADY = 1e-3  # change in a second below which a speed is steady, assumed [m/s]
LEAD_IN = 60  # longest time in which a vehicle changes its speed before the start, assumed [s]
BACKWARD = 0.5  # speed backwards, above which its sign is taken for wrong, assumed [m/s]
POSE = ("x", "y", "yaw_angle")


class Coupling(NamedTuple):
    """How steering and vehicle exchange values."""

    step: int = 1  # communication step [ms]
    delay: bool = False  # whether the motion of the rack reaches the vehicle one communication step late
    extrapolated: bool = True  # whether the rack force is extrapolated; otherwise it holds over the communication step


class Coupled:
    """A steering and an external vehicle: a simulator for :func:`steer_env.manoeuvres.drive`.

    Their plants are those of the project's car on two tracks, whose chassis is not used. The vehicle keeps its state
    from one :meth:`run` to the next; :meth:`settled` begins anew.

    Parameters
    ----------
    vehicle : Vehicle
    speed : float
        At which it starts [m/s].
    coupling : Coupling
    chassis : str, optional
        What recordings name as the chassis; by default the vehicle's name.

    Attributes
    ----------
    work : (3,) array
        Of the rack on the vehicle since the start [J]: as the steering has done it, as the vehicle has received it, and
        what has passed in either direction.
    force : float
        Rack force of the vehicle that acted on the steering in the last sample [N].
    """

    def __init__(self, vehicle: Vehicle, speed: float, coupling: Coupling, chassis: str | None = None) -> None:
        self._chassis = chassis or vehicle.name
        self.vehicle, self.coupling, self._start_speed = vehicle, coupling, speed
        self._places = [vehicle.takes.index(name) if name in vehicle.takes else None for name in RACK]
        self._others = [(k, _INPUT[name]) for k, name in enumerate(vehicle.takes) if name not in RACK]
        self._given, self._row, self._unused = np.zeros(6), np.zeros((1, _COLUMN + 2)), np.zeros((1, 1))
        self._taken = np.zeros(len(vehicle.takes))
        self._bound: tuple[tuple[Any, ...], Callable, plant.Plant] | None = None  # members, kernel, bound plant
        self.work, self.force = np.zeros(3), 0.0

    def suited(self, manoeuvre: Manoeuvre) -> Manoeuvre:
        """The manoeuvre on two tracks, as the plant whose steering drives is; a driver model knows the car by it.

        Raises
        ------
        ValueError
            The manoeuvre has a road, or needs an input that the vehicle does not take or a channel that it does not
            give.
        """
        name, vehicle = manoeuvre.name, self.vehicle
        if manoeuvre.road is not None:
            raise ValueError(f"{vehicle.name} has a road of its own: leave out that of {name}")
        inputs = [*manoeuvre.others, *([COAST] if manoeuvre.coasts_from is not None else [])]
        for needed in (plant.INPUTS[i][0] for i in inputs):
            if needed in OF_PLANT and needed not in vehicle.takes:
                raise ValueError(f"{name} needs the input {needed}, which {vehicle.name} does not take")
        channels = ["x"] if manoeuvre.ends_at is not None or manoeuvre.coasts_from is not None else []
        if manoeuvre.driver is None and manoeuvre.amplitude is None and not manoeuvre.lock:
            channels.append("lateral_acceleration")
        for needed in channels:
            if needed not in vehicle.gives:
                raise ValueError(f"{name} needs the channel {needed}, which {vehicle.name} does not give")
        return replace(manoeuvre, chassis="two_track")

    def about(self, car: Car, speed: float) -> dict[str, Any]:
        """What recordings tell of the vehicle in place of chassis, tyre and geometry of this project's car."""
        return {"chassis": self._chassis, "tyre": f"that of {self.vehicle.name}", **self.vehicle.meta}

    def channels(self, p: plant.Plant) -> Names:
        """Names and units of the channels; those that the vehicle does not give are NaN."""
        return (*plant.channels(p), SPEED)

    def settled(self, p: plant.Plant) -> tuple[Array, Array]:
        """State (S,) of the steering at rest and channels (C,), with the vehicle at its start.

        Raises
        ------
        CouplingError
            As :meth:`steer_env.connect.external.vehicle.Vehicle.start`, or it starts at another speed, or backwards.
        """
        names = [name for name, _ in self.channels(p)]
        self._columns = [names.index(name) for name in self.vehicle.gives]
        self._force, self._speed = (self.vehicle.gives.index(name) for name in ("rack_force", SPEED[0]))
        self._sample, self._time, self._sent, self.work[:] = 0, 0, 0.0, 0.0
        self._rack = 0.0, 0.0  # travel and speed at the last communication point
        self._taken[:], self._more_speed = 0.0, 0.0
        self._values = self._before = self.vehicle.start(self._start_speed)
        if not self._at_speed():
            self._values = self._before = self._brought_to_speed()
        self._pose_at_start, self._yaw = self._pose(self._values), 0.0
        self._values = self._before = self._from_start(self._values)
        row = np.full(len(names), np.nan)
        row[:_COLUMN], row[self._columns] = 0.0, self._values
        return np.zeros(state_size(p)), row

    def _at_speed(self) -> bool:
        """Whether the vehicle is at the speed to start at."""
        return abs(abs(self._values[self._speed]) - self._start_speed) <= SPREAD * self._start_speed + STANDING

    def _brought_to_speed(self) -> Array:
        """What the vehicle gives after it has changed its speed straight ahead, by its input ``target_speed``."""
        first, takes = abs(self._values[self._speed]), self.vehicle.takes
        self._more_speed = self._start_speed - first
        if TARGET in takes:
            self._taken[takes.index(TARGET)] = self._more_speed
            for _ in range(LEAD_IN):
                before = self._values[self._speed]
                for _ in range(round(1.0 / SAMPLE_TIME / self.coupling.step)):
                    self._values = self.vehicle.step(self._taken, self.coupling.step)
                if self._at_speed() and abs(self._values[self._speed] - before) < STEADY:
                    return self._values
        raise CouplingError(
            f"{self.vehicle.name} starts at {round(3.6 * first, 3):g} km/h and does not reach the "
            f"{3.6 * self._start_speed:.4g} km/h that are asked for: ask for its own speed, or let the mapping set it "
            f"(input {START_SPEED} or {TARGET})"
        )

    def run(self, p: plant.Plant, state: Array, inputs: Array, record: Array, substeps: int) -> bool:
        """As :func:`steer_env.vehicle.plant.run`, from where the last run ended.

        Raises
        ------
        ValueError
            More than one substep.
        CouplingError
            As :meth:`steer_env.connect.external.vehicle.Vehicle.step`, or a state of the steering is no longer finite,
            or the vehicle drives backwards.
        """
        if substeps != 1:
            raise ValueError(f"with an external vehicle a sample is one step, got {substeps} substeps")
        if not np.isfinite(inputs).all():
            missing = ", ".join(name for name in _MOTION if name not in self.vehicle.gives)
            raise CouplingError(f"the driver gives no number, as {self.vehicle.name} does not give {missing}")
        row, given, last = self._row[0], self._given, len(record) - 1
        advance = self._kernel(p, state)
        record[:] = np.nan
        for i, u in enumerate(inputs):
            given[:3], given[3] = (u[HAND], u[HAND], u[HAND_SPEED]), u[ASSIST_REQUEST]
            self.force = force = self._held_force()
            given[4], given[5] = force + u[RACK_DISTURBANCE], abs(self._values[self._speed])
            before = p.pinion_radius * state[COLUMN_ANGLE]
            finite = advance(state, given, self._unused, self._row, 1)
            self._time += 1
            if not finite:
                bad = plant.state_name(p, int(np.flatnonzero(~np.isfinite(state))[0]))
                raise CouplingError(f"{bad} of the steering is not finite at {self._time * SAMPLE_TIME:.6g} s")
            rack = p.pinion_radius * state[COLUMN_ANGLE], p.pinion_radius * state[COLUMN_SPEED]
            self.work[[0, 2]] += force * (rack[0] - before), abs(force * (rack[0] - before))
            self._sample += 1
            if self._sample == self.coupling.step:
                self._exchange(rack, u)
            shown = record[min(i, last)]
            shown[:_COLUMN] = row[:_COLUMN]
            shown[self._columns] = self._values
        return True

    def _kernel(self, p: plant.Plant, state: Array) -> Callable:
        """The kernel of the steering for a plant, kept while its members stay, as a look-up takes long."""
        members = tuple(getattr(p, name) for name in p._fields if name != "robot")
        if not self._bound or any(one is not other for one, other in zip(members, self._bound[0])):
            made = plant.bound(p)
            kernel = bind(steering.advance, made, state, self._given, self._unused, self._row, 1)
            self._bound = members, kernel, made
        _, kernel, made = self._bound
        return partial(kernel, made._replace(robot=p.robot))

    def _held_force(self) -> float:
        """Rack force of the vehicle in the middle of the present step of the steering [N]."""
        now, before = self._values[self._force], self._before[self._force]
        s = (self._sample + 0.5) / self.coupling.step
        return float(now + s * (now - before) if self.coupling.extrapolated else now)  # (N1)

    def _exchange(self, rack: tuple[float, float], u: Array) -> None:
        """The communication step of the vehicle that ends now."""
        sent = self._rack if self.coupling.delay else rack
        for k, value in zip(self._places, sent):
            if k is not None:
                self._taken[k] = value
        for k, index in self._others:
            self._taken[k] = u[index] + (self._more_speed if index == TARGET_SPEED else 0.0)
        self._before = self._values
        self._values = self._from_start(self.vehicle.step(self._taken, self.coupling.step))
        mean = 0.5 * (self._before[self._force] + self._values[self._force])
        self.work[1] += mean * (sent[0] - self._sent)
        self._sent, self._rack, self._sample = sent[0], rack, 0

    def _pose(self, values: Array) -> list[float]:
        """Place and heading; zero for what the vehicle does not give."""
        gives = self.vehicle.gives
        return [float(values[gives.index(name)]) if name in gives else 0.0 for name in POSE]

    def _from_start(self, values: Array) -> Array:
        """What the vehicle gives, with place and heading relative to those at the start, the heading without jumps."""
        if values[self._speed] < -BACKWARD:
            raise CouplingError(
                f"{self.vehicle.name} gives vehicle_speed = {values[self._speed]:.6g} m/s at "
                f"{self._time * SAMPLE_TIME:.6g} s, but no manoeuvre drives backwards: give the channel the other sign "
                "in the mapping, or another start"
            )
        (x0, y0, yaw0), (x, y, yaw) = self._pose_at_start, self._pose(values)
        c, s = math.cos(yaw0), math.sin(yaw0)
        turned = yaw - yaw0
        self._yaw = turned + math.tau * round((self._yaw - turned) / math.tau)  # also where the vehicle wraps it
        pose = c * (x - x0) + s * (y - y0), c * (y - y0) - s * (x - x0), self._yaw
        for name, value in zip(POSE, pose):
            if name in self.vehicle.gives:
                values[self.vehicle.gives.index(name)] = value
        return values


@contextmanager
def opened(chassis: str | Path, speed: float, coupling: Coupling | None = None) -> Iterator[Coupled]:
    """Our steering with an external vehicle, which is closed at the end.

    Parameters
    ----------
    chassis : str or path
        A unit (``.fmu``) or a mapping (``.toml``), as :class:`steer_env.connect.external.fmu_vehicle.FmuVehicle` takes
        it.
    speed : float
        At which the vehicle shall start [m/s].
    coupling : Coupling, optional
        By default the communication step of the mapping, without a delay.

    Raises
    ------
    ValueError
        As :class:`steer_env.connect.external.fmu_vehicle.FmuVehicle`, and as its ``close``.
    """
    vehicle = FmuVehicle(chassis)
    try:
        yield Coupled(vehicle, speed, coupling or Coupling(vehicle.mapping.step), str(chassis))
    except BaseException:
        with suppress(CouplingError):  # the first error is the one to tell
            vehicle.close()
        raise
    vehicle.close()
