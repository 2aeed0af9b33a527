"""Parameters whose arrays differ only in how they came about share the machine code."""

import pickle
from typing import NamedTuple

import numba
import numpy as np
import pytest

from steer_env import friction
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import COMPILED
from steer_env.vehicle import cars
from steer_env.vehicle.steering.eps import without_assist


class Pair(NamedTuple):
    a: np.ndarray
    b: float


def test_arrays_are_contiguous_and_read_only_and_the_given_ones_stay_as_they_are():
    grid = np.arange(12.0).reshape(3, 4)
    found = frozen(Pair(grid.T, 1.0))
    np.testing.assert_array_equal(found.a, grid.T)
    assert found.a.flags.c_contiguous
    assert not found.a.flags.writeable
    assert grid.flags.writeable
    assert frozen(found) is found
    assert np.shares_memory(frozen(grid), grid)
    assert frozen("lugre") == "lugre"


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
def test_plants_of_one_kind_have_one_signature(chassis):
    """A Masing set that was pickled, as to a worker, and an assist that is switched off."""
    law = friction.make("masing")
    fresh = cars.load().plant(law, chassis=chassis)
    pickled = cars.load().plant(pickle.loads(pickle.dumps(law)), chassis=chassis)
    unassisted = fresh._replace(assist=without_assist(fresh.assist))
    assert numba.typeof(fresh) == numba.typeof(pickled) == numba.typeof(unassisted)
