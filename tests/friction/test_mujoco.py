"""Friction in the joints of a MuJoCo model; tests/test_examples.py has the creep under load."""

import math

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from steer_env import friction
from steer_env.friction import law

H, INERTIA = 1e-3, 0.01  # [s], [kg m²]
LUGRE = "lugre,F_c=1,sigma_0=1000,sigma_1=2"
LAWS = ("coulomb,F_c=1", LUGRE, "masing,F_c=1,x_c=0.002,sigma_1=1")
ROTOR = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
# Two rotors on one axis, the second carried by the first: an inertia matrix that is coupled and constant.
ROTORS = f"""<body><joint name="a" axis="0 0 1" damping="{{damping}}"/>{ROTOR}
<body><joint name="b" axis="0 0 1"/>{ROTOR}</body></body>"""
ARM = """<body><joint name="a" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0" mass="1"/>
<body pos=".3 0 0"><joint name="b" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0" mass="1"/>
</body></body>"""


def rotor(joint=""):
    return f'<body><joint name="a" axis="0 0 1" {joint}/>{ROTOR}</body>'


def made(bodies, laws, option="", more=""):
    """Model, data and friction; without gravity unless the option has it."""
    option = option or 'gravity="0 0 0"'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{H}" {option}/><worldbody>{bodies}</worldbody>{more}</mujoco>'
    )
    return model, mujoco.MjData(model), friction.JointFriction(model, laws)


def test_coulomb_breaks_away_at_its_level():
    """Below F_c nothing moves; above, the excess accelerates the inertia."""
    _, data, joints = made(rotor(), {"a": "coulomb,F_c=1"})
    for load, speed in ((0.999, 0.0), (-0.999, 0.0), (1.001, 100 * H * 0.001 / INERTIA)):
        data.qfrc_applied[0] = load
        for _ in range(100):
            joints.step(data)
        assert data.qvel[0] == pytest.approx(speed, abs=1e-12)
        assert joints.torque["a"] == pytest.approx(math.copysign(min(abs(load), 1.0), load), abs=1e-12)
        assert data.qfrc_applied[0] == load


@pytest.mark.parametrize("before", [0, 5])
def test_a_reset_by_mujoco_is_told(before):
    """Of its data alone, so that the law would keep the motion of before."""
    _, data, joints = made(rotor(), {"a": LUGRE})
    for _ in range(before):
        joints.step(data)
    data.qfrc_applied[0] = 1e300
    with pytest.raises(RuntimeError, match="MuJoCo has reset its data"):
        joints.step(data)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
def test_one_joint_is_the_step_equation(integrator):
    """(I + h d)/h w + T = I v/h + u."""
    option = f'gravity="0 0 0" integrator="{integrator}"'
    _, data, joints = made(rotor('damping="0.3" armature="0.02"'), {"a": LUGRE}, option)
    p, memory, v, x, inertia = friction.resolve(LUGRE), np.zeros(1), 0.0, 0.0, INERTIA + 0.02
    for i in range(300):
        u = 1.5 * math.sin(0.03 * i)
        data.qfrc_applied[0] = u
        joints.step(data)
        v, _ = law.step(p, 1.0, memory, inertia / H + 0.3, inertia * v / H + u, H, v)
        x += H * v
        assert data.qpos[0] == pytest.approx(x, abs=1e-12)


def test_the_error_against_an_adaptive_solver_is_of_the_first_order():
    p = friction.make("lugre", F_c=1.0, sigma_0=1000.0, sigma_1=2.0)
    kernels, slope = friction.law_of(p), np.zeros(1)

    def derivative(t, y):
        kernels.rate(p, 1.0, y[2:], y[1], slope)
        return [y[1], (1.5 * math.sin(30.0 * t) - kernels.torque(p, 1.0, y[2:], y[1])) / INERTIA, slope[0]]

    exact = solve_ivp(derivative, (0.0, 0.2), np.zeros(3), "LSODA", rtol=1e-9, atol=1e-12).y[0, -1]
    errors = []
    for h in (H, H / 2.0):
        model, data, joints = made(rotor(), {"a": p})
        model.opt.timestep = h
        for _ in range(round(0.2 / h)):
            data.qfrc_applied[0] = 1.5 * math.sin(30.0 * (data.time + 0.5 * h))
            joints.step(data)
        errors.append(abs(data.qpos[0] - exact))
    assert errors[0] < 0.1 * abs(exact)
    assert 1.7 < errors[0] / errors[1] < 2.3


@pytest.mark.parametrize("text", LAWS)
def test_free_motion_gains_no_energy(text):
    """Kinetic energy and what the laws store, of two coupled rotors, never grow, and the rotors slow down to rest."""
    _, data, joints = made(ROTORS.format(damping=0), {"a": text, "b": text})
    inertia = INERTIA * np.array([[2.0, 1.0], [1.0, 1.0]])
    data.qvel[:] = 8.0, -15.0
    last = math.inf
    for _ in range(250):
        joints.step(data)
        stored = sum(law.stored_energy(p, memory) for p, memory in zip(joints.laws.values(), joints._memories))
        energy = 0.5 * data.qvel @ inertia @ data.qvel + stored
        assert energy <= last + 1e-13
        last = energy
    assert np.abs(data.qvel).max() < 1e-2


def test_an_arm_holds_its_weight():
    """Gravity takes 5.9 N m at the first joint and 1.5 N m at the second."""
    _, data, joints = made(ARM, {"a": "coulomb,F_c=6", "b": "coulomb,F_c=1.6"}, 'gravity="0 0 -9.81"')
    for _ in range(300):
        joints.step(data)
    assert np.abs(data.qpos).max() < 1e-12
    assert joints.torque["a"] == pytest.approx(9.81 * (0.15 + 0.45), rel=1e-9)
    assert joints.torque["b"] == pytest.approx(9.81 * 0.15, rel=1e-9)


def test_one_joint_slides_while_the_other_holds():
    _, data, joints = made(ROTORS.format(damping=0.2), {"b": "coulomb,F_c=1", "a": "coulomb,F_c=1"})
    data.qfrc_applied[:] = 1.4, 0.1
    for _ in range(100):
        joints.step(data)
    assert data.qvel[0] > 0.1
    assert abs(data.qvel[1]) < 1e-11
    assert joints.torque["a"] == pytest.approx(1.0, abs=1e-12)
    assert abs(joints.torque["b"]) < 1.0


def test_what_a_constraint_couples_comes_to_hold():
    """The load acts on a rotor without friction, which an equality couples to one with friction."""
    bodies = rotor() + rotor().replace('"a"', '"b"')
    couple = '<equality><joint joint1="a" joint2="b"/></equality>'
    _, data, joints = made(bodies, {"a": "coulomb,F_c=1"}, more=couple)
    data.qfrc_applied[1] = 0.3
    for _ in range(200):
        joints.step(data)
    assert abs(data.qvel[0]) < 1e-9
    assert abs(data.qvel[1]) < 1e-4  # the equality is a damped spring, which settles
    assert joints.torque["a"] == pytest.approx(0.3, rel=1e-2)


def test_reset_forgets():
    model, data, joints = made(rotor(), {"a": LUGRE})
    runs = []
    for _ in range(2):
        data.qvel[0] = 1.0
        for _ in range(20):
            joints.step(data)
        runs.append(data.qpos[0])
        mujoco.mj_resetData(model, data)
        joints.reset()
    assert runs[0] == runs[1]
    assert joints.torque == {"a": 0.0}


@pytest.mark.parametrize(
    ("bodies", "laws", "option", "message"),
    [
        (rotor(), {}, "", "at least one joint, got none"),
        (rotor(), {"elbow": "lugre"}, "", r"hinge or slide joint of the model \(a\), got 'elbow'"),
        (rotor(), {"a": "lugre,F_c=-1"}, "", "joint 'a': F_c must be finite and greater than 0, got -1"),
        (rotor(), {"a": "glue"}, "", "joint 'a': .*'glue'"),
        (rotor('frictionloss="0.5"'), {"a": "lugre"}, "", "frictionloss of joint 'a' must be 0 .*, got 0.5"),
        (rotor(), {"a": "lugre"}, 'integrator="RK4"', "must be Euler, implicit or implicitfast, got mjINT_RK4"),
    ],
)
def test_what_cannot_be_is_refused(bodies, laws, option, message):
    with pytest.raises(ValueError, match=message):
        made(bodies, laws, option)


def test_a_step_too_long_for_a_stribeck_curve_is_refused():
    _, data, joints = made(rotor(), {"a": "stribeck,F_c=1,F_s=3,v_s=0.01"})
    with pytest.raises(ValueError, match=r"timestep 0\.001 s is too long for the law of joint 'a'"):
        joints.step(data)
