"""Initial packings of rigid discs and other convex shapes."""

from skmpm.packing.checks import PackingError
from skmpm.packing.generator import Packing, packing

__all__ = ["Packing", "PackingError", "packing"]
