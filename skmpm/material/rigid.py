"""Rigid bodies."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rigid:
    """A rigid body: forces move it, or its motion is prescribed (`Body.motion`).

    Contact between rigid bodies is perfectly inelastic.

    Parameters
    ----------
    density : density [kg/m3], by which the volumes of its points give mass and moment of inertia
    """

    density: float
