"""The kernels of column and single-track chassis, of four cars side by side: each has the bits that it has alone."""

import numpy as np
import pytest

from steer_env.friction import sites
from steer_env.friction.level import Level
from steer_env.friction.numerics import packing, scratch
from steer_env.friction.numerics.kernel import COMPILED, kernel
from steer_env.friction.numerics.packing import of_row, of_rows
from steer_env.friction.numerics.simd import apart, beside, pack, place
from steer_env.vehicle import cars, chassis
from steer_env.vehicle.chassis.common.interface import INPUTS
from steer_env.vehicle.chassis.single_track import STATES
from steer_env.vehicle.steering import column

pytestmark = pytest.mark.skipif(not COMPILED, reason="cars run side by side in compiled code alone")

H = 1e-3
N = len(STATES)
OUT, U = 2 * N, 2 * N + 9  # places behind the states and their derivative
COLUMN, CHASSIS = (
    5,
    U + len(INPUTS) + 1,
)  # sizes of a row: states and memory; states, rates, outputs, inputs, rack force


@kernel
def steer(p, s, u):
    """Steps under the hand torques, rack forces and column torques of ``u`` (T, 4)."""
    for j in range(u.shape[0]):
        scales = sites.scales(p.friction, p.level, p.friction_torque_scale, u[j, 1], s[2], 0.0)
        column.step(p.column, p.friction, scales, s[0:4], s[4:5], False, u[j, 0], 0.0, u[j, 2], H)


@kernel
def steer_alone(template, rows, states, u, n):
    for i in range(n):
        steer(of_row(template, rows, i), states[i], u[i])


@kernel
def steer_fours(template, rows, states, u, n):
    s, given = scratch.fours(1, states.shape[1]), scratch.fours(u.shape[1], u.shape[2])
    for i in range(0, n, 4):
        four = place(pack(0.0, 1.0, 2.0, 3.0)) + i
        beside(states, states.shape[1], four, s)
        beside(u, u.shape[1] * u.shape[2], four, given)
        steer(of_rows(template, rows, four), s[0], given)
        apart(s, states.shape[1], four, states)


@kernel
def roll(p, s, u):
    """Euler steps of the chassis at the rack coordinates of ``u`` (T, 4)."""
    for j in range(u.shape[0]):
        x, dx = s[0:N], s[N:OUT]
        s[CHASSIS - 1] = chassis.derivative(
            p.chassis, p.strut, p.tyre[0], x, 0.01 * u[j, 0], 0.0, s[U : CHASSIS - 1], dx, s[OUT:U]
        )
        for k in range(N):
            x[k] += 2.0 * H * dx[k]


@kernel
def roll_alone(template, rows, states, u, n):
    for i in range(n):
        roll(of_row(template, rows, i), states[i], u[i])


@kernel
def roll_fours(template, rows, states, u, n):
    s, given = scratch.fours(1, states.shape[1]), scratch.fours(u.shape[1], u.shape[2])
    for i in range(0, n, 4):
        four = place(pack(0.0, 1.0, 2.0, 3.0)) + i
        beside(states, states.shape[1], four, s)
        beside(u, u.shape[1] * u.shape[2], four, given)
        roll(of_rows(template, rows, four), s[0], given)
        apart(s, states.shape[1], four, states)


@pytest.mark.parametrize("law", ["lugre"])
@pytest.mark.parametrize(
    ("alone", "fours", "size"), [(steer_alone, steer_fours, COLUMN), (roll_alone, roll_fours, CHASSIS)]
)
def test_four_cars_have_the_bits_of_each_alone(alone, fours, size, law):
    """Cars of other friction, mass and speed; one has an asymmetric level, one a Stribeck curve, one becomes NaN."""
    rng, n = np.random.default_rng(0), 16
    p = cars.load("compact").plant(law, speed=27.0)
    plants = []
    for i in range(n):
        F_c = 1.0 + 0.5 * rng.random()
        friction = p.friction._replace(F_c=F_c, F_s=1.6 if i == 9 else F_c)
        m, v_x = p.chassis.m * (1.0 + 0.1 * rng.random()), 20.0 + 10.0 * rng.random()
        level = Level(asymmetry=0.2, load=1e-4) if i == 5 else p.level
        plants.append(p._replace(friction=friction, chassis=p.chassis._replace(m=m, v_x=v_x), level=level))
    rows, template = np.array([packing.numbers(each) for each in plants]), packing.outline(p)
    one, four = np.zeros((2, n, size))
    for k in range(60):
        u = rng.uniform(-1.0, 1.0, (n, 10, 4))
        if size == COLUMN:
            u *= [5.0, 1e3, 5.0, 0.0]
        if k == 40:
            u[13, 3] = np.nan
        alone(template, rows, one, u, n)
        fours(template, rows, four, u, n)
        np.testing.assert_array_equal(four, one)
    assert np.isfinite(np.delete(one, 13, axis=0)).all()
