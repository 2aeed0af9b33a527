"""A foreign unit (FMU) as a file: what is checked before any code of it runs, and its unpacking.

A unit is a program, and it runs with the rights of the user who loads it. These checks tell early what cannot work, and
keep the files of the unit within their folder; they do not make a unit safe whose origin is unknown.
"""

import re
import stat
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

from steer_env.connect.fmu.link import INSTALL

DESCRIPTION = "modelDescription.xml"
LARGEST = 4e9  # of all files together, unpacked; assumed [byte]


def description(path: Path) -> Any:
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
        raise ValueError(f"{path}: a unit is loaded by the package fmpy, which is not installed: {INSTALL}") from None
    try:
        with zipfile.ZipFile(path) as archive:
            files = _checked_names(archive)
            if DESCRIPTION not in files:
                raise ValueError(f"is no FMU: it holds no {DESCRIPTION}")
            version = _version(archive.read(DESCRIPTION))
        try:
            found = fmpy.read_model_description(str(path))
        except Exception as error:  # fmpy raises bare exceptions
            raise ValueError(f"its {DESCRIPTION} is not valid: {error}") from None
        if found.coSimulation is None:
            raise ValueError("is for model exchange only, which needs a solver: export it for co-simulation")
        _check_binary(found.coSimulation.modelIdentifier, version, files, fmpy)
    except zipfile.BadZipFile:
        raise ValueError(f"{path} is no FMU, which is a zip archive: it is another file, or it was cut") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return found


def unpack(path: Path, folder: Path) -> None:
    """Unpack a unit that :func:`description` has checked."""
    with zipfile.ZipFile(path) as archive:
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
