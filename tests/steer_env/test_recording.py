"""Recordings: checks at construction and what is derived from them."""

import dataclasses
import pickle

import numpy as np
import pytest
from scipy import signal

from steer_env import metrics
from steer_env.recording.recording import DEGREE, Recording
from tests.steer_env.recorded import UNITS


@pytest.fixture
def weave():
    time = np.arange(1001) / 100
    wave = np.sin(2 * np.pi * 0.5 * time)
    channels = dict(zip(UNITS, (0.3 * wave, 3.0 * wave, 2.0 * wave, 0.1 * wave)))
    return Recording(time, channels, UNITS, {"manoeuvre": "weave", "speed_kph": 100.0, "cycles": 5, "mirrored": False})


def test_channels_are_found_by_name(weave):
    np.testing.assert_array_equal(weave["yaw_rate"], weave.channels["yaw_rate"])
    with pytest.raises(
        ValueError, match="no channel 'yaw' in this recording; there are handwheel_angle, handwheel_tor"
    ):
        weave["yaw"]


def test_a_recording_does_not_change(weave):
    with pytest.raises(ValueError, match="read-only"):
        weave["yaw_rate"][0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        weave.time = weave.time + 1
    again = pickle.loads(pickle.dumps(weave))
    np.testing.assert_array_equal(again["yaw_rate"], weave["yaw_rate"])


def test_what_metrics_keep_with_a_recording_is_no_part_of_it(weave):
    """A case of a sweep that holds it is the same case once it was evaluated."""
    before = len(pickle.dumps(weave))
    metrics.evaluate(weave, speed_m_s=27.8)
    assert vars(weave).keys() > {each.name for each in dataclasses.fields(weave)}
    assert len(pickle.dumps(weave)) == before


def test_a_recording_copies_what_may_change_and_shares_what_does_not(weave):
    own, view = np.zeros(1001), np.zeros(1002)[1:]
    view.flags.writeable = False
    other = dataclasses.replace(weave, channels={**weave.channels, "yaw_rate": own, "lateral_acceleration": view})
    assert all(other[name] is weave[name] for name in ("handwheel_angle", "handwheel_torque"))
    own[0] = view.base[1] = 1.0
    assert other["yaw_rate"][0] == other["lateral_acceleration"][0] == 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": [0.0, 1.0, np.nan]}, "time needs at least two samples, all finite"),
        ({"time": [0.0]}, "time needs at least two samples"),
        ({"time": [0.0, 1.0, 1.0]}, "sample 2 is 1.0 s after 1.0 s"),
        ({"time": np.zeros((3, 1))}, r"'time' has shape \(3, 1\)"),
        ({"channels": {"yaw_rate": [0.0, 1.0]}}, "channel 'yaw_rate' has 2 samples, time has 3"),
        ({"channels": {"time": [0.0, 1.0, 2.0]}, "units": {"time": "s"}}, "no channel may be called 'time'"),
        ({"units": {}}, r"units must name the channels \['yaw_rate'\]; got \[\]"),
        ({"units": {"yaw_rate": "deg/s"}}, r"unit 'deg/s'; known units are \['rad', "),
        ({"meta": {"a: b": 1}}, "meta key 'a: b' must be a single line"),
        ({"meta": {"friction": np.zeros(2)}}, "allowed are text, numbers"),
    ],
)
def test_what_a_recording_refuses(change, message):
    plain = {"time": [0.0, 1.0, 2.0], "channels": {"yaw_rate": [0.0, 1.0, 2.0]}, "units": {"yaw_rate": "rad/s"}}
    with pytest.raises(ValueError, match=message):
        Recording(**{**plain, **change})


def test_between_keeps_both_ends(weave):
    part = weave.between(2.0, 3.0)
    assert (part.time[0], part.time[-1], part.time.size) == (2.0, 3.0, 101)
    assert part.meta == weave.meta
    with pytest.raises(ValueError, match=r"no samples from 11 to 12 s; time runs from 0\.0 to 10\.0 s"):
        weave.between(11, 12)


def test_resampled_reads_straight_lines(weave):
    fine = weave.resampled(250.0)
    assert fine.rate == pytest.approx(250.0)
    assert fine.time[-1] == 10.0
    # A chord lies within (omega dt)^2 / 8 of a sine.
    np.testing.assert_allclose(fine["yaw_rate"], 0.1 * np.sin(np.pi * fine.time), atol=0.1 * (np.pi * 0.01) ** 2 / 8)
    with pytest.raises(ValueError, match=r"rate is 0\.05 Hz; it must give at least two samples"):
        weave.resampled(0.05)


def test_low_pass_has_no_phase_and_halves_at_the_cutoff():
    """Amplitude 1 / (1 + (f/fc)^4) at every frequency, the same for all channels, to 0.1 % away from the ends."""
    time = np.arange(4001) / 1000
    for frequency in (0.5, 5.0, 20.0):
        wave = np.sin(2 * np.pi * frequency * time)
        smooth = Recording(time, {"a": wave, "b": -7 * wave}, {"a": "1", "b": "N m"}).filtered(5.0)
        middle = slice(1000, 3001)
        expected = wave[middle] / (1 + (frequency / 5.0) ** 4)
        np.testing.assert_allclose(smooth["a"][middle], expected, atol=1e-3)
        np.testing.assert_allclose(smooth["b"], -7 * smooth["a"], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("cutoff", "rate", "run_in"), [(5.0, 100.0, 20), (10.0, 1000.0, 100), (5.0, 20.0, 4)])
def test_low_pass_is_scipys_to_the_bit(cutoff, rate, run_in):
    values = np.random.default_rng(0).standard_normal(500).cumsum()
    found = Recording(np.arange(500) / rate, {"a": values}, {"a": "1"}).filtered(cutoff)["a"]
    expected = signal.sosfiltfilt(signal.butter(2, cutoff, fs=rate, output="sos"), values, padlen=run_in)
    np.testing.assert_array_equal(found, expected)


def test_what_the_low_pass_refuses(weave):
    with pytest.raises(ValueError, match="sampling at 100 Hz is too slow for a low-pass at 30 Hz; record at 120 Hz"):
        weave.filtered(30.0)
    with pytest.raises(ValueError, match="11 samples are too few for a low-pass at 5 Hz: needs 20"):
        weave.between(0.0, 0.1).filtered(5.0)
    with pytest.raises(ValueError, match="cutoff_hz is 0; it must be positive"):
        weave.filtered(0)
    gap = Recording(weave.time, {"yaw_rate": np.full(1001, np.nan)}, {"yaw_rate": "rad/s"})
    with pytest.raises(
        ValueError,
        match=r"'yaw_rate' has samples that are not finite: close gaps with bridged\(\), or .* without\('yaw_rate'\)",
    ):
        gap.filtered(5.0)
    uneven = Recording(weave.time**2, weave.channels, weave.units)
    with pytest.raises(ValueError, match=r"not uniform: from 99.8001 to 100 s is 2 times .* call bridged\(\) if rows"):
        uneven.filtered(5.0)


def test_time_stamps_may_be_rounded(weave):
    assert Recording(np.round(np.arange(1001) / 128, 3), weave.channels, UNITS).rate == pytest.approx(128, rel=1e-3)


def test_channels_are_left_out(weave):
    rest = weave.without("yaw_rate", "handwheel_torque")
    assert list(rest.channels) == list(rest.units) == ["handwheel_angle", "lateral_acceleration"]
    assert rest.meta == weave.meta
    with pytest.raises(ValueError, match="no channel 'yaw'"):
        weave.without("yaw")


def test_an_offset_is_taken_off_one_channel(weave):
    zeroed = weave.without_offset("handwheel_angle", 2 * DEGREE)
    np.testing.assert_array_equal(zeroed["handwheel_angle"], weave["handwheel_angle"] - 2 * DEGREE)
    np.testing.assert_array_equal(zeroed["yaw_rate"], weave["yaw_rate"])
    with pytest.raises(ValueError, match="offset of 'yaw_rate' must be finite"):
        weave.without_offset("yaw_rate", np.nan)
    with pytest.raises(ValueError, match="no channel 'yaw'"):
        weave.without_offset("yaw", 1.0)


@pytest.mark.parametrize("seconds", [0.03, -0.03, 0.0125, -0.0125, 0.0])
def test_a_delay_moves_one_channel_and_trims_all(weave, seconds):
    moved = weave.delayed("yaw_rate", seconds)
    inside = (weave.time - seconds > -1e-9) & (weave.time - seconds < 10 + 1e-9)
    np.testing.assert_array_equal(moved.time, weave.time[inside])
    np.testing.assert_array_equal(moved["handwheel_angle"], weave["handwheel_angle"][inside])
    expected = 0.1 * np.sin(np.pi * (moved.time - seconds))
    np.testing.assert_allclose(moved["yaw_rate"], expected, atol=0.1 * (np.pi * 0.01) ** 2 / 8)  # a chord
    assert np.isfinite(moved["yaw_rate"]).all()


def test_a_delay_invents_nothing_where_rows_are_missing(weave):
    """Whole before and after the gap of 4.00 to 6.00 s; what comes out of the gap is NaN."""
    kept = (weave.time <= 4.0) | (weave.time >= 6.0)
    holed = dataclasses.replace(weave, time=weave.time[kept], channels={n: v[kept] for n, v in weave.channels.items()})
    moved = holed.delayed("yaw_rate", 0.1)
    lost = np.isnan(moved["yaw_rate"])
    np.testing.assert_allclose(moved.time[lost], np.arange(600, 610) / 100)
    np.testing.assert_allclose(moved["yaw_rate"][~lost], 0.1 * np.sin(np.pi * (moved.time[~lost] - 0.1)), atol=1e-12)


def test_a_delay_of_a_slower_channel_reads_between_its_own_samples(weave):
    """A value in every tenth row, NaN between; one of them lost makes a gap of two of its steps."""
    sparse = np.full(1001, np.nan)
    sparse[::10] = weave.time[::10]
    sparse[500] = np.nan
    slow = dataclasses.replace(weave, channels={**weave.channels, "yaw_rate": sparse})
    moved = slow.delayed("yaw_rate", 0.043)
    gap = (moved.time > 4.9 + 0.043) & (moved.time < 5.1 + 0.043)
    np.testing.assert_array_equal(np.isnan(moved["yaw_rate"]), gap)
    np.testing.assert_allclose(moved["yaw_rate"][~gap], moved.time[~gap] - 0.043, atol=1e-12)
    np.testing.assert_allclose(slow.bridged(0.3)["yaw_rate"], weave.time, atol=1e-12)


def test_a_delay_of_a_channel_without_samples(weave):
    assert np.isnan(holes(weave, slice(None)).delayed("yaw_rate", 0.1)["yaw_rate"]).all()


def test_what_a_delay_refuses(weave):
    with pytest.raises(ValueError, match="delay of 'yaw_rate' is 20 s; of 10 s in all, fewer than two samples remain"):
        weave.delayed("yaw_rate", 20.0)
    with pytest.raises(ValueError, match="delay of 'yaw_rate' must be finite, got nan"):
        weave.delayed("yaw_rate", np.nan)


def holes(weave, where, name="yaw_rate"):
    """The weave with NaN in a channel at some samples."""
    values = weave[name].copy()
    values[where] = np.nan
    return dataclasses.replace(weave, channels={**weave.channels, name: values})


def test_a_burst_of_nan_is_bridged_by_a_line(weave):
    burst = slice(301, 311)  # ten samples: 0.1 s
    mended = holes(weave, burst).bridged()
    line = np.interp(weave.time[burst], weave.time[[300, 311]], weave["yaw_rate"][[300, 311]])
    np.testing.assert_allclose(mended["yaw_rate"][burst], line, rtol=1e-12)
    rest = np.delete(np.arange(1001), np.r_[burst])
    np.testing.assert_array_equal(mended["yaw_rate"][rest], weave["yaw_rate"][rest])
    np.testing.assert_array_equal(mended["handwheel_angle"], weave["handwheel_angle"])
    assert mended.units == weave.units
    assert mended.meta == weave.meta


def test_missing_rows_are_put_in(weave):
    kept = np.delete(np.arange(1001), np.r_[200:210, 500])
    short = dataclasses.replace(weave, time=weave.time[kept], channels={n: v[kept] for n, v in weave.channels.items()})
    with pytest.raises(ValueError, match=r"from 1.99 to 2.1 s is 11 times the median step; call bridged\(\) if rows"):
        _ = short.rate
    mended = short.bridged()
    np.testing.assert_allclose(mended.time, weave.time, atol=1e-12)
    assert mended.rate == pytest.approx(100.0)
    np.testing.assert_array_equal(mended["yaw_rate"][kept], weave["yaw_rate"][kept])
    np.testing.assert_allclose(mended["yaw_rate"], weave["yaw_rate"], atol=0.1 * (np.pi * 0.11) ** 2 / 8)


def test_nan_beside_missing_rows_is_one_gap(weave):
    """Six missing rows and six NaN: 0.06 s each, 0.12 s together."""
    part = holes(weave, slice(206, 212))
    kept = np.delete(np.arange(1001), np.r_[200:206])
    part = dataclasses.replace(part, time=part.time[kept], channels={n: v[kept] for n, v in part.channels.items()})
    with pytest.raises(ValueError, match=r"'yaw_rate' has a gap from 1.99 to 2.12 s: 0.12 s, allowed is longest=0.1 s"):
        part.bridged()
    np.testing.assert_allclose(part.bridged(0.12).time, weave.time, atol=1e-12)


@pytest.mark.parametrize(
    ("where", "message"),
    [
        (slice(301, 312), r"'yaw_rate' has a gap from 3 to 3.12 s: 0.11 s, .* raise longest, cut .* between\(t0, t1\)"),
        (slice(0, 3), r"gap of 0.03 s where the recording begins; cut it off with between\(0.03, 10\)"),
        (slice(999, None), r"gap of 0.02 s where the recording ends; cut it off with between\(0, 9.98\)"),
        (slice(None), r"channel 'yaw_rate' has 0 samples: leave it out with without\('yaw_rate'\)"),
    ],
)
def test_gaps_that_are_refused(weave, where, message):
    with pytest.raises(ValueError, match=message):
        holes(weave, where).bridged()
    if "cut it off" in message:
        assert np.isfinite(holes(weave, where).between(0.03, 9.98).bridged()["yaw_rate"]).all()


def test_a_long_drop_out_is_refused(weave):
    kept = np.delete(np.arange(1001), np.r_[200:300])
    short = dataclasses.replace(weave, time=weave.time[kept], channels={n: v[kept] for n, v in weave.channels.items()})
    with pytest.raises(ValueError, match=r"missing in every channel from 1.99 to 3 s: 1 s, allowed is longest=0.1 s; "):
        short.bridged()
    with pytest.raises(ValueError, match="longest must be finite and at least 0, got -1"):
        short.bridged(-1)


def test_nothing_to_bridge_changes_nothing(weave):
    same = weave.bridged(0.0)
    np.testing.assert_array_equal(same.time, weave.time)
    for name in UNITS:
        np.testing.assert_array_equal(same[name], weave[name])
