"""The command line: what it writes, and one line for every mistake."""

import json
import os

import numpy as np
import pytest

from steer_env import friction, manoeuvres, metrics
from steer_env.experiments.cli.main import main
from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.metrics_json import entries
from steer_env.experiments.pages.options import Friction
from steer_env.metrics import evaluate
from steer_env.recording import files
from steer_env.vehicle import cars


def test_run_writes_csv_and_json_that_agree(tmp_path, capsys):
    out = tmp_path / "weave.csv"
    assert main(["run", "weave", "--friction", "masing,elements=5", "--rate-hz", "100", "--out", str(out)]) == 0
    recording = files.read(out)
    assert recording.rate == pytest.approx(100.0)
    assert "\ntime_s,handwheel_angle_deg," in out.read_text()

    data = json.loads((tmp_path / "weave.json").read_text())
    assert set(data) == {"metrics", "meta", "friction", "versions", "trace"}
    assert len(data["friction"]["parameters"]["k"]["value"]) == 5
    assert data["meta"]["manoeuvre"] == "weave"
    assert tuple(data["metrics"]) == metrics.available("weave")
    driven = manoeuvres.drive(cars.load(), manoeuvres.make("weave"), friction.make("masing", elements=5))
    assert data["metrics"] == entries(evaluate(driven))  # of the full rate, whatever that of the file
    for name, value in evaluate(recording).items():  # straight lines between the samples cut 1e-4 off a peak
        assert data["metrics"][name]["value"] == pytest.approx(value.value, rel=5e-4)
    printed = capsys.readouterr()
    assert all(name in printed.out for name in data["metrics"])
    assert printed.err == ""  # no progress bar where there is no terminal


@pytest.mark.parametrize(
    "law", ["coulomb,F_c=0.5", "viscous,sigma_2=0.5", "dahl,F_c=0.5", "lugre,F_c=1.2", "masing,elements=3"]
)
def test_a_file_names_the_law_with_its_parameters_as_the_command_line_takes_them(law, tmp_path):
    p = Friction(law).parameters
    files.write(manoeuvres.drive(cars.load(), manoeuvres.make("rig", cycles=1), p), tmp_path / "rig.csv")
    meta = files.read(tmp_path / "rig.csv").meta
    again = Friction(f"{meta['friction']},{meta['friction_parameters']}").parameters
    assert type(again) is type(p)
    for value, expected in zip(again, p, strict=True):
        np.testing.assert_array_equal(value, expected)


def test_run_speed_and_ripple_of_a_hold(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "hold", "--friction", "masing", "--speed-kph", "80", "--rate-hz", "1000"]) == 0
    data = json.loads((tmp_path / "hold.json").read_text())
    assert data["meta"]["speed_m_s"] == pytest.approx(80.0 / 3.6)
    low, high = data["metrics"]["torsion_bar_ripple"]["ci"]  # of one event: what its noise may do
    assert low <= data["metrics"]["torsion_bar_ripple"]["value"] <= high < 1.01 * low
    # the file holds degrees: the last digit may differ
    assert evaluate(files.read("hold.csv"))["torsion_bar_ripple"].value == pytest.approx(
        data["metrics"]["torsion_bar_ripple"]["value"], rel=1e-6
    )
    assert "torsion_bar_ripple" in capsys.readouterr().out


def test_refusals_are_null_with_a_reason_and_printed(tmp_path, monkeypatch, capsys):
    short = manoeuvres.make("weave", cycles=3)
    monkeypatch.setattr(manoeuvres, "make", lambda name: short)
    assert main(["run", "weave", "--friction", "masing", "--rate-hz", "50", "--out", str(tmp_path / "weave.csv")]) == 0
    data = json.loads((tmp_path / "weave.json").read_text())["metrics"]
    printed = capsys.readouterr().out
    for entry in data.values():
        assert (entry["value"], entry["ci"]) == (None, [None, None])
        assert f"every metric refused: {entry['reason']}" in printed
        assert "steer" in entry["reason"]  # what to do
    assert main(["evaluate", str(tmp_path / "weave.csv")]) == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "required: COMMAND"),
        (["run"], "required: MANOEUVRE"),
        (["run", "loop"], "invalid choice: 'loop' (choose from"),
        (["run", "weave", "--speed"], "expected one argument"),
        (["run", "weave", "--friction", "lugr"], "unknown friction law 'lugr'; available: bouc_wen, coulomb"),
        (["run", "weave", "--friction", "masing,k=1:2,y=0.1"], "got 2 and 1"),
        (["run", "weave", "--vehicle", "lorry"], "vehicle must be a .toml or .json file or one of "),
        (["run", "weave", "--speed-kph", "fast"], "--speed-kph: must be a number, got 'fast'"),
        (["run", "weave", "--speed-kph", "500"], "at most 252, got 500.0"),
        (["run", "weave", "--rate-hz", "5000"], "--rate-hz must be finite and at least 20 and at most 1000"),
        (["run", "weave", "--out", "weave.json"], "--out must be a directory or end in one of .csv"),
        (["run", "weave", "--out", "no/such/weave.csv"], "there is no directory no/such"),
        (["run", "weave", "--seed", "3"], "give its class with --road"),
        (["report", "--friction", "lugre", "lugre"], "--friction names 'lugre' twice"),
        (["report", "--friction", "lugre", "--out", os.devnull], "is a file: give a directory"),
    ],
)
def test_a_bad_value_is_one_line_and_exit_code_2(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    try:
        code = main(arguments)
    except SystemExit as stop:
        code = stop.code
    printed = capsys.readouterr()
    assert code == 2
    assert printed.out == ""
    assert message in printed.err
    assert printed.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_ctrl_c_ends_with_130(monkeypatch, capsys, tmp_path):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(manoeuvres, "drive", interrupt)
    assert main(["run", "weave", "--out", str(tmp_path / "weave.csv")]) == 130
    assert capsys.readouterr().err == "steer-env run: interrupted\n"
    assert not list(tmp_path.iterdir())


def test_version(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0
    assert capsys.readouterr().out == f"steer-env {provenance.versions()['version']}\n"


def test_car_prints_a_file_of_the_same_car(capsys, tmp_path):
    assert main(["car", "bmw_320i"]) == 0
    (tmp_path / "mine.json").write_text(capsys.readouterr().out, encoding="utf-8")
    assert cars.load(tmp_path / "mine.json").data() == cars.load("bmw_320i").data()


@pytest.mark.parametrize("base", cars.available())
def test_a_new_car_file_is_the_base_car(base, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["car", "--new", "mine.toml", "--base", base]) == 0
    assert capsys.readouterr().out == "mine.toml\n"
    assert cars.load("mine.toml").data() == {**cars.load(base).data(), "name": "mine"}


def test_a_new_car_file_replaces_none_and_takes_settings(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["car", "--new", "mine.toml", "--set", "column.K_tb=143", "--tyre", "example_mf61"]) == 0
    mine = cars.load("mine.toml")
    assert (mine.column.K_tb, mine.tyre.name) == (143.0, "example_mf61")
    for options, message in (
        (["--new", "mine.toml"], "mine.toml is there already: give another name, or remove it"),
        (["--new", "mine.json"], "a JSON file holds no comments"),
        (["--new", "no/mine.toml"], "--new no/mine.toml: there is no directory no"),
        (["compact", "--new", "other.toml"], "--new FILE.toml takes neither NAME nor --page"),
        (["compact", "--out", "x"], "give --page with it"),
        ([], "give the NAME of a car; --base belongs to --new"),
        (["mine.toml", "--set", "column.K=1"], "column has no key 'K'; it takes: I1, I2, K_tb"),
        (["mine.toml", "--set", "column.K_tb=abc"], "column.K_tb takes a number, a list as [1, 2], or text in quotes"),
        (["mine.toml", "--set", "column.K_tb"], "expected SECTION.KEY=VALUE, e.g. column.K_tb=143, got 'column.K_tb'"),
        (["mine.toml", "--set", "name='a'", "--set", "name='b'"], "--set gives name twice: give it once"),
    ):
        capsys.readouterr()
        try:
            code = main(["car", *options])
        except SystemExit as stop:
            code = stop.code
        assert (code, message in capsys.readouterr().err) == (2, True), options


# Those of the core that no other test runs to its end without the whole suite, which has real-time, by the clock.
@pytest.mark.parametrize(
    ("command", "written"),
    [
        ("report --friction viscous", "report/metrics.json"),
        ("study canudas1995", "canudas1995/index.html"),
        ("serve --describe json", None),
        ("drive --device fake --headless --seconds 2 --friction coulomb", "drives/drive-0001.csv"),
    ],
)
def test_a_command_of_the_core_does_its_work(command, written, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(command.split()) == 0
    if written:
        assert (tmp_path / written).stat().st_size > 10_000
    else:
        assert json.loads(capsys.readouterr().out)
