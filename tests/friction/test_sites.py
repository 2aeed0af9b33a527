"""Friction above and below the torsion bar, and a gear's growth with its load."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from steer_env import friction
from steer_env.friction import gear, law, sites
from steer_env.friction.level import Level
from steer_env.testing import friction_law
from steer_env.testing.histories import at_rest
from steer_env.vehicle import cars, step_limit
from steer_env.vehicle.steering import column
from steer_env.vehicle.steering.assist import friction_compensation

C = column.make(C1=0.05)
LAWS = friction.available()
PAIRS = list(zip(LAWS[:6], LAWS[5:]))  # above and below the bar: every law at one of them
ROAD = 20.0  # stiffness of a road spring at the column [N m/rad]


def driven(p, torque, h, steps, load=0.0, motor=0.0, q=None):
    """Rows (T, 6) of angles, speeds and both friction torques under a hand torque, and the work that is lost [J]."""
    q = np.zeros(4) if q is None else q
    p, memory, rows, off = sites.bound(p), at_rest(p), [], 0.0
    for i in range(steps):
        scales = both_ways(p, load, q[column.COLUMN_ANGLE], motor)
        before, road = column.energy(C, q), -ROAD * q[column.COLUMN_ANGLE]
        hand = torque((i + 0.5) * h)
        start = q.copy()
        w1, w2, T_F, _ = column.step(C, p, scales, q, memory, False, hand, 0.0, road + motor, h)
        above = _above(start, q, w1, w2, hand, h)
        lost = (C.C1 * w1**2 + C.C_tb * (w1 - w2) ** 2 + C.C2 * w2**2 + above * w1 + T_F * w2) * h
        # A sticking contact dissipates the momentum that is left (C8).
        lost += 0.5 * C.I1 * start[1] ** 2 * (w1 == 0.0) + 0.5 * C.I2 * start[3] ** 2 * (w2 == 0.0)
        off = max(off, abs(column.energy(C, q) - before - (hand * w1 + (road + motor) * w2) * h + lost))
        rows.append((q[0], q[2], w1, w2, above, T_F))
    return np.array(rows), off, memory


def both_ways(p, load=0.0, x=0.0, motor=0.0):
    """Scales of every site in both directions."""
    found = np.zeros(column.SCALES)
    sites.scales(p, Level(), 1.0, load, x, motor, found)
    return found


def _above(start, end, w1, w2, hand, h):
    """The torque above the bar, from the momentum of the handwheel."""
    twist = 0.5 * (start[0] + end[0] - start[2] - end[2])
    return hand - C.I1 * 2.0 * (w1 - start[1]) / h - C.C1 * w1 - C.C_tb * (w1 - w2) - C.K_tb * twist


def wave(t):
    return 3.0 * math.sin(2.0 * math.pi * t)


@pytest.mark.parametrize("name", ["coulomb", "masing"])
def test_one_site_below_the_bar_is_the_law_alone(name):
    one, alone = friction.resolve({"gear": name}), friction.make(name)
    np.testing.assert_allclose(driven(one, wave, 1e-3, 1500)[0], driven(alone, wave, 1e-3, 1500)[0], atol=1e-9)


@pytest.mark.parametrize("name", ["exponential_spring", "gms", "lugre", "masing"])
def test_the_shares_of_a_steering_are_the_law_where_they_turn_together(name):
    p, split = friction.make(name), friction.resolve({"column_eps": {"law": name, "efficiency": 1.0}})
    rng, ours, theirs = np.random.default_rng(5), at_rest(p), at_rest(split)
    for w in rng.normal(scale=0.3, size=300):
        law.advance(p, 1.0, ours, w, 1e-3)
        law.advance(split, 1.0, theirs, w, 1e-3)
        assert law.torque(split, 1.0, theirs, w) == pytest.approx(law.torque(p, 1.0, ours, w), rel=1e-9, abs=1e-12)


def test_the_shares_of_a_steering_keep_what_is_given_with_the_law():
    p = friction.resolve("masing,F_c=1.2,temperature_rate=0.01,temperature_rise=5,efficiency=0.9@column_eps")
    torques = {name: sites.sliding_torque(site.law) for name, site in zip(p._fields, p)}
    expected = {"upper_column": 0.12, "lower_column": 0.0, "gear": 0.36, "rack": 0.72, "motor": 0.0}
    assert torques == pytest.approx(expected, abs=1e-8)
    assert p.gear.driving * 0.36 == pytest.approx(0.1)
    assert p.rack.level == p.upper_column.level == Level(temperature_rate=0.01, temperature_rise=5.0)
    assert repr(friction.resolve(sites.as_mapping(p))) == repr(p)
    assert friction.resolve("lugre@column_eps").gear.driving * 0.27 == pytest.approx(0.12)
    active = friction.resolve("lugre,F_s=3,sigma_1=50,allow_active=1@column_eps")
    assert active.rack.law.sigma_1 == pytest.approx(30.0)


@pytest.mark.parametrize(("above", "below"), PAIRS)
def test_balance_symmetry_and_bounds(above, below):
    """Energy to rounding at 1 ms, the mirrored drive to the bit, and no growth at 10 ms."""
    p = friction.resolve({"upper_column": above, "rack": below})
    rows, off, _ = driven(p, wave, 1e-3, 1500)
    assert off < 1e-12
    mirrored, _, _ = driven(p, lambda t: -wave(t), 1e-3, 1500)
    np.testing.assert_array_equal(mirrored, -rows)
    coarse, _, _ = driven(p, wave, 1e-2, 300)
    assert np.abs(coarse[:, :2]).max() < 2.0 * np.abs(rows[:, :2]).max()


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(PAIRS), st.integers(0, 2**32 - 1), st.sampled_from([1e-3, 1e-2]))
def test_both_step_equations_are_solved(pair, seed, h):
    """The torque that each step equation leaves is the law's own mean torque at the speed that was found."""
    rng, (above, below) = np.random.default_rng(seed), pair
    p = friction.resolve({"upper_column": above, "rack": below})
    memory = at_rest(p)
    a, S, K = (2.0 * 0.037 / h, 2.0 * 0.052 / h, 0.07 + 65.0 * h)
    for side, fall in zip((0, 1), sites.falls(p, Level(), 1.0, 0.0, 0.0, h)):
        a, S = (a + fall, S) if side == 0 else (a, S + fall)
    bound = sites.bound(p)
    scales = both_ways(bound)
    for _ in range(20):
        R1, R2 = rng.normal(0.0, 10.0 ** rng.uniform(-2, 1.5), 2)
        before = memory.copy()
        step = sites.Equations(a + K, R1, K, S + K, R2, h)
        w1, w2, *T = sites.joint(bound, scales, memory, step, *rng.normal(0.0, 1.0, 2), False)
        for w, found, site in zip((w1, w2), T, (p.upper_column, p.rack)):
            own = before[site.start : site.end]
            if w == 0.0:
                ends = [law.mean_torque(site.law, 1.0, own, side, h)[0] for side in (-0.0, 0.0)]
                assert min(ends) - 1e-9 <= found <= max(ends) + 1e-9
            else:
                assert found == pytest.approx(law.mean_torque(site.law, 1.0, own, w, h)[0], rel=1e-7, abs=1e-7)


def test_second_order():
    """Against DOP853 of the differential equations: a hundredth of the step, a ten-thousandth of the error."""
    p = friction.resolve({"upper_column": "lugre,F_c=0.4", "gear": "dahl", "rack": "viscous"})
    sizes = [(s.start, s.end) for s in p]

    def derivative(t, x):
        q, m = x[:4], x[4:]
        T, rates = [], np.zeros(m.size)
        for site, (i, j), w in zip(p, sizes, (q[1], *[q[3]] * 4)):
            T.append(law.torque(site.law, 1.0, m[i:j], w))
            law.rate(site.law, 1.0, m[i:j], w, rates[i:j])
        bar = C.K_tb * (q[0] - q[2]) + C.C_tb * (q[1] - q[3])
        return [
            q[1],
            (wave(t) - C.C1 * q[1] - bar - T[0]) / C.I1,
            q[3],
            (bar - C.C2 * q[3] - ROAD * q[2] - sum(T[1:])) / C.I2,
            *rates,
        ]

    end = solve_ivp(derivative, (0.0, 0.5), np.zeros(4 + p.motor.end), "DOP853", rtol=1e-11, atol=1e-13).y[[0, 2], -1]
    errors = [np.abs(_centred(p, h) - end).max() for h in (1e-3, 1e-4)]
    assert errors[0] < 2e-5
    assert errors[1] < 0.02 * errors[0]


def _centred(p, h):
    """Angles after 0.5 s with the road's torque at the middle of each step, as the plant extrapolates it."""
    q, memory, p = np.zeros(4), at_rest(p), sites.bound(p)
    scales = both_ways(p)
    for i in range(round(0.5 / h)):
        road = -ROAD * (q[2] + 0.5 * h * q[3])
        column.step(C, p, scales, q, memory, False, _mean_wave(i * h, h), 0.0, road, h)
    return q[[0, 2]]


def _mean_wave(t, h):
    omega = 2.0 * math.pi
    return 3.0 * (math.cos(omega * t) - math.cos(omega * (t + h))) / (omega * h)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("motor", [4.0, -4.0])
def test_a_worm_gear_slides_with_its_efficiencies(side, motor):
    """Friction in settled sliding at a constant load: what the textbook's efficiencies leave, plus the preload."""
    found = gear.worm(0.25, 0.05)
    p = friction.resolve(
        {"gear": {"law": "masing", "F_c": 0.5, "efficiency": {"lead_angle": 0.25, "friction_coefficient": 0.05}}}
    )
    memory, p = at_rest(p), sites.bound(p)
    scales, equations = both_ways(p, motor=motor), sites.Equations(1.0, 0.0, 0.0, 100.0, 100.0 * side, 1e-3)
    for _ in range(200):
        _, w, _, T = sites.joint(p, scales, memory, equations, 0.0, 0.0, True)
    assert side * w > 0.9
    # The motor's torque less friction is the output; driven back, the input less friction is what the motor holds.
    growth = abs(motor) * (1.0 - found.driving if side * motor > 0.0 else 1.0 / found.driven - 1.0)
    assert T == pytest.approx(side * (0.5 + growth), rel=1e-9)


def test_efficiencies_of_a_worm_are_those_of_statics():
    """Forces on a flank of a worm: resolved along the axes, without the formula."""
    g, mu, a = 0.25, 0.05, math.radians(20.0)
    along, across = math.cos(g), math.sin(g)
    n, friction_force = math.cos(a), mu
    driving = (n * along - friction_force * across) / (n * across + friction_force * along) * math.tan(g)
    driven_back = (n * across - friction_force * along) / (n * along + friction_force * across) / math.tan(g)
    assert gear.worm(g, mu) == pytest.approx((driving, driven_back), rel=1e-12)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gear": "lugre", "belt": "lugre"}, "a site of friction must be"),
        ({"gear": "stiction"}, "friction at gear: .*unknown friction law"),
        ({"gear": {"law": "masing", "efficiency": 1.2}}, "friction at gear: efficiency must be .* at most 1, got 1.2"),
        ({"gear": {"law": "masing", "efficiency": [0.9, 0.0]}}, "locks itself"),
        (
            {"gear": {"law": "masing", "efficiency": {"lead_angle": 0.1, "friction_coefficient": 0.2}}},
            "friction_coefficient must be less than 0.09333",
        ),
        ({"rack": {"law": "masing", "efficiency": 0.9}}, "friction at rack: efficiency is that of the gear"),
        ({"rack": {"law": "masing", "load": -1e-4}}, "friction at rack: load"),
        ({"gear": {"law": "viscous", "efficiency": 0.9}}, r"has no sliding torque .*: give efficiency=1"),
        ({"gear": {"law": "masing", "efficiency": True}}, "efficiency must be a number"),
        (
            {"gear": {"law": "masing", "efficiency": {"lead_angle": 1.5, "friction_coefficient": 0.5}}},
            "friction_coefficient must be less than 0.06597",
        ),
        ({"gear": {"law": "masing", "tooth": 3}}, "friction at gear: .*no parameter 'tooth'"),
        ({"gear": {"law": "masing", "efficiency": 1e-320}}, r"friction at gear: efficiency must be .* at least 0\.01"),
        ({"column_eps": "lugre", "rack": "lugre"}, "at column_eps is that of all its sites: leave it or rack out"),
        ({"column_eps": None}, "^friction at column_eps: None is not"),
    ],
)
def test_what_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        friction.resolve(given)


@pytest.mark.parametrize(
    "check",
    [
        friction_law.check_step_equation,
        friction_law.check_mean_torque,
        friction_law.check_odd_symmetry,
        friction_law.check_passivity,
        friction_law.check_rate,
        friction_law.check_semigroup,
    ],
)
def test_sites_in_one_motion_are_a_law(check):
    check(friction.resolve("lugre@gear+dahl,F_c=0.3@upper_column+viscous@motor"))


def test_sites_as_text():
    text = friction.resolve("masing,elements=4,efficiency=0.9:0.85@gear+coulomb,F_c=5e-2@upper_column")
    mapping = {
        "gear": {"law": "masing", "elements": 4, "efficiency": [0.9, 0.85]},
        "upper_column": {"law": "coulomb", "F_c": 0.05},
    }
    assert repr(text) == repr(friction.resolve(mapping))
    for bad in ("lugre@gear+", "lugre@gear+dahl@gear", "lugre@", "@gear", "lugre@gear@rack"):
        with pytest.raises(ValueError, match="each site once"):
            friction.resolve(bad)


@pytest.mark.parametrize(
    "given",
    [
        "masing,elements=4,efficiency=0.9:0.85@gear+coulomb,F_c=0.05,asymmetry=0.1@upper_column",
        {"gear": {"law": "masing", "efficiency": {"lead_angle": 0.25, "friction_coefficient": 0.05}}, "rack": "gms"},
        {
            "lower_column": {"law": "lugre", "F_s": 1.2, "allow_active": True, "load": 2e-4},
            "motor": friction.make("gms"),
        },
        friction.resolve("dahl,F_c=0.3@upper_column+masing,efficiency=0.9@gear"),
    ],
)
def test_text_and_mapping_repeat_the_sites(given):
    text, p = sites.as_text(given), friction.resolve(given)
    assert repr(friction.resolve(text)) == repr(friction.resolve(friction.as_mapping(p))) == repr(p)
    assert sites.as_text(text) == text


def test_what_was_left_out_follows_what_is_varied():
    """Growth by efficiency belongs to the motor's torque, whatever the preload; F_s of LuGre follows its F_c."""
    for friction_torque in (0.3, 1.8):
        p = friction.varied("coulomb,efficiency=0.88@gear+lugre@rack", {"gear.F_c": friction_torque, "rack.F_c": 1.5})
        assert p.gear.driving * p.gear.law.F_c == pytest.approx(0.12, rel=1e-12)
        assert p.rack.law.F_s == 1.5
    assert friction.varied("lugre@column_eps", {"F_c": 1.5}) == friction.resolve("lugre,F_c=1.5@column_eps")
    with pytest.raises(ValueError, match="the site of friction must be"):
        friction.varied("coulomb@gear+coulomb@rack", {3: 1.0})
    with pytest.raises(ValueError, match=r"all sites of column_eps: name its parameter .* got 'gear.F_c'"):
        friction.varied("lugre@column_eps", {"gear.F_c": 0.3})


def test_a_stiff_bar_with_sticking_sites_is_solved():
    """Where a kink would lead to and fro between two speeds: energy is not made below the bar, nor above it."""
    stiff = column.make(K_tb=1e4, C1=0.05)
    p, rng = sites.bound(friction.resolve("coulomb,F_c=0.5@upper_column+coulomb@rack")), np.random.default_rng(5)
    scales, q, memory = both_ways(p), np.zeros(4), np.zeros(0)
    for _ in range(3000):
        start, hand, road = q.copy(), rng.normal(0.0, 3.0), rng.normal(0.0, 3.0)
        w1, w2, T_F, _ = column.step(stiff, p, scales, q, memory, False, hand, 0.0, road, 1e-2)
        K = stiff.C_tb + 0.5e-2 * stiff.K_tb
        bar = stiff.K_tb * (start[0] - start[2]) + K * (w1 - w2)
        above = hand - 200.0 * stiff.I1 * (w1 - start[1]) - stiff.C1 * w1 - bar
        for w, T, F in ((w1, above, 0.5), (w2, T_F, 0.9)):
            assert abs(T) <= F + 1e-9
            assert w == 0.0 or T == pytest.approx(math.copysign(F, w), abs=1e-9)


def test_laws_that_fall_on_both_sides_of_a_stiff_bar_are_refused_together():
    """Each alone would have one solution; with both there are two."""
    stiff = column.make(K_tb=1e4)
    a, S, K = step_limit.equations(stiff, 1e-3)
    steep = [
        f"stribeck,F_c=0.5,v_s=0.01,F_s={0.5 + 0.99 * slope * 0.01 / math.sqrt(2.0 / math.e)}"
        for slope in (a - K * K / S, S - K * K / a)
    ]
    car = cars.load("compact")
    p = car.plant("viscous")._replace(column=stiff, level=Level())
    for one in ({"upper_column": steep[0]}, {"rack": steep[1]}):
        step_limit.checked(p._replace(friction=friction.resolve(one)))
    both = p._replace(friction=friction.resolve({"upper_column": steep[0], "rack": steep[1]}))
    with pytest.raises(
        ValueError, match=r"'stribeck' at (rack, below|upper_column, above) the torsion bar: "
    ) as refused:
        step_limit.checked(both)
    fall, allowed = map(float, re.search(r"by up to (\S+) .* allows less than ([^,]+),", str(refused.value)).groups())
    assert allowed < fall


def test_what_knows_one_site_refuses_several():
    with pytest.raises(ValueError, match="the observer knows one site"):
        friction_compensation.make(1, 1e-3, friction_law="masing@gear+coulomb@upper_column")
