"""What a user gives of a scene, and its points and walls as arrays, made once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from skmpm import outline
from skmpm.arrays import Array, Bools, Ints
from skmpm.grid import BodyGrids, build_grids
from skmpm.material import Material, Rigid, initial_state, wave_speed
from skmpm.outline import Outlines, outlines
from skmpm.outline.crossings import folded
from skmpm.outline.images import Images, images
from skmpm.outline.widths import thickness
from skmpm.scene.objects import Body, Load, Pressure, Spring, Support, Wall, rigid_motion
from skmpm.scene.periodic import Periodic
from skmpm.values import Given, motion, scalar

MAX_THICKNESS_SHARE = 0.25  # of the thinnest part that a point may move through in one step


@dataclass(frozen=True, repr=False)
class Layout(Given):
    """The fields of a scene, which `Scene` describes: bodies, their points and outlines, and walls."""

    bodies: Sequence[Body]
    cell: float = field(kw_only=True)
    walls: Sequence[Wall] = field(default=(), kw_only=True)
    supports: Sequence[Support] = field(default=(), kw_only=True)
    loads: Sequence[Load | Pressure] = field(default=(), kw_only=True)
    springs: Sequence[Spring] = field(default=(), kw_only=True)
    friction: float | Mapping[Any, float] = field(default=0.0, kw_only=True)
    cohesion: float = field(default=0.0, kw_only=True)
    cohesion_range: float = field(default=0.0, kw_only=True)
    overlap: float = field(default=0.0, kw_only=True)
    gravity: ArrayLike | Callable[[Array, float], ArrayLike] = field(default=(0.0, 0.0), kw_only=True)
    periodic: Periodic | None = field(default=None, kw_only=True)

    @cached_property
    def offsets(self) -> Ints:
        """Index of each body's first point in the arrays of a state, (bodies + 1,)."""
        return np.concatenate([[0], np.cumsum([body.points.x.shape[1] for body in self.bodies])]).astype(int)

    @cached_property
    def owner(self) -> Ints:
        """Body of each point, (n,)."""
        return np.repeat(np.arange(len(self.bodies)), np.diff(self.offsets))

    @cached_property
    def deformable_points(self) -> Bools | slice:
        """Index of the points of deformable bodies; if these are all points, a slice, which copies nothing."""
        own = self.deformable[self.owner]
        return slice(None) if own.all() else own

    @cached_property
    def among_deformable(self) -> Ints:
        """The number of each point among those of deformable bodies, (n,); of no use for others."""
        return np.asarray(np.cumsum(self.deformable[self.owner]) - 1)

    @cached_property
    def initial_positions(self) -> Array:
        """Positions of all points at t = 0, (2, n) [m]."""
        return np.concatenate([body.points.x for body in self.bodies], axis=1)

    @cached_property
    def initial_volumes(self) -> Array:
        """Volumes of all points at t = 0, (n,) [m2]."""
        return np.concatenate([body.points.volume for body in self.bodies])

    @cached_property
    def deformable(self) -> Bools:
        """Which bodies have unknowns, (bodies,)."""
        return np.array([not isinstance(body.material, Rigid) for body in self.bodies], dtype=bool)

    @cached_property
    def held_components(self) -> Bools:
        """Which components of the motion of bodies are prescribed, vx, vy and spin, (3, bodies)."""
        each = [rigid_motion(body, 0.0, f"body {b}") for b, body in enumerate(self.bodies)]
        return ~np.isnan(np.stack(each, axis=1))

    @cached_property
    def free_rigid(self) -> Ints:
        """The rigid bodies that forces move, in some components at least, (n,)."""
        return np.flatnonzero(~self.deformable & ~self.held_components.all(axis=0))

    @cached_property
    def movable(self) -> Bools:
        """Which bodies forces move, deformable ones and free rigid ones, (bodies,)."""
        movable = self.deformable.copy()
        movable[self.free_rigid] = True
        return movable

    @cached_property
    def grains(self) -> Bools:
        """Which bodies forces move in all components, (bodies,)."""
        return np.asarray(self.movable & ~self.held_components.any(axis=0))

    @cached_property
    def inside(self) -> Bools:
        """Which bodies are parts of the packing, (bodies,): grains, and all where nothing is outside.

        A box that is periodic in both directions has no outside: what holds a body in it is a part of the packing.
        """
        return np.asarray(self.grains | (self.periodic is not None and self.periodic.box.shape[1] == 2))

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """The deformable materials, in order of appearance."""
        return tuple(dict.fromkeys(material for body in self.bodies for material in body.materials))

    @cached_property
    def material_index(self) -> Ints:
        """The index of each point's material in `materials`, -1 in rigid bodies, (n,)."""
        index, place = np.full(self.offsets[-1], -1), {material: k for k, material in enumerate(self.materials)}
        for body, first in zip(self.bodies, self.offsets[:-1], strict=True):
            for material, points in body.parts:
                index[first : first + body.points.size][points] = place[material]
        return index

    @cached_property
    def points_by_material(self) -> tuple[tuple[Material, Ints], ...]:
        """The deformable materials, each with its points among those of deformable bodies."""
        own = self.material_index[self.deformable_points]
        return tuple((material, np.flatnonzero(own == k)) for k, material in enumerate(self.materials))

    @cached_property
    def internal_variables(self) -> int:
        """Number of internal variables of the material that has most."""
        return max(len(initial_state(material)) for material in self.materials)

    @cached_property
    def materials_by_group(self) -> tuple[tuple[Material, ...], bytes]:
        """The materials, and which of them each point has: equal for points of equal materials."""
        return self.materials, self.material_index.tobytes()

    @cached_property
    def composite(self) -> Bools:
        """Which bodies have several materials, (bodies,)."""
        return np.array([len(body.materials) > 1 for body in self.bodies], dtype=bool)

    @cached_property
    def densities(self) -> Array:
        """Densities at all points, (n,) [kg/m3]."""
        rigid = [body.material.density if isinstance(body.material, Rigid) else np.nan for body in self.bodies]
        deformable = np.array([material.density for material in self.materials])
        return np.where(self.material_index < 0, np.array(rigid)[self.owner], deformable[self.material_index])

    @cached_property
    def masses(self) -> Array:
        """Masses of all points, (n,) [kg/m]."""
        return self.densities * self.initial_volumes

    @cached_property
    def mass(self) -> float:
        """Mass of all bodies that forces move [kg/m]."""
        return float(self.masses[self.movable[self.owner]].sum())

    @cached_property
    def fastest_wave(self) -> float:
        """Speed of the fastest pressure wave [m/s]."""
        return max(wave_speed(material) for material in self.materials)

    @cached_property
    def outlined(self) -> Bools:
        """Which bodies have an outline, (bodies,)."""
        return np.array([bool(body.points.outline) for body in self.bodies], dtype=bool)

    @property
    def initial_box(self) -> Array | None:
        """The edges of the periodic box at t = 0, (2, 1) or (2, 2) [m]; None without one."""
        return None if self.periodic is None else self.periodic.box

    @cached_property
    def outlines(self) -> Outlines:
        """The outlines of all bodies, as indices into the arrays of a state."""
        return outlines([body.points.outline for body in self.bodies], self.offsets)

    @cached_property
    def nearest_boundary(self) -> Ints:
        """The boundary point of its body that is nearest to each point at t = 0, (n,); any if it has no outline."""
        x, boundary = self.initial_positions, self.outlines
        apart = 4.0 * float(np.ptp(x)) + 1.0  # between bodies, in a third direction
        tree = KDTree(np.vstack([x[:, boundary.point], apart * boundary.body]).T)
        return np.asarray(tree.query(np.vstack([x, apart * self.owner]).T)[1])

    def inward_normals(self, x: Array) -> Array:
        """Inward normals of the boundary points among points at x (2, n), zero at others, (2, n)."""
        inward, boundary = np.zeros_like(x), self.outlines
        if boundary.point.size:
            inward[:, boundary.point] = -outline.normals(boundary, x[:, boundary.point])
        return inward

    def body_grids(self, x: Array) -> BodyGrids:
        """The body grids of deformable bodies whose points are at x (2, n) [m]."""
        own = self.deformable_points
        return build_grids(x[:, own], self.owner[own], self.cell, len(self.bodies), self.inward_normals(x)[:, own])

    def images(self, x: Array, box: Array | None, reach: float) -> Images:
        """Outlines with boundary points at x (2, m), and their images within reach [m] in a box of edges (2, n)."""
        return images(self.outlines, x, len(self.bodies), box, reach)

    @property
    def max_motion(self) -> float:
        """Largest motion of a point in a step, relative to the mean, between bodies with outlines [m].

        Contact detection finds penetrations of less than a cell, or of a share of the thinnest part of all bodies.
        """
        thinnest = float(np.min(self.thickness[~np.isnan(self.thickness)], initial=np.inf))
        return max(self.cell, MAX_THICKNESS_SHARE * thinnest if np.isfinite(thinnest) else 0.0)

    @cached_property
    def thickness(self) -> Array:
        """Width of the thinnest part of each body at t = 0, (bodies,) [m]; nan without an outline."""
        return thickness(self.outlines, self.initial_positions[:, self.outlines.point], len(self.bodies))

    def folded(self, x: Array) -> Ints:
        """Deformable bodies that may touch themselves with points at x (2, n): their outlines turn back that far."""
        bodies = folded(self.outlines, x[:, self.outlines.point])
        return np.asarray(bodies[self.deformable[bodies]])

    @cached_property
    def cohesive(self) -> bool:
        """Whether any contact has cohesion."""
        return any(c > 0.0 for c in (self.cohesion, *(wall.cohesion for wall in self.walls)))

    def cohesion_between(self, bodies: Ints) -> Array:
        """Cohesion (k,) [Pa] of pairs (2, k) of bodies, or of body and wall; walls are -1, -2, ..."""
        of_walls = np.array([wall.cohesion for wall in self.walls], dtype=float)
        cohesion, on_wall = np.full(bodies.shape[1], float(self.cohesion)), bodies[1] < 0
        cohesion[on_wall] = of_walls[-1 - bodies[1, on_wall]]
        return cohesion

    @cached_property
    def turning(self) -> Ints:
        """The supports that turn, (n,)."""
        return np.flatnonzero([support.rotation is not None for support in self.supports])

    @cached_property
    def wall_points(self) -> Array:
        """Points of the walls at t = 0, (walls, 2) [m]."""
        return np.array([wall.point for wall in self.walls], dtype=float).reshape(-1, 2)

    @cached_property
    def normals(self) -> Array:
        """Unit normals of the walls, (2, walls)."""
        normals = np.array([wall.normal for wall in self.walls], dtype=float).reshape(-1, 2).T
        return np.asarray(normals / np.hypot(*normals))

    @cached_property
    def driven_walls(self) -> Ints:
        """The walls that a force or a pressure drives, (p,)."""
        return np.flatnonzero([wall.driven for wall in self.walls])

    @cached_property
    def wall_masses(self) -> Array:
        """Masses of the driven walls, (p,) [kg/m]."""
        masses = [self.walls[i].mass for i in self.driven_walls.tolist()]
        return np.array([self.mass if mass is None else mass for mass in masses], dtype=float)

    def driving_forces(self, t: float, lengths: Array) -> Array:
        """Forces towards the bodies on the driven walls at time t, (p,) [N/m], from the lengths of all walls [m]."""
        forces = np.zeros(self.driven_walls.size)
        for k, i in enumerate(self.driven_walls.tolist()):
            wall, name = self.walls[i], "force" if self.walls[i].pressure is None else "pressure"
            value = scalar(getattr(wall, name), t, f"wall {i}: {name}")
            forces[k] = value if name == "force" else value * lengths[i]
        return forces

    def wall_velocities(self, t: float) -> Array:
        """Given velocities of the walls at time t, (walls, 2) [m/s]; SceneError if not finite.

        Those of driven walls hold along the wall, and along their normals where the wall begins.
        """
        each = [motion(wall.velocity, t, f"wall {i}: velocity") for i, wall in enumerate(self.walls)]
        return np.array(each).reshape(-1, 2)

    @property
    def stressed(self) -> bool:
        """Whether a stress moves a periodic box."""
        return self.periodic is not None and self.periodic.components.size > 0

    @cached_property
    def has_scalar_unknowns(self) -> bool:
        """Whether forces move anything that has no grid: walls, rigid bodies, a periodic box."""
        return bool(self.driven_walls.size or self.free_rigid.size or self.stressed)


def material_at(scene: Layout, point: int) -> Material | Rigid:
    """The material of a point."""
    whole = scene.bodies[scene.owner[point]].material
    return whole if isinstance(whole, Rigid) else scene.materials[scene.material_index[point]]
