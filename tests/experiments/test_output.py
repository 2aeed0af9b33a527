"""What the report is made with: atomic output, worker processes, provenance, differences of metrics."""

import csv
import io
import json
import os
import re
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from steer_env import friction, metrics
from steer_env.experiments import sweep
from steer_env.experiments.cli.main import main
from steer_env.experiments.pages import files, options, pages, pictures, provenance, style, words
from steer_env.experiments.pages.files import replaced_directory, write_text
from steer_env.experiments.reports import report
from steer_env.experiments.studies.common import battery
from steer_env.metrics.common.confidence import difference
from steer_env.vehicle import cars

CONTENTS = report.CONTENTS
ROOT = Path(__file__).parents[2]


@contextmanager
def no_room(size):
    """Files take no more than so many bytes, as on a disk that is full."""
    resource = pytest.importorskip("resource", reason="this system has no such limit")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_is_told_with_the_file_that_found_no_room(tmp_path, capsys):
    store = sweep.Store(tmp_path / "store", {})
    with no_room(1000):
        code = main(["run", "rig", "--out", str(tmp_path / "rig.csv")])
        with pytest.raises(OSError, match=r"File too large: .*store"):
            store.save("a", bytes(2000))
        with pytest.raises(OSError, match=r"File too large: .*page"):
            write_text(tmp_path / "page.html", "x" * 2000)
    assert code == 2
    assert f"steer-env run: {tmp_path / 'rig.csv'}: File too large" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["store"]


@pytest.mark.parametrize("known", [["lugre"], ["lugre", "masing", "dahl"], sorted(friction.available())])
def test_labels_of_ones_own_look_like_no_other(known):
    """Fitted files and laws with parameters beside packaged laws; these keep their looks."""
    labels = [*known, "rig.json", "lugre,F_c=1.2"]
    found = style.styles(labels)
    looks = {(look["color"], str(look["linestyle"])) for look in found.values()}
    assert set(found) == set(labels)
    assert len(looks) == len(labels)
    assert all(found[law] | {"zorder": 0.0} == style.styles([law])[law] | {"zorder": 0.0} for law in known)


def test_a_law_from_outside_looks_the_same_on_every_page_and_like_no_other(toy):
    """In colour alone, as some pictures have no dashes."""
    own = style.styles(["toy_jenkins"])["toy_jenkins"]["color"]
    packaged = [law for law in friction.available() if law != "toy_jenkins"]
    assert style.styles([*packaged, "toy_jenkins"])["toy_jenkins"]["color"] == own
    assert style.styles(["lugre", "toy_jenkins", "rig.json"])["toy_jenkins"]["color"] == own
    assert own not in style.colours(packaged)


@pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")
@pytest.mark.parametrize("name", [*cars.available(), str(ROOT / "examples" / "assist_functions.toml")])
def test_every_car_can_be_written_as_json_with_the_functions_of_its_assist(name):
    car = cars.load(name)
    told = json.loads(json.dumps(provenance.car(car), allow_nan=False))["assist"]
    assert told["boost"]["value"] == car.assist.boost.tolist()
    gains = {key: told[key]["value"] for key in ("return_gain", "friction_share") if key in told}
    for key, value in gains.items():
        np.testing.assert_array_equal(np.ravel(value), np.ravel(car.data()["assist"][key]))
    assert bool(gains) == (name == "compact_tuned" or name.endswith(".toml"))


def test_shares_are_of_the_value_or_of_the_usual_range():
    value, base = (metrics.Value(x, x, x, "ms", repeats=(x - 0.1, x + 0.1)) for x in (2.0, 1.0))
    found = battery.difference("yaw_lag", value, base)  # usual range 50 to 120 ms
    assert found.value == 1.0
    assert found.half_width == pytest.approx(0.1 * 2**0.5 * stats.t.ppf(0.975, 2))  # Welch, equal variances
    assert found.share == pytest.approx(1.0 / 70.0)


@pytest.mark.filterwarnings("error")
def test_the_interval_of_a_difference_is_that_of_scipy_without_its_warning():
    rng = np.random.default_rng(3)
    a, b = rng.normal(2.0, 0.3, 7), rng.normal(2.5, 0.6, 12)
    expected = stats.ttest_ind(b, a, equal_var=False).confidence_interval(0.95)
    assert difference(a, b) == pytest.approx((b.mean() - a.mean(), expected.low, expected.high), rel=1e-9)
    nearly = np.array([1.0, 1.0, 1.0 + 1e-15])
    gap, low, high = difference(nearly, b)
    assert low < gap < high


def test_an_error_or_an_interrupted_swap_leaves_the_old_report(tmp_path, monkeypatch):
    out = tmp_path / "report"
    out.mkdir()
    (out / "index.html").write_text("old")
    rename = os.rename

    def interrupted(source, target):
        if target == out and not str(source).endswith(".old"):
            raise KeyboardInterrupt
        rename(source, target)

    def write(error):
        with replaced_directory(out, CONTENTS) as part:
            (part / "index.html").write_text("new")
            if error is RuntimeError:
                raise error

    monkeypatch.setattr("steer_env.experiments.pages.files.os.rename", interrupted)
    for error in (RuntimeError, KeyboardInterrupt):
        with pytest.raises(error):
            write(error)
        assert [path.name for path in tmp_path.rglob("*")] == ["report", "index.html"]
        assert (out / "index.html").read_text() == "old"


def test_a_directory_with_other_files_is_not_replaced(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ValueError, match=r"holds other files \(thesis\.tex\)"):
        report.build_report(tmp_path, {})
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_the_digest_covers_all_four_packages_once():
    found = provenance.source_files()
    for name in (
        "env.py",
        "friction/law.py",
        "vehicle/plant.py",
        "experiments/cli/main.py",
        "vehicle/data/cars/compact.json",
    ):
        assert name in found
    files = [path.resolve() for path in found.values()]
    assert len(files) == len(set(files))
    assert not [name for name in found if name.startswith("steer_env/")]


@style.as_svg
def _drawn():
    figure = style.new_figure(4.0, 3.0)
    axes = figure.subplots()
    axes.plot([0.0, 1.0, 2.0], [0.0, 0.123456, -0.4], label='a "b" & <c>')
    axes.barh([0.0], [1.0])
    axes.legend()
    return figure


def test_a_smaller_picture_is_the_same_picture():
    """Every word and every line stays, each point within a twentieth of a point of paper."""
    from xml.etree import ElementTree

    drawn = _drawn()
    small = style.smaller(drawn)
    assert len(small) < 0.5 * len(drawn)
    svg = "{http://www.w3.org/2000/svg}"
    before, after = ElementTree.fromstring(drawn), ElementTree.fromstring(small)
    text, path = f"{svg}text", f"{svg}path"
    assert [each.text for each in before.iter(text)] == [each.text for each in after.iter(text)]
    for one, other in zip(before.iter(path), after.iter(path), strict=True):
        points = [float(x) for x in re.findall(r"-?\d+\.?\d*", one.get("d", ""))]
        assert _absolute(other.get("d", "")) == pytest.approx(points, abs=0.0501)
    rules = dict(re.findall(r"([.\w]+)\{([^}]*)\}", small))
    assert all(f".{name}" in rules for each in after.iter() for name in each.get("class", "").split())
    cut = [one.get("clip-path") is not None for one in before.iter(path)]
    assert [
        any("clip" in rules[f".{name}"] for name in other.get("class", "").split()) for other in after.iter(path)
    ] == cut
    assert any(cut)
    for one, other in zip(before.iter(text), after.iter(text), strict=True):
        shown = f"{rules['text']}; {rules['.' + other.get('class')]}"
        assert _declared(shown) == _declared(one.get("style"))
    assert pages.image(drawn).startswith("data:image/svg+xml,<svg")
    assert not set('"&#') & set(pages.image(drawn))  # which would end the attribute, or the address


def _declared(style):
    """Property -> value of a style."""
    return dict(tuple(part.strip() for part in each.split(":")) for each in style.split(";") if each.strip())


def _absolute(path):
    """The points of a path whose segments are relative to the end of the one before."""
    found, end, begin = [], (0.0, 0.0), (0.0, 0.0)
    for command, text in re.findall(r"([A-Za-z])([^A-Za-z]*)", path):
        numbers = [float(x) for x in re.findall(r"-?\d+\.?\d*", text)]
        base = (0.0, 0.0) if command == "M" else end
        points = [(base[0] + x, base[1] + y) for x, y in zip(numbers[::2], numbers[1::2])]
        begin = points[0] if command == "M" else begin
        end = points[-1] if points else begin
        found += [x for point in points for x in point]
    return found


def test_pictures_are_kept_as_files_with_their_data(tmp_path):
    with style.picture_folder(tmp_path):
        text = [_drawn(), _drawn()][0]
    expected = {f"drawn{number}.{form}" for form in ("csv", "pdf", "png", "svg") for number in ("", "_2")}
    assert {each.name for each in tmp_path.iterdir()} == expected
    assert (tmp_path / "drawn.svg").read_text(encoding="utf-8") == text
    assert (tmp_path / "drawn.pdf").read_bytes().startswith(b"%PDF")
    assert (tmp_path / "drawn.png").read_bytes().startswith(b"\x89PNG")
    rows = list(csv.DictReader((tmp_path / "drawn.csv").read_text(encoding="utf-8").splitlines()))
    line = [row for row in rows if row["label"] == 'a "b" & <c>']
    assert [(float(row["x"]), float(row["y"])) for row in line] == [(0.0, 0.0), (1.0, 0.123456), (2.0, -0.4)]
    assert ("1.0", "0.0") in [(row["x"], row["y"]) for row in rows]  # the end of the bar
    assert _drawn() == text  # which is kept nowhere
    assert len(list(tmp_path.iterdir())) == 8


def test_a_table_with_a_decimal_comma_is_the_same_table():
    rows = [("name", "x"), ("a, b", 1.5), ("c;d", -2.0), ("e.f", 3)]
    with files.csv_decimal(","):
        text = files.csv_text(rows)
    assert '"c;d";-2,0' in text
    read = [[name, x.replace(",", ".")] for name, x in csv.reader(io.StringIO(text), delimiter=";")]
    assert read == list(csv.reader(io.StringIO(files.csv_text(rows))))


def test_the_data_of_a_picture_name_its_rows(tmp_path):
    """Dots of laws stand at places, whose names are in the file as they are in the picture."""
    with style.picture_folder(tmp_path):
        pictures.dots({"lugre": (1.0, 0.9, 1.1), "bouc_wen": (2.0, 1.9, 2.2)}, "left [%]", name="left")
    rows = list(csv.DictReader((tmp_path / "left.csv").read_text(encoding="utf-8").splitlines()))
    found = {(row["y_name"], float(row["x"])) for row in rows}
    assert found == {("lugre", x) for x in (0.9, 1.0, 1.1)} | {("bouc wen", x) for x in (1.9, 2.0, 2.2)}
    assert {(row["x_axis"], row["x_name"]) for row in rows} == {("left [%]", "")}


@pytest.mark.parametrize(
    ("x", "half", "text"),
    [
        (8.5032, 0.0123, "8.50 ± 0.01"),
        (0.066249, 6e-5, "0.0662 ± 6·10⁻⁵"),
        (-1.3196, 0.71, "−1.3 ± 0.7"),
        (0.1256, 0.06, "0.13 ± 0.06"),
        (123.4, 40.0, "120 ± 40"),
        (2.0, float("nan"), "2"),
        (0.0, 0.0, "0 ± 0"),
    ],
)
def test_a_value_ends_where_its_interval_begins(x, half, text):
    assert words.within(x, half) == text


def test_long_work_without_a_terminal_says_every_tenth_part(capsys, monkeypatch):
    monkeypatch.setenv("STEER_ENV_QUIET", "0")
    monkeypatch.setattr(options, "LONG", -1.0)
    with options.progress("driving", 50) as notify:
        for k in range(51):
            notify(k, f"case {k}")
    lines = [line for line in capsys.readouterr().err.splitlines() if line != "steer-env: driving"]
    assert len(lines) == 9
    assert re.fullmatch(r"steer-env: 10 % done after 0:0\d min, 0:0\d left, case 5", lines[0])
    monkeypatch.setattr(options, "LONG", 1000.0)
    with options.progress("driving") as notify:
        notify(0.5, "more")
    assert capsys.readouterr().err == ""


class Elapsed(threading.Timer):
    """A timer whose time has gone by when it starts."""

    def start(self):
        self.function(*self.args)


def test_long_work_says_soon_what_it_does_and_how_long_the_rest_takes(capsys, monkeypatch):
    """Of twenty equal parts, before which as much time goes by as ten of them take, as where kernels are compiled."""
    now = 0.0
    monkeypatch.setenv("STEER_ENV_QUIET", "0")
    monkeypatch.setattr(options.threading, "Timer", Elapsed)
    monkeypatch.setattr(options.time, "monotonic", lambda: now)
    with options.progress("compiling and driving") as notify:
        for k in range(1, 21):
            now = 10.0 + k
            notify(k / 20, f"case {k}")
    first, *lines = capsys.readouterr().err.splitlines()
    assert first == "steer-env: compiling and driving"
    minutes = [re.search(r"after (\S+) min, (\S+) left", line).groups() for line in lines]
    assert minutes == [(f"0:{10 + k:02d}", f"0:{20 - k:02d}") for k in range(2, 20, 2)]


def test_work_may_say_a_line_every_ten_seconds(capsys, monkeypatch):
    now = 0.0
    monkeypatch.setenv("STEER_ENV_QUIET", "0")
    monkeypatch.setattr(options.time, "monotonic", lambda: now)
    with options.progress("tuning", every=10.0) as notify:
        for k in range(1, 31):
            now = float(k)
            notify(0.001 * k, f"set {k}")
    said = [re.search(r"after (\S+) min.*, set (\d+)$", line).groups() for line in capsys.readouterr().err.splitlines()]
    assert said == [("0:10", "10"), ("0:20", "20"), ("0:30", "30")]


def test_curves_that_coincide_are_named():
    phase = np.linspace(0.0, 2.0 * np.pi, 400)
    base = {"handwheel_angle": 0.2 * np.cos(phase), "handwheel_torque": 3.0 * np.cos(phase - 0.3)}
    late = {name: np.roll(values[:-1], 7) for name, values in base.items()}  # the same line, begun elsewhere
    weak = {**base, "handwheel_torque": 0.97 * base["handwheel_torque"]}
    assert pictures.coincident({"lugre": base, "masing": late, "dahl": weak}) == ["masing"]


def test_a_difference_of_values_near_zero_is_not_seventeen_fold():
    """A residual angle of 0.007 deg that becomes 0.13 deg, as a share of the least angle that shares are felt by."""
    value, base = (metrics.Value(x, x, x, "deg", repeats=(x, x)) for x in (0.13, 0.007))
    found = battery.difference("residual_handwheel_angle", value, base)
    assert found.share == pytest.approx(0.123 / 3.0)
    assert not found.matters
