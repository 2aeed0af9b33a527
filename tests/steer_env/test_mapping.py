"""Mappings: what a file and its compact form say, and what they are refused for."""

import re

import pytest

from steer_env.recording.channel_mapping import KNOWN, Entry, Mapping, load, parse_entry
from steer_env.vehicle import cars, plant


def test_every_channel_of_both_chassis_is_known():
    for chassis in ("single_track", "two_track"):
        assert set(plant.channels(cars.load().plant(chassis=chassis))) <= set(KNOWN.items())
    assert KNOWN["vehicle_speed"] == "m/s"


def test_a_file(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(
        """
        [channels.handwheel_angle]
        from = "SteeringWheelAngle"
        unit = "deg"
        sign = -1
        delay_ms = 10
        offset = 0.3
        [channels.yaw_rate]
        [channels.own_tie_rod_force]
        from = "F1"
        unit = "kN"
        [channels.time]
        from = "Stamp"
        unit = "ms"
        [meta]
        vehicle = "ours"
        speed_m_s = 27.8
        """
    )
    assert load(path) == Mapping(
        {
            "handwheel_angle": Entry("handwheel_angle", "SteeringWheelAngle", "deg", -1.0, 0.01, 0.3),
            "yaw_rate": Entry("yaw_rate", "yaw_rate", None),
            "own_tie_rod_force": Entry("own_tie_rod_force", "F1", "kN"),
            "time": Entry("time", "Stamp", "ms"),
        },
        {"vehicle": "ours", "speed_m_s": 27.8},
    )


def test_entries_go_over_those_of_a_file():
    first, other, again = parse_entry("yaw_rate=r"), parse_entry("x=X"), parse_entry("yaw_rate=gyro")
    merged = Mapping(meta={"vehicle": "ours"}).with_entries([first, other]).with_entries([again])
    assert merged == Mapping({"yaw_rate": again, "x": other}, {"vehicle": "ours"})


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "yaw_rate=ESP.Rate[deg/s],sign_from=ESP.Rate_VZ",
            Entry("yaw_rate", "ESP.Rate", "deg/s", sign_from="ESP.Rate_VZ"),
        ),
        (
            "handwheel_angle=SteeringWheelAngle[deg],sign=-1,delay_ms=10",
            Entry("handwheel_angle", "SteeringWheelAngle", "deg", -1.0, 0.01),
        ),
        (" yaw_rate = Gyro z [deg/s] , offset = 0.3 ", Entry("yaw_rate", "Gyro z", "deg/s", 1.0, 0.0, 0.3)),
        ("yaw_rate=imu[3][°/s]", Entry("yaw_rate", "imu[3]", "°/s")),
        ("yaw_rate=a=b,sign=1", Entry("yaw_rate", "a=b", None)),
        ("yaw_rate=,sign=-1", Entry("yaw_rate", "yaw_rate", None, -1.0)),
        ("own_tie_rod_force=F1,unit=kN", Entry("own_tie_rod_force", "F1", "kN")),
        ("time=Stamp[ms]", Entry("time", "Stamp", "ms")),
        ("handwheel_torque=T[counts],scale=2", Entry("handwheel_torque", "T", "counts", scale=2.0)),
    ],
)
def test_the_compact_form(text, expected):
    assert parse_entry(text) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("yaw_rate", "expected NAME=NAME_IN_FILE[unit],sign=-1,delay_ms=10,offset=0.3,scale=1.02; got 'yaw_rate'"),
        ("yaw_rate=Gyro,sign", "expected each of key=value once (unit, sign, delay_ms, offset, scale, sign_from), got"),
        ("yaw_rate=Gyro,gain=2", "channels.yaw_rate has no key 'gain'; it takes from, unit, sign, delay_ms, offset"),
        ("yaw_rate=Gyro,sign=2", "channels.yaw_rate.sign must be 1 or -1, got 2.0"),
        ("yaw_rate=Gyro,delay_ms=soon", "channels.yaw_rate.delay_ms must be a number, got 'soon'"),
        ("yaw_rate=Gyro,offset=nan", "channels.yaw_rate.offset must be finite, got nan"),
        ("yaw_rate=Gyro[furlong]", "channels.yaw_rate.unit 'furlong' is not known; known are deg, deg/s"),
        ("yaw_rate=Gyro[deg]", "channels.yaw_rate.unit 'deg' does not fit yaw_rate, which is kept in 'rad/s'"),
        ("handwheel_angel=SWA", "no channel is known as 'handwheel_angel', did you mean handwheel_angle or"),
        ("tie_rod_force=F1[kN]", "did you mean rack_force? (a channel of your own begins with own_ and has a unit)"),
        (
            "handwheel_torque=T[Nm],scale=0",
            "channels.handwheel_torque.scale must be finite and greater than 0, got 0.0",
        ),
        ("qqq=SWA", "no channel is known as 'qqq', there are handwheel_angle, handwheel_speed,"),
        ("time=Stamp[ms],delay_ms=3", "channels.time has no key 'delay_ms'; it takes from, unit"),
        ("time=Stamp[deg]", "channels.time.unit 'deg' does not fit time, which is kept in 's'"),
    ],
)
def test_what_the_compact_form_refuses(text, message):
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        parse_entry(text)
    assert repr(text) in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[channel.yaw_rate]\n", "no section 'channel' in a mapping; it takes [channels.NAME] and [meta]"),
        ("channels = 3\n", "channels must hold keys and values, got 3"),
        (
            "[channels]\nyaw_rate = 'r'\n",
            "channels.yaw_rate must hold keys and values (from, unit, sign, delay_ms, off",
        ),
        ("[channels.yaw_rate]\nfrom = 3\n", "channels.yaw_rate.from must be text, got 3"),
        ("[channels.yaw_rate]\nsign = true\n", "channels.yaw_rate.sign must be 1 or -1, got True"),
        ("[meta]\nwhen = 2020-01-01\n", "meta 'when' is datetime.date(2020, 1, 1); allowed are text, numbers, true"),
        ("[meta]\n'a:b' = 1\n", "meta key 'a:b' must be a single line without a colon"),
        ("[channels.yaw_rate\n", "line 1"),
        (b"[meta]\nvehicle = '\xff'\n", "expected text in UTF-8"),
    ],
)
def test_what_a_file_is_refused_for(tmp_path, text, message):
    path = tmp_path / "map.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ")
