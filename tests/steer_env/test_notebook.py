"""What results show in a notebook: short texts, tables, frames and pictures."""

import importlib.util

import matplotlib.pyplot as plt
import numpy as np
import pytest

from steer_env import friction, metrics
from steer_env.friction.numerics import shown
from steer_env.recording import Recording
from steer_env.recording.recording import DEGREE
from steer_env.vehicle import cars
from tests.needs import needs
from tests.synthetic.cases import CASES

TIME = np.linspace(0.0, 1.0, 11)


@pytest.fixture
def small():
    channels = {"handwheel_angle": DEGREE * TIME, "yaw_rate": 0.5 * TIME, "column_speed": 0.25 * TIME}
    units = {"handwheel_angle": "rad", "yaw_rate": "rad/s", "column_speed": "rad/s"}
    return Recording(TIME, channels, units, {"manoeuvre": "weave"})


@pytest.fixture(scope="module")
def fit():
    x = 0.03 * np.sin(np.pi * np.arange(0.0, 6.0, 0.005))
    return friction.fit(x, friction.response("dahl", x, 0.005), "dahl", dt=0.005)


@pytest.fixture(scope="module")
def evaluated():
    return metrics.evaluate(CASES["weave, linear car"].make(200.0)[0])


@pytest.fixture
def pictures():
    plt.switch_backend("agg")
    yield
    plt.close("all")


def curves(axes):
    return [line.get_xydata().T for line in axes.lines]


def test_texts_are_short_and_name_what_is_there(small, fit, evaluated):
    for found, words in (
        (small, ("weave", "3 channels", "11 samples")),
        (cars.load("compact"), ("compact", "1400 kg", "2.7 m")),
        (fit, ("dahl", "F_c=")),
        (evaluated, (f"{len(evaluated)} metrics",)),
    ):
        assert len(repr(found)) < 200
        assert all(word in repr(found) for word in words), repr(found)


def test_tables_have_a_row_for_each_part(small, fit, evaluated):
    car = cars.load("compact")
    for found, names in (
        (small, small.channels),
        (car, ("chassis.mass", "column.K_tb")),
        (fit, fit.parameters._fields),
        (evaluated, evaluated),
    ):
        assert all(f"<td>{name}</td>" in found._repr_html_() for name in names)


def test_a_channel_without_a_value_is_shown(small):
    gone = Recording(TIME, {"yaw_rate": np.full(11, np.nan)}, {"yaw_rate": "rad/s"})
    assert "<td>nan</td>" in gone._repr_html_()


def test_texts_of_a_table_are_no_markup():
    assert "<td>&lt;b&gt;</td>" in shown.html("", [{"a": "<b>"}])


@needs("pandas")
def test_frames_hold_the_numbers(small, fit, evaluated):
    frame = small.to_frame()
    np.testing.assert_array_equal(frame["yaw_rate"], small["yaw_rate"])
    np.testing.assert_array_equal(frame.index, small.time)
    assert frame.attrs["units"] == small.units
    assert fit.to_frame().loc["F_c", "value"] == fit.parameters.F_c
    assert tuple(fit.to_frame().loc["F_c", ["low", "high"]]) == fit.intervals["F_c"]
    name = next(iter(evaluated))
    assert evaluated.to_frame().loc[name, "value"] == evaluated[name].value


def test_a_frame_without_pandas_says_what_to_install(small, monkeypatch):
    monkeypatch.setattr(shown, "find_spec", lambda name: None if name == "pandas" else importlib.util.find_spec(name))
    with pytest.raises(ImportError, match="pip install pandas"):
        small.to_frame()


def test_a_recording_is_drawn_in_degrees(small, pictures):
    axes = small.plot("time", "handwheel_angle")
    np.testing.assert_allclose(curves(axes), [[TIME, TIME]])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "handwheel angle [deg]")
    assert small.plot("handwheel_angle", ["yaw_rate", "column_speed"], axes) is axes
    np.testing.assert_allclose(curves(axes)[2], [TIME, 0.25 * TIME / DEGREE])
    assert axes.get_legend() is not None


def test_channels_of_several_units_are_not_drawn_together(small):
    with pytest.raises(ValueError, match=r"one unit, got .* in .'deg', 'deg/s'."):
        small.plot("time", ["yaw_rate", "handwheel_angle"])


def test_a_fit_is_drawn_on_its_record(fit, pictures):
    record, law = curves(fit.plot())
    np.testing.assert_array_equal(record, [fit.record.x, fit.record.torque])
    np.testing.assert_allclose(law, record, atol=1e-3)  # the record is of the law, without noise
    with pytest.raises(ValueError, match=r"fit\.plot\(record\)"):
        fit._replace(record=None).plot()


def test_unknown_names_are_answered_with_near_ones(small, evaluated):
    with pytest.raises(ValueError, match="did you mean handwheel_angle"):
        small["handwheel_angel"]
    name = next(iter(evaluated))
    with pytest.raises(KeyError, match=f"did you mean .*{name}"):
        evaluated[name[:-1]]
