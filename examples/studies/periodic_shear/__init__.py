"""Simple shear of periodic packings at constant pressure."""
