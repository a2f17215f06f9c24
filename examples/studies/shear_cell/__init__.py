"""Plane shear of soft discs between rough walls at constant pressure."""
