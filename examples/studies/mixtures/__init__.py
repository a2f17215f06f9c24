"""Compaction of mixtures of rigid and soft discs."""
