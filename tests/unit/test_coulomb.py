"""The contact solver: projection, residual, closed forms, lattices; see also verification/test_contact_solver.py."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag
from scipy.optimize import nnls

from skmpm import coulomb

MU = st.sampled_from([0.0, 0.1, 0.3, 0.5, 1.0, 2.0])
SEED = st.integers(0, 2**32 - 1)


def random_problem(seed, mu):
    """W of full rank."""
    rng = np.random.default_rng(seed)
    m = 2 * len(mu)
    H = rng.normal(size=(m, m + 1)) * 10.0 ** rng.uniform(-1, 1, size=(m, 1))  # diag(W): four decades
    return H @ H.T, H @ rng.normal(size=m + 1), np.array(mu)


def lattice(side, *, per_pair=4, mu=0.5, seed=0, redundant=False):
    """Elastic-like discs on a hexagonal lattice: rigid motions plus a smooth Green's function, dense per body."""
    rng = np.random.default_rng(seed)
    i, j = (a.ravel() for a in np.mgrid[:side, :side])
    bonds = [(i, j, i + 1, j), (i, j, i, j + 1), (i + 1, j, i, j + 1)]
    a, b = np.hstack([[p * side + q, s * side + t] for p, q, s, t in bonds])
    inside = np.hstack([(np.maximum(p, s) < side) & (np.maximum(q, t) < side) for p, q, s, t in bonds])
    a, b = a[inside], b[inside]
    centre = np.array([2.0 * i + j, np.sqrt(3.0) * j])
    n = np.repeat((centre[:, a] - centre[:, b]) / 2.0, per_pair, axis=1)
    t = np.array([-n[1], n[0]])
    offset = np.tile((0.0 if redundant else 0.1) * (np.arange(per_pair) - (per_pair - 1) / 2), a.size)
    a, b = np.repeat(a, per_pair), np.repeat(b, per_pair)
    scale = 1.0 if redundant else 10.0 ** rng.uniform(-1.0, 1.0, 2 * a.size)
    blocks, q = [], np.zeros(2 * a.size)
    for body in range(side * side):
        on_a, on_b = np.flatnonzero(a == body), np.flatnonzero(b == body)
        own, sign = np.r_[on_a, on_b], np.r_[np.ones(on_a.size), -np.ones(on_b.size)]
        arm = np.hstack([-n[:, on_a], n[:, on_b]]) + offset[own] * t[:, own]
        D = np.stack([n[:, own], t[:, own]], axis=1) * sign  # (xy, nt, contacts)
        spin = np.einsum("xik,xk->ik", D, np.array([-arm[1], arm[0]]))
        far = np.hypot(*(arm[:, :, None] - arm[:, None, :]))
        G = np.einsum("xik,xjl,kl->kilj", D, D, 0.3 + 2.0 * np.exp(-far / 0.3))
        G += 0.6 * np.einsum("ik,jl->kilj", spin, spin)
        rows = (2 * own[:, None] + [0, 1]).ravel()
        blocks.append((np.repeat(rows, rows.size), np.tile(rows, rows.size), G.ravel()))
        velocity = -0.02 * (centre[:, body] - centre.mean(axis=1)) + 0.05 * rng.normal(size=2)
        turn = 0.05 * rng.normal()
        q[rows] += (np.einsum("xik,x->ki", D, velocity) + turn * spin.T).ravel()
    rows, columns, values = (np.concatenate(x) for x in zip(*blocks, strict=True))
    W = sp.coo_array((values, (rows, columns)), shape=(q.size, q.size)).tocsr()
    S = sp.diags_array(scale * np.ones(q.size))
    mu = np.full(a.size, mu) if np.isscalar(mu) else rng.uniform(*mu, a.size)
    return (S @ W @ S).tocsr(), scale * (q + np.where(np.arange(q.size) % 2, 0.0, 0.02)), mu


def certificate(W, q, mu, r):
    d = W.diagonal()
    return coulomb.residual(r, W @ r + q, mu, d, reference=np.linalg.norm(q / np.sqrt(d)))


@given(SEED, st.integers(1, 30), st.booleans())
def test_frictionless_is_nnls(seed, k, singular):
    """To minimise |H'r + v| over r >= 0 has W = H H', q = H v; the velocity H'r + v is unique even if r is not."""
    rng = np.random.default_rng(seed)
    H, v = rng.normal(size=(k, max(1, k // 2) if singular else k + 2)), None
    v = rng.normal(size=H.shape[1])
    r, info = coulomb.solve(H @ H.T, H @ v, np.zeros(k), tol=1e-10)
    expected, _ = nnls(H.T, -v)
    assert info.converged
    np.testing.assert_allclose(H.T @ r, H.T @ expected, atol=1e-7 * np.linalg.norm(v))


@given(SEED, st.integers(1, 30))
def test_zero_friction_with_tangential_rows_is_the_frictionless_problem(seed, k):
    W, q, mu = random_problem(seed, [0.0] * k)
    r, _ = coulomb.solve(W, q, mu, tol=1e-12)
    normal, _ = coulomb.solve(W[::2, ::2], q[::2], mu, tol=1e-12)
    assert not r[1::2].any()
    np.testing.assert_allclose(r[::2], normal, rtol=1e-8, atol=1e-8 * np.abs(normal).max())


@pytest.mark.parametrize("slide", [-3.0, 3.0])
def test_slips_on_the_cone_to_the_last_bit(slide):
    r, _ = coulomb.solve(np.diag([3.0, 0.7]), np.array([-0.3, slide]), np.array([0.3]))
    np.testing.assert_allclose(r[0], 0.1, rtol=1e-9)
    assert r[1] == -np.sign(slide) * 0.3 * r[0]


def test_friction_does_not_lift():
    """The convex relaxation would open the contact by mu |u_t|; Coulomb keeps u_n = 0."""
    W, q = np.eye(2), np.array([-1.0, 2.0])
    r, _ = coulomb.solve(W, q, np.array([0.5]), tol=1e-12)
    np.testing.assert_allclose(W @ r + q, [0.0, 1.5], atol=1e-12)
    relaxed = coulomb.project(-q, np.array([0.5]))
    assert coulomb.residual(relaxed, relaxed + q, np.array([0.5]), np.ones(2)) > 0.1


def test_sticks_below_the_cone():
    r, info = coulomb.solve(np.eye(2), np.array([-1.0, 0.4]), np.array([0.5]))
    np.testing.assert_allclose(r, [1.0, -0.4], rtol=1e-9)
    assert info.converged


def test_a_doubled_contact_is_shared_in_one_step():
    """W is exactly singular; the tiny shift of the Newton matrix picks equal shares."""
    r, info = coulomb.solve(np.ones((2, 2)), np.full(2, -1.0), np.zeros(2), tol=1e-9)
    np.testing.assert_allclose(r, 0.5, rtol=1e-9)
    assert (info.iterations, info.converged) == (1, True)


@pytest.mark.parametrize("mu", [0.0, 0.5, 2.0])
def test_uncoupled_contacts_have_a_closed_form(mu):
    """W diagonal: each normal impulse stops its contact, each tangential one does so up to friction."""
    rng = np.random.default_rng(3)
    d, q = 10.0 ** rng.uniform(-2, 2, 400), rng.normal(size=400)
    r, info = coulomb.solve(sp.diags_array(d, format="csr"), q, np.full(200, mu), tol=1e-12)
    normal = np.maximum(-q[::2] / d[::2], 0.0)
    tangential = np.clip(-q[1::2] / d[1::2], -mu * normal, mu * normal)
    assert info.converged
    np.testing.assert_allclose(r, np.stack([normal, tangential], axis=1).ravel(), rtol=1e-8, atol=1e-12)


def test_a_reference_tells_what_residuals_are_relative_to():
    """One contact closes slowly, another stays open fast: |q~| is the other's, and says nothing of the first."""
    W, q, known = np.array([[1.0, 0.3], [0.3, 1.0]]), np.array([-1e-6, 1.0]), np.array([0.5e-6, 0.0])
    loose, info = coulomb.solve(W, q, np.zeros(2), r0=known, tol=1e-6)
    assert info.converged and loose == pytest.approx(known), "half of what it takes is good enough"
    r, info = coulomb.solve(W, q, np.zeros(2), r0=known, tol=1e-6, reference=1e-6)
    assert info.converged
    np.testing.assert_allclose(r, [1e-6, 0.0], rtol=1e-5)


def test_without_contacts():
    r, info = coulomb.solve(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
    assert r.shape == (0,) and info == coulomb.Info(0, 0.0, True)
    assert coulomb.residual(r, r, np.zeros(0), r) == 0.0
    assert coulomb.project(r, np.zeros(0)).shape == (0,)


def test_at_rest_and_apart():
    for q in (np.zeros(4), np.array([1.0, 5.0, 2.0, -3.0])):
        r, info = coulomb.solve(np.eye(4), q, np.full(2, 0.5))
        assert not r.any() and info.converged and info.iterations == 0


@given(SEED, st.lists(MU, min_size=1, max_size=6))
def test_projection_is_the_nearest_point(seed, mu):
    """P is in the cone, r - P in its polar, and the two are orthogonal (Moreau)."""
    rng = np.random.default_rng(seed)
    mu, r = np.array(mu), rng.normal(size=2 * len(mu))
    p = coulomb.project(r, mu)
    rest = r - p
    assert (np.abs(p[1::2]) <= mu * p[::2]).all()
    assert (rest[::2] + mu * np.abs(rest[1::2]) <= 1e-12).all()
    assert abs(p @ rest) < 1e-12
    np.testing.assert_array_equal(coulomb.project(r[::2], mu), np.maximum(r[::2], 0.0))


@given(SEED, st.lists(MU, min_size=1, max_size=4), st.floats(-3, 3), st.floats(-3, 3))
def test_residual_does_not_depend_on_units(seed, mu, length, mass):
    W, q, mu = random_problem(seed, mu)
    r = np.random.default_rng(seed).normal(size=q.size) / np.diag(W)
    expected = certificate(W, q, mu, r)
    velocity, mass = 10.0**length, 10.0**mass
    assert certificate(W / mass, velocity * q, mu, velocity * mass * r) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("mu", [0.0, 0.5, (0.0, 2.0)])
def test_large_lattice(mu):
    """About 3,200 contacts, 17 discs across, diag(W) over four decades, to 1e-10, certified by `residual`."""
    W, q, mu = lattice(17, mu=mu)
    if not mu.any():
        W, q = W[::2][:, ::2].tocsr(), q[::2]
    r, info = coulomb.solve(W, q, mu, tol=1e-10)
    assert info.converged and certificate(W, q, mu, r) < 1e-10
    assert 0.05 < (r > 0.0).mean() < 0.95
    if mu.any():
        edge = mu * r[::2]
        slips = (np.abs(r[1::2]) == edge) & (edge > 0.0)
        assert slips.any() and ((np.abs(r[1::2]) < edge).sum() > 0) and (np.abs(r[1::2]) <= edge).all()


def test_lattice_with_every_contact_doubled():
    W, q, mu = lattice(8, per_pair=2, redundant=True)
    r, info = coulomb.solve(W, q, mu, tol=1e-9)
    assert info.converged and certificate(W, q, mu, r) < 1e-9


def test_warm_start_takes_fewer_iterations():
    W, q, mu = lattice(8)
    r, cold = coulomb.solve(W, q, mu, tol=1e-10)
    q = q * (1.0 + 1e-3 * np.random.default_rng(0).normal(size=q.size))
    _, warm = coulomb.solve(W, q, mu, r0=r, tol=1e-10)
    assert warm.converged and warm.iterations == 1 < cold.iterations
    assert coulomb.solve(W, q, mu, r0=r, tol=1.0)[1] == coulomb.Info(0, pytest.approx(0.0, abs=1.0), True)


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("copies", [1, 80])
def test_a_jam_is_reported_not_raised(friction, copies):
    """A particle of two dofs between two walls that close in: no impulse can open both gaps."""
    W = sp.csr_array(block_diag(*[np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(2))] * copies))
    q = np.tile([-1.0, 0.0, -1.0, 0.0], copies)
    r, info = coulomb.solve(W, q, np.full(2 * copies, friction))
    assert not info.converged and info.residual > 0.1 and np.isfinite(r).all()


@pytest.mark.parametrize("noise", [0.0, 1e-20, -1e-20, 1e-32])
@pytest.mark.parametrize("slide", [3.0, -3.0, 1e-9, 0.0])
@pytest.mark.parametrize("compliance", [1.0, 4e-8, 7e5])
def test_a_point_that_a_support_moves_along_the_contact(compliance, slide, noise):
    """W = diag(w, 0), also with what rounding makes of zero: r = (1, -mu sign(slide)) / w, the support bears r_t."""
    W, q, mu = compliance * np.diag([1.0, noise]), np.array([-1.0, slide]), np.array([0.5])
    r, info = coulomb.solve(W, q, mu, tol=1e-12)
    assert info.converged
    np.testing.assert_allclose(compliance * r, [1.0, -0.5 * np.sign(slide)], rtol=1e-9)
    u, size = W @ r + q, np.hypot(1.0, slide) / np.sqrt(compliance)
    assert coulomb.residual(r, u, mu, W.diagonal(), reference=size) < 1e-12
    wrong = coulomb.residual(r * [1.0, -1.0], u, mu, W.diagonal(), reference=size)
    assert wrong >= 0.2 * abs(slide) / np.hypot(1.0, slide), "of the size of the slip, in any units"


def held_at(W, q, held, noise):
    """The problem with the tangential rows of some contacts held; what is left of them is round-off."""
    W, rows = W.copy(), 2 * held + 1
    W[rows] *= noise
    W[:, rows] *= noise
    return W, q


@pytest.mark.parametrize("noise", [0.0, 1e-10, 1e-13])
@pytest.mark.parametrize("sparse", [False, True])
@given(SEED, st.floats(0.0, 1.0), st.floats(-3, 3), st.floats(-3, 3))
@settings(max_examples=25)
def test_contacts_with_and_without_a_tangential_response(sparse, noise, seed, friction, length, mass):
    """Where r_t is known the law is one-sided: r_t = -mu r_n sign(q_t), checked on its own; so in any units."""
    k = 120 if sparse else 6
    rng, velocity, mass = np.random.default_rng(seed), 10.0**length, 10.0**mass
    H = np.kron(np.eye(k // 6), np.ones((12, 13))) * rng.normal(size=(2 * k, k // 6 * 13))
    H *= np.repeat(10.0 ** rng.uniform(-1, 1, size=k), 2)[:, None]
    W, q, mu = H @ H.T, rng.normal(size=2 * k) * np.linalg.norm(H, axis=1), np.full(k, friction)
    held = rng.choice(k, k // 3, replace=False)
    W, q = held_at(W, q, held, noise)
    r, info = coulomb.solve(sp.csr_array(W / mass) if sparse else W / mass, velocity * q, mu, tol=1e-10)
    assume(info.converged or sparse)  # definite W: but for one in thousands solved
    assert info.converged
    s = np.sqrt(coulomb.row_scales(W.diagonal(), k))
    np.testing.assert_allclose(s[2 * held + 1], s[2 * held])
    x, size = r * s / (mass * velocity), np.linalg.norm(q / s)
    u = (W @ (r / (mass * velocity)) + q) / s
    assert max(-x[::2].min(), -u[::2].min(), np.minimum(x[::2], u[::2]).max()) < 1e-9 * size
    np.testing.assert_allclose(
        x[2 * held + 1], -friction * np.sign(q[2 * held + 1]) * x[2 * held], atol=1e-9 * size, rtol=1e-9
    )
    other = (x + size) / s
    expected = coulomb.residual(other, u * s, mu, W.diagonal())
    in_units = coulomb.residual(mass * velocity * other, velocity * u * s, mu, W.diagonal() / mass)
    assert in_units == pytest.approx(velocity * np.sqrt(mass) * expected, rel=1e-9)


def test_scales_of_rows():
    """Ordinary rows keep diag(W), tangential ones that are negligible or negative take their normal row's."""
    W = np.array([2.0, 3.0, 2.0, 1e-3, 5.0, 1e-14, 7.0, 0.0, 1.0, -1e-18])
    expected = [2.0, 3.0, 2.0, 1e-3, 5.0, 5.0, 7.0, 7.0, 1.0, 1.0]
    np.testing.assert_array_equal(coulomb.row_scales(W, 5), expected)
    np.testing.assert_array_equal(coulomb.row_scales(expected, 5), expected)
    np.testing.assert_array_equal(coulomb.row_scales(W[::2], 5), W[::2])
    assert W[5] == 1e-14


@pytest.mark.parametrize(("seed", "iterations", "solved"), [(14, 600, True), (14, 149, False), (0, 149, True)])
def test_where_contacts_would_change_in_turns(seed, iterations, solved):
    """Ten contacts on three degrees of freedom, whose states recur if all of them change in a step.

    Of one problem contacts have to change one by one; of the other states recur then, too, and proximal problems are
    solved. With fewer than 150 Newton steps these are not tried, and the best iterate is returned.
    """
    rng, mu = np.random.default_rng(seed), np.full(10, 0.5)
    H = rng.normal(size=(20, 3))
    q = H @ rng.normal(size=3)
    q[::2] += 1.0  # a motion opens all contacts, so there is a solution
    r, info = coulomb.solve(H @ H.T, q, mu, tol=1e-9, iterations=iterations)
    assert info.converged is solved
    assert bool(certificate(H @ H.T, q, mu, r) < 1e-9) is solved


def test_what_is_not_a_number_ends():
    _, info = coulomb.solve(np.eye(2), np.array([np.nan, 1.0]), np.array([0.5]))
    assert not info.converged and info.residual == np.inf


def test_a_tolerance_below_round_off_ends():
    mass = 1e4 ** np.arange(4.0)
    H = np.eye(4) - np.eye(4, k=-1)
    r, info = coulomb.solve(H / mass @ H.T, np.array([-1.0, 0.0, 0.0, 0.0]), np.zeros(4), tol=1e-15)
    assert not info.converged and np.isfinite(r).all()


def test_leaves_the_callers_arrays_alone():
    W, q, mu = lattice(6)
    W = W[:, ::-1][:, ::-1].tocsr()
    W = sp.csr_array((W.data.copy(), W.indices.copy(), W.indptr), shape=W.shape)
    order = np.concatenate([np.arange(a, b)[::-1] for a, b in zip(W.indptr[:-1], W.indptr[1:], strict=True)])
    unsorted = sp.csr_array((W.data[order], W.indices[order], W.indptr), shape=W.shape)
    before, q_before, r0 = unsorted.toarray(), q.copy(), np.ones_like(q)
    coulomb.solve(unsorted, q, mu, r0=r0)
    np.testing.assert_array_equal(unsorted.toarray(), before)
    np.testing.assert_array_equal(q, q_before)
    assert (r0 == 1.0).all()


@pytest.mark.parametrize(
    ("shape", "size", "mu", "message"),
    [
        ((4, 4), 3, [0.5, 0.5], "disagree"),
        ((2, 2), 4, [0.5, 0.5], "disagree"),
        ((4, 4), 4, [0.5, -0.5], "negative"),
        ((2, 2), 2, [0.5, 0.5], "tangential"),
    ],
)
def test_says_what_is_wrong(shape, size, mu, message):
    with pytest.raises(ValueError, match=message):
        coulomb.solve(np.eye(shape[0]), np.zeros(size), np.array(mu))


@pytest.mark.parametrize("unstable", [0, 1])
def test_newton_steps_end_where_a_motion_that_keeps_contacts_closed_lowers_the_energy(unstable):
    """Contacts, each with a bilateral unknown that responds by 0.5 and has the compliance -c: unstable if c < 0.5."""
    k = 150
    compliance = np.full(k, -1.0)
    compliance[:unstable] = -0.1
    response, coupling = 0.5 * sp.eye_array(k), 0.2 * sp.eye_array(k)
    of_bilateral = response + sp.diags_array(compliance)
    W = sp.block_array([[sp.eye_array(k), coupling], [coupling, of_bilateral]], format="csr")
    q, s = np.full(k, -1.0), np.full(k, 0.1)
    _, free = coulomb.solve(W, q, np.zeros(k), iterations=12, bilateral=coulomb.Bilateral(s))
    _, counted = coulomb.solve(W, q, np.zeros(k), iterations=12, bilateral=coulomb.Bilateral(s, negative=k))
    assert free.converged, "a saddle is a solution, too"
    assert counted.converged == (not unstable)
    assert counted.iterations == 1


@pytest.mark.parametrize("k", [30, 150])
@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_bilateral_unknowns_are_what_eliminating_them_gives(k, mu):
    """Unknowns s with D s = J^T r add J s to the velocities, as J D^-1 J^T in W does: dense and sparse problems."""
    rng = np.random.default_rng(k)
    size = 2 * k if mu else k
    links = sp.csr_array(np.where(rng.random((size, size)) < 3 / size, rng.random((size, size)), 0.0))
    W, J, D = (
        sp.csr_array(links @ links.T + sp.eye_array(size)),
        rng.normal(size=(size, 3)),
        np.array([9.0, 20.0, 40.0]),
    )
    q, friction = rng.normal(size=size), np.full(k, mu)
    bordered = sp.block_array([[W, J], [sp.csr_array(J.T), sp.diags_array(-D)]], format="csr")
    r, info = coulomb.solve(bordered, q, friction, tol=1e-10, bilateral=coulomb.Bilateral(np.zeros(3)))
    expected, _ = coulomb.solve(W + J / D @ J.T, q, friction, tol=1e-10)
    assert info.converged
    np.testing.assert_allclose(r, expected, atol=1e-8)
    np.testing.assert_allclose(info.bilateral, J.T @ r / D, atol=1e-8)


def test_bilateral_unknowns_without_contacts_are_refused():
    """They were ignored."""
    with pytest.raises(
        ValueError, match=r"2 bilateral unknowns and no contact; solve W s \+ q = 0 by a linear solver"
    ):
        coulomb.solve(np.eye(2), np.zeros(0), np.zeros(0), bilateral=coulomb.Bilateral(np.ones(2)))
