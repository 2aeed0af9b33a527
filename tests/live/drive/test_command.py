"""The command ``drive``: what it says, and that nothing recorded is lost where it is killed."""

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from steer_env import friction
from steer_env.experiments.cli.main import main
from steer_env.live.drive.hands import car_configuration
from steer_env.live.drive.session import PERIOD, Session
from steer_env.live.real_time import haptics
from steer_env.live.real_time.angle_filter import BANDWIDTH
from steer_env.recording import files
from steer_env.vehicle import cars

COMMAND = [sys.executable, "-m", "steer_env.experiments.cli.main"]


def _heeds_signals():
    """As in a terminal; what a shell starts in the background or by nohup ignores one, and so would the process."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def started(folder, *options):
    """The command in a process of its own, once it drives."""
    command = [*COMMAND, "drive", "--device", "fake", "--headless", "--out", str(folder), *options]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, **pipes, preexec_fn=_heeds_signals)
    assert "driving with" in process.stdout.readline()
    return process, folder / "drive-0001.csv"


def grown(path, size=100_000):
    """Wait until a recording has so many bytes."""
    end = time.monotonic() + 60.0
    while path.stat().st_size < size:
        assert time.monotonic() < end, "the recording does not grow"
        time.sleep(0.05)


def said(capsys, *options, code=2):
    """What the command says where it refuses something."""
    assert main(["drive", *options]) == code
    return capsys.readouterr().err


def test_kill_9_loses_no_more_than_the_last_second(tmp_path, capsys):
    process, path = started(tmp_path, "--seconds", "60", "--manoeuvre", "weave")
    grown(path)
    process.kill()
    killed = time.time()
    process.wait()
    process.stdout.close(), process.stderr.close()
    assert killed - path.stat().st_mtime < 1.0
    recording = files.read(path)
    assert recording.time.size > 100
    assert recording.meta["manoeuvre"] == "weave"
    # An ordinary recording, which evaluate reads, and refuses as it is no whole weave.
    assert main(["evaluate", str(path)]) == 1
    assert "every metric refused" in capsys.readouterr().out


@pytest.mark.whole
def test_a_process_that_was_stopped_goes_on_and_ctrl_c_ends_it(tmp_path):
    process, path = started(tmp_path)
    grown(path)
    process.send_signal(signal.SIGSTOP)
    time.sleep(0.5)
    size = path.stat().st_size
    process.send_signal(signal.SIGCONT)
    grown(path, size + 50_000)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert "deadlines missed" in out
    assert "the torque faded" in out  # it found out that it had been stopped
    assert files.read(path)["deadlines_missed"].max() >= 300.0
    assert files.read(path).time.size > 200


def test_a_terminal_that_closes_ends_the_drive(tmp_path):
    process, path = started(tmp_path)
    grown(path)
    process.send_signal(signal.SIGHUP)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert "with torque for" in out
    assert files.read(path)["watchdog_gain"][-1] < 1.0


def test_a_signal_that_was_dropped_while_a_kernel_was_compiled_ends_the_command(tmp_path, monkeypatch, capsys):
    init = Session.__init__

    def interrupted(self, *given):
        with contextlib.suppress(KeyboardInterrupt):  # as a callback of C does
            signal.raise_signal(signal.SIGINT)
        init(self, *given)

    monkeypatch.setattr(Session, "__init__", interrupted)
    assert "interrupted" in said(capsys, "--device", "fake", "--headless", "--out", str(tmp_path), code=130)
    assert not list(tmp_path.iterdir())


def test_a_wheel_gets_the_torque_with_which_it_is_stable_behind_the_filter(tmp_path, capsys):
    wheel = 0.003, 0.3, 0.001
    part = car_configuration("lugre", cars.load("compact"), hands="angle")[0].subsystem
    found = [haptics.stability(part, haptics.make(*wheel), *more) for more in ((), (BANDWIDTH, PERIOD))]
    assert found[1].share < found[0].share - 0.1
    options = ["--headless", "--seconds", "0.1", "--out", str(tmp_path), "--wheel", "0.003,0.3,1"]
    assert main(["drive", "--device", "fake", *options]) == 0
    assert f"it gives {found[1].share:.0%} of the torque" in capsys.readouterr().out


def test_standard_input_gives_commands(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.StringIO("faster\nfly\n\nquit\n"))
    begin = time.monotonic()
    assert (
        main(["drive", "--device", "fake", "--headless", "--seconds", "600", "--commands", "--out", str(tmp_path)]) == 0
    )
    assert time.monotonic() - begin < 300.0
    told = capsys.readouterr()
    assert "speed held at 105 km/h" in told.out
    assert "steer-env drive: 'fly' is none of swap, set_1" in told.err


@pytest.mark.whole
def test_a_device_that_goes_ends_the_command_with_its_sentence(tmp_path, capsys):
    err = said(capsys, "--device", "fake,faults=unplug@1", "--headless", "--out", str(tmp_path))
    assert "was unplugged: plug it in" in err
    assert files.read(tmp_path / "drive-0001.csv").time.size > 10


def test_a_priority_that_is_not_allowed_is_told(tmp_path, monkeypatch, capsys):
    def refused(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    monkeypatch.setattr(os, "nice", refused)
    assert main(["drive", "--device", "fake", "--headless", "--priority", "5", "--out", str(tmp_path)]) == 2
    told = capsys.readouterr()
    assert "the priority 5 of SCHED_FIFO is not allowed" in told.err
    assert "driving with" not in told.out
    assert not list(tmp_path.iterdir())


def test_files_of_one_name_are_told_by_their_folders_and_with_their_law(tmp_path):
    laws = []
    for name, level in (("A", 1.0), ("B", 1.2)):
        path = tmp_path / name / "fitted.json"
        path.parent.mkdir()
        path.write_text(json.dumps(friction.as_mapping(friction.make("lugre", F_c=level))))
        laws.append(str(path))
    options = ["--headless", "--seconds", "0.1", "--out", str(tmp_path), "--friction", *laws]
    assert main(["drive", "--device", "fake", *options]) == 0
    configurations = files.read(tmp_path / "drive-0001.csv").meta["sets"]
    assert [each["label"] for each in configurations] == laws
    assert {each["law"] for each in configurations} == {"lugre of fitted.json"}


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--device", "spoon"], "spoon"),
        (["--device", "fake,colour=red"], "the device fake has no option 'colour'"),
        (["--device", "fake,red"], "--device takes NAME[,KEY=VALUE...], got 'red'"),
        (["--device", "keyboard", "--headless"], "the device keyboard needs the window"),
        (["--device", "fake", "--headless", "--friction", "lugre", "lugre"], "'lugre' twice"),
        (["--device", "fake", "--headless", "--seconds", "-1"], "--seconds"),
        (["--device", "fake", "--headless", "--torque-limit", "99"], "--torque-limit"),
        (["--device", "keyboard", "--wheel", "0.04,0.5,8"], "--wheel is for a wheel with a motor"),
        (["--device", "fake", "--headless", "--out", "/proc/drives"], "choose another directory"),
        (["--device", "fake", "--headless", "--speed-kph", "900"], "at most 252, got 900"),
    ],
)
def test_what_cannot_be_is_told_in_a_sentence(options, sentence, capsys):
    err = said(capsys, *options)
    assert sentence in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "sentence"),
    [("friction=butter", "butter"), ("dahl", "'dahl' is none of"), ("", "it is empty"), ("set=5", "SECTION.KEY=VALUE")],
)
def test_a_further_configuration_that_makes_no_sense_is_refused(words, sentence, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["drive", "--device", "fake", "--headless", "--b", words])
    assert stop.value.code == 2
    assert sentence in capsys.readouterr().err


def test_without_a_display_it_says_what_to_do(monkeypatch, capsys):
    for name in ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    err = said(capsys, "--device", "fake")
    assert "needs a window, and there is none" in err
    assert "--headless" in err


def test_without_pygame_it_says_what_to_do(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pygame", None)
    assert "pip install '.[drive]'" in said(capsys, "--device", "fake")
