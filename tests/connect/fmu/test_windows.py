"""The binary for Windows, which zig links, and where wine is installed also its run."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from steer_env.connect import fmu

fmpy = pytest.importorskip("fmpy", reason="the extra fmu is not installed")
validation = pytest.importorskip("fmpy.validation", reason="the extra fmu is not installed")
pytest.importorskip("ziglang", reason="the extra fmu is not installed")
if shutil.which("cc") is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

pytestmark = pytest.mark.whole

WINE = shutil.which("wine64") or shutil.which("wine")
SAMPLES = 60_000
LIMIT = 300  # of a call, the first of which makes wine's folder of settings in some ten seconds [s]
OUTPUTS = ("handwheel_angle", "handwheel_torque", "motor_torque", "yaw_rate", "lateral_acceleration")


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """Folder, description and path of a unit for both platforms."""
    folder = tmp_path_factory.mktemp("windows")
    path = fmu.export(folder / "car.fmu", platforms=["linux64", "win64"])
    fmpy.extract(str(path), str(folder / "unit"))
    return folder / "unit", fmpy.read_model_description(str(path)), path


def built(folder, compiler, name, *options):
    """The C importer, compiled for a platform."""
    program = folder / name
    include = f"-I{fmpy.__path__[0]}/c-code"
    source = Path(__file__).with_name("harness.c")
    subprocess.run([*compiler, "-std=gnu11", include, source, "-o", program, *options], check=True)
    return program


def test_the_unit_holds_a_library_for_windows(unpacked):
    folder, description, path = unpacked
    library = folder / "binaries" / "win64" / f"{description.coSimulation.modelIdentifier}.dll"
    code = library.read_bytes()
    assert code[:2] == b"MZ"
    machine = int.from_bytes(code[int.from_bytes(code[60:64], "little") + 4 :][:2], "little")
    assert machine == 0x8664  # x86-64
    for name in ("fmi2Instantiate", "fmi2DoStep", "fmi2SetFMUstate", "fmi2GetTypesPlatform"):
        assert name.encode() + b"\0" in code
    assert b"libgcc" not in code  # nothing but Windows itself is needed
    assert b"winpthread" not in code
    assert validation.validate_fmu(str(path)) == []
    assert path.stat().st_size < 2e6


@pytest.mark.skipif(WINE is None, reason="wine is not installed")
def test_the_library_runs_under_wine(unpacked, tmp_path):
    """Sixty seconds of a sine of the hand torque, by the DLL and by the library for Linux."""
    folder, description, _ = unpacked
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu"]
    programs = {
        # With the options of the library zig needs no second runtime of Windows, which takes it a minute or two.
        "win64": [WINE, built(folder, zig, "harness.exe", "-O2", "-s")],
        "linux64": [built(folder, ["cc"], "harness", "-O1", "-lm")],
    }
    # Settings of its own, nothing on a screen, and no offer to install .NET or a browser.
    wine = {"WINEPREFIX": str(tmp_path / "wine"), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}
    options = {"env": {**os.environ, **wine, "DISPLAY": ""}, "timeout": LIMIT, "stdin": subprocess.DEVNULL}
    references = {v.name: v.valueReference for v in description.modelVariables}
    found = {}
    for (platform, program), suffix in zip(programs.items(), ("dll", "so")):
        library = folder / "binaries" / platform / f"{description.coSimulation.modelIdentifier}.{suffix}"
        wanted = [str(references[name]) for name in ("hand_torque", *OUTPUTS)]
        called = [*program, library, description.guid]
        checked = subprocess.run([*called, "check", "1000", "20"], stdout=subprocess.PIPE, **options)
        assert checked.returncode == 0, checked.stdout
        lines = subprocess.check_output([*called, "print", str(SAMPLES), *wanted], text=True, **options)
        found[platform] = np.array([[float.fromhex(word) for word in line.split()] for line in lines.splitlines()])
    assert found["win64"].shape == (SAMPLES, len(OUTPUTS))
    span = np.ptp(found["linux64"], axis=0)
    assert (span > 0.0).all()
    worst = np.abs(found["win64"] - found["linux64"]).max(axis=0) / span
    print("worst difference over the span:", dict(zip(OUTPUTS, worst)))
    assert worst.max() < 1e-9
