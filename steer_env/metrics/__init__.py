"""Steering metrics: one file for each test; every metric has a definition, a source, a validity and an interval.

``tests()`` lists the tests; ``evaluate(recording)`` evaluates the manoeuvre that the recording's meta names. A test's
module is imported when the test is first used. Code outside this folder adds a test with ``register_evaluation``, and a
metric with ``metric``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
