"""What property files of other people have: what is taken and told, what is refused, and what a car makes of a range.

A file here is made of a mapping of sections; the oracles of its forces are those of ``test_tir``.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

from steer_env import manoeuvres
from steer_env.experiments.cli.common.tables import print_metrics
from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import assessment
from steer_env.friction.numerics import check
from steer_env.metrics import Value, evaluate
from steer_env.vehicle import cars, tyre
from steer_env.vehicle.constants import GRAVITY
from tests.vehicle.test_tir import Numbers, agree, book, mf_tyre

FORMATS = {  # of [MODEL], by version
    "5.2": {"PROPERTY_FILE_FORMAT": "MF_05"},
    "PAC2002": {"PROPERTY_FILE_FORMAT": "PAC2002"},
    "60": {"FITTYP": 60.0},
    "61": {"FITTYP": 61.0},
    "62": {"FITTYP": 62.0},
}
OVERTURNING, ROLLING = "OVERTURNING_COEFFICIENTS", "ROLLING_COEFFICIENTS"
SCALING, LATERAL, ALIGNING = "SCALING_COEFFICIENTS", "LATERAL_COEFFICIENTS", "ALIGNING_COEFFICIENTS"
LONGITUDINAL = "LONGITUDINAL_COEFFICIENTS"
R_0, F_0 = 0.31, 3900.0


def contents(version="PAC2002"):
    """Sections of a small file."""
    return {
        "UNITS": {"LENGTH": "meter", "FORCE": "newton", "ANGLE": "radians", "MASS": "kg", "TIME": "second"},
        "MODEL": {**FORMATS[version], "LONGVL": 16.6},
        "DIMENSION": {"UNLOADED_RADIUS": R_0},
        "VERTICAL": {"FNOMIN": F_0, "VERTICAL_STIFFNESS": 210e3},
        SCALING: {"LFZO": 1.0},
        LONGITUDINAL: {"PCX1": 1.62, "PDX1": 1.08, "PDX2": -0.06, "PEX1": 0.3, "PKX1": 21.0, "PVX1": 1e-4},
        OVERTURNING: {"QSX1": 0.002, "QSX2": 0.7, "QSX3": 0.05},
        LATERAL: {
            **{"PCY1": 1.31, "PDY1": 0.98, "PDY2": -0.11, "PDY3": 1.1, "PEY1": -0.7, "PKY1": -17.5, "PKY2": 1.8},
            **{"PKY3": 0.3, "PVY3": -0.2, "PVY4": -0.1},
            **({"PHY3": -0.03} if version in ("5.2", "PAC2002") else {"PKY6": -0.8}),
        },
        ROLLING: {"QSY1": 0.011},
        ALIGNING: {"QBZ1": 9.5, "QBZ9": 5.0, "QCZ1": 1.15, "QDZ1": 0.11, "QDZ8": -0.1, "QEZ1": -1.0},
    }


def lines(sections):
    for name, entries in sections.items():
        yield f"[{name}]"
        for key, value in entries.items():
            yield f"{key} = " + (f"'{value}'" if isinstance(value, str) and value else str(value))


def written(path, sections, more=()):
    path.write_text("\n".join([*lines(sections), *more]) + "\n", encoding="utf-8")
    return path


def with_key(version, section, key, value):
    sections = contents(version)
    sections[section] = {**sections.get(section, {}), key: value}
    return sections


@pytest.fixture(autouse=True)
def _nothing_told(monkeypatch):
    monkeypatch.setattr(check, "_WARNED", set())


@pytest.fixture
def path(tmp_path):
    return tmp_path / "own.tir"


def loaded(path, recwarn):
    """The tyre of a file, and what was told of it."""
    recwarn.clear()
    subject = tyre.load(path)
    assert {each.category for each in recwarn} <= {tyre.TyreFile}
    return subject, " ".join(str(each.message) for each in recwarn)


# Taken and told

NEUTRAL = [
    ("PAC2002", SCALING, "LKG", "1"),
    ("PAC2002", SCALING, "LKYG", "1.0"),
    ("PAC2002", SCALING, "LIP", "1"),
    ("PAC2002", SCALING, "LKYC", "1"),
    ("5.2", OVERTURNING, "QPX1", "0"),
    ("61", OVERTURNING, "QPX1", "0.0"),
    ("62", ALIGNING, "QPZ1", "0"),
    ("PAC2002", ALIGNING, "QDZ10", "0"),
    ("PAC2002", LATERAL, "PTY3", "0"),
    ("PAC2002", LATERAL, "PTY3", "0.25"),  # damping of another program at low speed
    ("PAC2002", LONGITUDINAL, "PTX4", "0.1"),
    ("5.2", LATERAL, "PKY4", "2"),
    ("60", ROLLING, "QSY7", "1"),
    ("60", OVERTURNING, "QSX9", "0"),
    ("61", SCALING, "LMUV", "0"),
    ("61", SCALING, "LGAZ", "1"),
    ("61", SCALING, "LGYR", "0.5"),
    ("61", LATERAL, "PHY3", "0"),
    ("5.2", "TURNSLIP_COEFFICIENTS", "PDXP1", "0"),
    # A term that changes nothing as another coefficient of it is 0, or at the pressure of the file.
    ("5.2", OVERTURNING, "QSX5", "0.9"),
    ("5.2", LATERAL, "PPY1", "0.4"),
    ("61", OVERTURNING, "QPX1", "0.3"),
    ("PAC2002", SCALING, "LIP", "0.9"),
    # What no version knows.
    ("61", LATERAL, "PZZ9", "0"),
    ("PAC2002", SCALING, "LZZ", "1"),
    ("PAC2002", ALIGNING, "CONTACT_MODEL", "'3D_ENVELOPING'"),
    ("62", ALIGNING, "COMMENT", "of a fit"),
    # Empty values of what has a value without it.
    ("PAC2002", "DIMENSION", "WIDTH", ""),
    ("61", LATERAL, "PDY3", ""),
    ("61", LATERAL, "PKY4", ""),
    ("61", ROLLING, "QSY7", "''"),
    ("61", SCALING, "LMUX", ""),
    ("61", "VERTICAL_FORCE_RANGE", "FZMAX", ""),
    ("61", "STRUCTURAL", "LATERAL_STIFFNESS", ""),
    ("61", "OPERATING_CONDITIONS", "NOMPRES", ""),
]


@pytest.mark.parametrize(("version", "section", "key", "value"), NEUTRAL)
def test_what_changes_nothing_is_taken_and_told(version, section, key, value, path, recwarn):
    without = contents(version)
    without.get(section, {}).pop(key, None)
    before, told = loaded(written(path, without), recwarn)
    assert told == ""
    path.write_text(
        re.sub(rf"(?m)^{key} =.*$", f"{key} = {value}", "\n".join(lines(with_key(version, section, key, 0))))
    )
    after, told = loaded(path, recwarn)
    assert after == before
    assert "without effect here" in told
    assert key in told
    tyre.load(path)
    assert len(recwarn) == 1  # a warning is told once


def test_empty_values_that_nothing_reads_are_no_news(path, recwarn):
    sections = contents() | {"INERTIA": {"MASS": "", "IXX": ""}}
    sections["MODEL"] |= {"ROAD_INCREMENT": "", "FITTYP": ""}
    sections["UNITS"] |= {"MASS": ""}
    assert loaded(written(path, sections), recwarn)[1] == ""


@pytest.mark.parametrize("key", ["FNOMIN", "PCY1", "UNLOADED_RADIUS", "LONGVL"])
def test_an_empty_value_that_is_needed_is_named(key, path):
    text = "\n".join(lines(contents()))
    path.write_text(re.sub(rf"(?m)^{key} = .*$", f"{key} =", text))
    with pytest.raises(ValueError, match=rf"own.tir:\d+: {key}: expected a number, got ''"):
        tyre.load(path)


@pytest.mark.parametrize("unit", ["LENGTH", "FORCE", "TIME", "ANGLE"])
def test_a_unit_is_needed_where_a_number_has_it(unit, path):
    sections = contents()
    del sections["UNITS"][unit]
    if unit == "ANGLE":
        tyre.load(written(path, sections))
        sections["SLIP_ANGLE_RANGE"] = {"ALPMAX": 0.3}
    with pytest.raises(ValueError, match=rf"own.tir:1: {unit}: expected in .UNITS., because [A-Z_]+ has this unit"):
        tyre.load(written(path, sections))


def test_sections_and_keys_twice_with_the_same_values(path, recwarn):
    table = ["[DEFLECTION_LOAD_CURVE]", "{pen fz}", "0.0 0.0", "0.02 4000.0"]
    again = [
        f"[{OVERTURNING}]",
        "QSX2 = 7.0e-1",
        "QSX12 =",
        "QSX12 = 0",
        *table,
        f"[{LATERAL}]",
        "pdy1 = 0.980",
        *table,
    ]
    before, _ = loaded(written(path, contents("61")), recwarn)
    after, told = loaded(written(path, contents("61"), again), recwarn)
    assert after == before
    for name in (f"[{OVERTURNING}]", f"[{LATERAL}]", "[DEFLECTION_LOAD_CURVE]", "QSX2", "QSX12", "PDY1"):
        assert f"{name} a second time" in told


def test_two_values_of_a_key_are_refused(path):
    written(path, contents("61"), [f"[{LATERAL}]", "PDY1 = 1.05"])
    count = path.read_text().count("\n")
    first = path.read_text()[: path.read_text().index("PDY1")].count("\n") + 1
    with pytest.raises(
        ValueError, match=rf"own.tir:{count}: PDY1: .* in line {first} already, there 0.98 and here 1.05"
    ):
        tyre.load(path)


@pytest.mark.parametrize(
    ("section", "key", "home"),
    [
        ("OVERTURNING_COEFFICIENT", "QSX3", OVERTURNING),
        (ALIGNING, "QSX3", OVERTURNING),
        ("VERTICAL", "FZMAX", "VERTICAL_FORCE_RANGE"),
        ("LOAD_RANGE", "FZMAX", "VERTICAL_FORCE_RANGE"),
        ("SCALING", "LMUY", SCALING),
    ],
)
def test_a_coefficient_where_it_would_be_lost_is_refused(section, key, home, path):
    sections = contents()
    sections[OVERTURNING].pop("QSX3")
    sections[section] = {**sections.get(section, {}), key: 0.9}
    with pytest.raises(ValueError, match=rf"{key}: expected in .{home}., is in .{section}."):
        tyre.load(written(path, sections))


# Refused, with the size of the effect


def size(path, name):
    """What a refusal says that a force or moment would change."""
    with pytest.raises(ValueError, match=r"own.tir:\d+: [A-Z0-9]+: expected") as caught:
        tyre.load(path)
    return float(re.search(rf"{name} by up to (\S+) N", str(caught.value))[1])


def test_sizes_by_hand(path):
    """At 0.05 rad of camber and at the nominal load; M_x = -R_0 F_z QSX12 g |g| and the like."""
    written(path, with_key("PAC2002", OVERTURNING, "QSX12", 0.3))
    assert size(path, "M_x") == pytest.approx(R_0 * F_0 * 0.3 * 0.05**2, rel=5e-3)
    written(path, with_key("60", OVERTURNING, "QSX10", 0.4) | {OVERTURNING: {"QSX10": 0.4, "QSX11": 1.0}})
    assert size(path, "M_x") == pytest.approx(R_0 * F_0 * 0.4 * np.arctan(1.0) * 0.05, rel=5e-3)
    written(path, with_key("5.2", ROLLING, "QSY5", 2.0))
    assert size(path, "M_y") == pytest.approx(R_0 * F_0 * 2.0 * 0.05**2, rel=5e-3)
    written(path, with_key("PAC2002", SCALING, "LKG", 1.5))  # PHY3 and PVY3 of 1.5 times
    one, other = (with_key("PAC2002", LATERAL, "PHY3", -0.03 * k) for k in (1.0, 1.5))
    other[LATERAL] |= {"PVY3": -0.3, "PVY4": -0.15}
    # The largest of the changes over the slip angles is at least that straight ahead.
    straight = [
        tyre.load(written(path.with_stem(f"k{i}"), s)).forces(0, 0, 0.05, F_0, 16.6)[1]
        for i, s in enumerate((one, other))
    ]
    assert size(path, "F_y") >= 0.99 * abs(straight[1] - straight[0]) > 10.0


@pytest.mark.parametrize(
    ("version", "section", "key", "value"),
    [
        ("5.2", LATERAL, "PKY7", 0.5),
        ("PAC2002", ALIGNING, "QDZ11", 0.5),
        ("60", ROLLING, "QSY7", 0.9),
        ("5.2", LONGITUDINAL, "RBX3", 4.0),
        ("PAC2002", "TURNSLIP_COEFFICIENTS", "PDYP1", 0.4),
        ("5.2", "TURNSLIP_COEFFICIENTS", "QCRP1", 0.2),  # a torque of turning that its file leaves without a shape
    ],
)
def test_a_change_away_from_the_nominal_load_is_a_change(version, section, key, value, path):
    sections = with_key(version, section, key, value)
    sections[LONGITUDINAL] |= {"RBX1": 5.0, "RCX1": 1.0}
    with pytest.raises(ValueError, match=rf"own.tir:\d+: {key}: expected .*; got {value:g}, which would change "):
        tyre.load(written(path, sections))


def test_friction_that_falls_with_the_sliding_speed(path):
    written(path, with_key("61", SCALING, "LMUV", 0.25))
    assert 0.15 * F_0 < size(path, "F_x") < 0.21 * 1.08 * F_0  # at most the peak less the peak over 1.25


def test_a_friction_ellipse_is_refused_with_what_the_weights_reach(path):
    sections = contents()
    sections["MODEL"]["FE_METHOD"] = "YES"  # the file has no weights: both peaks at once, sqrt(2) of the ellipse
    with pytest.raises(ValueError, match=r"own.tir:\d+: FE_METHOD: expected 'NO'.* reach 1.41 of such an ellipse"):
        tyre.load(written(path, sections))


def test_a_scale_of_the_pressure(path):
    sections = with_key("PAC2002", SCALING, "LIP", 0.9)
    sections |= {"TIRE_CONDITIONS": {"IP": 2.2e5, "IP_NOM": 2.2e5}}
    sections[LATERAL]["PPY3"] = -0.5
    # dp = 1/0.9 - 1 lowers the peak of F_y to 1 - 0.5/9 of it, and the force at 0.1 rad by nearly as much.
    less = contents()
    less[LATERAL] |= {key: (1 - 0.5 / 9) * less[LATERAL][key] for key in ("PDY1", "PDY2")}
    low = tyre.load(written(path.with_stem("low"), less))
    high = tyre.load(written(path.with_stem("high"), contents()))
    change = max(abs(low.forces(0, 0.1, g, F_0, 16.6)[1] - high.forces(0, 0.1, g, F_0, 16.6)[1]) for g in (-0.05, 0.05))
    assert size(written(path, sections), "F_y") == pytest.approx(change, rel=5e-3)


# Pressure and format


def test_pressure_terms_without_a_pressure_are_told(path, recwarn):
    plain, _ = loaded(written(path, contents()), recwarn)
    subject, told = loaded(written(path, with_key("PAC2002", LATERAL, "PPY1", 0.4)), recwarn)
    assert subject.coefficients == plain.coefficients
    assert "PPY1, as the file has no nominal pressure" in told


def test_a_pressure_beyond_its_range_is_told(path, recwarn):
    sections = contents("61") | {"OPERATING_CONDITIONS": {"INFLPRES": 2.6e5, "NOMPRES": 2.2e5}}
    sections["INFLATION_PRESSURE_RANGE"] = {"PRESMIN": 1.8e5, "PRESMAX": 2.5e5}
    assert (
        "pressure 260000 Pa is beyond PRESMIN and PRESMAX, 180000 to 250000"
        in loaded(written(path, sections), recwarn)[1]
    )


def test_two_formats_in_one_file_are_told(path, recwarn):
    sections = contents("61")
    sections["MODEL"]["PROPERTY_FILE_FORMAT"] = "PAC2002"
    subject, told = loaded(written(path, sections), recwarn)
    assert subject.coefficients.FITTYP == 61.0
    assert "PROPERTY_FILE_FORMAT 'PAC2002', as FITTYP 61 decides" in told


def test_the_gyroscopic_couple_is_told_with_its_size(path, recwarn):
    sections = with_key("PAC2002", ALIGNING, "QTZ1", 0.2)
    sections[ALIGNING]["MBELT"] = 5.4
    assert "1.08 N m for each m/s of speed" in loaded(written(path, sections), recwarn)[1]


@pytest.mark.parametrize("version", FORMATS)
def test_what_lmuy_does_elsewhere_is_told_with_its_size(version, path, recwarn):
    """K_y = PKY1 FNOMIN sin(2 atan(1/PKY2)) at the nominal load, which LMUY leaves and another program multiplies."""
    subject, told = loaded(written(path, with_key(version, SCALING, "LMUY", 0.8)), recwarn)
    K_y = 17.5 * F_0 * np.sin(2 * np.arctan(1 / 1.8))
    assert tyre.cornering_stiffness(subject.coefficients, F_0) == pytest.approx(K_y)
    left, times = map(float, re.search(r"stiffness, (\S+) N/rad .* makes it (\S+) N/rad", told).groups())
    assert left == pytest.approx(K_y, rel=1e-3)
    assert times == pytest.approx(0.8 * K_y, rel=1e-3)
    assert loaded(written(path, with_key(version, SCALING, "LMUY", 1.0)), recwarn)[1] == ""


# Ways to write the same file

TEXT = "\n".join(lines(contents() | {"VERTICAL_FORCE_RANGE": {"FZMAX": 9000.0}}))
WAYS = {
    "no newline at the end": TEXT,
    "Windows": TEXT.replace("\n", "\r\n") + "\r\n",
    "byte order mark": "\ufeff" + TEXT,
    "lower case": TEXT.lower(),
    "spaces": re.sub(r"(?m)^", "  ", TEXT.replace(" = ", "   =    ").replace("[", "[ ").replace("]", " ]  ")),
    "no spaces": TEXT.replace(" = ", "="),
    "tabs": re.sub(r"(?m)^", "\t", TEXT.replace(" = ", "\t=\t")),
    "comments": re.sub(r"(?m)$", " $ a = [1]", TEXT).replace("\n", "\n! [UNITS]\n\n$ KEY = 1\n"),
    "comments without a space": re.sub(r"(?m)(?<=[0-9])$", "!x", TEXT),
    "other quotes": TEXT.replace("'", '"'),
    "no quotes": TEXT.replace("'", ""),
    "exponents of Fortran": re.sub(r"(?m)= (-?[0-9.]+)$", r"= \1D+00", TEXT),
    "signs": re.sub(r"(?m)= ([0-9.]+)$", r"= +\1", TEXT),
    "tables": TEXT + "\n[SHAPE]\n{radial width}\n 1.0 0.0\n 0.9 1.0\n[BOTTOMING_CURVE]\n{pen fz}\n0.1 0.0\n",
    "table first": "[SHAPE]\n{radial width}\n 1.0 0.0\n" + TEXT,
    "units in the plural": TEXT.replace("meter", "METERS").replace("newton", "Newtons").replace("second", "Seconds"),
    "header of another program": "[MDI_HEADER]\nFILE_TYPE ='tir'\nFILE_VERSION =3.0\n! : COMMENT : own\n" + TEXT,
    "block of comments": f"[MDI_HEADER]\nFILE_TYPE = 'tir'\n(COMMENTS)\n{{comment_string}}\n'Tire - own'\n{TEXT}",
    "own section": TEXT + "\n[MAKER]\nINFLATION_PRESSURE = 4.14\nTEST_NUMBER = ''\nWIDTH = 3\n",
    "FITTYP of 5.2": TEXT.replace("LONGVL", "FITTYP = 6\nLONGVL"),
    "FITTYP in quotes": TEXT.replace("LONGVL", "FITTYP = '21'\nLONGVL"),
}


@pytest.mark.parametrize("way", WAYS)
def test_one_file_written_in_many_ways(way, path, recwarn):
    path.write_bytes(TEXT.encode() + b"\n")
    plain, _ = loaded(path, recwarn)
    path.write_bytes(WAYS[way].encode())
    subject, told = loaded(path, recwarn)
    assert subject.coefficients == plain.coefficients
    assert subject.limits == plain.limits
    assert told == ""


UNITS = [
    ({"LENGTH": "mm"}, {"UNLOADED_RADIUS": 1e3, "LONGVL": 1e3, "VERTICAL_STIFFNESS": 1e-3}),
    ({"FORCE": "knewton"}, {"FNOMIN": 1e-3, "FZMAX": 1e-3, "VERTICAL_STIFFNESS": 1e-3}),
    ({"LENGTH": "inches"}, {"UNLOADED_RADIUS": 1 / 0.0254, "LONGVL": 1 / 0.0254, "VERTICAL_STIFFNESS": 0.0254}),
    ({"TIME": "Milliseconds"}, {"LONGVL": 1e-3}),
    ({"ANGLE": "deg"}, {}),
    ({"MASS": "stone"}, {}),  # which nothing uses
]


@pytest.mark.parametrize(("units", "factors"), UNITS)
def test_units(units, factors, path, recwarn):
    sections = contents() | {"VERTICAL_FORCE_RANGE": {"FZMAX": 9000.0}}
    plain, _ = loaded(written(path, sections), recwarn)
    for entries in sections.values():
        entries |= {key: entries[key] * factors[key] for key in entries.keys() & factors.keys()}
    sections["UNITS"] |= units
    subject, told = loaded(written(path, sections), recwarn)
    np.testing.assert_allclose(subject.coefficients, plain.coefficients, rtol=1e-14)
    np.testing.assert_allclose(subject.limits, plain.limits, rtol=1e-14)
    assert subject.vertical_stiffness == pytest.approx(plain.vertical_stiffness, rel=1e-14)
    assert told == ""


@pytest.mark.parametrize("value", ["1,31", "1_31", "1.31.0", "inf", "nan", "1e999", "'1.31'", "1.31 Shape", "١"])
def test_what_is_no_number_is_refused(value, path):
    path.write_text(TEXT.replace("PCY1 = 1.31", f"PCY1 = {value}"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"own.tir:\d+: PCY1: expected a number"):
        tyre.load(path)


# A range in a car


def ranged(path, low, high, **more):
    sections = contents() | {"VERTICAL_FORCE_RANGE": {"FZMIN": low, "FZMAX": high}}
    return written(path, sections | more)


@pytest.mark.parametrize(("low", "high"), [(300.0, 2500.0), (-2500.0, -300.0), (2500.0, 300.0)])
def test_range_of_loads(low, high, path):
    """A range holds magnitudes, as some files count loads downwards or name the larger one first."""
    top = tyre.load(ranged(path, low, high)).limits
    assert (top.load_low * F_0, top.load * F_0) == pytest.approx((300.0, 2500.0))


def test_what_is_beyond_a_range(path):
    subject = tyre.load(ranged(path, 300.0, 2500.0, SLIP_ANGLE_RANGE={"ALPMIN": -0.2, "ALPMAX": 0.25}))
    assert subject.beyond("F_z", [300.0, 1000.0, 2500.0]) is None
    found = subject.beyond("F_z", [[299.0, 400.0], [2501.0, 2500.0]])
    assert found[2:] == pytest.approx((299.0, 2501.0, 300.0, 2500.0, 0.5))
    assert "299 to 2501 N, 50 % of them beyond the range of own, 300 to 2500 N" in found.words
    assert subject.beyond("alpha", [0.1, -0.21]).share == 0.5
    assert subject.beyond("kappa", [-1.5, 1.5]) is None


def test_a_car_at_rest_beyond_the_range_of_its_tyre_is_told(path):
    car = cars.load("compact")
    c = car.chassis
    front = 0.5 * GRAVITY * c["mass"] * c["rear_axle"] / (c["front_axle"] + c["rear_axle"])
    with pytest.warns(cars.UnusualCar, match=rf"{front:.0f} N in front .* beyond the range of own, 100 to 2000 N"):
        cars.load("compact", {"tyre": str(ranged(path, 100.0, 2000.0))})
    cars.load("compact", {"tyre": str(ranged(path, 100.0, front + 1.0))})  # told of the drive instead


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
def test_a_drive_beyond_the_range_is_told_in_its_results(chassis, path):
    """Static loads are inside; those of the turn are not. The recording's own channels are the oracle."""
    base, limit = cars.load("compact"), 4400.0
    slips = {"SLIP_ANGLE_RANGE": {"ALPMIN": -0.004, "ALPMAX": 0.004}} if chassis == "two_track" else {}
    car = cars.load(base, {"tyre": str(ranged(path, 200.0, limit, **slips))})
    weave = replace(manoeuvres.make("weave"), chassis=chassis)
    recording = manoeuvres.drive(car, weave, "masing")
    loads = np.array(
        [recording[f"wheel_load_{wheel}"] for wheel in ("front_left", "front_right", "rear_left", "rear_right")]
    )
    largest = loads.max()
    assert largest > limit
    found = {each["quantity"]: each for each in recording.meta["beyond_tyre"]}
    assert found["F_z"]["largest"] == largest
    assert found["F_z"]["share"] == pytest.approx((loads > limit).mean())
    assert found.keys() == ({"F_z", "alpha"} if slips else {"F_z"})
    notes = next(iter(evaluate(recording).values())).notes
    assert any(f"to {largest:.4g} N" in note and "200 to 4400 N" in note for note in notes)
    page = assessment.make_page(assessment.assess({"own": recording}), {"own": recording}).html()
    assert all(note in page for note in notes)
    usual = manoeuvres.drive(base, weave, "masing")
    assert "beyond_tyre" not in usual.meta


@pytest.mark.filterwarnings("always::steer_env.vehicle.cars.UnusualCar")
def test_run_prints_the_loads(path, tmp_path, capsys):
    ranged(path, 100.0, 2000.0)
    assert main(["run", "weave", "--friction", "masing", "--tyre", str(path), "--out", str(tmp_path / "x")]) == 0
    printed = capsys.readouterr()
    assert "N in front" in printed.err
    assert re.search(r"note: wheel loads from \d+ to 4\d\d\d N, 100 % of them", printed.out)


def test_notes_are_printed_where_every_metric_is_refused(capsys):
    refused = Value(np.nan, np.nan, np.nan, "N m", "too slow", notes=("wheel loads beyond",))
    print_metrics({"one": refused, "other": refused}, "weave")
    assert capsys.readouterr().out.splitlines() == ["every metric refused: too slow", "note: wheel loads beyond"]


# Files and their truth, at random

KEYS = {  # of every version, with a spread that leaves a plausible tyre
    LONGITUDINAL: {
        "PDX2": 0.1,
        "PDX3": 0.5,
        "PEX2": 0.1,
        "PEX4": 0.1,
        "PKX2": 2.0,
        "PHX1": 0.002,
        "RBX1": 5.0,
        "RCX1": 0.5,
    },
    LATERAL: {
        "PDY2": 0.1,
        "PEY2": 0.5,
        "PEY3": 0.1,
        "PHY1": 0.003,
        "PVY1": 0.02,
        "RBY1": 5.0,
        "RCY1": 0.5,
        "RVY1": 0.05,
    },
    ALIGNING: {
        "QBZ2": 1.0,
        "QBZ5": 0.1,
        "QBZ10": 0.3,
        "QDZ2": 0.01,
        "QDZ6": 0.004,
        "QEZ2": 0.5,
        "QHZ1": 0.004,
        "SSZ1": 0.02,
    },
    OVERTURNING: {"QSX1": 0.01, "QSX2": 0.5, "QSX3": 0.1},
    ROLLING: {"QSY2": 0.02, "QSY3": 0.003, "QSY4": 1e-4},
    SCALING: {
        "LFZO": 0.1,
        "LCX": 0.05,
        "LKX": 0.1,
        "LMUX": 0.1,
        "LMUY": 0.1,
        "LKY": 0.1,
        "LTR": 0.1,
        "LVX": 0.2,
        "LMX": 0.1,
    },
}
OF_PAC2002 = {
    OVERTURNING: {
        "QSX4": 0.1,
        "QSX5": 0.5,
        "QSX6": 1.0,
        "QSX7": 0.5,
        "QSX8": 0.5,
        "QSX9": 0.5,
        "QSX10": 0.2,
        "QSX11": 0.5,
    },
    ROLLING: {"QSY5": 0.1, "QSY6": 0.05, "QSY7": 0.2},
}
FOREIGN = [  # versions, section, key and a value that changes a force
    (("5.2", "PAC2002", "60"), OVERTURNING, "QSX13", 0.02),
    (("5.2", "PAC2002", "60"), OVERTURNING, "QSX12", 0.4),
    (("5.2", "PAC2002"), LATERAL, "PEY5", 3.0),
    (("5.2", "PAC2002"), LATERAL, "PKY4", 1.7),
    (("5.2", "PAC2002"), LATERAL, "PKY6", -0.9),
    (("5.2", "PAC2002", "61", "62"), ALIGNING, "QBZ6", 9.0),
    (("60", "61", "62"), LATERAL, "PHY3", 0.05),
    (("60", "61", "62"), SCALING, "LGAY", 0.8),
    (("5.2", "60"), ROLLING, "QSY5", 0.2),
    (tuple(FORMATS), SCALING, "LMUV", 0.3),
    (tuple(FORMATS), SCALING, "LKG", 1.4),
]


def random_text(rng, sections):
    """The sections in one of the ways in which people write them."""
    style = {
        "equals": rng.choice(["=", " = ", "\t=  ", "  ="]),
        "end": rng.choice(["", " $ note", "   ! x = 1", "\t$[A]"]),
        "before": rng.choice(["", " ", "\t"]),
        "lower": rng.random() < 0.2,
        "digits": rng.choice(["r", ".16e", "D"]),
    }

    def number(value):
        if style["digits"] == "r":
            return repr(float(value))
        return f"{value:.16e}".replace("e", "D" if style["digits"] == "D" else "e")

    made = []
    for name, entries in sections.items():
        made += [f"${'-' * 20}{name.lower()}"] if rng.random() < 0.5 else []
        made.append(f"{style['before']}[{name}]")
        for key, value in entries.items():
            text = value if isinstance(value, str) else number(value)
            made.append(
                f"{style['before']}{key.lower() if style['lower'] else key}{style['equals']}{text}{style['end']}"
            )
        made += [""] if rng.random() < 0.3 else []
    return str(rng.choice(["\n", "\r\n"])).join(made) + str(rng.choice(["", "\n"]))


def random_case(rng):
    """A version, the text of a file, the numbers that hold for it, and the key for which it is refused, if it is."""
    version = str(rng.choice(list(FORMATS)))
    sections = contents(version)
    for source, most in ((KEYS, 8), (OF_PAC2002 if version == "PAC2002" else {}, 6)):
        pairs = [(section, key, spread) for section, keys in source.items() for key, spread in keys.items()]
        for i in rng.permutation(len(pairs))[: rng.integers(0, most + 1)]:
            section, key, spread = pairs[i]
            sections[section][key] = float((key[0] == "L") + spread * rng.uniform(-1.0, 1.0))
    q = Numbers({key: v for entries in sections.values() for key, v in entries.items() if isinstance(v, float)})
    refused = ""
    for _ in range(rng.integers(0, 3)):  # what changes nothing
        version_, section, key, value = NEUTRAL[rng.integers(len(NEUTRAL))]
        if version_ == version and key not in q and key != "COMMENT":
            sections[section] = {**sections.get(section, {}), key: value or "''"}
    for name in ("UNITS", "MODEL"):
        sections[name] = {key: f"'{v}'" if isinstance(v, str) else v for key, v in sections[name].items()}
    kind = rng.integers(0, 6)
    if kind == 0:
        versions, section, key, value = FOREIGN[rng.integers(len(FOREIGN))]
        if version in versions:
            sections[section][key], refused = value, key
    elif kind == 1:
        sections[LATERAL]["PDY1"], refused = str(rng.choice(["0,98", "0.9.8", "''", "high", "1e999"])), "PDY1"
    elif kind == 2:
        sections[ALIGNING]["QZZ3"], refused = 0.1, "QZZ3"
    elif kind == 3:
        sections["LATERAL_COEFFICIENT"], refused = {"PVY2": 0.1}, "PVY2"
    text = random_text(rng, sections)
    if kind == 4:
        section = str(rng.choice([LATERAL, ALIGNING, OVERTURNING]))
        key = str(rng.choice(list(contents(version)[section])))
        other = rng.random() < 0.5
        text += f"\n[{section}]\n{key} = {float(sections[section][key]) + other!r}\n"
        refused = key if other else ""
    return version, text, q, refused


@pytest.mark.filterwarnings("ignore::steer_env.vehicle.tyre.TyreFile")
def test_files_at_random_are_right_or_refused_by_name(path):
    """Forces against the second transcription of the equations; none is wrong, and none that is valid is refused."""
    rng = np.random.default_rng(56)
    counts = {True: 0, False: 0}
    for _ in range(200):
        version, text, q, refused = random_case(rng)
        path.write_bytes(text.encode())
        counts[bool(refused)] += 1
        if refused:
            with pytest.raises(ValueError, match=rf"own\.tir:\d+: {refused}: "):
                tyre.load(path)
            continue
        subject = tyre.load(path)
        for _ in range(4):
            kappa, alpha, gamma = rng.uniform(-0.2, 0.2, 3) * (1.0, 1.0, 0.5)
            F_z, v_x = rng.uniform(500.0, 8000.0), rng.uniform(3.0, 50.0)
            if version == "60":
                expected = book(q, kappa, alpha, gamma, F_z, v_x)
            else:
                expected = mf_tyre(int(version) if version.startswith("6") else 52, q, kappa, alpha, gamma, F_z, v_x)
            agree(subject.forces(kappa, alpha, gamma, F_z, v_x), expected, F_z)
    assert min(counts.values()) > 50
