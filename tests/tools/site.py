"""Gather the sources of the site and build it with Sphinx.

The pages of the repository keep their places, so that their relative links work in the site as they do on the code
host; README.md is the landing page, which shows the page of ``steer-env explore``. Files that a page links to are
copied beside them and offered for download.
"""

import os
import posixpath
import re
import runpy
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from tests.tools.site_pages import GALLERY, ROOT, generated

CONFIGURATION = ROOT / "docs"
# Pages of the site that stand for files and folders of the repository.
STANDS_FOR = {
    "README.md": "index.md",
    "LICENSE": "licence.md",
    "CITATION.cff": "citation.md",
    "examples": "examples/index.md",
}
LAWS = ("lugre@column_eps", "lugre", "masing", "coulomb")  # of the car on the landing page
LIVE = """
```{raw} html
<p>Sliders for car and friction law redraw the weave with its metrics, as <code>steer-env explore</code> writes it;
<a href="live/index.html">by itself</a>, or <a href="live/drive.html">drive the car</a> in the browser.</p>
<iframe class="live" src="live/index.html" title="The car with sliders" loading="lazy"></iframe>
```

## Install
"""
# The sidebar: the doors of the README, by the kind of reader, then what all of them look up.
DOORS = {
    "Study friction": (
        "docs/friction_laws.md",
        "laws/index.md",
        "docs/make_a_law.md",
        "docs/friction_measurement.md",
        "docs/road_drive.md",
        "docs/robot_joints.md",
        "docs/report.md",
        "docs/real_time.md",
    ),
    "Calibrate steering": (
        "docs/walkthrough.md",
        "docs/explore.md",
        "docs/car_files.md",
        "docs/cars.md",
        "cars/index.md",
        "docs/analysis.md",
        "docs/recordings.md",
        "docs/tuning.md",
        "docs/sensitivity.md",
    ),
    "Train controllers": (
        "docs/learning.md",
        "docs/make_a_task.md",
        "docs/training.md",
        "docs/benchmark.md",
        "scores.md",
        "docs/environments.md",
        "environments/index.md",
        "docs/friction_shift.md",
        "docs/datasets.md",
        "docs/integrations.md",
        "examples/index.md",
    ),
    "Couple to your own tools": ("docs/fmu.md", "docs/cosimulation.md", "docs/many_machines.md"),
    "Sit at the wheel": ("docs/driving.md", "docs/devices.md"),
    "Reference": (
        "docs/model.md",
        "docs/metrics.md",
        "manoeuvres/index.md",
        "commands/index.md",
        "api/index.md",
        "docs/traces.md",
        "docs/validation.md",
        "docs/compatibility.md",
    ),
    "Project": (
        "docs/architecture.md",
        "CONTRIBUTING.md",
        "CHANGELOG.md",
        "docs/releasing.md",
        "citation.md",
        "licence.md",
    ),
}


def repository_pages() -> dict[str, str]:
    """Place -> text of the Markdown pages of the repository."""
    paths = [ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")]
    paths += sorted((ROOT / "docs").glob("*.md"))
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def targets(place: str, text: str) -> set[str]:
    """What a page links to and shows within the repository, from its root."""
    found = re.findall(r"\]\(([^)#:\s]+)[^)]*\)", text)
    there = {posixpath.normpath(posixpath.join(posixpath.dirname(place), target)) for target in found}
    return {target for target in there if (ROOT / target).exists()}


def led(place: str, text: str) -> str:
    """A page whose links to what another page of the site stands for lead to that page."""
    folder = posixpath.dirname(place)

    def replaced(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(folder, link[1]))
        return f"]({posixpath.relpath(STANDS_FOR[target], folder or '.')}" if target in STANDS_FOR else link[0]

    return re.sub(r"\]\(([^)#:\s]+)", replaced, text)


def contents() -> str:
    """The tables of contents of the landing page, which make the sidebar."""
    parts = []
    for door, places in DOORS.items():
        names = "\n".join(place.removesuffix(".md") for place in places)
        parts.append(f"\n```{{toctree}}\n:hidden:\n:titlesonly:\n:caption: {door}\n\n{names}\n```\n")
    return "".join(parts)


def gather(folder: Path) -> None:
    """Write the sources of the site into a folder, which is replaced."""
    shutil.rmtree(folder, ignore_errors=True)
    written, own = repository_pages(), generated()
    linked = set().union(*(targets(place, text) for place, text in (written | own).items()))
    for target in linked - set(written) - set(STANDS_FOR):
        if (ROOT / target).is_file():
            path = folder / target
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / target, path)
    for place, text in (written | own).items():
        path = folder / STANDS_FOR.get(place, place)
        path.parent.mkdir(parents=True, exist_ok=True)
        if place == "README.md":
            text = text.replace("\n## Install\n", LIVE, 1) + contents()
        path.write_text(led(place, text), encoding="utf-8")


def mathml(tex: str, block: bool) -> str:
    """LaTeX of a page as MathML, which browsers draw without a script or a font of the site.

    The backticks are those of a code host's mark of inline mathematics, which MyST takes for a part of it. The
    converter sets functions without space, and a prime as an apostrophe.
    """
    from docutils.utils.math.latex2mathml import tex2mathml

    spaced = re.sub(r"(\\(?:arctan|cos|cot|exp|ln|log|sin|tanh?)\b)", r"\\,\1\\,", tex.strip("`"))
    return tex2mathml(spaced, as_block=block).replace("<mo>'</mo>", "<mo>′</mo>")


def draw(folder: Path) -> int:
    """Write the page of the car and the pictures of the gallery, in the places that they have in the site."""
    from steer_env.experiments.cli.main import main

    place = folder / "examples" / "gallery"
    place.mkdir(parents=True, exist_ok=True)
    os.chdir(place)
    for script in GALLERY:
        runpy.run_path(str(script))
    return main(["explore", "--friction", *LAWS, "--out", str(folder / "live")])


def build(out: Path, options: Iterable[str] = ("--fail-on-warning", "--keep-going", "--nitpicky")) -> int:
    """Build the site into ``out``, with the sources and what Sphinx keeps beside it; the exit code.

    What is compiled is drawn meanwhile, by a process of its own.
    """
    from sphinx.cmd.build import main

    sources, kept, drawn = (out.with_name(f"{out.name}-{part}").absolute() for part in ("sources", "kept", "drawn"))
    shutil.rmtree(drawn, ignore_errors=True)
    compiled = {key: value for key, value in os.environ.items() if key != "NUMBA_DISABLE_JIT"} | {"MPLBACKEND": "agg"}
    words = [sys.executable, "-m", "tests.tools.site", str(drawn)]
    drawing = subprocess.Popen(words, cwd=ROOT, env=compiled, stdout=subprocess.DEVNULL)
    gather(sources)
    shutil.rmtree(out, ignore_errors=True)
    places = ["--conf-dir", CONFIGURATION, "--doctree-dir", kept, sources, out]
    code = main([*options, "--quiet", "--fresh-env", "--jobs", "auto", "--builder", "html", *map(str, places)])
    if drawing.wait() == 0:
        shutil.copytree(drawn, out, dirs_exist_ok=True)
    return code or drawing.returncode


if __name__ == "__main__":
    sys.exit(draw(Path(sys.argv[1])))
