"""Whether the kernels of a friction law mean the same to the interpreter as to the compiler."""

import os
import pickle
import subprocess
import sys
from collections.abc import Iterable
from typing import Any

import numpy as np

from steer_env import friction
from steer_env.friction import law
from steer_env.testing.histories import Array, at_rest


def trace(p: Any) -> tuple[Array, Array]:
    """Speeds, torques and energies of a fixed random run (200, 4), and the response to a random displacement (200,)."""
    rng = np.random.default_rng(7)
    memory, w, rows = at_rest(p), 0.0, []
    for _ in range(200):
        S, h, torque_scale = 10.0 ** rng.uniform((-1, -5, -0.5), (3, -2, 0.5))
        w, T = law.step(p, torque_scale, memory, S, rng.normal(0.0, 3.0), h, w)
        rows.append((w, T, law.torque(p, torque_scale, memory, w), law.stored_energy(p, memory)))
    x = np.cumsum(rng.normal(0.0, 3e-3, 200))
    return np.array(rows), friction.response(p, x, 1e-3)


def check_plain_python(sets: Iterable[Any]) -> None:
    """The kernels mean the same to the interpreter as to the compiler, for all parameter sets in one other process.

    Raises
    ------
    ValueError
        The class of a set stands in the script that runs, where the other process cannot import it.
    AssertionError
        They do not, or the kernels fail or warn in plain Python.
    """
    sets = list(sets)
    for p in sets:
        if type(p).__module__ == "__main__":
            raise ValueError(f"{type(p).__name__} stands in the script that runs; put the law into a module of its own")
    code = "from steer_env.testing import plain_python; plain_python.answer()"
    settings = {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        input=pickle.dumps(sets),
        env=os.environ | settings,
        capture_output=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr.decode()
    for p, (rows, torques) in zip(sets, pickle.loads(run.stdout)):
        expected_rows, expected_torques = trace(p)
        # the compiler writes x**2 as x*x and may link another exp: an ulp each, carried on by 200 steps
        np.testing.assert_allclose(rows, expected_rows, rtol=1e-9, atol=1e-12, err_msg=repr(p))
        np.testing.assert_allclose(torques, expected_torques, rtol=1e-12, atol=1e-12, err_msg=repr(p))


def answer() -> None:
    """What the other process does: parameter sets from standard input, their traces to standard output."""
    traces = [trace(p) for p in pickle.load(sys.stdin.buffer)]
    sys.stdout.buffer.write(pickle.dumps(traces))
