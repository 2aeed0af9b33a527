"""A torsion bar that makes the assist loop unstable is named; no metric becomes NaN without a reason."""

import pytest

from steer_env import manoeuvres
from steer_env.vehicle import cars

CAR = cars.load()


@pytest.mark.parametrize("stiffness", [1e4, 1e5])
def test_an_unstable_assist_loop_is_named(stiffness):
    stiff = CAR._replace(column=CAR.column._replace(K_tb=stiffness))
    what = f"the motor torque jumps .*; the assist loop is unstable there: K_tb {stiffness:g} N m/rad"
    with pytest.raises(ValueError, match=what):
        manoeuvres.drive(stiff, manoeuvres.make("weave"))


def test_a_stiff_bar_without_assist_drives():
    stiff = CAR._replace(
        column=CAR.column._replace(K_tb=1e4), assist=manoeuvres.common.driving.without_assist(CAR.assist)
    )
    manoeuvres.drive(stiff, manoeuvres.make("weave", cycles=3))
