"""A plastic quarter of a disc under a frictionless plate, by finite elements that share nothing with skmpm.

Total Lagrangian, eight-node cells on a curved mesh that fits the disc, 2 x 2 Gauss points, so that plastic flow does
not lock. The return mapping is that of de Souza Neto, Peric & Owen (2008, box 14.3): spectral decomposition of the
trial b_e in three dimensions; its tangent is found by differences. The plate touches nodes, by an active set.
"""

from dataclasses import dataclass

import numpy as np
from fem import disc_mesh
from skfem import Basis, BilinearForm, ElementQuadS2, ElementVector, LinearForm, MeshQuad2, condense, solve
from skfem.helpers import ddot, grad

STEP = 1e-7  # of differences


@dataclass(frozen=True)
class VonMises:
    """Hencky's elasticity, von Mises' yield stress Y + H a, at finite strain and plane strain."""

    E: float
    nu: float
    Y: float
    H: float

    def respond(self, F, inverse_cp, hardened):
        """First Piola-Kirchhoff stress (2, 2, n), and C_p^-1 (n, 3, 3) and equivalent plastic strain (n,) after."""
        mu, bulk = self.E / (2 + 2 * self.nu), self.E / (3 - 6 * self.nu)
        full = np.zeros((F.shape[-1], 3, 3))
        full[:, :2, :2], full[:, 2, 2] = np.moveaxis(F, -1, 0), 1.0
        squared, vectors = np.linalg.eigh(full @ inverse_cp @ full.swapaxes(1, 2))
        strain = 0.5 * np.log(squared)
        volume = strain.sum(axis=1, keepdims=True)
        deviator = strain - volume / 3
        size = np.maximum(np.linalg.norm(deviator, axis=1), 1e-300)
        trial = np.sqrt(6.0) * mu * size
        flow = np.maximum(trial - self.Y - self.H * hardened, 0.0) / (3 * mu + self.H)
        deviator *= (1 - np.sqrt(1.5) * flow / size)[:, None]
        kirchhoff = np.einsum("nik,nk,njk->nij", vectors, 2 * mu * deviator + bulk * volume, vectors)
        elastic = np.einsum("nik,nk,njk->nij", vectors, np.exp(2 * (deviator + volume / 3)), vectors)
        back = np.linalg.inv(full)
        P = np.moveaxis((kirchhoff @ back.swapaxes(1, 2))[:, :2, :2], 0, -1)
        return P, back @ elastic @ back.swapaxes(1, 2), hardened + flow

    def tangent(self, F, inverse_cp, hardened):
        """Derivative of the stress by F, (2, 2, 2, 2, n)."""
        columns = []
        for j, k in np.ndindex(2, 2):
            change = np.zeros((2, 2, 1))
            change[j, k] = STEP
            ends = [self.respond(F + s * change, inverse_cp, hardened)[0] for s in (1, -1)]
            columns.append((ends[0] - ends[1]) / (2 * STEP))
        return np.stack(columns, axis=2).reshape(2, 2, 2, 2, -1)


@dataclass(frozen=True)
class Pressed:
    """What the plate bears, and the state of the disc."""

    stroke: np.ndarray  # (steps,) of the plate
    force: np.ndarray  # (steps,) on the quarter
    height: np.ndarray  # (steps,) of the top of the disc, over the line of symmetry
    mesh: MeshQuad2
    points: np.ndarray  # (2, q) where fields are, at the start
    displacement: np.ndarray  # (2, q)
    plastic: np.ndarray  # (q,) equivalent plastic strain


def press(law, h, strokes, tolerance=1e-8):
    """Press the quarter by a plate through the strokes, one step each: positions of the plate are 1 - stroke."""
    mesh = _curved(h)
    basis = Basis(mesh, ElementVector(ElementQuadS2()), intorder=3)
    x = basis.doflocs
    components = [basis.split_indices()[c] for c in (0, 1)]
    rim = components[1][np.abs(np.hypot(*x[:, components[1]]) - 1) < 1e-6]
    held = np.concatenate([components[0][x[0, components[0]] < 1e-9], components[1][x[1, components[1]] < 1e-9]])
    rim = np.setdiff1d(rim, held)
    top = rim[np.argmin(x[0, rim])]
    u, n = np.zeros(basis.N), basis.dx.size
    inverse_cp, hardened = np.repeat(np.eye(3)[None], n, axis=0), np.zeros(n)
    active, rows = rim[x[1, rim] > 2], []
    for stroke in strokes:
        for _ in range(60):
            limit = 1 - stroke - x[1]
            moved, fixed = np.zeros_like(u), np.concatenate([held, active])
            moved[active] = (limit - u)[active]
            u, residual, F = _equilibrium(basis, law, u, moved, fixed, inverse_cp, hardened, tolerance * law.Y * h)
            pushed = active[residual[active] < 0]
            behind = rim[u[rim] > limit[rim] + 1e-12]
            following = np.union1d(pushed, behind)
            if np.array_equal(following, active):
                break
            active = following
        else:
            raise RuntimeError("the active set did not settle")
        _, inverse_cp, hardened = law.respond(F, inverse_cp, hardened)
        rows.append((stroke, -residual[active].sum(), 1 + u[top]))
    columns = np.array(rows).T
    at = np.asarray(basis.global_coordinates()).reshape(2, -1)
    moved = np.asarray(basis.interpolate(u)).reshape(2, -1)
    return Pressed(*columns, mesh, at, moved, hardened)


def _curved(h):
    """A quarter of a disc of radius 1, in isoparametric cells of mean area h^2 or so."""
    mesh = disc_mesh(h)
    centre = mesh.p[:, mesh.t].mean(axis=1)
    straight = mesh.restrict(np.flatnonzero((centre > 0).all(axis=0)))
    mesh = MeshQuad2.from_mesh(straight)
    places, radius = mesh.doflocs.copy(), np.hypot(*mesh.doflocs)
    ends = straight.facets[:, straight.boundary_facets()]
    arc = ends[:, (np.abs(np.hypot(*straight.p[:, ends]) - 1) < 1e-9).all(axis=0)]
    middle = straight.p[:, arc].mean(axis=1)
    for m in middle.T:
        k = np.argmin(np.hypot(*(places - m[:, None])))
        places[:, k] /= radius[k]
    return MeshQuad2(places, mesh.t)


def _equilibrium(basis, law, u, moved, fixed, inverse_cp, hardened, tolerance):
    """Displacement with those at `fixed` moved, its forces (dofs,), deformation gradients: Newton, line search."""
    free = np.setdiff1d(np.arange(basis.N), fixed)

    def at(u):
        F = np.asarray(basis.interpolate(u).grad).reshape(2, 2, -1) + np.eye(2)[:, :, None]
        return _force(basis, law.respond(F, inverse_cp, hardened)[0]), F

    residual, F = at(u)
    for iteration in range(40):
        if iteration and np.abs(residual[free]).max() <= tolerance:
            return u, residual, F
        K = _stiffness(basis, law.tangent(F, inverse_cp, hardened))
        step = solve(*condense(K, -residual, x=np.zeros_like(u) if iteration else moved, D=fixed))
        slope, length = abs(step @ residual), 1.0
        residual, F = at(u + step)
        while iteration and abs(step @ residual) > 0.9 * slope and length > 0.01:
            length /= 2
            residual, F = at(u + length * step)
        u = u + length * step
    raise RuntimeError("Newton's method did not converge")


def _force(basis, P):
    shape = (2, 2, *basis.dx.shape)
    return LinearForm(lambda v, w: ddot(w.P, grad(v))).assemble(basis, P=P.reshape(shape))


def _stiffness(basis, C):
    shape = (2, 2, 2, 2, *basis.dx.shape)
    form = BilinearForm(lambda u, v, w: np.einsum("ijkl...,kl...,ij...->...", w.C, grad(u), grad(v)))
    return form.assemble(basis, C=C.reshape(shape))
