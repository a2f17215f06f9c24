"""Initial packings of rigid discs and other convex shapes."""

from skmpm.packing.generator import Packing, PackingError, packing

__all__ = ["Packing", "PackingError", "packing"]
