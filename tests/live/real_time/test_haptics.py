"""A fake wheel on the loop: its computed limit of stability against the one that a longer delay finds."""

import math

import numpy as np
import pytest

from steer_env.live.real_time import angle_filter, haptics
from steer_env.live.real_time.haptics import FREQUENCIES, OWN_DELAY, Wheel, longest_delay, stability
from steer_env.live.real_time.model import make_model, step
from steer_env.vehicle import cars, subsystems

K_TB = 130.0  # of the default car [N m/rad]
BIT = math.radians(900.0) / 2**16  # of a sensor with 16 bit over 900 deg [rad]
PARTS = 10  # of a sample, in which the fake wheel moves
LOOP = 0.0015  # delay of the loop below: the torque of a sample acts from the next one on, and holds for it [s]


def part_of(speed=100.0 / 3.6, law="lugre", chassis="two_track"):
    """The default car with a prescribed handwheel angle."""
    return subsystems.make("car", cars.load("compact").plant(law, speed, True, chassis=chassis), speed)


def oscillation(part, wheel, delay, share=1.0, bit=0.0, friction=0.0, seconds=4.0, gap=3):
    """Peak to peak [rad] of the wheel's angle in the last second, after a push of 2 N m for 30 ms.

    The wheel has ``delay`` [s], a sensor with a step of ``bit`` [rad], and Coulomb friction [N m]. Its readings come at
    uneven intervals of 1 ms to ``gap`` [ms], to the filter of the mailboxes.
    """
    draw, sensor, due = np.random.default_rng(7), angle_filter.make(), 0
    model, names = make_model(part), [signal.name for signal in part.given]
    places = names.index("hand_angle"), names.index("hand_speed")
    angle = speed = filtered = filtered_speed = 0.0
    waiting = [0.0] * (round(1e3 * delay) + 1)
    angles = np.zeros(round(1e3 * seconds))
    for i in range(angles.size):
        if bit:
            if i >= due:
                angle_filter.follow(sensor, bit * round(angle / bit), 1_000_000 * i)
                due = i + int(draw.integers(1, gap + 1))
            filtered, filtered_speed = angle_filter.estimate(sensor, 1_000_000 * i)
        else:
            filtered, filtered_speed = angle, speed
        model.given[places[0]], model.given[places[1]] = filtered, filtered_speed
        step(model, 1)
        waiting.append(-share * model.outputs[0, model.torque])
        torque = waiting.pop(0) + (2.0 if i < 30 else 0.0)
        for _ in range(PARTS):
            rub = friction * math.tanh(speed / 0.01)
            speed += 1e-3 / PARTS * (torque - rub - wheel.damping * speed) / wheel.inertia
            angle += 1e-3 / PARTS * speed
        angles[i] = angle
        if abs(angle) > 3.0:
            return math.inf
    return float(np.ptp(angles[-1000:]))


def found_delay(part, wheel, longest, **sensor):
    """The shortest whole number of milliseconds with which the wheel goes on oscillating [s]."""
    low, high = 0, round(1e3 * longest)
    quiet = 0.005 if sensor else 0.002  # some steps of the sensor
    assert oscillation(part, wheel, 0.0, **sensor) < quiet
    assert oscillation(part, wheel, longest, **sensor) > 2.0 * quiet
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if oscillation(part, wheel, 1e-3 * middle, **sensor) > quiet else (middle, high)
    return 1e-3 * high


def test_a_spring_has_the_limit_of_the_closed_form():
    """J s^2 + b s + K e^(-s tau): at the limit J w^2 = K cos(w tau) and b w = K sin(w tau)."""
    wheel = Wheel(0.04, 1.0, 0.0)
    delay, frequency = longest_delay(wheel, np.full(FREQUENCIES.size, K_TB + 0.0j))
    square = (-(wheel.damping**2) + math.sqrt(wheel.damping**4 + (2.0 * wheel.inertia * K_TB) ** 2)) / (
        2.0 * wheel.inertia**2
    )
    omega = math.sqrt(square)
    assert frequency == pytest.approx(omega / (2.0 * math.pi), rel=0.002)
    assert delay == pytest.approx(math.atan2(wheel.damping * omega, wheel.inertia * square) / omega, rel=0.005)
    assert delay == pytest.approx(wheel.damping / K_TB, rel=0.05)  # of a light wheel: 8 ms ask for 1 N m s/rad


def constant(stiffness):
    """A plant that answers every frequency alike."""
    return np.full(FREQUENCIES.size, complex(stiffness))


def test_a_plant_that_answers_little_takes_long_to_oscillate_and_one_that_does_not_answer_never_does():
    delay, frequency = longest_delay(Wheel(0.04, 1.0, 0.0), constant(0.1))
    assert delay == pytest.approx(0.5 * math.pi * 1.0 / 0.1, rel=0.01)  # a quarter of a turn behind, at K / b
    assert frequency == pytest.approx(0.1 / (2.0 * math.pi), rel=0.01)
    assert longest_delay(Wheel(0.04, 1.0, 0.0), constant(0.0))[0] == math.inf


@pytest.mark.parametrize(
    ("stiffness", "inertia", "damping"),
    [
        (130.0, 0.003, 0.3),
        (130.0, 0.001, 0.5),
        (20.0, 1.0, 0.1),
        (5.0, 0.3, 0.3),
        (5.0, 1.0, 0.01),
        (400.0, 0.001, 0.1),
    ],
)
def test_light_and_heavy_wheels_have_a_limit(stiffness, inertia, damping):
    """Against the first delay in ms at which the roots of the discrete loop leave the unit circle."""
    delay, _ = longest_delay(Wheel(inertia, damping, 0.0), constant(stiffness))
    first = first_unstable(stiffness, inertia, damping)
    print(f"computed {1e3 * (delay - LOOP):.2f} ms, discrete loop unstable from {first} ms")
    assert first - 1.1 <= 1e3 * (delay - LOOP) <= first + 0.1 or (first == 0 and delay < LOOP)


def first_unstable(stiffness, inertia, damping):
    """Smallest delay [ms] at which a wheel behind a held torque, sampled at 1 ms, is unstable."""
    decay = math.exp(-damping * 1e-3 / inertia)
    slide = inertia / damping * (1.0 - decay)
    for samples in range(400):
        # angle, speed, and torques on their way, of which the last acts in this sample
        a = np.zeros((3 + samples, 3 + samples))
        a[0, :2], a[1, 1] = (1.0, slide), decay
        a[0, -1], a[1, -1] = (1e-3 - slide) / damping, (1.0 - decay) / damping
        a[2, 0] = -stiffness
        a[3:, 2:-1] = np.eye(samples)
        if np.abs(np.linalg.eigvals(a)).max() > 1.0:
            return samples
    raise AssertionError("stable with every delay")


def test_a_plant_that_lags_is_unstable_without_delay():
    assert longest_delay(Wheel(0.04, 0.01, 0.0), 130.0 * np.exp(constant(-0.05j)))[0] == 0.0


def test_a_light_wheel_is_quiet_with_its_share():
    """One that was called stable with every delay and is not, and one that hums with all that is stable."""
    part = part_of(28.0)
    for wheel in (Wheel(0.003, 0.3, 0.008), Wheel(0.008, 0.3, 0.008), Wheel(0.02, 0.1, 0.008)):
        found = stability(part, wheel)
        print(f"{wheel}: {found}, oscillates by {oscillation(part, wheel, 0.008, found.share):.5f} rad")
        assert found.longest_delay < 0.008
        assert 0.05 < found.share < haptics.MARGIN
        assert oscillation(part, wheel, 0.008, 1.0) > 0.01
        assert oscillation(part, wheel, 0.008, found.share) < 0.001


@pytest.mark.whole
@pytest.mark.parametrize("gap", [3, 9])
@pytest.mark.parametrize(("law", "speed", "damping"), [("lugre", 28.0, 0.3), ("dahl", 14.0, 0.3)])
def test_the_limit_with_16_bit_and_a_filter_is_where_a_longer_delay_finds_it(law, speed, damping, gap):
    """Readings at uneven intervals with a mean of 2 and 5 ms."""
    part, wheel = part_of(speed, law), Wheel(0.04, damping, 0.0)
    found = stability(part, wheel, angle_filter.BANDWIDTH, 0.5e-3 * (1 + gap))
    computed = found.longest_delay + OWN_DELAY - LOOP
    measured = found_delay(part, wheel, 0.06, bit=BIT, gap=gap)
    print(f"{law}, {speed} m/s, up to {gap} ms: computed {1e3 * computed:.1f} ms, found {1e3 * measured:.0f} ms")
    assert measured == pytest.approx(computed, rel=0.2, abs=1e-3)


@pytest.mark.whole
@pytest.mark.parametrize("speed", [0.0, 5.0, 20.0, 40.0, 60.0])
def test_a_wheel_with_16_bit_and_8_ms_is_stable_at_every_speed(speed):
    """With the share that is computed; a wheel with little damping gets less than all of the torque."""
    part = part_of(speed)
    for damping in (1.0, 0.1):
        wheel = Wheel(0.04, damping, 0.008)
        found = stability(part, wheel, angle_filter.BANDWIDTH)
        print(f"{speed} m/s, {damping} N m s/rad: {found}")
        assert 0.0 < found.share <= 1.0
        assert found.share <= haptics.MARGIN or found.longest_delay >= 0.008
        assert oscillation(part, wheel, wheel.delay, found.share, BIT, 0.05) < 0.01


def test_bad_wheels_and_parts_are_named():
    with pytest.raises(ValueError, match=r"damping of the wheel \[N m s/rad\] must be finite and greater than 0"):
        haptics.make(0.04, 0.0, 0.008)
    torque = subsystems.make("car", cars.load("compact").plant(speed=27.8), 27.8)
    with pytest.raises(ValueError, match="hands that give the angle"):
        stability(torque, Wheel(0.04, 1.0, 0.008))
