#!/usr/bin/env bash
# The tyre of commonroad-vehicle-models 3.0.2 has forces at zero slip that its coefficients do not mean.
#
# Pacejka's vertical shifts are forces that are added to the sine. Here the longitudinal one, F_z p_vx1 [N], is added to
# the argument of the sine, in radians: the force at zero slip is -1.4 % of 4 kN where p_vx1 gives -0.001 %, and it
# has the other sign at 1 kN. The lateral shifts are multiplied by the sign of the camber angle: the lateral force
# jumps by 4 % of the load where a wheel passes upright, which a solver that adapts its step finds again and again.
# Seen with vehicle 2 (BMW 320i): 17.1 N at 1 kN and -55.8 N at 4 kN; 85.0, 0.0 and -85.0 N at a camber of -1e-9, 0 and
# 1e-9 rad.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet commonroad-vehicle-models==3.0.2
cd "$folder"
venv/bin/python - <<'PYTHON'
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.utils import tire_model

tyre = parameters_vehicle2().tire
longitudinal = {load: tire_model.formula_longitudinal(0.0, 0.0, load, tyre) for load in (1000.0, 4000.0)}
for load, force in longitudinal.items():
    print(f"zero slip, {load:g} N: F_x {force:.1f} N; as a force the shift would be {load * tyre.p_vx1:.3f} N")
lateral = {camber: tire_model.formula_lateral(0.0, camber, 4000.0, tyre)[0] for camber in (-1e-9, 0.0, 1e-9)}
for camber, force in lateral.items():
    print(f"zero slip, camber {camber:g} rad, 4000 N: F_y {force:.1f} N")
assert abs(longitudinal[1000.0] - 17.1) < 0.1
assert abs(longitudinal[4000.0] + 55.8) < 0.1
assert abs(lateral[-1e-9] - 85.0) < 0.1
assert lateral[0.0] == 0.0
assert abs(lateral[1e-9] + 85.0) < 0.1
PYTHON
