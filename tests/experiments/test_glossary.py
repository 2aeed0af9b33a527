"""The pages of metrics, environments and car files are what their definitions say."""

import pytest

from tests.tools import glossary


@pytest.mark.parametrize("path", glossary.PAGES, ids=lambda path: path.name)
def test_the_page_is_up_to_date(path):
    assert path.read_text(encoding="utf-8") == glossary.PAGES[path](), "run python -m tests.maintain glossary"


def test_environments_tell_ranges_noise_and_both_kinds_of_arguments():
    page = glossary.environments_page()
    assert "| `load` | 0 to 500 | mass added to the body [kg] |" in page
    assert "| `entry_offset` | -1 to 1 | lateral offset of the start, left positive [m] |" in page
    assert "| `road_friction` | 0.4 to 1.2 |" in page  # of the tuning's weave
    path = "path at 0.1, 0.2 ... 1.5 s: lateral position of the path ahead, in the car's frame"
    assert f"| 10-24 | {path} | 30 | 0.3 to 1.7 | m |" in page
    assert "| path 0.2s" not in page
    assert "| yaw rate | 0.002 | rad/s |" in page
    assert page.count("| option | range | meaning |") == len(glossary.REGISTERED)
    for argument in ("targets : str", "threads : int", "autoreset_mode : ", "control_dt : float"):
        assert argument in page
