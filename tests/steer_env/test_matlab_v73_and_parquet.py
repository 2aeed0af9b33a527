"""MATLAB v7.3 and Parquet from elsewhere, and what is said where the package that reads them is missing."""

import sys
from decimal import Decimal

import h5py
import numpy as np
import pandas
import pyarrow
import pytest
from pyarrow import parquet

from steer_env.recording.files import read, write
from steer_env.recording.recording import DEGREE, Recording
from tests.steer_env.recorded import mapped, refusal

HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"  # of 512 bytes, then HDF5


def matlab(path, variables):
    """A file as MATLAB lays it out: the axes reversed, text as 16-bit numbers, structures as groups."""

    def store(group, name, value):
        if isinstance(value, dict):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, entry in value.items():
                store(inner, key, entry)
        elif isinstance(value, str):
            entry = group.create_dataset(name, data=np.frombuffer(value.encode("utf-16-le"), "<u2")[:, np.newaxis])
            entry.attrs["MATLAB_class"] = np.bytes_("char")
        else:
            entry = group.create_dataset(name, data=np.atleast_2d(value))
            entry.attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            store(file, name, value)
        file.create_group("#refs#").create_dataset("a", data=np.arange(7.0))
        empty = file.create_dataset("nothing", data=np.array([0, 0], dtype=np.uint64))
        empty.attrs["MATLAB_empty"] = np.uint8(1)
    with open(path, "r+b") as file:
        file.write(HEADER)
    return path


CONTENT = {
    "t_s": np.arange(3.0),
    "SWA_deg": np.array([0, 90, -90], dtype=np.int16),
    "v": np.array([[36.0], [72.0], [36.0]]),
    "car": "compact",
    "gain": np.array([3.0]),
}


@pytest.mark.parametrize("wrap", [lambda c: c, lambda c: {"run": c}, lambda c: {"log": {"run": c}}])
def test_a_matlab_v73_file(tmp_path, wrap):
    path = matlab(tmp_path / "run.mat", wrap(CONTENT))
    found = read(path, mapped("handwheel_angle=SWA,sign=-1", "vehicle_speed=v[km/h]"))
    np.testing.assert_allclose(found.time, [0, 1, 2])
    np.testing.assert_allclose(found["handwheel_angle"], [0, -np.pi / 2, np.pi / 2])
    np.testing.assert_allclose(found["vehicle_speed"], [10, 20, 10])
    assert read(path).meta == {"not_read": "v"}


def test_meta_in_a_matlab_v73_file_is_read(tmp_path):
    path = matlab(tmp_path / "run.mat", {**CONTENT, "meta": '{"trace": {"car": "Ø", "list": [1, 2.5]}}'})
    assert read(path).meta["trace"] == {"car": "Ø", "list": [1, 2.5]}


def test_a_matlab_v73_file_without_its_header_is_read(tmp_path):
    with h5py.File(tmp_path / "run.mat", "w") as file:
        file["time_s"], file["SWA_deg"] = np.arange(3.0), np.arange(3.0)
    np.testing.assert_allclose(read(tmp_path / "run.mat")["SWA"], np.arange(3) * DEGREE)


def test_a_cut_matlab_v73_file_is_refused(tmp_path):
    path = matlab(tmp_path / "run.mat", {"time_s": np.arange(5000.0), "SWA_deg": np.arange(5000.0)})
    whole = path.read_bytes()
    for size in (600, len(whole) // 2):
        path.write_bytes(whole[:size])
        assert "is it complete?" in refusal(path)


def test_a_parquet_file_from_pandas(tmp_path):
    """Time stamps, integers with an empty cell, text beside numbers, an index of its own."""
    path = tmp_path / "run.parquet"
    stamps = pandas.to_datetime(["2024-05-01 12:00:00.0", "2024-05-01 12:00:00.5", "2024-05-01 12:00:01.0"])
    counts = pandas.array([0, None, 180], dtype="Int64")
    table = pandas.DataFrame({"time": stamps, "SWA [deg]": counts, "v_kmh": [36.0, 72.0, np.nan], "state": list("abc")})
    table.to_parquet(path)
    found = read(path)
    np.testing.assert_allclose(found.time, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(found["SWA"], [0.0, np.nan, np.pi])
    np.testing.assert_allclose(found["v"], [10.0, 20.0, np.nan])
    assert found.meta == {"not_read": "state", "no_value": {"SWA [deg]": {"empty": 1}, "v_kmh": {"empty": 1}}}
    assert "column 'state', wanted as handwheel_angle, holds no plain numbers" in refusal(
        path, mapped("handwheel_angle=state[deg]")
    )


def test_parquet_decimals_and_truth_values_are_numbers(tmp_path):
    path = tmp_path / "run.parquet"
    decimals = pyarrow.array([Decimal("0.10"), None, Decimal("-12.25")], pyarrow.decimal128(12, 2))
    flags = pyarrow.array([True, None, False])
    parquet.write_table(pyarrow.table({"time_s": [0.0, 0.1, 0.2], "T [Nm]": decimals, "on [1]": flags}), path)
    found = read(path)
    np.testing.assert_array_equal(found["T"], [0.1, np.nan, -12.25])
    np.testing.assert_array_equal(found["on"], [1.0, np.nan, 0.0])
    assert found.meta["no_value"] == {"T [Nm]": {"empty": 1}, "on [1]": {"empty": 1}}


@pytest.mark.parametrize("meta", ["[1, 2]", "3", "null", "no JSON", b"\xff"])
def test_parquet_meta_that_is_no_object_is_refused(tmp_path, meta):
    path = tmp_path / "run.parquet"
    table = pyarrow.table({"time_s": [0.0, 0.1], "T [Nm]": [1.0, 2.0]})
    parquet.write_table(table.replace_schema_metadata({"steer-env": meta}), path)
    assert "its meta steer-env is no JSON object" in refusal(path)


def test_units_in_the_metadata_of_parquet_columns_are_read(tmp_path):
    path = tmp_path / "run.parquet"
    fields = [
        pyarrow.field("Stamp", pyarrow.float32(), metadata={"unit": "ms"}),
        pyarrow.field("Torque", pyarrow.float32(), metadata={"unit": "Nm"}),
    ]
    parquet.write_table(pyarrow.table([[0.0, 10.0], [1.0, 2.0]], schema=pyarrow.schema(fields)), path)
    found = read(path, mapped("handwheel_torque=Torque"))
    np.testing.assert_allclose(found.time, [0.0, 0.01])
    np.testing.assert_allclose(found["handwheel_torque"], [1.0, 2.0])


def test_other_programs_read_our_parquet(tmp_path):
    write(Recording([0.0, 0.1], {"yaw_rate": [0.1, 0.2]}, {"yaw_rate": "rad/s"}), tmp_path / "run.parquet")
    found = pandas.read_parquet(tmp_path / "run.parquet")
    assert list(found) == ["time_s", "yaw_rate_deg_s"]
    np.testing.assert_allclose(found["yaw_rate_deg_s"] * DEGREE, [0.1, 0.2])


@pytest.mark.parametrize(
    ("module", "name", "message"),
    [
        ("h5py", "run.mat", "MATLAB v7.3 files need the package h5py: pip install '.[hdf5]'"),
        ("pyarrow", "run.parquet", "Parquet files need the package pyarrow: pip install '.[parquet]'"),
    ],
)
def test_without_the_extra(tmp_path, monkeypatch, module, name, message):
    path = tmp_path / name
    if module == "h5py":
        matlab(path, CONTENT)
    else:
        pandas.DataFrame({"time_s": [0.0, 1.0]}).to_parquet(path)
    monkeypatch.setitem(sys.modules, module, None)
    assert message in refusal(path)
