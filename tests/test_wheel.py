"""The wheel, away from the checkout, and on a system that lacks what Windows lacks."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# Runs the command line, or a program, without what POSIX alone has. Libraries that it uses may open text as they like.
WITHOUT_POSIX = """
import os, signal, sys, warnings

warnings.simplefilter("ignore", EncodingWarning)
warnings.filterwarnings("error", category=EncodingWarning, module=r"steer_env\\.")
for name in ("fcntl", "resource", "pwd", "grp", "termios", "pty", "tty"):
    sys.modules[name] = None
for name in ("fork", "forkpty", "killpg", "setsid", "mkfifo", "sched_getaffinity", "sched_setscheduler", "sched_param"):
    delattr(os, name)
del signal.SIGKILL, signal.SIGHUP


def symlink(*_, **__):
    raise OSError("a required privilege is not held by the client")


os.symlink = symlink
if len(sys.argv) == 2:
    exec(sys.argv[1])
else:
    from steer_env.experiments.cli.main import main

    sys.exit(main())
"""

EXAMPLE = """
import gymnasium as gym
import steer_env

env = gym.make("steer_env/AssistWeave-v3")
env.reset(seed=0)
print(steer_env.__file__, *env.step(env.action_space.sample())[0].shape)
"""

COMMANDS = sorted(path.stem for path in (ROOT / "experiments" / "cli").glob("[a-z]*.py") if path.stem != "main")
HELP = f"""
from contextlib import suppress
from steer_env.experiments.cli.main import main

for name in {COMMANDS}:
    with suppress(SystemExit):
        main([name.replace("_", "-"), "--help"])
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the wheel, below a drive and a space, and nothing else of this project."""
    folder = tmp_path_factory.mktemp("wheel")
    left_out = shutil.ignore_patterns(".*", "build", "dist", "report", "*.egg-info", "__pycache__")
    shutil.copytree(ROOT, folder / "source", symlinks=True, ignore=left_out)
    target = folder / "C" / "Program Files"
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", folder, folder / "source"], check=True)
    (wheel,) = folder.glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", target, wheel], check=True)
    return target


def run(installed, *arguments):
    settings = {"PYTHONPATH": str(installed), "PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0", "LC_ALL": "C"}
    command = [sys.executable, "-X", "warn_default_encoding", "-c", WITHOUT_POSIX, *map(str, arguments)]
    done = subprocess.run(
        command, cwd=installed.parent, env={**os.environ, **settings}, capture_output=True, encoding="cp1252"
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.whole
def test_the_wheel_works_without_what_windows_lacks(installed):
    """The environments; a test driven, written, read and evaluated; a page; and the help of every command."""
    assert not [path for path in installed.rglob("*") if path.is_symlink()]
    where, observations = run(installed, EXAMPLE).rsplit(maxsplit=1)
    assert Path(where).is_relative_to(installed)
    assert observations == "9"
    assert "peak_handwheel_torque" in run(installed, "run", "weave", "--out", "my runs")
    recording = installed.parent / "my runs" / "weave.csv"
    assert "torque_deadband" in run(installed, "evaluate", recording, "--manoeuvre", "weave")
    run(installed, "car", "--new", "my car.toml")
    assert "keeps 30 deg and 6 dB" in run(installed, "analyse", "--vehicle", "my car.toml", "--out", "my page")
    assert (installed.parent / "my page" / "index.html").is_file()
    assert run(installed, HELP).count("usage: steer-env") == len(COMMANDS)
