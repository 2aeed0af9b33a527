"""A torsion bar that makes the assist loop unstable is named; no metric becomes NaN without a reason."""

import pytest

from steer_env import manoeuvres
from steer_env.vehicle import cars
from steer_env.vehicle.steering import eps

CAR = cars.load()


@pytest.mark.parametrize(
    ("assist", "what"), [(eps.make(), "no handwheel amplitude"), (CAR.assist, "the motor torque jumps")]
)
def test_an_unstable_assist_loop_is_named(assist, what):
    stiff = CAR._replace(column=CAR.column._replace(K_tb=1e4), assist=assist)
    with pytest.raises(ValueError, match=f"{what}.*the assist loop is unstable there: K_tb 10000 N m/rad"):
        manoeuvres.drive(stiff, manoeuvres.make("weave"))


def test_a_stiff_bar_without_assist_drives():
    stiff = CAR._replace(
        column=CAR.column._replace(K_tb=1e4), assist=manoeuvres.common.driving.without_assist(CAR.assist)
    )
    manoeuvres.drive(stiff, manoeuvres.make("weave", cycles=3))
