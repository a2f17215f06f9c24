"""Bodies of two materials with known solutions: laminates, a disc with a round core, a disc with a square core."""

from dataclasses import dataclass
from functools import cache

import meshio
import numpy as np
from fem import Solution, by_neighbours, disc_mesh
from fem_exact import pressure
from fem_problems import loads, without_rigid_motion
from ledger import relative
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad0,
    ElementQuad1,
    ElementQuad2,
    ElementVector,
    FacetBasis,
    LinearForm,
    condense,
    solve,
)
from skfem.helpers import ddot, dot, grad, sym_grad, trace

from skmpm.material import LinearElastic
from skmpm.points import Points, box, disc, from_mesh
from skmpm.scene import Body, Scene, Support
from skmpm.scheme import Scheme
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

STATIC = Scheme(inertia=False, newton_tol=1e-10)


def solved(scene, scheme=STATIC):
    """The state after one quasi-static step of 1 s."""
    return step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme)


# A laminate of a width of 1 m and a height of 2 m on smooth supports: layers on each other or side by side.
WIDTH, HEIGHT, STROKE = 1.0, 2.0, 1e-4


def laminate(axis, materials, *, cell=1 / 8, shift=0.0, scheme=STATIC):
    """A laminate held below and at its sides, pulled by `STROKE` at its top; its two layers follow along `axis`."""
    points = box((shift, shift), (WIDTH, HEIGHT), spacing=cell / 2)
    middle = shift + (WIDTH, HEIGHT)[axis] / 2
    points = points.with_groups(lambda x: np.where(x[axis] < middle, "first", "second"))
    sides = [(0, 0.0, (0.0, None)), (0, WIDTH, (0.0, None)), (1, 0.0, (None, 0.0)), (1, HEIGHT, (None, STROKE))]
    supports = [
        Support(lambda x, i=i, at=at: np.abs(x[i] - at - shift) < 1e-9, velocity=prescribed)
        for i, at, prescribed in sides
    ]
    body = Body(points, dict(zip(("first", "second"), materials, strict=True)))
    return Scene([body], cell=cell, supports=supports)


def pull(scene, scheme=STATIC):
    """The force that `STROKE` takes [N/m], and the state."""
    state = solved(scene, scheme)
    return -float(state.support_force[-1, 1]), state


# A disc of radius 1 with a core under a pressure p all around it (Lame; Timoshenko & Goodier, paragraph 28).


@dataclass(frozen=True)
class RoundCore:
    """u = C r in the core of radius a, u = A r + B / r around it."""

    core: LinearElastic
    shell: LinearElastic
    a: float = 0.5
    p: float = 1e3

    @property
    def constants(self):
        """A, B, C from the pressure at r = 1, and the displacement and radial stress at r = a."""
        (l1, m1), (l2, m2) = self.core.lame, self.shell.lame
        matrix = [
            [2 * (l2 + m2), -2 * m2, 0.0],
            [self.a, 1 / self.a, -self.a],
            [2 * (l2 + m2), -2 * m2 / self.a**2, -2 * (l1 + m1)],
        ]
        return np.linalg.solve(matrix, [-self.p, 0.0, 0.0])

    def displacement(self, r):
        """Radial displacement at r (n,) [m]."""
        A, B, C = self.constants
        return np.where(r < self.a, C * r, A * r + B / np.maximum(r, self.a))

    def scene(self, h, offset=(0.0, 0.0), spacing=0.5):
        """The disc on cells h, moved by `offset` cells."""
        shift = h * np.asarray(offset)
        cloud = disc(tuple(shift), 1.0, spacing=spacing * h)
        cloud = cloud.with_groups(lambda x: np.where(np.hypot(*(x - shift[:, None])) < self.a, "core", "shell"))
        still = Points(cloud.x - shift[:, None], cloud.volume, cloud.outline)
        push = loads(still, lambda x, normal: -self.p * x / np.hypot(*x))
        return Scene([Body(cloud, {"core": self.core, "shell": self.shell})], cell=h, loads=push), still.x

    def error(self, h, offset=(0.0, 0.0), **options):
        """Relative L2 error of the displacement."""
        scene, x = self.scene(h, offset, **options)
        state, volume = solved(scene), scene.initial_volumes
        u = without_rigid_motion(x, state.x - scene.initial_positions, volume)
        r = np.hypot(*x)
        return relative(u, self.displacement(r) * x / np.maximum(r, 1e-12), volume)


# A disc of radius 1 with a square core, |x|, |y| < 1/2, under two opposite pressures: by scikit-fem, and of its mesh.


@dataclass(frozen=True)
class SquareCore:
    """The materials of core and shell."""

    core: LinearElastic
    shell: LinearElastic

    def mesh(self, h):
        """A mesh with the core as a subdomain."""
        return disc_mesh(h).with_subdomains({"core": lambda x: np.abs(x).max(axis=0) < 0.5})

    def points(self, h):
        """The points of that mesh, with its groups as gmsh keeps them."""
        mesh = self.mesh(h)
        tag = np.full(mesh.t.shape[1], 2)
        tag[mesh.subdomains["core"]] = 1
        cells = [("quad", mesh.t.T)]
        names = {"core": np.array([1, 2]), "shell": np.array([2, 2])}
        return from_mesh(meshio.Mesh(mesh.p.T, cells, cell_data={"gmsh:physical": [tag]}, field_data=names))

    def finite_elements(self, h, element=None):
        """The solution by scikit-fem, by default Q1."""
        mesh = self.mesh(h)
        basis = Basis(mesh, ElementVector(element or ElementQuad1()))
        flat = basis.with_element(ElementQuad0())
        each = [flat.zeros(), flat.zeros()]
        for values, (soft, stiff) in zip(each, zip(self.shell.lame, self.core.lame, strict=True), strict=True):
            values[:] = soft
            values[flat.get_dofs(elements="core")] = stiff

        @BilinearForm
        def stiffness(u, v, w):
            return w.lam * trace(grad(u)) * trace(grad(v)) + 2.0 * w.mu * ddot(sym_grad(u), sym_grad(v))

        lam, mu = (flat.interpolate(values) for values in each)
        boundary = FacetBasis(mesh, basis.elem, intorder=8)
        traction = LinearForm(lambda v, w: dot(-pressure(w.x) * w.x / np.hypot(*w.x), v))
        far = basis.nodal_dofs[:, [mesh.p[0].argmin(), mesh.p[0].argmax()]]
        fixed = np.unique(np.concatenate([far[0, :1], far[1]]))
        system = stiffness.assemble(basis, lam=lam, mu=mu), traction.assemble(boundary)
        return Solution(basis, solve(*condense(*system, D=fixed)))

    @cache  # noqa: B019
    def reference(self):
        """Q2 elements, of the displacement at positions x (2, n)."""
        fine = self.finite_elements(1 / 24, ElementQuad2())
        return lambda x: by_neighbours(lambda part: fine.basis.probes(part).dot(fine.nodal).reshape(2, -1), x)

    def error(self, x, u, weight):
        """Relative L2 error of a displacement (2, n), away from the boundary, where meshes end at chords."""
        inside = np.hypot(*x) < 0.98
        x, u, weight = x[:, inside], u[:, inside], weight[inside]
        known = without_rigid_motion(x, self.reference()(x), weight)
        return relative(without_rigid_motion(x, u, weight), known, weight)

    def error_of_finite_elements(self, h):
        """That of Q1 elements."""
        found = self.finite_elements(h)
        x, u = (
            np.asarray(f).reshape(2, -1)
            for f in (found.basis.global_coordinates(), found.basis.interpolate(found.nodal))
        )
        return self.error(x, u, found.basis.dx.ravel())

    def error_of_points(self, h, offset=(0.0, 0.0), spacing=0.25):
        """That of this method, with points of a mesh of 2 spacing h."""
        cloud = self.points(2 * spacing * h)
        shift = h * np.asarray(offset)[:, None]
        moved = Points(cloud.x + shift, cloud.volume, cloud.outline, cloud.group)
        push = loads(cloud, lambda x, normal: -pressure(x) * x / np.hypot(*x))
        scene = Scene([Body(moved, {"core": self.core, "shell": self.shell})], cell=h, loads=push)
        state = solved(scene)
        return self.error(cloud.x, state.x - moved.x, cloud.volume)
