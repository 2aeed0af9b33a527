import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steer_env.vehicle import tyre
from steer_env.vehicle.tyre.coefficients import MagicFormula

LEFT = tyre.load()
SYMMETRIC = tyre.load(symmetric=True)
V = 16.67


def changed(base, **coefficients):
    return dataclasses.replace(base, coefficients=base.coefficients._replace(**coefficients))


# Without the shift of kappa, forces vanish with both slips and the book's stiffnesses hold at zero.
CENTRED = changed(SYMMETRIC, PHX1=0.0, PHX2=0.0, RHY1=0.0)

kappas = st.floats(-1.5, 1.5)
alphas = st.floats(-1.5, 1.5)
cambers = st.floats(-0.26, 0.26)
loads = st.floats(0.0, 12000.0)
speeds = st.floats(1.0, 100.0)
inputs = (kappas, alphas, cambers, loads, speeds)


def slope(function, x, h=1e-5):
    """Central difference with Richardson's step: error O(h^4), rounding about 1e-11 of the value over h."""
    d1, d2 = (function(x + s) - function(x - s) for s in (h, 2 * h))
    return (8 * d1 - d2) / (12 * h)


@pytest.mark.parametrize("F_z", [500.0, 4000.0, 9000.0])
def test_slopes_at_no_slip_are_the_stiffnesses_of_the_book(F_z):
    c = CENTRED.coefficients
    K_y = tyre.cornering_stiffness(c, F_z)
    K_x = tyre.longitudinal_stiffness(c, F_z)
    D_t = F_z / c.FNOMIN * c.UNLOADED_RADIUS * (c.QDZ1 + c.QDZ2 * (F_z / c.FNOMIN - 1))

    def force(i, kappa=0.0, alpha=0.0):
        return float(CENTRED.forces(kappa, alpha, 0.0, F_z, V)[i])

    assert slope(lambda a: force(1, alpha=a), 0.0) == pytest.approx(-K_y, rel=1e-6)
    assert slope(lambda k: force(0, kappa=k), 0.0) == pytest.approx(K_x, rel=1e-6)
    assert slope(lambda a: force(4, alpha=a), 0.0) == pytest.approx(D_t * K_y, rel=1e-6)  # (4.E48)


@pytest.mark.parametrize("F_z", [500.0, 4000.0, 9000.0])
def test_slopes_over_camber(F_z):
    c = CENTRED.coefficients
    df = F_z / c.FNOMIN - 1
    K_yg = F_z * (c.PKY6 + c.PKY7 * df)
    K_zg = F_z * c.UNLOADED_RADIUS * (c.QDZ8 + c.QDZ9 * df)
    D_t = F_z / c.FNOMIN * c.UNLOADED_RADIUS * (c.QDZ1 + c.QDZ2 * df)
    assert slope(lambda g: CENTRED.forces(0, 0, g, F_z, V)[1], 0.0) == pytest.approx(K_yg, rel=1e-6)  # (4.E30)
    assert slope(lambda g: CENTRED.forces(0, 0, g, F_z, V)[4], 0.0) == pytest.approx(K_zg - D_t * K_yg, rel=1e-6)
    assert K_yg < 0  # an inclination to the right pushes to the right


def test_stiffness_over_load_for_any_shape():
    """The closed form for PKY4 = 2 is the general one; the largest stiffness is at PKY2 FNOMIN."""
    c = LEFT.coefficients
    near = c._replace(PKY4=2.0 + 1e-12)
    for F_z in (10.0, 4000.0, 12000.0):
        assert tyre.cornering_stiffness(c, F_z) == pytest.approx(tyre.cornering_stiffness(near, F_z), rel=1e-10)
    assert tyre.cornering_stiffness(c, c.PKY2 * c.FNOMIN) == pytest.approx(14.95 * c.FNOMIN)


@given(*inputs)
def test_finite_everywhere(kappa, alpha, camber, F_z, v_x):
    for each in (LEFT, SYMMETRIC, LEFT.mirrored()):
        for mu in (0.01, 1.0, 2.0):
            assert np.isfinite(each.forces(kappa, alpha, camber, F_z, v_x, mu)).all()


@given(kappas, cambers, st.floats(100.0, 9000.0))
def test_continuous_straight_ahead(kappa, camber, F_z):
    """A step of E_y at alpha = 0 would appear here as up to a newton; the slope alone gives 2e-4 N."""
    before, after = (np.array(LEFT.forces(kappa, a, camber, F_z, V)) for a in (-1e-9, 1e-9))
    assert np.abs(after - before)[:2].max() < 1e-3


def test_combined_slip_stays_within_the_pure_curves_and_near_the_ellipse():
    kappa, alpha = np.meshgrid(np.linspace(-1, 1, 101), np.linspace(-0.5, 0.5, 101))
    for F_z in (1000.0, 4000.0, 8000.0):
        F_x, F_y, *_ = CENTRED.forces(kappa, alpha, 0.0, F_z, V)
        pure_x = CENTRED.forces(kappa, 0.0, 0.0, F_z, V)[0]
        pure_y = CENTRED.forces(0.0, alpha, 0.0, F_z, V)[1]
        sliding = np.abs(kappa) > 0.05
        assert (np.abs(F_x) <= np.abs(pure_x)).all()
        assert (np.abs(F_y) <= np.abs(pure_y))[sliding].all()
        # The fitted weights bulge 6 % beyond the ellipse of the two peaks; a wrong weight gives 2.
        assert ((F_x / pure_x.max()) ** 2 + (F_y / pure_y.max()) ** 2).max() < 1.1


def test_forces_oppose_slip():
    kappa, alpha = np.meshgrid(np.linspace(0.01, 1, 30), np.linspace(0.01, 0.5, 30))
    F_x, *_ = CENTRED.forces(kappa, 0.0, 0.0, 4000.0, V)
    _, F_y, _, _, M_z = CENTRED.forces(0.0, alpha, 0.0, 4000.0, V)
    assert (F_x > 0).all()
    assert (F_y < 0).all()
    assert M_z[alpha < 0.1].min() > 0
    assert CENTRED.forces(0.0, 0.0, 0.0, 4000.0, V)[:2] == (0.0, 0.0)


def test_road_friction_scales_peaks_and_keeps_stiffnesses():
    kappa, alpha = np.linspace(0, 1, 2001), np.linspace(0, 1, 2001)
    for mu in (0.2, 0.5):
        for i, slips in ((0, (kappa, 0.0)), (1, (0.0, alpha))):
            dry, wet = (np.abs(CENTRED.forces(*slips, 0.0, 4000.0, V, m)[i]).max() for m in (1.0, mu))
            assert wet == pytest.approx(mu * dry, rel=1e-4)  # the grid's error in finding a peak
        assert slope(lambda a, mu=mu: CENTRED.forces(0, a, 0, 4000.0, V, mu)[1], 0.0) == pytest.approx(
            -tyre.cornering_stiffness(CENTRED.coefficients, 4000.0), rel=1e-6
        )


def test_no_load_gives_zeros_and_is_approached():
    assert LEFT.forces(0.1, 0.1, 0.1, 0.0, V) == (0.0,) * 5
    assert np.abs(LEFT.forces(0.1, 0.1, 0.1, 1e-5, V)).max() < 1e-4


def test_overturning_and_rolling_moments():
    c = LEFT.coefficients
    R_0 = c.UNLOADED_RADIUS
    assert LEFT.forces(0.0, 0.05, 0.01, 3000.0, 30.0)[3] == pytest.approx(-0.01 * 3000.0 * R_0)
    full = changed(LEFT, QSX1=0.01, QSX2=0.5, QSX3=0.02, QSY2=0.3, QSY3=0.002, QSY4=1e-4)
    F_x, F_y, M_x, M_y, _ = full.forces(0.02, 0.05, 0.01, 3000.0, 30.0)
    v = 30.0 / c.LONGVL
    assert M_x == pytest.approx(3000.0 * R_0 * (0.01 - 0.5 * math.sin(0.01) + 0.02 * F_y / c.FNOMIN))
    assert M_y == pytest.approx(-3000.0 * R_0 * (0.01 + 0.3 * F_x / c.FNOMIN + 0.002 * v + 1e-4 * v**4))


def test_arrays_broadcast_and_agree_with_scalars():
    kappa, alpha = np.linspace(-0.2, 0.2, 5)[:, None], np.linspace(-0.1, 0.1, 3)
    out = LEFT.forces(kappa, alpha, 0.02, [3000.0, 0.0, 5000.0], V)
    assert all(each.shape == (5, 3) for each in out)
    for i in range(5):
        for j, F_z in enumerate((3000.0, 0.0, 5000.0)):
            assert LEFT.forces(kappa[i, 0], alpha[j], 0.02, F_z, V) == tuple(each[i, j] for each in out)
    assert LEFT.forces(0, [], 0, 4000, V)[1].shape == (0,)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("kappa", math.nan),
        ("alpha", math.inf),
        ("camber", 0.5),
        ("F_z", -1.0),
        ("v_x", 0.0),
        ("v_x", -101.0),
        ("mu", 0.0),
    ],
)
def test_bad_input_is_named(name, value):
    good = {"kappa": 0.0, "alpha": 0.0, "camber": 0.0, "F_z": 4000.0, "v_x": V, "mu": 1.0}
    with pytest.raises(
        ValueError, match=rf"{name}\|? must be within .* to .*, got {abs(value) if name == 'v_x' else value}"
    ):
        LEFT.forces(**good | {name: value})
    with pytest.raises(ValueError, match=name):
        LEFT.forces(**good | {name: np.array([good[name], value])})


def test_shapes_that_do_not_broadcast():
    with pytest.raises(ValueError, match="shape"):
        LEFT.forces([0.0, 0.0], [0.0, 0.0, 0.0], 0.0, 4000.0, V)


def test_unknown_name_lists_the_known():
    with pytest.raises(ValueError, match="pacejka_2006_205_60r15, got 'slick'"):
        tyre.load("slick")


@pytest.mark.parametrize(
    ("key", "value"),
    [("FNOMIN", 0.0), ("LONGVL", -1.0), ("PCY1", 0.0), ("PDY1", 0.0), ("RBX1", math.nan), ("PKY1", 14.95)],
)
def test_senseless_coefficients_are_refused(key, value):
    with pytest.raises(ValueError, match=key):
        changed(LEFT, **{key: value})


def test_relaxation_is_checked():
    with pytest.raises(ValueError, match="relaxation_length"):
        dataclasses.replace(LEFT, relaxation_length=0.0)


def test_every_asymmetry_is_a_coefficient_and_symmetric_has_none():
    assert set(tyre.ASYMMETRY) <= set(MagicFormula._fields)
    assert all(getattr(SYMMETRIC.coefficients, key) == 0.0 for key in tyre.ASYMMETRY)
    rest = set(MagicFormula._fields) - set(tyre.ASYMMETRY)
    assert all(getattr(SYMMETRIC.coefficients, key) == getattr(LEFT.coefficients, key) for key in rest)
