"""An external vehicle as a unit (FMU) for co-simulation of FMI 2.0 or 3.0."""

import hashlib
import tempfile
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from steer_env.connect.external import archive, mapping
from steer_env.connect.external.mapping import Entry, factor
from steer_env.connect.external.slaves import Numbers, Slave2, Slave3
from steer_env.connect.external.vehicle import GIVEN, START_SPEED, TAKEN, Array, CouplingError
from steer_env.recording.channel_mapping import did_you_mean
from steer_env.vehicle.steering.eps import SAMPLE_TIME

_REAL = ("Real", "Float64")
_SETTABLE = ("input", "parameter")


class FmuVehicle:
    """A unit, checked, unpacked and loaded; a :class:`steer_env.connect.external.vehicle.Vehicle`.

    Parameters
    ----------
    path : str or path
        The unit (``.fmu``), where its variables have this project's names, or a mapping (``.toml``) that names it.

    Raises
    ------
    ValueError
        A mapping or a unit that cannot be used, with the reason, before any code of the unit runs.
    OSError
        A file cannot be opened.
    """

    def __init__(self, path: str | Path) -> None:
        given = mapping.read(path) if Path(path).suffix == ".toml" else None
        unit = Path(path) if given is None else given.fmu
        self.name = unit.name
        description = archive.description(unit)
        digest = hashlib.sha256(unit.read_bytes()).hexdigest()
        variables = {v.name: v for v in description.modelVariables}
        self.mapping = m = mapping.load(unit, variables) if given is None else given
        try:
            _check_complete(m, given is None)
            into = {name: _place(f"inputs.{name}", e, variables, TAKEN[name], True) for name, e in m.inputs.items()}
            out = [_place(f"outputs.{name}", e, variables, GIVEN[name]) for name, e in m.outputs.items()]
            fixed = [_variable(f"parameters.{name}", name, variables, True).valueReference for name in m.parameters]
        except ValueError as error:
            raise ValueError(f"{unit}: {error}") from None
        self.meta: dict[str, Any] = {"external_vehicle": self.name, "external_vehicle_sha256": digest, **m.meta}
        self.takes = tuple(name for name in m.inputs if name != START_SPEED)
        self.gives = (*m.outputs, *(("vehicle_speed",) if "vehicle_speed" not in m.outputs else ()))
        self._inputs, self._input_size = _together(into[name] for name in self.takes)
        self._outputs, self._output_size = _together(out)
        self._speed, self._speed_size = _together(into[name] for name in m.inputs if name == START_SPEED)
        self._parameters = Numbers(fixed)
        self._parameters.values[:] = list(m.parameters.values())
        self._alive, self._running, self._time = False, False, 0
        kind = Slave2 if description.fmiVersion.startswith("2") else Slave3
        self._folder = tempfile.TemporaryDirectory()
        try:
            archive.unpack(unit, Path(self._folder.name))
            self._slave = self._asked("to load", partial(kind, description, Path(self._folder.name)))
        except BaseException:
            self._folder.cleanup()
            raise

    def start(self, speed: float) -> Array:
        """Make a new instance, which starts at time zero; what it gives (G,).

        Raises
        ------
        CouplingError
            The unit refuses, or gives a number that is not finite.
        """
        self._end()
        self._time = 0
        self._asked("to be instantiated", self._slave.instantiate)
        self._alive = True
        self._speed.values[:] = speed / self._speed_size
        for numbers in (self._parameters, self._speed):
            if numbers.size:
                self._asked("a start value", partial(self._slave.set, numbers))
        self._asked("to start", self._slave.begin)
        self._running = True
        return self._read()

    def step(self, taken: Array, samples: int) -> Array:
        """Advance by a communication step; what the unit gives at its end (G,).

        Raises
        ------
        CouplingError
            The unit refuses, or gives a number that is not finite.
        """
        np.divide(taken, self._input_size, out=self._inputs.values)
        self._slave.said = ""
        try:
            self._slave.set(self._inputs)
            self._slave.step(self._time * SAMPLE_TIME, samples * SAMPLE_TIME)
        except Exception as error:  # fmpy raises bare exceptions
            raise self._failed("a step", error) from None
        self._time += samples
        return self._read()

    def close(self) -> None:
        """Free the instance and remove the unpacked files."""
        self._end()
        self._folder.cleanup()

    def _end(self) -> None:
        if self._alive:
            if self._running:  # a unit that has failed may only be freed
                self._asked("to terminate", self._slave.terminate)
            self._alive = self._running = False
            self._slave.end()

    def _read(self) -> Array:
        try:
            self._slave.get(self._outputs)
        except Exception as error:
            raise self._failed("its outputs", error) from None
        found = self._outputs.values * self._output_size
        if not np.isfinite(found).all():
            bad = self.gives[int(np.flatnonzero(~np.isfinite(found))[0])]
            variable = self.mapping.outputs[bad].variable
            raise CouplingError(f"{self.name} gave {variable} = {found[self.gives.index(bad)]} at {self._now()}")
        return found if self.mapping.speed is None else np.append(found, self.mapping.speed)

    def _asked(self, what: str, call: Callable[[], Any]) -> Any:
        """Result of a call of the unit."""
        try:
            return call()
        except Exception as error:  # fmpy raises bare exceptions
            raise self._failed(what, error) from None

    def _failed(self, what: str, error: Exception) -> CouplingError:
        self._running = False
        said = getattr(getattr(self, "_slave", None), "said", "")
        return CouplingError(f"{self.name} refused {what} at {self._now()}: {said or error}")

    def _now(self) -> str:
        return f"{self._time * SAMPLE_TIME:.6g} s"


def _check_complete(m: mapping.Mapping, unmapped: bool) -> None:
    """ValueError where what every vehicle needs is not there."""
    advice = "write a mapping (docs/fmu.md)" if unmapped else "add it to the mapping"
    for kind, needed, there in (("input", "rack_travel", m.inputs), ("output", "rack_force", m.outputs)):
        if needed not in there:
            raise ValueError(f"has no {kind} {needed}, which an external vehicle needs: {advice}")
    if ("vehicle_speed" in m.outputs) == (m.speed is not None):
        raise ValueError("the speed of the vehicle comes either from the output vehicle_speed or from speed_m_s")


def _variable(where: str, name: str, variables: dict[str, Any], setting: bool) -> Any:
    """A real scalar of the unit that can be read or, for ``setting``, be set."""
    if name not in variables:
        raise ValueError(f"{where}: there is no variable {name!r}, {did_you_mean(name, variables)}")
    found = variables[name]
    if found.type not in _REAL or found.dimensions:
        raise ValueError(f"{where}: {name} is of type {found.type}; a real scalar is needed")
    if setting and (found.causality not in _SETTABLE or found.variability == "constant"):
        raise ValueError(f"{where}: {name} is of causality {found.causality}, which cannot be set")
    return found


def _place(where: str, entry: Entry, variables: dict[str, Any], unit: str, setting: bool = False) -> tuple[int, float]:
    """Value reference of a variable, and the size of its unit in SI with the sign."""
    found = _variable(where, entry.variable, variables, setting)
    declared = found.unit or (found.declaredType.unit if found.declaredType is not None else None)
    return found.valueReference, entry.sign * factor(where, entry.unit or declared, unit)


def _together(places: Iterable[tuple[int, float]]) -> tuple[Numbers, Array]:
    found = list(places)
    return Numbers(reference for reference, _ in found), np.array([size for _, size in found])
