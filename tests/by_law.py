"""The laws that expensive tests run over: a few in every run, the others in the whole suite.

The contracts of ``steer_env.testing`` hold every law to the same in every run; what a car makes of a law takes longer,
because each law and chassis is compiled by itself.
"""

import pytest

from steer_env import friction

FEW = ("coulomb", "dahl", "lugre", "masing", "viscous")
OTHERS = tuple(law for law in friction.available() if law not in FEW)
EACH_LAW = [*FEW, *(pytest.param(law, marks=pytest.mark.whole) for law in OTHERS)]
EACH_PAIR = [
    *((one, other) for one in FEW for other in FEW),
    *(pytest.param(*pair, marks=pytest.mark.whole) for law in OTHERS for pair in (("lugre", law), (law, "lugre"))),
]
