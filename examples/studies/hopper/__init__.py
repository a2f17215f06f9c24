"""Clogging of a hopper by soft discs."""
