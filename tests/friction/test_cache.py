"""Machine code is kept, found again whatever is imported, never stale, and missing or damaged folders do no harm.

Each of these tests starts Python afresh, with the cache in a folder of its own.
"""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from steer_env import friction
from steer_env.friction.numerics import cache
from steer_env.friction.numerics.kernel import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="nothing is compiled")

ROOT = Path(__file__).parents[2]
C = friction.make("viscous").sigma_2
TORQUE = pytest.approx(50.0 * C / (100.0 + C))

REPORT = """
import json, numpy as np
from steer_env import friction
from steer_env.friction import law
{imports}
p = friction.make({name!r})
w, T = law.step(p, 1.0, np.zeros(law.law_of(p).memory_size(p)), 100.0, 50.0, 1e-3, 0.0)
print(json.dumps({{
    "torque": T,
    "folder": law.step.kernel.stats.cache_path,
    "compiled": sum(law.step.kernel.stats.cache_misses.values()),
    "loaded": sum(law.step.kernel.stats.cache_hits.values()),
}}))
"""


def fresh_process(folder, name="viscous", imports="", path=ROOT, **settings):
    """What a new process reports of one step with a law."""
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", REPORT.format(name=name, imports=imports)],
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": f"{ROOT}{os.pathsep}{path}"} | settings,
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_a_warm_process_compiles_nothing_whatever_is_imported(tmp_path):
    cold = fresh_process(tmp_path)
    warm = fresh_process(tmp_path, imports="import steer_env.drivers; friction.law.LAWS.all()")
    assert (cold["compiled"], cold["loaded"]) == (1, 0)
    assert (warm["compiled"], warm["loaded"]) == (0, 1)
    assert warm["torque"] == cold["torque"] == TORQUE
    assert Path(warm["folder"]).is_relative_to(tmp_path / cache.FOLDER / "steer_env.friction.law.step")


def test_an_edited_law_is_compiled_afresh(tmp_path):
    """``step`` lives in another file than the law that becomes part of it; numba's cache would serve the old law."""
    source = Path(friction.models.viscous.__file__).read_text(encoding="utf-8").replace('"viscous"', '"outside"')
    file, folder = tmp_path / "outside.py", tmp_path / "cache"

    def run(text):
        file.write_text(text)
        return fresh_process(folder, "outside", "import outside", tmp_path)

    first = run(source)
    assert first["torque"] == TORQUE
    doubled = run(source.replace("p.sigma_2", "2.0 * p.sigma_2"))
    assert doubled["torque"] == pytest.approx(50.0 * 2.0 * C / (100.0 + 2.0 * C))
    assert doubled["folder"] != first["folder"]
    assert run(source) == first | {"compiled": 0, "loaded": 1}


def test_a_law_typed_at_a_prompt_works(tmp_path):
    """Its kernels have no source file, so that numba caches only their callers."""
    source = Path(friction.models.viscous.__file__).read_text(encoding="utf-8").replace('"viscous"', '"typed"')
    report = fresh_process(tmp_path, "typed", f"exec({source!r})")
    assert report["torque"] == TORQUE


def test_without_a_writable_folder_it_compiles_in_memory():
    report = fresh_process("/proc/nonexistent")
    assert report == {"torque": TORQUE, "folder": None, "compiled": 1, "loaded": 0}


@pytest.mark.whole
@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_damaged_files_are_replaced(tmp_path, suffix):
    fresh_process(tmp_path)
    files = list(tmp_path.rglob(f"*.{suffix}"))
    assert files
    for file in files:
        file.write_bytes(file.read_bytes()[:40])
    assert fresh_process(tmp_path)["torque"] == TORQUE
    assert fresh_process(tmp_path) == fresh_process(tmp_path)


@pytest.mark.whole
def test_a_full_disk_does_no_harm(tmp_path):
    full = "from steer_env.friction.numerics import cache; from numba.core.caching import IndexDataCacheFile as F\n"
    full += "def refuse(*_): raise OSError(28, 'No space left on device')\nF._save_data = F._save_index = refuse"
    assert fresh_process(tmp_path, imports=full)["torque"] == TORQUE
    assert fresh_process(tmp_path)["compiled"] == 1


@pytest.mark.whole
def test_processes_that_write_at_once_leave_a_whole_cache(tmp_path):
    """Two signatures of one kernel, each from two processes, one of which compiles while the other waits."""
    names = ["viscous", "coulomb"] * 2
    with ThreadPoolExecutor(4) as pool:
        reports = list(pool.map(lambda name: fresh_process(tmp_path, name), names))
    for name, report in zip(names, reports):
        warm = fresh_process(tmp_path, name)
        assert warm["torque"] == report["torque"]
        assert warm["loaded"] == 1
    for name in ("viscous", "coulomb"):
        assert sorted(report["compiled"] for of, report in zip(names, reports) if of == name) == [0, 1]


def test_only_our_own_old_folders_are_pruned(tmp_path):
    ours = [tmp_path / f"{i:032x}" for i in range(cache.NEWEST + 2)]
    foreign = tmp_path / "thesis"
    for age, folder in enumerate([*ours, foreign]):
        folder.mkdir()
        os.utime(folder, (1e9 - age, 1e9 - age))
    os.utime(ours[-1])
    cache.prune(tmp_path)
    assert foreign.exists()
    assert ours[-1].exists()
    assert not any(folder.exists() for folder in ours[:-1])  # all older than UNUSED
    cache.prune(tmp_path / "nowhere")
