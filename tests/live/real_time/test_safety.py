"""The watchdog and the limits, by faults on a fake wheel with a clock of its own."""

import math

import numpy as np
import pytest

from steer_env.live.real_time import Limits, Mailboxes
from steer_env.live.real_time.loop import NEVER, PERIOD, counts, make_loop_memory
from steer_env.live.real_time.model import restart
from steer_env.live.real_time.safety import SAFETY, limit_torque
from steer_env.vehicle import cars, subsystems
from tests.live.real_time.wheel import Wheel

FADED = 0.050  # time from a fault to zero torque [s]


@pytest.fixture
def wheel():
    """A wheel in use: past the soft start, with some newton metres."""
    made = Wheel()
    made.run(1.5)
    assert made.phases[-1] == "on"
    assert 1.0 < abs(made.torques[-1]) < made.limits.torque
    return made


def largest_step(torques):
    """Largest change of the torque in a sample [N m]."""
    return np.abs(np.diff(torques)).max()


def test_nothing_before_an_input_then_a_soft_start():
    wheel = Wheel()
    assert set(wheel.run(0.2, silent=True)) == {0.0}
    assert set(wheel.phases) == {"off"}
    torques = np.abs(wheel.run(1.2))
    assert wheel.phases[200] == "starting"
    assert wheel.phases[199 + 1000 : 199 + 1003].count("on") >= 2
    whole = Wheel(Limits(soft_start=1e-9))
    whole.run(0.2, silent=True)
    ramp = np.minimum(np.arange(1, 1201) / 1000.0, 1.0)
    assert torques == pytest.approx(ramp * np.abs(whole.run(1.2)), abs=1e-9)


def test_the_torque_is_that_of_the_torsion_bar(wheel):
    names = [signal.name for signal in wheel.part.outputs]
    bar = wheel.mail.get()[2][names.index("torsion_bar_torque")]
    assert wheel.torques[-1] == pytest.approx(-bar, rel=1e-12)


def test_inputs_that_cease_hold_then_fade_and_start_again_softly(wheel):
    before = wheel.torques[-1]
    torques = np.array(wheel.run(0.2, silent=True))
    fading = wheel.phases.index("fading", 1400) - 1500  # samples after the last input
    assert 1e-3 * fading <= wheel.limits.hold + 0.010  # detected, and begun within 10 ms of it
    assert not torques[round(1e3 * FADED) :].any()
    assert np.abs(torques).max() < abs(before) + 1.0
    assert largest_step([before, *torques]) < 1.2 * (abs(before) + 1.0) / (1e3 * wheel.limits.fade)
    assert wheel.phases[-1] == "off"
    again = wheel.run(1.2)
    assert largest_step([0.0, *again]) < 0.2
    assert wheel.phases[-1] == "on"
    assert counts(wheel.loop)["stale_trips"] == 1


def test_an_input_that_is_back_in_time_is_no_fault(wheel):
    for _ in range(5):
        wheel.run(0.018, silent=True)
        wheel.run(0.002)
    assert set(wheel.phases[1500:]) == {"on"}
    assert counts(wheel.loop)["stale_trips"] == 0


@pytest.mark.parametrize("missed", [5, 16])
def test_a_stall_of_the_machine_is_no_fault(wheel, missed):
    wheel.run(0.3, missed=missed)
    assert set(wheel.phases[1500:]) == {"on"}


def test_missed_deadlines_fade(wheel):
    before = wheel.torques[-1]
    torques = wheel.run(0.06, missed=30)  # a stall of 31 ms, and what follows
    assert wheel.phases[1500] in ("fading", "off")
    assert not any(torques[round(1e3 * FADED) - 30 :])
    assert abs(torques[0]) <= abs(before) + 1.0
    wheel.run(2.0)
    assert wheel.phases[-1] == "on"  # by itself, as soon as deadlines are kept
    assert counts(wheel.loop)["deadline_trips"] == 1


def test_many_short_stalls_fade_as_well(wheel):
    for _ in range(12):
        wheel.run(0.006, missed=3)
    assert counts(wheel.loop)["deadline_trips"] == 1


def test_a_stopped_process_fades_at_once(wheel):
    """SIGSTOP for five seconds: meanwhile the wheel's own timeout ends its torque, then there is none."""
    assert wheel.run(5.001, missed=5000) == [0.0]


def test_a_loop_that_no_longer_writes_gives_no_torque(wheel):
    """Its thread hangs or has died without a word; the program in Python takes zero."""
    assert abs(wheel.mail.get()[0]) > 1.0
    wheel.now += 31 * PERIOD
    assert wheel.mail.get()[0] == 0.0
    assert wheel.run(0.001)[0] != 0.0  # one that is back at the next deadline
    wheel.run(0.05, missed=31)
    wheel.run(2.0)
    assert counts(wheel.loop)["deadline_trips"] == 1
    assert wheel.phases[-1] == "on"


def test_a_sink_that_fails_stays_without_torque(wheel):
    wheel.mail.fail()
    torques = wheel.run(0.1)
    assert not any(torques[round(1e3 * FADED) :])
    assert wheel.phases[1501] == "fading"  # the sample after the one that it refused
    wheel.mail.device.failed[0] = 0
    assert not any(wheel.run(1.0))
    assert wheel.phases[-1] == "failed"
    wheel.model.begun[0] += 1  # a new session
    wheel.run(1.2)
    assert wheel.phases[-1] == "on"
    assert counts(wheel.loop)["failure_trips"] == 1


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_plant_that_does_not_stay_finite_has_no_torque(wheel, value):
    wheel.amplitude = value
    torques = wheel.run(0.1)
    assert np.isfinite(torques).all()
    assert not any(torques[round(1e3 * FADED) :])
    assert wheel.phases[-1] == "failed"
    assert np.isfinite(wheel.model.state).all()


@pytest.mark.parametrize("value", [math.nan, 1e300, 1e4, 31.0])
def test_one_input_that_makes_no_sense_ends_the_torque_at_once(wheel, value):
    """Also where good inputs follow; the plant and the outputs stay as they were before."""
    state = wheel.model.state.copy()
    shown = wheel.mail.get()[2]
    good = [0.0] * len(wheel.part.given)
    wheel.mail.put([*good[: wheel.angle], value, *good[wheel.angle + 1 :]], wheel.now + 1_000_000)
    assert wheel.run(0.001, silent=True) == [0.0]
    assert wheel.mail.get()[1] == "failed"
    assert np.array_equal(wheel.model.state, state)
    assert np.array_equal(wheel.mail.get()[2], shown)
    assert set(wheel.run(0.1)) == {0.0}
    assert counts(wheel.loop)["failure_trips"] == 1
    wheel.model.begun[0] += 1  # a new session
    wheel.run(1.2)
    assert wheel.phases[-1] == "on"


def test_a_plant_that_fails_within_the_ranges_shows_what_it_had(wheel):
    wheel.model.state[:] = 1e308
    shown = wheel.mail.get()[2]
    assert wheel.run(0.01) == [0.0] * 10
    assert wheel.phases[-10:] == ["failed"] * 10
    assert np.array_equal(wheel.mail.get()[2], shown)


@pytest.mark.parametrize("jump", [30.0, 0.1, -0.1])
def test_an_angle_that_jumps_ends_the_torque_at_once(wheel, jump):
    """Faster than any handwheel turns; the plant stays as it was, and a new session begins softly."""
    state = wheel.model.state.copy()
    inputs = [0.0] * len(wheel.part.given)
    inputs[wheel.angle] = wheel.model.given[wheel.angle] + jump
    wheel.mail.put(inputs, wheel.now + PERIOD)
    assert wheel.run(0.001, silent=True) == [0.0]
    assert wheel.mail.get()[1] == "failed"
    assert np.array_equal(wheel.model.state, state)
    assert set(wheel.run(0.1)) == {0.0}
    assert counts(wheel.loop)["failure_trips"] == 1
    wheel.model.begun[0] += 1
    wheel.run(1.2)
    assert wheel.phases[-1] == "on"


def test_what_a_handwheel_can_do_is_no_jump():
    """40 rad/s, in readings of 100 Hz; and another angle behind a pause, in which a user may have set it anew."""
    wheel = Wheel(amplitude=0.0)
    wheel.run(1.5)
    for i in range(10):
        wheel.run(0.009, silent=True)
        wheel.amplitude, wheel.omega = 0.4 * (i + 1), 0.5 * math.pi / (1e-9 * (wheel.now + PERIOD))
        wheel.run(0.001)
    assert set(wheel.phases[1500:]) == {"on"}
    wheel.run(0.1, silent=True)
    assert wheel.phases[-1] == "off"
    wheel.amplitude = 0.0
    wheel.run(1.2)
    assert wheel.phases[-1] == "on"
    assert counts(wheel.loop)["failure_trips"] == 0


def test_a_dead_man_key_that_is_released_fades_and_starts_again_softly():
    wheel = Wheel(dead_man=True)
    assert set(wheel.run(0.2, held=False)) == {0.0}
    assert set(wheel.phases) == {"off"}
    wheel.run(1.5)
    assert wheel.phases[-1] == "on"
    before = wheel.torques[-1]
    torques = wheel.run(0.1, held=False)
    assert wheel.phases[1700] == "fading"  # with the next sample
    assert not any(torques[26:])
    assert largest_step([before, *torques]) < 1.2 * (abs(before) + 1.0) / (1e3 * wheel.limits.fade)
    assert wheel.phases[-1] == "off"
    assert np.abs(wheel.model.given).max() > 0.1  # the wheel still turns the car
    assert largest_step([0.0, *wheel.run(1.2)]) < 0.2
    assert wheel.phases[-1] == "on"
    assert counts(wheel.loop)["dead_man_trips"] == 1
    silent = wheel.run(0.1, silent=True)  # a key that was held when the wheel fell silent
    assert not any(silent[round(1e3 * FADED) :])


def test_a_dead_man_key_counts_only_where_it_is_needed(wheel):
    wheel.run(0.2, held=False)
    assert set(wheel.phases[1500:]) == {"on"}


@pytest.mark.parametrize("seconds", [-10.0, -0.05, 0.05, 10.0])
def test_a_clock_that_jumps_ends_the_torque_and_nothing_else(wheel, seconds):
    """That of the client by so much, against the loop's; it starts again when the times are right."""
    wheel.offset = round(1e9 * seconds)
    torques = wheel.run(0.2)
    assert not any(torques[round(1e3 * FADED) :])
    assert wheel.phases[-1] == "off"
    wheel.offset = 0
    wheel.run(1.2)
    assert wheel.phases[-1] == "on"
    assert counts(wheel.loop)["failure_trips"] == 0


def test_a_clock_of_the_loop_that_jumps_on_is_a_stall(wheel):
    """Its deadlines are left out; the torque fades and starts again."""
    wheel.run(3.001, missed=3000)
    wheel.run(0.05)
    assert "fading" in wheel.phases[1500:] or wheel.phases[1500] == "off"
    wheel.run(6.0)
    assert wheel.phases[-1] == "on"
    assert counts(wheel.loop)["deadline_trips"] == 1


def test_inputs_that_make_sense_are_those_of_every_part():
    """Every input of every part has a range, which holds its value at the start."""
    for name in subsystems.SUBSYSTEMS:
        part = subsystems.make(name, cars.load("compact").plant(speed=60.0, robot=True), 60.0)
        for signal in part.given:
            assert -math.inf < signal.low <= signal.start <= signal.high < math.inf


def test_limits_of_torque_and_slew():
    limits = Limits(torque=1.5, slew=20.0, soft_start=1e-9)
    wheel = Wheel(limits)
    torques = wheel.run(3.0)
    assert np.abs(torques).max() == pytest.approx(1.5)
    assert largest_step([0.0, *torques]) < 20.0 * 1e-3 * (1 + 1e-9)
    free = Wheel(Limits(soft_start=1e-9))
    within = np.abs(free.run(3.0)) > 1.5
    assert abs(counts(wheel.loop)["clipped"] - within.sum()) < 30


@pytest.mark.parametrize(("torque", "speed", "expected"), [(6.0, 20.0, 3.0), (6.0, -20.0, 6.0), (-6.0, -20.0, -3.0)])
def test_the_power_that_drives_the_handwheel_is_limited(torque, speed, expected):
    """Of 60 W at 20 rad/s: 3 N m; a torque that brakes takes power and is not limited."""
    memory = np.zeros(1, SAFETY).view(np.recarray)
    memory.gain = 1.0
    assert limit_torque(Limits(power=60.0, slew=1e9), memory[0], torque, speed) == pytest.approx(expected)


def test_every_sample_keeps_the_limit_of_power():
    draw = np.random.default_rng(3)
    memory, limits = np.zeros(1, SAFETY).view(np.recarray), Limits()
    memory.gain = 1.0
    given = [(8.0, 0.0)] * 20 + [(8.0, 30.0)] * 3 + [(8.0, -30.0)] * 20 + [(8.0, 30.0)]
    given += list(zip(10.0 * draw.standard_normal(20_000), 30.0 * draw.standard_normal(20_000)))
    torques = np.array([limit_torque(limits, memory[0], torque, speed) for torque, speed in given])
    speeds = np.array([speed for _, speed in given])
    assert torques.max() == 8.0
    assert (torques * speeds).max() <= limits.power * (1 + 1e-12)
    grown = np.diff(np.abs(torques))[np.sign(torques[1:]) == np.sign(torques[:-1])]
    assert grown.max() <= limits.slew * 1e-3 * (1 + 1e-9)  # only what falls may do so faster


@pytest.mark.parametrize("field", Limits._fields)
@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
def test_limits_that_are_none_are_refused(field, value):
    with pytest.raises(ValueError, match=rf"{field} of Limits must be finite"):
        make_loop_memory(Limits()._replace(**{field: value}))


def test_a_stall_that_is_no_fault_is_no_way_around_the_slew():
    wheel = Wheel(Limits(slew=100.0, soft_start=1e-9), amplitude=0.15)
    wheel.run(1.5)
    for missed in (5, 16, 5):
        last = wheel.torques[-1]
        wheel.omega += math.pi / (1e-9 * wheel.now)  # the other way round
        assert abs(wheel.run(0.02, missed=missed)[0] - last) <= 0.1 * (1 + 1e-9)
    assert set(wheel.phases[1500:]) == {"on"}


def test_a_session_that_follows_at_once_lets_the_torque_fade(wheel):
    before = wheel.torques[-1]
    restart(wheel.model)
    torques = wheel.run(0.1)
    assert largest_step([before, *torques]) <= wheel.limits.slew * 1e-3 + abs(before) / 25.0
    assert wheel.phases[1500] == "fading"
    assert wheel.phases[1530] == "starting"


def test_a_random_history_never_breaks_a_limit():
    """Whatever happens: within the limit, no jump beyond slew and fade, and no torque 50 ms after the last input."""
    draw = np.random.default_rng(4)
    wheel = Wheel(Limits(torque=2.0, slew=100.0, soft_start=0.05), amplitude=1.0)
    most = 100.0 * 1e-3 + 2.0 / 25.0  # slew and fade in one sample
    for _ in range(400):
        last = wheel.torques[-1] if wheel.torques else 0.0
        silent = draw.random() < 0.4
        length = int(draw.integers(40, 90))
        torques = wheel.run(1e-3 * length, silent=silent)
        assert np.abs(torques).max() <= 2.0
        assert largest_step([last, *torques]) <= most * (1 + 1e-9)
        if silent:
            assert not any(torques[49:])
    assert counts(wheel.loop)["stale_trips"] > 50


def test_a_time_to_come_is_no_input(wheel):
    wheel.mail.put([0.0] * len(wheel.part.given), wheel.now + 10**12)
    torques = wheel.run(0.1, silent=True)
    assert not any(torques[round(1e3 * FADED) :])


def test_a_jump_that_is_stamped_to_come_is_no_way_around_the_watchdog(wheel):
    """The reading is not taken, and the next one with a right time is the jump that it is."""
    inputs = [0.0] * len(wheel.part.given)
    inputs[wheel.angle] = wheel.model.given[wheel.angle] + 2.0
    wheel.mail.put(inputs, wheel.now + 10**11)
    before = wheel.torques[-1]
    assert wheel.run(0.001, silent=True)[0] == pytest.approx(before, abs=0.1)
    wheel.mail.put(inputs, wheel.now + PERIOD)
    assert wheel.run(0.001, silent=True) == [0.0]
    assert wheel.mail.get()[1] == "failed"


def test_a_filter_goes_on_behind_a_time_to_come():
    """One reading with a wrong time neither stops the filtered angle nor moves it."""
    wheel = Wheel(angle_bandwidth=50.0)
    wheel.run(1.5)
    wheel.offset = 60 * 10**9
    wheel.run(0.001)
    wheel.offset = 0
    wheel.run(0.5)
    angle = wheel.amplitude * math.sin(wheel.omega * 1e-9 * wheel.now)
    assert wheel.model.given[wheel.angle] == pytest.approx(angle, abs=1e-3)
    assert set(wheel.phases[1500:]) == {"on"}


def test_a_loop_that_ended_amid_a_sample_gives_no_torque(wheel):
    wheel.mail.device.count_out[0] += 1
    torque, phase, _ = wheel.mail.get()
    assert (torque, phase) == (0.0, "failed")


def test_mailboxes_keep_what_arrived_whole():
    part = subsystems.make("steering", cars.load("compact").plant(robot=True), 20.0)
    mail = Mailboxes(part)
    assert mail.device.heard[0] == NEVER
    mail.put(np.ones(6))
    for bad in ([1.0, 2.0], "text", None):
        with pytest.raises(ValueError, match=r"put takes 6 inputs \(hand_torque, .*\), got \(|could not convert"):
            mail.put(bad)
        assert mail.device.count_in[0] == 2
    mail.device.count_in[0] += 1  # an interrupt ended a call
    mail.put(np.ones(6))
    assert mail.device.count_in[0] == 4
