"""The type of the arrays of this package."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Array of double-precision numbers; its shape and units stand where it is declared."""
