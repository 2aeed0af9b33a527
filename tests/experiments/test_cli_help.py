"""Help answers at once: no command imports a simulation for it. Missing extras and a closed pipe end in a sentence."""

import argparse
import re
import subprocess
import sys

import numpy as np
import pytest

from steer_env import assists, drivers, friction, manoeuvres, metrics, targets
from steer_env.experiments.cli import drive
from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.messages import in_options
from steer_env.experiments.cli.main import main, parser
from steer_env.experiments.cli.study import SWEEPING
from steer_env.experiments.learning import policy_report
from steer_env.friction.numerics.extras import install
from steer_env.friction.numerics.registry import modules_by_name, with_dashes
from steer_env.live import devices
from steer_env.live.drive import scene
from steer_env.recording import Recording, can_log, files
from steer_env.vehicle import cars, road
from steer_env.vehicle.steering.eps import SAMPLE_TIME


def _commands(words, made):
    """Words of every command below a parser -> its parser."""
    below = [action.choices for action in made._actions if isinstance(action, argparse._SubParsersAction)]
    if not below:
        return {words: made}
    return {key: one for name, sub in below[0].items() for key, one in _commands((*words, name), sub).items()}


COMMANDS = _commands((), parser())
FOLDERS = {words[0] for words in COMMANDS if len(words) > 1}  # words with commands of their own
SLOW = ("numba", "scipy", "matplotlib", "torch", "plotly")  # to import
HELP = """
import sys
from steer_env.experiments.cli.main import main
for command in {commands}:
    try:
        main([*command, "--help"])
    except SystemExit as stop:
        print(stop.code, *(name for name in {slow} if name in sys.modules), file=sys.stderr)
"""


def test_help_imports_nothing_slow():
    every = [(), *((name,) for name in FOLDERS), *COMMANDS]
    words = [sys.executable, "-c", HELP.format(commands=every, slow=SLOW)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stderr.splitlines() == ["0"] * len(every)
    assert done.stdout.count("usage: steer-env") >= len(every)


def test_names_in_the_help_are_those_of_the_registries():
    assert names.laws() == friction.available()
    assert names.manoeuvres() == manoeuvres.available()
    assert set(names.manoeuvres()) >= set(metrics.tests())
    assert names.cars() == cars.available()
    assert names.chassis() == tuple(sorted(cars.SPEEDS))
    assert names.targets() == targets.available()
    assert names.drivers() == drivers.available()
    assert names.assists() == assists.available()
    assert names.devices() == devices.available()
    assert drive.COURSES == scene.COURSES
    assert names.friction_records() == ("rig",)
    assert tuple(files.FORMATS) == names.FORMATS
    assert can_log.SUFFIXES == names.CAN_FORMATS
    assert tuple(road.ROUGHNESS) == names.ROAD_CLASSES
    assert pytest.approx(1.0 / SAMPLE_TIME) == names.SAMPLE_RATE


@pytest.mark.parametrize(
    ("missing", "command", "extra"),
    [
        ("torch", ["train", "--env", "steer_env/AssistWeave-v3"], "train"),
        ("stable_baselines3", ["policy", "evaluate", "shipped", "--env", "steer_env/AssistWeave-v3"], "train"),
        ("stable_baselines3", ["policy", "shift", "policy.zip"], "train"),
        ("minari", ["policy", "record", "--env", "steer_env/AssistWeave-v3", "--policy", "zero"], "datasets"),
        ("sb3_contrib", ["train", "--env", "steer_env/AssistWeave-v3", "--algo", "recurrent-ppo"], "train"),
        ("asammdf", ["evaluate", "weave.mf4"], "mdf"),
        ("asammdf", ["run", "weave", "--out", "weave.mf4"], "mdf"),
        ("pyarrow", ["run", "weave", "--out", "weave.parquet"], "parquet"),
        ("cantools", ["evaluate", "drive.log.gz", "--dbc", "car.dbc"], "can"),
        ("optuna", ["tune"], "tune"),
        ("distributed", ["study", "loop-width", "--cluster", "local"], "cluster"),
    ],
)
def test_a_missing_extra_is_named_before_the_work_begins(missing, command, extra, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "steer_env.experiments.cli.common.extras.find_spec", lambda name: None if name == missing else object()
    )
    assert main(command) == 2
    error = capsys.readouterr().err
    assert f"needs {missing}: {install(extra)}" in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.whole
@pytest.mark.skipif(sys.platform == "win32", reason="pipes of a POSIX shell")
@pytest.mark.parametrize("command", [["--help"], ["car", "compact"], ["run", "rig"]])
def test_a_closed_pipe_prints_no_error(command, tmp_path):
    words = [sys.executable, "-m", "steer_env.experiments.cli.main", *command]
    if "run" in command:
        words += ["--out", str(tmp_path)]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    assert process.stderr.read() == ""
    process.stderr.close()
    # A text that the buffer takes whole is lost at the end of the program, without a failure.
    assert process.wait() in ((0, 141) if command == ["--help"] else (141,))


def test_messages_name_options():
    text = "say that the test was at 80 km/h (speed_m_s=22.22), or frequency_hz=0.25 if right"
    assert in_options(text) == "say that the test was at 80 km/h (--speed-kph 79.99), or --frequency-hz 0.25 if right"


PYTHON = re.compile(r"\w+\(.*\)|\w=|longest|bridged")


def gappy(*gaps, size=200):
    """A recording of two channels at 100 Hz with NaN at these slices of the second one."""
    time = 0.01 * np.arange(size)
    torque = np.sin(time)
    for gap in gaps:
        torque[gap] = np.nan
    units = {"handwheel_angle": "rad", "handwheel_torque": "N m"}
    return Recording(time, {"handwheel_angle": np.cos(time), "handwheel_torque": torque}, units, {})


@pytest.mark.parametrize(
    ("gap", "message"),
    [
        (slice(0, 20), "cut it off with --between 0.2 1.99, or leave the channel out with --without handwheel_torque"),
        (slice(50, 90), " s; cut the recording there with --between T0 T1, or leave the channel out with "),
        (slice(0, 199), "channel 'handwheel_torque' has 1 samples: leave it out with --without handwheel_torque"),
    ],
)
def test_a_gap_is_told_with_options_that_there_are(gap, message, tmp_path, capsys):
    path = tmp_path / "gappy.csv"
    files.write(gappy(gap), path)
    assert main(["evaluate", str(path), "--manoeuvre", "weave"]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert not PYTHON.search(error.replace(str(path), ""))
    main(["evaluate", str(path), "--manoeuvre", "weave", "--without", "handwheel_torque"])
    assert "has a gap" not in capsys.readouterr().err


def test_a_refusal_is_printed_once(tmp_path, capsys):
    """Metrics that are refused for the same reason share a line, with the option that helps."""
    path = tmp_path / "weave.csv"
    assert main(["run", "weave", "--speed-kph", "60", "--out", str(path)]) == 0
    capsys.readouterr()
    main(["evaluate", str(path), "--speed-kph", "100"])
    refused = [line for line in capsys.readouterr().out.splitlines() if "refused" in line]
    reasons = [line.partition(" refused: ")[2] for line in refused]
    assert len(set(reasons)) == len(reasons) >= 1
    assert any("--speed-kph" in reason for reason in reasons)
    assert not any(re.search(r"speed_m_s|frequency_hz=|between\(", reason) for reason in reasons)


@pytest.mark.parametrize("name", modules_by_name("steer_env.experiments.studies", with_dashes))
def test_every_study_has_help(name, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["study", name, "--help"])
    assert stop.value.code == 0
    said = capsys.readouterr().out
    assert f"usage: steer-env study {name}" in said
    assert said.count("--figures DIR") == 1
    for option in ("--workers N", "--cluster ADDRESS", "--resume "):
        assert said.count(option) == (name in SWEEPING), option


def test_episodes_have_no_frames_without_pygame(monkeypatch):
    """A core install evaluates baselines without pictures, and does not end in a traceback after the work."""
    monkeypatch.setattr(policy_report, "find_spec", lambda name: None)
    assert policy_report.frames("steer_env/AssistWeave-v3", None) == []


def _options(name):
    """Words of each command that has an option -> the action of the option."""
    return {words: made._option_string_actions[name] for words, made in COMMANDS.items() if name in _names(made)}


def _names(made):
    return {name for name in made._option_string_actions if name.startswith("--")}


def _type(action):
    """A type by its name, as two whole numbers with other limits are the same type."""
    return getattr(action.type, "__qualname__", None)


ALL = sorted(set().union(*(_names(made) for made in COMMANDS.values())) - {"--help"})
# Option -> what may differ between commands.
DIFFERENT = {
    "--chassis": {"type"},  # 'run' and 'report' also take the file of an external vehicle, which is checked
    "--out": {"type", "metavar"},  # a directory or a file
}


@pytest.mark.parametrize("name", ALL)
def test_an_option_means_the_same_in_every_command(name):
    found = _options(name)
    told = {
        "type": {_type(action) for action in found.values()},
        "metavar": {action.metavar for action in found.values()},
        "attribute": {action.dest for action in found.values()},
    }
    assert {key for key, values in told.items() if len(values) > 1} <= DIFFERENT.get(name, set()), told


def test_what_computes_many_cases_takes_workers_and_resumes():
    """Which commands these are, is in test_own_law_on_workers.py."""
    sweeping = set(_options("--workers"))
    assert set(_options("--cluster")) == sweeping
    assert set(_options("--resume")) == sweeping | {("train",)}
    assert set(_options("--import")) == set(COMMANDS)
