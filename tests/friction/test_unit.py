"""A law as a unit: equal to direct calls, bound anew in every process, and refused where its functions are wrong."""

import copy
import importlib
import math
import pickle
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import NamedTuple

import gymnasium as gym
import numpy as np
import pytest
from numba.core.errors import TypingError
from numpy.typing import NDArray

from steer_env import friction
from steer_env.friction import law, sites
from steer_env.friction.numerics.kernel import COMPILED, kernel
from steer_env.friction.response import follow
from steer_env.registration import id_of
from steer_env.vehicle import cars, plant
from steer_env.vehicle.steering import column


def seen(env, steps=20):
    """What an environment shows in some steps."""
    return np.array([env.step(np.array([0.3 * math.sin(i)], np.float32))[0] for i in range(steps)])


@pytest.mark.parametrize("chassis", ["single_track", pytest.param("two_track", marks=pytest.mark.whole)])
def test_an_own_law_of_two_states_is_driven_here_and_in_another_process(chassis):
    """The pickled environment goes on there to the bit, and rows of a vector are the single one."""
    with law.LAWS.restored():
        importlib.import_module("tests.friction.toy_equations")
        driven(chassis)
        del sys.modules["tests.friction.toy_equations"]


def driven(chassis):
    env = gym.make(id_of("AssistWeave"), friction="toy_jenkins_dahl", chassis=chassis)
    env.reset(seed=1)
    many = gym.make_vec(id_of("AssistWeave"), num_envs=3, friction="toy_jenkins_dahl", chassis=chassis)
    many.reset(seed=1)
    sent, expected = pickle.dumps(env), seen(env)
    rows = [many.step(np.full((3, 1), 0.3 * math.sin(i), np.float32))[0][0] for i in range(20)]
    np.testing.assert_array_equal(rows, expected)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        np.testing.assert_array_equal(pool.submit(seen_there, sent).result(), expected)


def seen_there(sent):
    """As :func:`seen`, of a pickled environment."""
    importlib.import_module("tests.friction.toy_equations")
    return seen(pickle.loads(sent))


@pytest.mark.parametrize("name", friction.available())
def test_calls_by_address_are_direct_ones_to_the_bit(name):
    """Along a displacement, with another level to each side."""
    p, rng = friction.make(name), np.random.default_rng(3)
    x, levels = np.cumsum(rng.normal(0.0, 2e-3, 300)), rng.uniform(0.5, 1.5, (300, 2))
    found, expected = np.zeros(300), np.zeros(300)
    follow(p, levels, np.zeros(law.law_of(p).memory_size(p)), x, 1e-3, found)
    getattr(follow, "kernel", follow)(p, levels, np.zeros(law.law_of(p).memory_size(p)), x, 1e-3, expected)
    np.testing.assert_array_equal(found, expected)


class Chain(NamedTuple):
    n: int  # floats that it remembers
    k: NDArray[np.int64]  # (2,) stiffnesses


@kernel
def chain_torque(p, torque_scale, memory, w):
    return p.k[0] * memory[0] + p.k[1] * memory[p.n - 1]


@kernel
def chain_advance(p, torque_scale, memory, w, h):
    for i in range(p.n):
        memory[i] += w * h / (1.0 + i)


@kernel
def chain_solve(p, torque_scale, memory, S, R, h, w_guess):
    return R / S


@kernel
def chain_rate(p, torque_scale, memory, w, out):
    out[0] = w


@kernel
def chain_energy(p, memory):
    return 0.0


@pytest.fixture
def chain():
    """A law whose memory is as long as a parameter says, with whole numbers, and without a mean torque."""
    with law.LAWS.restored():
        functions = {
            "torque": chain_torque,
            "advance": chain_advance,
            "rate": chain_rate,
            "stored_energy": chain_energy,
        }
        given = {**functions, "solve": chain_solve, "memory_size": lambda p: p.n}
        law.register("chain", Chain, make=lambda *, n=2: Chain(n, np.array([10, 30])), **given)
        yield lambda n: friction.make("chain", n=n)


def test_laws_of_one_class_that_remember_more_or_less_are_told_apart(chain):
    x = 1e-3 * np.arange(5.0)
    for n in (2, 5, 2):
        np.testing.assert_allclose(friction.response(chain(n), x, 1e-3), (10.0 + 30.0 / n) * x, rtol=1e-12)


@pytest.mark.skipif(not COMPILED, reason="nothing is called by address")
def test_a_function_that_a_law_does_not_have_is_told(chain):
    with pytest.raises(NotImplementedError, match="the law has no such function"):
        law.mean_torque(sites.bound(chain(2)), 1.0, np.zeros(2), 1.0, 1e-3)


@pytest.mark.skipif(not COMPILED, reason="nothing is called by address")
@pytest.mark.parametrize("memory", [np.zeros((4, 2))[:, 1], np.zeros(1, np.float32)], ids=["strided", "float32"])
def test_a_memory_of_another_kind_is_refused(memory):
    with pytest.raises(TypingError, match="a unit takes contiguous arrays of float64"):
        column.step_torque(column.make(), friction.make("lugre"), 1.0, np.zeros(4), memory, 1.0, 0.0, 1e-3)


@pytest.mark.skipif(not COMPILED, reason="nothing is called by address")
def test_what_holds_addresses_stays_in_its_process():
    bound = plant.bound(cars.load().plant("masing@column_eps", 20.0))
    for act in (pickle.dumps, copy.deepcopy):
        with pytest.raises(TypeError, match="holds addresses of this process: bind its parameters anew"):
            act(bound)
    with pytest.raises(ValueError, match="bound for another use"):
        plant.bound(bound, wide=True)


class Spring(NamedTuple):
    k: float


def spring(**given):
    """Register a spring of which some functions are replaced."""
    functions = {
        "make": lambda k=1.0: Spring(k),
        "torque": lambda p, L, memory, w: p.k * memory[0],
        "advance": lambda p, L, memory, w, h: memory.__setitem__(0, memory[0] + w * h),
        "rate": lambda p, L, memory, w, out: out.__setitem__(0, w),
        "stored_energy": lambda p, memory: 0.5 * p.k * memory[0] ** 2,
        "mean_torque": lambda p, L, memory, w, h: (p.k * (memory[0] + 0.5 * w * h), 0.5 * p.k * h),
    }
    law.register("spring", Spring, memory_size=lambda p: 1, **functions | given)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"torque": lambda p, memory, w: 0.0}, r"torque\(p, torque_scale, memory, w\) raises .*positional arguments"),
        ({"torque": lambda p, L, memory, w: {}[w]}, "raises at w = 0: KeyError"),
        ({"torque": lambda p, L, memory, w: math.nan if w < 0.0 else 0.0}, "is not finite at w = -0.01: nan"),
        ({"advance": lambda p, L, memory, w, h: memory.__setitem__(1, w)}, r"advance\(.* raises .*IndexError"),
        ({"rate": lambda p, L, memory, w, out: out.base.__setitem__((1, 0), w)}, "beyond the 1 floats of memory_size"),
        ({"mean_torque": lambda p, L, memory, w, h: 0.0}, r"mean_torque\(.* must return 2 numbers, got 0.0"),
        ({"make": lambda k: Spring(k)}, "make takes keywords, all with defaults"),
    ],
)
def test_a_law_of_wrong_functions_is_refused_by_name_and_reason(given, message):
    with law.LAWS.restored(), pytest.raises(ValueError, match=f"^friction law 'spring': .*{message}"):
        spring(**given)
    assert "spring" not in friction.available()


@kernel
def _fails(p, torque_scale, memory, w):
    if abs(w) > 5.0:
        raise ValueError("too fast for this law")
    return p.k * w


@kernel
def _fails_in_the_mean(p, torque_scale, memory, w, h):
    return _fails(p, torque_scale, memory, w), p.k


def test_a_law_that_raises_is_told():
    """Not as a torque of zero: the exception of the function behind the address reaches the caller."""
    with law.LAWS.restored():
        law.register("fails", Spring, make=lambda *, k=0.1: Spring(k), torque=_fails, mean_torque=_fails_in_the_mean)
        p = cars.load().plant({"rack": "fails"}, 20.0)
        inputs = np.zeros((500, len(plant.INPUTS)))
        inputs[:, plant.HAND] = 20.0
        with pytest.raises(ValueError, match="too fast for this law"):
            plant.run(p, plant.initial_state(p), inputs, np.zeros((1, len(plant.channels(p)))), 1)
        assert sites.bound(p.friction).numbers.size > 0
