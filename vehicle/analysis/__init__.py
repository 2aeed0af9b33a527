"""What analyses a car: linear models, operating points, limit cycles, free control, understeer."""
