"""Points that fill a box evenly: from where to look for the deepest of several valleys."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc


def even_points(low: NDArray[np.float64], high: NDArray[np.float64], count: int, seed: int) -> NDArray[np.float64]:
    """(count, m) points between low (m,) and high (m,), the same for the same seed.

    Law: Sobol' points, scrambled. Source: Owen, J. Complexity 14 (1998) 466.
    """
    shares = qmc.Sobol(low.size, seed=seed).random_base2(max(count, 1).bit_length())[:count]
    return np.asarray(low + shares * (high - low))
