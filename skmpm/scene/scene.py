"""The scene: everything that does not change during a simulation.

A body of a symmetric shape and material may turn inside its shape without a change of energy.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skmpm.arrays import ROUND_OFF, Bools
from skmpm.material import Material, has_memory, viscosity_of
from skmpm.representation import line, quantity, table
from skmpm.scene.check import check
from skmpm.scene.model import Model
from skmpm.scene.objects import Body
from skmpm.values import SceneError

ROUND = 1e-3  # deviation of boundary points from a circle, over its radius


def _rings(body: Body) -> bool:
    """Whether the materials of a body are rings about its centre of mass, or one."""
    if len(body.parts) <= 1:
        return True
    volume, x = body.points.volume, body.points.x
    mass = np.concatenate([material.density * volume[points] for material, points in body.parts])
    position = np.concatenate([x[:, points] for _, points in body.parts], axis=1)
    radius = np.hypot(*(x - np.average(position, axis=1, weights=mass)[:, None]))
    inner, outer = zip(*sorted((radius[p].min(), radius[p].max()) for _, p in body.parts), strict=True)
    return all(low > high for low, high in zip(inner[1:], outer[:-1], strict=True))


def _isotropic(material: Material) -> bool:
    """Whether the energy is a function of F F^T, by its values for one deformation of the material, rotated.

    Flow leaves strains in a body that turn with it.
    """
    if viscosity_of(material) > 0.0 or has_memory(material):
        return False
    F, angle = np.array([[1.2, 0.3], [0.05, 0.9]]), np.linspace(0.0, np.pi, 7)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    energy = material.energy(np.einsum("ij,jkn->ikn", F, rotation))
    return bool(np.ptp(energy) <= ROUND_OFF * np.abs(energy).max())


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
    friction : Coulomb coefficient of contacts between bodies, between parts of one body and with walls, unless bodies
        or walls have their own; or a table by pairs of names, as ``{("gel", "glass"): 0.3, "default": 0.1}``, whose
        entries take precedence over both
    cohesion : largest tension c of contacts between bodies [Pa]; Coulomb's law then holds for the normal traction
        plus c. It acts where gaps are closed at the start of a step, and breaks where it is exceeded
    cohesion_range : largest gap [m] at which cohesion acts, also at walls; 0: closed gaps only. Flat surfaces
        separate at the traction c whatever the range. For round ones it has to include several boundary points;
        otherwise the force that separates them is that of a single point, and proportional to the spacing
    periodic : a periodic box instead of walls, or one that is periodic in one direction, between walls in the other;
        bodies may lie across its edges, or outside of it
    overlap : largest intended overlap of bodies at the start [m], as of interference fits, up to a quarter of a cell.
        Each step removes a fifth of what is left: 30 steps without inertia leave 0.1 %. By default overlaps of more
        than 1e-3 cells are refused
    gravity : (2,) [m/s2], or a function of initial positions X (2, n) and time -> (2, n), which a step from t takes
        at t + theta dt; it acts on bodies that forces move

    Raises
    ------
    SceneError
        if an input is invalid; the message names the object, its value and the remedy

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], friction=0.3, gravity=(0, -9.81))
    >>> len(scene.bodies), len(scene.walls)
    (1, 1)
    >>> scene.initial_positions.shape
    (2, 110)
    """

    def __post_init__(self) -> None:
        for name in ("bodies", "walls", "supports", "loads", "springs"):
            several = getattr(self, name)
            if not isinstance(several, Iterable):
                raise SceneError(f"{name}: expected a list, got a {type(several).__name__}")
            object.__setattr__(self, name, tuple(several))
        super().__post_init__()
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
    def round(self) -> Bools:
        """Which bodies are bounded by circles about their centres of mass, (bodies,)."""
        found = np.zeros(len(self.bodies), dtype=bool)
        boundary, x, volume = self.outlines, self.initial_positions, self.initial_volumes
        for b in np.flatnonzero(self.outlined).tolist():
            points = slice(self.offsets[b], self.offsets[b + 1])
            centre = np.average(x[:, points], axis=1, weights=volume[points])
            own = np.flatnonzero(boundary.body == b)
            radius = np.hypot(*(x[:, boundary.point[own]] - centre[:, None]))
            loops = np.split(radius, np.flatnonzero(boundary.previous[own] >= own)[1:])
            found[b] = all(np.ptp(r) <= ROUND * r.max() for r in loops)
        return found

    @cached_property
    def indifferent_to_rotation(self) -> Bools:
        """Which bodies are round, rigid or isotropic and elastic, and only frictionless contact acts on, (bodies,).

        Several materials do not matter if they are concentric rings.
        """
        if self.frictions.among_bodies.any() or self.cohesive:
            return np.zeros(len(self.bodies), dtype=bool)
        isotropic = {material: _isotropic(material) for material in self.materials}
        symmetric = [all(isotropic[m] for m in body.materials) and _rings(body) for body in self.bodies]
        acted_on = self.loaded_bodies | self.supported_bodies.any(axis=0)
        return np.asarray(self.round & np.array(symmetric) & ~acted_on)

    @cached_property
    def free_to_turn(self) -> Bools:
        """Which of them nothing turns wherever they touch, (bodies,): none where a wall is rough."""
        return self.indifferent_to_rotation & (not self.frictions.at_walls.any())
