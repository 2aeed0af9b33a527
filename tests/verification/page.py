"""The page of ``steer-env explore`` in Chromium: how soon it shows and follows, its size, a drive's lag."""

import gzip
import itertools
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from steer_env import metrics
from steer_env.experiments import explore
from steer_env.recording import read
from tests.experiments.explore.chromium import Chromium
from tests.verification.common.rows import Row, verdict

STARTS, MOVES = 3, 200
MINUTE = 60.0  # [s]
CLOCK = "steerDriven.log.samples - performance.now()"  # simulated time less that of the clock [ms]
SHOWN = "document.querySelector('main')?.dataset.run"
EXACT = "typeof steerShown === 'object' && steerShown.answer?.exact"
MOVED = """(async () => {
  const slider = document.querySelector('input[type=range][data-name="friction.F_c"]');
  const main = document.querySelector("main");
  const taken = [];
  for (let k = 0; k < %d; k++) {
    const start = performance.now();
    const drawn = new Promise((resolve) => {
      const watch = new MutationObserver(() => resolve(watch.disconnect()));
      watch.observe(main, { attributeFilter: ["data-run"] });
    });
    slider.value = 20 + (k * 7) %% 160;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    await drawn;
    taken.push(performance.now() - start);
  }
  return taken;
})()"""


def rows() -> Iterator[Row]:
    """Sizes; on each chassis start from disk to the first loops, and time from a slider's move to the redrawn weave."""
    with tempfile.TemporaryDirectory() as folder:
        page = explore.explore(Path(folder, "page"), friction=["lugre"])
        yield from _sizes(page.parent)
        for chassis in ("single_track", "two_track"):
            address = f"{page.as_uri()}#law=lugre&chassis={chassis}"
            starts = [_start(address, Path(folder, f"{chassis}{k}")) for k in range(STARTS)]
            yield _time(f"start to the first loops, {chassis}", 1e3 * min(starts), 1000.0)
            with Chromium(Path(folder, chassis)) as browser:
                browser.open(address)
                browser.until(EXACT)
                taken: Any = browser.value(MOVED % MOVES)
            yield _time(f"slider to redrawn weave, {chassis}, median", float(np.median(taken)), 30.0)
            yield _time(f"slider to redrawn weave, {chassis}, 95th percentile", float(np.quantile(taken, 0.95)), 80.0)
        yield from _drive(page.with_name("drive.html"), Path(folder))


def _drive(page: Path, folder: Path) -> Iterator[Row]:
    """A minute driven by keys on two tracks: how late it was, whether a sample is missing, and what Python reads."""
    with Chromium(folder / "driven") as browser:
        browser.open(f"{page.as_uri()}#law=lugre&chassis=two_track")
        browser.until("typeof steerDriven === 'object' && steerDriven.ready")
        browser.key("p")
        browser.until("steerDriven.log.samples > 0")
        begins: Any = browser.value(CLOCK)
        side = itertools.cycle(["ArrowLeft", "ArrowRight", "ArrowRight", "ArrowLeft"])
        end = time.monotonic() + MINUTE
        while time.monotonic() < end:
            key = next(side)
            browser.call("Input.dispatchKeyEvent", type="keyDown", key=key)
            time.sleep(0.25)
            browser.call("Input.dispatchKeyEvent", type="keyUp", key=key)
            time.sleep(0.1)
        off = browser.value(CLOCK) - begins
        late: Any = browser.value("steerDriven.largest")
        browser.value("document.getElementById('manoeuvre').value = 'road'")
        (folder / "drive.csv").write_text(browser.value("steerDriven.csv()"))
    yield _time("simulated time behind the clock in a minute's drive, at most", late, 25.0)
    # As the page's thread receives it, which draws meanwhile.
    yield _time("simulated time less that of the clock over the minute, as the page receives it", abs(off), 100.0)
    values = metrics.evaluate(read(folder / "drive.csv"), intervals=False)
    found = sum(bool(np.isfinite(value.value)) for value in values.values())
    yield Row("metrics of the minute, evaluated as a drive on a road", f"{found}", ">= 1", verdict(found >= 1))


def _sizes(folder: Path) -> Iterator[Row]:
    """What the page loads first, as sent by a host that compresses and on disk, and what a further law adds."""
    modules = sorted((folder / "modules").iterdir())
    first = [*(file for file in folder.iterdir() if file.is_file()), *modules[: len(modules) // 2]]  # of one chassis
    data = [file.read_bytes() for file in first]
    law = max(len(gzip.compress(file.read_bytes())) for file in modules if "beginning" not in file.name)
    yield _size("first load, gzipped", sum(len(gzip.compress(each)) for each in data), 1e6)
    yield _size("first load, on disk", sum(map(len, data)), 2e6)
    yield _size("a further law, gzipped", law, 1e5)


def _size(what: str, value: float, most: float) -> Row:
    return Row(what, f"{value / 1e3:.0f} kB", f"<= {most / 1e3:g} kB", verdict(value <= most))


def _start(address: str, profile: Path) -> float:
    with Chromium(profile) as browser:
        begins = time.monotonic()
        browser.open(address)
        browser.until(SHOWN)
        return time.monotonic() - begins


def _time(what: str, value: float, most: float) -> Row:
    return Row(what, f"{value:.0f} ms", f"<= {most:g} ms", verdict(value <= most))
