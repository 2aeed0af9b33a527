"""What analyses a car: linear models, operating points, margins, limit cycles, free control, understeer, power."""
