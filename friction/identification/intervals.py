"""Confidence intervals of a least-squares estimate whose residuals are not independent of each other (F35)."""

import numpy as np
from numpy.typing import NDArray


def samples_per_count(residual: NDArray) -> float:
    """How many samples count as one, ``1 + 2 sum r_k``, where the residuals are not independent (F35).

    r_k is the autocorrelation of the residuals, summed up to the first lag where it is not positive.

    Source: Bayley, Hammersley, J. R. Statistical Society Suppl. 8 (1946) 184-197.
    """
    n = residual.size
    power = np.abs(np.fft.rfft(residual, 2 * n)) ** 2  # padded to twice the length, so that the end does not wrap
    r = np.fft.irfft(power)[:n]
    if not r[0] > 0.0:
        return 1.0
    return float(1.0 + (2.0 * np.sum(r[1 : np.argmax(r <= 0.0)]) / r[0] if (r <= 0.0).any() else n))


def half_widths(J: NDArray, residual: NDArray, rows: NDArray, floor: float = 0.0) -> NDArray[np.float64]:
    """Half the widths of the 95 % intervals of the combinations ``rows @ parameters``, by Student's t (F35).

    The covariance ``s^2 inv(J'J)`` of independent residuals is multiplied by :func:`samples_per_count`.

    Parameters
    ----------
    J : (n, m) array
        Derivatives of the residuals by the parameters.
    residual : (n,) array
        Residuals at the estimate, in order of time.
    rows : (k, m) array
        Combinations of parameters.
    floor : float
        Least standard deviation that the residuals count with.

    Returns
    -------
    (k,) array
        In the units of the combinations; very large where the residuals do not depend on a parameter.
    """
    from scipy.special import stdtrit  # imported here, because that takes longer than the import of all laws

    n, m = J.shape
    freedom = max(n / samples_per_count(residual) - m, 1.0)
    size = np.linalg.norm(J, axis=0)
    size[size == 0.0] = 1e-12 * (size.max() or 1.0)
    w, V = np.linalg.eigh((J / size).T @ (J / size))
    inverse = V / np.maximum(w, 1e-14) @ V.T  # parameters without influence get a very large variance
    variance = max(residual @ residual / freedom, floor**2)  # (F35)
    C = variance * inverse / np.outer(size, size)
    return stdtrit(freedom, 0.975) * np.sqrt(np.einsum("ki,ij,kj->k", rows, C, rows))
