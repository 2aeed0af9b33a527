"""Processor time of the first step of an environment, by each compiler and from the cache.

``python tests/tools/compile_time.py`` prints a table in Markdown. Required are at most 30 s with numba's own compiler,
at most 15 s with the fast one, and at most 3 s for a second task or another friction law on the same chassis.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
STEP = """
import time, gymnasium
from steer_env.registration import id_of
env = gymnasium.make(id_of("{task}"), chassis="{chassis}", friction="{friction}")
env.reset(seed=0)
env.step(env.action_space.sample())
print(time.process_time())
"""
RUNS = (
    ("cold", "AssistWeave", "single_track", "lugre"),
    ("from the cache", "AssistWeave", "single_track", "lugre"),
    ("second task", "AssistRelease", "single_track", "lugre"),
    ("second law", "AssistWeave", "single_track", "masing"),
    ("cold, two tracks", "AssistWeave", "two_track", "lugre"),
)


def first_step(compiler: str, folder: str, task: str, chassis: str, friction: str) -> float:
    """Processor time of a new process to the end of its first step, imports and all [s]."""
    settings = {"NUMBA_CACHE_DIR": folder, "STEER_ENV_COMPILER": compiler, "STEER_ENV_QUIET": "1"}
    path = {"PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, "-c", STEP.format(task=task, chassis=chassis, friction=friction)]
    environment = {**os.environ, **settings, **path}
    return float(subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout)


def main() -> None:
    print("| first step of AssistWeave, processor time [s] | numba | fast |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as numba, tempfile.TemporaryDirectory() as fast:
        for what, *run in RUNS:
            own, quick = first_step("numba", numba, *run), first_step("fast", fast, *run)
            print(f"| {what} | {own:.1f} | {quick:.1f} |", flush=True)


if __name__ == "__main__":
    main()
