"""Iterative solvers of Newton steps of the contact problem, against dense algebra."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from skmpm import coulomb
from skmpm.coulomb import krylov, newton


def blocks_weakly_coupled(seed, blocks, size, coupling):
    """A matrix of unsymmetric blocks, its right-hand side, and the label of each row; rows in random order."""
    rng = np.random.default_rng(seed)
    n = blocks * size
    label, A = np.repeat(np.arange(blocks), size), coupling * rng.normal(size=(n, n)) / np.sqrt(n)
    for b in range(blocks):
        own = np.flatnonzero(label == b)
        A[np.ix_(own, own)] += rng.normal(size=(size, size)) + 4.0 * np.eye(size)
    order = rng.permutation(n)
    return sp.csr_array(A[np.ix_(order, order)]), rng.normal(size=n), label[order]


@given(st.integers(0, 100), st.integers(2, 12), st.integers(1, 6))
def test_weakly_coupled_blocks_are_solved(seed, blocks, size):
    A, b, label = blocks_weakly_coupled(seed, blocks, size, 0.05)
    x = krylov.by_blocks(A, b, 1e-8, label)
    exact = np.linalg.solve(A.toarray() - 1e-8 * np.eye(b.size), b)
    np.testing.assert_allclose(x, exact, atol=1e-6 * np.linalg.norm(exact))


@given(st.integers(0, 100), st.integers(1, 15))
def test_blocks_are_inverted_whatever_their_diagonals(seed, size):
    """A cyclic exchange of rows leaves zeros on the diagonal; a matrix of zeros is refused."""
    A = np.roll(np.triu(np.random.default_rng(seed).normal(size=(size, size)), 1) + 3.0 * np.eye(size), 1, axis=0)
    inverse = A.copy()
    krylov._invert_block(inverse)
    np.testing.assert_allclose(inverse @ A, np.eye(size), atol=1e-15 * np.linalg.cond(A))
    with pytest.raises(np.linalg.LinAlgError):
        krylov._invert_block(np.zeros((size, size)))


def test_strongly_coupled_blocks_are_given_up_after_a_few_iterations(monkeypatch):
    A, calls = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(300, 300), format="csr"), []
    apply = krylov._apply
    monkeypatch.setattr(krylov, "_apply", lambda *args: calls.append(0) or apply(*args))
    with pytest.raises(krylov.NotConvergedError):
        krylov.by_blocks(A, np.ones(300), 0.0, np.arange(300) // 2)
    assert len(calls) <= 2 * krylov.PROBED + 1


@given(st.integers(0, 100), st.integers(0, 4))
def test_a_known_factor_serves_other_states(seed, changes):
    """Of 40 rows 30 are active; then a few others, and some no longer."""
    rng = np.random.default_rng(seed)
    whole = rng.normal(size=(40, 40))
    whole = whole @ whole.T / 40.0 + np.eye(40)
    before = np.sort(rng.permutation(40)[:30])
    dropped, added = rng.permutation(before)[:changes], np.setdiff1d(np.arange(40), before)[:changes]
    now = np.sort(np.concatenate([np.setdiff1d(before, dropped), added]))
    inverse = np.linalg.inv(whole[np.ix_(before, before)])
    A, b, asked = sp.csr_array(whole[np.ix_(now, now)]), rng.normal(size=now.size), []

    def factor(v):
        asked.append(0)
        return inverse @ v

    x = krylov.by_known_factor(A, b, 0.0, now, factor, before, 2 * changes)
    np.testing.assert_allclose(A @ x, b, atol=1e-7 * np.linalg.norm(b))
    assert len(asked) <= 4 * changes + 4


def chain(bodies, coupling):
    """Frictional contacts between bodies in a row, of which each couples with the next by so much."""
    rng = np.random.default_rng(3)
    size, pairs = 2 * 3 * bodies, np.repeat(np.arange(bodies), 3)
    block = rng.normal(size=(bodies, 6, 6))
    W = np.zeros((size, size))
    for b in range(bodies):
        W[6 * b : 6 * b + 6, 6 * b : 6 * b + 6] = block[b] @ block[b].T / 6.0 + np.eye(6)
    for b in range(bodies - 1):
        W[6 * b : 6 * b + 6, 6 * b + 6 : 6 * b + 12] = coupling * rng.normal(size=(6, 6))
    W = np.tril(W.T) + np.tril(W.T, -1).T
    q = np.where(np.arange(size) % 2, 0.3 * rng.normal(size=size), -rng.uniform(0.1, 1.0, size))
    return sp.csr_array(W), q, np.full(3 * bodies, 0.3), pairs


def test_pairs_lead_to_the_same_impulses_without_a_factorisation(monkeypatch):
    W, q, mu, pairs = chain(60, 0.02)
    expected, info = coulomb.solve(W, q, mu, tol=1e-10)
    assert info.converged and info.iterations > 1
    monkeypatch.setattr(newton, "splu", None)
    r, info = coulomb.solve(W, q, mu, tol=1e-10, pairs=pairs)
    assert info.converged
    np.testing.assert_allclose(r, expected, atol=1e-9 * np.abs(expected).max())


def test_without_pairs_no_iterative_solver_is_tried_first(monkeypatch):
    W, q, mu, _ = chain(60, 0.02)
    monkeypatch.setattr(newton, "by_blocks", None)
    assert coulomb.solve(W, q, mu)[1].converged


def test_a_factor_is_used_again_where_few_contacts_change(monkeypatch):
    """Of a known solution two contacts are pulled apart: the same impulses by fewer factorisations."""
    W, q, mu, _ = chain(60, 0.02)
    r, _ = coulomb.solve(W, q, mu, tol=1e-10)
    pressed = 2 * np.flatnonzero(r[::2] > 0.0)[::60]
    q[pressed] += 3.0
    factorised, found, original = {}, {}, newton._factorised
    for most in (0, newton.MAX_CHANGES):
        made = []
        monkeypatch.setattr(newton, "_factorised", lambda A, _made=made: _made.append(0) or original(A))
        monkeypatch.setattr(newton, "MAX_CHANGES", most)
        found[most], info = coulomb.solve(W, q, mu, tol=1e-10, r0=r)
        factorised[most] = len(made)
        assert info.converged
    assert factorised[newton.MAX_CHANGES] == 1 < factorised[0]
    np.testing.assert_allclose(found[0], found[newton.MAX_CHANGES], atol=1e-9 * np.abs(r).max())
