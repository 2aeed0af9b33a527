"""Tables as test benches write them: comments, preambles, rows of units, UTF-16, decimal commas, time without unit."""

import dataclasses
from itertools import cycle

import numpy as np
import pytest
from scipy import io

from steer_env.recording.files import read, write
from steer_env.recording.recording import DEGREE
from tests.needs import needs
from tests.steer_env.recorded import made_weave, mapped, refusal

weave = pytest.fixture(made_weave)
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


@pytest.mark.parametrize(("case", "encoding"), list(zip(BENCH, cycle(["utf-8", "utf-16"]))))
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


@pytest.mark.parametrize("suffix", [".csv", ".mat", pytest.param(".mf4", marks=needs("asammdf"))])
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


@pytest.mark.parametrize("name", ["time", "t", "Time", "T"])
def test_a_time_without_a_unit_is_in_seconds_and_told(name, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(f"{name},yaw_rate_deg_s\n0.00,0\n0.01,1\n0.02,0\n")
    found = read(path)
    np.testing.assert_allclose(found.time, [0.0, 0.01, 0.02])
    assert found.meta == {"seconds_assumed": name}
    assert read(path, mapped(f"time={name}")).meta == found.meta
    in_ms = read(path, mapped(f"time={name}[ms]"))
    np.testing.assert_allclose(in_ms.time, [0.0, 1e-5, 2e-5])
    assert in_ms.meta == {}


def test_a_matlab_file_too(tmp_path):
    io.savemat(tmp_path / "run.mat", {"time": np.arange(3) / 100, "yaw_rate_deg_s": np.arange(3.0)})
    found = read(tmp_path / "run.mat")
    assert found.time[1] == 0.01
    assert found.meta == {"seconds_assumed": "time"}


def test_steps_that_are_no_seconds_and_other_units_are_refused(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time,yaw_rate_deg_s\n0,0\n10,1\n20,0\n")
    text = refusal(path)
    assert "column 'time' names no unit, and its steps of 10 are too long for seconds" in text
    assert '[channels.time] from = "time", unit = "ms" (or "us", "s")' in text
    assert read(path, mapped("time=time[s]")).time[1] == 10.0
    path.write_text("Stamp,yaw_rate_deg_s\n0,0\n0.01,1\n")
    assert refusal(path, mapped("time=Stamp")).endswith("with one of s, ms, us")
    path.write_text("time_s,yaw_rate\n0,0\n0.01,1\n")
    allowed = refusal(path).rpartition("with one of ")[2].split(", ")
    assert {"deg/s", "rad/s", "counts"} <= set(allowed)
    assert not {"N", "m", "deg", "kW"} & set(allowed)


PREAMBLE = "Prüfstand: Fahrversuch 12\nDatum: 01.02.2026; Fahrer: A, B\n\n"


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
@pytest.mark.parametrize(
    "table",
    [
        "Zeit;Gierrate;Status\ns;°/s;-\n0,0;1,5;\n0,01;2,5;1\n",
        "Zeit [s];Gierrate [°/s];Status;\n0,0;1,5;;\n0,01;2,5;1;\n",
        "t,Gierrate [deg/s]\n0.0,1.5\n0.01,2.5\n",
    ],
)
def test_a_preamble_is_kept_as_a_comment(table, encoding, tmp_path):
    path = tmp_path / "run.csv"
    path.write_bytes(("# manoeuvre: weave\n# Bench 3\n" + PREAMBLE + table).encode(encoding))
    found = read(path)
    np.testing.assert_allclose(found["Gierrate"], np.radians([1.5, 2.5]))
    np.testing.assert_allclose(found.time, [0.0, 0.01])
    assert found.meta["manoeuvre"] == "weave"
    assert found.meta["comment"] == "\n".join(["Bench 3", *PREAMBLE.split("\n")[:2]])


@pytest.mark.parametrize(
    "text",
    [
        PREAMBLE + "Stamp;Gierrate [°/s]\n0,0;1,5\n0,01;2,5\n",  # names no time
        PREAMBLE + "Zeit [s];Gierrate [°/s]\nnull;eins\n0,0;1,5\n0,01;2,5\n",  # no numbers under it
        PREAMBLE + "Zeit [s];Gierrate [°/s]\n0,0\n0,01;2,5\n",  # a row that is too short
        "Bench\n" * 50 + "Zeit [s];Gierrate [°/s]\n0,0;1,5\n0,01;2,5\n",
    ],
)
def test_what_is_no_preamble_is_refused(text, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(text)
    assert "no time among the columns" in refusal(path)


def test_fifty_lines_are_looked_at(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("Bench\n" * 49 + "Zeit [s];Gierrate [°/s]\n0,0;1,5\n0,01;2,5\n")
    assert read(path).time[1] == 0.01
