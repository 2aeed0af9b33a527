"""An external vehicle as an FMU for co-simulation of FMI 2.0 or 3.0; fmpy loads its library.

An FMU is a program, and it runs with the rights of the user who loads it. What is checked before any code of it runs
tells early what cannot work, and keeps the files of the archive within their folder; neither that nor its own process
makes an FMU safe whose origin is unknown.
"""

import hashlib
import os
import re
import shutil
import stat
import tempfile
import zipfile
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

import numpy as np

from steer_env.connect.external import mapping
from steer_env.connect.external.fmu_process import FmuError, Instance, Library, OwnProcess
from steer_env.connect.external.mapping import Entry, factor
from steer_env.connect.external.vehicle import (
    START_SPEED,
    VEHICLE_INPUT_UNITS,
    VEHICLE_OUTPUT_UNITS,
    Array,
    CouplingError,
)
from steer_env.friction.numerics import archives
from steer_env.friction.numerics.check import did_you_mean
from steer_env.friction.numerics.extras import install
from steer_env.vehicle.steering.eps import SAMPLE_TIME

_REAL = ("Real", "Float64")
_SETTABLE = ("input", "parameter")
DESCRIPTION = "modelDescription.xml"
LARGEST = 4e9  # of all files together, unpacked; assumed [byte]
FOLDER = "steer-env-fmu-"  # begins the names of temporary folders


class FmuVehicle:
    """A unit, checked, unpacked and loaded; a :class:`steer_env.connect.external.vehicle.Vehicle`.

    Parameters
    ----------
    path : str or path
        The unit (``.fmu``), where its variables have this project's names, or a mapping (``.toml``) that names it.
    own_process : bool, optional
        Whether the unit runs in a process of its own, under the limits of the mapping; by default as the mapping says.

    Raises
    ------
    ValueError
        A mapping or a unit that cannot be used, with the reason, before any code of the unit runs.
    CouplingError
        The unit cannot be loaded.
    OSError
        A file cannot be opened.
    """

    def __init__(self, path: str | Path, own_process: bool | None = None) -> None:
        given = mapping.read(path) if Path(path).suffix == ".toml" else None
        unit = Path(path) if given is None else given.fmu
        self.name = unit.name
        description = _description(unit)
        digest = hashlib.sha256(unit.read_bytes()).hexdigest()
        variables = {v.name: v for v in description.modelVariables}
        self.mapping = m = mapping.load(unit, variables) if given is None else given
        try:
            _check_complete(m, given is None)
            into = {
                name: _place(f"inputs.{name}", e, variables, VEHICLE_INPUT_UNITS[name], True)
                for name, e in m.inputs.items()
            }
            out = [_place(f"outputs.{name}", e, variables, VEHICLE_OUTPUT_UNITS[name]) for name, e in m.outputs.items()]
            fixed = [_variable(f"parameters.{name}", name, variables, True).valueReference for name in m.parameters]
        except ValueError as error:
            raise ValueError(f"{unit}: {error}") from None
        self.meta: dict[str, Any] = {"external_vehicle": self.name, "external_vehicle_sha256": digest, **m.meta}
        self.takes = tuple(name for name in m.inputs if name != START_SPEED)
        self.gives = (*m.outputs, *(("vehicle_speed",) if "vehicle_speed" not in m.outputs else ()))
        inputs, self._input_size = _group_by_unit(into[name] for name in self.takes)
        outputs, self._output_size = _group_by_unit(out)
        speed, self._speed_size = _group_by_unit(into[name] for name in m.inputs if name == START_SPEED)
        self._time = 0
        self._folder = _LockedFolder()
        try:
            _unpack(unit, self._folder.path)
            library = Library(
                description.fmiVersion[0],
                description.guid,
                description.coSimulation.modelIdentifier,
                str(self._folder.path),
                [*fixed, *speed],
                inputs,
                outputs,
            )
            self._fmu = self._call(lambda: self._loaded(library, own_process))
        except BaseException:
            self._folder.remove()
            raise
        of = self._fmu
        self._fixed, self._inputs, self._outputs = (
            np.frombuffer(numbers.memory) for numbers in (of.parameters, of.inputs, of.outputs)
        )
        self._fixed[: len(fixed)] = list(m.parameters.values())

    def _loaded(self, library: Library, own_process: bool | None) -> Instance | OwnProcess:
        m = self.mapping
        if not (m.own_process if own_process is None else own_process):
            return Instance(library)
        if self._folder.lock is None:
            raise ValueError(
                f"{m.fmu}: a process of its own needs Linux or macOS: set own_process = false in a mapping"
            )
        return OwnProcess(library, self._folder.lock, m.time_limit, m.memory_limit)

    def start(self, speed: float) -> Array:
        """Make a new instance, which starts at time zero; what it gives (G,).

        Raises
        ------
        CouplingError
            The unit refuses, has a fault, or gives a number that is not finite.
        """
        self._time = 0
        self._fixed[len(self.mapping.parameters) :] = speed / self._speed_size
        self._call(self._fmu.start)
        return self._given()

    def step(self, taken: Array, samples: int) -> Array:
        """Advance by a communication step; what the unit gives at its end (G,).

        Raises
        ------
        CouplingError
            The unit refuses, has a fault, or gives a number that is not finite.
        """
        np.divide(taken, self._input_size, out=self._inputs)
        self._call(partial(self._fmu.step, self._time * SAMPLE_TIME, samples * SAMPLE_TIME))
        self._time += samples
        return self._given()

    def close(self) -> None:
        """Free the instance, end its process and remove the unpacked files.

        Raises
        ------
        CouplingError
            The unit refuses, or has a fault.
        """
        try:
            self._call(self._fmu.close)
        finally:
            self._folder.remove()

    def _given(self) -> Array:
        found = self._outputs * self._output_size
        if not np.isfinite(found).all():
            bad = self.gives[int(np.flatnonzero(~np.isfinite(found))[0])]
            variable = self.mapping.outputs[bad].variable
            raise CouplingError(f"{self.name} gave {variable} = {found[self.gives.index(bad)]} at {self._now()}")
        return found if self.mapping.speed is None else np.append(found, self.mapping.speed)

    def _call(self, call: Callable[[], Any]) -> Any:
        """Result of a call of the unit."""
        try:
            return call()
        except FmuError as error:
            raise CouplingError(f"{self.name} {error.did} at {self._now()}: {error.why}") from None

    def _now(self) -> str:
        return f"{self._time * SAMPLE_TIME:.6g} s"


class _LockedFolder:
    """A temporary folder that is locked as long as its process lives; first, those of dead processes are removed.

    Attributes
    ----------
    path : Path
    lock : int or None
        Descriptor of the folder, with which another process keeps the lock; None on Windows, where none is locked.
    """

    def __init__(self) -> None:
        self.lock: int | None = None
        if os.name != "posix":
            self._make()
            return
        for left in Path(tempfile.gettempdir()).glob(f"{FOLDER}*"):
            with suppress(OSError):  # it is in use, or somebody else's
                lock = _lock(left, wait=False)
                shutil.rmtree(left, ignore_errors=True)
                os.close(lock)
        while True:
            self._make()
            with suppress(FileNotFoundError):
                self.lock = _lock(self.path)
                if self.path.exists():  # otherwise another process has removed it before it was locked
                    return

    def _make(self) -> None:
        self._made = tempfile.TemporaryDirectory(prefix=FOLDER, ignore_cleanup_errors=True)
        self.path = Path(self._made.name)

    def remove(self) -> None:
        """Remove the folder and what it holds."""
        self._made.cleanup()
        if self.lock is not None:
            os.close(self.lock)
            self.lock = None


def _lock(folder: Path, wait: bool = True) -> int:
    """Descriptor of a folder that this process has locked; BlockingIOError where another one has."""
    import fcntl  # which Windows does not have

    found = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(found, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(found)
        raise
    return found


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


def _group_by_unit(places: Iterable[tuple[int, float]]) -> tuple[list[int], Array]:
    found = list(places)
    return [reference for reference, _ in found], np.array([size for _, size in found])


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
            f"{path}: a unit is loaded by the package fmpy, which is not installed: {install('fmu')}"
        ) from None
    try:
        with archives.open_archive(path, "FMU") as archive:
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
    with archives.open_archive(path, "FMU") as archive:
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
