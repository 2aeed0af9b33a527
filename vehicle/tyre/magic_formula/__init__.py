"""Magic Formula: steady-state forces and moments of a tyre at combined slip, as kernels on flat coefficients.

Every force is a sine or cosine of one curve with stiffness B, shape C, peak D and curvature E (T1):

    F = D sin(C atan(B x - E (B x - atan(B x)))) + S_V,    x = slip + S_H

    F_x = G_xa F_x0(kappa)      F_y = G_yk F_y0(alpha) + S_Vyk      M_z = -t (F_y - S_Vyk) + M_zr + s dF_x

The weights G and the lever s couple the slips; t is the pneumatic trail, M_zr the residual torque.

The kernels evaluate four wheels at once (:mod:`steer_env.friction.numerics.simd`); a single wheel fills all four lanes.
A branch that only some wheels need adds exactly nothing to the result of the others.

Axes: ISO 8855, x forward, y left, z up; alpha > 0 gives F_y < 0 and M_z > 0. A tyre that rolls backwards is the same
tyre seen from behind: a half turn about z reverses kappa, alpha, camber, F_x, F_y, M_x and M_y, and leaves M_z and the
turn slip unchanged, because these are about z.

The kernels hold three sets of equations; the coefficient ``FITTYP`` selects one:

* 60: Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, section 4.3.2; M_y as in MF-Tyre 5.2.
* 52: MF-Tyre 5.2 (PAC2002 in ADAMS). It takes camber itself instead of its sine, and the slip angle itself in weights
  and trail.
* 61: MF-Tyre 6.1 and 6.2: Besselink, Schmeitz, Pacejka, Vehicle System Dynamics 48 (2010) S1, appendix, also with
  angles. The turn slip of 6.2: Pacejka, 3rd ed. 2012, section 4.3.3. M_x and M_y as in the same paper and MF-Tyre.

Numbers (4.E..) beside the code are those of the book's section 4.3.2, numbers (A..) those of the paper's appendix, and
numbers (4.77) and higher those of the 3rd edition's section 4.3.3. Scaling factors and inflation pressure are in the
coefficients already, so the lines lack them.

Deviations for 60, the first three of which reproduce an independent library to ten digits at kappa = camber = 0:

* F_y0 takes alpha itself; weights, trail and residual torque take tan(alpha). M_zr carries cos(alpha) twice.
* The asymmetry of E_y follows the sign of alpha, not that of alpha + S_H; a short ramp keeps F_y continuous at
  straight running.
* s acts on dF_x, the part of F_x that kappa adds, because M_z at pure slip was fitted with the drag at kappa = 0 in it.

Deviations for all: a load under 1e-6 N gives zeros, so that the small epsilons in the denominators of the sources are
not needed. The spin that camber adds to the turn slip takes R_0 for the effective rolling radius. At turn slip 0 the
equations are those without turn slip, in which camber acts by its own terms and not as spin.
"""

from steer_env.vehicle.tyre.magic_formula.forces import forces, forces_of_four
from steer_env.vehicle.tyre.magic_formula.point import A_MU
from steer_env.vehicle.tyre.magic_formula.stiffness import cornering_stiffness, longitudinal_stiffness, stiffnesses

__all__ = ["A_MU", "cornering_stiffness", "forces", "forces_of_four", "longitudinal_stiffness", "stiffnesses"]
