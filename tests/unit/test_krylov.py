"""Iterative solvers of Newton steps of the contact problem, against dense algebra."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from skmpm import coulomb
from skmpm.coulomb import krylov, newton


def overlapping_squares(seed, squares, coupling):
    """An unsymmetric matrix of dense squares, each of which shares half of its rows with the next, as bodies do."""
    rng = np.random.default_rng(seed)
    n = 4 * (squares + 1)
    A = np.eye(n)
    for k in range(squares):
        A[4 * k : 4 * k + 8, 4 * k : 4 * k + 8] += coupling * rng.normal(size=(8, 8))
    return sp.csr_array(A), rng.normal(size=n)


@given(st.integers(0, 100), st.integers(1, 30))
def test_squares_that_overlap_are_solved(seed, squares):
    A, b = overlapping_squares(seed, squares, 0.1)
    x = krylov.by_incomplete_factor(A, b, 1e-8)
    exact = np.linalg.solve(A.toarray() - 1e-8 * np.eye(b.size), b)
    np.testing.assert_allclose(x, exact, atol=1e-6 * np.linalg.norm(exact))


def test_incomplete_factors_of_a_band_are_those_of_elimination(monkeypatch):
    """Without fill to drop they are exact, and one iteration is enough."""
    A, b = overlapping_squares(0, 1, 0.1)
    monkeypatch.setattr(krylov, "LIMIT", 1)
    x = krylov.by_incomplete_factor(A, b, 0.0)
    np.testing.assert_allclose(A @ x, b, atol=1e-9)


def membrane(points):
    """Stiffness of a square membrane with so many points a side, which couples all rows."""
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(points, points))
    return sp.csr_array(sp.kronsum(line, line))


def test_what_couples_all_rows_is_given_up():
    with pytest.raises(krylov.NotConvergedError):
        krylov.by_incomplete_factor(membrane(100), np.ones(10_000), 0.0)


@pytest.mark.parametrize("limit, left", [(3, None), (4, 1e-4), (6, 1e-6), (25, 1e-9)])
def test_the_next_newton_step_begins_with_what_the_limit_leaves(monkeypatch, limit, left):
    """Of 3,000 discs a residual of 1e-8 instead of 1e-9 was left to an LU. It may not be much."""
    A, b = membrane(10), np.ones(100)
    monkeypatch.setattr(krylov, "LIMIT", limit)
    if left is None:
        with pytest.raises(krylov.NotConvergedError):
            krylov.by_incomplete_factor(A, b, 0.0)
    else:
        x = krylov.by_incomplete_factor(A, b, 0.0)
        assert left / 100.0 < np.linalg.norm(b - A @ x) / np.linalg.norm(b) <= left


def test_singular_and_too_definite_matrices_are_left_to_a_factorisation():
    singular, symmetric = sp.csr_array([[1.0, 1.0], [1.0, 1.0]]), sp.csr_array([[1.0, 0.1], [0.1, -1.0]])
    with pytest.raises(krylov.NotConvergedError):
        krylov.by_incomplete_factor(singular, np.array([1.0, 0.0]), 0.0)
    with pytest.raises(krylov.NotConvergedError):
        krylov.by_incomplete_factor(symmetric, np.array([1.0, 0.0]), 0.0, negative=2)
    x = krylov.by_incomplete_factor(symmetric, np.array([1.0, 0.0]), 0.0, negative=1)
    np.testing.assert_allclose(symmetric @ x, [1.0, 0.0], atol=1e-9)


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
    size = 2 * 3 * bodies
    block = rng.normal(size=(bodies, 6, 6))
    W = np.zeros((size, size))
    for b in range(bodies):
        W[6 * b : 6 * b + 6, 6 * b : 6 * b + 6] = block[b] @ block[b].T / 6.0 + np.eye(6)
    for b in range(bodies - 1):
        W[6 * b : 6 * b + 6, 6 * b + 6 : 6 * b + 12] = coupling * rng.normal(size=(6, 6))
    W = np.tril(W.T) + np.tril(W.T, -1).T
    q = np.where(np.arange(size) % 2, 0.3 * rng.normal(size=size), -rng.uniform(0.1, 1.0, size))
    return sp.csr_array(W), q, np.full(3 * bodies, 0.3)


def test_the_same_impulses_with_and_without_a_factorisation(monkeypatch):
    W, q, mu = chain(60, 0.02)
    monkeypatch.setattr(newton, "splu", None)
    r, info = coulomb.solve(W, q, mu, tol=1e-10)
    assert info.converged and info.iterations > 1
    monkeypatch.undo()
    monkeypatch.setattr(newton, "by_incomplete_factor", given_up)
    expected, info = coulomb.solve(W, q, mu, tol=1e-10)
    assert info.converged
    np.testing.assert_allclose(r, expected, atol=1e-9 * np.abs(expected).max())


def given_up(*_):
    raise krylov.NotConvergedError


def test_a_factor_is_used_again_where_few_contacts_change(monkeypatch):
    """Of a known solution two contacts are pulled apart: the same impulses by fewer factorisations."""
    W, q, mu = chain(60, 0.02)
    monkeypatch.setattr(newton, "by_incomplete_factor", given_up)
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
