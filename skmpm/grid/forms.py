"""The weak forms as scikit-fem forms: the definitions of all matrices and vectors of the bulk.

They are assembled on `BodyGrids.basis`, whose quadrature points are the places of the points' strains. Gradients are
with respect to the anchor configuration; `P` is the first Piola-Kirchhoff stress per anchor volume, `C` its tangent.
Time steps use the compiled assembly of `assembly`, which equals these forms.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
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

from skmpm.arrays import Array, Ints


@BilinearForm
def mass(u: Any, v: Any, w: Any) -> Any:
    """Consistent mass matrix, int rho u . v; its row sums are the lumped mass (Nezamabadi et al. 2017, eq. 6)."""
    return w["rho"] * dot(u, v)


@LinearForm
def momentum(v: Any, w: Any) -> Any:
    """Nodal momentum, int rho v_p . v, with the velocity v_p of the points (Nezamabadi et al. 2017, eq. 7)."""
    return w["rho"] * dot(w["velocity"], v)


@LinearForm
def internal_force(v: Any, w: Any) -> Any:
    """Internal force, int P : grad v (Nezamabadi et al. 2017, eq. 6, with the opposite sign)."""
    return np.einsum("ij...,ij...->...", w["P"], grad(v))


@BilinearForm
def stiffness(u: Any, v: Any, w: Any) -> Any:
    """Tangent stiffness, int grad v : C : grad u with C_iIjJ = dP_iI / dF_jJ."""
    return np.einsum("iIjJ...,iI...,jJ...->...", w["C"], grad(v), grad(u))


@BilinearForm
def growth(u: Any, q: Any, w: Any) -> Any:
    """Change of volume, int q S : grad u; S is the derivative of the volume by F, q is constant per cell."""
    return q * np.einsum("ij...,ij...->...", w["S"], grad(u))


@LinearForm
def content(q: Any, w: Any) -> Any:
    """Volume of each cell, int q r; r is the volume per anchor volume, q is constant per cell."""
    return q * w["r"]


def mean_dilatation_stiffness(basis: CellBasis, slope: Array, mixed: Array, bulk: Array, rest: Array) -> Any:
    """Stiffness B'D + D'B + B'EB of the mean dilatation theta of cells, (2 nodes, 2 nodes).

    B is the derivative of theta by the displacement, D and E are the second derivatives of the energies of cells by
    theta and the displacement and by theta twice. This is the mixed form with theta and a pressure constant in each
    cell, after elimination of both (Simo, Taylor & Pister, CMAME 51, 1985). `slope` (2, 2, n) is the derivative of
    the volume by F, `mixed` (2, 2, n) and `bulk` (n,) are those of the energy by theta and F and by theta twice [Pa],
    and `rest` (n,) is the undeformed volume; all per anchor volume.
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
    """Ghost penalty h [dn u] . [dn v] on a facet beside a poorly filled cell (Coombs, IJNME 2022).

    `u` and `v` are each taken on one side of the facet; the normal is that of side 0 for both.
    """
    return w["h_facet"] * dot(
        np.einsum("ij...,j...->i...", grad(u), w.n), np.einsum("ij...,j...->i...", grad(v), w.n)
    )


def ghost_matrix(mesh: MeshQuad, facets: Ints, cell: float) -> Any:
    """Ghost penalty matrix (2 nodes, 2 nodes): sum over `facets` of int h [dn u] . [dn v]."""
    sides = [InteriorFacetBasis(mesh, ElementVector(ElementQuad1()), facets=facets, side=i) for i in (0, 1)]
    return sum((-1.0) ** (i + j) * jump.assemble(sides[i], sides[j], h_facet=cell) for i in (0, 1) for j in (0, 1))


def reference_gradient() -> Array:
    """Coefficients of 1, xi, eta in the gradients of the shape functions of the unit cell, (3, 2, 4)."""
    X = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    at = np.stack([ElementQuad1().lbasis(X, i)[1] for i in range(4)], axis=1)
    return np.stack([at[..., 0], at[..., 1] - at[..., 0], at[..., 2] - at[..., 0]])


@cache
def reference_ghost() -> Array:
    """Ghost penalty matrix of a facet between two unit cells, scalar, (6, 6); the same for normals along x and y.

    The coordinates (normal, tangent) of the six nodes are (-1, 0), (0, 0), (1, 0), (-1, 1), (0, 1), (1, 1).
    """
    nodes = np.array([[-1.0, 0.0, 1.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]])
    mesh = MeshQuad(nodes, np.array([[0, 1], [1, 2], [4, 5], [3, 4]]))
    return np.asarray(ghost_matrix(mesh, np.flatnonzero(mesh.f2t[1] >= 0), 1.0).toarray()[::2, ::2])
