"""Banded Cholesky by LAPACK through pointers: other than SciPy's wrappers, calls hold no lock."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cython_lapack

Array = NDArray[np.float64]

_ADDRESS = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)
_NAME = ctypes.PYFUNCTYPE(ctypes.c_char_p, ctypes.py_object)(("PyCapsule_GetName", ctypes.pythonapi))
_LOWER = ctypes.c_char(b"L")


def _routine(name: str, arguments: int) -> Any:
    """A routine of LAPACK, all of whose arguments are pointers."""
    capsules: dict[str, Any] = dict(cython_lapack.__pyx_capi__)
    capsule = capsules[name]
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arguments)(_ADDRESS(capsule, _NAME(capsule)))


_pbtrf = _routine("dpbtrf", 6)


def _int(value: int) -> Any:
    return ctypes.byref(ctypes.c_int(value))


def factorise(band: Array) -> int:
    """Overwrite the lower band (rows, n), in Fortran order, by its Cholesky factor.

    Returns zero or, where the matrix is not positive definite, the order of the leading minor that is not.
    """
    height, n = band.shape
    info = ctypes.c_int()
    _pbtrf(ctypes.byref(_LOWER), _int(n), _int(height - 1), band.ctypes.data, _int(height), ctypes.byref(info))
    return info.value
