"""The study of a pulse with free hands: its table, its marks and its picture, on a car of few runs."""

import re

import pytest

from steer_env.experiments.studies import hands_off
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import free_control


def test_table_and_picture(tmp_path, capsys):
    hands_off.main(["--friction", "lugre", "--stride", "25", "--out", str(tmp_path / "picture.svg")])
    text, picture = capsys.readouterr().out, (tmp_path / "picture.svg").read_text()
    car = cars.load()
    for chassis in cars.SPEEDS:
        assert f"{chassis}, 3 N m for 0.3 s" in text
        found = free_control.pulse(car.plant(None, 50.0, chassis=chassis))
        assert f"50 m/s, {car.friction}, {chassis}, 3 N m: {found.verdict}, and " in text
        assert picture.count(f"{chassis.replace('_', ' ')}: 5 N m") == 1
    count = len(cars.SPEEDS) * 2 * 3 * 3  # chassis, torques, laws, speeds
    assert int(re.search(r"same verdict in \d+ of (\d+) runs", text)[1]) == count
    assert "no friction" in picture


def test_speeds_below_the_first_failure():
    """A pass beyond a failure does not count."""
    verdicts = {10.0: "settles", 20.0: "decays", 30.0: "settles", 40.0: "spins"}
    of = {v: hands_off.Outcome(verdict, verdict, "", [], 0.0) for v, verdict in verdicts.items()}
    assert hands_off.free_of(of, {"decays", "oscillates", "spins"}) == "10 m/s"
    assert hands_off.free_of(of, {"spins"}) == "30 m/s"
    assert hands_off.free_of(of, {"settles"}) == "none"


def test_differences_at_half_the_step_are_named():
    case = hands_off.Case("two_track", 3.0, "lugre")
    of = {10.0: hands_off.Outcome("settles", "settles", "", [], 0.0)}
    of[20.0] = hands_off.Outcome("settles", "decays", "", [], 0.0)
    text = hands_off.half_step({case: of})
    assert text.splitlines() == [
        "Half the step: the same verdict in 1 of 2 runs",
        "  two_track, 3 N m, lugre, 20 m/s: settles, then decays",
    ]


@pytest.mark.parametrize("stride", ["0", "-1", "nan", "60"])
def test_stride_is_checked(stride, capsys):
    with pytest.raises(SystemExit):
        hands_off.main(["--stride", stride])
    assert "--stride must be from 0.1 to 50" in capsys.readouterr().err
