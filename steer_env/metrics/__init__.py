"""Steering metrics: one file for each test; every metric has a definition, a source, a validity and an interval.

``tests()`` lists the tests; ``evaluate(recording)`` evaluates the manoeuvre that the recording's meta names. A test's
module is imported when the test is first used. Code outside this folder adds a test with ``register_evaluation``, and a
metric with ``metric``.
"""

import lazy_loader

from steer_env.friction.numerics.renamed import renamed

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__getattr__ = renamed(
    __name__,
    {
        "Procedure": "steer_env.metrics:ManoeuvreEvaluation",
        "Reading": "steer_env.metrics:FilteredChannels",
        "procedure": "steer_env.metrics:register_evaluation",
        "procedure_by_name": "steer_env.metrics:evaluation_by_name",
        "procedure_of": "steer_env.metrics:evaluation_of",
    },
    __getattr__,
)
