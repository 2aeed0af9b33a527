"""An external vehicle as an FMU for co-simulation of FMI 2.0 or 3.0; fmpy loads its library.

An FMU is a program, and it runs with the rights of the user who loads it. What is checked before any code of it runs
tells early what cannot work, and keeps its files within their folder; it does not make an FMU safe whose origin is
unknown.
"""

import ctypes
import hashlib
import re
import stat
import tempfile
import zipfile
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from steer_env.connect.external import mapping
from steer_env.connect.external.mapping import Entry, factor
from steer_env.connect.external.vehicle import GIVEN, START_SPEED, TAKEN, Array, CouplingError
from steer_env.friction.numerics import archives
from steer_env.recording.channel_mapping import did_you_mean
from steer_env.vehicle.steering.eps import SAMPLE_TIME


class Numbers:
    """Real variables of a unit that are set or read together.

    Parameters
    ----------
    references : iterable of int
        Value references.
    """

    def __init__(self, references: Iterable[int]) -> None:
        found = list(references)
        self.size = len(found)
        self.references = (ctypes.c_uint * self.size)(*found)
        self.buffer = (ctypes.c_double * self.size)()
        self.values: NDArray[np.float64] = np.ctypeslib.as_array(self.buffer)  # (N,) what is set, or was read


class Slave2:
    """A unit of FMI 2.0."""

    def __init__(self, description: Any, folder: Path) -> None:
        from fmpy import calloc, fmi2, free
        from fmpy.logging import addLoggerProxy

        self.said = ""  # the last message of the unit
        self._unit = fmi2.FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="vehicle",
        )
        self._callbacks = fmi2.fmi2CallbackFunctions()
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(lambda *words: self._hear(words[-1]))
        self._callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(ctypes.byref(self._callbacks))  # which fills in what the unit passes beside the text

    def _hear(self, text: bytes) -> None:
        self.said = text.decode(errors="replace")

    def instantiate(self) -> None:
        """Make an instance."""
        self._unit.instantiate(callbacks=self._callbacks)

    def begin(self) -> None:
        """Initialize, up to time zero."""
        self._unit.setupExperiment(startTime=0.0)
        self._unit.enterInitializationMode()
        self._unit.exitInitializationMode()

    def set(self, numbers: Numbers) -> None:
        """Set variables."""
        unit = self._unit
        unit.fmi2SetReal(unit.component, numbers.references, numbers.size, numbers.buffer)

    def get(self, numbers: Numbers) -> None:
        """Read variables."""
        unit = self._unit
        unit.fmi2GetReal(unit.component, numbers.references, numbers.size, numbers.buffer)

    def step(self, time: float, step: float) -> None:
        """Advance by a communication step [s]."""
        self._unit.doStep(time, step)

    def terminate(self) -> None:
        """End the run."""
        self._unit.terminate()

    def end(self) -> None:
        """Free the instance."""
        self._unit.fmi2FreeInstance(self._unit.component)


class Slave3:
    """A unit of FMI 3.0."""

    def __init__(self, description: Any, folder: Path) -> None:
        from fmpy import fmi3

        self.said = ""
        self._unit = fmi3.FMU3Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="vehicle",
        )

    def _hear(self, environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.said = message.decode(errors="replace")

    def instantiate(self) -> None:
        """Make an instance."""
        self._unit.instantiate(logMessage=self._hear)

    def begin(self) -> None:
        """Initialize, up to time zero."""
        self._unit.enterInitializationMode(startTime=0.0)
        self._unit.exitInitializationMode()

    def set(self, numbers: Numbers) -> None:
        """Set variables."""
        unit = self._unit
        unit.fmi3SetFloat64(unit.component, numbers.references, numbers.size, numbers.buffer, numbers.size)

    def get(self, numbers: Numbers) -> None:
        """Read variables."""
        unit = self._unit
        unit.fmi3GetFloat64(unit.component, numbers.references, numbers.size, numbers.buffer, numbers.size)

    def step(self, time: float, step: float) -> None:
        """Advance by a communication step [s]."""
        _, terminate, early, reached = self._unit.doStep(time, step)
        if terminate or early:
            raise RuntimeError(f"it ended a step early, at {reached:g} s")

    def terminate(self) -> None:
        """End the run."""
        self._unit.terminate()

    def end(self) -> None:
        """Free the instance."""
        self._unit.fmi3FreeInstance(self._unit.component)


_REAL = ("Real", "Float64")
_SETTABLE = ("input", "parameter")
DESCRIPTION = "modelDescription.xml"
LARGEST = 4e9  # of all files together, unpacked; assumed [byte]


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
        description = _description(unit)
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
            _unpack(unit, Path(self._folder.name))
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


def _description(path: Path) -> Any:
    """The description of a unit that this machine can run for co-simulation, as fmpy reads it; no code of it runs.

    Raises
    ------
    ValueError
        With the reason: no archive, a file that would leave the folder of the unit, no description or a bad one,
        FMI 1.0, model exchange only, no binary for this platform, or fmpy is not installed.
    OSError
        The file cannot be opened.
    """
    try:
        import fmpy
    except ImportError:
        raise ValueError(
            f"{path}: a unit is loaded by the package fmpy, which is not installed: pip install '.[fmu]'"
        ) from None
    try:
        with archives.opened(path, "FMU") as archive:
            files = _checked_names(archive)
            if DESCRIPTION not in files:
                raise ValueError(f"is no FMU: it holds no {DESCRIPTION}")
            version = _version(archive.read(DESCRIPTION))
        try:
            found = fmpy.read_model_description(str(path))
        except Exception as error:  # fmpy raises bare exceptions
            raise ValueError(f"its {DESCRIPTION} is not valid: {' '.join(str(error).split())}") from None
        if found.coSimulation is None:
            raise ValueError("is for model exchange only, which needs a solver: export it for co-simulation")
        _check_binary(found.coSimulation.modelIdentifier, version, files, fmpy)
    except archives.DamagedError:
        raise
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return found


def _unpack(path: Path, folder: Path) -> None:
    """Unpack a unit that :func:`_description` has checked."""
    with archives.opened(path, "FMU") as archive:
        _checked_names(archive)
        archive.extractall(folder)


def _checked_names(archive: zipfile.ZipFile) -> set[str]:
    """Names of the files; ValueError where one of them would leave the folder that the archive is unpacked into."""
    for each in archive.infolist():
        name = PurePosixPath(each.filename.replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts or re.match(r"[A-Za-z]:", each.filename):
            raise ValueError(f"holds the file {each.filename!r}, which climbs out of the folder of the unit")
        if stat.S_ISLNK(each.external_attr >> 16):
            raise ValueError(f"holds the link {each.filename!r}, which may lead out of the folder of the unit")
    if sum(each.file_size for each in archive.infolist()) > LARGEST:
        raise ValueError(f"takes more than {LARGEST / 1e9:g} GB unpacked")
    return set(archive.namelist())


def _version(text: bytes) -> str:
    """Version of FMI, ``"2"`` or ``"3"``."""
    try:
        found = ElementTree.fromstring(text).get("fmiVersion", "")
    except ElementTree.ParseError as error:
        raise ValueError(f"its {DESCRIPTION} is not valid: {error}") from None
    if not re.match(r"(2\.0$|3\.)", found):
        raise ValueError(f"is of FMI {found or 'no version'}; 2.0 and 3.0 can be loaded: export it in one of these")
    return found[0]


def _check_binary(identifier: str, version: str, files: set[str], fmpy: Any) -> None:
    """ValueError unless there is a binary for this platform, in the folder of the unit."""
    if not re.fullmatch(r"[A-Za-z_]\w*", identifier or ""):
        raise ValueError(f"its modelIdentifier must be a C identifier, got {identifier!r}")
    here = fmpy.platform if version == "2" else fmpy.platform_tuple
    if f"binaries/{here}/{identifier}{fmpy.sharedLibraryExtension}" not in files:
        there = sorted({name.split("/")[1] for name in files if re.match(r"binaries/[^/]+/.", name)})
        raise ValueError(
            f"has no binary {identifier}{fmpy.sharedLibraryExtension} for this platform, {here}; it has binaries for "
            f"{', '.join(there) or 'none'}: export it for {here}"
        )
