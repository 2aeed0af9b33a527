"""Confidence intervals of a least-squares estimate whose residuals are not independent of each other."""

import numpy as np
from numpy.typing import NDArray


def half_widths(J: NDArray, residual: NDArray, rows: NDArray) -> NDArray[np.float64]:
    """Half the widths of the 95 % intervals of the combinations ``rows @ parameters``, by Student's t.

    The covariance ``s^2 inv(J'J)`` of independent residuals is multiplied by ``1 + 2 sum r_k``, the number of samples
    that count as one. r_k is the autocorrelation of the residuals, summed up to the first lag where it is not
    positive.

    Parameters
    ----------
    J : (n, m) array
        Derivatives of the residuals by the parameters.
    residual : (n,) array
        Residuals at the estimate, in order of time.
    rows : (k, m) array
        Combinations of parameters.

    Returns
    -------
    (k,) array
        In the units of the combinations; very large where the residuals do not depend on a parameter.

    Source: Bayley, Hammersley, J. R. Statistical Society Suppl. 8 (1946) 184-197.
    """
    from scipy.special import stdtrit  # imported here, because that takes longer than the import of all laws

    n, m = J.shape
    power = np.abs(np.fft.rfft(residual, 2 * n)) ** 2  # padded to twice the length, so that the end does not wrap
    r = np.fft.irfft(power)[:n]
    samples_per_count = 1.0
    if r[0] > 0.0:
        samples_per_count += 2.0 * np.sum(r[1 : np.argmax(r <= 0.0)]) / r[0] if (r <= 0.0).any() else n
    freedom = max(n / samples_per_count - m, 1.0)
    H = J.T @ J
    H += 1e-14 * np.trace(H) * np.eye(m)  # a parameter without influence gets a very large variance
    C = residual @ residual / freedom * np.linalg.inv(H)
    return stdtrit(freedom, 0.975) * np.sqrt(np.einsum("ki,ij,kj->k", rows, C, rows))
