"""The page of ``steer-env explore`` in Chromium: how soon it shows the car, and how soon it follows a slider."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from steer_env.experiments import explore
from tests.experiments.explore.chromium import Chromium
from tests.verification.common.rows import Row, verdict

STARTS, MOVES = 3, 200
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
    """Start from disk to the first loops, and the time from a move of a slider to the redrawn weave, each chassis."""
    with tempfile.TemporaryDirectory() as folder:
        page = explore.explore(Path(folder, "page"), friction=["lugre"])
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


def _start(address: str, profile: Path) -> float:
    with Chromium(profile) as browser:
        begins = time.monotonic()
        browser.open(address)
        browser.until(SHOWN)
        return time.monotonic() - begins


def _time(what: str, value: float, most: float) -> Row:
    return Row(what, f"{value:.0f} ms", f"<= {most:g} ms", verdict(value <= most))
