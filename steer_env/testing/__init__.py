"""Tests that a part of one's own has to pass, so far for friction laws: ``check_friction_law("my_law")``.

They draw histories with hypothesis, which is no dependency of the package: ``pip install hypothesis``.
"""

import importlib.util

if importlib.util.find_spec("hypothesis") is None:
    raise ImportError(
        "steer_env.testing draws its cases with hypothesis, which is not installed: pip install hypothesis"
    )
if not __debug__:
    raise ImportError("steer_env.testing consists of assertions, which python -O leaves out: run Python without -O")

from steer_env.testing.friction_law import CHECKS, check_friction_law
from steer_env.testing.plain_python import check_plain_python

__all__ = ["CHECKS", "check_friction_law", "check_plain_python"]
