"""Raw CAN logs as recordings: frames, rates, gaps, counters, and logs and databases that do not fit."""

import gzip
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import can
import cantools
import numpy as np
import pytest

from steer_env import metrics
from steer_env.experiments.cli.main import main
from steer_env.metrics import RefusedError
from steer_env.metrics.common.filtered_channels import FilteredChannels
from steer_env.recording import can_database, can_log
from steer_env.recording.files import read, write
from steer_env.recording.recording import DEGREE, Recording
from tests.needs import needs
from tests.steer_env.recorded import UNITS, made_weave, mapped, refusal

FOLDER = Path(__file__).parents[2] / "examples" / "can_log"
LOG, DBC = FOLDER / "rav4_2017_can_60s.log.gz", FOLDER / "toyota_rav4_2017.dbc"
OPTIONS = can_log.Options((DBC,))
ANGLE = "handwheel_angle=STEER_ANGLE_SENSOR.STEER_ANGLE + STEER_ANGLE_SENSOR.STEER_FRACTION"
ENTRIES = (
    ANGLE,
    "handwheel_speed=STEER_RATE",
    "vehicle_speed=SPEED",
    "yaw_rate=YAW_RATE",
    "lateral_acceleration=ACCEL_Y,sign=-1",
    "handwheel_torque=STEER_TORQUE_DRIVER[counts]",
)
WHEELBASE, RATIO = 2.65, 16.88  # of the car [m, 1]; SOURCES.md has the source


@pytest.fixture(scope="module")
def drive():
    return read(LOG, mapped(*ENTRIES), can=OPTIONS)


class Frames(NamedTuple):
    """The frames of one message, the last one of each time stamp."""

    time: np.ndarray  # (F,) from the first frame of the log on [s]
    values: dict[str, np.ndarray]  # (F,) of each signal in its unit


def decoded():
    """The frames of every message of the database that occurs in the log, at their own instants."""
    with can.LogReader(LOG) as reader:
        frames = list(reader)
    found = {}
    for entry in can_database.load([DBC])[0]:
        latest = {f.timestamp: f.data for f in frames if f.arbitration_id == entry.message.frame_id}
        data = np.array([list(frame) for frame in latest.values()], dtype=np.uint8)
        if data.size:
            time = np.array(list(latest)) - frames[0].timestamp
            of_message = found.setdefault(entry.message.label, Frames(time, {}))
            of_message.values[entry.signal.name] = entry.read(data, np.full(len(data), data.shape[1]))[1]
    return found


def test_every_frame_is_decoded_as_the_packages_give_it():
    database = cantools.database.load_file(DBC)
    stamps, values = defaultdict(list), defaultdict(list)
    with can.LogReader(LOG) as reader:
        for frame in reader:
            message = database.get_message_by_frame_id(frame.arbitration_id)
            if stamps[message.name] and stamps[message.name][-1] == frame.timestamp:
                stamps[message.name].pop()
                values[message.name].pop()
            stamps[message.name].append(frame.timestamp)
            values[message.name].append(message.decode(frame.data))
    found = decoded()
    assert {name: frames.time.size for name, frames in found.items()} == {
        "KINEMATICS": 4974,
        "STEER_ANGLE_SENSOR": 4974,
        "SPEED": 2487,
        "STEER_TORQUE_SENSOR": 3000,
        "EPS_STATUS": 1499,
        "STEERING_LKA": len(stamps["STEERING_LKA"]),
    }
    first = min(times[0] for times in stamps.values())
    for name, frames in found.items():
        np.testing.assert_array_equal(frames.time, np.array(stamps[name]) - first)
        for signal, samples in frames.values.items():
            np.testing.assert_array_equal(samples, [entry[signal] for entry in values[name]])


def test_the_database_is_what_the_bytes_say():
    """By hand, from the bytes of the first frames of the log."""
    found = decoded()
    angle, speed, torque = found["STEER_ANGLE_SENSOR"], found["SPEED"], found["STEER_TORQUE_SENSOR"]
    first = [angle.values[name][0] for name in ("STEER_ANGLE", "STEER_FRACTION", "STEER_RATE")]
    assert first == pytest.approx([0.0, -0.4, 0.0])  # 025#00001000C00000FD: 12 bits 0x000, 4 bits 0xC, 12 bits 0x000
    assert speed.values["SPEED"][0] == pytest.approx(0x0B7A / 100)  # 0B4#000000001D0B7A5E
    assert torque.values["STEER_TORQUE_DRIVER"][0] == 0xFFFB - 0x10000  # 260#08FFFB0000001884
    assert torque.values["STEER_TORQUE_EPS"][0] == 0x0018


def test_rates_of_different_messages_come_to_one_time_base(drive):
    """Uniform at the rate of the fastest message; each value on the line between the frames around it."""
    assert drive.rate == pytest.approx(82.9, abs=0.05)
    assert drive.meta["can"]["rate_hz"] == pytest.approx(drive.rate)
    assert drive.time[0] < 0.05
    assert drive.time[-1] > 59.9
    speed = decoded()["SPEED"]
    for at in (7, 1000, 4001):
        after = np.searchsorted(speed.time, drive.time[at])
        (t0, t1), (v0, v1) = speed.time[after - 1 : after + 1], speed.values["SPEED"][after - 1 : after + 1] / 3.6
        line = v0 + (v1 - v0) * (drive.time[at] - t0) / (t1 - t0)
        assert drive["vehicle_speed"][at] == pytest.approx(line, rel=1e-12)
    for values in drive.channels.values():
        assert np.isfinite(values).all()
    told = drive.meta["can"]["messages"]
    assert told["SPEED"]["rate_hz"] == pytest.approx(41.45, abs=0.01)
    assert told["SPEED"]["gaps"] == 0
    assert told["STEER_ANGLE_SENSOR"]["longest_step_s"] == pytest.approx(0.0287, abs=1e-4)


def fit(x, y):
    """Correlation, slope, and what remains of y, root mean square."""
    slope, offset = np.polyfit(x, y, 1)
    return np.corrcoef(x, y)[0, 1], slope, np.std(y - slope * x - offset)


def test_angle_speed_yaw_rate_and_acceleration_agree_as_those_of_a_car(drive):
    """Bicycle kinematics below 0.5 Hz, within the resolution of the sensors: 0.244 deg/s and 0.036 m/s2 a count."""
    slow = drive.filtered(0.5)
    angle, speed, yaw = slow["handwheel_angle"], slow["vehicle_speed"], slow["yaw_rate"]
    lag = round(0.1 * drive.rate)  # the car's yaw follows its wheels
    by_wheels = (speed * angle / (RATIO * WHEELBASE))[:-lag]
    cases = {
        "yaw rate over speed * angle / (ratio * wheelbase)": fit(by_wheels, yaw[lag:]),
        "lateral acceleration over speed * yaw rate": fit(speed * yaw, slow["lateral_acceleration"]),
        "rate of the angle over its derivative": fit(np.gradient(angle, slow.time), slow["handwheel_speed"]),
    }
    for name, (correlation, slope, rest) in cases.items():
        print(f"{name}: correlation {correlation:.3f}, slope {slope:.3f}, rest {rest:.2g}")
    (c, k, rest), (c_y, k_y, rest_y), (c_r, k_r, _) = cases.values()
    # 1 / (1 + v^2 / v_ch^2) at 61 km/h, with a characteristic speed of 65 to 100 km/h: the car understeers
    assert c > 0.9
    assert 1 / (1 + (61 / 65) ** 2) < k < 1 / (1 + (61 / 100) ** 2)
    assert rest < 0.5 * 0.244 * DEGREE
    assert c_y > 0.85
    assert k_y == pytest.approx(1.0, abs=0.12)  # roll and the road's bank are in the sensor's reading
    assert rest_y < 1.1 * 0.036
    assert c_r > 0.8
    assert k_r == pytest.approx(1.0, abs=0.1)


def test_torque_stays_in_counts_and_its_metrics_are_refused(drive, tmp_path):
    assert drive.units["handwheel_torque"] == "counts"
    assert drive.meta["uncalibrated"] == "handwheel_torque"
    counts = decoded()["STEER_TORQUE_SENSOR"].values["STEER_TORQUE_DRIVER"]
    assert counts.min() <= drive["handwheel_torque"].min() < -100
    with pytest.raises(RefusedError, match="handwheel_torque is in counts of its sensor, uncalibrated"):
        FilteredChannels(drive, 1.0)["handwheel_torque"]  # which every metric reads
    write(drive, tmp_path / "drive.csv")
    back = read(tmp_path / "drive.csv")
    assert (back.units, back.meta) == (drive.units, drive.meta)


# Other formats, and logs that are damaged


@pytest.fixture(scope="module")
def frames():
    with can.LogReader(LOG) as reader:
        return [frame for _, frame in zip(range(2000), reader)]


def written(path, frames):
    with can.Logger(path) as logger:
        for frame in frames:
            logger.on_message_received(frame)
    return path


@pytest.mark.parametrize("suffix", [*can_log.SUFFIXES, ".csv"])
def test_every_format_gives_the_same_recording(tmp_path, frames, suffix):
    expected = read(
        LOG, mapped(*ENTRIES), can=OPTIONS._replace(until=frames[-1].timestamp - frames[0].timestamp + 1e-9)
    )
    found = read(written(tmp_path / f"drive{suffix}", frames), mapped(*ENTRIES), can=OPTIONS)
    np.testing.assert_allclose(found.time, expected.time, atol=2e-4)  # .asc and .trc round the time stamps
    for name in expected.channels:
        size = np.abs(expected[name]).max()
        np.testing.assert_allclose(found[name], expected[name], atol=0.02 * size)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # python-can leaves a bad file open
@pytest.mark.parametrize("suffix", [*can_log.SUFFIXES, ".csv"])
@pytest.mark.parametrize("part", [0.0, 0.6])
def test_a_cut_log_is_refused_with_what_can_be_read(tmp_path, frames, suffix, part):
    """In mid-frame: the sentence says how far it is whole, and that much can be read."""
    path = written(tmp_path / f"drive{suffix}", frames)
    whole = path.read_bytes()
    size = int(part * len(whole))
    if part and suffix in (".log", ".csv"):  # within the data of a frame that is wanted
        size = whole.rfind({".log": b"0B4#", ".csv": b",0xb4,"}[suffix], 0, size) + {".log": 8, ".csv": 16}[suffix]
    path.write_bytes(whole[:size])
    text = refusal(path, mapped("vehicle_speed=SPEED"), can=OPTIONS)
    if part == 0.0:
        assert "is it complete?" in text or "record it again" in text or "recordings end in" in text or "header" in text
        return
    assert "the log breaks off after" in text or "the log is cut there" in text
    if "--between 0 " in text:
        until = float(text.split("--between 0 ")[1])
        if until > 1.0:
            rest = read(path, mapped("vehicle_speed=SPEED"), can=OPTIONS._replace(until=until))
            assert rest.time[-1] == pytest.approx(until, abs=0.06)


def test_a_number_of_400_digits_is_refused_for_its_signal_alone(tmp_path):
    large = tmp_path / "large.dbc"
    large.write_text(DBC.read_text().replace("(1,0)", f"({'9' * 400},0)", 1))
    options = can_log.Options(large, until=2.0)
    assert "scale of STEER_ANGLE_SENSOR.STEER_RATE must be" in refusal(
        LOG, mapped("handwheel_speed=STEER_RATE"), can=options
    )
    assert np.isfinite(read(LOG, mapped(ANGLE), can=options)["handwheel_angle"]).all()


def test_frames_shorter_than_the_database_says_are_read_where_they_hold_the_signal(tmp_path):
    """Bytes 5 and 6 of eight have the speed; what is too short for it is told, and refused if nothing else is there."""
    path = tmp_path / "drive.log"
    whole = [f"({5 + 0.02 * k:.2f}) can0 0B4#0000000000{100 * k:04X}" for k in range(10)]
    path.write_text("\n".join([*whole[:4], "(5.07) can0 0B4#00000000", *whole[4:]]) + "\n")
    found = read(path, mapped("vehicle_speed=SPEED"), can=OPTIONS)
    np.testing.assert_allclose(found["vehicle_speed"], np.arange(10) / 3.6, atol=1e-9)
    assert "SPEED.SPEED is not in 1 frames, which are shorter than its 7 bytes" in found.meta["can"]["notes"]
    path.write_text("".join(f"({5 + 0.02 * k:.2f}) can0 0B4#00000000\n" for k in range(10)))
    assert "has 0 samples in 10 frames; it needs 7 bytes, of which they have 4" in refusal(
        path, mapped("vehicle_speed=SPEED"), can=OPTIONS
    )


def speeds(path, times, values, identifier=0xB4, bus="can0"):
    """A log of the speed [km/h]."""
    lines = [f"({5 + t:.6f}) {bus} {identifier:03X}#0000000000{round(100 * v):04X}00" for t, v in zip(times, values)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_lost_frames_are_a_gap_and_told(tmp_path):
    times = np.delete(np.arange(200) * 0.02, [60, *range(100, 104)])
    path = speeds(tmp_path / "drive.log", times, 50 + 5 * times)
    found = read(path, mapped("vehicle_speed=SPEED"), can=OPTIONS)
    gap = (found.time > 99 * 0.02 + 1e-9) & (found.time < 104 * 0.02 - 1e-9)
    np.testing.assert_array_equal(np.isnan(found["vehicle_speed"]), gap)  # one lost frame is bridged by a line
    np.testing.assert_allclose(found["vehicle_speed"][~gap], (50 + 5 * found.time[~gap]) / 3.6, atol=0.01 / 3.6)
    told = found.meta["can"]["messages"]["SPEED"]
    assert (told["frames"], told["gaps"]) == (195, 1)
    assert told["longest_step_s"] == pytest.approx(0.1)
    assert told["longest_step_at_s"] == pytest.approx(1.98)


def test_a_counter_tells_the_frames_that_are_missing(tmp_path):
    text = DBC.read_text().replace('" CAR\n\nBO_ 608', '" CAR\n SG_ COUNTER : 7|4@0+ (1,0) [0|15] "" CAR\n\nBO_ 608')
    (tmp_path / "car.dbc").write_text(text)
    lines = [f"({0.02 * k:.6f}) can0 0B4#{k % 16:01X}000000000138800" for k in range(100) if k not in (17, 50, 51)]
    (tmp_path / "drive.log").write_text("\n".join(lines) + "\n")
    found = read(tmp_path / "drive.log", mapped("vehicle_speed=SPEED"), can=can_log.Options((tmp_path / "car.dbc",)))
    assert found.meta["can"]["messages"]["SPEED"]["missed_by_counter"] == 3
    np.testing.assert_allclose(found["vehicle_speed"], 50 / 3.6)


def test_multiplexed_signals_have_the_frames_that_hold_them(tmp_path):
    """Every third frame has a multiplexer that the database does not know."""
    head, _, _ = DBC.read_text().partition("BO_ 36")
    signals = (
        "BO_ 180 SPEED: 8 CAR",
        ' SG_ KIND M : 7|8@0+ (1,0) [0|0] "" CAR',
        ' SG_ SPEED m0 : 47|16@0+ (0.01,0) [0|0] "km/h" CAR',
        ' SG_ YAW_RATE m1 : 47|16@0+ (0.01,0) [0|0] "deg/s" CAR',
    )
    (tmp_path / "car.dbc").write_text(head + "\n".join(signals) + "\n")
    lines = [f"({0.01 * k:.6f}) can0 0B4#{(0, 1, 9)[k % 3]:02X}00000000{100 * (k % 3 + 1):04X}00" for k in range(60)]
    (tmp_path / "drive.log").write_text("\n".join(lines) + "\n")
    named = mapped("vehicle_speed=SPEED", "yaw_rate=YAW_RATE")
    found = read(tmp_path / "drive.log", named, can=can_log.Options(tmp_path / "car.dbc"))
    np.testing.assert_allclose(found["vehicle_speed"], 1 / 3.6)
    np.testing.assert_allclose(found["yaw_rate"], 2 * DEGREE)
    assert found.rate == pytest.approx(100 / 3)
    assert found.meta["can"]["messages"]["SPEED"]["not_decoded"] == 20


def test_two_buses_are_not_mixed(tmp_path):
    a = speeds(tmp_path / "a.log", np.arange(50) * 0.02, np.full(50, 36.0))
    b = speeds(tmp_path / "b.log", np.arange(50) * 0.02 + 0.001, np.full(50, 72.0), bus="can1")
    path = tmp_path / "drive.log"
    path.write_text("".join(sorted((a.read_text() + b.read_text()).splitlines(keepends=True))))
    named = mapped("vehicle_speed=SPEED")
    assert "SPEED occurs on the buses can0, can1: choose one, --bus can0" in refusal(path, named, can=OPTIONS)
    for bus, speed in (("can0", 10.0), ("can1", 20.0)):
        np.testing.assert_allclose(read(path, named, can=OPTIONS._replace(bus=bus))["vehicle_speed"], speed)
    assert "no frame in the log on the bus 'can7'" in refusal(path, named, can=OPTIONS._replace(bus="can7"))


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("vehicle_speed=SPED", "no signal 'SPED'; did you mean SPEED?"),
        ("vehicle_speed=Tempo", "no signal 'Tempo'; there are YAW_RATE, ACCEL_X, ACCEL_Y, STEER"),
        (
            "handwheel_torque=STEERING_LKA.STEER_TORQUE_CMD[counts]",
            "column 'STEERING_LKA.STEER_TORQUE_CMD', wanted as handwheel_torque, is in the message STEERING_LKA "
            "(id 0x2E4), which never occurs in the log; it has 0x0B4",
        ),
        ("handwheel_torque=STEER_TORQUE_DRIVER", "STEER_TORQUE_DRIVER' names no unit; give it in a mapping"),
        ("yaw_rate=SPEED", "column 'SPEED.SPEED' is in 'km/h', yaw_rate needs 'rad/s': correct it"),
        ("yaw_rate=SPEED[deg/s]", "is in 'km/h' by the file, but in 'deg/s' by the mapping: these are of different"),
        (
            "yaw_rate=YAW_RATE + SPEED",
            "'YAW_RATE + SPEED' cannot be formed: its signals must be of one message and in one",
        ),
        ("yaw_rate=YAW_RATE + FINE", "no signal 'FINE', for 'YAW_RATE + FINE'; there are YAW_RATE"),
    ],
)
def test_databases_and_mappings_that_do_not_fit(tmp_path, entry, message):
    path = speeds(tmp_path / "drive.log", np.arange(50) * 0.02, np.full(50, 36.0))
    text = refusal(path, mapped(entry), can=OPTIONS)
    assert message in text
    assert text.startswith(f"{path} with {DBC}: ")


def test_a_name_in_two_messages_needs_that_of_its_message(tmp_path):
    text = DBC.read_text().replace("STEER_TORQUE_EPS", "STEER_ANGLE").replace("7|16@0- (1,0)", "7|16@0- (0.1,0)")
    (tmp_path / "car.dbc").write_text(text)
    options = can_log.Options((tmp_path / "car.dbc",))
    message = "did you mean STEER_ANGLE_SENSOR.STEER_ANGLE or STEER_TORQUE_SENSOR.STEER_ANGLE?"
    assert message in refusal(LOG, mapped("handwheel_angle=STEER_ANGLE"), can=options)
    assert message in refusal(LOG, mapped("handwheel_angle=STEER_ANGLE + STEER_FRACTION"), can=options)
    found = read(LOG, mapped("handwheel_angle=STEER_ANGLE_SENSOR.STEER_ANGLE"), can=options._replace(until=2.0))
    assert found["handwheel_angle"].size > 100


def test_logs_and_databases_that_cannot_be_read(tmp_path):
    path = speeds(tmp_path / "drive.log", np.arange(50) * 0.02, np.full(50, 36.0))
    assert "give the DBC that says what is in them, --dbc car.dbc" in refusal(path)
    (tmp_path / "car.dbc").write_text("BO_ 36 KINEMATICS 8\n")
    assert "car.dbc cannot be read as a CAN database: " in refusal(path, can=can_log.Options((tmp_path / "car.dbc",)))
    with pytest.raises(FileNotFoundError):
        read(path, can=can_log.Options((tmp_path / "none.dbc",)))
    with pytest.raises(ValueError, match=r"a CAN log is not written; recordings end in \.csv"):
        write(read(path, can=OPTIONS), tmp_path / "other.blf")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:20], lines[30], *lines[20:]]))
    assert "SPEED (id 0x0B4): the time goes back from 0.600000 to 0.400000 s; sort the log" in refusal(
        path, can=OPTIONS
    )


def test_without_the_extra(tmp_path, monkeypatch):
    path = speeds(tmp_path / "drive.log", np.arange(50) * 0.02, np.full(50, 36.0))
    monkeypatch.setitem(sys.modules, "cantools", None)
    assert "CAN databases need the package cantools: pip install '.[can]'" in refusal(path, can=OPTIONS)


# What a log does not say plainly

HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: A\n'
STEER = HEAD + 'BO_ 256 STEER: 8 A\n SG_ ANGLE : 0|16@1- (0.1,0) [0|0] "deg" A\n'
SIGNED = HEAD + (
    'BO_ 256 STEER: 8 A\n SG_ ANGLE : 0|13@1+ (0.1,0) [0|0] "deg" A\n SG_ ANGLE_SIGN : 13|1@1+ (1,0) [0|1] "" A\n'
    ' SG_ FINE : 16|8@1+ (0.01,0) [0|0] "deg" A\n'
)
NAMED = mapped("handwheel_angle=ANGLE")


def logged(tmp_path, database, lines, suffix=".log"):
    """A log of these lines, and the options that read it."""
    path = tmp_path / f"drive{suffix}"
    (tmp_path / "car.dbc").write_text(database)
    path.write_text("\n".join(lines))
    return path, can_log.Options(tmp_path / "car.dbc")


def angles(times, values, identifier="100"):
    """Lines of a candump log [0.1 deg]."""
    return [f"({5 + t:.6f}) can0 {identifier}#{v % 65536:04X}" for t, v in zip(times, map(swapped, values))]


def swapped(value):
    return int.from_bytes((int(value) % 65536).to_bytes(2, "little"), "big")


def test_a_range_that_most_values_are_beyond_is_told(tmp_path):
    """As that of the hand torque of Volkswagen in opendbc, which is in N m and the signal in N cm."""
    torque = 'BO_ 256 EPS: 8 A\n SG_ TORQUE : 0|10@1+ (1,0) [0|8] "Unit_centiNewtoMeter" A\n'
    path, options = logged(tmp_path, HEAD + torque, angles(0.01 * np.arange(50), np.arange(50)))
    named = mapped("handwheel_torque=TORQUE")
    found = read(path, named, can=options)
    assert np.isnan(found["handwheel_torque"]).sum() == 41
    assert "most values are beyond [0|8]; if that range is wrong, set it to [0|0]" in found.meta["can"]["notes"][0]
    path, options = logged(tmp_path, HEAD + torque.replace("0|8", "0|0"), angles(0.01 * np.arange(50), np.arange(50)))
    found = read(path, named, can=options)
    np.testing.assert_allclose(found["handwheel_torque"], 0.01 * np.arange(50), atol=1e-9)
    assert "notes" not in found.meta["can"]


def test_a_sign_in_a_signal_of_its_own(tmp_path):
    """The wheel passes straight ahead between two frames; there the line is between values with their signs."""
    truth = np.linspace(-20, 20, 50).round(1)
    raw = [round(abs(value) * 10) | (value < 0) << 13 for value in truth]
    path, options = logged(tmp_path, SIGNED, angles(0.01 * np.arange(50), raw))
    found = read(path, mapped("handwheel_angle=ANGLE,sign_from=STEER.ANGLE_SIGN"), can=options)
    np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), truth, atol=1e-6)
    assert "notes" not in found.meta["can"]
    right = read(path, mapped("handwheel_angle=ANGLE,sign=-1,sign_from=ANGLE_SIGN"), can=options)
    np.testing.assert_allclose(right["handwheel_angle"], -found["handwheel_angle"])
    bare = read(path, NAMED, can=options)
    assert bare["handwheel_angle"].min() >= 0
    assert "STEER.ANGLE is read without its sign, STEER.ANGLE_SIGN" in bare.meta["can"]["notes"][0]
    (tmp_path / "run.csv").write_text("time_s,ANGLE_deg\n0,1\n1,2\n")
    named = mapped("handwheel_angle=ANGLE[deg],sign_from=ANGLE_SIGN")
    assert "sign_from of handwheel_angle is for CAN logs" in refusal(tmp_path / "run.csv", named)


def test_the_names_of_a_sign_say_what_is_negative(tmp_path):
    truth = np.linspace(-20, 20, 50).round(1)
    raw = [round(abs(value) * 10) | (value >= 0) << 13 for value in truth]
    names = 'VAL_ 256 ANGLE_SIGN 1 "positiv_links" 0 "negativ" ;\n'
    path, options = logged(tmp_path, SIGNED + names, angles(0.01 * np.arange(50), raw))
    found = read(path, mapped("handwheel_angle=ANGLE,sign_from=ANGLE_SIGN"), can=options)
    np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), truth, atol=1e-6)


def test_what_two_databases_name_is_asked_for(tmp_path):
    lines = angles(0.01 * np.arange(50), np.full(50, 100))
    path, _ = logged(tmp_path, STEER, lines)
    other = tmp_path / "chassis.dbc"
    other.write_text(HEAD + 'BO_ 256 OTHER: 8 A\n SG_ TEMP : 0|8@1+ (1,0) [0|0] "K" A\n')
    for order in ((tmp_path / "car.dbc", other), (other, tmp_path / "car.dbc")):
        options = can_log.Options(order)
        text = refusal(path, NAMED, can=options)
        assert "id 0x100 is" in text
        assert "did you mean car:STEER.ANGLE?" in text
        found = read(path, mapped("handwheel_angle=car:STEER.ANGLE"), can=options)
        np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), 10.0)


@pytest.mark.parametrize(
    ("database", "reason"),
    [
        (STEER + STEER.removeprefix(HEAD).replace("256", "512"), "it is defined twice, in different ways"),
        (STEER.replace("(0.1,0)", "(0,0)"), "the scale of STEER.ANGLE is 0"),
    ],
)
def test_what_a_database_does_not_define_is_refused_by_name(tmp_path, database, reason):
    path, options = logged(tmp_path, database, angles(0.01 * np.arange(50), range(50)))
    assert reason in refusal(path, mapped("handwheel_angle=STEER.ANGLE"), can=options)


def test_a_doubled_stamp_is_told_and_the_last_of_its_frames_kept(tmp_path):
    times = 0.01 * np.arange(50)
    times[20] = times[21]
    path, options = logged(tmp_path, STEER, angles(times, np.arange(50)))
    found = read(path, NAMED, can=options)
    np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), 10 * found.time, atol=1e-6)
    assert found.meta["doubled_stamps"] == {"STEER": 1}


@pytest.mark.parametrize("cycle", [None, 10, 200])
def test_batches_are_spread_by_the_cycle_time(tmp_path, cycle):
    """Of the database, or of the log where that has none or a wrong one; a frame that is lost moves one batch."""
    true = np.delete(0.003 + 0.01 * np.arange(500), 217)
    stamps = np.ceil(true / 0.05) * 0.05
    text = (
        STEER
        if cycle is None
        else STEER + (f'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 1000;\nBA_ "GenMsgCycleTime" BO_ 256 {cycle};\n')
    )
    path, options = logged(tmp_path, text, angles(stamps, 1000 * true))
    found = read(path, NAMED, can=options)
    late = np.degrees(found["handwheel_angle"]) / 100 - (found.time + stamps[0])
    assert np.abs(late).max() < 0.0135  # that batch by a cycle time, all by less than half of one
    assert abs(late.mean()) < 0.005
    assert found.rate == pytest.approx(100, rel=0.01)
    assert "batches of 0.05 s; 499 frames with 100 stamps are spread by the cycle time of 0.01 s" in str(found.meta)


@pytest.mark.parametrize("apart", [1e-6, 2e-5, 3e-4])
@pytest.mark.parametrize("frames", [2, 3, 5, 10])
def test_batches_whose_frames_are_stamped_one_by_one(tmp_path, frames, apart):
    """As a computer stamps what an adapter hands over in one go; a jitter of the sender is no batch."""
    true = 0.01 * np.arange(600)
    stamps = np.array([(k // frames + 1) * 0.01 * frames + k % frames * apart for k in range(600)])
    path, options = logged(tmp_path, STEER, angles(stamps, 1000 * true))
    found = read(path, NAMED, can=options)
    late = np.degrees(found["handwheel_angle"]) / 100 - found.time
    assert np.ptp(late) < frames * apart + 1e-3  # all frames are late alike
    assert found.rate == pytest.approx(100, rel=1e-3)
    assert f"frames with {600 // frames} stamps are spread by the cycle time of 0.01 s" in str(found.meta)
    jitter = np.random.default_rng(1).uniform(0, 0.009, 600)
    path, options = logged(tmp_path, STEER, angles(true + 5 * (true > 3) + jitter, 1000 * true))
    assert "notes" not in read(path, NAMED, can=options).meta["can"]


def test_a_log_of_one_time_stamp_is_refused(tmp_path):
    path, options = logged(tmp_path, STEER, angles(np.zeros(50), range(50)))
    assert "has 50 samples in 50 frames, all with one time stamp" in refusal(path, NAMED, can=options)


def test_messages_of_batches_keep_the_order_of_their_frames(tmp_path):
    """Two messages of unlike cycle times that are sent together come half the cycle of the faster one apart at most."""
    database = STEER + 'BO_ 257 SLOW: 8 A\n SG_ TORQUE : 0|16@1- (0.1,0) [0|0] "Nm" A\n'
    true = 0.01 * np.arange(1000)
    value = np.round(1000 * np.sin(true))
    fast = angles(np.floor(true / 0.05 + 1e-9) * 0.05, value)
    slow = angles(np.floor(true / 0.05 + 1e-9) * 0.05, value, "101")
    lines = [line for k, pair in enumerate(zip(fast, slow)) for line in pair[: 2 - (k % 5 > 0)]]
    path, options = logged(tmp_path, database, lines)
    found = read(path, mapped("handwheel_angle=ANGLE", "handwheel_torque=TORQUE"), can=options)
    most = 0.005 * 100 + 0.1  # of the steepest slope, and of counts and straight lines
    np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), found["handwheel_torque"], atol=most)
    told = "the time between frames of SLOW and those of STEER is known to within 0.005 s"
    assert told in found.meta["can"]["notes"][-1]
    assert found.meta["timing_error_s"] == [{"channels": ["handwheel_torque"], "seconds": pytest.approx(0.005)}]


MOTION = HEAD + (
    'BO_ 256 EPS: 8 A\n SG_ ANGLE : 0|32@1- (1e-7,0) [0|0] "deg" A\n SG_ TORQUE : 32|32@1- (1e-7,0) [0|0] "Nm" A\n'
    'BO_ 257 ESP: 8 A\n SG_ AY : 0|32@1- (1e-7,0) [0|0] "m/s2" A\n SG_ YAW : 32|32@1- (1e-7,0) [0|0] "deg/s" A\n'
)
ALL = ("handwheel_angle=ANGLE", "handwheel_torque=TORQUE", "lateral_acceleration=AY", "yaw_rate=YAW")


def weave_at(time):
    """Angle [deg], torque [N m], lateral acceleration [m/s2] and yaw rate [deg/s] of a weave, (4, T)."""
    steer = 2 * np.pi * 0.2 * time
    torque = 2.3 * np.tanh(np.sin(steer - 0.05)) + 0.35 * np.tanh(6 * np.cos(steer))
    return np.array([14 * np.sin(steer), torque, 2 * np.sin(steer - 0.2), 4.6 * np.sin(steer - 0.12)])


@pytest.mark.parametrize("batch", [0.02, 0.05])
def test_intervals_of_a_log_of_batches_hold_the_truth(tmp_path, batch):
    """Messages of 100 and 50 Hz whose instants nobody knows, with lost frames: the truth is that of 1 kHz."""
    dense = np.arange(0, 60, 1e-3)
    truth = dict(zip(UNITS, weave_at(dense)))
    truth |= {name: np.radians(truth[name]) for name in ("handwheel_angle", "yaw_rate")}
    test = {"manoeuvre": "weave", "speed_m_s": 27.8}
    expected = metrics.evaluate(Recording(dense, truth, UNITS, test))
    held = []
    for seed in range(12):
        draw = np.random.default_rng(seed)
        frames = []
        for identifier, cycle in ((0, 0.01), (1, 0.02)):
            sent = draw.uniform(0, cycle) + np.arange(0, 60 - cycle, cycle * (1 + draw.uniform(-5e-5, 5e-5)))
            sent = sent[draw.uniform(size=sent.size) > 0.001]
            words = np.round(1e7 * weave_at(sent)[2 * identifier : 2 * identifier + 2]).astype("<i4")
            frames += [(t, identifier, word.tobytes().hex()) for t, word in zip(sent, words.T)]
        lines = [f"({5 + np.ceil(t / batch) * batch:.6f}) can0 10{k}#{data}" for t, k, data in sorted(frames)]
        path, options = logged(tmp_path, MOTION, lines)
        found = metrics.evaluate(read(path, mapped(*ALL, **test), can=options).bridged())
        for name, value in ((name, each.value) for name, each in expected.items() if not each.reason):
            slack = 5e-4 * abs(value)  # of the straight lines between frames
            held.append(found[name].low - slack <= value <= found[name].high + slack)
    assert len(held) > 150
    assert np.mean(held) >= 0.95


def test_messages_that_share_stamps_are_known_to_within_a_batch(tmp_path):
    """As one frame of each message stands in a batch; a log of stamps of their own says nothing of that."""
    slow = 'BO_ 257 SLOW: 8 A\n SG_ TORQUE : 0|16@1- (0.1,0) [0|0] "Nm" A\n'
    both = mapped("handwheel_angle=ANGLE", "handwheel_torque=TORQUE")
    times = 0.02 * np.arange(200)
    for apart, told in ((0.0, [{"channels": ["handwheel_torque"], "seconds": pytest.approx(0.02)}]), (0.003, None)):
        pairs = zip(angles(times, range(200)), angles(times + apart, range(200), "101"))
        path, options = logged(tmp_path, STEER + slow, [line for pair in pairs for line in pair])
        found = read(path, both, can=options)
        assert found.meta.get("timing_error_s") == told
        assert ("notes" in found.meta["can"]) == bool(told)


def test_what_a_recording_says_of_its_timing_widens_intervals():
    """By its channels alone, or of all by one number; a bound of the user goes before it."""
    weave = made_weave()
    test = {"manoeuvre": "weave", "speed_m_s": 27.8}

    def width(timing=None, **meta):
        value = metrics.evaluate(replace(weave, meta={**test, **meta}), timing=timing)["yaw_lag"]
        return value.high - value.low

    told = [{"channels": ["yaw_rate", "not_there"], "seconds": 0.005}]
    assert width(timing_error_s=told) == pytest.approx(width() + 10.0, rel=0.01)  # ms
    assert width(timing_error_s=0.005) == pytest.approx(width(0.005))
    assert width(0.0, timing_error_s=told) == width()
    for wrong in ([5], "much", -1.0, [{"channels": ["yaw_rate"], "seconds": -1.0}]):
        with pytest.raises(ValueError, match="timing_error_s"):
            width(timing_error_s=wrong)


def test_relative_stamps_of_an_asc_log_add_up(tmp_path):
    """Those of lines that are no frames, too."""
    frame = "   {} 1  100             Rx   d 8 {:02X} 00 00 00 00 00 00 00"
    lines = ["date Thu Jan 1 10:00:00.000 am 2026", "base hex  timestamps relative", "internal events logged"]
    for k in range(100):
        lines += [frame.format("0.006000", k), "   0.004000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.0%"]
    lines.append("")
    path, options = logged(tmp_path, STEER, lines, ".asc")
    found = read(path, NAMED, can=options)
    np.testing.assert_allclose(found.time, 0.01 * np.arange(100), atol=1e-9)
    np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), 0.1 * np.arange(100), atol=1e-9)


def test_the_time_between_blocks_of_relative_stamps_is_not_known(tmp_path):
    frame = "   0.010000 1  100             Rx   d 2 10 00"
    block = ["Begin Triggerblock Mon Sep 30 15:06:{:02}.000 2026", "   0.000000 Start of measurement", *[frame] * 30]
    lines = ["base hex  timestamps relative", block[0].format(1), *block[1:], "End TriggerBlock"]
    path, options = logged(tmp_path, STEER, [*lines, ""], ".asc")
    assert read(path, NAMED, can=options)["handwheel_angle"].size == 30
    path, options = logged(tmp_path, STEER, [*lines, block[0].format(40), *block[1:], ""], ".asc")
    text = refusal(path, NAMED, can=options)
    assert "another trigger block begins, and relative stamps do not say when" in text
    until = float(text.split("--between 0 ")[1])
    assert read(path, NAMED, can=options._replace(until=until))["handwheel_angle"].size == 29


@pytest.mark.parametrize(
    ("lines", "suffix"),
    [
        (angles(0.01 * np.arange(50), range(50)), ".log"),
        ([f"   {0.01 * k:.6f} 1  100  Rx   d 2 {k:02X} 00" for k in range(50)], ".asc"),
        ([";$FILEVERSION=1.1", *(f"{k})  {10.0 * k:.1f}  Rx  0100  2  {k:02X} 00" for k in range(50))], ".trc"),
    ],
)
def test_a_last_line_needs_no_end_if_it_is_a_whole_frame(tmp_path, lines, suffix):
    path, options = logged(tmp_path, STEER, lines, suffix)
    assert read(path, NAMED, can=options)["handwheel_angle"].size == 50
    for cut in (1, 2):
        path.write_text("\n".join(lines)[:-cut])
        assert "the log breaks off after" in refusal(path, NAMED, can=options)


def test_a_message_of_j1939_comes_from_the_source_that_there_is(tmp_path):
    database = STEER.replace("256", str(0x18F009FE | 1 << 31))
    one, two = (angles(0.01 * np.arange(50) + 0.001 * k, range(50), f"18F009{k:02X}") for k in (11, 19))
    path, options = logged(tmp_path, database, one)
    found = read(path, NAMED, can=options)
    np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), 0.1 * np.arange(50), atol=1e-6)
    assert "comes from the source address 0x0B (0x18F0090B)" in found.meta["can"]["notes"][0]
    path, options = logged(tmp_path, database, sorted(one + two))
    assert "comes from 0x0B (0x18F0090B), 0x13 (0x18F00913), not from 0xFE" in refusal(path, NAMED, can=options)
    path, options = logged(tmp_path, database, sorted(two + angles(0.01 * np.arange(50), range(50), "18F009FE")))
    assert "notes" not in read(path, NAMED, can=options).meta["can"]
    foreign = STEER.replace("256", str(0x12DD5455 | 1 << 31))  # the extended data page is of no message of J1939
    path, options = logged(tmp_path, foreign, angles(0.01 * np.arange(50), range(50), "12DD5456"))
    assert "never occurs in the log; it has 0x12DD5456" in refusal(path, NAMED, can=options)


def test_an_identifier_of_the_other_kind_is_told(tmp_path):
    path, options = logged(tmp_path, STEER, angles(0.01 * np.arange(50), range(50), "00000100"))
    assert "never occurs with a standard identifier; it is there as an extended one" in refusal(
        path, NAMED, can=options
    )


@needs("asammdf")
@pytest.mark.parametrize("extended", [0, 1])
def test_raw_frames_of_an_mdf_file_are_decoded(tmp_path, extended):
    """Frames shorter than the database says, in two groups of one bus; without a database the file is refused."""
    import asammdf

    fields = {"BusChannel": "u1", "ID": "<u4", "IDE": "u1", "DLC": "u1", "DataLength": "u1", "DataBytes": ("u1", (8,))}
    path = tmp_path / "drive.mf4"
    with asammdf.MDF(version="4.10") as mdf:
        for part in range(2):
            frames = np.zeros(
                100,
                dtype=[
                    (f"CAN_DataFrame.{name}", *np.atleast_1d(np.array(kind, dtype=object)))
                    for name, kind in fields.items()
                ],
            )
            frames["CAN_DataFrame.ID"], frames["CAN_DataFrame.IDE"] = 256, extended
            frames["CAN_DataFrame.DataLength"] = frames["CAN_DataFrame.DLC"] = 2
            values = (np.arange(part, 200, 2) - 100).astype("<i2")
            frames["CAN_DataFrame.DataBytes"][:, :2] = values.view(np.uint8).reshape(-1, 2)
            mdf.append(asammdf.Signal(frames, 0.01 * np.arange(part, 200, 2), name="CAN_DataFrame"))
        mdf.save(path)
    (tmp_path / "car.dbc").write_text(STEER.replace("256", str(256 | extended << 31)))
    found = read(path, NAMED, can=can_log.Options(tmp_path / "car.dbc"))
    np.testing.assert_allclose(found.time, 0.01 * np.arange(200), atol=1e-9)
    np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), 0.1 * (np.arange(200) - 100), atol=1e-9)
    assert "give the DBC that says what is in them" in refusal(path, NAMED)
    cut = tmp_path / "cut.mf4"
    cut.write_bytes(path.read_bytes()[:500])
    assert "cut.mf4" in refusal(cut, NAMED, can=can_log.Options(tmp_path / "car.dbc"))


# The command line


def test_options_of_can_logs(tmp_path, capsys):
    (tmp_path / "run.csv").write_text("time_s,yaw_rate_deg_s\n0,1\n1,2\n")
    command = ["evaluate", str(tmp_path / "run.csv"), "--manoeuvre", "weave"]
    assert main([*command, "--dbc", str(DBC)]) == 2
    assert "--dbc is for CAN logs (.blf, .asc," in capsys.readouterr().err
    cut = tmp_path / "cut.log"
    cut.write_bytes(gzip.decompress(LOG.read_bytes())[:100_000])
    command = ["evaluate", str(cut), "--dbc", str(DBC), "--map", "yaw_rate=YAW_RATE", "--manoeuvre", "weave"]
    assert main(command) == 2
    error = capsys.readouterr().err
    assert "the log breaks off after 2561 whole frames" in error
    assert main([*command, "--between", *error.split("--between ")[1].split()]) == 1  # read, without a metric


def test_a_template_lists_what_the_log_has_and_is_a_mapping(tmp_path, capsys):
    out = tmp_path / "map.toml"
    command = ["evaluate", str(LOG), "--dbc", str(DBC), "--template", str(out)]
    assert main(command) == 0
    (section,) = (part for part in out.read_text().split("\n\n") if part.startswith("[channels.vehicle_speed]"))
    out.write_text("\n".join(line.removeprefix("# ") for line in section.splitlines() if '"m/s"' not in line))
    assert set(read(LOG, out, can=OPTIONS).channels) == {"vehicle_speed"}
    capsys.readouterr()
    assert main(command) == 2
    assert "map.toml exists already: name another file, or remove it" in capsys.readouterr().err
