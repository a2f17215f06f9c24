"""Rows: contacts as algebra, the only thing the solver sees of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.grid import BodyGrids
from skmpm.scene import PrescribedVelocities, Scene, State

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Constraints:
    """k contacts; the relative velocity (first minus second body) is `difference @ base @ w + given`.

    `offset` holds what completes it in the contact law: u = H w + offset, with 0 <= u_n perp r_n >= 0. Contacts
    combine the velocities of places (boundary points, grid nodes), which combine those of nodes: H = D (base x I).
    """

    bodies: Ints  # (2, k); walls are -1, -2, ...
    x: Array  # (2, k) [m]
    normal: Array  # (2, k) unit, from the second to the first body
    gap: Array  # (k,) [m]
    friction: Array  # (k,) Coulomb coefficients
    key: Ints  # (k,) identity from step to step
    point: Ints  # (k,) boundary point of the first body, -1 at a grid node
    base: sp.csr_array  # (m, nodes) from nodal velocities to those of places
    difference: sp.csr_array  # (k, m)
    tangent_shares: sp.csr_array  # (k, m) of places: how fast the second body's unit tangent turns and grows [1/m]
    curvature: Array  # (k,) of that surface, negative where it bulges [1/m]
    prescribed: Array  # (2, k) prescribed part of the relative velocity [m/s]
    offset_normal: Array  # (k,) [m/s]
    pushed_out: Array  # (k,) how much of an overlap left by an earlier step this step removes [m]

    @property
    def size(self) -> int:
        """Number of contacts."""
        return self.gap.size

    @property
    def tangential(self) -> bool:
        """Whether any contact has friction; without it there are no tangential rows."""
        return bool(self.friction.any())

    @property
    def tangent(self) -> Array:
        """Unit tangents (-n_y, n_x), (2, k)."""
        return np.stack([-self.normal[1], self.normal[0]])

    @cached_property
    def D(self) -> sp.csr_array:
        """Velocities of places (2 m,) to relative ones: rows n (k,) or, with friction, n, t, n, t, ... (2 k,)."""
        directions = (self.normal, self.tangent) if self.tangential else (self.normal,)
        rows = [component_along(self.difference, direction) for direction in directions]
        if not self.tangential:
            return rows[0]
        return sp.csr_array(sp.vstack(rows, format="csr")[self._interleaved])

    @property
    def H(self) -> sp.csr_array:
        """Nodal velocities (2 nodes,) to relative velocities."""
        return sp.csr_array(self.D @ sp.kron(self.base, np.eye(2), format="csr"))

    def at_contact_points(self, w: Array) -> Array:
        """Velocities of the places (2 m,) from those of the nodes (2 nodes,)."""
        return np.asarray(self.base @ w.reshape(-1, 2)).ravel()

    def at_nodes(self, impulses: Array) -> Array:
        """What impulses at places (2 m,) are at nodes, (2 nodes,)."""
        return np.asarray(self.base.T @ impulses.reshape(-1, 2)).ravel()

    def geometric(self, chosen: Ints) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
        """Rows of the chosen contacts, by places: sliding [m/s], turning and stretch of the second surface [1/s]."""
        slide, surface = (
            component_along(self.difference[chosen], self.tangent[:, chosen]),
            self.tangent_shares[chosen],
        )
        return (
            slide,
            component_along(surface, self.normal[:, chosen]),
            component_along(surface, self.tangent[:, chosen]),
        )

    @cached_property
    def curved(self) -> NDArray[np.bool_]:
        """Whether the second surface is curved and of a body with unknowns, (k,)."""
        unknown = np.diff(self.base.indptr) > 0
        row = np.repeat(np.arange(self.size), np.diff(self.tangent_shares.indptr))
        return np.asarray(np.bincount(row, unknown[self.tangent_shares.indices], self.size) > 0)

    @property
    def _interleaved(self) -> Ints:
        return np.arange(2 * self.size).reshape(2, -1).T.ravel()

    @property
    def offset(self) -> Array:
        """What completes u = H w + offset, (k,) or (2 k,) [m/s]."""
        return self._with_sliding(self.offset_normal)

    @property
    def prescribed_components(self) -> Array:
        """The prescribed relative velocity along the rows of H, (k,) or (2 k,) [m/s]."""
        return self._with_sliding(np.einsum("ik,ik->k", self.normal, self.prescribed))

    def _with_sliding(self, normal: Array) -> Array:
        """Interleave normal components with the prescribed sliding, where there are tangential rows."""
        if not self.tangential:
            return normal
        return np.stack([normal, np.einsum("ik,ik->k", self.tangent, self.prescribed)], axis=1).ravel()

    def with_frames_of(self, earlier: Constraints, w: Array) -> Constraints:
        """These rows about w, gaps and all, but acting along the normals and on the places of `earlier` ones.

        A corner on a side may go on as two tips, with the roles of the two bodies exchanged.
        """
        found, where = _match(earlier.key, self.key)
        i = np.flatnonzero(found)
        way = np.where(earlier.bodies[0, where] == self.bodies[0], 1.0, -1.0)
        taken = sp.csr_array((way[i], (i, where[i])), shape=(self.size, earlier.size))
        kept = sp.diags_array((~found).astype(float))
        normal = np.where(found, way * earlier.normal[:, where], self.normal)
        difference = sp.csr_array(kept @ self.difference + taken @ earlier.difference)
        there = self.base @ w.reshape(-1, 2)
        speeds = [(combined @ there).T for combined in (self.difference, difference)]
        rotated = np.einsum("ik,ik->k", self.normal, speeds[0]) - np.einsum("ik,ik->k", normal, speeds[1])
        return replace(
            self,
            normal=normal,
            difference=difference,
            prescribed=np.where(found, way * earlier.prescribed[:, where], self.prescribed),
            offset_normal=self.offset_normal + rotated,
        )

    def among(self, chosen: NDArray[np.bool_]) -> Constraints:
        """The chosen ones of these rows, `chosen` (k,)."""
        if chosen.all():
            return self
        kept = np.flatnonzero(chosen)
        some = {f.name: _some(getattr(self, f.name), kept) for f in fields(self) if f.name != "base"}
        return replace(self, **some)

    def forces(self, r: Array, dt: float) -> Array:
        """Mean forces over the step in (n, t), (2, k) [N/m], from impulses r."""
        if self.tangential:
            return np.ascontiguousarray(r.reshape(-1, 2).T) / dt
        return np.stack([r, np.zeros_like(r)]) / dt

    def impulses(self, key: Ints, force: Array, dt: float) -> Array:
        """Impulses of these rows from the forces (2, m) of contacts known by their `key` (m,); else zero."""
        found, where = _match(key, self.key)
        r = np.where(found, dt * force[:, where], 0.0) if key.size else np.zeros((2, self.size))
        return np.asarray(r.T.ravel() if self.tangential else r[0])


def _some(values: Any, chosen: Ints) -> Any:
    return values[chosen] if isinstance(values, sp.csr_array) else values[..., chosen]


def component_along(matrix: sp.csr_array, direction: Array) -> sp.csr_array:
    """Rows (k, 2 m) that take the component along `direction` (2, k) of what `matrix` (k, m) gives."""
    count = np.diff(matrix.indptr)
    columns = np.stack([2 * matrix.indices, 2 * matrix.indices + 1], axis=1).ravel()
    data = (matrix.data * np.repeat(direction, count, axis=1)).T.ravel()
    return sp.csr_array((data, columns, 2 * matrix.indptr), shape=(matrix.shape[0], 2 * matrix.shape[1]))


Linearise = Callable[[Array], Constraints]
ContactLaw = Callable[[Scene, State, BodyGrids, float, float, PrescribedVelocities], Linearise]


def _match(known: Ints, wanted: Ints) -> tuple[NDArray[np.bool_], Ints]:
    """For each wanted key whether it is among the known ones (unique), and where."""
    order = np.argsort(known)
    place = np.minimum(np.searchsorted(known[order], wanted), max(known.size - 1, 0))
    where = order[place] if known.size else place
    return (known[where] == wanted) if known.size else np.zeros(wanted.size, dtype=bool), where


def lookup(known: Ints, values: Array, wanted: Ints, otherwise: float) -> Array:
    """Values (m,) of known keys (m,) at the wanted keys (k,)."""
    if known.size == 0:
        return np.full(wanted.size, otherwise)
    found, where = _match(known, wanted)
    return np.asarray(np.where(found, values[where], otherwise))
