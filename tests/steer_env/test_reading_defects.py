"""Every reader does the same with one defect: the table of docs/recordings.md, and pairs of file and truth."""

import gzip
from pathlib import Path

import asammdf
import numpy as np
import pyarrow
import pytest
from asammdf.blocks.conversion_utils import from_dict
from pyarrow import parquet
from scipy.io import savemat

from steer_env.recording import mapping_template
from steer_env.recording.can_log import Options
from steer_env.recording.files import read
from tests.steer_env.recorded import mapped, refusal
from tests.steer_env.test_matlab_v73_and_parquet import matlab

FORMATS = ("csv", "mat", "mat73", "mf4", "parquet")
SIZE = 50
DBC = 'VERSION ""\nBU_: ECU\nBO_ 256 EPS: 8 ECU\n SG_ SWA : 0|16@1- (0.01,0) [0|0] "deg" ECU\n'


def written(folder, form, time, columns, time_name="time_s"):
    """A file with columns of numbers or texts by label, whose unit is in brackets."""
    path = folder / f"run.{form.replace('73', '')}"
    labels = [time_name, *columns]
    if form == "csv":
        rows = zip(time, *columns.values())
        path.write_text("\n".join([",".join(labels), *(",".join(map(str, row)) for row in rows)]) + "\n")
    elif form == "parquet":
        parquet.write_table(pyarrow.table([list(time), *map(list, columns.values())], names=labels), path)
    elif form == "mf4":
        signals = [
            asammdf.Signal(
                np.array(values, dtype="S" if isinstance(values[0], str) else float),
                np.array(time, dtype=float),
                name=label.partition(" ")[0],
                unit=label.partition("[")[2].rstrip("]"),
                encoding="utf-8" if isinstance(values[0], str) else None,
            )
            for label, values in columns.items()
        ]
        with asammdf.MDF(version="4.10") as file:
            for signal in signals:
                file.append([signal])
            file.save(path, overwrite=True)
    else:
        plain = {label.replace(" [", "_").replace("/", "_").rstrip("]"): v for label, v in columns.items()}
        content = {time_name: np.array(time), **{label: np.array(values) for label, values in plain.items()}}
        if form == "mat73":
            matlab(path, {label: values for label, values in content.items() if values.dtype.kind == "f"})
        else:
            savemat(path, content)
    return path


def told(recording, key):
    """What the meta counts, without the names of columns."""
    return [*recording.meta.get(key, {}).values()]


TIME = np.arange(SIZE) / 100
SWA = np.sin(TIME)


def doubled(folder, form):
    time = TIME.copy()
    time[20] = time[19]
    found = read(written(folder, form, time, {"SWA [rad]": SWA}))
    np.testing.assert_array_equal(found.time, np.delete(time, 19))
    np.testing.assert_array_equal(found["SWA"], np.delete(SWA, 19))
    assert told(found, "doubled_stamps") == [1]


def goes_back(folder, form):
    time = TIME.copy()
    time[20] = 0.0123
    assert "0.0123" in refusal(written(folder, form, time, {"SWA [rad]": SWA}))


def in_blocks(folder, form):
    time = np.floor(np.arange(SIZE) / 5) / 20
    message = "40 of 50 samples of .* have the time stamp of another"
    with pytest.raises(ValueError, match=message):
        read(written(folder, form, time, {"SWA [rad]": SWA}))


def empty(folder, form):
    values = SWA.copy()
    values[[7, 8]] = np.nan
    found = read(written(folder, form, TIME, {"SWA [rad]": values}))
    np.testing.assert_array_equal(found["SWA"], values)
    assert told(found, "no_value") == [{"empty": 2}]


def infinite(folder, form):
    values = SWA.copy()
    values[[7, 8, 9]] = np.inf, -np.inf, np.nan
    found = read(written(folder, form, TIME, {"SWA [rad]": values}))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found["SWA"])), [7, 8, 9])
    assert told(found, "no_value") == [{"infinite": 2, "empty": 1}]


def texts(folder, form):
    path = written(folder, form, TIME, {"SWA [rad]": SWA, "Status": ["ok", "bad"] * (SIZE // 2)})
    found = read(path)
    assert set(found.channels) == {"SWA"}
    assert found.meta["not_read"] == "Status"
    assert "column 'Status', wanted as own_status, holds no" in refusal(path, mapped("own_status=Status[1]"))


def no_unit(folder, form):
    path = written(folder, form, TIME, {"SWA [rad]": SWA, "yaw": SWA})
    assert read(path).meta["not_read"] == "yaw"
    assert "column 'yaw' names no unit; give it in a mapping" in refusal(path, mapped("yaw_rate=yaw"))


def unknown_unit(folder, form):
    path = written(folder, form, TIME, {"SWA [rad]": SWA, "yaw [furlong]": SWA})
    assert read(path).meta["not_read"].startswith("yaw")
    source = "yaw_furlong" if form.startswith("mat") else "yaw"
    assert "give it in a mapping" in refusal(path, mapped(f"yaw_rate={source}"))


def no_time(folder, form):
    path = written(folder, form, TIME, {"SWA [rad]": SWA}, "Stamp")
    assert "no time among the columns" in refusal(path)


def one_sample(folder, form):
    refusal(written(folder, form, TIME[:1], {"SWA [rad]": SWA[:1]}))


def cut(folder, form):
    path = written(folder, form, TIME, {"SWA [rad]": SWA})
    whole = path.read_bytes()
    if form == "csv":
        path.write_bytes(whole[: whole.rfind(b",")])
        assert "line 51, column 'SWA [rad]': expected 2 values" in refusal(path)
    else:
        path.write_bytes(whole[: len(whole) // 2])
        assert "is it complete?" in refusal(path)


def codes(folder, form):
    values = list(SWA)
    if form == "csv":
        values[7:9] = "Invalid", "Invalid"
        path = written(folder, form, TIME, {"SWA [rad]": values})
    else:
        raw, conversion = (
            np.arange(SIZE, dtype="u1"),
            {"val_0": 7, "text_0": "Invalid", "val_1": 8, "text_1": "Invalid"},
        )
        conversion = from_dict({**conversion, "default_addr": {"a": 0.5, "b": 0.0}})
        path = folder / "run.mf4"
        with asammdf.MDF(version="4.10") as file:
            file.append([asammdf.Signal(raw, TIME, name="SWA", unit="rad", conversion=conversion)])
            file.save(path, overwrite=True)
    found = read(path)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found["SWA"])), [7, 8])
    assert told(found, "no_value") == [{"Invalid": 2}]


def two_of_one_name(folder, form):
    if form == "csv":
        path = folder / "run.csv"
        path.write_text("time_s,SWA [rad],SWA [rad]\n0,1,2\n1,1,2\n")
    else:
        path = folder / "run.parquet"
        names = ["time_s", "SWA [rad]", "SWA [rad]"]
        parquet.write_table(pyarrow.table([[0.0, 1.0], [1.0, 1.0], [2.0, 2.0]], names=names), path)
    assert "'SWA [rad]' and 'SWA [rad]' are both 'SWA': name one of them in a mapping" in refusal(path)
    assert "may be any of SWA [rad], SWA [rad]" in refusal(path, mapped("handwheel_angle=SWA"))
    assert mapping_template.text(path, {"handwheel_angle": "rad"}).count('# "SWA [rad]": rad, ') == 1


# Defect -> the formats that can have it.
DEFECTS = {
    doubled: FORMATS,
    goes_back: FORMATS,
    in_blocks: FORMATS,
    empty: FORMATS,
    infinite: FORMATS,
    texts: ("csv", "mat", "mf4", "parquet"),
    no_unit: FORMATS,
    unknown_unit: FORMATS,
    no_time: ("csv", "mat", "mat73", "parquet"),  # an MDF file has a time of its own
    one_sample: FORMATS,
    cut: FORMATS,
    codes: ("csv", "mf4"),
    two_of_one_name: ("csv", "parquet"),
}


@pytest.mark.parametrize(
    ("defect", "form"),
    [pytest.param(defect, form, id=f"{defect.__name__}-{form}") for defect, forms in DEFECTS.items() for form in forms],
)
def test_a_defect_is_treated_alike_in_every_format(defect, form, tmp_path):
    defect(tmp_path, form)


def test_every_defect_is_in_the_table_of_the_page():
    page = (Path(__file__).parents[2] / "docs" / "recordings.md").read_text()
    table = page.partition("| defect |")[2].partition("\n\n")[0]
    assert table.count("\n|") - 1 >= len(DEFECTS)


def can_log(folder, stamps, values):
    """A log of candump with a signed angle of 0.01 deg."""
    lines = [
        f"({stamp:.6f}) can0 100#{int(value).to_bytes(2, 'little', signed=True).hex().upper()}000000000000"
        for stamp, value in zip(stamps, values)
    ]
    (folder / "run.log").write_text("\n".join(lines) + "\n")
    (folder / "run.dbc").write_text(DBC)
    return folder / "run.log", Options(folder / "run.dbc")


def test_of_frames_with_one_stamp_the_last_is_kept(tmp_path):
    time = TIME.copy()
    time[20] = time[19]
    path, options = can_log(tmp_path, time, np.arange(SIZE))
    found = read(path, mapped("handwheel_angle=SWA"), can=options)
    inside = np.interp(found.time, np.delete(time, 19), np.delete(np.arange(SIZE), 19)) * 0.01
    np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), inside, atol=1e-9)


def test_frames_that_go_back_in_time_are_refused(tmp_path):
    time = TIME.copy()
    time[20] = 0.0123
    path, options = can_log(tmp_path, time, np.arange(SIZE))
    assert "0.0123" in refusal(path, mapped("handwheel_angle=SWA"), can=options)


# Conventions of text, and what they mean

STEERING = {"Angle": "deg", "Torque": "Nm", "Speed": "km/h"}
SIZES = {"deg": np.pi / 180, "Nm": 1.0, "km/h": 1 / 3.6}
TEXTS = ("Invalid", "---", "n/a", "#NV", "1.#QNAN", "-1.#IND", "SNA")


def in_text(rng):
    """A file of random conventions, in bytes; its time, its channels, and how many samples of each are no values."""

    def choose(*options):
        return options[rng.integers(len(options))]

    separator = choose(",", ";", "\t")
    comma = separator != "," and rng.random() < 0.5
    quoted = rng.random() < 0.3
    size = int(rng.integers(30, 60))
    time = np.round(np.cumsum(rng.uniform(0.009, 0.011, size)), 6)
    channels = {name: np.round(rng.normal(0, 100, size), int(rng.integers(1, 7))) for name in STEERING}
    cells = [[repr(float(x)) for x in values] for values in (time, *channels.values())]
    counts = {}
    for name, column in zip(channels, cells[1:]):
        for k in rng.choice(size, int(rng.integers(0, 4)), replace=False):
            column[k] = choose("", "nan", *TEXTS, "inf")
            reason = {"": "empty", "nan": "empty", "inf": "infinite"}.get(column[k], column[k])
            counts.setdefault(name, {}).setdefault(reason, 0)
            counts[name][reason] += 1
            channels[name][k] = np.nan
    rows = [list(row) for row in zip(*cells)]
    if doubled_at := (int(rng.integers(1, size)) if rng.random() < 0.3 else 0):
        rows[doubled_at - 1][0] = rows[doubled_at][0]
    if comma:
        rows = [[cell.replace(".", ",") if cell not in TEXTS else cell for cell in row] for row in rows]
    if rng.random() < 0.3:
        for row in rows:
            row.insert(1, choose("ok", "bad, or worse" if quoted else "worse", "12:00:01"))
    more = ["Status"] * (len(rows[0]) - 4)
    style = choose("brackets", "parentheses", "row", "row in brackets")
    units = ["s", *[""] * len(more), *STEERING.values()]
    names = [choose("Time", "t", "Zeit", "time"), *more, *STEERING]
    units_row = None
    if style.startswith("row"):
        units_row = [f"[{unit}]" if "brackets" in style and unit else unit for unit in units]
    else:
        left, right = "[]" if style == "brackets" else "()"
        names = [f"{name} {left}{unit}{right}" if unit else name for name, unit in zip(names, units)]

    def line(cells, end=""):
        return separator.join(f'"{cell}"' if quoted else cell for cell in cells) + end

    end = choose("", "", separator, separator * 3)
    mark = "# " if rng.random() < 0.25 else ""
    top = [choose("", "# driver: A. B.", "# measured with a comment"), mark + line(names, end)]
    if units_row:
        top += [choose("", "# from here on units") if not mark else "", mark + line(units_row, end)]
    top += [choose("", "  ")] if rng.random() < 0.5 else []
    if not mark and rng.random() < 0.3:
        top[:0] = ['"Format","MoTeC CSV File",,,"Workbook",""', "Vehicle: car 7", ""]
    lines = [*[each for each in top if each or rng.random() < 0.5], *(line(row, end) for row in rows)]
    if rng.random() < 0.2:
        lines.insert(len(lines) - 5, choose("", "# lap 2", lines[-size - 1] if not mark and len(top) < 3 else ""))
    breaks = choose("\n", "\r\n")
    text = breaks.join(lines) + choose("", breaks, breaks * 2)
    data = text.encode(choose("utf-8", "utf-8-sig", "latin-1", "utf-16"))
    keep = np.arange(size) != doubled_at - 1
    if doubled_at:
        time[doubled_at - 1] = time[doubled_at]
    truth = {name: values[keep] * SIZES[STEERING[name]] for name, values in channels.items()}
    return data, time[keep], truth, counts, int(doubled_at > 0)


def test_conventions_of_text_are_read_as_they_are_meant(tmp_path):
    """150 files of random conventions: every number, every gap with its reason, every doubled stamp."""
    rng = np.random.default_rng(56)
    for case in range(150):
        data, time, truth, counts, stamps = in_text(rng)
        path = tmp_path / f"run{case}.csv{'.gz' if case % 5 == 0 else ''}"
        path.write_bytes(gzip.compress(data, 1) if path.suffix == ".gz" else data)
        try:
            found = read(path)
        except ValueError as error:
            pytest.fail(f"{error}\n{data[:600]!r}")
        np.testing.assert_allclose(found.time, time, rtol=1e-12, err_msg=str(data[:600]))
        assert set(found.channels) == set(truth), data[:600]
        for name, values in truth.items():
            np.testing.assert_allclose(found[name], values, rtol=1e-12, err_msg=str(data[:600]))
        told_of = {label.split(" ")[0]: reasons for label, reasons in found.meta.get("no_value", {}).items()}
        assert told_of == counts, data[:600]
        assert sum(told(found, "doubled_stamps")) == stamps


def test_text_with_a_wrong_row_is_refused_in_every_convention(tmp_path):
    """50 files with one row too many cells, a time that goes back or a number that is none."""
    rng = np.random.default_rng(57)
    for case in range(50):
        data, *_ = in_text(rng)
        encoding = {b"\xff\xfe": "utf-16", b"\xef\xbb": "utf-8-sig"}.get(data[:2], "utf-8")
        lines = data.decode(encoding).rstrip().splitlines()
        separator = next((mark for mark in (";", "\t") if mark in lines[-9]), ",")
        wrong = [lines[-9] + separator + "1", lines[-20], lines[-9].partition(separator)[0]][case % 3]
        path = tmp_path / "run.csv"
        path.write_text("\n".join([*lines[:-4], wrong, *lines[-4:]]))
        assert f"line {len(lines) - 3}" in refusal(path), data[:600]
