"""Baseline assists: contracts that all of them keep, the friction observer, and the margins of the designed loops."""

import math
from functools import partial
from itertools import cycle, product

import gymnasium as gym
import numpy as np
import pytest

from steer_env import assists, friction
from steer_env.assists import lead_lag
from steer_env.assists.common.linear import discretise, slopes
from steer_env.assists.common.reference_feel import Feel
from steer_env.registration import id_of
from steer_env.tasks.assist_parking import WANTED
from steer_env.tasks.assist_release import RELEASE_TIME
from steer_env.tasks.common.reference_feel import reference_torque
from steer_env.vehicle import cars
from steer_env.vehicle.steering.linear import response
from steer_env.vehicle.steering.margins import hands_fixed_loop
from tests.by_law import EACH_LAW, FEW, OTHERS, in_turn, pairs

CAR = cars.load()
NAMES = assists.available()
SCENARIOS = ("Weave", "Release", "LaneChange", "LaneKeeping", "Parking")
_made: dict = {}

standard = partial(assists.make, tuned=False)  # which a search for better options does not change


def environment(scenario, law="lugre", num_envs=None):
    """An assist environment, made once; every test resets it."""
    key = scenario, law, num_envs
    if key not in _made:
        name = id_of(f"Assist{scenario}")
        _made[key] = (
            gym.make(name, friction=law, normalise=False).unwrapped
            if num_envs is None
            else gym.make_vec(name, num_envs=num_envs, friction=law, normalise=False)
        )
    return _made[key]


def watched(scenario, steps, seed=5):
    """Observations (steps, O) of an episode's beginning under the table alone."""
    env = environment(scenario)
    seen = [env.reset(seed=seed)[0]]
    for _ in range(steps - 1):
        seen.append(env.step(np.zeros(1, np.float32))[0])
    return np.array(seen)


def acted(baseline, seen):
    baseline.reset()
    return np.array([baseline.act(one) for one in seen])


@pytest.mark.parametrize("name", NAMES)
def test_a_row_of_a_batch_acts_as_a_single_environment(name):
    seen = [watched("Weave", 300, seed) for seed in (1, 2, 3)]
    together = acted(standard(name, environment("Weave", num_envs=3)), np.stack(seen, axis=1))
    assert together.shape == (300, 3, 1)
    assert together.dtype == np.float32
    for i, alone in enumerate(seen):
        assert np.array_equal(acted(standard(name, environment("Weave")), alone), together[:, i])


@pytest.mark.parametrize("name", NAMES)
def test_each_row_starts_anew_by_itself(name):
    seen = np.stack([watched("Weave", 200, seed) for seed in (1, 2)], axis=1)
    baseline = standard(name, environment("Weave", num_envs=2))
    before = acted(baseline, seen)
    baseline.reset(np.array([False, True]))
    after = np.array([baseline.act(np.stack([seen[-1, 0], one])) for one in seen[:, 1]])
    assert np.array_equal(after[:, 1], before[:, 1])


@pytest.mark.parametrize(
    ("name", "scenario"), [*((name, "Weave") for name in NAMES), *zip(NAMES, cycle(SCENARIOS[1:]))]
)
def test_mirrored_observations_mirror_the_action(name, scenario):
    env = environment(scenario)
    seen = watched(scenario, 200)
    even = [quantity.name in ("speed", "released") for quantity in env.batch.observed]
    actions = acted(standard(name, env), seen)
    assert np.array_equal(acted(standard(name, env), np.where(even, seen, -seen)), -actions)
    assert name == "boost" or scenario != "Weave" or np.abs(actions).max() > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_actions_stay_within_their_span(name):
    env = environment("Release")
    baseline = standard(name, env)
    rng = np.random.default_rng(0)
    for bound in (env.observation_space.high, -env.observation_space.high):
        for one in [bound] * 5 + [(bound * rng.uniform(-1.0, 1.0, bound.shape)).astype(np.float32) for _ in range(200)]:
            action = baseline.act(one)
            assert action.shape == (1,)
            assert abs(action[0]) <= 1.0


@pytest.mark.parametrize(("name", "scenario", "law"), pairs(product(NAMES, SCENARIOS, ("lugre", "masing"))))
def test_every_baseline_drives_every_task(name, scenario, law):
    env = environment(scenario, law)
    baseline = standard(name, env)
    observation, _ = env.reset(seed=2)
    over = False
    while not over:
        observation, reward, terminated, over, info = env.step(baseline.act(observation))
        assert math.isfinite(reward)
        assert "non_finite_state" not in info
        if terminated:
            assert scenario == "LaneChange"  # at the end of its course
            break
    assert info.get("rolled_over") is None
    if scenario == "LaneChange":
        assert info["metrics"]["peak_lateral_offset"] < 2.0
    assert info["metrics"]["rms_handwheel_speed"] < 2.0


@pytest.mark.parametrize("law", EACH_LAW)
def test_the_observer_is_the_laws_response(law):
    env = environment("Weave")
    seen = watched("Weave", 400)
    speeds = seen[:, [quantity.name for quantity in env.batch.observed].index("column_speed")].astype(float)
    baseline = standard("friction_compensation", env, law=law)
    observed = []
    for one in seen:
        baseline.act(one)
        observed.append(baseline.observed[0])
    x = np.concatenate([[0.0], np.cumsum(speeds * env.control_dt)])
    # The displacement is summed here and differenced there, which leaves rounding.
    np.testing.assert_allclose(observed, friction.response(law, x, env.control_dt)[1:], rtol=0.0, atol=1e-9)


def let_go(plant, name, **options):
    """Column speed (T,) of a release from 0.3 rad under a baseline."""
    env = environment("Release", plant)
    baseline = standard(name, env, **options)
    observation, _ = env.reset(seed=0, options={"amplitude": 0.3, "speed": 100.0 / 3.6})
    speed, over = [], False
    while not over:
        observation, _, _, over, info = env.step(baseline.act(observation))
        speed.append(info["column_speed"])
    return np.array(speed)


@pytest.mark.parametrize(
    ("plant", "observer", "share"),
    [*in_turn((*FEW, *OTHERS), [0.4, 0.7]), *in_turn((*FEW[1:], *OTHERS, FEW[0]), [0.7, 0.4])],
)
def test_friction_compensation_comes_to_rest(plant, observer, share):
    """No limit cycle, held or let go, whatever friction the car has and the observer believes in."""
    speed = let_go(plant, "friction_compensation", law=observer, share=share)
    held = speed[round(RELEASE_TIME / 0.01) - 50 : round(RELEASE_TIME / 0.01) - 5]
    assert np.ptp(held) < 1e-3
    # The slowest swing of a car without dry friction has decayed to a hundredth of the 0.6 rad/s it starts with.
    assert np.ptp(speed[-60:]) < 6e-3


def test_compensation_and_lqg_bring_the_feel_nearer_to_the_reference():
    env = environment("Weave", num_envs=8)

    def error(name):
        baseline = standard(name, env)
        observation, _ = env.reset(seed=0)
        over = np.zeros(8, bool)
        while not over.any():
            observation, _, _, over, info = env.step(baseline.act(observation))
        return info["metrics"]["rms_feel_error"].mean()

    plain = error("boost")
    assert plain == pytest.approx(0.42, abs=0.02)
    assert error("friction_compensation") < 0.97 * plain
    assert error("lead_lag") < 0.97 * plain
    assert error("integral") < 0.3 * plain
    assert error("lqg") < 0.2 * plain


@pytest.mark.parametrize("name", NAMES)
def test_scaled_observations_give_the_same_actions(name):
    scaled = gym.make("steer_env/AssistWeave-v3").unwrapped
    seen = watched("Weave", 300)
    assert scaled.observation_scale.max() > 1.0
    own = acted(standard(name, scaled), (seen / scaled.observation_scale).astype(np.float32))
    np.testing.assert_allclose(own, acted(standard(name, environment("Weave")), seen), rtol=0.0, atol=1e-5)


def driven(scenario, name, options, keys):
    """Handwheel angle and torque (T, 2) of an episode of a car with keys of its assist, under a baseline."""
    env = gym.make(id_of(f"Assist{scenario}"), vehicle={"base": "compact", "assist": keys}).unwrapped
    baseline = standard(name, env, **options)
    observation, _ = env.reset(seed=3)
    seen, over = [], False
    while not over:
        observation, _, ended, cut, info = env.step(baseline.act(observation))
        seen.append([info["handwheel_angle"], info["handwheel_torque"]])
        over = ended or cut
    return np.array(seen)


@pytest.mark.parametrize(
    ("scenario", "name", "options", "keys"),
    [
        ("Weave", "active_return", {"gain": 10.0, "hold": 1.0}, {"return_gain": 10.0, "return_hold": 1.0}),
        ("Release", "damping", {"gain": 1.0}, {"damping": (CAR.assist.damping + 1.0).tolist()}),
        ("Weave", "lead_lag", {"gain": 0.1}, {"lead_lag_gain": 0.1}),
        pytest.param(
            *("Weave", "friction_compensation", {"share": 0.5, "law": "dahl"}),
            {"friction_share": 0.5, "friction_law": "dahl"},
            marks=pytest.mark.whole,
        ),
    ],
)
def test_a_baseline_does_what_the_same_function_of_the_car_does(scenario, name, options, keys):
    """One law at control steps of 10 ms and at 1 ms: the difference is a small part of the effect, root mean square."""
    without, added = driven(scenario, "boost", {}, {}), driven(scenario, name, options, {})
    own = driven(scenario, "boost", {}, keys)
    effect, difference = (np.sqrt(np.mean((other - added) ** 2, axis=0)) for other in (without, own))
    assert effect[1] > 5e-3  # of 2 N m
    assert np.all(difference <= 0.05 * effect), difference / effect


def shares(amplitude, frequency, torque, speed=28.0, time=20.0):
    """Share of the feel that may be followed, over time, for a sine of the handwheel [rad], [Hz] and a hand torque."""
    env = environment("Weave")
    feel = Feel(env.batch, 30.0)
    omega = 2.0 * math.pi * frequency
    t = np.arange(0.0, time, env.control_dt)
    rates = amplitude * omega * np.cos(omega * t)
    inertia = -env.batch.car.column.I1 * np.gradient(rates, t)  # all that a free handwheel puts on the torsion bar
    feel.begin(0, float(rates[0]))
    return np.array(
        [feel.shares(*(np.array([x]) for x in (twist + torque, rate, speed)))[0] for twist, rate in zip(inertia, rates)]
    )


def test_the_feel_is_followed_in_slow_steering_with_hands():
    assert shares(0.26, 0.2, 2.0)[-500:].min() > 0.9
    # A released handwheel, whatever its motion; and an oscillation of any size, unless the car stands.
    for frequency in (0.2, 1.0, 2.0):
        assert shares(0.26, frequency, 0.0)[-500:].max() < 0.05
    for amplitude in (0.1, 1.0):
        assert shares(amplitude, 1.2, 2.0)[-500:].max() < 0.1
        assert shares(amplitude, 1.2, 2.0, speed=0.0)[-500:].min() > 0.9


@pytest.mark.parametrize("name", ["integral", "lqg"])
def test_caution_bounds_the_feel_in_quick_steering(name):
    """Between a controller that follows the feel in every motion and the boost alone; lower is nearer to the feel."""
    env = environment("LaneKeeping", num_envs=2)

    def error(baseline):
        observation, _ = env.reset(seed=0)
        over = np.zeros(2, bool)
        while not over.any():
            observation, _, over, ended, info = env.step(baseline.act(observation))
            over |= ended
        return info["metrics"]["rms_feel_error"].mean()

    bold, usual, cautious, alone = map(
        error,
        (
            *(standard(name, env, **more) for more in ({"caution": 0.3}, {}, {"caution": 100.0})),
            standard("boost", env),
        ),
    )
    assert bold < usual < cautious < 1.01 * alone
    assert usual < 0.9 * alone


def test_grip_and_quick_motion_fade_in_closed_form():
    """A torque that begins and ends at once: two lags of 4 Hz, then a decay; a jerk at the wheel decays as slowly."""
    batch = environment("Weave").batch
    feel, dt = Feel(batch, 30.0), batch.control_dt
    t, rest, held = dt * np.arange(1, round(3.0 / dt)), np.zeros(1), round(1.0 / dt)
    feel.begin(0, 0.0)
    found = [feel.shares(np.full(1, 2.0 if k < held else 0.0), rest, rest)[0] for k in range(t.size)]
    grip = 0.1 * np.sqrt(np.array(found) / (1.0 - np.array(found)))
    left, n = math.exp(-2.0 * math.pi * 4.0 * dt), np.arange(1, held + 1)  # of a step after dt and after n dt
    expected = 2.0 * (1.0 - left**n * (1.0 + n * (1.0 - left))) - 0.2
    growing = expected > 0.0
    np.testing.assert_allclose(grip[:held][growing], expected[growing], rtol=1e-9)
    np.testing.assert_allclose(np.diff(np.log(grip[(t > 1.5) & (t < 2.0)])) / dt, -1.0 / 0.15, rtol=1e-6)

    feel.begin(0, 0.0)
    jerk = np.where(t < 0.05, 0.3, 0.0)
    found = [feel.shares(np.full(1, 50.0), np.array([rate]), np.full(1, 30.0))[0] for rate in jerk]
    quick = np.sqrt(1.0 / np.array(found) - 1.0)[t > 2.0]  # what is left of the jerk, over what is slow and dies out
    assert np.log(quick[0] / quick[-1]) == pytest.approx((t[-1] - t[t > 2.0][0]) / 1.6, rel=0.02)


def test_a_standing_car_feels_as_in_parking():
    env = environment("Weave")
    feel, rate = Feel(env.batch, 1.0), np.array([2.0])
    assert feel.references(np.zeros(1), rate, np.zeros(1))[0] == pytest.approx(WANTED, rel=1e-6)
    driven = feel.references(np.ones(1), rate, np.full(1, 20.0))[0]
    assert driven == pytest.approx(reference_torque(1.0, 2.0))


@pytest.mark.parametrize("control_dt", [0.001, 0.01])
@pytest.mark.parametrize("speed", [0.0, 22.0, 28.0])
def test_margins_of_the_lead_lag(speed, control_dt):
    import control

    env = gym.make("steer_env/AssistWeave-v3", control_dt=control_dt).unwrapped
    baseline = standard("lead_lag", env, gain=1.0)
    car, H = env.batch.car, lead_lag.compensator(baseline.design(speed), baseline._law, control_dt)
    smallest_phase, smallest_gain = math.inf, math.inf
    for slope in slopes(car, speed):
        loops = lead_lag.loops(car, H, slope, speed)
        for loop in (loops.boost + loops.added, loops.request):
            phase, gain = lead_lag.margins(loop)
            smallest_phase, smallest_gain = min(smallest_phase, phase), min(smallest_gain, gain)
        closed = control.feedback(-H * discretise(car, slope, speed, control_dt)[0, 0], 1)
        assert np.abs(closed.poles()).max() < 1.0
    assert smallest_phase >= math.radians(30.0)
    assert smallest_gain >= 2.0
    # The gain is as large as it may be: one of both is used up, to the step of the search.
    assert smallest_phase < math.radians(31.5) or smallest_gain < 2.1


def test_margins_as_the_library_has_them():
    import control

    env = environment("Weave")
    loop = hands_fixed_loop(env.batch.car.column, env.batch.car.assist, 2.8, 28.0)
    omega = np.geomspace(1.0, 3100.0, 4000)
    z = np.exp(1j * omega * 1e-3)
    np.testing.assert_allclose(response(loop, z[::500]), loop(z[::500]), rtol=1e-8)
    gain, phase, *_ = control.stability_margins(control.frequency_response(loop, omega))
    found = lead_lag.margins(response(loop, z))
    assert math.degrees(found[0]) == pytest.approx(phase, abs=0.1)
    assert found[1] == pytest.approx(gain, rel=1e-3)


@pytest.mark.parametrize("speed", [0.0, 22.0, 28.0])
def test_margins_of_the_lqg(speed):
    """At the request, at every slope of the boost curve, as long as its authority is not used up."""
    env = environment("Weave")
    car, d = env.batch.car, standard("lqg", env).design(speed)
    A, B = d.A + np.outer(d.E, d.C), d.B[:, :2] + np.outer(d.E, d.D[:2])
    z = np.exp(1j * np.geomspace(1.0, 0.999 * math.pi / 0.01, 2000) * 0.01)
    for slope in slopes(car, speed):
        plant = discretise(car, slope, speed, 0.01)
        feedback = d.C @ np.linalg.inv(z[:, None, None] * np.eye(len(A)) - A) @ B + d.D[:2]
        through = plant.C @ np.linalg.inv(z[:, None, None] * np.eye(len(plant.A)) - plant.A) @ plant.B[:, :1]
        phase, gain = lead_lag.margins(-(feedback[:, None] @ through)[:, 0, 0])
        assert phase >= math.radians(30.0)
        assert gain >= 2.0
        request = plant.B[:, :1]
        whole = np.block([[plant.A + request @ d.D[None, :2] @ plant.C, request @ d.C[None]], [B @ plant.C, A]])
        assert np.abs(np.linalg.eigvals(whole)).max() < 1.0


def test_bad_input():
    env = environment("Weave")
    with pytest.raises(ValueError, match=r"unknown baseline assist 'pid'; available: active_return, boost"):
        standard("pid", env)
    with pytest.raises(ValueError, match=r"has no option 'gian'; it takes: gain"):
        standard("damping", env, gian=1.0)
    with pytest.raises(ValueError, match=r"has no option 'gain'; it takes: none"):
        standard("boost", env, gain=1.0)
    for share in (-0.1, 1.1, math.nan):
        with pytest.raises(ValueError, match=r"share must be finite and at least 0 and at most 1"):
            standard("friction_compensation", env, share=share)
    with pytest.raises(ValueError, match=r"unknown friction law 'coulombe'"):
        standard("friction_compensation", env, law="coulombe")
    with pytest.raises(ValueError, match=r"gain .* at least 0"):
        standard("damping", env, gain=-1.0)
    with pytest.raises(ValueError, match=r"lead \[Hz\] must be a pair"):
        standard("lead_lag", env, lead=3.0)
    with pytest.raises(ValueError, match=r"must be an array \(9,\)"):
        standard("boost", env).act(np.zeros(3, np.float32))


def test_another_environment_is_refused():
    for other in ("steer_env/DriverLaneKeeping-v3", "CartPole-v1"):
        with pytest.raises(ValueError, match=r"whose action is an assist torque, got"):
            standard("damping", gym.make(other))


def test_a_missing_observation_is_named(monkeypatch):
    env = environment("Weave")
    kept = tuple(quantity for quantity in env.batch.observed if quantity.name != "column_speed")
    monkeypatch.setattr(env.batch, "observed", kept)
    with pytest.raises(ValueError, match=r"AssistWeave does not observe column_speed; it has: handwheel_angle"):
        standard("damping", env)
