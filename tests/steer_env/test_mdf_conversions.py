"""Conversions of MDF channels against arithmetic of their own, without sympy, which asammdf takes for some formulas."""

import math

import asammdf
import numpy as np
import pytest
from asammdf.blocks import v4_blocks, v4_constants
from asammdf.blocks.conversion_utils import from_dict

from steer_env.recording import own_process
from steer_env.recording.files import read
from tests.steer_env.recorded import mapped, refusal

RAW = {"u1": np.arange(0, 256, 3), "i2": np.arange(-300, 300, 7), "f4": np.arange(-20, 20, 0.37)}
LINEAR = {"a": 0.25, "b": -3.0}
INVALID = "Invalid"


@pytest.fixture(autouse=True)
def without_sympy(tmp_path, monkeypatch):
    """The reader's own process finds no sympy."""
    (tmp_path / "lean").mkdir()
    (tmp_path / "lean" / "sympy.py").write_text("raise ImportError('there is no sympy here')")
    monkeypatch.syspath_prepend(tmp_path / "lean")
    with pytest.raises(ValueError, match="there is no sympy here"):
        own_process.read("sympy", __import__, "sympy")


def written(path, raw, *conversions):
    """A file with a channel C0, C1, ... for each conversion of the same raw samples."""
    time = np.arange(len(raw)) / 100
    signals = [
        asammdf.Signal(raw, time, name=f"C{k}", unit="N", conversion=from_dict(conversion))
        for k, conversion in enumerate(conversions)
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals)
        file.save(path, overwrite=True)
    return path


FORMULAS = {
    "X1^2": lambda x: x * x,
    "pow(X1, 2) / 4": lambda x: x * x / 4,
    "-X1^2 + 3 * X1 - 1": lambda x: -x * x + 3 * x - 1,
    "(X1 + 2)^3 / 100": lambda x: (x + 2) ** 3 / 100,
    "2^(X1 / 64)": lambda x: 2 ** (x / 64),
    "exp(X1 / 100)": lambda x: math.exp(x / 100),
    "atan(X1)": math.atan,
    "sqrt(abs(X1)) * sin(X1)": lambda x: math.sqrt(abs(x)) * math.sin(x),
    "ln(X1 * X1 + 1)": lambda x: math.log(x * x + 1),
    "log10(X1^2 + 1) - cosh(X1 / 100)": lambda x: math.log10(x * x + 1) - math.cosh(x / 100),
    "1.5e-1 * X": lambda x: 0.15 * x,
    "7": lambda x: 7.0,
}


@pytest.mark.parametrize("kind", RAW)
def test_algebraic_conversions(tmp_path, kind):
    raw = RAW[kind].astype(kind)
    found = read(written(tmp_path / "run.mf4", raw, *({"formula": formula} for formula in FORMULAS)))
    for k, (formula, value) in enumerate(FORMULAS.items()):
        expected = [value(float(x)) for x in raw]
        np.testing.assert_allclose(found[f"C{k}"], expected, rtol=1e-12, atol=1e-12, err_msg=formula)


@pytest.mark.parametrize(
    ("formula", "unknown"),
    [
        ("X1 & 255", "'X1 & 255' is not known"),
        ("log(X1)", "'log(X1)' is not known"),
        ("X1 + X2", "'X2' is not known"),
        ("sin(X1, X1)", "'sin(X1, X1)' is not known"),
        ("__import__('os').getcwd()", "is not known"),
        ("X1 +", "which is no formula"),
    ],
)
def test_what_a_formula_may_not_hold_is_named(tmp_path, formula, unknown):
    path = written(tmp_path / "run.mf4", RAW["f4"], LINEAR, {"formula": formula})
    assert read(path).meta["not_read"] == "C1"
    told = refusal(path, mapped("own_force=C1[N]"))
    assert f"has the algebraic conversion {formula!r}" in told
    assert unknown in told


def ranges(x, whole):
    """The value of x by [0, 5] to 1, [6, 10] to 2, otherwise -1; ends belong to a range of whole numbers only."""
    return next((value for low, high, value in ((0, 5, 1), (6, 10, 2)) if low <= x < high + whole), -1)


def nearest(x, keys):
    """The value of the key that is nearest to x, the lower one of two."""
    return min(keys, key=lambda pair: (abs(x - pair[0]), pair[0]))[1]


KEYS = [(-50.0, 3.0), (0.0, 1.0), (10.0, 5.0), (200.0, -2.0)]
TABLE = {f"{name}_{k}": pair[place] for place, name in enumerate(("raw", "phys")) for k, pair in enumerate(KEYS)}
RANGES = {
    "lower_0": 0.0,
    "upper_0": 5.0,
    "phys_0": 1.0,
    "lower_1": 6.0,
    "upper_1": 10.0,
    "phys_1": 2.0,
    "default": -1.0,
}


@pytest.mark.parametrize("kind", RAW)
def test_the_other_conversions_to_numbers(tmp_path, kind):
    raw = RAW[kind].astype(kind)
    rational = {"P1": 1.0, "P2": 2.0, "P3": 3.0, "P4": 0.5, "P5": 0.0, "P6": 50.0}
    tables = [{**TABLE, "interpolation": flag} for flag in (True, False)]
    found = read(written(tmp_path / "run.mf4", raw, None, LINEAR, rational, *tables, RANGES))
    keys, values = zip(*KEYS)
    expected = [
        raw,
        [0.25 * float(x) - 3 for x in raw],
        [(x * x + 2 * x + 3) / (0.5 * x * x + 50) for x in map(float, raw)],
        np.interp(raw, keys, values),
        [nearest(float(x), KEYS) for x in raw],
        [ranges(float(x), kind != "f4") for x in raw],
    ]
    for k, each in enumerate(expected):
        np.testing.assert_allclose(found[f"C{k}"], each, rtol=1e-12, atol=1e-12, err_msg=f"C{k}")


@pytest.mark.parametrize("size", [40, 400])  # asammdf has other code from 100 and 150 samples on
@pytest.mark.parametrize("kind", ["u1", "f4"])
def test_texts_beside_numbers_are_gaps_that_are_counted(tmp_path, kind, size):
    raw = (np.arange(size) % 64).astype(kind)
    codes = {"val_0": 7, "text_0": INVALID, "val_1": 9, "text_1": "SNA", "default_addr": LINEAR}
    spans = {"lower_0": 8.0, "upper_0": 11.0, "text_0": INVALID, "default_addr": {"formula": "X1^2"}}
    found = read(written(tmp_path / "run.mf4", raw, codes, spans))
    inside = (raw >= 8) & (raw <= (11 if kind == "u1" else 10))
    np.testing.assert_allclose(found["C0"], np.where((raw == 7) | (raw == 9), np.nan, 0.25 * raw.astype(float) - 3))
    np.testing.assert_allclose(found["C1"], np.where(inside, np.nan, raw.astype(float) ** 2))
    assert found.meta["no_value"] == {
        "C0": {INVALID: np.count_nonzero(raw == 7), "SNA": np.count_nonzero(raw == 9)},
        "C1": {INVALID: np.count_nonzero(inside)},
    }


def test_what_is_no_number_before_a_conversion_is_none_behind_it(tmp_path):
    """Tables have a value for every number, which a missing one must not get."""
    raw = RAW["f4"].copy()
    raw[[3, 4, 5]] = np.nan, np.inf, -np.inf
    tables = [{**TABLE, "interpolation": flag} for flag in (True, False)]
    codes = {"val_0": 7, "text_0": INVALID, "default_addr": RANGES}
    found = read(written(tmp_path / "run.mf4", raw, LINEAR, *tables, RANGES, codes, {"formula": "7"}))
    for name, values in found.channels.items():
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(values)), [3, 4, 5], err_msg=name)
        assert found.meta["no_value"][name] == {"infinite": 2, "empty": 1}


def test_where_a_formula_has_no_value_is_told_apart_from_an_empty_sample(tmp_path):
    raw = RAW["f4"].copy()
    raw[3] = np.nan
    nested = {"val_0": 7, "text_0": INVALID, "default_addr": {"formula": "ln(X1)"}}
    found = read(written(tmp_path / "run.mf4", raw, {"formula": "sqrt(X1)"}, LINEAR, nested))
    below = int(np.count_nonzero(raw < 0))
    assert found.meta["no_value"] == {
        "C0": {"no result of 'sqrt(X1)'": below, "empty": 1},
        "C1": {"empty": 1},
        "C2": {"no result of 'ln(X1)'": below, "empty": 1},
    }


def test_keys_of_texts_need_not_be_whole_numbers(tmp_path):
    raw = np.arange(200) / 2
    codes = {"val_0": 7.5, "text_0": INVALID, "default_addr": LINEAR}
    found = read(written(tmp_path / "run.mf4", raw, codes))
    np.testing.assert_array_equal(np.isnan(found["C0"]), raw == 7.5)


def test_conversions_to_text_are_refused_by_name(tmp_path):
    gears = {f"{key}_{k}": value(k) for k in range(256) for key, value in (("val", int), ("text", "gear {}".format))}
    path = written(tmp_path / "run.mf4", RAW["u1"].astype("u1"), LINEAR, gears)
    assert read(path).meta["not_read"] == "C1"
    assert "column 'C1', wanted as own_gear, holds texts" in refusal(path, mapped("own_gear=C1[N]"))


def test_texts_become_numbers_by_their_table(tmp_path):
    texts = np.array([b"low", b"high", b"odd"] * 20)
    kind = v4_constants.CONVERSION_TYPE_TTAB
    conversion = v4_blocks.ChannelConversion(conversion_type=kind, links_nr=6, val_0=1.5, val_1=4.0, val_default=-1.0)
    conversion.referenced_blocks = {"text_0": b"low", "text_1": b"high"}
    time = np.arange(60) / 100
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(texts, time, name="C0", unit="N", conversion=conversion, encoding="utf-8")])
        file.save(tmp_path / "run.mf4", overwrite=True)
    np.testing.assert_array_equal(read(tmp_path / "run.mf4")["C0"], [1.5, 4.0, -1.0] * 20)


def test_a_formula_of_mdf_3(tmp_path):
    raw = RAW["i2"].astype("i2")
    signal = asammdf.Signal(raw, np.arange(raw.size) / 100, name="C0", unit="N")
    signal.conversion = from_dict({"formula": "X^2 / 4"})
    with asammdf.MDF(version="3.30") as file:
        file.append([signal])
        file.save(tmp_path / "run.mdf", overwrite=True)
    np.testing.assert_allclose(read(tmp_path / "run.mdf")["C0"], raw.astype(float) ** 2 / 4)


def test_a_formula_beside_texts_of_mdf_3(tmp_path):
    raw = (np.arange(60) % 32).astype("u1")
    conversion = from_dict({"lower_0": 8.0, "upper_0": 11.0, "text_0": INVALID})
    conversion.referenced_blocks["default_addr"] = b'"0.25*{X}-3.0"'
    signal = asammdf.Signal(raw, np.arange(raw.size) / 100, name="C0", unit="N", conversion=conversion)
    with asammdf.MDF(version="3.30") as file:
        file.append([signal])
        file.save(tmp_path / "run.mdf", overwrite=True)
    found = read(tmp_path / "run.mdf")
    inside = (raw >= 8) & (raw <= 11)
    np.testing.assert_allclose(found["C0"], np.where(inside, np.nan, 0.25 * raw - 3.0))
    assert found.meta["no_value"] == {"C0": {INVALID: np.count_nonzero(inside)}}


def drawn(rng, depth=0):
    """A random conversion, and what it makes of a sample: a number, or the text in its place."""
    kind = rng.integers(5 if depth else 8)
    a, b, c = (float(x) for x in np.round(rng.uniform(0.5, 9.0, 3), 3))
    if kind == 0:
        return {"a": a, "b": -b}, lambda x, whole: a * x - b
    if kind == 1:
        rational = {"P1": a, "P2": 1.0, "P3": b, "P4": 0.0, "P5": 0.0, "P6": c}
        return rational, lambda x, whole: (a * x * x + x + b) / c
    if kind == 2:
        return {"formula": f"{a} * X1^2 - pow(X1, 3) / {b}"}, lambda x, whole: a * x**2 - x**3 / b
    if kind == 3:
        return {"formula": f"exp(-X1 / 50) + atan(X1 * {a})"}, lambda x, whole: math.exp(-x / 50) + math.atan(x * a)
    keys = [(float(key), round(float(rng.normal()), 3)) for key in sorted(rng.choice(np.arange(-40, 90), 6, False))]
    if kind == 4:
        table = {f"{name}_{k}": pair[i] for i, name in enumerate(("raw", "phys")) for k, pair in enumerate(keys)}
        if rng.random() < 0.5:
            return {**table, "interpolation": False}, lambda x, whole: nearest(x, keys)
        return {**table, "interpolation": True}, lambda x, whole: float(np.interp(x, *zip(*keys)))
    bounds = [(keys[k][0], keys[k + 1][0] - 0.5 * rng.integers(3), keys[k][1]) for k in (0, 2, 4)]

    def within(x, whole, otherwise, of):
        fits = (k for k, (low, high, _) in enumerate(bounds) if low <= x < high or x in (low, *([high] * whole)))
        k = next(fits, None)
        return otherwise(x) if k is None else of(k)

    spans = {f"{name}_{k}": bound[i] for i, name in enumerate(("lower", "upper")) for k, bound in enumerate(bounds)}
    if kind == 5:
        values = {f"phys_{k}": bound[2] for k, bound in enumerate(bounds)}
        return {**spans, **values, "default": -a}, lambda x, whole: within(
            x, whole, lambda x: -a, lambda k: bounds[k][2]
        )
    inner, value = drawn(rng, 1)
    texts = {f"text_{k}": f"code {k}" for k in range(3)}
    if kind == 6:
        return (
            {**spans, **texts, "default_addr": inner},
            lambda x, whole: within(x, whole, lambda x: value(x, whole), "code {}".format),
        )
    values = [key for key, _ in keys[:3]]
    codes = {**{f"val_{k}": key for k, key in enumerate(values)}, **texts, "default_addr": inner}
    return codes, lambda x, whole: f"code {values.index(x)}" if x in values else value(x, whole)


@pytest.mark.parametrize("seed", range(3))
def test_any_conversions_are_right_or_told(tmp_path, seed):
    """60 channels of random conversions of random raw samples: every number, and every text counted."""
    rng = np.random.default_rng(seed)
    kind, size = ("u1", "i2", "f4")[seed], (60, 120, 300)[seed]
    raw = (rng.integers(0, 90, size) if kind == "u1" else rng.integers(-80, 180, size) / 2).astype(kind)
    pairs = [drawn(rng) for _ in range(60)]
    found = read(written(tmp_path / "run.mf4", raw, *(conversion for conversion, _ in pairs)))
    for k, (conversion, value) in enumerate(pairs):
        expected = [value(float(x), kind != "f4") for x in raw]
        numbers = [math.nan if isinstance(x, str) else x for x in expected]
        np.testing.assert_allclose(found[f"C{k}"], numbers, rtol=1e-11, atol=1e-11, err_msg=str(conversion))
        counts = {text: expected.count(text) for text in expected if isinstance(text, str)}
        assert found.meta.get("no_value", {}).get(f"C{k}", {}) == counts, conversion
