"""Build a release and check it: ``make release``, or this script with a folder for the files.

Of the last commit, never of what lies about, a source archive is built, and the wheel of that archive: it holds no
links, as a file system without symbolic links would not. Both are installed away from the checkout, each into an empty
environment, and run the first example of the README and the command. The script prints what is left to do by hand.
"""

import re
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
BY_HAND = """
left by hand, in this order:
  docs/releasing.md from 1 to 5
  git tag v{version} && git push --tags
  python -m twine upload {out}/*       # needs an account of the index and its token
  docs and README no longer say that the package is not on an index
"""


def called(*words: object, **more: object) -> None:
    """Run a program; what it says is shown, and CalledProcessError where it fails."""
    print("+", *words, flush=True)
    subprocess.run([str(word) for word in words], check=True, **more)


def environment(folder: Path, *installed: object) -> Path:
    """The Python of a new environment with some packages."""
    venv.create(folder, with_pip=True)
    python = folder / ("Scripts" if sys.platform == "win32" else "bin") / "python"
    called(python, "-m", "pip", "install", "--quiet", *installed)
    return python


def version() -> str:
    """The version, if it is the same wherever it stands; ValueError with the places otherwise."""
    places = {
        "pyproject.toml": r'^version = "(.+)"',
        "CITATION.cff": r"^version: (.+)",
        "CHANGELOG.md": r"^## (\S+)",
    }
    found = {name: re.search(at, (ROOT / name).read_text("utf-8"), re.MULTILINE)[1] for name, at in places.items()}
    if len(set(found.values())) > 1:
        raise ValueError(f"the version must be the same everywhere, got {found}")
    return found["pyproject.toml"]


def built(out: Path, work: Path) -> tuple[Path, Path]:
    """Source archive and wheel of the last commit, in an empty folder ``out``."""
    source = work / "source"
    source.mkdir()
    called("git", "archive", "--output", work / "head.tar", "HEAD", cwd=ROOT)
    with tarfile.open(work / "head.tar") as archive:
        archive.extractall(source)
    python = environment(work / "build", "build", "twine")
    called(python, "-m", "build", "--outdir", out, source)  # the wheel is made of the source archive
    called(python, "-m", "twine", "check", "--strict", *out.iterdir())
    (archive_of,), (wheel,) = out.glob("*.tar.gz"), out.glob("*.whl")
    return archive_of, wheel


def packaged(source: Path, wheel: Path) -> None:
    """ValueError where one of them has a link, or the wheel lacks a module of the last commit."""
    with tarfile.open(source) as archive:
        links = [member.name for member in archive if member.issym() or member.islnk()]
    if links:
        raise ValueError(f"{source.name} has links, which some systems cannot make: {', '.join(links)}")
    tracked = subprocess.run(["git", "ls-files", "*.py"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    packages = ("friction/", "vehicle/", "experiments/")
    wanted = {f"steer_env/{path}" for path in tracked.split() if path.startswith(packages)}
    wanted |= {path for path in tracked.split() if path.startswith("steer_env/")}
    missing = sorted(wanted - set(zipfile.ZipFile(wheel).namelist()))
    if missing:
        raise ValueError(f"{wheel.name} lacks {len(missing)} modules, {missing[0]} among them")


def runs(made: Path, work: Path) -> None:
    """Install a file into an empty environment, and run the first example and the command, away from the checkout."""
    python = environment(work / made.suffix[1:], made, "--constraint", ROOT / "constraints.txt")
    example = (
        (ROOT / "README.md").read_text("utf-8").partition("## First example\n\n```python\n")[2].partition("```")[0]
    )
    away = work / f"away from {made.suffix[1:]}"
    away.mkdir()
    called(python, "-I", "-c", example, cwd=away)
    called(python.with_name("steer-env"), "run", "rig", "--out", "results", cwd=away)


def main(out: Path) -> int:
    """Build and check; the exit code."""
    if out.exists() and any(out.iterdir()):
        raise ValueError(f"{out} must be empty, so that nothing of an earlier release is uploaded")
    found = version()
    changed = subprocess.run(["git", "status", "--porcelain"], cwd=ROOT, check=True, capture_output=True, text=True)
    if changed.stdout:
        print(f"not in the release, as it is not committed:\n{changed.stdout}")
    with tempfile.TemporaryDirectory() as folder:
        files = built(out.resolve(), Path(folder))
        packaged(*files)
        for made in files:
            runs(made, Path(folder))
    print(", ".join(made.name for made in files), "are built, checked, installed and run")
    print(BY_HAND.format(version=found, out=out))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "dist")))
