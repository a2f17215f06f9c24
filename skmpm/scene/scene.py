"""The scene: everything that does not change during a simulation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skmpm.representation import line, table
from skmpm.scene.check import check
from skmpm.scene.model import Model
from skmpm.scene.objects import SceneError
from skmpm.scene.symmetry import indifferent_to_rotation, round_bodies
from skmpm.units import quantity


@dataclass(frozen=True, repr=False)
class Scene(Model):
    """Bodies and walls on a background grid of square cells.

    Parameters
    ----------
    bodies : the bodies
    cell : side h of the cells [m]
    walls : rigid half-planes
    supports : prescribed velocities
    loads : dead loads, and pressures that follow the boundary
    springs : beds to ground, and bars between sets of points
    friction : Coulomb coefficient of all contacts, between bodies, parts of one and walls, but for bodies and walls
        that give their own; or a table by pairs of their names, as ``{("gel", "glass"): 0.3, "default": 0.1}``,
        whose entries precede all
    cohesion : tension c that contacts between bodies bear [Pa]; Coulomb's law then holds for the normal traction plus
        c. It acts on gaps that are closed at the start of a step, and breaks where it is exceeded
    cohesion_range : largest gap [m] that cohesion pulls, also at walls; zero for closed ones only. Flat surfaces come
        off at c whatever the range. Round ones need one that several boundary points are within, or the force that
        separates them is that of one boundary point and proportional to the spacing
    periodic : a periodic box instead of walls; bodies may lie across its edges, or outside of it
    overlap : largest overlap of bodies at the start that is meant [m], as of interference fits, up to a quarter of a
        cell. A step removes a fifth of it: 30 steps without inertia leave 0.1 %. Others are refused from 1e-3 cells
    gravity : (2,) [m/s2], or a function of initial positions X (2, n) and time t -> (2, n), taken at t + theta dt of
        each step from t on, at points of bodies that forces move

    Raises
    ------
    SceneError
        if an input is invalid; the message names the object, its value and the remedy
    """

    def __post_init__(self) -> None:
        for name in ("bodies", "walls", "supports", "loads", "springs"):
            several = getattr(self, name)
            if not isinstance(several, Iterable):
                raise SceneError(f"{name}: expected a list, got a {type(several).__name__}")
            object.__setattr__(self, name, tuple(several))
        check(self)

    def __repr__(self) -> str:
        return line("Scene", self._facts())

    def _repr_html_(self) -> str:
        return table("Scene", self._facts())

    def _facts(self) -> dict[str, object]:
        materials = sorted({type(m).__name__ for body in self.bodies for m in body.materials or (body.material,)})
        facts: dict[str, object] = {"bodies": f"{len(self.bodies)} of {', '.join(materials)}"}
        facts |= {"points": int(self.offsets[-1]), "cell": quantity(self.cell, "m")}
        around = ("walls", "supports", "loads", "springs")
        facts |= {name: len(getattr(self, name)) for name in around if getattr(self, name)}
        friction = "a table" if isinstance(self.friction, Mapping) else self.friction
        return facts | {"friction": friction} | ({"cohesion [Pa]": self.cohesion} if self.cohesion else {})

    @cached_property
    def round(self) -> NDArray[np.bool_]:
        """Which bodies are bounded by circles about their centres of mass, (bodies,)."""
        return round_bodies(self)

    @cached_property
    def indifferent_to_rotation(self) -> NDArray[np.bool_]:
        """Which bodies are round and isotropic, and nothing but frictionless contact acts on them, (bodies,)."""
        return indifferent_to_rotation(self, self.round)

    @cached_property
    def free_to_turn(self) -> NDArray[np.bool_]:
        """Which of them nothing turns wherever they touch, (bodies,): none where a wall is rough."""
        return self.indifferent_to_rotation & (not self.frictions.at_walls.any())
