"""Fixtures that several packages' tests share."""

import importlib
import os
import sys

import pytest
from hypothesis import settings

from steer_env.friction import law
from steer_env.friction.numerics import kernel

# Windows of render_mode="human" that no screen has to show.
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

# The same examples at every run: a failure is a change of the code, not a throw of the dice.
settings.register_profile("suite", derandomize=True, deadline=None)
settings.register_profile("random", deadline=None, print_blob=True)  # `make test-all`, with a seed that it prints
settings.load_profile("suite")


@pytest.fixture(scope="module")
def toy():
    """The toy law, registered for one module's tests only."""
    registries = (law.LAWS._things, law.LAWS._by_class, kernel._digests)
    before = [dict(registry) for registry in registries]
    module = importlib.import_module("tests.friction.toy_law")
    yield module
    del sys.modules[module.__name__]
    for registry, entries in zip(registries, before):
        registry.clear()
        registry.update(entries)
