"""A short smoke test over versions of the dependencies: ``make test-matrix``, or this script with versions of numba.

For each version of numba, and for the lower bounds of all dependencies together, a virtual environment is made and the
package is installed in it. A new process then imports the package, compares a friction law with its closed form, drives
50 steps of an environment and a few of four side by side, once for each compiler. The script prints the versions and
digests that docs/compatibility.md lists, and its exit code is 1 if anything failed.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

import tomllib

ROOT = Path(__file__).parents[2]
VERSIONS = ("0.61.2", "0.62.1", "0.63.1", "0.64.0", "0.65.1", "0.66.0", "0.67.0", "0.68.1")
LOWEST = "lower bounds"

SMOKE = """
import hashlib, json, time
import gymnasium, llvmlite, numba, numpy as np, steer_env
from steer_env import friction
from steer_env.friction.numerics import kernel

x = np.linspace(0.0, 0.05, 200)
p = friction.make("dahl")
expected = p.F_c * (1.0 - np.exp(-x * p.sigma_0 / p.F_c))
error = float(np.abs(friction.response(p, x, 0.01) - expected).max())
assert error < 1e-13, error

env = gymnasium.make("steer_env/AssistWeave-v3", friction="lugre")
seen, _ = env.reset(seed=1)
digest = hashlib.sha256(seen.tobytes())
for i in range(50):
    seen, reward, *_ = env.step(np.array([0.2 * np.sin(0.1 * i)], np.float32))
    digest.update(seen.tobytes() + np.float64(reward).tobytes())
    if i == 0:
        first = time.process_time()

one = gymnasium.make("steer_env/AssistWeave-v3", friction="lugre")
four = gymnasium.make_vec("steer_env/AssistWeave-v3", num_envs=4, friction="lugre")  # side by side
one.reset(seed=1), four.reset(seed=1)
for i in range(5):
    alone, beside = one.step(np.array([0.2], np.float32))[0], four.step(np.full((4, 1), 0.2, np.float32))[0]
    assert (beside[0] == alone).all(), (beside[0], alone)
print(json.dumps({
    "numba": numba.__version__, "llvmlite": llvmlite.__version__, "numpy": np.__version__, "first": first,
    "digest": digest.hexdigest()[:8], "compiler": kernel.COMPILER,
}))
"""


def requirements(version: str) -> list[str]:
    """What pip is to install besides the package."""
    if version != LOWEST:
        return [f"numba=={version}"]
    with (ROOT / "pyproject.toml").open("rb") as file:
        listed = tomllib.load(file)["project"]["dependencies"]
    return [each.replace(">=", "==") for each in listed if ";" not in each]


def install(folder: Path, version: str) -> Path:
    """A virtual environment with the package and one version of numba; its Python."""
    venv.create(folder, with_pip=True)
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    command = [python, "-m", "pip", "install", "--quiet", "--editable", ROOT, *requirements(version)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return python


def smoke(python: Path, compiler: str) -> dict[str, str | float]:
    """What a new process reports; what went wrong under ``"failed"``."""
    with tempfile.TemporaryDirectory() as cache:
        settings = {"NUMBA_CACHE_DIR": cache, "STEER_ENV_COMPILER": compiler}
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | settings
        done = subprocess.run(
            [python, "-c", SMOKE], env=environment, cwd=cache, capture_output=True, text=True, check=False
        )
    if done.returncode:
        return {"failed": (done.stderr.strip().splitlines() or ["no message"])[-1]}
    found = json.loads(done.stdout)
    if found["compiler"] != compiler:
        found["failed"] = next(line for line in done.stderr.splitlines() if "fast compiler" in line)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("versions", nargs="*", default=[*VERSIONS, LOWEST], help="of numba, or 'lower bounds'")
    failed = False
    python_version = ".".join(map(str, sys.version_info[:3]))
    print("| installed | Python | numpy | numba, llvmlite | compiler | first step [s] | digest of 50 steps |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for version in parser.parse_args().versions:
        with tempfile.TemporaryDirectory() as folder:
            try:
                python = install(Path(folder), version)
            except subprocess.CalledProcessError as error:
                failed = True
                reason = (error.stderr.strip().splitlines() or ["no message"])[-1]
                print(f"| {version} | {python_version} | | | | | cannot be installed: {reason} |", flush=True)
                continue
            for compiler in ("numba", "fast"):
                found = smoke(python, compiler)
                failed |= "failed" in found and compiler == "numba"
                if "digest" not in found:
                    print(f"| {version} | {python_version} | | | {compiler} | | {found['failed']} |", flush=True)
                    continue
                last = found.get("failed", f"`{found['digest']}`")
                print(
                    f"| {version} | {python_version} | {found['numpy']} | {found['numba']}, {found['llvmlite']} "
                    f"| {compiler} | {found['first']:.1f} | {last} |",
                    flush=True,
                )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
