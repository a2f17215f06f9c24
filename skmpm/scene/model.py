"""What acts on the points of a scene, made once: materials, friction, supports, loads, springs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.material import bounded_modulus, has_memory, initial_state
from skmpm.scene.friction import Friction, friction_of
from skmpm.scene.layout import Layout
from skmpm.scene.objects import Load, Pressure
from skmpm.scene.point_sets import (
    Ends,
    PointSet,
    ends_of,
    points_with_shares,
    prescribed_components,
    pressed_segments,
    supported_points,
)
from skmpm.values import SceneError, motion, scalar


def initial_internal(scene: Layout) -> Array:
    """Internal variables of all points at t = 0, (k, n), k as of the material that has most; zero elsewhere."""
    internal = np.zeros((scene.internal_variables, scene.owner.size))
    for k, material in enumerate(scene.materials):
        state = initial_state(material)
        internal[: state.shape[0], scene.material_index == k] = state
    return internal


def plastic_strain(scene: Layout, internal: Array) -> Array:
    """Equivalent plastic strain of the points, (n,), of their `internal` variables (k, n).

    Zero in materials without memory, nan where one with memory does not tell.
    """
    out, deformable = np.zeros(scene.owner.size), np.flatnonzero(scene.deformable[scene.owner])
    for material, points in scene.points_by_material:
        if has_memory(material):
            own, known = deformable[points], getattr(material, "plastic_strain", None)
            state = internal[: initial_state(material).shape[0], own]
            out[own] = np.nan if known is None else known(state)
    return out


class Model(Layout):
    """Points and walls with what acts on them."""

    @cached_property
    def largest_modulus(self) -> float:
        """The largest bounded modulus of a material [Pa]."""
        return max(bounded_modulus(material) for material in self.materials)

    @cached_property
    def crossing_times(self) -> Array:
        """Time in which pressure waves cross the radius of a disc of that area, (bodies,) [s]; inf for rigid ones.

        In a body of several materials the radius is shared between them as the volume is.
        """
        radius = np.sqrt(np.add.reduceat(self.initial_volumes, self.offsets[:-1]) / np.pi)
        slowness = np.full(len(self.bodies), np.inf)
        for i, body in enumerate(self.bodies):
            volume, total = body.points.volume, body.points.volume.sum()
            parts = [(m.density, *m.lame, volume[p].sum() / total) for m, p in body.parts]
            each = [np.sqrt(density / (lam + 2.0 * mu)) * share for density, lam, mu, share in parts]
            slowness[i] = sum(each) if each else np.inf
        return np.asarray(radius * slowness)

    @cached_property
    def compliance(self) -> Array:
        """(1 - nu^2) / E at small strain, by body, (bodies,) [1/Pa]; zero for rigid bodies.

        Of a body of several materials it is the mean over its boundary points, where it is touched.
        """
        each = [(lam + 2.0 * mu) / (4.0 * mu * (lam + mu)) for lam, mu in (m.lame for m in self.materials)]
        at = np.array([*each, 0.0])[self.material_index]
        result = at[self.offsets[:-1]]
        for b in np.flatnonzero(self.composite).tolist():
            own, boundary = at[self.offsets[b] : self.offsets[b + 1]], self.bodies[b].points.outline
            result[b] = own[np.concatenate(boundary) if boundary else slice(None)].mean()
        return result

    @property
    def can_touch(self) -> bool:
        """Whether there is a wall, more than one body or a periodic box."""
        return bool(self.walls) or len(self.bodies) > 1 or self.periodic is not None

    @cached_property
    def frictions(self) -> Friction:
        """The Coulomb coefficients of all pairs."""
        return friction_of(self)

    @cached_property
    def supported(self) -> Sequence[PointSet]:
        """The points whose velocity each support prescribes."""
        return tuple(supported_points(self, i, support) for i, support in enumerate(self.supports))

    def support_velocities(self, t: float, dt: float | None = None) -> Array:
        """Velocities of supports in a step from t to t + dt [s], (supports, 2) [m/s], nan where free.

        They are the prescribed ones in its middle, and mean ones of prescribed displacements. Without dt they are
        those at t, where displacements are differentiated over the time in which waves cross a cell, which steps do
        not resolve. SceneError if one is invalid.
        """
        interval, middle = (self.cell / self.fastest_wave, t) if dt is None else (dt, t + 0.5 * dt)
        each = np.empty((len(self.supports), 2))
        for i, support in enumerate(self.supports):
            if support.displacement is None:
                each[i] = prescribed_components(support, middle, f"support {i}: velocity")
            else:
                name = f"support {i}: displacement"
                start, end = (prescribed_components(support, time, name) for time in (t, t + interval))
                each[i] = (end - start) / interval
        return each

    @cached_property
    def free_components(self) -> Bools:
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
    def held_points(self) -> Ints:
        """The points of which supports prescribe a component, (m,)."""
        return np.flatnonzero((self.supporting >= 0).any(axis=0))

    @cached_property
    def supported_bodies(self) -> Bools:
        """Of which bodies supports prescribe each component of a velocity, (2, bodies)."""
        return np.stack([self._bodies_of(np.flatnonzero(own >= 0)) for own in self.supporting])

    @cached_property
    def sprung_bodies(self) -> Bools:
        """Which bodies springs act on, (bodies,)."""
        return self._bodies_of(*(place.points for ends in self.sprung for place in ends.sets))

    @cached_property
    def loaded_bodies(self) -> Bools:
        """Which bodies loads, pressures or springs act on, (bodies,)."""
        pressed = [self.outlines.point[segments] for segments in self.pressed]
        return self.sprung_bodies | self._bodies_of(*(place.points for place in self.loaded), *pressed)

    def _bodies_of(self, *points: Ints) -> Bools:
        """Which bodies have any of some points, (bodies,)."""
        found = np.zeros(len(self.bodies), dtype=bool)
        for each in points:
            found[self.owner[each]] = True
        return found

    @cached_property
    def dead_loads(self) -> Mapping[int, Load]:
        """The loads that keep their direction, by their numbers."""
        return {i: load for i, load in enumerate(self.loads) if isinstance(load, Load)}

    def forces(self, t: float) -> Array:
        """The dead loads at time t, (dead loads, 2) [N/m]; SceneError if one is not finite."""
        each = [motion(load.force, t, f"load {i}: force") for i, load in self.dead_loads.items()]
        return np.array(each).reshape(-1, 2)

    @cached_property
    def loaded(self) -> Sequence[PointSet]:
        """The points that share each dead load."""
        loads = self.dead_loads.items()
        return tuple(points_with_shares(self, f"load {i}: where", load.where, self.movable) for i, load in loads)

    @cached_property
    def pressures(self) -> Mapping[int, Pressure]:
        """The loads that follow the boundary, by their numbers."""
        return {i: load for i, load in enumerate(self.loads) if isinstance(load, Pressure)}

    def pressure_values(self, t: float) -> Array:
        """The pressures at time t, (pressures,) [Pa]; SceneError if one is not finite."""
        each = [scalar(load.value, t, f"load {i}: value") for i, load in self.pressures.items()]
        return np.array(each, dtype=float)

    @cached_property
    def pressed(self) -> Sequence[Ints]:
        """The boundary points at which the segments begin that each pressure acts on."""
        return tuple(pressed_segments(self, i, pressure) for i, pressure in self.pressures.items())

    @cached_property
    def sprung(self) -> Sequence[Ends]:
        """The points that each spring acts on."""
        return tuple(ends_of(self, i, spring) for i, spring in enumerate(self.springs))

    def rest_of_spring(self, i: int, t: float) -> Array:
        """What spring i has at time t without a force: displacement (2,) of a bed, length () of a bar [m]."""
        given, ends, name = self.springs[i].rest, self.sprung[i], f"spring {i}: rest"
        if ends.bed:
            return motion((0.0, 0.0) if given is None else given, t, name)
        if given is None:
            return np.asarray(np.hypot(*ends.span(self.initial_positions)))
        length = scalar(given, t, name)
        if length < 0.0:
            raise SceneError(f"{name} = {length:g} m at t = {t:.6g} s; a length is zero or more")
        return np.asarray(length)
