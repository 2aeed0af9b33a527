"""White noise of the sensors: the rows of a batch draw theirs in blocks, each from its own generator."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK = 128  # control steps of noise drawn at once


class SensorNoise:
    """Noise of the observations of ``n`` rows.

    Parameters
    ----------
    n : int
    deviations : (O,) array
        Standard deviation of each observation at a factor of 1 [its unit].

    Attributes
    ----------
    factor : (n,) array
        Factor of each row on the deviations [1].
    steps : (n,) array of int
        Control steps since the last start or :meth:`redraw`; a multiple of ``BLOCK`` draws the next block.
    blocks : (n, BLOCK, O) array
        Noise at the deviations of 1 that is drawn already; (n, 0, O) before any row has noise.
    """

    def __init__(self, n: int, deviations: Array) -> None:
        self._deviations = deviations
        self.factor, self.steps = np.zeros(n), np.zeros(n, np.int64)
        self.blocks = np.zeros((n, 0, deviations.size))
        self.noisy = False  # whether any row has noise

    def set_factor(self, rows: int | slice, factor: float | Array) -> None:
        """Set the factor of some rows [1]."""
        self.factor[rows] = factor
        self.noisy = bool(self.factor.any())
        if self.noisy and not self.blocks.size:
            self.blocks = np.zeros((self.factor.size, BLOCK, self._deviations.size))

    def begin(self, i: int, factor: float, rng: np.random.Generator) -> Array | float:
        """Noise of the first observation of an episode in row ``i`` (O,), whose factor is given [1]."""
        self.set_factor(i, factor)
        self.steps[i] = 0
        if factor == 0.0:
            return 0.0
        self.blocks[i] = rng.standard_normal(self.blocks.shape[1:])
        noise: Array = factor * self._deviations * self.blocks[i, 0]
        return noise

    def advance(self, going: NDArray[np.bool_], generators: Sequence[np.random.Generator], out: Array) -> None:
        """Put the noise of the next observation of the rows that are ``going`` into ``out`` (n, O).

        A row whose block is used up draws the next one from its generator.
        """
        self.steps += 1
        places = self.steps % BLOCK
        for i in np.flatnonzero(going & (places == 0) & (self.factor != 0.0)).tolist():
            self.blocks[i] = generators[i].standard_normal(self.blocks.shape[1:])
        noise = self.factor[:, None] * self._deviations * self.blocks[np.arange(len(places)), places]
        out[going] = noise[going]

    def redraw(self) -> None:
        """Forget the noise that is drawn already: every row draws a new block at its next step."""
        self.steps[:] = -1
