"""Plane-strain elasticity by scikit-fem on meshes that fit the body: Q1 to compare with, Q2 and P2 as references.

Arrays are components first, points last, as in skmpm: x, u (2, n), stress (2, 2, n).
"""

from dataclasses import dataclass

import numpy as np
from skfem import (
    Basis,
    BilinearForm,
    CellBasis,
    ElementQuad1,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshQuad,
    condense,
    solve,
)
from skfem.helpers import ddot, dot, grad

from skmpm.material import LinearElastic

MATERIAL = LinearElastic(1e6, 0.3, 1000.0)
LAMBDA, MU = MATERIAL.lame


def by_neighbours(f, x, size=64):
    """The values (..., n) of a function of positions x (2, n), of `size` neighbours at a time.

    The finders of scikit-fem compare each of their points with every cell that is near any of them.
    """
    order = np.argsort(x[0])
    values = np.concatenate([f(x[:, part]) for part in np.array_split(order, 1 + order.size // size)], axis=-1)
    return values[..., np.argsort(order)]


def hooke(gradient):
    """Stress (2, 2, ...) of a displacement gradient (2, 2, ...), plane strain."""
    strain = 0.5 * (gradient + gradient.swapaxes(0, 1))
    one = np.eye(2).reshape(2, 2, *(1,) * (strain.ndim - 2))
    return 2.0 * MU * strain + LAMBDA * np.einsum("ii...->...", strain) * one


@BilinearForm
def stiffness(u, v, w):
    """Virtual work of the stress."""
    return ddot(hooke(grad(u)), grad(v))


@dataclass(frozen=True)
class Field:
    """A displacement and its stress at points with weights, as the norms want them."""

    x: np.ndarray  # (2, n) [m]
    u: np.ndarray  # (2, n) [m]
    stress: np.ndarray  # (2, 2, n) [Pa]
    weight: np.ndarray  # (n,) [m2]


@dataclass(frozen=True)
class Solution:
    """A finite element solution: nodal values on a basis."""

    basis: CellBasis
    nodal: np.ndarray

    def field(self):
        """The solution at the basis's own quadrature points."""
        basis, u = self.basis, self.basis.interpolate(self.nodal)
        x = np.asarray(basis.global_coordinates()).reshape(2, -1)
        return Field(x, np.asarray(u).reshape(2, -1), hooke(u.grad).reshape(2, 2, -1), basis.dx.ravel())

    def at(self, local, cells):
        """Displacement and stress (2, n), (2, 2, n) at local coordinates (2, n) of given cells (n,)."""
        mesh, element = self.basis.mesh, self.basis.elem
        rule = (local[:, :, None], np.ones((cells.size, 1)))
        options = {"mapping": self.basis.mapping, "dofs": self.basis.dofs, "disable_doflocs": True}
        u = CellBasis(mesh, element, elements=cells, quadrature=rule, **options).interpolate(self.nodal)
        return np.asarray(u)[..., 0], hooke(u.grad)[..., 0]


def solve_fem(mesh, traction, held, element=None):
    """Solve under a traction on the boundary, (x, normal) -> (2, ...) [Pa], with the sides `held`.

    `held` lists (axis, velocity): on the side x[axis] = 0 the components of velocity that are not None are zero.
    Without any, three values of two far nodes are fixed: rigid motions are for the norm to take out.
    """
    basis = Basis(mesh, ElementVector(element or ElementQuad1()))
    boundary = FacetBasis(mesh, basis.elem, intorder=8)
    force = LinearForm(lambda v, w: dot(traction(w.x, w.n), v)).assemble(boundary)
    fixed = [_side(basis, axis, c) for axis, prescribed in held for c in (0, 1) if prescribed[c] is not None]
    if not held:
        far = basis.nodal_dofs[:, [mesh.p[0].argmin(), mesh.p[0].argmax()]]
        fixed = [far[0, :1], far[1]]
    fixed = np.unique(np.concatenate(fixed))
    return Solution(basis, solve(*condense(stiffness.assemble(basis), force, D=fixed)))


def _side(basis, axis, component):
    dofs = basis.get_dofs(lambda x: np.abs(x[axis]) < 1e-9)
    return dofs.all(f"u^{component + 1}")


def mapped(nx, ny, function):
    """The unit square in nx by ny cells, its nodes (2, n) moved by `function`."""
    square = MeshQuad.init_tensor(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1))
    return MeshQuad(np.ascontiguousarray(function(square.p)), square.t)


def merged(meshes):
    """One mesh of several that share nodes."""
    first = np.cumsum([0] + [mesh.p.shape[1] for mesh in meshes[:-1]])
    nodes = np.concatenate([mesh.p for mesh in meshes], axis=1)
    cells = np.concatenate([mesh.t + start for mesh, start in zip(meshes, first, strict=True)], axis=1)
    _, chosen, number = np.unique(np.round(nodes, 9), axis=1, return_index=True, return_inverse=True)
    return MeshQuad(np.ascontiguousarray(nodes[:, chosen]), np.ascontiguousarray(number.ravel()[cells]))


def strip_mesh(length, depth, h):
    """A rectangle [0, length] x [-depth/2, depth/2] in squares of side h."""
    return mapped(round(length / h), round(depth / h), lambda p: p * [[length], [depth]] - [[0.0], [depth / 2]])


def hole_mesh(side, h):
    """A quarter of a square plate with a hole of radius 1, two blocks of n x n cells of mean area h^2."""
    n = max(1, round(np.sqrt((side**2 - np.pi / 4) / 2) / h))

    def block(p):
        angle = np.pi / 4 * p[1]
        inner = np.array([np.cos(angle), np.sin(angle)])
        return inner + p[0] * (side * np.array([np.ones_like(angle), p[1]]) - inner)

    return merged([mapped(n, n, block), mapped(n, n, lambda p: block(p)[::-1])])


def disc_mesh(h):
    """A disc of radius 1: a square in its middle and four blocks around it, cells of mean area h^2 or so."""
    n = max(2, round(1 / h))

    def ring(p):
        q = 2 * p[1] - 1
        inner = 0.5 * np.array([np.ones_like(q), q])
        return inner + p[0] * (np.array([np.cos(np.pi / 4 * q), np.sin(np.pi / 4 * q)]) - inner)

    turns = [np.round([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in np.pi / 2 * np.arange(4)]
    rings = [mapped(max(1, round(n / 2)), n, lambda p, turn=turn: turn @ ring(p)) for turn in turns]
    return merged([mapped(n, n, lambda p: p - 0.5), *rings])
