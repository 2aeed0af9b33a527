"""A page in a browser."""

import sys

import pytest

from steer_env.experiments import explore
from tests.experiments.explore.cases import BROWSERS


@pytest.fixture(scope="session")
def page(tmp_path_factory):
    return explore.explore(tmp_path_factory.mktemp("page") / "page", friction=["lugre"], chassis=["single_track"])


@pytest.fixture(scope="module", autouse=True)
def _engines():
    """Engines of V8, whose threads and memory no other test has to bear, end with the module."""
    yield
    if engines := sys.modules.get("tests.experiments.explore.engine"):  # which needs an extra
        engines.engine.cache_clear()


@pytest.fixture(params=BROWSERS[:1])
def browser(request, tmp_path):
    with request.param(tmp_path / "profile") as found:
        yield found
        assert found.errors == []
