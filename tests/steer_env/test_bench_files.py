"""Tables as test benches write them: free comments, rows of units, UTF-16, decimal commas, channels without a value."""

import dataclasses

import numpy as np
import pytest

from steer_env.recording.files import read, write
from steer_env.recording.recording import DEGREE, Recording
from tests.steer_env.recorded import mapped, refusal

UNITS = {"handwheel_angle": "rad", "handwheel_torque": "N m", "lateral_acceleration": "m/s2", "yaw_rate": "rad/s"}


@pytest.fixture
def weave():
    time = np.arange(1001) / 100
    wave = np.sin(2 * np.pi * 0.5 * time)
    return Recording(time, dict(zip(UNITS, (0.3 * wave, 3.0 * wave, 2.0 * wave, 0.1 * wave))), UNITS)


BENCH = {
    "a comment without a colon": "# Bench 3\n# driver: A\n# checked, signed\nTime [s],SWA [deg]\n0,-90.5\n0.5,90\n",
    "units under the header": "Time,SWA\ns,deg\n0,-90.5\n0.5,90\n",
    "units in brackets under the header": "Time;SWA\n[s];[deg]\n0,0;-90,5\n0,5;90,0\n",
    "units under a header that has them": "Time [s],SWA_deg\ns,deg\n0,-90.5\n0.5,90\n",
    "units in quotation marks": '"Time","SWA","v_1"\n"s","deg","km/h"\n0,-90.5,36\n0.5,90,72\n',
    "a unit that is a number": "\nTime,SWA,ratio\ns,deg,1\n0,-90.5,1\n0.5,90,2\n",
    "units for some": "Time,SWA,Status\ns,deg,\n0,-90.5,1\n0.5,90,2\n",
    "decimal commas between tabs": "Time [s]\tSWA [deg]\n0,0\t-90,5\n0,5\t90,0\n",
    "decimal commas and no others": "Time [s];SWA [deg]\n0,00;-90,50\n0,50;90,00\n",
}


@pytest.mark.parametrize("case", BENCH)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_table_of_a_test_bench(tmp_path, case, encoding):
    path = tmp_path / "run.csv"
    path.write_bytes(BENCH[case].encode(encoding))
    found = read(path)
    np.testing.assert_allclose(found.time, [0.0, 0.5])
    np.testing.assert_allclose(found["SWA"], [-90.5 * DEGREE, np.pi / 2])
    if case == "a comment without a colon":
        assert found.meta == {"comment": "Bench 3\nchecked, signed", "driver": "A"}
        write(found, path)
        assert read(path).meta == found.meta
    if case == "units in quotation marks":
        np.testing.assert_allclose(found["v_1"], [10.0, 20.0])
    if case == "units for some":
        assert found.meta == {"not_read": "Status"}


def test_utf_16_of_either_byte_order_is_read(tmp_path):
    path = tmp_path / "run.csv"
    for mark, encoding in ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        path.write_bytes(mark + "# Prüfstand: Süd\nTime [s];SWA [°]\r\n0;1\r\n1;2\r\n".encode(encoding))
        assert read(path).meta == {"Prüfstand": "Süd"}
        np.testing.assert_allclose(read(path)["SWA"], [DEGREE, 2 * DEGREE])
    path.write_bytes(b"\xff\xfe" + "Time [s];SWA [deg]\n0;1\n1;2\n".encode("utf-16-le")[:-3])
    assert "line 3 holds bytes that are not utf-16-le: is it complete?" in refusal(path)


@pytest.mark.parametrize("suffix", [".csv", ".mat", ".mf4"])
def test_a_channel_without_a_number_is_kept_out(weave, tmp_path, suffix):
    """The others are read, and the meta names it; where nothing is left the file is refused."""
    path = tmp_path / f"run{suffix}"
    empty = dataclasses.replace(weave, channels={**weave.channels, "yaw_rate": np.full(weave.time.size, np.nan)})
    write(empty, path)
    for found in (read(path), read(path, mapped("handwheel_angle=handwheel_angle"))):
        assert "yaw_rate" not in found.channels
        assert len(found.channels) == 3
        assert found.meta["not_read"].startswith("yaw_rate")
        assert found.meta["not_read"].endswith("(no values)")
        assert found.bridged().time.size == weave.time.size


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "Time [s],SWA [deg]\ns,rad\n0,1\n1,2\n",
            "line 2, column 'SWA [deg]': the row of units says 'rad', the header says 'deg': correct one of them",
        ),
        ("Time,SWA\ns,furlong\n0,1\n1,2\n", "none of the columns SWA can be read"),
        ("Time [s],SWA [deg]\n0,x\ns,deg\n", "line 2, column 'SWA [deg]': expected a number, got 'x'"),
    ],
)
def test_rows_of_units_that_are_refused(tmp_path, text, message):
    path = tmp_path / "run.csv"
    path.write_text(text)
    assert message in refusal(path)
