"""Contact constraints: contact Jacobian, gaps and friction, the input of the contact solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import Array, Bools, Ints
from skmpm.contact.feet import MIN_CURVATURE_FACTOR
from skmpm.contact.rows import among, combinations, components
from skmpm.grid import BodyGrids
from skmpm.scene import PrescribedVelocities, Scene, State


@dataclass(frozen=True)
class SurfaceGeometry:
    """Geometry of the surfaces in k contacts, from which the geometric stiffness of contact follows.

    Attributes
    ----------
    stencil : (4, k) contact points that define the second surface at the foot
    tangent_shares : (4, k) their weights in its unit tangent, zero for walls and at corners [1/m]
    own : (4, k) contact points that define the first surface
    own_shares : (4, k) their weights in its unit tangent, zero where the contact point is fixed [1/m]
    curvature : (k,) of the second surface, negative where it is convex [1/m]
    along : (k,) cosine between the tangents of both surfaces
    travel : (k,) of the contact point per turn of both surfaces against each other [m]; 0 if it is fixed
    wide_from : (k,) normal force between the bodies that makes a contact too wide to travel [N/m]
    """

    stencil: Ints
    tangent_shares: Array
    own: Ints
    own_shares: Array
    curvature: Array
    along: Array
    travel: Array
    wide_from: Array

    @staticmethod
    def fixed(contacts: int) -> SurfaceGeometry:
        """The geometry where normals and contact points do not move with the surfaces."""
        points, shares, none = np.zeros((4, contacts), dtype=np.int64), np.zeros((4, contacts)), np.zeros(contacts)
        return SurfaceGeometry(points, shares, points, shares, none, none, none, np.full(contacts, np.inf))


@dataclass(frozen=True)
class Constraints:
    """The constraints of k contacts; their relative velocity (first minus second body) is u = H w + offset.

    The contact law is 0 <= u_n perp r_n >= 0 with Coulomb friction, for `lifted` impulses r. The m contact points
    are the boundary points or, for shared-grid contact, the grid nodes. The contact Jacobian H = D (base x I) maps
    nodal velocities to contact points (`base`) and takes their differences along normals and tangents (`D`);
    `prescribed` is the part of the relative velocity that prescribed motions contribute, and `offset` contains gaps
    as well.

    Attributes
    ----------
    bodies : (2, k); walls are -1, -2, ...
    x : (2, k) [m]
    normal : (2, k) unit, from the second to the first body
    gap : (k,) [m]
    friction : (k,) Coulomb coefficients
    key : (k,) identity of the contact, the same in all steps
    point : (k,) material point of the first body, -1 at a grid node
    base : (m, nodes) interpolation from nodes to contact points
    difference : (k, m) first body minus second body
    geometry : of the surfaces
    rigid : (m, 2) velocities of the contact points on rigid bodies, zero on others [m/s]
    surfaces : (2, k) relative velocity by the motion of walls and of periodic images [m/s]
    offset_normal : (k,) [m/s]
    pushed_out : (k,) part of an initial overlap that this step removes [m]
    tensile_strength : (k,) largest tension c l that the contact bears in this step [N/m]
    opening : (k,) change of the positive part of the gap in this step [m]
    image : (2, k) displacement of the second body to its image in contact, at the end of the step [m]
    """

    bodies: Ints
    x: Array
    normal: Array
    gap: Array
    friction: Array
    key: Ints
    point: Ints
    base: sp.csr_array
    difference: sp.csr_array
    geometry: SurfaceGeometry
    rigid: Array
    surfaces: Array
    offset_normal: Array
    pushed_out: Array
    tensile_strength: Array
    opening: Array
    image: Array

    @property
    def size(self) -> int:
        """Number of contacts."""
        return self.gap.size

    @cached_property
    def prescribed(self) -> Array:
        """Part of the relative velocity that prescribed motions contribute, (2, k) [m/s]."""
        if not self.rigid.any():
            return self.surfaces
        return np.asarray(self.surfaces + (self.difference @ self.rigid).T)

    @property
    def tangential(self) -> bool:
        """Whether any contact has friction; without friction there are no tangential rows."""
        return bool(self.friction.any())

    @property
    def cohesive(self) -> bool:
        """Whether any contact bears tension."""
        return bool(self.tensile_strength.any())

    @cached_property
    def tangent(self) -> Array:
        """Unit tangents (-n_y, n_x), (2, k)."""
        return np.stack([-self.normal[1], self.normal[0]])

    @cached_property
    def D(self) -> sp.csr_array:
        """From contact point (2 m,) to relative velocities: rows n (k,) or, with friction, n, t, n, t, ... (2 k,)."""
        return components(self.difference, *self.directions)

    @property
    def directions(self) -> tuple[Array, ...]:
        """The directions (2, k) of the rows of each contact: its normal and, with friction, its tangent."""
        return (self.normal, self.tangent) if self.tangential else (self.normal,)

    @property
    def H(self) -> sp.csr_array:
        """The contact Jacobian: from nodal velocities (2 nodes,) to relative velocities (k,) or (2 k,)."""
        return sp.csr_array(self.D @ sp.kron(self.base, np.eye(2), format="csr"))

    @cached_property
    def shares(self) -> sp.csr_array:
        """From nodal velocities to relative ones, the same for both components, (k, nodes)."""
        return sp.csr_array(self.difference @ self.base)

    def at_contact_points(self, w: Array) -> Array:
        """Velocities of the contact points (2 m,) from those of the nodes (2 nodes,)."""
        return np.asarray(self.base @ w.reshape(-1, 2)).ravel()

    def at_nodes(self, impulses: Array) -> Array:
        """Nodal impulses (2 nodes,) equivalent to impulses at the contact points (2 m,)."""
        return np.asarray(self.base.T @ impulses.reshape(-1, 2)).ravel()

    def geometric(self, chosen: Ints) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
        """Rows (chosen, 2 m) of the geometric stiffness, to be applied to velocities of the contact points.

        They give the sliding velocity [m/s] and the rates of rotation and stretch of the second surface [1/s].
        """
        surface, normal, tangent = self._of_tangents(chosen)[1], self.normal[:, chosen], self.tangent[:, chosen]
        slide = components(self.difference[chosen], tangent)
        return slide, components(surface, normal), components(surface, tangent)

    def _of_tangents(self, chosen: Ints) -> tuple[sp.csr_array, sp.csr_array]:
        """Rows (chosen, m) that combine contact points to the unit tangents of the first and the second surface."""
        at, points = self.geometry, self.difference.shape[1]
        sides = ((at.own, at.own_shares), (at.stencil, at.tangent_shares))
        own, other = (combinations(columns[:, chosen], shares[:, chosen], points) for columns, shares in sides)
        return own, other

    @property
    def spread(self) -> Array:
        """Turn of the normal over that of the surface at its foot, c = 1 / (1 - g kappa), (k,)."""
        return np.asarray(1.0 / np.maximum(1.0 - self.gap * self.geometry.curvature, MIN_CURVATURE_FACTOR))

    def turning(self, chosen: Ints, direction: Array, sliding: Array | float = 1.0) -> sp.csr_array:
        """Rows (chosen, 2 m) to the rates at which the surfaces turn against each other [1/s].

        With the normals as `direction` (2, chosen): the slope of the gap along the first outline changes with its own
        rotation and with that of the normal, which turns as the second surface does, and by the curvature of that
        where the contact slides. With other directions, and other weights of `sliding`, these are the rows in which
        a force acts that moves along both outlines.
        """
        slide, at = components(self.difference[chosen], self.tangent[:, chosen]), self.geometry
        own, other = (components(rows, direction) for rows in self._of_tangents(chosen))
        factor = at.along[chosen] * self.spread[chosen]
        bend = sp.diags_array(factor * at.curvature[chosen] * sliding)
        return sp.csr_array(own - sp.diags_array(factor) @ other - bend @ slide)

    @cached_property
    def curved(self) -> Bools:
        """Whether the second surface is that of a body, and no corner of it, (k,)."""
        return np.asarray(self.geometry.tangent_shares.any(axis=0))

    @property
    def offset(self) -> Array:
        """The offset of u = H w + offset, (k,) or (2 k,) [m/s]; along tangents it is what is prescribed."""
        if not self.tangential:
            return self.offset_normal
        return np.stack([self.offset_normal, np.einsum("ik,ik->k", self.tangent, self.prescribed)], axis=1).ravel()

    def components(self, vectors: Array) -> Array:
        """Components of vectors (2, k) along normals and tangents, in the order of the rows of H, (k,) or (2 k,)."""
        normal = np.einsum("ik,ik->k", self.normal, vectors)
        if not self.tangential:
            return np.asarray(normal)
        return np.stack([normal, np.einsum("ik,ik->k", self.tangent, vectors)], axis=1).ravel()

    def among(self, chosen: Bools) -> Constraints:
        """The constraints of the contacts where `chosen` (k,) is true."""
        if chosen.all():
            return self
        kept = np.flatnonzero(chosen)
        of_contacts = (f.name for f in fields(self) if f.name not in ("base", "rigid", "geometry", "difference"))
        some = {name: getattr(self, name)[..., kept] for name in of_contacts}
        return replace(self, geometry=among(self.geometry, kept), difference=self.difference[kept], **some)

    def normal_part(self, r: Array) -> Array:
        """The normal components (k,) of impulses."""
        return r[::2] if self.tangential else r

    def lifted(self, r: Array, dt: float) -> Array:
        """Impulses r + c l dt n [N s/m], which obey the law without cohesion, from r [N s/m]; back again with -dt."""
        if not self.cohesive:
            return r
        out = r.copy()
        out[:: 2 if self.tangential else 1] += dt * self.tensile_strength
        return out

    def forces(self, r: Array, dt: float) -> Array:
        """Mean forces over the step, normal and tangential (2, k) [N/m], from impulses r [N s/m]."""
        if self.tangential:
            return np.ascontiguousarray(r.reshape(-1, 2).T) / dt
        return np.stack([r, np.zeros_like(r)]) / dt

    def vectors(self, r: Array) -> Array:
        """Impulses r as vectors, (2, k)."""
        return np.asarray(np.einsum("kd,dik->ik", r.reshape(self.size, -1), np.stack(self.directions)))

    def impulses(self, key: Ints, force: Array, dt: float) -> Array:
        """Impulses of these contacts from the forces (2, m) of contacts with keys `key` (m,); zero for others."""
        r = lookup(key, dt * force, self.key, 0.0)
        return np.asarray(r.T.ravel() if self.tangential else r[0])


def no_constraints(base: sp.csr_array) -> Constraints:
    """Constraints of no contact, over these contact points."""
    none, two, rows = np.zeros(0), np.zeros((2, 0)), sp.csr_array((0, base.shape[0]))
    no_index, no_pair = np.zeros(0, dtype=np.int64), np.zeros((2, 0), dtype=np.int64)
    return Constraints(
        *(no_pair, two, two, none, none, no_index, no_index, base, rows, SurfaceGeometry.fixed(0)),
        *(np.zeros((base.shape[0], 2)), two, none, none, none, none, two),
    )


Linearise = Callable[..., Constraints]  # of nodal velocities and, if forces drive anything, all prescribed ones
ContactFormulation = Callable[[Scene, State, BodyGrids, float, float, PrescribedVelocities, bool], Linearise]


def acts_at_grid_nodes(law: ContactFormulation) -> bool:
    """Whether a contact formulation acts at grid nodes that bodies share, by its optional attribute `at_grid_nodes`.

    Such a formulation measures no gaps and needs body grids rebuilt at every step. Any other acts between outlines
    and is held to the checks of its gaps, functions that call `point_to_curve` among them.

    Parameters
    ----------
    law : the contact formulation

    Returns
    -------
    whether it does

    Examples
    --------
    >>> import skmpm
    >>> skmpm.contact.acts_at_grid_nodes(skmpm.contact.shared_grid)
    True
    >>> skmpm.contact.acts_at_grid_nodes(skmpm.contact.point_to_curve)
    False
    """
    return bool(getattr(law, "at_grid_nodes", False))


def lookup(known: Ints, values: Array, wanted: Ints, otherwise: float | Array) -> Array:
    """Values (..., k) of the wanted keys (k,) from those (..., m) of known ones (m,), unique, else `otherwise`.

    The latter is one number, or one for each row (..., 1).
    """
    if known.size == 0:
        return np.full((*values.shape[:-1], wanted.size), otherwise)
    order = np.argsort(known, kind="stable")  # fast where runs ascend, as keys do
    where = order[np.minimum(np.searchsorted(known[order], wanted), known.size - 1)]
    return np.where(known[where] == wanted, np.take(values, where, axis=-1), otherwise)
