"""The list of planted errors is in step with the code."""

import pytest

from tests.tools.planted_errors import ERRORS, ROOT


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: error.name)
def test_an_error_can_be_planted(error):
    assert (ROOT / error.file).read_text(encoding="utf-8").count(error.right) == 1
    assert all((ROOT / path).exists() for path in error.tests.split())
