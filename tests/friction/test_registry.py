"""A law from one file is picked up everywhere; compiled code is cached, and never stale."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from steer_env import friction
from tests.friction import contracts

ROOT = Path(__file__).parents[2]
C = friction.make("viscous").sigma_2


def test_toy_law_is_found(toy):
    assert "toy_jenkins" in friction.available()
    p = friction.make("toy_jenkins", k=50.0)
    assert p == toy.Jenkins(50.0, 0.9)
    assert friction.law_of(p).parameters is toy.Jenkins
    with pytest.raises(ValueError, match="it takes: k, F_c"):
        friction.make("toy_jenkins", sigma_0=1.0)


@pytest.mark.parametrize("check", contracts.CHECKS, ids=lambda check: check.__name__)
def test_toy_law_keeps_the_contracts(toy, check):
    check(friction.make("toy_jenkins"))


def test_toy_law_in_plain_python(toy):
    contracts.check_plain_python([friction.make("toy_jenkins")])


def test_toy_law_equals_masing_with_one_element(toy):
    """Two solvers of one law: Newton with a kink, and the exact march."""
    jenkins, masing = friction.make("toy_jenkins"), friction.make("masing", k=[100.0], y=[0.009])
    x = np.cumsum(np.random.default_rng(5).normal(0.0, 4e-3, 500))
    np.testing.assert_allclose(friction.response(jenkins, x, 1e-3), friction.response(masing, x, 1e-3), atol=1e-13)
    (rows, _), (expected, _) = contracts.trace(jenkins), contracts.trace(masing)
    np.testing.assert_allclose(rows, expected, rtol=1e-9, atol=1e-12)  # roundings carried on by 200 steps


# Each of these starts Python afresh, with the cache in a folder of its own.

REPORT = """
import json, sys, numpy as np
from steer_env import friction
from steer_env.friction import law
from steer_env.friction.numerics.kernel import cache_directory
{imports}
p = friction.make({name!r})
w, T = law.step(p, 1.0, np.zeros(law.law_of(p).memory_size(p)), 100.0, 50.0, 1e-3, 0.0)
print(json.dumps({{
    "torque": T,
    "folder": str(cache_directory()),
    "compiled": sum(law.step.stats.cache_misses.values()),
    "loaded": sum(law.step.stats.cache_hits.values()),
}}))
"""


def fresh_process(cache, name="viscous", imports="", path=ROOT):
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", REPORT.format(name=name, imports=imports)],
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": f"{ROOT}{os.pathsep}{path}"},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_a_warm_process_compiles_nothing(tmp_path):
    cold, warm = fresh_process(tmp_path), fresh_process(tmp_path)
    assert (cold["compiled"], cold["loaded"]) == (1, 0)
    assert (warm["compiled"], warm["loaded"]) == (0, 1)
    assert warm["torque"] == cold["torque"]
    assert Path(warm["folder"]).parent == tmp_path


def test_an_edited_law_is_compiled_afresh(tmp_path):
    """``step`` lives in another file than the law it inlines; numba's own cache would serve the old law."""
    source = Path(friction.models.viscous.__file__).read_text().replace('"viscous"', '"outside"')
    file, cache = tmp_path / "outside.py", tmp_path / "cache"

    def run(text):
        file.write_text(text)
        return fresh_process(cache, "outside", "import outside", tmp_path)

    first, doubled, again = run(source), run(source.replace("p.sigma_2", "2.0 * p.sigma_2")), run(source)
    assert first["torque"] == pytest.approx(50.0 * C / (100.0 + C))
    assert doubled["torque"] == pytest.approx(50.0 * 2.0 * C / (100.0 + 2.0 * C))
    assert doubled["folder"] != first["folder"]
    assert again == first | {"compiled": 0, "loaded": 1}
    assert fresh_process(cache)["folder"] not in (first["folder"], doubled["folder"])


def test_without_a_writable_cache_it_compiles_in_memory():
    report = fresh_process("/proc/nonexistent")
    assert report["folder"] == "None"
    assert report["torque"] == pytest.approx(50.0 * C / (100.0 + C))
    assert report["loaded"] == 0


def test_a_law_typed_at_a_prompt_works(tmp_path):
    """No source file to stamp: its kernels are compiled in memory, and only its callers are cached."""
    source = Path(friction.models.viscous.__file__).read_text().replace('"viscous"', '"typed"')
    report = fresh_process(tmp_path, "typed", f"exec({source!r})")
    assert report["torque"] == pytest.approx(50.0 * C / (100.0 + C))
