"""Point-to-curve contact: boundary points against outlines and walls, in the configuration at the end of the step.

A boundary point c of one body is projected on the smooth outline of another body (`outline.Curve`). The foot of the
projection is a combination of four boundary points with weights z(s). The row of the contact Jacobian is N(c) w_a -
sum_m z_m N(m) w_b along the normal of the curve, for theta = 1 the exact derivative of the gap: momentum is
conserved exactly, the two contact forces act on one line, and frictionless contact is conservative. One body of a
pair contributes its boundary points (a deformable body before a rigid one, then the body with the finer boundary,
then by position), the other its curve and, as points, its corners.

Gaps are those at the end of the step. Contact forces act along the normals of x + theta dt w, the configuration in
which the stress is evaluated: a disc that rotates under a pressure p gains p V (omega dt)^2 per step from its stress
and loses the same amount at its contacts. The two cancel only if normals and stress belong to one configuration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from skmpm import outline
from skmpm.arrays import Array
from skmpm.contact.closest_points import closest_points
from skmpm.contact.cohesion import tensile_strength
from skmpm.contact.constraints import Constraints, Linearise, no_constraints
from skmpm.contact.gap_function import ContactPairs, contacts_between_bodies, contacts_with_walls, geometry_of
from skmpm.contact.motion import Motion, contact_reach
from skmpm.contact.neighbours import Neighbours, Roles, Tension, neighbours, pairs_of_bodies
from skmpm.contact.rows import combinations, joined
from skmpm.contact.self_contact import SelfContact
from skmpm.grid import BodyGrids
from skmpm.outline import Cubics, Outlines
from skmpm.outline.images import Images
from skmpm.outline.measures import bend
from skmpm.scene import PrescribedVelocities, Scene, SceneError, State, prescribed_velocities

# Fraction of an initial overlap that a step removes: gradually, since all at once ejects the bodies. In dynamic steps
# shorter than waves take to cross a cell it is as much smaller: velocities would be overlaps over dt.
PUSH_OUT = 0.2  # with 0.1 and 0.4 test_preflight fails


def point_to_curve(
    scene: Scene,
    state: State,
    grid: BodyGrids,
    dt: float,
    theta: float = 1.0,
    motions: PrescribedVelocities | None = None,
    inertia: bool = True,
) -> Linearise:
    """Contact of boundary points with outlines and walls (the default contact formulation).

    Parameters
    ----------
    scene, state, grid : a scene, its state, and the body grids
    dt : length of the step [s]
    theta : of the scheme
    motions : prescribed velocities of the step; None: evaluated here
    inertia : whether the step has inertia; without it contacts slide along the outlines

    Returns
    -------
    function of a nodal velocity (2 nodes,) [m/s] that returns the `Constraints` linearised about it

    Raises
    ------
    SceneError
        if a body has no outline

    Notes
    -----
    The gap g(w) is evaluated in the configuration that `w` leads to at the end of the step; contacts obey
    u_n(w') = [g(w) - g_allowed] / dt + n . (relative velocity of w' - w) >= 0. A pair that overlaps at the start of
    the step may keep 0.8 of this overlap, more in very short steps (`PUSH_OUT`). Light contacts act at the closest
    points of smooth outlines.

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))
    >>> scheme = skmpm.Scheme(contact=skmpm.contact.point_to_curve)
    >>> state = skmpm.step(scene, skmpm.initial(scene, scheme=scheme), 1e-4, scheme=scheme)
    >>> bool(state.wall_force[0, 1] < 0)
    True
    """
    check_outlines(scene)
    motions = prescribed_velocities(scene, state.t, dt, state.box) if motions is None else motions
    kept = 1.0 - PUSH_OUT * (min(1.0, dt * scene.fastest_wave / scene.cell) if inertia else 1.0)
    motion = Motion.prescribed(scene, state, motions, dt)
    interpolation = _boundary_interpolation(scene, grid, scene.outlines)
    step = _PointToCurve(scene, state, theta, motion, interpolation, kept)
    margin = 0.5 * contact_reach(scene) + 2.0 * motion.largest(dt * state.v[:, scene.outlines.point], step.start)
    close = step.near(margin)
    if close is not None:
        close = step.with_closest_points(close, slide=not inertia)
    if close is not None and scene.cohesive:
        close = step.with_tension(close)
    return replace(step, margin=margin, close=close)


@dataclass(frozen=True)
class _PointToCurve:
    """The constraints of a step at any nodal velocities, from candidates that are found once."""

    scene: Scene
    state: State
    theta: float
    motion: Motion  # as prescribed
    interpolation: sp.csr_array  # (m, nodes) from nodes to boundary points
    kept: float  # share of an initial overlap that stays
    margin: float = 0.0  # twice the motion up to which the candidates are complete [m]
    close: Neighbours | None = None  # the candidates; None if nothing is near anything

    def __call__(self, w: Array, motions: PrescribedVelocities | None = None) -> Constraints:
        """The constraints at nodal velocities w (2 nodes,) [m/s], and what is prescribed if it is not as at first."""
        dt, motion = self.motion.dt, self.motion
        if motions is not None:
            motion = Motion.prescribed(self.scene, self.state, motions, dt)
        velocity = (self.interpolation @ w.reshape(-1, 2)).T
        moved = dt * velocity + motion.points
        near = self._candidates(2.0 * motion.largest(moved, self.start))
        if near is None:
            return no_constraints(self.interpolation)
        moved = motion.of_surfaces(near.surfaces, moved)
        pairs = self.pairs(near, motion.walls, moved, self.theta)
        if pairs.gap.size == 0:
            return no_constraints(self.interpolation)
        return self.constraints(pairs, near, motion, moved, velocity)

    def _candidates(self, needed: float) -> Neighbours | None:
        """The candidates with a margin of `needed` [m], found again if that is more than was foreseen.

        Those of an iterate that moves farther than a step may are not looked for: it diverges, and all bodies of a
        packing would be near each other.
        """
        if needed <= self.margin:
            return self.close
        near = self.near(min(needed, self.margin + 2.0 * self.scene.max_motion))
        if near is None or self.close is None:
            return near
        facing = None if self.close.facing is None else self.ahead(near)
        return replace(near, shifts=self.close.shifts, tension=self.close.tension, facing=facing)

    @property
    def start(self) -> Array:
        """Positions of the boundary points at the start, (2, m) [m]."""
        return self.state.x[:, self.scene.outlines.point]

    def near(self, margin: float) -> Neighbours | None:
        """The candidates, complete for motions up to half the margin [m]; None if nothing is near anything."""
        scene, state, within = self.scene, self.state, contact_reach(self.scene)
        surfaces = scene.images(self.start, state.box, within + margin)
        at, own = surfaces.at(self.start, state.box), SelfContact.of_scene(scene, state, surfaces.outlines)
        pairs = pairs_of_bodies(scene, surfaces, at, within + margin)
        if pairs.size + own.bodies.size + len(scene.walls) == 0:
            return None
        initial = scene.initial_positions[:, surfaces.outlines.point]
        curve, roles = outline.curve(surfaces.outlines, initial, at), _roles(scene, surfaces, initial)
        return neighbours(scene, surfaces, curve.through(at), roles, own, margin, pairs, state.contacts)

    def pairs(self, near: Neighbours, walls: Array, moved: Array, theta: float) -> ContactPairs:
        """The contact pairs of surfaces whose boundary points have moved by `moved` (2, m) [m].

        `walls` (2, walls, 2) are points of the walls at the start of the step, and their displacements [m].
        """
        scene, start = self.scene, near.start.x
        on_walls = [contacts_with_walls(scene, near, start, moved, walls)] if walls.size else []
        between = [] if near.none and on_walls else [contacts_between_bodies(near, start, moved, theta)]
        return joined([*between, *on_walls])

    def with_tension(self, near: Neighbours) -> Neighbours:
        """The candidates with the contacts that bear tension in the step."""
        start, walls = near.start.x, self.motion.walls[0]
        found = self.pairs(near, np.stack([walls, 0.0 * walls]), 0.0 * start, 1.0)
        strength = tensile_strength(self.scene, near.surfaces, start, found, near.roles.rank)
        bears = np.flatnonzero(strength)
        return replace(near, tension=Tension(found.key[bears], strength[bears]))

    def ahead(self, near: Neighbours) -> Cubics:
        """The outlines at t + theta dt in a step of constant velocities."""
        motion, boundary = self.motion, self.scene.outlines
        v = self.state.v + motion.change_of_box_velocity(self.state)
        moved = np.where(self.scene.deformable[boundary.body], motion.dt * v[:, boundary.point], motion.points)
        return near.curve.through(near.start.x + self.theta * motion.of_surfaces(near.surfaces, moved))

    def with_closest_points(self, near: Neighbours, *, slide: bool) -> Neighbours:
        """The candidates with contact points shifted to the closest points of the outlines `ahead`.

        Impulses have no moment about the axis of a body that rolls if their points pass below it then. What slides
        may move far: which points face a side is decided there, too.
        """
        start, displacement = self.motion.walls
        walls, ahead = start + self.theta * displacement, self.ahead(near)
        shifts = closest_points(self.scene, near, ahead, walls, self.state.contacts, slide=slide)
        return replace(near, shifts=shifts, facing=ahead if slide else None)

    def constraints(
        self, found: ContactPairs, near: Neighbours, motion: Motion, moved: Array, velocity: Array
    ) -> Constraints:
        """Constraints of the contact pairs, linearised about a motion of the surfaces by `moved` (2, m) [m].

        `velocity` (2, points) [m/s] is what the nodes cause of it at the boundary points of bodies.
        """
        surfaces, dt, x, points = near.surfaces, motion.dt, near.start.x + moved, velocity.shape[1]
        at = np.einsum("jk,ijk->ik", found.own_weights, x[:, found.own])
        on_wall = found.bodies[1] < 0
        first, second = (surfaces.lattice[:, body] for body in (found.bodies[0], np.where(on_wall, *found.bodies)))
        before, image, home = (
            motion.lattice_vectors(k, end) for k, end in ((second - first, 0), (second - first, 1), (first, 1))
        )
        found, shifts = _of_bodies(found, surfaces), near.shifts.at(found.key)
        columns = np.concatenate([found.own, found.stencil])
        relative = combinations(columns, np.concatenate([found.own_weights, -found.weights]), points)
        moving = (before - image) / dt
        moving[:, on_wall] -= motion.walls[1, -1 - found.bodies[1, on_wall]].T / dt
        now = np.einsum("ik,ki->k", found.normal, relative @ velocity.T)
        allowed = np.maximum(np.minimum(self.kept * found.before, -shifts.sagitta), np.minimum(found.before, 0.0))
        return Constraints(
            bodies=found.bodies,
            x=at - home,
            normal=found.normal,
            gap=found.gap,
            friction=self.scene.frictions.between(found.bodies),
            key=found.key,
            point=self.scene.outlines.point[found.point],
            base=self.interpolation,
            difference=relative,
            geometry=geometry_of(found, shifts),
            rigid=motion.points.T / dt,
            surfaces=moving,
            offset_normal=(found.gap - allowed) / dt - now,
            pushed_out=np.where(found.before < 0.0, np.maximum(np.minimum(found.gap, 0.0) - found.before, 0.0), 0.0),
            tensile_strength=near.tension.strength_of(found.key),
            opening=np.maximum(found.gap, 0.0) - np.maximum(found.before, 0.0),
            image=image,
        )


def check_outlines(scene: Scene) -> None:
    """Raise SceneError if a body has no outline."""
    if not scene.outlined.all():
        raise SceneError(
            f"body {np.argmin(scene.outlined)} has no outline; give its Points an outline or use"
            " Scheme(contact=shared_grid, anchor=0)"
        )


def _boundary_interpolation(scene: Scene, grid: BodyGrids, boundary: Outlines) -> sp.csr_array:
    """Interpolation from nodes to boundary points, (m, nodes); the rows of rigid bodies are zero."""
    own, point = scene.deformable[boundary.body], boundary.point
    if not own.all():
        point = scene.among_deformable[point[own]]
    offsets = np.append(0, np.cumsum(4 * own)).astype(np.int32)
    data, indices = (a.reshape(-1, 4)[point].ravel() for a in (grid.interpolation.data, grid.interpolation.indices))
    return sp.csr_array((data, indices, offsets), shape=(own.size, grid.nodes))


def _roles(scene: Scene, surfaces: Images, x: Array) -> Roles:
    """Rank the bodies by which contributes points: deformable before rigid, finer boundary first, then by position.

    In a periodic box the last is their number, and images follow their bodies. The curve of a rigid body does not
    depend on the solution, and neither do the normals of the forces on it. Held rigid bodies are the last: points of
    theirs would not shift to the closest points (`closest_points`), and a disc on them would stand on its chords.
    """
    boundary, bodies, number = surfaces.outlines, surfaces.body.size, surfaces.outlines.body
    count = np.maximum(np.bincount(number, minlength=bodies), 1)
    length = np.hypot(*(x[:, boundary.next] - x))
    spacing = np.bincount(number, length, bodies) / count
    rounded = np.round(spacing / max(float(spacing.max()), 1e-300), 6)
    centre = [np.bincount(number, component, bodies) / count for component in x]
    # Positions depend on the box that a body begins in, its number does not.
    place = centre[::-1] if scene.periodic is None else [np.arange(bodies), surfaces.body]
    rank = np.empty(bodies, dtype=np.int64)
    still = ~scene.deformable[surfaces.body] + 1 * ~scene.movable[surfaces.body]
    rank[np.lexsort((*place, rounded, still))] = np.arange(bodies)
    rigid = ~scene.deformable[surfaces.owner]
    bends = np.where(rigid, bend(boundary, x), 0.0) if rigid.any() else np.zeros(rigid.size)
    return Roles(rank, spacing, bends)


def _of_bodies(found: ContactPairs, surfaces: Images) -> ContactPairs:
    """The contact pairs in numbers of bodies and of their boundary points, instead of those of images."""
    if surfaces.none:
        return found
    boundary = surfaces.boundary
    return replace(
        found,
        bodies=surfaces.bodies_of(found.bodies),
        point=boundary[found.point],
        own=boundary[found.own],
        stencil=boundary[found.stencil],
    )
