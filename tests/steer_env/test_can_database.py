"""Signals of databases: bits against cantools, codes that are no values, signs, databases that are wrong in part."""

import random

import cantools
import numpy as np
import pytest

from steer_env.recording import can_database

HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: A\n'


def loaded(tmp_path, *texts):
    """The columns by label of databases with these messages, and what could not be read of them."""
    paths = [tmp_path / f"{name}.dbc" for name, _ in zip("abc", texts)]
    for path, text in zip(paths, texts):
        path.write_text(HEAD + text)
    columns, left = can_database.load(paths)
    return {column.label: column for column in columns}, left


def values(column, raw):
    """The values of whole-number raw values of a signal that begins at bit 0 of a little-endian frame."""
    data = np.array([list(int(k % 2**64).to_bytes(8, "little")) for k in raw], dtype=np.uint8)
    return column.read(data, np.full(len(raw), 8))


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("defect", ["", "VAL_ 256 ANGLE 1 Grün ;\n"])
def test_encodings(tmp_path, encoding, defect):
    text = HEAD + f'BO_ 256 M: 8 A\n SG_ S : 0|8@1+ (0.1,0) [0|0] "°" A\nVAL_ 256 S 7 "ungültig" ;\n{defect}'
    (tmp_path / "a.dbc").write_text(text, encoding=encoding)
    (column,), left = can_database.load([tmp_path / "a.dbc"])
    assert (column.signal.unit, left) == ("°", {})
    assert values(column, [7])[2] == {"7 (ungültig)": 1}


def test_bits_are_read_as_cantools_reads_them(tmp_path):
    """Random signals of both byte orders, signed, unsigned and of floating point, in frames of random bytes."""
    draw = random.Random(1)
    for _ in range(300):
        length, float_type = draw.choice([(draw.randint(1, 64), 0), (32, 1), (64, 2)])
        big = draw.random() < 0.5
        first = draw.randint(0, 64 - length)
        start = 8 * (first // 8) + 7 - first % 8 if big else first
        sign = draw.choice("+-")
        scale, offset = draw.choice([(1, 0), (0.1, -40), (-0.01, 20.47), (2, 3)])
        text = f'BO_ 256 M: 8 A\n SG_ S : {start}|{length}@{int(not big)}{sign} ({scale},{offset}) [0|0] "" A\n'
        text += f"SIG_VALTYPE_ 256 S : {float_type};\n" if float_type else ""
        columns, _ = loaded(tmp_path, text)
        message = cantools.database.load_string(HEAD + text, "dbc").messages[0]
        frames = [bytes(draw.randrange(256) for _ in range(8)) for _ in range(20)]
        _, found, _ = columns["M.S"].read(np.array([list(frame) for frame in frames], dtype=np.uint8), np.full(20, 8))
        expected = np.array([float(message.decode(frame)["S"]) for frame in frames])
        expected[~np.isfinite(expected)] = np.nan
        np.testing.assert_allclose(found, expected, rtol=3e-16, err_msg=text)  # cantools scales whole numbers whole


def test_signals_that_overlap_are_read_each(tmp_path):
    """The codec of cantools shifts the second one."""
    text = 'BO_ 256 M: 8 A\n SG_ A : 7|16@0+ (1,0) [0|0] "" A\n SG_ B : 15|16@0+ (1,0) [0|0] "" A\n'
    columns, _ = loaded(tmp_path, text)
    data = np.array([[1, 2, 3, 0, 0, 0, 0, 0]], dtype=np.uint8)
    assert [columns[name].read(data, np.array([8]))[1][0] for name in ("M.A", "M.B")] == [0x0102, 0x0203]


@pytest.mark.parametrize(
    ("signal", "names", "raw", "expected"),
    [
        ('8@1+ (0.1,-10) [0|0] "Nm"', '255 "Invalid" 254 "Unknown"', [253, 254, 255], [15.3, None, None]),
        ('8@1+ (0.1,-10) [-10|15.3] "Nm"', "", [253, 254, 255], [15.3, None, None]),
        ('8@1+ (0.1,0) [0|0] "deg"', '0 "Straight" 255 "Beyond"', [0, 254, 255], [0.0, 25.4, None]),
        ('8@1+ (0.1,0) [0|0] "deg"', '7 "Sensor_Fault" 8 "No_Fault"', [7, 8], [None, 0.8]),
        ('13@1- (0.25,0) [0|0] "Nm"', '-4096 "SNA"', [-4096, -4095], [None, -1023.75]),
        ('16@1- (0.1,0) [0|0] "deg"', '32768 "SNA" 65535 "Error"', [-32768, -1, -2], [None, None, -0.2]),
        ('16@1+ (0.1,0) [0|0] "deg"', '-1 "Faulty" 70000 "Invalid"', [65535, 65534, 4464], [None, 6553.4, 446.4]),
        ('16@1+ (1,0) [0|0] "1"', '32765 "32765 (0x000~0x7FFD valid range)"', [32765], [32765.0]),
        ('2@1+ (1,0) [0|3] ""', '0 "Off" 1 "On" 2 "Fault" 3 "SNA"', [0, 1, 2, 3], [0, 1, 2, None]),
        ('8@1+ (1,0) [0|0] ""', '255 "Error" 254 "Init"', [253, 254, 255], [253, None, None]),
        ('3@1+ (1,0) [0|7] ""', '0 "P" 1 "R" 2 "N" 3 "D" 7 "S"', [0, 1, 2, 3, 7], [0, 1, 2, 3, 7]),
        ('12@1+ (-0.01,20.47) [0|4095] "Nm"', "", [0, 4095], [20.47, -20.48]),  # the range is that of the raw values
        ('16@1- (-0.1,0) [0|65535] "deg"', "", [-100, 100], [10.0, -10.0]),  # of an unsigned one
        ('32@1- (1,0) [-3.4E+038|3.4E+038] ""', "", [-5], [-5.0]),
        ('8@1+ (1,0) [10|10] ""', "", [255], [255.0]),
    ],
)
def test_codes_are_no_values_and_named_numbers_are(tmp_path, signal, names, raw, expected):
    text = f"BO_ 256 M: 8 A\n SG_ S : 0|{signal} A\n" + (f"VAL_ 256 S {names} ;\n" if names else "")
    columns, _ = loaded(tmp_path, text)
    there, found, codes = values(columns["M.S"], raw)
    assert there.all()
    np.testing.assert_allclose(found, [np.nan if value is None else value for value in expected], atol=1e-9)
    assert sum(codes.values()) == expected.count(None)


@pytest.mark.parametrize(
    ("name", "is_code"),
    [
        *((name, True) for name in ("Sensorfehler", "NotCalibrated", "Nicht_kalibriert", "ERR", "uninitialized")),
        *((name, True) for name in ("Signal_Unplausibel", "Ersatzwert", "NaN", "dont_care", "out of range")),
        *((name, False) for name in ("Straight", "No_Fault", "kein_Fehler", "Notch", "Standstill", "ferry")),
    ],
)
def test_names_in_the_middle_of_a_measuring_signal(tmp_path, name, is_code):
    """Of a raw value that is none of the last ones, so that only its name can say so."""
    text = f'BO_ 256 M: 8 A\n SG_ S : 0|16@1+ (0.1,0) [0|0] "Nm" A\nVAL_ 256 S 1000 "{name}" ;\n'
    columns, _ = loaded(tmp_path, text)
    assert np.isnan(values(columns["M.S"], [1000])[1][0]) == is_code


@pytest.mark.parametrize(
    ("length", "raw", "expected"),
    [
        (2, [1, 2, 3], [1, None, None]),
        (4, [13, 14, 15], [13, None, None]),
        (8, [0xFA, 0xFB, 0xFE, 0xFF], [0xFA, None, None, None]),
        (16, [0xFAFF, 0xFB00, 0xFE00, 0xFFFF], [0xFAFF, None, None, None]),
        (32, [0xFAFFFFFF, 0xFFFFFFFF], [0xFAFFFFFF, None]),
    ],
)
def test_what_is_not_available_in_j1939_is_no_value(tmp_path, length, raw, expected):
    """And in a message that is none of J1939 it is."""
    text = f'BO_ {0x18F009FE | 1 << 31} M: 8 A\n SG_ S : 0|{length}@1+ (1,0) [0|0] "" A\n'
    columns, _ = loaded(tmp_path, text)
    found = values(columns["M.S"], raw)[1]
    np.testing.assert_array_equal(found, [np.nan if value is None else value for value in expected])
    other, _ = loaded(tmp_path, text.replace(str(0x18F009FE | 1 << 31), "256"))
    np.testing.assert_array_equal(values(other["M.S"], raw)[1], raw)


@pytest.mark.parametrize(
    ("size", "sign"),
    [
        ("ANG", "ANG_SIGN"),
        ("LWI_Lenkradwinkel", "LWI_VZ_Lenkradwinkel"),
        ("LH3_BLM", "LH3_BLMSign"),
        ("Giergeschwindigkeit", "Vorzeichen_der_Giergeschwindigk"),
        ("STEER_ANGLE", "STEER_DIRECTION"),
        ("LW", "LW_Sign"),
        ("LW1_Lenk_Gesch", "LW1_Gesch_Sign"),
        ("EPS_Berechneter_LW", "EPS_VZ_BLW"),
    ],
)
@pytest.mark.parametrize("bits", [1, 2])
def test_a_magnitude_knows_the_signal_of_its_sign(tmp_path, size, sign, bits):
    text = f'BO_ 256 M: 8 A\n SG_ {size} : 0|13@1+ (0.1,0) [0|0] "deg" A\n SG_ {sign} : 13|{bits}@1+ (1,0) [0|1] "" A\n'
    columns, _ = loaded(tmp_path, text)
    assert columns[f"M.{size}"].sign.label == f"M.{sign}"
    assert columns[f"M.{sign}"].sign is None
    signed, _ = loaded(tmp_path, text.replace("0|13@1+ (0.1,0)", "0|13@1- (0.1,0)"))
    assert signed[f"M.{size}"].sign is None
    ranged, _ = loaded(tmp_path, text.replace("0|13@1+ (0.1,0) [0|0]", "0|13@1- (0.1,0) [0|300]"))
    assert ranged[f"M.{size}"].sign.label == f"M.{sign}"  # signed by its bits, a magnitude by its range


ANGLE = ' SG_ ANGLE : 0|16@1- (0.1,0) [0|0] "deg" A\n'


def test_one_name_in_two_databases_is_told_apart_and_the_same_definition_is_one(tmp_path):
    both, _ = loaded(tmp_path, f"BO_ 256 STEER: 8 A\n{ANGLE}", f"BO_ 512 STEER: 8 A\n{ANGLE}")
    assert set(both) == {"a:STEER.ANGLE", "b:STEER.ANGLE"}
    one, _ = loaded(tmp_path, f"BO_ 256 STEER: 8 A\n{ANGLE}", f'BO_ 256 STEER: 8 A\n{ANGLE}CM_ SG_ 256 ANGLE "it";\n')
    assert set(one) == {"STEER.ANGLE"}
    other, _ = loaded(tmp_path, f"BO_ 256 STEER: 8 A\n{ANGLE}", f"BO_ 256 STEER: 8 A\n{ANGLE.replace('0.1', '0.2')}")
    assert set(other) == {"a:STEER.ANGLE", "b:STEER.ANGLE"}
    assert other["a:STEER.ANGLE"].apart == "id 0x100 is STEER in a and STEER in b"


@pytest.mark.parametrize(
    ("defect", "lost"),
    [
        ('VAL_ 256 NONE 1 "On" ;\n', ""),
        ('VAL_ 300 ANGLE 1 "On" ;\n', ""),
        ("SIG_VALTYPE_ 256 NONE : 1;\n", ""),
        ('CM_ 145 "no kind" ;\n', ""),
        ('CM_ SG_ 304 "no signal";\n', ""),
        ('BO_ 1275 2017_5: 8 A\n SG_ X : 0|8@1+ (1,0) [0|0] "" A\n', "2017_5.X"),
        ('BO_ 512 M: 8 A\n SG_ 0_X : 0|8@1+ (1,0) [0|0] "" A\n SG_ Y : 8|8@1+ (1,0) [0|0] "" A\n', "M.0_X"),
        ('BO_ 512 M: 8 A\n SG_ X : 0|8@1+ (.25,0) [0|0] "" A\n SG_ Y : 8|8@1+ (1,0) [0|0] "" A\n', "M.X"),
        ('BO_ 3221225472 M: 8 A\n SG_ X : 0|8@1+ (1,0) [0|0] "" A\n', "M.X"),
    ],
)
def test_a_defect_costs_only_what_it_describes(tmp_path, defect, lost):
    """The angle of the database, its names and its cycle time are read as without the defect."""
    good = f'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 1000;\nBO_ 256 STEER: 8 A\n{ANGLE}VAL_ 256 ANGLE 32767 "Invalid" ;\n'
    good += 'BA_ "GenMsgCycleTime" BO_ 256 10;\n'
    columns, left = loaded(tmp_path, good + defect)
    assert columns["STEER.ANGLE"].message.cycle == 0.01
    assert values(columns["STEER.ANGLE"], [32767, 100])[1][1] == 10.0
    assert values(columns["STEER.ANGLE"], [32767, 100])[2] == {"32767 (Invalid)": 1}
    assert list(left) == [lost] * bool(lost)
    assert ("M.Y" in columns) == ("SG_ Y" in defect)


def test_an_identifier_of_29_bits_without_its_mark_can_only_be_extended(tmp_path):
    columns, left = loaded(tmp_path, f'BO_ {0x62CC033} M: 8 A\n{ANGLE}VAL_ {0x62CC033} ANGLE 32767 "Invalid" ;\n')
    assert (columns["M.ANGLE"].message.key, left) == ((0x62CC033, True), {})
    assert np.isnan(values(columns["M.ANGLE"], [32767])[1]).all()
