"""The sampled assist against closed forms, and the margins of its loop against a simulation of it."""

import cmath
import math

import numpy as np
import pytest

from steer_env import friction
from steer_env.vehicle.steering import column, eps
from steer_env.vehicle.steering.margins import boost_gain, margins

DEFAULT = eps.make()
T = eps.SAMPLE_TIME
# Motor damping of the loop figures, and a sensor that passes its torque on: command = lead(torque).
STRAIGHT = {"torques": [0.0, 1e3], "boost": [[0.0, 1e3]] * 2, "speeds": [0.0, 50.0], "damping": [0.0, 0.0]}


def command_of(a, x, *inputs):
    """The command that a sample computes; it is the first in the queue."""
    eps.sample(a, x, *inputs)
    return x[eps.QUEUE]


def motor_torque(a, requests, substeps=1):
    """Mean motor torque of every step and the torque at its end under a sequence of requests (N,)."""
    x, h = np.zeros(eps.STATE_SIZE), T / substeps
    means, ends = [], []
    for request in requests:
        before, after = eps.sample(a, x, 0.0, 0.0, 0.0, request)
        for j in range(substeps):
            means.append(eps.motor_step(a, x, x[:0], before, after, j * h, 0.0, h))
            ends.append(x[eps.MOTOR_TORQUE])
    return np.array(means), np.array(ends)


def test_boost_is_linear_between_the_grid_points_and_held_beyond():
    rng = np.random.default_rng(3)
    speeds, torques = rng.uniform(0.0, 50.0, 200), rng.uniform(0.0, 9.0, 200)
    for v, t in zip(speeds, torques):
        expected = np.interp(v, DEFAULT.speeds, [np.interp(t, DEFAULT.torques, row) for row in DEFAULT.boost])
        boost, damping = eps.boost_curve(DEFAULT, t, v)
        assert boost == pytest.approx(expected, abs=1e-12)
        assert damping == pytest.approx(np.interp(v, DEFAULT.speeds, DEFAULT.damping), abs=1e-12)


def test_lead_filter_is_the_analogue_with_prewarped_corners():
    """Each factor 1 + s/corner is bilinear with s = corner tan(omega T/2)/tan(corner T/2): exact at its corner."""
    a = eps.make(**STRAIGHT, lead_zero=15.0, lead_pole=150.0, limit=1e9)

    def response(f):
        x, omega = np.zeros(eps.STATE_SIZE), 2.0 * math.pi * f
        n = np.arange(4000)
        y = np.array([command_of(a, x, u, 0.0, 0.0, 0.0) for u in np.cos(omega * T * n)])[2000:]
        basis = np.column_stack([np.cos(omega * T * n), np.sin(omega * T * n)])[2000:]
        real, imaginary = np.linalg.lstsq(basis, y, rcond=None)[0]
        return real - 1j * imaginary

    def factor(f, corner):
        return 1.0 + 1j * math.tan(math.pi * f * T) / math.tan(math.pi * corner * T)

    for f in (1.0, 15.0, 40.0, 150.0, 400.0):
        assert response(f) == pytest.approx(factor(f, 15.0) / factor(f, 150.0), abs=1e-9)
    for f in (5.0, 15.0, 40.0):  # where the loop crosses over, the warping of the other corner is small
        analogue = (1.0 + 1j * f / 15.0) / (1.0 + 1j * f / 150.0)
        assert abs(response(f)) == pytest.approx(abs(analogue), rel=0.02)
        assert cmath.phase(response(f)) == pytest.approx(cmath.phase(analogue), abs=math.radians(1.5))


@pytest.mark.parametrize("delay", [0.0, 0.3e-3, 0.5e-3, 1e-3, 2.3e-3, 4e-3])
@pytest.mark.parametrize("substeps", [1, 10])
def test_delay_hold_and_lag_are_exact(delay, substeps):
    """A request of one sample gives a pulse of one sample, ``delay`` later, through the lag of the motor."""
    a = eps.make(delay=delay)
    requests = np.zeros(12)
    requests[2] = 5.0
    means, ends = motor_torque(a, requests, substeps)
    h = T / substeps
    edges = h * np.arange(means.size + 1)

    def lag(t):
        """Response to a unit step at 0."""
        return -np.expm1(-a.bandwidth * np.maximum(t, 0.0))

    def impulse(t):
        t = np.maximum(t, 0.0)
        return t + np.expm1(-a.bandwidth * t) / a.bandwidth

    on, off = edges - (2.0 * T + delay), edges - (3.0 * T + delay)
    np.testing.assert_allclose(ends, 5.0 * (lag(on) - lag(off))[1:], atol=1e-12)
    np.testing.assert_allclose(means, 5.0 * np.diff(impulse(on) - impulse(off)) / h, atol=1e-10)
    quiet = edges[1:] <= 2.0 * T + delay - 1e-12
    assert not ends[quiet].any()


def test_command_is_boost_through_lead_less_damping_plus_request():
    a = eps.make(lead_zero=20.0, lead_pole=20.0)  # equal corners: no lead
    x = np.zeros(eps.STATE_SIZE)
    assert command_of(a, x, 2.0, 0.4, 100.0 / 3.6, -0.7) == pytest.approx(2.2 - 0.4 * 1.0 - 0.7, abs=1e-12)
    assert command_of(a, x, -2.0, -0.4, 100.0 / 3.6, 0.7) == pytest.approx(-(2.2 - 0.4 - 0.7), abs=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_motor_limit(side):
    a = eps.make(limit=3.0)
    assert command_of(a, np.zeros(eps.STATE_SIZE), side * 7.0, 0.0, 0.0, 0.0) == side * 3.0
    _, ends = motor_torque(a, np.full(60, side * 1e3))
    assert np.abs(ends).max() <= 3.0
    assert ends[-1] == pytest.approx(side * 3.0, abs=1e-12)


LOOP = column.make(K_tb=143.0, I2=0.06, C2=0.8, C_tb=0.0)


def test_boost_gain_is_the_slope():
    assert boost_gain(DEFAULT, 2.5, 0.0) == pytest.approx(10.0, rel=1e-6)
    assert boost_gain(DEFAULT, -2.5, 100.0 / 3.6) == pytest.approx(2.8, rel=1e-6)
    assert boost_gain(DEFAULT, 0.0, 0.0) == pytest.approx(0.8, rel=1e-6)


@pytest.mark.parametrize("offset", [0.0, 0.5e-3, 1.7e-3])
def test_margins_hold_for_the_kernels(offset):
    """The sampled controller and the column with the kernels of the plant, at the gain margin."""
    a = eps.make(delay=offset, damping=[3.0] * 6)
    m = margins(LOOP, a, 1.0, 0.0)

    def grows(gain):
        b = eps.make(
            delay=offset, speeds=[0, 1], torques=[0, 1e6], boost=[[0, 1e6 * gain]] * 2, damping=[3, 3], limit=1e9
        )
        p, substeps = friction.make("viscous", sigma_2=0.0), 20
        x, q, size = np.zeros(eps.STATE_SIZE), np.array([0.0, 0.0, 1e-3, 0.0]), []
        for _ in range(400):
            before, after = eps.sample(b, x, -LOOP.K_tb * q[2], q[3], 0.0, 0.0)
            for j in range(substeps):
                motor = eps.motor_step(b, x, x[:0], before, after, j * T / substeps, 0.0, T / substeps)
                column.step_angle(LOOP, p, 1.0, q, np.zeros(0), 0.0, 0.0, motor, T / substeps)
            size.append(abs(q[2]))
        return max(size[300:]) > max(size[150:250])

    assert not grows(0.97 * m.gain)
    assert grows(1.03 * m.gain)


def test_no_boost_has_infinite_margins():
    m = margins(column.make(), DEFAULT, 0.0, 0.0)
    assert m.stable
    assert m.phase == m.gain == math.inf


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"speeds": [0.0, 0.0, 1.0]}, "speeds"),
        ({"torques": [0.5, 1.0]}, "torques"),
        ({"boost": [[0.0, 1.0]]}, "boost"),
        ({"boost": -np.array(eps.make().boost)}, "boost"),
        ({"damping": [1.0]}, "damping"),
        ({"lead_pole": 451.0}, "lead_pole"),
        ({"delay": 5e-3}, "delay"),
    ],
)
def test_bad_parameter(keys, message):
    with pytest.raises(ValueError, match=rf"^{message}\b.*got"):
        eps.make(**keys)
