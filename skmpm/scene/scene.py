"""The scene: everything that does not change during a simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skmpm.material import Material, Rigid, bounded_modulus, initial_state, wave_speed
from skmpm.outline import Images, Outlines, folded, images, outlines, thickness
from skmpm.representation import line, table
from skmpm.scene.check import check
from skmpm.scene.friction import Friction, friction_of
from skmpm.scene.materials import (
    crossing_times,
    densities,
    groups_of,
    points_by_material,
    surface_compliance,
)
from skmpm.scene.objects import Body, Load, Pressure, SceneError, Support, Wall, motion, scalar
from skmpm.scene.periodic import Periodic
from skmpm.scene.point_sets import PointSet, loaded_points, pressed_segments, supported_points
from skmpm.scene.prescribed_velocities import support_velocities
from skmpm.scene.springs import Ends, Spring, ends_of
from skmpm.scene.symmetry import indifferent_to_rotation, round_bodies
from skmpm.units import quantity

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, repr=False)
class Scene:
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
    def offsets(self) -> Ints:
        """Index of each body's first point in the arrays of a state, (bodies + 1,)."""
        return np.concatenate([[0], np.cumsum([body.points.x.shape[1] for body in self.bodies])]).astype(int)

    @cached_property
    def owner(self) -> Ints:
        """Body of each point, (n,)."""
        return np.repeat(np.arange(len(self.bodies)), np.diff(self.offsets))

    @cached_property
    def deformable_points(self) -> NDArray[np.bool_] | slice:
        """Index of the points of deformable bodies; if these are all points, a slice, which copies nothing."""
        own = self.deformable[self.owner]
        return slice(None) if own.all() else own

    @cached_property
    def initial_positions(self) -> Array:
        """Positions of all points at t = 0, (2, n) [m]."""
        return np.concatenate([body.points.x for body in self.bodies], axis=1)

    @cached_property
    def initial_volumes(self) -> Array:
        """Volumes of all points at t = 0, (n,) [m2]."""
        return np.concatenate([body.points.volume for body in self.bodies])

    @cached_property
    def deformable(self) -> NDArray[np.bool_]:
        """Which bodies have unknowns, (bodies,)."""
        return np.array([not isinstance(body.material, Rigid) for body in self.bodies], dtype=bool)

    @cached_property
    def free_rigid(self) -> Ints:
        """The rigid bodies that forces move, (n,)."""
        held = np.array([body.motion is not None for body in self.bodies], dtype=bool)
        return np.flatnonzero(~self.deformable & ~held)

    @cached_property
    def movable(self) -> NDArray[np.bool_]:
        """Which bodies forces move, deformable ones and free rigid ones, (bodies,)."""
        movable = self.deformable.copy()
        movable[self.free_rigid] = True
        return movable

    @cached_property
    def has_scalar_unknowns(self) -> bool:
        """Whether forces move anything that has no grid: walls, rigid bodies, a periodic box."""
        return bool(self.driven_walls.size or self.free_rigid.size or self.stressed)

    @property
    def stressed(self) -> bool:
        """Whether a stress moves a periodic box."""
        return self.periodic is not None and self.periodic.components.size > 0

    @cached_property
    def mass(self) -> float:
        """Mass of all bodies that forces move [kg/m]."""
        return float(self.masses[self.movable[self.owner]].sum())

    @cached_property
    def masses(self) -> Array:
        """Masses of all points, (n,) [kg/m]."""
        return self.densities * self.initial_volumes

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """The deformable materials, in order of appearance."""
        return tuple(dict.fromkeys(material for body in self.bodies for material in body.materials))

    @cached_property
    def points_by_material(self) -> tuple[tuple[Material, Ints], ...]:
        """The deformable materials, each with its points among those of deformable bodies."""
        return points_by_material(self)

    @cached_property
    def internal_variables(self) -> int:
        """Number of internal variables of the material that has most."""
        return max(len(initial_state(material)) for material in self.materials)

    @cached_property
    def materials_by_group(self) -> tuple[tuple[tuple[Material, ...], str], ...]:
        """The materials of each body, with the groups of its points if there are several."""
        return tuple((body.materials, groups_of(body)) for body in self.bodies)

    @cached_property
    def first_moduli(self) -> Array:
        """Bounded modulus of the first material of each body, zero for rigid ones, (bodies,) [Pa]."""
        return np.array([bounded_modulus(body.materials[0]) if body.materials else 0.0 for body in self.bodies])

    @cached_property
    def composite(self) -> NDArray[np.bool_]:
        """Which bodies have several materials, (bodies,)."""
        return np.array([len(body.materials) > 1 for body in self.bodies], dtype=bool)

    @cached_property
    def densities(self) -> Array:
        """Densities at all points, (n,) [kg/m3]."""
        return densities(self)

    @cached_property
    def round(self) -> NDArray[np.bool_]:
        """Which bodies are bounded by circles about their centres of mass, (bodies,)."""
        return round_bodies(self)

    @cached_property
    def indifferent_to_rotation(self) -> NDArray[np.bool_]:
        """Which bodies are round and isotropic, and nothing but frictionless contact acts on them, (bodies,)."""
        return indifferent_to_rotation(self)

    @cached_property
    def free_to_turn(self) -> NDArray[np.bool_]:
        """Which of them nothing turns wherever they touch, (bodies,): none where a wall is rough."""
        return self.indifferent_to_rotation & (not self.frictions.at_walls.any())

    @cached_property
    def crossing_times(self) -> Array:
        """Time in which pressure waves cross the radius of a disc of that area, (bodies,) [s]; inf for rigid ones."""
        return crossing_times(self)

    @cached_property
    def fastest_wave(self) -> float:
        """Speed of the fastest pressure wave [m/s]."""
        return max(wave_speed(material) for material in self.materials)

    @cached_property
    def compliance(self) -> Array:
        """(1 - nu^2) / E at the surface of each body, at small strain (bodies,) [1/Pa]; zero for rigid bodies."""
        return surface_compliance(self)

    @cached_property
    def outlined(self) -> NDArray[np.bool_]:
        """Which bodies have an outline, (bodies,)."""
        return np.array([bool(body.points.outline) for body in self.bodies], dtype=bool)

    @cached_property
    def outlines(self) -> Outlines:
        """The outlines of all bodies, as indices into the arrays of a state."""
        return outlines([body.points.outline for body in self.bodies], self.offsets)

    def images(self, x: Array, box: Array | None, reach: float) -> Images:
        """Outlines with boundary points at x (2, m), and their images within reach [m] in a box of edges (2, 2)."""
        return images(self.outlines, x, len(self.bodies), box, reach)

    @cached_property
    def thickness(self) -> Array:
        """Width of the thinnest part of each body at t = 0, (bodies,) [m]; nan without an outline."""
        return thickness(self.outlines, self.initial_positions[:, self.outlines.point], len(self.bodies))

    def folded(self, x: Array) -> Ints:
        """Deformable bodies that may touch themselves with points at x (2, n): their outlines turn back that far."""
        bodies = folded(self.outlines, x[:, self.outlines.point])
        return np.asarray(bodies[self.deformable[bodies]])

    @cached_property
    def frictions(self) -> Friction:
        """The Coulomb coefficients of all pairs."""
        return friction_of(self)

    @cached_property
    def cohesive(self) -> bool:
        """Whether any contact has cohesion."""
        return any(c > 0.0 for c in (self.cohesion, *(wall.cohesion for wall in self.walls)))

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

    def cohesion_between(self, bodies: Ints) -> Array:
        """Cohesion (k,) [Pa] of pairs (2, k) of bodies, or of body and wall; walls are -1, -2, ..."""
        of_walls = np.array([wall.cohesion for wall in self.walls], dtype=float)
        cohesion, on_wall = np.full(bodies.shape[1], float(self.cohesion)), bodies[1] < 0
        cohesion[on_wall] = of_walls[-1 - bodies[1, on_wall]]
        return cohesion

    @cached_property
    def supported(self) -> Sequence[PointSet]:
        """The points whose velocity each support prescribes."""
        return tuple(supported_points(self, i, support) for i, support in enumerate(self.supports))

    @cached_property
    def free_components(self) -> NDArray[np.bool_]:
        """Which components of their points' velocities supports leave free, (supports, 2)."""
        return np.isnan(self.support_velocities(0.0))

    @cached_property
    def supporting(self) -> Ints:
        """The support that prescribes each component of the points' velocities, -1 where none does, (2, n)."""
        number = np.full((2, self.offsets[-1]), -1)
        for i, (place, free) in enumerate(zip(self.supported, self.free_components, strict=True)):
            for axis in np.flatnonzero(~free):
                number[axis, place.points] = i
        return number

    @cached_property
    def dead_loads(self) -> Sequence[Load]:
        """The loads that keep their direction."""
        return tuple(load for load in self.loads if isinstance(load, Load))

    @cached_property
    def pressures(self) -> Sequence[Pressure]:
        """The loads that follow the boundary."""
        return tuple(load for load in self.loads if isinstance(load, Pressure))

    @cached_property
    def loaded(self) -> Sequence[PointSet]:
        """The points that share each dead load."""
        return tuple(loaded_points(self, i, load) for i, load in enumerate(self.loads) if isinstance(load, Load))

    @cached_property
    def pressed(self) -> Sequence[Ints]:
        """The boundary points at which the segments begin that each pressure acts on."""
        each = enumerate(self.loads)
        return tuple(pressed_segments(self, i, load) for i, load in each if isinstance(load, Pressure))

    @cached_property
    def sprung(self) -> Sequence[Ends]:
        """The points that each spring acts on."""
        return tuple(ends_of(self, i, spring) for i, spring in enumerate(self.springs))

    def support_velocities(self, t: float, dt: float | None = None) -> Array:
        """Velocities of supports in a step from t to t + dt, or at t, (supports, 2) [m/s], nan where free."""
        return support_velocities(self, t, dt)

    def forces(self, t: float) -> Array:
        """The dead loads at time t, (dead loads, 2) [N/m]; SceneError if one is not finite."""
        loads = enumerate(self.loads)
        each = [motion(load.force, t, f"load {i}: force") for i, load in loads if isinstance(load, Load)]
        return np.array(each).reshape(-1, 2)

    def pressure_values(self, t: float) -> Array:
        """The pressures at time t, (pressures,) [Pa]; SceneError if one is not finite."""
        loads = enumerate(self.loads)
        each = [scalar(load.value, t, f"load {i}: value") for i, load in loads if isinstance(load, Pressure)]
        return np.array(each, dtype=float)
