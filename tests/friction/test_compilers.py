"""The choice of the compiler, what takes over where the fast one cannot be loaded, and equal results."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from steer_env.friction.numerics.kernel import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="nothing is compiled")

ROOT = Path(__file__).parents[2]

STEP = """
from steer_env import friction
from steer_env.friction import law
import numpy as np
print(law.step(friction.make("lugre"), 1.0, np.zeros(1), 100.0, 50.0, 1e-3, 0.0))
from steer_env.friction.numerics import kernel
print(kernel.COMPILER)
"""


COMPILING = "steer-env: compiling machine code for "  # said where it takes more than a second


def run(code, folder, **settings):
    """Exit status, lines of the output and lines of standard error of a new process."""
    # The choice of this process must not decide that of the other one.
    inherited = {name: value for name, value in os.environ.items() if name != "STEER_ENV_COMPILER"}
    environment = {**inherited, "STEER_ENV_QUIET": "0", "NUMBA_CACHE_DIR": str(folder), **settings}
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout.splitlines(), done.stderr.splitlines()


def others(error):
    """Lines on standard error but the one that says that kernels are compiled."""
    return [line for line in error if not line.startswith(COMPILING)]


def test_another_choice_is_refused(tmp_path):
    code, _, error = run(STEP, tmp_path, STEER_ENV_COMPILER="gcc")
    assert code != 0
    assert error[-1] == (
        "ValueError: STEER_ENV_COMPILER must be 'numba' or 'fast', or unset for the fast one, got 'gcc'"
    )


RENAMED = "import numba.core.codegen as m; m.Library = m.__dict__.pop('JITCodeLibrary')\n"


@pytest.mark.whole
def test_numbas_own_compiler_takes_over(tmp_path):
    """Where numba has renamed something: with one line about it, and the same numbers."""
    code, output, error = run(RENAMED + STEP, tmp_path)
    assert code == 0, error
    assert output == [run(STEP, tmp_path)[1][0], "numba"]
    assert len(others(error)) == 1
    assert others(error)[0].startswith("steer-env: the fast compiler cannot be loaded (ImportError(")
    assert run(RENAMED + STEP, tmp_path, STEER_ENV_QUIET="1")[2] == []


def test_a_kernel_that_is_wrong_itself_is_no_failure_of_the_compiler(tmp_path):
    wrong = """
from steer_env.friction.numerics.kernel import kernel
@kernel
def wrong(x):
    return x.nothing
try:
    wrong(1.0)
except Exception as error:
    print(type(error).__name__)
"""
    code, (kind, _, compiler), error = run(wrong + STEP, tmp_path, STEER_ENV_COMPILER="fast")
    assert (code, kind, compiler, others(error)) == (0, "TypingError", "fast", [])


ROLLOUT = """
import sys, gymnasium, numpy as np, steer_env
from numba.core import event
compiled = event.RecordingListener()
event.register("numba:compile", compiled)
env = gymnasium.make(steer_env.registration.id_of("AssistWeave"), chassis="two_track", friction="masing")
env.reset(seed=1)
functions = sum(each.is_start for _, each in compiled.buffer)
env.action_space.seed(1)
rows = []
for _ in range(40):
    seen, reward, *_ = env.step(env.action_space.sample())
    rows.append([*np.asarray(seen, float), reward])
np.save(sys.argv[1], np.array(rows))
from steer_env.friction.numerics import kernel
print(kernel.COMPILER, functions)
"""


# Functions that numba compiles for an environment on two tracks with its law, 185 when this was set; 0.1 s each.
COMPILED_AT_MOST = 189


@pytest.mark.whole
def test_both_compilers_give_the_same_rollouts_to_the_bit(tmp_path):
    """An environment on two tracks, compiled by each compiler from nothing, which says once that it compiles."""
    results = []
    for choice in ("numba", "fast"):
        file = tmp_path / f"{choice}.npy"
        code = ROLLOUT.replace("sys.argv[1]", repr(str(file)))
        status, output, error = run(code, tmp_path / choice, STEER_ENV_COMPILER=choice)
        assert status == 0, error
        compiler, functions = output[0].split()
        assert compiler == choice
        assert choice == "numba" or 0 < int(functions) <= COMPILED_AT_MOST
        assert len(error) == 1
        assert error[0].startswith(COMPILING)
        assert error[0].endswith("once, as it is kept")
        assert run(code, tmp_path / choice, STEER_ENV_COMPILER=choice)[2] == []  # from the cache
        results.append(np.load(file))
    assert results[0].tobytes() == results[1].tobytes()
