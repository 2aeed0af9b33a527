"""Integration of the column."""

import math
from collections.abc import Iterator
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.experiments.studies.common.column_schemes import SCHEMES, Case, integrate, reference
from steer_env.friction.law import law_of
from steer_env.vehicle.steering import column
from tests.verification.common.rows import Row, at_most, verdict

STEP = 1e-3  # [s]
MOST = {"lugre": 0.001, "masing": 0.002}  # RMS error of the friction torque at 1 ms, relative to F_c
SCHEME, *OTHERS = SCHEMES  # the project's comes first
# Friction F_c [N m], pre-sliding distance [deg] and frequency [Hz] of the cases.
TWELVE = tuple(product((0.3, 0.9, 3.0), (0.05, 0.5), (0.2, 2.0)))


def twelve_cases(law: str) -> list[Case]:
    """The cases of ``TWELVE``, two cycles each, for "lugre" or "masing".

    The pre-sliding distance is ``F_c/sigma_0`` for LuGre, with a damping ratio of 0.5 of the pre-sliding mode, and the
    length of the virgin curve for Masing. The hand torque exceeds the friction by 0.3 N m, which moves the column at up
    to 0.3 to 0.5 rad/s, as the on-centre weave does (0.33 rad/s). Faster reversals cost accuracy: with an excess of
    0.5 N m, 0.7 rad/s, the error of the stiffest LuGre case is 0.12 %; with 2 N m, 2.7 rad/s, it is 0.22 %.
    """
    c = column.make()
    cases = []
    for F_c, distance, frequency in TWELVE:
        length = math.radians(distance)
        if law == "lugre":
            stiffness = F_c / length
            p = friction.make(law, F_c=F_c, sigma_0=stiffness, sigma_1=math.sqrt(stiffness * c.I2))
        else:
            p = friction.make(law, F_c=F_c, x_c=length)
        cases.append(Case(c, p, F_c + 0.3, frequency, 2.0 / frequency))
    return cases


@cache
def twelve_references(law: str) -> list[NDArray[np.float64]]:
    """Reference means over steps of 1 ms for the twelve cases."""
    return [reference(case, STEP) for case in twelve_cases(law)]


def relative_error(case: Case, scheme: str, exact: NDArray[np.float64], unit: float) -> float:
    """RMS error of the friction torque at 1 ms over ``unit`` [N m]; ``exact`` holds the means over these steps."""
    return float(np.sqrt(np.mean((integrate(case, scheme, STEP)[0] - exact) ** 2)) / unit)


def rows() -> Iterator[Row]:
    """Column against DOP853 at 1e-10, twelve cases: RMS error of the friction torque at 1 ms, and bounded at 10 ms."""
    for law, most in MOST.items():
        growth, balance = [], []
        cases = list(zip(twelve_cases(law), twelve_references(law), TWELVE))
        for case, exact, (F_c, distance, frequency) in cases:
            error = relative_error(case, SCHEME, exact, F_c)
            yield at_most(f"{law}, F_c {F_c:g} N m, {distance:g} deg, {frequency:g} Hz", error, most, "of F_c")
            (T_F, w), (_, fine) = (integrate(case, SCHEME, step) for step in (1e-2, STEP))
            growth.append((np.abs(T_F).max() / np.abs(exact).max(), np.abs(w).max() / np.abs(fine).max()))
            balance.append(_energy_missing(case))
        torque, speed = np.max(growth, axis=0)
        # at this step LuGre's damper adds to F_c
        yield Row(
            f"{law}, bounded at 10 ms: peak torque", f"{torque:.2f}", "<= 1.3 of the true", verdict(torque <= 1.3)
        )
        yield Row(f"{law}, bounded at 10 ms: peak speed", f"{speed:.2f}", "<= 1.1 of the true", verdict(speed <= 1.1))
        yield at_most(f"{law}, energy balance", balance, 1e-12, "J")
        for scheme in OTHERS:
            error = max(relative_error(case, scheme, exact, F_c) for case, exact, (F_c, *_) in cases)
            yield Row(f"{law}, {scheme} in comparison: worst", f"{error:.1e}", "no limit", "pass")


def _energy_missing(case: Case) -> float:
    """Work of hands and road, less the energy gained and the losses in dampers and friction, over a run [J]."""
    c, p = case.c._replace(C1=0.05), case.friction  # so that every term of the equations is in use
    q, memory, work = np.zeros(4), np.zeros(law_of(p).memory_size(p)), []
    for t in STEP * (np.arange(round(case.duration / STEP)) + 0.5):
        T1, T_C = case.amplitude * math.sin(2.0 * math.pi * case.frequency * t), -case.K_road * q[column.COLUMN_ANGLE]
        w1, w2, T_F = column.step_torque(c, p, 1.0, q, memory, T1, T_C, STEP)
        work.append(T1 * w1 + (T_C - T_F) * w2 - c.C1 * w1**2 - c.C2 * w2**2 - c.C_tb * (w1 - w2) ** 2)
    return abs(STEP * math.fsum(work) - column.energy(c, q))
