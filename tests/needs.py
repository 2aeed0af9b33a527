"""What a test needs beside the core: a package of an extra, without which it is skipped and says so."""

from importlib.util import find_spec

import pytest


def needs(*packages: str) -> pytest.MarkDecorator:
    """A mark for a test, or a module of tests, that uses packages which it does not import itself."""
    missing = [package for package in packages if find_spec(package) is None]
    return pytest.mark.skipif(bool(missing), reason=f"needs {', '.join(missing)}")
