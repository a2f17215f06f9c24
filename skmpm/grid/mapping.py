"""The mapping from the reference square to the cells of a Cartesian grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from skfem.mapping import Mapping

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class CartesianMapping(Mapping):
    """Affine mapping from the reference square to square cells of equal size; evaluated without caching."""

    def __init__(self, origin: Array, cell: float) -> None:
        self.origin, self.cell = origin, cell

    def _select(self, tind: Ints | None) -> Array:
        return self.origin if tind is None else self.origin[:, tind]

    def _diagonal(self, X: Array, tind: Ints | None, value: float) -> Array:
        points = X.shape[-1]
        return np.broadcast_to(value * np.eye(2)[:, :, None, None], (2, 2, self._select(tind).shape[1], points))

    def F(self, X: Array, tind: Ints | None = None) -> Array:
        """Global positions (2, cells, points) [m] of local coordinates."""
        local = X if X.ndim == 3 else X[:, None, :]
        return self._select(tind)[:, :, None] + self.cell * local

    def invF(self, x: Array, tind: Ints | None = None) -> Array:
        """Local coordinates of global positions (2, cells, points) [m], not clipped."""
        return (x - self._select(tind)[:, :, None]) / self.cell

    def DF(self, X: Array, tind: Ints | None = None) -> Array:
        """Jacobian, (2, 2, cells, points) [m]."""
        return self._diagonal(X, tind, self.cell)

    def invDF(self, X: Array, tind: Ints | None = None) -> Array:
        """Inverse Jacobian, (2, 2, cells, points) [1/m]."""
        return self._diagonal(X, tind, 1.0 / self.cell)

    def detDF(self, X: Array, tind: Ints | None = None) -> Array:
        """Jacobian determinant, (cells, points) [m2]."""
        return np.broadcast_to(self.cell**2, (self._select(tind).shape[1], X.shape[-1]))
