"""One calibration for all laws: the friction of the default car below the torsion bar, referred to the column axis.

No LuGre or Masing parameter set of a steering system has been published. The defaults of the dry laws therefore share
the two things that sources support: the saturated torque F_C (75 N at the rack on a pinion of 7 to 8 mm give 0.5 to
0.6 N m, worm and motor 0.3 N m; the pinion preloads that workshop manuals give for nine cars lie at 0.6-1.9 N m) and
the branch after a reversal from saturation, ``F = F_C (1 - 2 exp(-x sigma_0/F_C))``, which is (F6) in docs/model.md.
"""

F_C = 0.9  # (F6), saturated torque [N m]
SIGMA_0 = 100.0  # (F6), pre-sliding stiffness [N m/rad]; F_C/SIGMA_0 = 0.52 deg, assumed within 0.5-1.0 deg
SIGMA_1 = 2.0  # micro-damping [N m s/rad]; assumed, damping ratio 0.44 of the pre-sliding mode at 0.052 kg m2
# The linear damper that loses as much energy per cycle as F_C does, 4 F_C/(pi omega A), in the weave to 2 m/s2 at
# 100 km/h, whose amplitude A is 15.1 deg at 0.2 Hz with the Ford Escort.
SIGMA_2_EQUIVALENT = 3.46  # [N m s/rad]
# Laws with a Stribeck curve as their essence have a small one; assumed, since the rig of an electric power steering
# showed none (ASME IDETC 2015, V003T01A007).
BREAK_AWAY = 1.1  # break-away torque over F_C [1]; assumed
V_S = 0.1  # Stribeck speed [rad/s]; assumed, 0.7 mm/s at the rack

# Shares of the friction at the sites of a steering [1]. A column EPS: rack, worm and motor as above; the 0.1 to 0.2 N m
# above the torsion bar and the efficiency of the gear, 0.85 to 0.90 in both directions, are assumed. A rack EPS has no
# worm, but a ball screw, belt and motor at the rack; the share of pinion, rack and motor stands at the rack, as one law
# split over sites that turn together is the same law. All of it is assumed, the efficiency within 0.85 to 0.95. By wire
# the actuator at the rack is that of the rack EPS, and the site above the bar is the handwheel with its motor.
SHARES = {
    "column_eps": {"upper_column": 0.1, "gear": 0.3, "rack": 0.6},
    "rack_eps": {"upper_column": 0.1, "gear": 0.2, "rack": 0.7},
    "steer_by_wire": {"upper_column": 0.1, "gear": 0.2, "rack": 0.7},
}
GEAR_EFFICIENCY = {"column_eps": 0.88, "rack_eps": 0.90, "steer_by_wire": 0.90}  # [1]
