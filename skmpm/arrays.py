"""Types of the arrays of the library, and what counts as round-off in them.

Signatures name the types, and say shapes and units beside.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

ROUND_OFF = 1e-9  # relative: numbers that many operations have led to are the same if they differ by less
EXACT = 1e-12  # relative: the same for numbers of a few operations
