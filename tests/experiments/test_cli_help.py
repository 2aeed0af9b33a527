"""Help answers at once: no command imports a simulation for it. Missing extras and a closed pipe end in a sentence."""

import re
import subprocess
import sys

import numpy as np
import pytest

from steer_env import assists, drivers, friction, manoeuvres, metrics, targets
from steer_env.experiments.cli import drive
from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.messages import in_options
from steer_env.experiments.cli.main import main
from steer_env.experiments.learning import policy_report
from steer_env.friction.numerics.registry import dashed, listed
from steer_env.friction.numerics.renamed import REMOVED_IN
from steer_env.live import devices
from steer_env.live.drive import scene
from steer_env.recording import Recording, can_log, files
from steer_env.vehicle import cars, road
from steer_env.vehicle.steering.eps import SAMPLE_TIME

COMMANDS = [name for name in listed("steer_env.experiments.cli", dashed) if name != "main"]
SLOW = ("numba", "scipy", "matplotlib", "torch", "plotly")  # to import
HELP = """
import sys, time
from steer_env.experiments.cli.main import main
try:
    main(sys.argv[1:])
except SystemExit as stop:
    code = stop.code
print(code, *(name for name in {slow} if name in sys.modules), f"{{time.process_time():.3f}}", file=sys.stderr)
"""


def _processor_time(*command):
    done = subprocess.run([sys.executable, "-c", *command], capture_output=True, text=True, check=True)
    return done.stdout, done.stderr.split()


@pytest.mark.parametrize("command", [[], *([name] for name in COMMANDS)], ids=lambda command: " ".join(command))
def test_help_imports_nothing_slow(command):
    text, (code, *slow, seconds) = _processor_time(HELP.format(slow=SLOW), *command, "--help")
    assert (code, slow) == ("0", [])
    assert "usage: steer-env" in text
    base = "import sys, time, gymnasium; print(f'{time.process_time():.3f}', file=sys.stderr)"
    _, (gymnasium,) = _processor_time(base)
    over = float(seconds) - float(gymnasium)
    print(f"steer-env {' '.join(command)} --help: {over:.2f} s over import gymnasium")  # a benchmark, not a test


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
        ("torch", ["train", "--env", "steer_env/AssistWeave-v1"], "train"),
        ("stable_baselines3", ["evaluate-policy", "shipped", "--env", "steer_env/AssistWeave-v1"], "train"),
        ("stable_baselines3", ["shift", "policy.zip"], "train"),
        ("minari", ["record", "--env", "steer_env/AssistWeave-v1", "--policy", "zero"], "integrations"),
        ("sb3_contrib", ["train", "--env", "steer_env/AssistWeave-v1", "--algo", "recurrent-ppo"], "train"),
        ("torch", ["verify", "policies"], "train"),
        ("asammdf", ["evaluate", "weave.mf4"], "mdf"),
        ("asammdf", ["run", "weave", "--out", "weave.mf4"], "mdf"),
        ("pyarrow", ["run", "weave", "--out", "weave.parquet"], "parquet"),
        ("cantools", ["evaluate", "drive.log.gz", "--dbc", "car.dbc"], "can"),
        ("vehiclemodels", ["study", "commonroad"], "test"),
    ],
)
def test_a_missing_extra_is_named_before_the_work_begins(missing, command, extra, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "steer_env.experiments.cli.common.extras.find_spec", lambda name: None if name == missing else object()
    )
    assert main(command) == 2
    error = capsys.readouterr().err
    assert f"needs {missing}: pip install '.[{extra}]'" in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="pipes of a POSIX shell")
@pytest.mark.parametrize("command", [["--help"], ["car", "compact"], ["run", "rig"]])
def test_a_closed_pipe_prints_no_error(command, tmp_path):
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "steer_env.experiments.cli.main",
            *command,
            *(["--out", str(tmp_path)] * ("run" in command)),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
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
        (
            slice(50, 90),
            " s; cut the recording there with --between T0 T1, or leave the channel out with ",
        ),
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


@pytest.mark.parametrize("name", listed("steer_env.experiments.studies", dashed))
def test_every_study_has_help(name, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["study", name, "--help"])
    assert stop.value.code == 0
    assert f"usage: steer-env study {name}" in capsys.readouterr().out


def test_former_names_of_options_are_taken_and_told(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "weave", "--speed_kph", "500"]) == 2
    assert main(["run", "weave", "--rate_hz=5000"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == f"steer-env: --speed_kph is now --speed-kph; release {REMOVED_IN} removes the old name"
    assert [line.startswith("steer-env run: --") for line in lines] == [False, True, False, True]


def test_episodes_have_no_frames_without_pygame(monkeypatch):
    """A core install evaluates baselines without pictures, and does not end in a traceback after the work."""
    monkeypatch.setattr(policy_report, "find_spec", lambda name: None)
    assert policy_report.frames("steer_env/AssistWeave-v1", None) == []


@pytest.mark.parametrize("name", COMMANDS)
def test_options_have_hyphens(name, capsys):
    with pytest.raises(SystemExit):
        main([name, "--help"])
    text = capsys.readouterr().out
    assert not re.search(r"--\w*_", text)
