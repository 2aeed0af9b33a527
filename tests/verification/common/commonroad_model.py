"""CommonRoad's multi-body model as an oracle for our two-track car, which ``cross_validation`` compares with it.

``vehiclemodels.vehicle_dynamics_mb`` has 29 states: the body, two axles that springs join to it, and four wheels, on
steady-state Magic Formula tyres. Its axes are SAE (y right, z down, nose up positive); everything here is ISO 8855.
Every difference beyond the limits has a name and a switch in the CommonRoad model: a value (``QUIRKS``) or a few lines
of code (``CODE``). Run as a module with ``--write`` it writes the stored reference.

Source: commonroad-vehicle-models 3.0.2 (BSD). Its bounds of 0.4 rad/s of steering and 11.5 m/s2 are not reached here.
"""

import argparse
import copy
import dataclasses
import inspect
import json
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from vehiclemodels.init_mb import init_mb
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from steer_env.recording.recording import Recording
from tests.verification.common.commonroad_manoeuvres import (
    MANOEUVRES,
    Manoeuvre,
    acceleration,
    longest_step,
    recording_of,
    road_wheel_angle,
    sample_times,
)
from tests.verification.common.commonroad_reference import FILE, STORED, interval

Array = NDArray[np.float64]

VEHICLE, CAR = 2, "bmw_320i"  # of the reference: their vehicle by its number, and our car with its parameters


def _jump(p: Any) -> None:
    """p_hy1 and p_vy1 times sign(gamma): 2 % of the load, one way or the other, where a wheel passes upright."""
    p.tire.p_hy1 = p.tire.p_vy1 = 0.0


def _drag(p: Any) -> None:
    """p_hx1, and p_vx1 inside the sine: a drag of 1 % of the load at zero slip."""
    p.tire.p_hx1 = p.tire.p_vx1 = 0.0


def _one_sided(p: Any) -> None:
    """Shifts of combined slip, the same on both sides of the car: left and right turns differ, and F_y(0) is not 0."""
    p.tire.r_hx1 = p.tire.r_hy1 = p.tire.r_by3 = p.tire.r_vy1 = 0.0


def _load_point(p: Any) -> None:
    """The wheel load acts K_lt F_y beside the middle of the wheel."""
    p.K_lt = 0.0


def _joint(p: Any) -> None:
    """A spring and a damper join body and axles sideways; they follow the force of the tyres after some 0.06 s."""
    p.K_ras *= 100.0
    p.K_rad *= 10.0


QUIRKS: dict[str, Callable[[Any], None]] = {
    "jump": _jump,
    "drag": _drag,
    "one-sided": _one_sided,
    "load point": _load_point,
    "joint": _joint,
}


def reconciled(parameters: Any, quirks: Iterable[str] = tuple(QUIRKS)) -> Any:
    """A copy of their parameters without the named peculiarities, all of ``QUIRKS`` by default.

    Differences that take more than values are in ``CODE``. The camber thrust against the inclination of the wheel
    stays, as ``steer_env.vehicle.commonroad.tyre`` has it too. KeyError for an unknown name.
    """
    p = copy.deepcopy(parameters)
    for name in quirks:
        QUIRKS[name](p)
    return p


_BALANCE = "    #dynamics common with single-track model\n"


def _before_balance(*lines: str) -> dict[str, str]:
    """Lines that run when all forces are known; SAE axes."""
    return {_BALANCE: "".join(f"    {line}\n" for line in lines) + _BALANCE}


# Lines of CommonRoad's code and what replaces them, where that model lacks something or differs from ours.
CODE: dict[str, Mapping[str, str]] = {
    # Their slip angles use the lateral speed of the sprung centre of gravity, from which that of the axle differs
    # by the roll rate times the height between them; x[15] and x[20] are the lateral speeds of the axles.
    "axle slip": {
        "(x[10] + p.a*x[5] - x[14]*(p.R_w - x[16]))": "(x[15] - x[14]*(p.R_w - x[16]))",
        "(x[10] - p.b*x[5] - x[19]*(p.R_w - x[21]))": "(x[20] - x[19]*(p.R_w - x[21]))",
    },
    # Their yaw moments are about the sprung centre of gravity; here they are about that of the whole car.
    "centres": _before_balance(
        "sumY = (F_y_LF + F_y_RF)*math.cos(x[2]) + (F_x_LF + F_x_RF)*math.sin(x[2]) + F_y_LR + F_y_RR",
        "sumN -= (p.m_uf*p.a - p.m_ur*p.b)/p.m*sumY",
    ),
    # Roll moves the centre of gravity out of the middle of the tracks, so that F_x gives a yaw moment.
    "lean": _before_balance("sumN += sumX*math.sin(x[6])*p.m_s/p.m*(p.h_s - p.R_w)"),
    # Their wheels have no angular momentum.
    "spin": _before_balance(
        "momentum = p.I_y_w*(x[23] + x[24] + x[25] + x[26])",
        "sumL -= x[5]*momentum",
        "sumN += x[7]*momentum",
    ),
    # Their axles are beams with a roll centre fixed in the middle. Independent wheels pass all roll moments to the
    # body, except those of the load (and its shift), of the springs, and of the links, which act along the body's y.
    "beams": _before_balance(
        "Y_f = (F_y_LF + F_y_RF)*math.cos(x[2]) + (F_x_LF + F_x_RF)*math.sin(x[2])",
        "link_f = 0.5*p.T_f*math.sin(x[6])*(F_y_LF - F_y_RF) - (p.h_raf - x[16])*Y_f",
        "link_r = 0.5*p.T_r*math.sin(x[6])*(F_y_LR - F_y_RR) - (p.h_rar - x[21])*(F_y_LR + F_y_RR)",
        "shift_f = p.K_lt*(F_z_LF*F_y_LF + F_z_RF*F_y_RF)",
        "shift_r = p.K_lt*(F_z_LR*F_y_LR + F_z_RR*F_y_RR)",
        "sumL_uf = 0.5*p.T_f*(F_SRF - F_SLF + F_z_LF - F_z_RF) + link_f - shift_f",
        "sumL_ur = 0.5*p.T_r*(F_SRR - F_SLR + F_z_LR - F_z_RR) + link_r - shift_r",
        "sumL += F_RAF*(p.R_w - p.h_raf) - Y_f*(p.R_w - x[16]) - link_f",
        "sumL += F_RAR*(p.R_w - p.h_rar) - (F_y_LR + F_y_RR)*(p.R_w - x[21]) - link_r",
    ),
    # Their loads act below the wheel centres. The load of an inclined wheel acts in the wheel plane, height times
    # camber to the side. Virtual work on the camber, x[6] + D (x[6] - x[13]) T/2, divides the moment between body
    # and axle.
    "contact": _before_balance(
        "lean_f = (p.R_w - x[16])*(gamma_LF*F_z_LF + gamma_RF*F_z_RF)",
        "lean_r = (p.R_w - x[21])*(gamma_LR*F_z_LR + gamma_RR*F_z_RR)",
        "sumL += (1 + 0.5*p.D_f*p.T_f)*lean_f + (1 + 0.5*p.D_r*p.T_r)*lean_r",
        "sumL_uf -= 0.5*p.D_f*p.T_f*lean_f",
        "sumL_ur -= 0.5*p.D_r*p.T_r*lean_r",
        "sumN += (p.R_w - x[16])*(gamma_LF*F_x_LF + gamma_RF*F_x_RF)",
        "sumN += (p.R_w - x[21])*(gamma_LR*F_x_LR + gamma_RR*F_x_RR)",
    ),
    # Their whole F_x pitches the body at the sprung height. Here its sprung share does, at the wheel centres, and the
    # torques do.
    "pitch": _before_balance(
        "sumM_s += p.m*p.R_w*u[1] - sumX*(p.m_s/p.m*(p.R_w - x[16]) + (1 - p.m_s/p.m)*(p.h_s - x[11]))"
    ),
}


@lru_cache
def _dynamics(code: tuple[str, ...]) -> Callable[[list[float], list[float], Any], list[float]]:
    if not code:
        return vehicle_dynamics_mb
    source = inspect.getsource(sys.modules[vehicle_dynamics_mb.__module__])
    for name in code:
        for original, new in CODE[name].items():
            if original not in source:
                raise RuntimeError(f"vehicle_dynamics_mb is not that of version 3.0.2: no line with {original!r}")
            source = source.replace(original, new)
    scope: dict[str, Any] = {}
    exec(source, scope)
    return scope["vehicle_dynamics_mb"]


def _wheel_loads(p: Any, x: Array) -> Array:
    """Wheel loads (4, T) from height and roll of the axles, as the CommonRoad model computes them [N]."""
    loads = []
    for roll, height, track in ((x[13], x[16], p.T_f), (x[18], x[21], p.T_r)):
        middle, side = height + p.R_w * (np.cos(roll) - 1.0), 0.5 * track * np.sin(roll)
        loads += [p.K_zt * (middle - side), p.K_zt * (middle + side)]
    return np.array(loads)


def drive(
    parameters: Any, manoeuvre: Manoeuvre, code: Iterable[str] = (), dt: float = 0.005, tolerance: float = 1e-8
) -> Recording:
    """Drive their multi-body model.

    Parameters
    ----------
    parameters : vehiclemodels.vehicle_parameters.VehicleParameters
        Of vehicle 1, 2 or 3.
    manoeuvre : Manoeuvre
    code : iterable of str
        Names from ``CODE``: lines of CommonRoad's code that are changed, to show the effect.
    dt : float
        Between the samples of the recording [s].
    tolerance : float
        Relative tolerance of the integration (LSODA); the absolute one is a hundredth of it.

    Returns
    -------
    Recording
        Channels in SI and ISO 8855, as ``commonroad_manoeuvres.UNITS`` names them. ``speed`` and ``lateral_speed`` are
        those of the sprung centre of gravity, along the body's x and y. ``lateral_acceleration`` is the sum of the
        tyres' forces along y over the whole mass; ``sprung_lateral_acceleration`` is v_y' + v_x r. Roll is positive to
        the right, pitch nose down.

    Raises
    ------
    KeyError
        For an unknown name in ``code``.
    RuntimeError
        If a wheel locks or the integration fails, with the reason of the solver.
    """
    p, dynamics = parameters, _dynamics(tuple(code))

    def derivative(t: float, state: Any) -> list[float]:
        x = state.tolist()
        lost = x.pop()
        angle, rate = road_wheel_angle(manoeuvre, t)
        x[2] = -float(angle)
        u = [-float(rate), acceleration(manoeuvre, t, x[3], lost)]
        return [*dynamics(x, u, p), manoeuvre.speed - x[3]]

    times = sample_times(manoeuvre, dt)
    start = [*init_mb([0.0, 0.0, 0.0, manoeuvre.speed, 0.0, 0.0, 0.0], p), 0.0]

    def grip(t: float, x: Any) -> float:
        return p.R_w * min(x[23:27]) - 0.5 * x[3]

    grip.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        derivative,
        (0.0, times[-1]),
        start,
        "LSODA",
        times,
        events=grip,
        max_step=longest_step(manoeuvre),
        rtol=tolerance,
        atol=0.01 * tolerance,
    )
    if run.t.size < times.size:
        reason = "a wheel locks" if run.success else run.message
        raise RuntimeError(f"{manoeuvre} on CommonRoad's model ends after {run.t[-1]:g} s: {reason}")
    x = run.y
    rates = np.array([derivative(t, state) for t, state in zip(times, x.T)]).T
    angle = road_wheel_angle(manoeuvre, times)[0]
    # Joints and springs exert internal forces only, so the tyres' forces are those that accelerate the masses.
    v_x, r = x[3], x[5]
    sideways = [m * (rates[i] + v_x * r) for m, i in ((p.m_s, 10), (p.m_uf, 15), (p.m_ur, 20))]
    command = [acceleration(manoeuvre, t, v, lost) for t, v, lost in zip(times, v_x, x[29])]
    values = [
        *(angle, command, v_x, -x[10], -r),
        *(rates[3] - r * x[10], -sum(sideways) / p.m, -(rates[10] + v_x * r)),
        *(x[6], -x[8]),
        *_wheel_loads(p, x),
        *x[23:27],
        *(x[0], -x[1], -x[4]),
    ]
    return recording_of(times, values, manoeuvre)


def histories(name: str, parameters: Any) -> dict[str, Recording]:
    """Their side of one of ``MANOEUVRES``, published and reconciled, sampled as the reference is."""
    manoeuvre = MANOEUVRES[name]
    dt = interval(manoeuvre)
    return {
        "published": drive(parameters, manoeuvre, dt=dt),
        "reconciled": drive(reconciled(parameters), manoeuvre, CODE, dt),
    }


def numbers(parameters: Any) -> dict[str, Any]:
    """Their parameters by name, those of the tyre nested, without other models and the bounds of the driver."""
    values = dataclasses.asdict(parameters)
    return {key: value for key, value in values.items() if key not in ("steering", "longitudinal", "trailer")}


def write(path: Path = FILE) -> None:
    """Write the reference; the file appears whole or not at all."""
    p = setup_vehicle_parameters(vehicle_id=VEHICLE)
    about = {
        "source": f"commonroad-vehicle-models, vehicle {VEHICLE} (BMW 320i), multi-body model",
        "licence": "BSD",
        "version": metadata.version("commonroad-vehicle-models"),
        "command": "python -m tests.verification.common.commonroad_model --write",
        "car": CAR,
        "parameters": numbers(p),
    }
    arrays = {
        f"{name}.{case}": np.array([run[channel] for channel in STORED], np.float32)
        for name in MANOEUVRES
        for case, run in histories(name, p).items()
    }
    part = path.with_name(f".{path.name}.{os.getpid()}.part.npz")
    try:
        np.savez_compressed(part, about=np.array(json.dumps(about)), **arrays)  # type: ignore[arg-type]
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=write.__doc__)
    parser.add_argument("--write", action="store_true", required=True, help=f"{FILE}")
    parser.parse_args()
    write()
