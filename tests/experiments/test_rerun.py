"""Every result file tells what it was made from, and `steer-env rerun` makes it again to the bit."""

import hashlib
import importlib
import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest

from steer_env import manoeuvres
from steer_env.experiments.cli.main import main
from steer_env.experiments.pages import provenance, traces
from steer_env.recording import Recording, files
from steer_env.vehicle import cars, tyre

STIFF = 'base = "compact"\n[column]\nK_tb = {}\n'


@pytest.fixture(autouse=True)
def _somewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def rerun(path, capsys, *options):
    """Exit code of a rerun, and what it printed."""
    capsys.readouterr()
    code = main(["rerun", str(path), *options])
    printed = capsys.readouterr()
    return code, printed.out + printed.err


def require_same(path, capsys):
    """The result is made again to the bit."""
    code, text = rerun(path, capsys)
    assert (code, text.splitlines()[-1]) == (0, f"{path}: equal to the bit")


def test_two_files_of_one_name_with_other_torsion_bars_are_told_apart(tmp_path):
    found = []
    for stiffness in (120.0, 140.0):
        folder = tmp_path / f"{stiffness:.0f}"
        folder.mkdir()
        (folder / "a.toml").write_text(STIFF.format(stiffness))
        assert main(["run", "rig", "--vehicle", str(folder / "a.toml"), "--rate-hz", "50", "--out", str(folder)]) == 0
        for name in ("rig.csv", "rig.json"):
            trace = traces.read(folder / name)
            assert (trace["car"]["name"], trace["car"]["column"]["K_tb"]) == ("a", stiffness)
            assert cars.load(trace["car"]).data() == cars.load(folder / "a.toml").data()
        found.append((folder / "rig.csv").read_text().partition("time_s")[0])
    assert found[0] != found[1]


@pytest.mark.parametrize("suffix", ["csv", pytest.param("mf4", marks=pytest.mark.whole)])
def test_a_recording_is_made_again_by_its_own_content(suffix, tmp_path, capsys):
    """The car file and the tyre file of the command are gone, and one of their names is another car's."""
    (tmp_path / "a.toml").write_text(STIFF.format(140.0))
    tyre.save(tyre.load("example_mf61"), tmp_path / "mine.tir")
    out = tmp_path / f"mine.{suffix}"
    options = ["--friction", "masing,elements=3", "--vehicle", "a.toml", "--tyre", "mine.tir", "--set", "column.C2=0.5"]
    assert main(["run", "rig", *options, "--rate-hz", "50", "--out", out.name]) == 0
    (tmp_path / "a.toml").write_text(STIFF.format(90.0))
    (tmp_path / "mine.tir").unlink()
    trace = traces.read(out)
    assert trace["command"] == ["run", "rig", *options, "--rate-hz", "50", "--out", out.name]
    assert (trace["car"]["column"]["K_tb"], trace["car"]["column"]["C2"]) == (140.0, 0.5)
    assert (trace["tyre"]["name"], trace["strut"]["name"]) == ("mine", "s2")
    assert (trace["version"], trace["sources"]) == tuple(provenance.versions()[key] for key in ("version", "sources"))
    law = trace["friction"]["masing,elements=3"]
    assert (law["law"], len(law["parameters"]["k"])) == ("masing", 3)
    for path in (out, out.with_suffix(".json")):
        require_same(path, capsys)
    files.write(touched(files.read(out)), out)
    code, text = rerun(out, capsys)
    assert code == 1
    assert re.search(r"mine\.\w+: 1 values are others: handwheel_torque$", text.strip())


def touched(recording):
    """The recording with the last bit of one sample of one channel changed."""
    values = recording.channels["handwheel_torque"].copy()
    values[7] = np.nextafter(values[7], np.inf)
    return replace(recording, channels={**recording.channels, "handwheel_torque": values})


def test_an_evaluation_is_made_again_with_its_inputs(tmp_path, capsys):
    for law in ("lugre", "viscous"):
        assert main(["run", "rig", "--friction", law, "--rate-hz", "50", "--out", f"{law}.csv"]) == 0
    (tmp_path / "map.toml").write_text("[channels.handwheel_torque]\nsign = -1\n")
    options = ["--mapping", "map.toml", "--map", "handwheel_angle=handwheel_angle,sign=-1"]
    main(["evaluate", "--compare", "lugre.csv", "viscous.csv", *options, "--out", "found"])
    trace = traces.read("found/evaluation.json")
    assert [given["name"] for given in trace["inputs"]] == ["lugre.csv", "viscous.csv", "map.toml"]
    assert trace["inputs"][2]["text"] == (tmp_path / "map.toml").read_text()
    mapped = trace["mapping"]["lugre"]["channels"]
    assert {name: entry["sign"] for name, entry in mapped.items()} == {"handwheel_torque": -1, "handwheel_angle": -1}
    (tmp_path / "map.toml").unlink()  # the trace holds it
    for name in ("evaluation.json", "index.html"):
        require_same(f"found/{name}", capsys)
    (tmp_path / "viscous.csv").rename(tmp_path / "found" / "viscous.csv")  # beside the result
    (tmp_path / "found" / "index.html").rename(tmp_path / "found" / "renamed.html")
    assert rerun("found/renamed.html", capsys)[0] == 0
    (tmp_path / "found" / "viscous.csv").write_text("another\n")
    code, text = rerun("found/evaluation.json", capsys)
    assert code == 2
    assert "found/viscous.csv is another file than found/evaluation.json was made from: its SHA-256 begins " in text
    (tmp_path / "found" / "viscous.csv").unlink()
    code, text = rerun("found/evaluation.json", capsys)
    assert code == 2
    assert "found/evaluation.json needs viscous.csv, which is neither there nor beside the result" in text


@pytest.fixture
def modules(tmp_path, monkeypatch):
    """Writes files below the working directory; forgets what was imported of them, as a new process has."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(sys, "path", sys.path[:])

    def write(**texts):
        for name, text in texts.items():
            file = tmp_path / (name.replace("__", "/") + ".py")
            file.parent.mkdir(exist_ok=True)
            file.write_text(text)
        forget()

    def forget():
        for name in [name for name in sys.modules if name.partition(".")[0] in ("mine", "laws", "table")]:
            del sys.modules[name]
        sys.path[:] = [each for each in sys.path if each != str(tmp_path)]
        importlib.invalidate_caches()

    yield write
    forget()


def run_with(module):
    assert main(["run", "rig", "--import", module, "--rate-hz", "50", "--out", "found/rig.csv"]) == 0


def test_a_module_of_a_package_is_checked_with_what_it_imports(tmp_path, modules, capsys):
    (tmp_path / "found").mkdir()
    modules(laws__mine="from .values import K\nimport table\n", laws__values="K = 1\n", table="K = 2\n")
    run_with("laws.mine")
    given = traces.read("found/rig.csv")["inputs"]
    assert [each["module"] for each in given] == ["laws.mine", "laws.values", "table"]
    assert {each["sha256"] for each in given} == {
        hashlib.sha256((tmp_path / file).read_bytes()).hexdigest()
        for file in ("laws/mine.py", "laws/values.py", "table.py")
    }
    modules()
    require_same("found/rig.csv", capsys)
    modules(table="K = 30\n")
    code, text = rerun("found/rig.csv", capsys)
    assert code == 2
    assert re.search(
        r"the module table, .*table\.py, is another than found/rig\.csv was made with: that one's SHA", text
    )
    (tmp_path / "table.py").unlink()
    modules()
    code, text = rerun("found/rig.csv", capsys)
    assert code == 2
    assert "found/rig.csv needs the module table, which is neither in the working directory, nor installed, nor" in text


def test_a_module_beside_the_result_is_imported_from_there(tmp_path, modules, monkeypatch, capsys):
    (tmp_path / "found").mkdir()
    modules(mine="import table\n", table="K = 1\n")
    run_with("mine")
    for name in ("mine.py", "table.py"):
        (tmp_path / name).rename(tmp_path / "found" / name)
    modules()
    require_same("found/rig.json", capsys)
    assert sys.modules["mine"].__file__ == str(tmp_path / "found" / "mine.py")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    modules()
    assert rerun("../found/rig.json", capsys)[0] == 0


def test_the_module_that_is_checked_is_the_one_that_runs(tmp_path, modules, capsys):
    """The right one lies beside the result, a changed one in the working directory, which goes first."""
    (tmp_path / "found").mkdir()
    modules(mine="K = 1\n")
    run_with("mine")
    modules(mine="raise RuntimeError('must not run')\n", found__mine="K = 1\n")
    code, text = rerun("found/rig.csv", capsys)
    assert code == 2
    assert f"the module mine, {tmp_path / 'mine.py'}, is another than found/rig.csv was made with" in text
    modules(mine="try:\n    import table\nexcept ImportError:\n    pass\n")
    run_with("mine")
    modules(table="K = 1\n")
    code, text = rerun("found/rig.csv", capsys)
    assert "is another than found/rig.csv was made with: there was none" in text


def test_equal_is_equal_in_every_bit_and_every_value(tmp_path):
    first, second = tmp_path / "a.json", tmp_path / "b.json"

    def found(one, other):
        first.write_text(json.dumps(one))
        second.write_text(json.dumps(other))
        return traces.differences(first, second)

    assert found({"x": 0.0, "y": [float("nan"), 1]}, {"x": -0.0, "y": [float("nan"), 1.0]}) == ["x", "y.1"]
    assert found(
        {"metrics": {"version": 1, "date": {"seconds": 2}}}, {"metrics": {"version": 2, "date": {"seconds": 3}}}
    ) == [
        "metrics.version",
        "metrics.date.seconds",
    ]
    about = ("version", "versions", "provenance", "real_time", "trace")
    assert not found({name: {"a": 1} for name in about}, {name: {"a": 2} for name in about})


def test_a_zero_of_another_sign_in_a_recording_is_told(tmp_path):
    time = np.arange(10) / 10.0
    for name, zero in (("a", 0.0), ("b", -0.0), ("c", np.nan)):
        values = np.where(time == 0.5, zero, 1.0)
        meta = {"seconds": {"a": 1, "b": 2}.get(name, 1)}
        files.write(
            Recording(time, {"handwheel_torque": values}, {"handwheel_torque": "N m"}, meta), tmp_path / f"{name}.mat"
        )
    assert traces.differences(tmp_path / "a.mat", tmp_path / "b.mat") == ["handwheel_torque", "meta seconds"]
    assert traces.differences(tmp_path / "c.mat", tmp_path / "c.mat") == []


def test_another_version_is_refused_unless_asked_for(tmp_path, capsys):
    assert main(["run", "rig", "--rate-hz", "50"]) == 0
    path = tmp_path / "rig.json"
    data = json.loads(path.read_text())
    data["trace"] |= {"sources": "0123456789abcdef", "packages": {**data["trace"]["packages"], "numpy": "1.0"}}
    path.write_text(json.dumps(data))
    code, text = rerun(path, capsys)
    assert code == 2
    assert "was made by another program: sources 0123456789abcdef then, " in text
    assert "package numpy 1.0 then, " in text
    assert text.strip().endswith("Check out that version, or go on with --any-version")
    code, text = rerun(path, capsys, "--any-version", "--out", "kept")
    assert code == 0
    assert "going on, as --any-version asks" in text
    assert text.strip().endswith("equal to the bit")
    assert (tmp_path / "kept" / "rig.csv").exists()


def test_what_holds_no_trace_is_refused(tmp_path, capsys):
    (tmp_path / "other.json").write_text("[]")
    assert "other.json: holds no trace, so nothing tells what it was made from" in rerun("other.json", capsys)[1]
    assert "results end in .json, .html, .csv" in rerun("other.txt", capsys)[1]
    (tmp_path / "other.json").write_text(json.dumps({"trace": provenance.trace()}))
    own = provenance.trace(command=["car", "compact"], result="car")
    for key, value in (("version", None), ("packages", 1), ("command", "car"), ("result", "../car"), ("inputs", [1])):
        (tmp_path / "bad.json").write_text(json.dumps({"trace": {**own, key: value}}))
        assert f"bad.json: its trace holds no {key} as this program writes it" in rerun("bad.json", capsys)[1]
    assert "its trace holds no command, as a Python program or 'benchmark' wrote it" in rerun("other.json", capsys)[1]


def test_a_manoeuvre_of_all_is_made_again_by_itself(tmp_path, monkeypatch, capsys):
    """Its trace names the manoeuvre, not how many workers there were."""
    monkeypatch.setattr(manoeuvres, "available", lambda: ("rig",))
    (tmp_path / "a.toml").write_text(STIFF.format(140.0))
    for workers in ("1", "2"):
        assert main(["run", "all", "--vehicle", "a.toml", "--workers", workers, "--out", workers]) == 0
    assert (tmp_path / "1" / "rig.csv").read_bytes() == (tmp_path / "2" / "rig.csv").read_bytes()
    assert traces.read("1/rig.csv")["command"] == ["run", "rig", "--vehicle", "a.toml"]
    (tmp_path / "a.toml").unlink()
    code, text = rerun("1/rig.csv", capsys)
    assert (code, text.splitlines()[-1]) == (0, "1/rig.csv: equal to the bit")


@pytest.mark.whole
def test_an_evaluation_of_policies_is_made_again_with_an_own_car(tmp_path, capsys):
    (tmp_path / "a.toml").write_text(STIFF.format(140.0))
    command = "policy evaluate damping --env steer_env/AssistWeave-v3 --episodes 2 --vehicle a.toml --out found"
    assert main(command.split()) == 0
    data = json.loads((tmp_path / "found" / "evaluation.json").read_text())
    assert data["trace"]["car"]["column"]["K_tb"] == 140.0
    assert data["arguments"]["vehicle"].startswith("a, ")
    (tmp_path / "a.toml").unlink()
    for name in ("evaluation.json", "index.html"):
        require_same(f"found/{name}", capsys)
