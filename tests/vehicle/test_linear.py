"""The linear single track: closed forms of the textbook, and the single track against it for small inputs."""

import math

import numpy as np
import pytest

from steer_env.vehicle import cars
from steer_env.vehicle.analysis import linear
from tests.vehicle.test_single_track import linearised

CAR = cars.load()
C = CAR.chassis
L = C["front_axle"] + C["rear_axle"]
KPH = 1.0 / 3.6
STEER = CAR.steering["pinion_radius"] * float(CAR.strut.solve(0.0, 0.0).per_rack.rotation[..., 2])


def test_textbook_model():
    """Without aligning torque, compliance and roll K is m (b/C_f - a/C_r)/L, and the eigenvalues are Pacejka's."""
    v = 30.0
    model = linear.from_car(CAR, v, aligning=False, compliance=False, roll=False)._replace(
        steer_force=0.0, steer_moment=0.0
    )
    m, a, b, C_f, C_r, I_z = *model[1:2], *model[3:7], model.yaw_inertia
    assert model.understeer_gradient() == pytest.approx(m * (b / C_f - a / C_r) / L, rel=1e-12)
    damping = (I_z * (C_f + C_r) + m * (a * a * C_f + b * b * C_r)) / (m * v * I_z)
    stiffness = (C_f * C_r * L * L - m * v * v * (a * C_f - b * C_r)) / (m * v * v * I_z)
    np.testing.assert_allclose(np.poly(model.state_space().poles()), [1.0, damping, stiffness], rtol=1e-9)


def test_handwheel_input_and_unknown_input():
    model = linear.from_car(CAR, 20.0)
    ratio = model.state_space("handwheel").dcgain() / model.state_space().dcgain()
    np.testing.assert_allclose(ratio, STEER, rtol=1e-6)
    with pytest.raises(ValueError, match="'road_wheel' or 'handwheel', got 'rack'"):
        model.state_space("rack")
    with pytest.raises(ValueError, match="speed"):
        linear.from_car(CAR, 0.0)


@pytest.mark.parametrize("v", [10.0, 100.0 * KPH, 50.0])
def test_single_track_agrees(v):
    """Gains agree to 1e-3 when steady and to 1 % below 0.2 Hz; above, roll and relaxation matter."""
    model = linear.from_car(CAR, v).state_space()
    full = linearised(CAR.plant(speed=v))  # per rack travel
    per_rack = STEER / CAR.steering["pinion_radius"]
    np.testing.assert_allclose(full.dcgain()[:2, 0] / per_rack, model.dcgain()[1:, 0], rtol=1e-3)
    for hertz, within in ((0.05, 0.002), (0.2, 0.02)):
        s = 2j * math.pi * hertz
        np.testing.assert_allclose(np.abs(full(s)[:2, 0] / per_rack / model(s)[1:, 0]), 1.0, atol=within)
