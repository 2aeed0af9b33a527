"""The page of the linearised car: its numbers are those of the loop, and it tells what misses the limits."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from steer_env.experiments.calibration import margin_map
from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import analysis
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import assist_loop
from steer_env.vehicle.analysis.operating_point import cornering, held, steady

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """A map of four points for each pair of hands and friction."""
    monkeypatch.setattr(margin_map, "SPEEDS", (30.0, 60.0))
    monkeypatch.setattr(margin_map, "TORQUES", (0.0, 3.0, 9.0))
    monkeypatch.setattr(analysis, "MODES_SPEEDS", np.array([50.0, 100.0]))
    monkeypatch.setattr(analysis, "BODE_SPEEDS", (100.0,))


@pytest.mark.whole
def test_page_of_a_car(tmp_path, capsys):
    """Margins as those of the loop itself; a torque out of reach is told; the same command gives the same files."""
    for name in ("first", "second"):
        assert main(["analyse", "--vehicle", "compact", "--out", str(tmp_path / name)]) == 0
    assert "keeps 30 deg and 6 dB at all 24 points" in capsys.readouterr().out
    texts = [(tmp_path / name / "analyse.json").read_text(encoding="utf-8") for name in ("first", "second")]
    data = json.loads(texts[0])
    assert texts[0].replace('"first"', '"second"') == texts[1]
    assert len(data["map"]) == 36
    assert sum(cell["reached"] for cell in data["map"]) == 24
    own = next(c for c in data["map"] if (c["speed_kph"], c["torque"], c["hands"]) == (60.0, 3.0, "off"))
    point = held(steady(cornering(cars.load("compact"), 60.0 / 3.6), torque=3.0), "off")
    expected = assist_loop.margins(point)
    assert own["friction"] == margin_map.SLIDING
    assert (own["gain"], own["phase"], own["disk"]) == pytest.approx((expected.gain, expected.phase, expected.disk))
    page = (tmp_path / "first" / "index.html").read_text(encoding="utf-8")
    assert page.count("<figure>") == 5
    assert "Smallest margins at each speed" in page


def test_a_loop_that_misses_the_limits(tmp_path, capsys):
    """A later motor and more boost: the points are named, in the page and in its numbers."""
    changes = ["--set", "assist.boost_scale=1.3", "--set", "assist.delay=0.004"]
    assert main(["analyse", *changes, "--out", str(tmp_path / "page")]) == 0
    data = json.loads((tmp_path / "page" / "analyse.json").read_text(encoding="utf-8"))
    below = [
        c
        for c in data["map"]
        if c["reached"]
        and (
            math.degrees(c["phase"] or math.inf) < 30.0
            or 20.0 * math.log10(c["gain"] or math.inf) < 6.0
            or not c["stable"]
        )
    ]
    assert below
    assert len(below) == len(data["missed"])
    assert f"misses 30 deg and 6 dB at {len(below)} of" in capsys.readouterr().out


def test_a_directory_with_other_files_is_refused(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("kept", encoding="utf-8")
    assert main(["analyse", "--out", str(tmp_path)]) == 2
    assert "holds other files (mine.txt)" in capsys.readouterr().err


def test_the_example_of_the_docs_runs(capsys):
    text = (ROOT / "docs" / "analysis.md").read_text(encoding="utf-8")
    exec(re.search(r"```python\n(.*?)```", text, re.S)[1], {})
    assert "Margins(gain=" in capsys.readouterr().out
