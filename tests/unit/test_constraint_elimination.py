"""Constraint elimination against dense linear algebra and the null space of the constraints."""

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from skmpm import linear
from skmpm.grid import build_grids
from skmpm.grid.assembly import prepare
from skmpm.grid.supports import eliminate
from skmpm.linear.band import column_lengths, half_bandwidth
from skmpm.material import LinearElastic
from skmpm.points import box, disc
from skmpm.scene import Body, Load, Scene, Support
from skmpm.scheme import Scheme
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

SOLID = LinearElastic(1e3, 0.3, 1.0)


def solid(offset=(0.0, 0.0)):
    """A bar of 2 x 8 cells, (body grids, A): stiffness and a mass of one part in a million."""
    p = box(offset, (2, 8), spacing=0.5)
    grid = build_grids(p.x, np.zeros(p.size, int), 1.0, 1)
    assembly = prepare(grid, p.volume, np.ones(p.size), np.ones(grid.cells))
    F = np.repeat(np.eye(2)[:, :, None], p.size, axis=2)
    inertia = 1e-3 * assembly.mass.reshape(-1, 2, 1) * np.eye(2)
    return p, grid, assembly.matrix(assembly.stiffness(SOLID.tangent(F)), 1.0, inertia)


def rows(grid, points, axes=(0, 1)):
    """Rows of both components of the points, each with its own prescribed value."""
    G = sp.csr_array(sp.vstack([sp.kron(grid.interpolation[points], np.eye(2)[a : a + 1]) for a in axes]))
    prescribed = np.repeat(np.arange(len(axes)), len(points))
    return G, sp.csr_array((np.ones(prescribed.size), (np.arange(prescribed.size), prescribed)))


def eliminated(grid, G, B):
    return eliminate(G, B, sp.csr_array(G.shape[::-1][:1] + B.shape[1:]), grid.blocks, grid.rigid_motions)


@given(seed=st.integers(0, 999), ends=st.booleans(), x=st.floats(0, 0.99), y=st.floats(0, 0.99))
def test_every_admissible_velocity_obeys_the_rows_and_no_other_is_lost(seed, ends, x, y):
    p, grid, _ = solid((x, y))
    low, high = (np.flatnonzero(p.x[1] == edge) for edge in (p.x[1].min(), p.x[1].max()))
    chosen = np.concatenate([low, high]) if ends else low
    G, B = rows(grid, chosen)
    found = eliminated(grid, G, B)
    rng = np.random.default_rng(seed)
    prescribed = rng.standard_normal(2)
    v = found.admissible(rng.standard_normal(G.shape[1]), prescribed)
    significant = la.null_space(G.toarray(), rcond=0.05).shape[1]
    free = found.T.diagonal().sum()
    exact = la.null_space(G.toarray(), rcond=1e-14).shape[1]
    assert exact <= free <= significant + 4
    # Rows next to a grid line are left out on purpose: what they miss is their own small share.
    assert np.abs(G @ v - B @ prescribed).max() <= (1e-12 if free == exact else 0.5)


def test_a_velocity_that_obeys_is_kept():
    p, grid, _ = solid((0.3, 0.4))
    G, B = rows(grid, np.flatnonzero(p.x[1] == p.x[1].min()))
    found = eliminated(grid, G, B)
    v = np.tile([0.7, -0.2], grid.nodes)
    assert np.allclose(found.admissible(v, np.array([0.7, -0.2])), v, rtol=0, atol=1e-13)


@pytest.mark.parametrize("solver", [linear.banded, linear.amg, linear.direct])
def test_the_solution_is_that_of_the_saddle_point_problem(solver):
    p, grid, A = solid((0.25, 0.4))
    G, B = rows(grid, np.flatnonzero(p.x[1] == p.x[1].min()), axes=(1,))
    found = eliminated(grid, G, B)
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    v = found.factorised(solver, A, grid.blocks, grid.rigid_motions)(b)
    independent = la.orth(G.toarray().T).T
    k = independent.shape[0]
    whole = np.block([[A.toarray(), independent.T], [independent, np.zeros((k, k))]])
    expected = np.linalg.solve(whole, np.concatenate([b, np.zeros(k)]))[: b.size]
    assert np.abs(v - expected).max() <= 1e-7 * np.abs(expected).max()


def test_compliance_sees_the_supports():
    p, grid, A = solid()
    G, B = rows(grid, np.flatnonzero(p.x[1] == 0.0))
    solve = eliminated(grid, G, B).factorised(linear.banded, A, grid.blocks, grid.rigid_motions)
    H, _ = rows(grid, [0, 5, p.size - 1])
    assert np.allclose(solve.delassus(H).toarray(), H @ solve(H.T.toarray()), rtol=1e-10, atol=1e-14)
    assert abs(H[0] @ solve(H.T.toarray())[:, 0]) < 1e-14  # point 0 is held


@pytest.mark.parametrize(
    ("axes", "chosen", "holds"), [((0, 1), "edge", True), ((1,), "edge", False), ((0, 1), "point", False)]
)
def test_a_body_floats_unless_no_rigid_motion_is_left(axes, chosen, holds):
    p, grid, _ = solid((0.1, 0.2))
    edge = np.flatnonzero(p.x[1] == p.x[1].min())
    G, B = rows(grid, edge if chosen == "edge" else edge[:1], axes)
    assert eliminated(grid, G, B).holds.tolist() == [holds]


@pytest.mark.parametrize("edge", [0, 1], ids=["left", "bottom"])
def test_a_supported_edge_does_not_widen_the_band(edge):
    """A disc, R/h = 12, held along an edge that rows of nodes cross or follow: the band stays within 1.3 of its own.

    Eliminated in the nodes' own order the left edge makes it five times as wide. Solutions are those of the oracle.
    """
    widths = []

    def seeing(A, blocks, motions):
        widths.append(half_bandwidth(column_lengths(A, blocks)))
        return linear.banded(A, blocks, motions)

    body = Body(disc((0.03, 0.04), 1.2, spacing=0.074), LinearElastic(1e6, 0.3, 1000.0))
    load = Load(lambda x: x[0] + x[1] > 1.5, (1e2, 3e2))
    moved = {}
    for supported in (False, True):
        held = [Support(lambda x: x[edge] < -0.9)] if supported else []
        scene = Scene([body], cell=0.1, supports=held, loads=[load])
        for name, solver in (("banded", seeing), ("direct", linear.direct)):
            state = step(scene, initial(scene), 1e-3, scheme=Scheme(linear=solver))
            moved[name] = state.x - scene.initial_positions
        assert np.abs(moved["banded"] - moved["direct"]).max() < 1e-10 * np.abs(moved["direct"]).max()
    assert widths[1] < 1.3 * widths[0]


def test_bodies_without_supports_keep_their_blocks():
    """Three bars at an angle to the grid, the middle one held at an end: solution, and matrix of the others."""
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    bars = [turn @ box((5.0 * i, 0.3), (2, 8), spacing=0.5).x for i in range(3)]
    x, body = np.concatenate(bars, axis=1), np.repeat(np.arange(3), bars[0].shape[1])
    grid = build_grids(x, body, 1.0, 3)
    assembly = prepare(grid, np.full(body.size, 0.25), np.ones(body.size), np.ones(grid.cells))
    F = np.repeat(np.eye(2)[:, :, None], body.size, axis=2)
    inertia = 1e-3 * assembly.mass.reshape(-1, 2, 1) * np.eye(2)
    A, given = assembly.matrix(assembly.stiffness(SOLID.tangent(F)), 1.0, inertia), []
    end = np.flatnonzero((body == 1) & ((turn.T @ x)[1] < 0.31))

    def recorded(matrix, *others):
        given.append(matrix)
        return linear.banded(matrix, *others)

    found = eliminated(grid, *rows(grid, end))
    solver = found.factorised(recorded, A, grid.blocks, grid.rigid_motions)
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    free = np.setdiff1d(np.arange(A.shape[0]), found.fixed)
    lift = found.T.toarray()[:, free]
    exact = lift @ np.linalg.solve(lift.T @ A.toarray() @ lift, lift.T @ b)
    np.testing.assert_allclose(solver(b), exact, rtol=1e-9, atol=1e-9)
    for first, last in (grid.blocks[:2], grid.blocks[2:]):
        np.testing.assert_array_equal(given[0].toarray()[first:last, first:last], A.toarray()[first:last, first:last])
