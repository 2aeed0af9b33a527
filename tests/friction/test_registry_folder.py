"""What a registry keeps at the end of a test's registrations."""

import sys

from steer_env import friction
from steer_env.friction import law


def test_a_law_of_the_folder_that_a_test_imports_first_stays_known():
    module = "steer_env.friction.models.masing"
    with law.LAWS.restored():
        friction.make("masing")
        law.LAWS.register("from a test", object())
    assert module in sys.modules
    assert friction.make("masing").k.size == 10
    assert "from a test" not in friction.available()
