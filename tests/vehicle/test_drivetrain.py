"""Torque and power balances of the drivetrain, its shifts, the step of a braked wheel, and the resulting car."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steer_env.friction.numerics.kernel import COMPILED
from steer_env.vehicle.chassis.two_track import brakes, drivetrain, speed_hold
from steer_env.vehicle.chassis.two_track.drivetrain import RPM

D, B, S = drivetrain.make(), brakes.make(), speed_hold.make()
GEARS = range(1, D.ratios.size + 1)
MASS, RADIUS, DRAG_AREA, ROLLING = 1226.0, 0.298, 0.7, 0.012
WHEELS = 4.0  # moment of inertia of all wheels together [kg m2]
KPH = 1.0 / 3.6
spins = st.floats(-200.0, 200.0)
torques = st.floats(-3000.0, 3000.0)
capacities = st.floats(0.0, 3000.0)


def resistance(v, force=0.0):
    return 0.5 * 1.2 * DRAG_AREA * v**2 + ROLLING * MASS * 9.81 + force


def drive(d, pedals_of, v=0.0, gear=1.0, force=0.0, duration=30.0, h=0.005):
    """Point mass without slip, pedals from ``pedals_of(v, gear, engaged, h)``: speed, gear and throttle, (N,) each."""
    left, throttle, rows = 0.0, 0.0, []
    for _ in range(round(duration / h)):
        spin = v / RADIUS
        gear, left = drivetrain.shift(d, gear, left, throttle, spin, spin, h)
        throttle, pedal = pedals_of(v, gear, left == 0.0, h)
        torque = sum(drivetrain.axle_torques(d, gear, left == 0.0, throttle, spin, spin))
        brake = 2.0 * sum(brakes.brake_torques(B, pedal, 0.0))
        inertia = WHEELS + drivetrain.reflected_inertia(d, gear, left == 0.0, spin, spin)
        total = (torque - brake) / RADIUS - resistance(v, force)
        v = max(v + h * total / (MASS + inertia / RADIUS**2), 0.0)
        rows.append((v, gear, throttle))
    return np.array(rows).T


def driver(target, integral=0.0):
    """The speed hold in the form that ``drive`` takes, with the integral at the start."""

    def pedals(v, gear, engaged, h):
        nonlocal integral
        demand, rate = speed_hold.longitudinal_demand(S, v, target, integral)
        integral += h * rate
        mass, spin = MASS + WHEELS / RADIUS**2, v / RADIUS
        return speed_hold.pedals(D, B, gear, engaged, demand, mass, RADIUS, spin, spin)

    return pedals


# Engine, gearbox, axles


def test_engine_equals_its_curves_and_holds_their_ends():
    for omega in np.linspace(0.0, 1.2 * D.speeds[-1], 301):
        full, drag = np.interp(omega, D.speeds, D.full_load), np.interp(omega, D.speeds, D.drag)
        for throttle in (0.0, 0.3, 1.0):
            expected = throttle * full - (1.0 - throttle) * drag
            assert drivetrain.engine_torque(D, omega, throttle) == pytest.approx(expected, abs=1e-12)


def test_defaults_are_85_kilowatts_at_6000_rpm():
    power = [drivetrain.engine_torque(D, omega, 1.0) * omega for omega in D.speeds]
    assert max(power) == pytest.approx(85e3, rel=1e-3)
    assert D.speeds[np.argmax(power)] == pytest.approx(6000.0 * RPM)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("gear", GEARS)
@pytest.mark.parametrize("throttle", [0.0, 0.2, 1.0])
def test_power_passes_the_gearbox_less_its_loss(share, gear, throttle):
    d = drivetrain.make(front_share=share)
    omega_f, omega_r = 37.0, 41.0  # between idle and the limiter in every gear
    T_f, T_r = drivetrain.axle_torques(d, float(gear), True, throttle, omega_f, omega_r)
    assert T_f * (1.0 - share) == pytest.approx(T_r * share)
    omega_e = d.final_drive * d.ratios[gear - 1] * (share * omega_f + (1.0 - share) * omega_r)
    engine = drivetrain.engine_torque(d, omega_e, throttle) * omega_e
    wheels = T_f * omega_f + T_r * omega_r
    assert wheels == pytest.approx(engine * d.efficiency if engine > 0.0 else engine / d.efficiency)
    assert (wheels > 0.0) == (throttle > 0.0)


@given(
    gear=st.sampled_from(GEARS), throttle=st.floats(0.0, 1.0), omega=st.floats(-20.0, 160.0), share=st.floats(0.0, 1.0)
)
def test_throttle_for_is_the_inverse_of_the_torque(gear, throttle, omega, share):
    d = drivetrain.make(front_share=share)
    torque = sum(drivetrain.axle_torques(d, float(gear), True, throttle, omega, omega))
    assert drivetrain.throttle_for(d, float(gear), torque, omega, omega) == pytest.approx(throttle, abs=1e-12)


def test_throttle_is_held_where_the_engine_cannot():
    assert drivetrain.throttle_for(D, 3.0, 1e5, 80.0, 80.0) == 1.0
    assert drivetrain.throttle_for(D, 3.0, -1e5, 80.0, 80.0) == 0.0


def test_a_running_shift_interrupts_the_drive():
    assert drivetrain.axle_torques(D, 2.0, False, 1.0, 60.0, 60.0) == (0.0, 0.0)
    assert drivetrain.reflected_inertia(D, 2.0, False, 60.0, 60.0) == 0.0


def test_clutch_slips_below_idle_without_creep_stall_or_step():
    closes = D.speeds[0] / (D.final_drive * D.ratios[0])
    full = D.final_drive * D.ratios[0] * D.full_load[0] * D.efficiency
    for spin in (-5.0, 0.0, 0.5 * closes, closes):
        assert drivetrain.axle_torques(D, 1.0, True, 0.0, spin, spin) == (0.0, 0.0)
        assert drivetrain.axle_torques(D, 1.0, True, 0.5, spin, spin)[0] == pytest.approx(0.5 * full)
    below, above = (drivetrain.axle_torques(D, 1.0, True, 0.1, closes * (1 + e), 0.0)[0] for e in (-1e-9, 1e-9))
    assert below == pytest.approx(above, rel=1e-6)
    assert drivetrain.reflected_inertia(D, 1.0, True, 0.99 * closes, 0.0) == 0.0
    assert drivetrain.reflected_inertia(D, 1.0, True, 1.01 * closes, 0.0) == D.inertia * (D.final_drive * 3.55) ** 2


# Shifts


@given(throttle=st.floats(0.0, 1.0), spin=st.floats(0.0, 250.0), gear=st.sampled_from(GEARS))
def test_no_shift_is_followed_by_its_opposite(throttle, spin, gear):
    new, left = drivetrain.shift(D, float(gear), 0.0, throttle, spin, spin, 0.001)
    assert left == (D.shift_time if new != gear else 0.0)
    again, _ = drivetrain.shift(D, new, 0.0, throttle, spin, spin, 0.001)
    assert (again - new) * (new - gear) >= 0.0


def test_no_hunting_where_the_driver_wants_the_same_force_after_the_shift():
    for spin, torque in itertools.product(np.arange(2.0, 190.0, 4.0), np.linspace(-150.0, 2400.0, 52)):
        for gear in GEARS:
            settled, before = float(gear), 0.0
            while settled != before:
                before = settled
                throttle = drivetrain.throttle_for(D, settled, torque, spin, spin)
                settled, _ = drivetrain.shift(D, settled, 0.0, throttle, spin, spin, 0.001)
                assert (settled - before) * (before - gear) >= 0.0  # on in one direction only


def test_slowly_varying_throttle_shifts_no_more_than_it_must():
    spin, gear, gears = 60.0, 3.0, []
    for throttle in 0.5 - 0.5 * np.cos(np.linspace(0.0, 4.0 * np.pi, 4001)):
        gear, _ = drivetrain.shift(D, gear, 0.0, throttle, spin, spin, 0.001)
        gears.append(gear)
    assert np.count_nonzero(np.diff(gears)) <= 2 + 2 * 2  # up at first, then down and up once or twice a period


def test_a_shift_takes_its_time_and_ignores_inputs_meanwhile():
    gear, left = drivetrain.shift(D, 1.0, 0.0, 0.0, 100.0, 100.0, 0.01)
    assert (gear, left) == (2.0, D.shift_time)
    steps = 0
    while left > 0.0:
        gear, left = drivetrain.shift(D, gear, left, 0.0, 100.0, 100.0, 0.01)
        steps += 1
    assert gear == 2.0
    assert steps in (40, 41)  # rounding of 0.4 - 40 x 0.01


def test_gears_end_at_the_first_and_the_last():
    assert drivetrain.shift(D, 5.0, 0.0, 0.0, 1e3, 1e3, 0.001) == (5.0, 0.0)
    assert drivetrain.shift(D, 1.0, 0.0, 1.0, 0.0, 0.0, 0.001) == (1.0, 0.0)


# Brakes and wheels


def test_brake_torques():
    b = brakes.make(front=1000.0, rear=400.0, hand=300.0)
    assert brakes.brake_torques(b, 0.0, 0.0) == (0.0, 0.0)
    assert brakes.brake_torques(b, 0.5, 0.0) == (500.0, 200.0)
    assert brakes.brake_torques(b, 0.5, 1.0) == (500.0, 500.0)


@given(omega=spins, torque=torques, capacity=capacities)
def test_wheel_step_is_the_set_valued_brake(omega, torque, capacity):
    I, h = 1.1, 0.001
    new, T_b = brakes.wheel_step(I, omega, torque, capacity, h)
    small = 1e-12 * (I / h * abs(omega) + abs(torque) + capacity) + 1e-300
    assert I * (new - omega) == pytest.approx(h * (torque - T_b), abs=h * small)
    assert abs(T_b) <= capacity + small
    if new != 0.0:
        assert T_b == pytest.approx(math.copysign(capacity, new), abs=small)
    gain = 0.5 * I * (new**2 - omega**2)
    work = 0.5 * h * (torque - T_b) * (new + omega)
    assert gain == pytest.approx(work, abs=h * small * (abs(new) + abs(omega)))
    assert brakes.wheel_step(I, -omega, -torque, capacity, h) == (-new, -T_b)


def test_wheel_stops_without_ringing_stays_locked_and_breaks_loose():
    I, h, capacity, omega = 1.0, 0.001, 500.0, 10.0
    for step in range(40):
        before = omega
        omega, T_b = brakes.wheel_step(I, omega, -200.0, capacity, h)
        assert omega == pytest.approx(max(10.0 - 0.7 * (step + 1), 0.0), abs=1e-12)
        if before == 0.0:
            assert (omega, T_b) == (0.0, -200.0)
    assert brakes.wheel_step(I, 0.0, -capacity, capacity, h) == (0.0, -capacity)
    assert brakes.wheel_step(I, 0.0, 600.0, capacity, h) == (pytest.approx(0.1), pytest.approx(500.0))


def slow_axle(I, J, omega, torque, capacity, h):
    """The same inclusion by a trial of every pattern of sliding and holding wheels; the most consistent one."""
    M = (np.eye(2) * I + 0.25 * J) / h
    R = M @ omega + torque
    best = (math.inf, np.zeros(2))
    for pattern in itertools.product((-1.0, 0.0, 1.0), repeat=2):
        sign = np.array(pattern)
        slides = np.flatnonzero(sign)
        w = np.zeros(2)
        w[slides] = np.linalg.solve(M[np.ix_(slides, slides)], (R - sign * capacity)[slides])
        T_b = R - M @ w
        wrong = np.where(sign == 0.0, np.abs(T_b) - capacity, -sign * w * I / h)
        best = min(best, (max(wrong.max(), 0.0), w), key=lambda entry: entry[0])
    return best[1]


@given(
    J=st.floats(0.0, 40.0),
    omega=st.tuples(spins, spins),
    torque=st.tuples(torques, torques),
    capacity=st.tuples(capacities, capacities),
    slowness=st.sampled_from([1.0, 1e-2, 0.0]),
)
def test_axle_step_against_every_pattern(J, omega, torque, capacity, slowness):
    I, h = 1.1, 0.001
    omega, torque, capacity = slowness * np.array(omega), np.array(torque), np.array(capacity)
    step = brakes.axle_step(I, J, *omega, *torque, *capacity, h)
    new, T_b = np.array(step[:2]), np.array(step[2:])
    small = 1e-11 * ((I + J) / h * np.abs(omega).sum() + np.abs(torque).sum() + capacity.sum()) + 1e-300
    np.testing.assert_allclose(new, slow_axle(I, J, omega, torque, capacity, h), rtol=0, atol=10 * small * h / I)
    assert np.all(np.abs(T_b) <= capacity + small)
    slides = np.abs(new) * I / h > small
    np.testing.assert_allclose(T_b[slides], (np.sign(new) * capacity)[slides], rtol=0, atol=small)

    def energy(w):
        return 0.5 * I * np.sum(w**2) + 0.5 * J * (0.5 * np.sum(w)) ** 2

    work = 0.5 * h * np.sum((torque - T_b) * (omega + new))
    scale = h * small * (np.abs(omega).sum() + np.abs(new).sum())
    assert energy(new) - energy(omega) == pytest.approx(work, abs=scale + 1e-300)
    mirrored = brakes.axle_step(I, J, *omega[::-1], *torque[::-1], *capacity[::-1], h)
    assert mirrored == (step[1], step[0], step[3], step[2])
    assert brakes.axle_step(I, J, *-omega, *-torque, *capacity, h) == tuple(-value for value in step)


def test_axle_without_its_inertia_is_two_wheels():
    axle = brakes.axle_step(1.1, 0.0, 30.0, -0.1, 300.0, 50.0, 900.0, 400.0, 0.001)
    left = brakes.wheel_step(1.1, 30.0, 300.0, 900.0, 0.001)
    right = brakes.wheel_step(1.1, -0.1, 50.0, 400.0, 0.001)
    assert axle == pytest.approx((left[0], right[0], left[1], right[1]), rel=1e-13)


def test_locked_axle_stays_locked_to_the_last_bit():
    state = brakes.axle_step(1.1, 20.0, 0.0, 0.0, 500.0, -499.0, 500.0, 500.0, 0.001)
    assert state == (0.0, 0.0, 500.0, -499.0)


# The driver and the car


@pytest.mark.parametrize("start", [5.0, 15.0, 27.8, 40.0])
@pytest.mark.parametrize("step", [1.0, -1.0])
def test_speed_hold_overshoots_by_less_than_two_percent(start, step):
    gear = 1.0
    for _ in GEARS:
        gear, _ = drivetrain.shift(D, gear, 0.0, 0.2, start / RADIUS, start / RADIUS, 0.001)
    v, _, _ = drive(D, driver(start + step, resistance(start) / MASS), v=start, gear=gear, duration=40.0)
    assert np.max((v - start - step) * step) < 0.02
    assert v[-1] == pytest.approx(start + step, abs=0.01)


def test_speed_hold_does_not_wind_up():
    v, _, _ = drive(D, driver(27.8), v=3.0, duration=60.0)  # full throttle for most of it
    assert np.max(v) < 27.85
    assert v[-1] == pytest.approx(27.8, abs=0.05)
    _, rate = speed_hold.longitudinal_demand(S, 0.0, 50.0, 0.0)
    assert rate == 0.0


def test_speed_hold_meets_a_grade():
    v, _, _ = drive(
        D, driver(20.0, resistance(20.0) / MASS), v=20.0, gear=4.0, force=0.06 * MASS * 9.81, duration=120.0
    )
    assert np.min(v) > 19.0  # a shift down costs 0.4 s of drive
    assert v[-1] == pytest.approx(20.0, abs=0.01)


@pytest.mark.parametrize("engaged", [True, False])
@pytest.mark.parametrize("gear", [1.0, 3.0, 5.0])
@pytest.mark.parametrize("demand", [-5.0, -0.2, 0.0, 0.7])
def test_split_gives_what_is_demanded(demand, gear, engaged):
    spin = 40.0
    throttle, pedal = speed_hold.pedals(D, B, gear, engaged, demand, MASS, RADIUS, spin, spin)
    assert throttle == 0.0 or pedal == 0.0
    if not engaged and demand > 0.0:
        return  # a shift interrupts the drive
    torque = sum(drivetrain.axle_torques(D, gear, engaged, throttle, spin, spin))
    torque -= 2.0 * sum(brakes.brake_torques(B, pedal, 0.0))
    inertia = drivetrain.reflected_inertia(D, gear, engaged, spin, spin)
    assert torque == pytest.approx(demand * (MASS * RADIUS + inertia / RADIUS), abs=1e-9)


def test_split_stops_at_the_full_pedal():
    assert speed_hold.pedals(D, B, 3.0, True, -30.0, MASS, RADIUS, 65.0, 65.0) == (0.0, 1.0)


# Construction


@pytest.mark.parametrize(
    ("make", "key", "value", "allowed"),
    [
        (drivetrain.make, "speeds", [80.0, 70.0], "ascending"),
        (drivetrain.make, "full_load", [100.0], "9 values"),
        (drivetrain.make, "drag", [5.0] * 9, "0 at the idle speed"),
        (drivetrain.make, "full_load", [0.0] * 9, "not both be 0"),
        (drivetrain.make, "ratios", [1.0, 2.0], "descending"),
        (drivetrain.make, "down_shift", [1100.0 * RPM, 3500.0 * RPM], "hunts"),
        (drivetrain.make, "up_shift", 300.0, "two speeds"),
        (brakes.make, "rear", math.inf, "finite"),
        (speed_hold.make, "proportional", "fast", "number"),
    ],
)
def test_bad_values_are_named(make, key, value, allowed):
    with pytest.raises(ValueError, match=rf"(?s){key}.*{allowed}.*got"):
        make(**{key: value})


def test_one_gear_and_all_wheel_drive_are_fine():
    d = drivetrain.make(ratios=[1.0], front_share=0.5)
    assert drivetrain.shift(d, 1.0, 0.0, 1.0, 0.0, 0.0, 0.001) == (1.0, 0.0)


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_plain_python_equals_compiled():
    rng = np.random.default_rng(1)
    for _ in range(50):
        w, T, c = rng.uniform(-5.0, 5.0, 2), rng.uniform(-500.0, 500.0, 2), rng.uniform(0.0, 500.0, 2)
        arguments = (1.1, 20.0, *w, *T, *c, 0.001)
        assert brakes.axle_step(*arguments) == brakes.axle_step.py_func(*arguments)
