"""Stability of the assist loop."""

import math
from collections.abc import Iterator

from steer_env.experiments.studies.common.assist_margins import TARGETS, assist_cells, on_target
from steer_env.vehicle import cars
from steer_env.vehicle.steering import column, eps, margins
from tests.verification.common.rows import Row, verdict


def rows() -> Iterator[Row]:
    """Margins of the assist loop, handwheel held."""
    check, default = column.make(K_tb=143.0, I2=0.06, C2=0.8, C_tb=0.0), eps.make()
    for gain, phase, decibel in ((5.0, 56.0, 13.0), (10.0, 35.0, 7.0)):
        m = margins.margins(check, default, gain, 0.0)
        found = math.degrees(m.phase), 20.0 * math.log10(m.gain)
        passed = m.stable and abs(found[0] - phase) <= 2.0 and abs(found[1] - decibel) <= 0.5
        required = f"{phase:g} +- 2 deg, {decibel:g} +- 0.5 dB"
        yield Row(f"check loop, gain {gain:g}", f"{found[0]:.1f} deg, {found[1]:.1f} dB", required, verdict(passed))
    bare = eps.make(bandwidth=80.0, delay=1.5e-3, lead_zero=150.0, lead_pole=150.0, damping=[0.0] * 6)
    for gain, stable in ((1.0, "stable"), (2.0, "unstable")):
        found_stable = "stable" if margins.margins(check, bare, gain, 0.0).stable else "unstable"
        yield Row(f"without lead and damping, gain {gain:g}", found_stable, stable, verdict(found_stable == stable))
    for speed in 3.6 * cars.load().assist.speeds:
        cells = assist_cells("compact", speed)
        measured = f"{min(cell.phase_deg for cell in cells):.1f} deg, {min(cell.gain_db for cell in cells):.1f} dB"
        required = ">= {:g} deg, {:g} dB".format(*TARGETS)
        yield Row(f"default car, {speed:.0f} km/h, least", measured, required, verdict(all(map(on_target, cells))))
