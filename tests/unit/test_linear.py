"""Linear solvers: equal solutions from all of them, for systems assembled from several bodies."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag

from skmpm import linear
from skmpm.grid import build_grids
from skmpm.grid.assembly import prepare
from skmpm.linear import band
from skmpm.linear.band import column_lengths, half_bandwidth
from skmpm.material import NeoHookean

SOLVERS = {"banded": linear.banded, "amg": linear.amg, "direct": linear.direct}
CELL = 0.1
STEPS = [1e-6, 1e-3, 1.0]  # [s]: a wave (112 m/s) crosses 1e-3, 1 and 1000 cells in a step


@cache
def system(dt, radius=3.3, points=220):
    """A = M + dt^2 K of discs of random deformed points; cells of every filling, body 1 without any point."""
    rng = np.random.default_rng(0)
    body = np.repeat([0, 2, 3], points)
    distance, angle = np.sqrt(rng.uniform(size=body.size)), rng.uniform(0, 2 * np.pi, body.size)
    x = CELL * (radius * distance * np.stack([np.cos(angle), np.sin(angle)]) + 0.7 * body)
    solid = NeoHookean(1e7, 0.3, 1000.0)
    volume = np.full(body.size, np.pi * (radius * CELL) ** 2 / points)
    grid = build_grids(x, body, CELL, 4)
    fast = prepare(grid, volume, 1000.0 * volume, np.full(grid.cells, 0.005 * 1e7))
    F = np.eye(2)[:, :, None] + rng.uniform(-0.2, 0.2, size=(2, 2, body.size))
    values, vectors = np.linalg.eigh(np.moveaxis(solid.tangent(F).reshape(4, 4, -1), -1, 0))
    C = np.einsum("pij,pj,pkj->ikp", vectors, np.maximum(values, 0.0), vectors).reshape(2, 2, 2, 2, -1)
    A = fast.matrix(fast.stiffness(C), dt**2)
    return A, grid.blocks, grid.rigid_motions


@cache
def wide(dt):
    """The same with enough nodes, 1560, for several multigrid levels."""
    return system(dt, 12.0, 1500)


@cache
def rounding(dt):
    """The relative error that rounding of A alone makes in A^-1: eps times its condition number."""
    return np.finfo(float).eps * np.linalg.cond(system(dt)[0].toarray())


def random_rows(seed, blocks, contacts):
    """Rows as places on bodies make them: four nodes of one body each."""
    rng = np.random.default_rng(seed)
    filled = np.flatnonzero(np.diff(blocks))
    H = np.zeros((contacts, blocks[-1]))
    for row in H:
        b = rng.choice(filled)
        row[rng.integers(blocks[b], blocks[b + 1], size=8)] = rng.normal(size=8)
    return H


def indefinite():
    """Two bodies of two nodes, the second with a negative stiffness."""
    A = sp.bsr_array(np.diag([1.0, 1.0, 1.0, 1.0, 2.0, 2.0, -1.0, 2.0]), blocksize=(2, 2))
    return A, np.array([0, 4, 8]), np.ones((8, 3))


# Solutions.


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("name", ["banded", "direct"])
def test_factorisations_are_exact_to_rounding(name, dt):
    A, blocks, motions = system(dt)
    solve = SOLVERS[name](A, blocks, motions)
    B = np.random.default_rng(1).normal(size=(A.shape[0], 3))
    exact = np.linalg.solve(A.toarray(), B)
    assert solve.name == name
    assert np.linalg.norm(solve(B) - exact) <= rounding(dt) * np.linalg.norm(exact)
    assert np.linalg.norm(A @ solve(B) - B) <= 1e-14 * np.linalg.norm(A.toarray()) * np.linalg.norm(exact)
    assert np.linalg.norm(solve(B[:, 1]) - exact[:, 1]) <= rounding(dt) * np.linalg.norm(exact[:, 1])


@pytest.mark.parametrize("dt", STEPS)
def test_amg_and_the_band_agree_with_the_oracle_on_wider_bodies(dt):
    A, blocks, motions = wide(dt)
    b = np.random.default_rng(1).normal(size=A.shape[0])
    exact = linear.direct(A, blocks, motions)(b)
    size = np.linalg.norm(exact)
    assert np.linalg.norm(linear.banded(A, blocks, motions)(b) - exact) <= (1e-9 if dt == 1.0 else 1e-12) * size
    solve = linear.amg(A, blocks, motions)
    x = solve(b)
    assert solve.name == "amg"
    assert np.linalg.norm(A @ x - b) <= 1.5e-10 * np.linalg.norm(b)
    assert np.linalg.norm(x - exact) <= 1e-7 * size


@pytest.mark.parametrize("name", SOLVERS)
def test_no_right_hand_side_and_a_zero_one_are_solved(name):
    A, blocks, motions = system(1e-3)
    solve = SOLVERS[name](A, blocks, motions)
    assert not solve(np.zeros(A.shape[0])).any()
    assert solve(np.zeros((A.shape[0], 0))).shape == (A.shape[0], 0)


@pytest.mark.parametrize("name", SOLVERS)
def test_solving_and_factorising_leave_the_matrix_and_the_right_hand_side_alone(name):
    A, blocks, motions = system(1e-3)
    b = np.random.default_rng(2).normal(size=A.shape[0])
    before = A.data.copy(), b.copy(), motions.copy()
    solve = SOLVERS[name](A, blocks, motions)
    first = solve(b)
    assert np.array_equal(A.data, before[0]) and np.array_equal(b, before[1]) and np.array_equal(motions, before[2])
    assert np.array_equal(solve(b), first)


# Compliance.


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("name", SOLVERS)
def test_compliance_is_the_dense_triple_product(name, dt):
    A, blocks, motions = system(dt)
    H = random_rows(3, blocks, 25)
    W = SOLVERS[name](A, blocks, motions).delassus(sp.csr_array(H)).toarray()
    expected = H @ np.linalg.solve(A.toarray(), H.T)
    tol = rounding(dt) + (1e-9 if name == "amg" else 0.0)
    assert np.abs(W - expected).max() <= tol * np.abs(expected).max()


def test_compliance_by_amg_on_several_levels_equals_that_of_the_band():
    A, blocks, motions = wide(1e-2)
    H = sp.csr_array(random_rows(3, blocks, 6))
    band, amg = (SOLVERS[name](A, blocks, motions).delassus(H).toarray() for name in ("banded", "amg"))
    assert np.abs(amg - band).max() <= 1e-8 * np.abs(band).max()


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(0, 12))
def test_compliance_of_any_rows_is_the_same_from_bodies_and_from_columns(seed, contacts):
    A, blocks, motions = system(1e-3)
    H = random_rows(seed, blocks, contacts)
    banded = linear.banded(A, blocks, motions).delassus(sp.csr_array(H))
    direct = linear.direct(A, blocks, motions).delassus(sp.csr_array(H))
    assert banded.shape == direct.shape == (contacts, contacts)
    size = np.abs(direct.data).max(initial=0.0)
    np.testing.assert_allclose(banded.toarray(), direct.toarray(), rtol=0, atol=1e-11 * size)


@pytest.mark.parametrize("name", SOLVERS)
def test_compliance_refuses_rows_of_two_bodies(name):
    A, blocks, motions = system(1e-3)
    H = np.zeros((2, A.shape[0]))
    H[1, [blocks[0], blocks[2]]] = 1.0
    with pytest.raises(ValueError, match="touches two bodies"):
        SOLVERS[name](A, blocks, motions).delassus(sp.csr_array(H))


@pytest.mark.parametrize("name", SOLVERS)
def test_compliance_couples_only_places_that_share_a_body_and_empty_rows_stay_empty(name):
    A, blocks, motions = system(1e-3)
    H = np.zeros((4, A.shape[0]))
    H[0, blocks[0]] = H[2, blocks[0] + 5] = 1.0  # body 0
    H[1, blocks[2] + 3] = 1.0  # body 2; row 3 touches nothing
    W = SOLVERS[name](A, blocks, motions).delassus(sp.csr_array(H))
    assert set(zip(*(index.tolist() for index in W.nonzero()), strict=True)) == {
        (0, 0),
        (0, 2),
        (2, 0),
        (2, 2),
        (1, 1),
    }


# Banded.


def test_the_bandwidth_is_the_largest_distance_of_an_entry_from_the_diagonal():
    A, blocks, _ = system(1e-3)
    entries = A.toarray()
    rows, columns = np.nonzero(entries)
    farthest = np.abs(rows - columns).max()
    assert farthest <= half_bandwidth(column_lengths(A, blocks)) <= farthest + 1


def test_a_singular_matrix_is_an_error_of_linear_algebra_that_steps_catch():
    A, blocks, motions = system(1e-3)
    singular = sp.bsr_array((0.0 * A.data, A.indices, A.indptr), shape=A.shape)
    with pytest.raises(np.linalg.LinAlgError, match=r"linear.direct: .*singular"):
        linear.direct(singular, blocks, motions)


def test_banded_refuses_an_indefinite_matrix():
    with pytest.raises(np.linalg.LinAlgError):
        linear.banded(*indefinite())


def test_banded_goes_on_with_the_bodies_that_were_not_definite():
    """Body 0 is factorised once, body 1 again: the solver is that of the second matrix in both."""
    A, blocks, motions = indefinite()
    with pytest.raises(linear.NotPositiveDefinite, match=r"bodies \[1\] are not positive definite") as found:
        linear.banded(A, blocks, motions)
    assert found.value.bodies.tolist() == [1]
    better = sp.bsr_array(A + sp.diags_array(np.repeat([0.0, 3.0], 4)), blocksize=(2, 2))
    b = np.arange(1.0, 9.0)
    assert found.value.resume(better)(b) == pytest.approx(b / better.diagonal(), rel=1e-15)


def test_banded_solves_nothing_where_the_right_hand_side_is_zero():
    """The factors of the other bodies are not even read."""
    A, blocks, motions = system(1e-3)
    solve, b = linear.banded(A, blocks, motions), np.zeros(A.shape[0])
    b[blocks[2]] = 1.0
    (known,) = solve.bands
    bands = np.full_like(known, 1e300)
    own = slice(solve.offsets[2], solve.offsets[3])
    bands[own] = known[own]
    x = solve(b)
    assert np.array_equal(replace(solve, bands=(bands,))(b), x) and np.count_nonzero(x) == blocks[3] - blocks[2]


def test_bands_in_parts_are_those_in_one_array(monkeypatch):
    """A body or two in each: the same bits of solutions and of the Delassus operator."""
    A, blocks, motions = system(1e-3)
    whole, b = linear.banded(A, blocks, motions), np.arange(1.0, A.shape[0] + 1.0)
    H = sp.csr_array(np.eye(A.shape[0])[::3])
    for size in (1, int(whole.offsets[1]) + 1):
        monkeypatch.setattr(band, "PART", size)
        parts = linear.banded(A, blocks, motions)
        assert 1 < len(parts.bands) <= blocks.size - 1
        assert np.array_equal(parts(b), whole(b))
        assert np.array_equal(parts.delassus(H).toarray(), whole.delassus(H).toarray())


def test_banded_solves_bodies_that_are_smaller_than_the_band():
    rng = np.random.default_rng(0)
    sizes = [2, 12, 4]
    parts = [(lambda B: B @ B.T + np.eye(n))(rng.normal(size=(n, n))) for n in sizes]
    A = block_diag(*parts)
    solve = linear.banded(sp.bsr_array(A, blocksize=(2, 2)), np.cumsum([0, *sizes]), np.ones((18, 3)))
    np.testing.assert_allclose(solve(np.eye(18)), np.linalg.inv(A), rtol=1e-10, atol=1e-12)
    H = np.repeat(rng.normal(size=(5, 18)), 3, axis=0) * np.tile(np.repeat(np.eye(3), sizes, axis=1), (5, 1))
    np.testing.assert_allclose(solve.delassus(sp.csr_array(H)).toarray(), H @ np.linalg.inv(A) @ H.T, rtol=1e-10)


# Amg.


def test_amg_is_reproducible_and_leaves_the_global_random_state_alone():
    answers = []
    for seed in (1, 2):
        np.random.seed(seed)  # noqa: NPY002
        expected = np.random.get_state()  # noqa: NPY002
        A, blocks, motions = wide(1.0)
        answers.append(linear.amg(A, blocks, motions)(np.ones(A.shape[0])))
        state = np.random.get_state()  # noqa: NPY002
        assert all(np.array_equal(a, b) for a, b in zip(state, expected, strict=True))
    assert np.array_equal(*answers)


@pytest.mark.parametrize("tol", [1e-4, 1e-8])
def test_amg_stops_at_its_tolerance(tol):
    A, blocks, motions = wide(1.0)
    b = np.random.default_rng(5).normal(size=A.shape[0])
    solve = linear.amg(A, blocks, motions, tol=tol)
    residual = np.linalg.norm(A @ solve(b) - b) / np.linalg.norm(b)
    assert 1e-3 * tol < residual <= 1.01 * tol


def test_amg_needs_few_iterations_at_any_time_step():
    for dt in STEPS:
        A, blocks, motions = wide(dt)
        iterations = []
        solve = linear.amg(A, blocks, motions, callback=iterations.append)
        solve(np.random.default_rng(6).normal(size=A.shape[0]))
        assert len(iterations) == 1 and 0 < iterations[0] < 60


def test_amg_uses_the_rotation_as_a_motion_without_energy():
    """Measured: 40 iterations, and 46 with the translations alone."""
    A, blocks, motions = wide(1.0)
    iterations = []
    for prescribed in (motions, motions[:, :2]):
        linear.amg(A, blocks, prescribed, callback=iterations.append)(motions[:, 2])
    assert iterations[0] < 0.95 * iterations[1]


def test_amg_that_does_not_converge_names_a_remedy():
    n = 2000  # conjugate gradients alone need n / 2 iterations on a chain
    A = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n), format="csr")
    nothing = spla.LinearOperator((n, n), matvec=lambda r: r, dtype=float)
    solve = linear.Amg(A, nothing, np.array([0, n]), 1e-10)
    with pytest.raises(np.linalg.LinAlgError, match=r"in 500 iterations; use linear[.]banded"):
        solve(np.ones(n))


# The choice.


def bands(nodes, distance, wide):
    """A block matrix whose first `wide` columns have an entry at this distance, in nodes, from the diagonal."""
    each, first = np.arange(nodes), np.arange(wide)
    rows, columns = np.append(each, first + distance), np.append(each, first)
    A = sp.coo_array((np.ones(rows.size), (rows, columns)), shape=(nodes, nodes))
    return sp.bsr_array(sp.kron(A.tocsr(), np.eye(2), format="bsr"))


@pytest.mark.parametrize(
    ("nodes", "distance", "wide", "chosen"),
    [
        (100, 99, 1, "banded"),
        (50_000, 300, 49_700, "banded"),
        (50_000, 400, 49_600, "amg"),
        (50_000, 400, 30_000, "banded"),  # some columns are longer than 700
        (50_000, 2100, 1, "amg"),  # wider than a band may be
    ],
)
def test_default_takes_what_costs_less(monkeypatch, nodes, distance, wide, chosen):
    for name in ("banded", "amg"):
        monkeypatch.setattr(linear.choice, name, lambda A, blocks, motions, name=name: name)
    A = bands(nodes, distance, wide)
    assert linear.default(A, np.array([0, 2 * nodes]), np.ones((2 * nodes, 3))) == chosen


def test_columns_of_the_factor_reach_as_far_as_those_before_them():
    """Of three bodies, from a dense pattern."""
    A, blocks, _ = system(1.0)
    lengths = []
    for first, last in pairwise((blocks // 2).tolist()):
        ones = np.ones((A.indices.size, 1, 1))
        pattern = sp.bsr_array((ones, A.indices, A.indptr)).toarray()[first:last, first:last]
        reach = np.array([np.flatnonzero(pattern[:, : k + 1].any(axis=1))[-1] + 1 for k in range(last - first)])
        lengths.extend(2 * (reach - np.arange(last - first)))
    assert column_lengths(A, blocks).tolist() == lengths


def test_default_solves_packings_with_the_band():
    A, blocks, motions = system(1e-3)
    solve = linear.default(A, blocks, motions)
    assert solve.name == "banded"
    np.testing.assert_allclose(A @ solve(np.ones(A.shape[0])), 1.0, rtol=1e-10)
