"""The four problems of quasi-static elasticity, solved by skmpm and by Q1 finite elements."""

from collections.abc import Callable
from dataclasses import dataclass

import fem_exact as exact
import meshio
import numpy as np
from fem import MATERIAL, Field, disc_mesh, hole_mesh, mapped, solve_fem, strip_mesh
from ledger import relative

from skmpm import linear, points
from skmpm.scene import Body, Load, Scene, Support
from skmpm.scheme import Scheme
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

SIDE = 2.0  # of the quarter of the plate [m]
SPACING = 1 / 4  # of the points, in cells: what the goals take, see `test_fem_elasticity.rows`


@dataclass(frozen=True)
class Problem:
    """A body, its loads and supports, what is known of its solution, and how it is discretised."""

    name: str
    known: Callable  # x (2, n) -> u (2, n), stress (2, 2, n)
    traction: Callable  # x, normal -> (2, ...) [Pa]
    mesh: Callable  # h -> MeshQuad that fits the body, with cells of mean area h^2
    cloud: Callable  # spacing -> Points
    sizes: tuple  # h [m]
    held: tuple = ()  # (axis, velocity) of the sides x[axis] = 0


def by_mesh(mesh):
    """The points of a mesh of scikit-fem, by `from_mesh`: 2 x 2 to a cell inside."""
    return points.from_mesh(meshio.Mesh(mesh.p.T, [("quad", mesh.t.T)]))


def of_stress(known, loaded):
    """The traction of a known stress on the part of the boundary where `loaded(x)`."""

    def traction(x, normal):
        stress = known(x.reshape(2, -1))[1].reshape(2, 2, *x.shape[1:])
        return np.einsum("ij...,j...->i...", stress, normal) * loaded(x)

    return traction


def at_ends(x):
    """On the ends of the cantilever."""
    return (x[0] < 1e-9) | (x[0] > exact.LENGTH - 1e-9)


CANTILEVER = Problem(
    "cantilever",
    exact.cantilever,
    of_stress(exact.cantilever, at_ends),
    lambda h: strip_mesh(exact.LENGTH, exact.DEPTH, h),
    lambda s: points.box((0.0, -exact.DEPTH / 2), (exact.LENGTH, exact.DEPTH), spacing=s),
    (1 / 4, 1 / 8, 1 / 16),
)
PLATE = Problem(
    "plate with a hole",
    exact.hole,
    of_stress(exact.hole, lambda x: x.max(axis=0) > SIDE - 1e-9),
    lambda h: hole_mesh(SIDE, h),
    lambda s: by_mesh(hole_mesh(SIDE, 2 * s)),
    (1 / 4, 1 / 8, 1 / 16),
    ((0, (0.0, None)), (1, (None, 0.0))),
)
DISC = Problem(
    "disc under diametral load",
    exact.disc,
    lambda x, normal: -exact.pressure(x) * x / np.hypot(*x),
    disc_mesh,
    lambda s: by_mesh(disc_mesh(2 * s)),
    (1 / 4, 1 / 8, 1 / 16),
)
COOK = Problem(
    "Cook's membrane",
    exact.cook,
    exact.cook_traction,
    lambda h: mapped(round(4.8 / h), round(3.0 / h), exact.cook_map),
    lambda s: by_mesh(mapped(round(2.4 / s), round(1.5 / s), exact.cook_map)),
    (0.4, 0.2, 0.1),
    ((0, (0.0, 0.0)),),
)
PROBLEMS = (CANTILEVER, PLATE, DISC, COOK)


def loads(cloud, traction):
    """One load for each boundary point under a traction: its integral over both edges times the point's hat."""
    at, weight = np.polynomial.legendre.leggauss(6)
    force = np.zeros_like(cloud.x)
    for loop in cloud.outline:
        following = np.roll(loop, -1)
        edge = cloud.x[:, following] - cloud.x[:, loop]
        normal = np.array([edge[1], -edge[0]]) / np.hypot(*edge)
        for s, w in zip((at + 1) / 2, weight / 2, strict=True):
            push = w * traction(cloud.x[:, loop] + s * edge, normal) * np.hypot(*edge)
            force[:, loop] += (1 - s) * push
            force[:, following] += s * push
    pushed = np.flatnonzero(np.abs(force).max(axis=0))
    return [Load(lambda x, k=k: np.arange(x.shape[1]) == k, tuple(force[:, k])) for k in pushed.tolist()]


def material_points(problem, h, *, offset=(0.0, 0.0), spacing=SPACING, solver=linear.banded, **options):
    """Solve by skmpm on cells h, the body moved by `offset` cells: its field, and the state after the one step."""
    cloud = problem.cloud(h * spacing)
    shift = h * np.asarray(offset)[:, None]
    moved = points.Points(cloud.x + shift, cloud.volume, cloud.outline)
    supports = [
        Support(lambda x, axis=axis: np.abs(x[axis] - shift[axis]) < 1e-9, velocity=prescribed)
        for axis, prescribed in problem.held
    ]
    scene = Scene([Body(moved, MATERIAL)], cell=h, supports=supports, loads=loads(cloud, problem.traction))
    scheme = Scheme(inertia=False, linear=solver, **options)
    state = step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme)
    return Field(cloud.x, state.x - moved.x, state.stress, cloud.volume), state


def finite_elements(problem, h, element=None):
    """Solve by scikit-fem on the mesh that fits the body, by default Q1: the field at its quadrature points."""
    return solve_fem(problem.mesh(h), problem.traction, problem.held, element).field()


def errors(problem, field):
    """Relative L2 errors (2,) of displacement and stress; rigid motions count only where supports fix them."""
    u, stress = problem.known(field.x)
    own = field.u
    if not problem.held:
        u, own = (without_rigid_motion(field.x, v, field.weight) for v in (u, own))
    return np.array([relative(own, u, field.weight), relative(field.stress, stress, field.weight)])


def without_rigid_motion(x, u, weight):
    """The displacement (2, n) less the rigid motion closest to it."""
    one, zero = np.ones_like(x[0]), np.zeros_like(x[0])
    motions = np.array([[one, zero], [zero, one], [-x[1], x[0]]])
    gram = np.einsum("ain,bin,n->ab", motions, motions, weight)
    share = np.linalg.solve(gram, np.einsum("ain,in,n->a", motions, u, weight))
    return u - np.einsum("a,ain->in", share, motions)
