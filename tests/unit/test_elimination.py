"""Unknowns fixed by supports: against dense linear algebra, and against the null space of the rows."""

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from skmpm import linear
from skmpm.assembly import prepare
from skmpm.elimination import eliminate
from skmpm.grid import lay
from skmpm.material import LinearElastic
from skmpm.points import box, disc
from skmpm.scene import Body, Load, Scene, Support
from skmpm.scheme import Scheme
from skmpm.simulate import initial, step

SOLID = LinearElastic(1e3, 0.3, 1.0)


def solid(offset=(0.0, 0.0)):
    """A bar of 2 x 8 cells, (sheets, A): stiffness and a mass of one part in a million."""
    p = box(offset, (2, 8), spacing=0.5)
    sheets = lay(p.x, np.zeros(p.n, int), 1.0, 1)
    assembly = prepare(sheets, p.volume, np.ones(p.n), np.array([1.0]))
    F = np.repeat(np.eye(2)[:, :, None], p.n, axis=2)
    inertia = 1e-3 * assembly.mass.reshape(-1, 2, 1) * np.eye(2)
    return p, sheets, assembly.matrix(assembly.stiffness(SOLID.tangent(F)), 1.0, inertia)


def rows(sheets, points, axes=(0, 1)):
    """Rows of both components of the points, each told its own number."""
    G = sp.csr_array(sp.vstack([sp.kron(sheets.interpolation[points], np.eye(2)[a : a + 1]) for a in axes]))
    told = np.repeat(np.arange(len(axes)), len(points))
    return G, sp.csr_array((np.ones(told.size), (np.arange(told.size), told)))


def eliminated(sheets, G, B):
    return eliminate(G, B, sheets.blocks, sheets.rigid_motions())


@given(seed=st.integers(0, 999), ends=st.booleans(), x=st.floats(0, 0.99), y=st.floats(0, 0.99))
def test_every_admissible_velocity_obeys_the_rows_and_no_other_is_lost(seed, ends, x, y):
    p, sheets, _ = solid((x, y))
    low, high = (np.flatnonzero(p.x[1] == edge) for edge in (p.x[1].min(), p.x[1].max()))
    chosen = np.concatenate([low, high]) if ends else low
    G, B = rows(sheets, chosen)
    found = eliminated(sheets, G, B)
    rng = np.random.default_rng(seed)
    told = rng.standard_normal(2)
    v = found.admissible(rng.standard_normal(G.shape[1]), told)
    significant = la.null_space(G.toarray(), rcond=0.05).shape[1]
    free = found.T.diagonal().sum()
    exact = la.null_space(G.toarray(), rcond=1e-14).shape[1]
    assert exact <= free <= significant + 4
    # Rows next to a grid line are left out on purpose: what they miss is their own small share.
    assert np.abs(G @ v - B @ told).max() <= (1e-12 if free == exact else 0.5)


def test_a_velocity_that_obeys_is_kept():
    p, sheets, _ = solid((0.3, 0.4))
    G, B = rows(sheets, np.flatnonzero(p.x[1] == p.x[1].min()))
    found = eliminated(sheets, G, B)
    v = np.tile([0.7, -0.2], sheets.nodes)
    assert np.allclose(found.admissible(v, np.array([0.7, -0.2])), v, rtol=0, atol=1e-13)


@pytest.mark.parametrize("solver", [linear.banded, linear.amg, linear.direct])
def test_the_solution_is_that_of_the_saddle_point_problem(solver):
    p, sheets, A = solid((0.25, 0.4))
    G, B = rows(sheets, np.flatnonzero(p.x[1] == p.x[1].min()), axes=(1,))
    found = eliminated(sheets, G, B)
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    v = found.factorised(solver, A, sheets.blocks, sheets.rigid_motions())(b)
    independent = la.orth(G.toarray().T).T
    k = independent.shape[0]
    whole = np.block([[A.toarray(), independent.T], [independent, np.zeros((k, k))]])
    expected = np.linalg.solve(whole, np.concatenate([b, np.zeros(k)]))[: b.size]
    assert np.abs(v - expected).max() <= 1e-7 * np.abs(expected).max()


def test_compliance_sees_the_supports():
    p, sheets, A = solid()
    G, B = rows(sheets, np.flatnonzero(p.x[1] == 0.0))
    solve = eliminated(sheets, G, B).factorised(linear.banded, A, sheets.blocks, sheets.rigid_motions())
    H, _ = rows(sheets, [0, 5, p.n - 1])
    assert np.allclose(solve.compliance(H).toarray(), H @ solve(H.T.toarray()), rtol=1e-10, atol=1e-14)
    assert abs(H[0] @ solve(H.T.toarray())[:, 0]) < 1e-14  # point 0 is held


@pytest.mark.parametrize(
    ("axes", "chosen", "holds"), [((0, 1), "edge", True), ((1,), "edge", False), ((0, 1), "point", False)]
)
def test_a_body_floats_unless_no_rigid_motion_is_left(axes, chosen, holds):
    p, sheets, _ = solid((0.1, 0.2))
    edge = np.flatnonzero(p.x[1] == p.x[1].min())
    G, B = rows(sheets, edge if chosen == "edge" else edge[:1], axes)
    assert eliminated(sheets, G, B).holds.tolist() == [holds]


@pytest.mark.parametrize("edge", [0, 1], ids=["left", "bottom"])
def test_a_supported_edge_does_not_widen_the_band(edge):
    """A disc, R/h = 12, held along an edge that rows of nodes cross or follow: the band stays within 1.3 of its own.

    Eliminated in the nodes' own order the left edge makes it five times as wide. Solutions are those of the oracle.
    """
    widths = []

    def seeing(A, blocks, motions):
        widths.append(linear.half_bandwidth(A))
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
