"""Integration of the column."""

import math
from collections.abc import Iterator

import numpy as np

from steer_env.experiments.studies.integrators import (
    TWELVE,
    Case,
    integrate,
    relative_error,
    twelve_cases,
    twelve_references,
)
from steer_env.friction.law import law_of
from steer_env.vehicle.steering import column
from tests.verification.common.rows import Row, at_most, verdict

STEP = 1e-3  # [s]
MOST = {"lugre": 0.001, "masing": 0.002}  # RMS error of the friction torque at 1 ms, relative to F_c


def rows() -> Iterator[Row]:
    """Column against DOP853 at 1e-10, twelve cases: RMS error of the friction torque at 1 ms, and bounded at 10 ms."""
    for law, most in MOST.items():
        growth, balance = [], []
        for case, exact, (F_c, distance, frequency) in zip(twelve_cases(law), twelve_references(law), TWELVE):
            error = relative_error(case, "midpoint", STEP, exact, F_c)
            yield at_most(f"{law}, F_c {F_c:g} N m, {distance:g} deg, {frequency:g} Hz", error, most, "of F_c")
            (T_F, w), (_, fine) = (integrate(case, "midpoint", step) for step in (1e-2, STEP))
            growth.append((np.abs(T_F).max() / np.abs(exact).max(), np.abs(w).max() / np.abs(fine).max()))
            balance.append(_energy_missing(case))
        torque, speed = np.max(growth, axis=0)
        # at this step LuGre's damper adds to F_c
        yield Row(
            f"{law}, bounded at 10 ms: peak torque", f"{torque:.2f}", "<= 1.3 of the true", verdict(torque <= 1.3)
        )
        yield Row(f"{law}, bounded at 10 ms: peak speed", f"{speed:.2f}", "<= 1.1 of the true", verdict(speed <= 1.1))
        yield at_most(f"{law}, energy balance", balance, 1e-12, "J")


def _energy_missing(case: Case) -> float:
    """Work of hands and road, less the energy gained and the losses in dampers and friction, over a run [J]."""
    c, p = case.c._replace(C1=0.05), case.friction  # so that every term of the equations is in use
    q, memory, work = np.zeros(4), np.zeros(law_of(p).memory_size(p)), []
    for t in STEP * (np.arange(round(case.duration / STEP)) + 0.5):
        T1, T_C = case.amplitude * math.sin(2.0 * math.pi * case.frequency * t), -case.K_road * q[column.COLUMN_ANGLE]
        w1, w2, T_F = column.step_torque(c, p, 1.0, q, memory, T1, T_C, STEP)
        work.append(T1 * w1 + (T_C - T_F) * w2 - c.C1 * w1**2 - c.C2 * w2**2 - c.C_tb * (w1 - w2) ** 2)
    return abs(STEP * math.fsum(work) - column.energy(c, q))
