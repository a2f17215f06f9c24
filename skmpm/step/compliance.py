"""Unknowns that couple many contacts, in the contact problem: eliminated, or a border of W.

The unknowns s add L s to the velocities of contacts, and follow from the impulses, D s = R^T (r - known): eliminating
them adds L D^-1 R^T to W. A box under stress moves all contacts, and bars couple those of all bodies that they join,
so that W would become dense. In large problems they stay bilateral unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from skmpm import coulomb
from skmpm.arrays import Array, Ints
from skmpm.contact.rows import stacked
from skmpm.linear import Delassus, Solver
from skmpm.linear.corrected import Joined, Rotated
from skmpm.step.contact_problem import ContactIterate
from skmpm.step.contact_stiffness import ContactStiffness
from skmpm.step.factor import Factor


@dataclass(frozen=True)
class Border:
    """Unknowns s (p,) that stay in the contact problem."""

    left: sp.csr_array  # L (m, p), in the rows of W: of contacts, then of the geometric stiffness
    right: sp.csr_array  # R (m, p)
    own: sp.csr_array  # D (p, p)
    positive: int  # number of positive eigenvalues of D

    def of_contacts(self, k: int) -> Border:
        """The border of the first k rows, without those of the geometric stiffness."""
        return Border(self.left[:k], self.right[:k], self.own, self.positive)

    def around(
        self, W: sp.csr_array, inner: coulomb.Bilateral | None, known: Array
    ) -> tuple[sp.csr_array, coulomb.Bilateral]:
        """W with a border [[W, L], [R^T, -D]], and its bilateral unknowns, those of W first."""
        size = self.own.shape[0]
        left, right = (_padded(rows, (W.shape[0], size)) for rows in (self.left, self.right))
        below = sp.hstack([sp.csr_array(right.T), -self.own], format="csr")
        bordered = sp.csr_array(sp.vstack([sp.hstack([W, left], format="csr"), below], format="csr"))
        own = coulomb.Bilateral(-(self.right[: known.size].T @ known))
        if inner is None:
            return bordered, own
        negative = None if inner.negative is None else inner.negative + self.positive
        return bordered, coulomb.Bilateral(np.append(inner.q, own.q), negative)


def with_bars(
    contact: ContactIterate, joining: Joined, W: sp.csr_array, left: sp.csr_array, right: sp.csr_array
) -> tuple[sp.csr_array, Border | None]:
    """W of the rows `left` and `right` (m, 2 contact points) with bars; what stays a border.

    The inverse without bars gives W = theta L A^-1 R^T; they take off theta L Z D^-1 (R Z)^T.
    """
    theta = contact.increment.scheme.theta
    at_points = sp.csr_array(sp.kron(contact.constraints.base, np.eye(2), format="csr") @ joining.Z)
    moved, pushed = sp.csr_array(left @ at_points), sp.csr_array(right @ at_points)
    if contact.r.size <= coulomb.MAX_DENSE_ROWS:
        return sp.csr_array(W - sp.csr_array(theta * joining.correction(moved, pushed))), None
    return W, Border(theta * moved, theta * pushed, sp.csr_array(-theta * joining.D), 0)


def with_scalars(
    contact: ContactIterate, W: sp.csr_array, geometric: ContactStiffness | None
) -> tuple[sp.csr_array, Border | None]:
    """W with the response of the scalar unknowns to contacts; what stays a border.

    Those that a few contacts move are eliminated. A box stays an unknown in large problems, unless contacts respond
    above all by it, as between held bodies.
    """
    left = right = contact.J
    if geometric is not None:
        left, right = (stacked([contact.J, rows]) for rows in (geometric.Z_scalars, geometric.acting_scalars))
    unknowns, border = contact.increment.scalars, None
    stiffness = unknowns.inertia.response / unknowns.inertia.theta
    if unknowns.carrier is not None and contact.r.size > coulomb.MAX_DENSE_ROWS:
        few = unknowns.carrier.inertia.v0.size
        box, rest = contact.J[:, :few], stiffness[:few]
        if (W.diagonal()[: contact.r.size] >= box.multiply(box) @ (1.0 / rest)).all():
            border = Border(left[:, :few], right[:, :few], sp.csr_array(sp.diags_array(rest)), few)
            left, right, stiffness = left[:, few:], right[:, few:], stiffness[few:]
    responding = sp.csr_array(
        (left.data * (1.0 / stiffness)[left.indices], left.indices, left.indptr), shape=left.shape
    )
    return sp.csr_array(W + responding @ right.T), border


def _padded(rows: sp.csr_array, shape: tuple[int, int]) -> sp.csr_array:
    """Rows followed by empty ones, in a matrix of this shape."""
    indptr = np.append(rows.indptr, np.full(shape[0] - rows.shape[0], rows.nnz))
    return sp.csr_array((rows.data, rows.indices, indptr), shape=shape)


def delassus_matrix(
    contact: ContactIterate, solver: Solver, factor: Factor, geometric: ContactStiffness | None
) -> tuple[sp.csr_array, list[Border], Factor]:
    """W = theta H A^-1 H^T of the contacts, extended by the rows and columns of the geometric stiffness.

    The solver is that of the factor, turned. Also returns the borders of W that bars and a box are, and the factor
    with the responses of the contact points in W.
    """
    constraints, increment, delassus = contact.constraints, contact.increment, factor.delassus
    joining = solver if isinstance(solver, Joined) else None
    turned = solver if isinstance(solver, Rotated) else None
    solver = solver.solver if isinstance(solver, (Joined, Rotated)) else solver
    owners = _owners(contact)
    if delassus is None:
        reused = increment.bulk.linear and increment.scheme.anchor > 0.0
        reused &= solver.name != "amg"  # needs a solve per contact point: only for those in contact
        delassus = Delassus.with_factor(solver, constraints.base, owners, factor.points, whole=reused)
    left = right = constraints.D
    if geometric is not None:
        left, right = (stacked([left, rows]) for rows in (geometric.Z, geometric.acting))
    if turned:
        left, right = (turned.turned_back(rows, owners) for rows in (left, right))
    W, delassus = delassus.between(left, right)
    W, bars, box = increment.scheme.theta * W, None, None
    if joining:
        W, bars = with_bars(contact, joining, W, left, right)
    if increment.scalars.kinds:
        W, box = with_scalars(contact, W, geometric)
    return W, [border for border in (bars, box) if border is not None], replace(factor, delassus=delassus)


def _owners(contact: ContactIterate) -> Ints:
    """The bodies of the contact points, (m,); 0 for those of rigid bodies, which are not used."""
    base, grid = contact.constraints.base, contact.increment.grid
    owner = np.zeros(base.shape[0], dtype=np.int64)
    deformable = np.flatnonzero(np.diff(base.indptr))
    owner[deformable] = grid.node_body[base.indices[base.indptr[deformable]]]
    return owner
