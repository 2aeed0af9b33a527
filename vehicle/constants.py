"""Physical constants that several packages use."""

GRAVITY = 9.80665  # standard gravity [m/s2]
AIR_DENSITY = 1.2  # [kg/m3]
