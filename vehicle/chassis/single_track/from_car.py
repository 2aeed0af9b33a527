"""Parameters of the single-track chassis from a car."""

from typing import Any

from steer_env.vehicle.chassis.common.interface import CarData
from steer_env.vehicle.chassis.single_track.layout import SingleTrack
from steer_env.vehicle.constants import AIR_DENSITY

LOAD_TIME = 0.02  # time constant of the geometric load transfer, assumed [s]


def from_car(car: CarData, v_x: float, mu: float, road: Any) -> SingleTrack:
    """Parameters of a car at a held speed [m/s] on a level road with a friction factor.

    Raises
    ------
    ValueError
        A road, which this chassis cannot take.
    """
    if road is not None:
        raise ValueError("road needs chassis='two_track', got chassis='single_track'")
    c = car.chassis
    roll_centre = float(car.strut.straight.roll_centre_height)
    axle_height = (roll_centre * c["rear_axle"] + c["rear_roll_centre"] * c["front_axle"]) / (
        c["front_axle"] + c["rear_axle"]
    )
    h = c["sprung_height"] - axle_height
    return SingleTrack(
        v_x=v_x,
        mu=mu,
        m=c["mass"],
        m_s=c["sprung_mass"],
        m_uf=c["front_unsprung_mass"],
        m_ur=c["mass"] - c["sprung_mass"] - c["front_unsprung_mass"],
        a=c["front_axle"],
        b=c["rear_axle"],
        I_xr=c["roll_inertia"] + c["sprung_mass"] * h * h,
        I_z=c["yaw_inertia"],
        h=h,
        t_f=c["front_track"],
        t_r=c["rear_track"],
        # (V11)
        K_f=0.5 * c["front_spring"] * c["front_track"] ** 2 + c["front_anti_roll"],
        K_r=0.5 * c["rear_spring"] * c["rear_track"] ** 2 + c["rear_anti_roll"],
        B_f=c["front_anti_roll"] / c["front_track"],
        C_f=0.5 * c["front_damper"] * c["front_track"] ** 2,
        C_r=0.5 * c["rear_damper"] * c["rear_track"] ** 2,
        h_f=roll_centre,
        h_r=c["rear_roll_centre"],
        R_w=car.strut.loaded_radius,
        drag=0.5 * AIR_DENSITY * c["drag_area"],
        sigma_y=car.tyre.relaxation_length,
        stiffness_f=c["front_cornering_stiffness_factor"],
        stiffness_r=c["rear_cornering_stiffness_factor"],
        # (V13), (V14): rolling to the right lowers the left wheel in its arch
        roll_steer_r=-0.5 * c["rear_bump_steer"] * c["rear_track"],
        roll_camber_r=1.0 - 0.5 * c["rear_camber_gain"] * c["rear_track"],
        compliance_steer_r=c["rear_lateral_compliance"],
        K_rack=car.rack_stiffness(),
        T_rack=c["compliance_time"],
        T_load=LOAD_TIME,
        T_drive=c["speed_hold_time"],
    )
