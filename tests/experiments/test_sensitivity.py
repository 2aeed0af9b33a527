"""Sensitivity: indices against closed forms and finite differences, the page and its numbers, bad input."""

import json
import math
import re

import numpy as np
import pytest

from steer_env import friction, targets
from steer_env.experiments.calibration import screening, sensitivity, sensitivity_page
from steer_env.experiments.calibration.variation import Block, Outputs, Study
from steer_env.experiments.cli.main import main
from steer_env.vehicle import cars
from tests.needs import needs

pytestmark = needs("SALib")

LAW = friction.make("lugre")
PAIR = ("boost_level", "damping_level")


@pytest.fixture(scope="module")
def car():
    return cars.load()


def study(car, names=PAIR, span=0.5):
    return Study(car, LAW, "single_track", sensitivity.factors_of(car, LAW, names, span))


def ishigami(x):
    """Ishigami and Homma's function on [-pi, pi]^3, with a = 7 and b = 0.1."""
    z = math.pi * (2.0 * x - 1.0)
    return np.sin(z[..., 0]) + 7.0 * np.sin(z[..., 1]) ** 2 + 0.1 * z[..., 2] ** 4 * np.sin(z[..., 0])


def test_sobol_gives_the_closed_form_of_ishigami():
    d = screening.design(3, "sobol", 4096, 1)
    found = screening.effects(d, ishigami(d.points))
    a, b = 7.0, 0.1
    variance = a**2 / 8 + b * math.pi**4 / 5 + b**2 * math.pi**8 / 18 + 0.5
    first = [0.5 * (1 + b * math.pi**4 / 5) ** 2 / variance, a**2 / 8 / variance, 0.0]
    pair = 8 * b**2 * math.pi**8 / 225 / variance
    total = [first[0] + pair, first[1], pair]
    assert [effect.first for effect in found] == pytest.approx(first, abs=0.02)
    assert [effect.total for effect in found] == pytest.approx(total, abs=0.02)
    assert [effect.size for effect in found] == pytest.approx([math.sqrt(12 * t * variance) for t in total], rel=0.03)
    assert found[1].sign == found[2].sign == 0  # even about the middle, and odd by the first parameter only
    assert all(effect.low < effect.size < effect.high for effect in found)


@pytest.mark.parametrize(("method", "n", "close"), [("morris", 8, 1e-12), ("sobol", 512, 0.02)])
def test_a_linear_function_gives_its_coefficients(method, n, close):
    """Signed changes over the range, no spread, and of outputs that are sometimes refused the same."""
    slopes = np.array([3.0, -2.0, 0.0])
    d = screening.design(3, method, n, 0)
    outputs = d.points @ slopes + 5.0
    for missing in (0, 3):
        outputs[:missing, 1] = np.nan
        found = screening.effects(d, outputs)
        assert [effect.size for effect in found] == pytest.approx(abs(slopes), abs=3.0 * close)
        assert [effect.mean for effect in found] == pytest.approx(slopes, abs=1e-9)
        assert [effect.sign for effect in found] == [1, -1, 0]
    if method == "morris":
        assert max(effect.spread for effect in found) < 1e-12
    outputs[: n - 3, 1] = np.nan
    assert screening.effects(d, outputs) is None
    assert screening.effects(d, np.ones_like(outputs))[0].size == 0.0


def linear(block: Block) -> list[Outputs]:
    """Metrics that are the logarithm of the first parameter, and the second."""
    names = block.study.outputs
    first = "weave", "torque_at_0g"
    return [Outputs({name: math.log(a) if name == first else b for name in names}, {}) for a, b in block.rows]


def test_the_whole_path_gives_the_changes_of_a_linear_function(car, monkeypatch):
    """From the ranges through cases and rows to the shares of the bands."""
    monkeypatch.setattr(sensitivity, "evaluate", linear)
    posed = study(car, ("boost_level=0.5:2", "load=0:200"))
    results = sensitivity.collect(posed, targets.load("compact"), "lugre", screening.design(2, "morris", 6, 0))
    rows = {row.name: row for row in results.rows}
    change = math.log(4.0)
    assert [e.mean for e in rows["torque_at_0g"].effects] == pytest.approx([change, 0.0], abs=1e-12)
    assert [e.mean for e in rows["torque_at_0p1g"].effects] == pytest.approx([0.0, 200.0], abs=1e-9)
    row = rows["torque_at_0g"]
    assert row.own == 0.0
    assert sensitivity_page.share(row, row.effects[0]) == pytest.approx(change / (2.0 - 0.6))


@pytest.mark.whole
def test_small_ranges_give_the_finite_differences_at_the_centre(car):
    """Central differences of the metrics by the environment's own evaluation, over a range of one per cent."""
    names, high = ("boost_level=0.995:1.005", "damping_level=0.99:1.01", "load=0:20"), (1.005, 1.01, 20.0)
    posed = study(car, names)
    middle = [math.sqrt(f.low * f.high) if f.logarithmic else 0.5 * (f.low + f.high) for f in posed.factors]
    results = sensitivity.collect(posed, targets.load("compact"), "lugre", screening.design(3, "morris", 4, 0))
    rows = {row.name: row for row in results.rows}
    for i, (factor, top) in enumerate(zip(posed.factors, high, strict=True)):
        ends = [tuple(end if k == i else x for k, x in enumerate(middle)) for end in (factor.low, top)]
        low, above = sensitivity.evaluate(Block(posed, tuple(ends), "ends"))
        for name in ("torque_at_0p1g", "steady_step_torque", "handwheel_torque_mean", "free_damping_ratio"):
            change = above.values[rows[name].test, name] - low.values[rows[name].test, name]
            largest = max(abs(e.mean) for e in rows[name].effects)
            assert rows[name].effects[i].mean == pytest.approx(change, rel=0.02, abs=0.01 * largest), (
                factor.name,
                name,
            )


def test_what_is_refused_is_told_and_the_rest_is_kept(car, tmp_path):
    """Ranges beyond the stability of the loop: outputs with their reasons, and sets that the law does not allow."""
    posed = study(car, ("boost_level=0.9:3.0", "friction.F_c=0.5:0.95"))
    block = Block(posed, ((3.0, 0.9), (1.0, 0.95), (1.0, 0.9)), "three")
    unstable, forbidden, fine = sensitivity.evaluate(block)
    torque, peak = ("weave", "torque_at_0p1g"), ("parking", "handwheel_torque_peak")
    assert "the assist loop is unstable" in unstable.refused[peak]
    assert math.isfinite(unstable.values[torque])
    assert "F_s must be at least F_c" in forbidden.refused[torque]
    assert set(forbidden.values) == set(fine.values)
    assert not any(name in fine.refused for name in (torque, peak))


@pytest.mark.parametrize(
    ("names", "reason"),
    [
        (("boost_level", "friction.F_c=1:2"), "F_s must be"),
        (("boost_level", "column.K_tb=100:5000"), "the assist loop is unstable"),  # has margins at every point
    ],
)
def test_ranges_in_which_no_metric_has_an_effect_are_refused(names, reason, car):
    with pytest.raises(ValueError, match=rf"is refused at most parameter sets: .*{reason}.*; narrow the ranges"):
        sensitivity.collect(study(car, names), targets.load("compact"), "lugre", screening.design(2, "morris", 4, 0))


def test_targets_without_a_band_are_refused(car):
    empty = targets.load("compact")._replace(bands={})
    with pytest.raises(ValueError, match="targets 'compact' have no band for weave"):
        sensitivity.collect(study(car, ("boost_level", "load")), empty, "lugre", screening.design(2, "morris", 4, 0))


def test_a_parameter_of_a_site_is_varied_as_if_it_were_given(car):
    """The growth of the gear's friction stays that of its efficiency; a site that is not there is refused."""
    text = "lugre,F_c={},efficiency=0.88@gear+coulomb,F_c={}@upper_column"
    given, names = text.format(0.8, 0.1), ("friction.gear.F_c", "friction.upper_column.F_c")
    factors = sensitivity.factors_of(car, friction.resolve(given), names)
    assert [(f.low, f.own, f.high, f.unit) for f in factors] == [(0.4, 0.8, 1.6, "N m"), (0.05, 0.1, 0.2, "N m")]
    (varied,) = sensitivity.evaluate(Block(Study(car, given, "single_track", factors), ((0.6, 0.15),), "varied"))
    own = Study(car, text.format(0.6, 0.15), "single_track", sensitivity.factors_of(car, LAW, PAIR))
    (expected,) = sensitivity.evaluate(Block(own, (tuple(f.own for f in own.factors),), "given"))
    assert varied == expected
    with pytest.raises(ValueError, match=r"has no number 'friction.rack.F_c'"):
        sensitivity.factors_of(car, friction.resolve(given), ("load", "friction.rack.F_c"))


def test_an_efficiency_varies_up_to_one(car):
    (factor, _) = sensitivity.factors_of(car, "lugre@column_eps", ("friction.column_eps.efficiency", "load"))
    assert (factor.low, factor.own, factor.high) == (0.44, 0.88, 1.0)


@pytest.mark.parametrize(
    ("given", "key", "own"),
    [
        ("lugre@column_eps", "column_eps.F_c", 0.9),
        ("lugre@column_eps", "column_eps.efficiency", 0.88),
        ("lugre,driving=0.1@column_eps", "column_eps.driving", 0.1),
        ("masing,F_c=0.8,efficiency=0.9@gear", "gear.F_c", 0.8),
        ("masing,efficiency=0.9@gear", "gear.efficiency", 0.9),
    ],
)
def test_what_is_varied_of_sites_is_what_their_text_takes(car, given, key, own):
    factor = sensitivity.factors_of(car, given, ("load", f"friction.{key}={0.9 * own}:{1.05 * own}"))[1]
    assert factor.own == own
    assert repr(friction.varied(given, {key: factor.low})) != repr(friction.resolve(given))


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ("lugre@column_eps", "gear.F_c"),
        ("lugre,driving=0.1@column_eps", "column_eps.efficiency"),
        ("lugre,efficiency=0.9@gear", "gear.driving"),
    ],
)
def test_what_the_text_of_sites_does_not_take_is_refused(car, given, key):
    with pytest.raises(ValueError, match=f"has no number 'friction.{key}'; this friction has friction"):
        sensitivity.factors_of(car, given, ("load", f"friction.{key}=0.1:0.2"))


@pytest.mark.whole
def test_json_and_repeatability(tmp_path):
    """The command twice in other places and processes: the same numbers to the bit; bands, signs."""
    words = ["sensitivity", "--parameters", "boost_level", "damping_level", "--also", "column.K_tb"]
    for name, workers in (("one", "1"), ("two", "2")):
        place = ["--samples", "4", "--workers", workers, "--out", str(tmp_path / name)]
        assert main([*words, *place]) == 0
    texts = [(tmp_path / name / "sensitivity.json").read_text(encoding="utf-8") for name in ("one", "two")]
    one, two = (json.loads(text) for text in texts)
    one["trace"] = two["trace"] = None
    assert one == two
    assert one["parameters"]["column.K_tb"]["unit"] == "N m/rad"
    torque = one["outputs"]["torque_at_0p1g"]
    assert torque["effects"]["boost_level"]["sign"] == -1
    boost, (low, high) = torque["effects"]["boost_level"], torque["band"]
    assert boost["share"] == pytest.approx(boost["size"] / (high - low))
    assert torque["effects"]["boost_level"]["matters"]
    assert not torque["effects"]["column.K_tb"]["matters"]
    assert one["outputs"]["gain_margin"]["effects"]["column.K_tb"]["sign"] == -1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--parameters", "boost", "load"], "has no number 'boost'; there are boost_level, "),
        (["--parameters", "load"], "--parameters needs two or more of them, got load"),
        (["--parameters", "load", "--also", "load=0:1"], "--parameters gives load twice"),
        (["--also", "load=100"], "takes a range as load=LOW:HIGH, got '100'"),
        (["--also", "load=100:100"], "the range must be finite, with LOW below HIGH"),
        (["--also", "load=0:900"], r"load=0:900: it may go from 0 to 500 \[kg\]"),
        (["--also", "steering.friction_asymmetry"], "is 0: give its range"),
        (["--also", "assist.torques"], "has no number 'assist.torques'"),
        (["--manoeuvre", "weave"], "--manoeuvre has no effect with --method morris"),
        (["--span", "0"], "--span must be finite and greater than 0"),
        (["--samples", "3"], "--samples must be at least 4, got 3"),
        (["--method", "sobol", "--samples", "48"], "a power of two with --method sobol, as 32 or 64, got 48"),
    ],
)
def test_bad_input(words, message, tmp_path, capsys):
    assert main(["sensitivity", *words, "--out", str(tmp_path)]) == 2
    assert re.search(message, capsys.readouterr().err)
