#!/usr/bin/env bash
# savgol_filter of SciPy 1.17.1 makes zeros of a signal, without a warning, where window and order are large together.
#
# A local polynomial of any order keeps a constant, so that the coefficients add up to one. They are found by least
# squares over whole numbers of samples that are not scaled: 200 ** 6 beside 1. The solver takes the constant for
# rounding and leaves it out, and inside the signal nothing is left; at both ends, which are fitted in another way, the
# signal is right, so that a plot begins and ends well. A log of 1 kHz smoothed over 0.4 s with order 6 is such a case.
# Before that, digits go: with order 4 and 417 samples a quartic is kept to 1e-8 only.
# Seen: 5.0 becomes 2.5e-07 with 401 samples and order 6, 5.0 at the ends; the first windows, odd by tens, whose
# coefficients add up to less than 0.99 are 2591, 801, 341, 181 and 111 samples for the orders 4, 5, 6, 7 and 8.
# Orthonormal polynomials over the window, scaled to -1 to 1 (numpy.linalg.qr of a Vandermonde matrix), keep all digits.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
"$folder/venv/bin/python" -W error - <<'PYTHON'
import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

smooth = savgol_filter(np.full(2001, 5.0), 401, 6)
print(f"a constant of 5: {smooth[0]:g} at the start, {smooth[1000]:.2g} inside, {smooth[-1]:g} at the end")
assert np.allclose(smooth[[0, -1]], 5.0)
assert np.all(np.abs(smooth[200:-200]) < 1e-5)
for order, first in {4: 2591, 5: 801, 6: 341, 7: 181, 8: 111}.items():
    sums = savgol_coeffs(first - 10, order).sum(), savgol_coeffs(first, order).sum()
    print(f"order {order}: the coefficients add up to {sums[0]:.4f} over {first - 10} samples, {sums[1]:.1g} over {first}")
    assert sums[0] > 0.99
    assert sums[1] < 0.01
t = np.linspace(-1.0, 1.0, 2001)
lost = np.abs(savgol_filter(t**4, 417, 4) - t**4).max()
Q = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, 417), 5))[0]
kept = np.abs(np.convolve(t**4, Q @ Q[208], "valid") - t[208:-208] ** 4).max()
print(f"a quartic over 417 samples: off by {lost:.1g}, by orthonormal polynomials {kept:.1g}")
assert lost > 1e-9
assert kept < 1e-14
PYTHON
