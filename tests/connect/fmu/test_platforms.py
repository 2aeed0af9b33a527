"""Binaries for other platforms, which zig links, and sources; where wine or qemu is installed, also their runs."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import validation

from steer_env.connect import fmu
from steer_env.connect.fmu.object_code import PLATFORMS

if shutil.which("cc") is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

pytestmark = pytest.mark.whole

WINE = shutil.which("wine64") or shutil.which("wine")
ARM = Path("/usr/aarch64-linux-gnu")  # the C library, of Debian's libc6-arm64-cross
QEMU = shutil.which("qemu-aarch64") or shutil.which("qemu-aarch64-static") if ARM.is_dir() else None
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
    found = {}
    for (platform, program), suffix in zip(programs.items(), ("dll", "so")):
        library = folder / "binaries" / platform / f"{description.coSimulation.modelIdentifier}.{suffix}"
        checked = subprocess.run([*program, library, description.guid, "check", "1000", "20"], **options)
        assert checked.returncode == 0
        found[platform] = driven(program, library, description, SAMPLES, **options)
    assert apart(found["win64"], found["linux64"]) < 1e-9


def driven(program, library, description, samples, **options):
    """Outputs (T, K) of a library under a sine of the hand torque."""
    references = {v.name: v.valueReference for v in description.modelVariables}
    wanted = [str(references[name]) for name in ("hand_torque", *OUTPUTS)]
    called = [*program, library, description.guid, "print", str(samples), *wanted]
    lines = subprocess.check_output(called, text=True, **options).splitlines()
    found = np.array([[float.fromhex(word) for word in line.split()] for line in lines])
    assert found.shape == (samples, len(OUTPUTS))
    return found


def apart(one, other):
    """Largest difference over the span of its channel."""
    span = np.ptp(other, axis=0)
    assert (span > 0.0).all()
    worst = np.abs(one - other).max(axis=0) / span
    print("worst difference over the span:", dict(zip(OUTPUTS, worst)))
    return worst.max()


def test_arm_computes_what_x86_computes(tmp_path):
    """Ten seconds under an emulator, where there is one; otherwise the library is only made."""
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS["aarch64"].zig]
    found = {}
    for platform, compiler, emulator in (("linux64", ["cc"], []), ("aarch64", zig, [QEMU, "-L", ARM])):
        path = fmu.export(tmp_path / f"{platform}.fmu", platforms=[platform, "source"], chassis="two_track")
        assert validation.validate_fmu(str(path)) == []
        fmpy.extract(str(path), str(tmp_path / platform))
        description = fmpy.read_model_description(str(path))
        library = tmp_path / platform / "binaries" / "linux64" / f"{description.coSimulation.modelIdentifier}.so"
        assert int.from_bytes(library.read_bytes()[18:20], "little") == {"linux64": 0x3E, "aarch64": 0xB7}[platform]
        if platform == "linux64" or QEMU:
            program = [*emulator, built(tmp_path, compiler, f"harness-{platform}", "-O1", "-lm", "-ldl")]
            found[platform] = driven(program, library, description, 10_000)
    compiled(zig, tmp_path / "aarch64", library)  # in place of the exported one
    if QEMU:
        assert apart(found["aarch64"], found["linux64"]) < 1e-12
        assert np.array_equal(driven(program, library, description, 10_000), found["aarch64"])


@pytest.mark.parametrize(("fmi", "chassis"), [(2, "single_track"), (3, "two_track")])
def test_the_sources_compile_to_what_the_binary_computes(fmi, chassis, tmp_path):
    """Ten seconds of a sine of the hand torque, by the library of the export and by one made of the sources alone."""
    path = fmu.export(tmp_path / "car.fmu", platforms=["linux64", "source"], chassis=chassis, fmi=fmi)
    assert validation.validate_fmu(str(path)) == []
    fmpy.extract(str(path), str(tmp_path / "exported"))
    fmpy.extract(str(path), str(tmp_path / "compiled"))
    description = fmpy.read_model_description(str(path))
    (library,) = (tmp_path / "compiled" / "binaries").rglob("*.so")
    library.unlink()
    compiled(["cc"], tmp_path / "compiled", library)
    t = np.linspace(0.0, 10.0, 1001)
    torque = np.array([*zip(t, 4.0 * np.sin(3.0 * t))], dtype=[("time", float), ("hand_torque", float)])
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    exported, own = (
        fmpy.simulate_fmu(
            str(tmp_path / name), stop_time=10.0, step_size=1e-3, output_interval=1e-3, input=torque, output=outputs
        )
        for name in ("exported", "compiled")
    )
    assert len(own) >= 10_000
    assert np.ptp(own["yaw_rate"]) > 0.1
    assert exported.tobytes() == own.tobytes()


def compiled(compiler, folder, library):
    """The sources of an unpacked unit, compiled as the description says, with the headers of the standard only."""
    (configuration,) = fmpy.read_model_description(str(folder)).buildConfigurations
    (listed,) = configuration.sourceFileSets
    assert configuration.modelIdentifier == library.stem
    files = [folder / "sources" / name for name in listed.sourceFiles]
    include = f"-I{fmpy.__path__[0]}/c-code"
    subprocess.run([*compiler, "-shared", "-fPIC", "-O2", "-Wall", include, *files, "-o", library, "-lm"], check=True)


def test_sources_alone_need_no_compiler(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    path = fmu.export(tmp_path / "car.fmu", platforms=["source"], subsystem="steering")
    assert validation.validate_fmu(str(path)) == []
    names = zipfile.ZipFile(path).namelist()
    assert "sources/kernels.c" in names
    assert not [name for name in names if name.startswith("binaries/")]


def test_fmi_3_has_a_folder_for_each_platform_and_fmi_2_one_for_linux(tmp_path):
    """The library for macOS is linked; nobody ran it."""
    with pytest.raises(ValueError, match=r"export one unit for each processor, or FMI 3\.0"):
        fmu.export(tmp_path / "car.fmu", platforms=["linux64", "aarch64"])
    path = fmu.export(tmp_path / "car.fmu", platforms=["linux64", "aarch64", "macos"], fmi=3)
    assert validation.validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dylib"))
        folders = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
        head = archive.read(name)[:8]
    assert {"x86_64-linux", "aarch64-linux", "aarch64-darwin"} <= folders
    assert head == bytes.fromhex("cffaedfe0c000001")  # Mach-O of 64 bit, ARM of 64 bit
