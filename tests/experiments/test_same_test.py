"""What is refused before recordings are evaluated: another test, unlike conditions, conditions that are no numbers."""

from dataclasses import replace

import numpy as np
import pytest

from steer_env.experiments.cli.main import main
from steer_env.recording import files
from steer_env.recording.recording import Recording

UNITS = {"handwheel_angle": "rad", "handwheel_torque": "N m", "lateral_acceleration": "m/s2", "yaw_rate": "rad/s"}


@pytest.fixture
def weave():
    """A weave at 0.2 Hz and 100 km/h."""
    time = np.arange(5001) / 100
    phase = 2 * np.pi * 0.2 * time
    waves = 0.3 * np.sin(phase), 3 * np.sin(phase + 0.2), 2 * np.sin(phase - 0.2), 0.072 * np.sin(phase - 0.1)
    return Recording(time, dict(zip(UNITS, waves)), UNITS, {"manoeuvre": "weave"})


@pytest.fixture
def told(tmp_path, monkeypatch, capsys):
    """Runs the command in an empty folder; its exit code and its one line on standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*words):
        code = main(list(words))
        error = capsys.readouterr().err
        assert error.count("\n") == (code == 2)
        return code, error

    return run


def save(weave, name, **meta):
    files.write(replace(weave, meta={**weave.meta, **meta}), name)


@pytest.mark.parametrize("command", [["evaluate", "--compare"], ["validate"]])
def test_two_different_tests_are_not_compared(command, weave, told):
    save(weave, "a.csv")
    save(weave, "b.csv", manoeuvre="slow-ramp")
    code, error = told(*command, "a.csv", "b.csv")
    assert code == 2
    assert "a.csv is of 'weave' and b.csv is of 'slow-ramp': only recordings of the same test can be compared" in error
    code, error = told(*command, "a.csv", "b.csv", "--manoeuvre", "weave")
    assert code == 2
    assert "b.csv is of 'slow-ramp' by its meta, not of 'weave'" in error


def test_a_test_that_the_file_contradicts_is_refused_until_a_mapping_corrects_it(weave, told, tmp_path):
    save(weave, "a.csv", manoeuvre="slow-ramp")
    code, error = told("evaluate", "a.csv", "--manoeuvre", "weave")
    assert code == 2
    assert "a.csv is of 'slow-ramp' by its meta, not of 'weave'" in error
    (tmp_path / "m.toml").write_text('[meta]\nmanoeuvre = "weave"\n')
    assert told("evaluate", "a.csv", "--manoeuvre", "weave", "--mapping", "m.toml")[0] == 0
    save(weave, "b.csv", manoeuvre="Weave, Tuesday")  # the word of another program is no test
    assert "names no known test, 'Weave, Tuesday': give --manoeuvre" in told("evaluate", "b.csv")[1]
    assert told("evaluate", "b.csv", "--manoeuvre", "weave")[0] == 0


@pytest.mark.parametrize(
    ("key", "near", "far", "text"),
    [
        ("speed_m_s", 28.4, 28.7, "a.csv at 100 km/h and b.csv at 103.3 km/h are more than 3% apart"),
        ("frequency_hz", 0.215, 0.23, "a.csv at 0.2 Hz and b.csv at 0.23 Hz are more than 10% apart"),
    ],
)
def test_unlike_conditions_are_not_compared(key, near, far, text, weave, told):
    save(weave, "a.csv")
    save(weave, "b.csv", **{key: near})
    assert told("evaluate", "--compare", "a.csv", "b.csv")[0] == 0
    save(weave, "b.csv", **{key: far})
    code, error = told("evaluate", "--compare", "a.csv", "b.csv")
    assert code == 2
    assert text in error
    option = ["--speed-kph", "100"] if key == "speed_m_s" else ["--frequency-hz", "0.2"]
    assert told("evaluate", "--compare", "a.csv", "b.csv", *option)[0] == 0


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ('speed_m_s = "fast"', "speed_m_s must be a number, got 'fast'"),
        ("speed_m_s = 0", "speed_m_s must be finite and greater than 0, got 0"),
        ("torque_scale_error = 2", "torque_scale_error must be finite and at least 0 and at most 1, got 2"),
        ('manoeuvre = ["weave"]', "manoeuvre must be text, one of catch-up, "),
    ],
)
def test_a_bad_condition_is_one_line_with_its_file(line, text, weave, told, tmp_path):
    save(weave, "a.csv")
    (tmp_path / "m.toml").write_text(f"[meta]\n{line}\n")
    code, error = told("evaluate", "a.csv", "--mapping", "m.toml")
    assert code == 2
    assert f"a.csv (mapping m.toml): {text}" in error


@pytest.mark.parametrize(("option", "value"), [("--speed-kph", "0"), ("--frequency-hz", "nan")])
def test_a_condition_of_the_options_is_checked_too(option, value, weave, told):
    save(weave, "a.csv")
    code, error = told("evaluate", "a.csv", f"{option}={value}")
    assert code == 2
    assert f"{option} must be finite and greater than 0, got {float(value)}" in error


def test_a_directory_is_not_named_like_a_file_and_is_checked_before_the_work(weave, told, tmp_path, monkeypatch):
    save(weave, "a.csv")
    code, error = told("evaluate", "a.csv", "--out", "r/x.json")
    assert code == 2
    assert "is named like a file, with '.json': give the name of a directory" in error
    assert not (tmp_path / "r").exists()
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "thesis.txt").write_text("mine")
    monkeypatch.setattr("steer_env.experiments.reports.assessment.assess", None)  # which is not reached
    code, error = told("evaluate", "a.csv", "--out", "foreign")
    assert code == 2
    assert "foreign holds other files (thesis.txt)" in error
