"""The weak forms, in scikit-fem's language: the definition of every matrix and vector of the bulk.

They are evaluated on `Body grids.basis`, whose quadrature is the material points. All gradients are with respect to
the anchor configuration; `P` is the first Piola-Kirchhoff stress per anchor volume, `C` its tangent. What runs in
a step are the fast twins of `assembly`, whose reference matrices come from these same forms.
"""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import (
    BilinearForm,
    CellBasis,
    ElementQuad0,
    ElementQuad1,
    ElementVector,
    InteriorFacetBasis,
    LinearForm,
    MeshQuad,
)
from skfem.helpers import dot, grad

Array = NDArray[np.float64]

MONOMIALS = np.array([[0, 1, 0, 1, 2, 0], [0, 0, 1, 1, 0, 2]])
"""Exponents of xi and eta in a product of two Q1 gradients, (2, 6)."""

PAIRS = tuple(combinations_with_replacement(range(4), 2))
"""The ten independent entries of a symmetric 4 x 4 tangent; entry 2 i + I stands for F_iI."""


@BilinearForm
def mass(u: Any, v: Any, w: Any) -> Any:
    """Consistent mass, int rho u . v; its row sums are the lumped mass (Nezamabadi et al. 2017, eq. 6)."""
    return w["rho"] * dot(u, v)


@LinearForm
def momentum(v: Any, w: Any) -> Any:
    """Nodal momentum int rho v_p . v, v_p the velocity at the points (Nezamabadi et al. 2017, eq. 7)."""
    return w["rho"] * dot(w["velocity"], v)


@LinearForm
def internal_force(v: Any, w: Any) -> Any:
    """Virtual work of the stress, int P : grad v (Nezamabadi et al. 2017, eq. 6, with the sign of a resistance)."""
    return np.einsum("ij...,ij...->...", w["P"], grad(v))


@BilinearForm
def stiffness(u: Any, v: Any, w: Any) -> Any:
    """Tangent stiffness, int grad v : C : grad u with C_iIjJ = dP_iI / dF_jJ."""
    return np.einsum("iIjJ...,iI...,jJ...->...", w["C"], grad(v), grad(u))


@BilinearForm
def growth(u: Any, q: Any, w: Any) -> Any:
    """Change of volume, int q S : grad u; S is the slope of the volume by F, q constant in every cell."""
    return q * np.einsum("ij...,ij...->...", w["S"], grad(u))


@LinearForm
def content(q: Any, w: Any) -> Any:
    """Sum of a volume over the cells, int q r; r is that volume per anchor volume."""
    return q * w["r"]


def mean_dilatation_stiffness(basis: CellBasis, slope: Array, mixed: Array, bulk: Array, rest: Array) -> Any:
    """B'D + D'B + B'EB: the stiffness against a change of the cells' mean dilatation theta, (2 nodes, 2 nodes).

    B is the change of theta, D and E the second derivatives of the cells' energies by theta and the displacement, and
    by theta twice: what remains of a mixed form with theta and a pressure constant in every cell once both are
    eliminated (Simo, Taylor & Pister, CMAME 51, 1985). `slope` (2, 2, n) of the volume by F, `mixed` (2, 2, n)
    and `bulk` (n,) of the energy by theta and F, and by theta twice [Pa], `rest` (n,) undeformed volume; all per
    anchor volume.
    """
    mean = basis.with_element(ElementQuad0())
    B = growth.assemble(basis, mean, S=slope[..., None]).multiply(
        1.0 / content.assemble(mean, r=rest[:, None])[:, None]
    )
    D, E = growth.assemble(basis, mean, S=mixed[..., None]), content.assemble(mean, r=bulk[:, None])
    coupled = B.T @ D
    return coupled + coupled.T + B.T @ B.multiply(E[:, None]).tocsr()


@BilinearForm
def jump(u: Any, v: Any, w: Any) -> Any:
    """H [dn u] . [dn v] on a facet: the ghost penalty on poorly filled cells (Coombs, IJNME 2022).

    `u` and `v` come from either side of the facet; the normal is that of side 0 in both.
    """
    return w["h_facet"] * dot(
        np.einsum("ij...,j...->i...", grad(u), w.n), np.einsum("ij...,j...->i...", grad(v), w.n)
    )


def ghost_matrix(mesh: MeshQuad, facets: NDArray[np.int64], cell: float) -> Any:
    """Sum over `facets` of int h [dn u] . [dn v], assembled by scikit-fem, (2 nodes, 2 nodes)."""
    sides = [InteriorFacetBasis(mesh, ElementVector(ElementQuad1()), facets=facets, side=i) for i in (0, 1)]
    return sum((-1.0) ** (i + j) * jump.assemble(sides[i], sides[j], h_facet=cell) for i in (0, 1) for j in (0, 1))


def _unit_square() -> MeshQuad:
    return MeshQuad(np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]]), np.arange(4)[:, None])


def reference_stiffness() -> Array:
    """Stiffness of the unit cell for every unit tangent and monomial weight, (6, 10, 8, 8).

    Q1 gradients are linear in the local coordinates, so a cell's stiffness is linear in six moments of its
    points; in 2D it does not depend on the cell's size. Local dofs are node-interleaved, as in the mesh.
    """
    basis = CellBasis(_unit_square(), ElementVector(ElementQuad1()), intorder=6)
    order = basis.element_dofs[:, 0]
    # Evaluate the form at single points: six of them determine the six monomial coefficients exactly.
    xi, eta = np.array([0.1, 0.9, 0.2, 0.8, 0.5, 0.3]), np.array([0.2, 0.1, 0.7, 0.9, 0.4, 0.95])
    vandermonde = xi[:, None] ** MONOMIALS[0] * eta[:, None] ** MONOMIALS[1]
    values = np.zeros((6, 10, 8, 8))
    for p in range(6):
        point = CellBasis(
            _unit_square(),
            ElementVector(ElementQuad1()),
            quadrature=(np.array([[xi[p]], [eta[p]]]), np.ones(1)),
        )
        for k, (a, b) in enumerate(PAIRS):
            C = np.zeros((4, 4))
            C[a, b] = C[b, a] = 1.0
            K = stiffness.assemble(point, C=C.reshape(2, 2, 2, 2, 1, 1)).toarray()
            values[p, k] = K[np.ix_(order, order)]
    return np.linalg.solve(vandermonde, values.reshape(6, -1)).reshape(6, 10, 8, 8)


def reference_gradient() -> Array:
    """Gradients of the unit cell's shape functions by the monomials 1, xi, eta, (3, 2, 4)."""
    X = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    at = np.stack([ElementQuad1().lbasis(X, i)[1] for i in range(4)], axis=1)
    return np.stack([at[..., 0], at[..., 1] - at[..., 0], at[..., 2] - at[..., 0]])


def reference_ghost() -> Array:
    """Ghost matrix of one facet between two unit cells, (2, 6, 6), scalar, for facets with normal x and y.

    The six nodes are those of the two cells in the order (-1, 0), (0, 0), (1, 0), (-1, 1), (0, 1), (1, 1) along
    (normal, tangent).
    """
    out = np.zeros((2, 6, 6))
    for axis in (0, 1):
        nodes = np.array([[-1.0, 0.0, 1.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]])
        cells = np.array([[0, 1], [1, 2], [4, 5], [3, 4]])
        if axis == 1:
            nodes, cells = nodes[::-1], cells[::-1]
        mesh = MeshQuad(np.ascontiguousarray(nodes), np.ascontiguousarray(cells))
        out[axis] = ghost_matrix(mesh, np.flatnonzero(mesh.f2t[1] >= 0), 1.0).toarray()[::2, ::2]
    return out
