"""Studies: friction laws, vehicle, integrators, real time, cross-validation."""
