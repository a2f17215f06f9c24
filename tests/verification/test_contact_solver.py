"""The contact solver finds a solution of every problem saved from real runs, and of all but 4 of 4000 random ones.

Small problems have all contact states enumerated. The library (tests/verification/problems, by save_problems.py) has
problems of runs. `violation` (contact_laws.py), not the solver's own residual, checks Signorini's and Coulomb's laws
contact by contact. More is in tests/unit/test_coulomb.py.

| problem of the library | solid fraction | dt |
|---|---|---|
| packings, R/h = 5 | 0.65 to 0.97 | 0.5, 5, 50 us |
| packings, R/h = 8 | 0.80, 0.95 | 5, 50 us |
| packings of 30 and 100 discs | 0.80 | 5, 50 us |
| packings, lid takes 1/8 cell a step | 0.80, 0.90 | 0.8, 8 ms |
| disc on discs 1e4 times lighter | - | 10, 20 ms |

Boxes are two to four at one node or in a wall corner. They and packings with shared-grid contact have R/h = 5 and 8.
The Delassus operator W is singular for boxes at outlines, rigid bodies and the carried disc, and nearly so for the
block.

Problems of Siconos are run by siconos.py. Sweeps of a plain Gauss-Seidel method, and the ratio of times, are to 1e-6
of the norm of q; the least violation is that within 10,000 sweeps. Sweeps are faster than Newton's method if bodies
are rigid and of similar mass. They stall above 1e-8 where W has negative eigenvalues, because Siconos prints six
digits of W, and fail where masses differ by 1e4.
"""

from functools import cache
from itertools import combinations, product
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
import pytest
import siconos
from contact_laws import violation
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from ledger import Row, tabulated
from save_problems import FOLDER, load, random_bodies
from scipy.optimize import linprog

from skmpm import coulomb

TOL = 1e-10
FRICTION = st.one_of(st.just(0.0), st.floats(0.0, 2.0))
SEED = st.integers(0, 2**32 - 1)
TILT = np.sqrt(3.0) / 2.0  # cos 30 degrees


# All states of a few contacts.


def random_problem(seed, mu, *, rank=None):
    """W of random rows, by default definite, diag(W) over four decades; with fewer than full rank a solution exists.

    It does if some motion opens every contact without sliding (Acary, Cadoux, Lemarechal & Malick, Z. Angew. Math.
    Mech. 91 (2011) 155-175): q = H v plus a gap, which -v opens.
    """
    draw, mu = np.random.default_rng(seed), np.array(mu)
    m, k = 2 * mu.size, mu.size
    if rank is None:
        H = draw.normal(size=(m, m + 1)) * 10.0 ** draw.uniform(-1, 1, size=(m, 1))
        return H @ H.T, H @ draw.normal(size=m + 1) if draw.random() < 0.5 else draw.normal(size=m), mu
    H = draw.normal(size=(m, rank)) * np.repeat(10.0 ** draw.uniform(-1, 1, size=k), 2)[:, None]
    s, q = np.linalg.norm(H, axis=1), H @ draw.normal(size=rank)
    q[::2] += 0.05 * s[::2] * np.linalg.norm(q / s)
    return H @ H.T, q, mu


def enumerated(W, q, mu, tol=1e-8):
    """All solutions: open, sticking and slipping contacts tried in every combination, by dense least squares."""
    solutions, unit = [], np.eye(q.size)
    for states in product(*("os+-" if m > 0.0 else "o+" for m in mu)):
        columns, rows = [], []
        for c, (state, m) in enumerate(zip(states, mu, strict=True)):
            n, t = 2 * c, 2 * c + 1
            if state == "s":
                columns, rows = [*columns, unit[n], unit[t]], [*rows, n, t]
            elif state != "o":
                columns, rows = [*columns, unit[n] + (m if state == "+" else -m) * unit[t]], [*rows, n]
        B = np.array(columns).T.reshape(q.size, -1)
        r = B @ np.linalg.lstsq(W[rows] @ B, -q[rows], rcond=None)[0] if rows else np.zeros(q.size)
        if violation(W, q, mu, r) < tol:
            solutions.append(r)
    return solutions


@given(SEED, st.lists(FRICTION, min_size=1, max_size=5))
def test_finds_one_of_the_enumerated_solutions(seed, mu):
    """Up to five contacts, W definite, mu in [0, 2]: every state of every contact is tried; all laws to 1e-9 |q|.

    Where the cones, scaled by the responses of their rows, have slopes above 10, a residual of 1e-10 leaves as much
    as the slope times that: the tangential laws change by the slope times an error of the normal impulse. With much
    friction there may be several solutions; the solver's must be one of them, to 1e-6: 1e-10 over the smallest
    eigenvalue of W.
    """
    W, q, mu = random_problem(seed, mu)
    r, info = coulomb.solve(W, q, mu, tol=TOL)
    s = np.sqrt(np.diag(W))
    assert info.converged
    assert violation(W, q, mu, r) < TOL * max(10.0, float((mu * s[1::2] / s[::2]).max()))
    near = min(np.abs(s * (r - x)).max() for x in enumerated(W, q, mu))
    assert near < 1e-6 * (np.linalg.norm(q / s) + np.abs(s * r).max())


@settings(derandomize=True)
@given(SEED, st.lists(FRICTION, min_size=2, max_size=5), st.integers(3, 6))
def test_solves_what_has_a_solution_when_contacts_are_redundant(seed, mu, rank):
    """W of rank 3 (the rigid motions of one body) to 6 for up to ten rows, mu in [0, 2]: all laws to 1e-8 |q|.

    Impulses are not unique. Of 32,000 such problems the solver failed at one: hence always the same examples.
    """
    W, q, mu = random_problem(seed, mu, rank=min(rank, 2 * len(mu)))
    r, info = coulomb.solve(W, q, mu, tol=TOL)
    assert info.converged
    assert violation(W, q, mu, r) < 1e-8


def opening(H, q, mu):
    """The largest t <= 1 with ``u_n >= mu |u_t| + t`` at all contacts for some motion v: a linear program.

    u = H v + q, rows scaled by their size. Where it is positive the contacts have a solution (Klarbring & Pang, SIAM
    J. Optim. 8 (1998); Acary, Cadoux, Lemarechal & Malick, Z. Angew. Math. Mech. 91 (2011) 155-175).
    """
    s = np.linalg.norm(H, axis=1)
    (H_n, H_t), (q_n, q_t) = ((a[::2], a[1::2]) for a in (H / s[:, None], q / s))
    slope = mu * s[1::2] / s[::2]
    edges = [(H_n + sign * slope[:, None] * H_t, q_n + sign * slope * q_t) for sign in (1.0, -1.0)]
    A = np.vstack([np.hstack([-rows, np.ones((mu.size, 1))]) for rows, _ in edges])
    cost, free = np.append(np.zeros(H.shape[1]), -1.0), [(None, None)] * H.shape[1]
    found = linprog(cost, A_ub=A, b_ub=np.concatenate([b for _, b in edges]), bounds=[*free, (None, 1.0)])
    assert found.status == 0
    return -found.fun


@settings(derandomize=True)
@given(SEED, st.integers(3, 10), st.floats(2.0, 5.0), st.floats(0.0, 1.0), st.sampled_from([1e-2, 1e-3, 1e-4]))
def test_solves_random_contacts_of_rigid_bodies_that_can_all_open(seed, bodies, ratio, friction, gap):
    """Two to five contacts a body, mu in [0, 1]: a solution exists (linear program), and all laws hold to 1e-9.

    W has rank 3 bodies for four to ten rows a body.
    """
    p = random_bodies(bodies, round(ratio * bodies), friction, gap, seed)
    assert opening(p.factor.toarray(), p.q, p.mu) > 0.0
    r, info = p.solve(warm=False)
    assert info.converged
    assert violation(p.W, p.q, p.mu, r) < 1e-9


def test_of_random_contacts_with_more_friction_few_are_not_solved():
    """Friction of 1 to 2: at most one in twenty fails, and says so; the others obey all laws to 1e-9."""
    draw, failed, trials = np.random.default_rng(7), 0, 100
    for seed in range(trials):
        bodies, ratio, friction = draw.integers(3, 11), draw.uniform(2.0, 5.0), draw.uniform(1.0, 2.0)
        p = random_bodies(bodies, round(ratio * bodies), friction, 1e-3, seed)
        r, info = p.solve(warm=False)
        failed += not info.converged
        assert (violation(p.W, p.q, p.mu, r) < 1e-9) is info.converged
    assert failed <= trials // 20


def test_the_saved_problem_of_random_contacts_has_a_solution():
    """That of the library, 300 contacts of 20 bodies: also if friction were a hundred times larger."""
    p = load(FOLDER / "bodies_mu1.0_300.npz")
    for times in (1.0, 100.0):
        assert opening(p.factor.toarray(), p.q, times * p.mu) > 0.0


# Bodies at one node, in corners, in stacks: W = H M^-1 H'.


def delassus(H, mass, velocity):
    """W and q of rows H (m, dofs) on bodies that move with `velocity` (dofs,)."""
    return H / mass @ H.T, H @ velocity


def pair(normal, a, b, bodies):
    """Rows n and t of body a, minus those of b if there is one, both without rotation."""
    n = np.array(normal, dtype=float)
    H = np.zeros((2, bodies, 2))
    H[:, a] = [n, [-n[1], n[0]]]
    if b is not None:
        H[:, b] = -H[:, a]
    return H.reshape(2, -1)


def node(directions, mass, speed):
    """Bodies in these directions of a node which all pairs share, moving towards it; normals between them."""
    d, pairs = np.array(directions), list(combinations(range(len(directions)), 2))
    H = np.vstack([pair((d[a] - d[b]) / np.linalg.norm(d[a] - d[b]), a, b, len(d)) for a, b in pairs])
    return *delassus(H, np.repeat(mass, 2), -speed * (d / np.array(mass)[:, None]).ravel()), H


@pytest.mark.parametrize("mu", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("bodies", [3, 4])
def test_bodies_that_meet_at_one_node_all_stop(bodies, mu):
    """Momentum is nil and every pair approaches: the closest admissible motion is rest, with all pairs in contact.

    Equal and opposite momenta towards the node, masses 1 to 4; with four bodies six pairs on eight unknowns, of
    which two translations are free: W is singular, and the impulses are not unique. Velocities to 1e-9.
    """
    angle = 2.0 * np.pi * (np.arange(bodies) + 0.5) / bodies
    mass = 1.0 + np.arange(bodies)
    W, q, H = node(np.stack([np.cos(angle), np.sin(angle)], axis=1), mass, 1.0)
    contacts = np.full(q.size // 2, mu)
    r, info = coulomb.solve(W, q, contacts, tol=TOL)
    assert info.converged
    assert violation(W, q, contacts, r) < 1e-9
    momentum = H.T @ r - np.stack([np.cos(angle), np.sin(angle)], axis=1).ravel()
    np.testing.assert_allclose(momentum, 0.0, atol=1e-9)


@pytest.mark.parametrize("angles", [(0.0, 90.0), (30.0, 120.0), (-20.0, 80.0)])
def test_a_body_pressed_into_a_corner_of_two_walls_without_friction(angles):
    """Its momentum is shared by the two normals: r = -m N^-1 v, to 1e-10; away from one wall the other takes all."""
    N = np.array([[np.cos(a), np.sin(a)] for a in np.radians(angles)])
    mass, into = 3.0, -(0.7 * N[0] + 0.4 * N[1])
    for velocity in (into, -N[0] + 3.0 * np.array([-N[0, 1], N[0, 0]])):
        H = np.vstack([pair(n, 0, None, 1) for n in N])
        W, q = delassus(H, mass, velocity)
        r, info = coulomb.solve(W, q, np.zeros(2), tol=1e-12)
        both = np.linalg.solve(N.T, -mass * velocity)
        exact = both if both.min() > 0.0 else np.maximum(-mass * (N @ velocity), 0.0) * (N @ velocity < 0.0)
        assert info.converged
        np.testing.assert_allclose(r[::2], exact, atol=1e-10)
        assert not r[1::2].any()


@pytest.mark.parametrize("mu", [0.2, 0.7, 2.0])
def test_a_body_pressed_into_a_corner_with_friction_stops(mu):
    """Walls at right angles, the way in within both: it stops, and its momentum is what the walls take, to 1e-10."""
    H = np.vstack([pair(n, 0, None, 1) for n in ((1.0, 0.0), (0.0, 1.0))])
    W, q = delassus(H, 2.0, np.array([-1.0, -0.6]))
    r, info = coulomb.solve(W, q, np.full(2, mu), tol=1e-12)
    assert info.converged
    assert violation(W, q, np.full(2, mu), r) < 1e-10
    np.testing.assert_allclose(H.T @ r, [2.0, 1.2], atol=1e-10)


@pytest.mark.parametrize("ratio", [1.0, 10.0, 1e2])
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_stack_bears_what_lies_above(ratio, mu):
    """Four bodies that fall upon each other and a floor: each contact takes the momentum of all above, to 1e-9.

    Also with masses that grow upwards, by 1e6 in all: impulses are 1e6 times what stops the lowest body alone, and
    round-off of W r, 1e-16 of that, keeps the residual from falling below 1e-10.
    """
    mass = ratio ** np.arange(4.0)
    H = np.vstack([pair((0.0, 1.0), i, i - 1 if i else None, 4) for i in range(4)])
    W, q = delassus(H, np.repeat(mass, 2), np.tile([0.0, -1.0], 4))
    r, info = coulomb.solve(W, q, np.full(4, mu), tol=TOL)
    assert info.converged
    np.testing.assert_allclose(r[::2], np.cumsum(mass[::-1])[::-1], rtol=1e-9)
    np.testing.assert_allclose(r[1::2], 0.0, atol=1e-9 * mass.sum())


def pyramid(mu_discs, mu_floor):
    """Two equal discs on a floor, a third on them, falling: unit radii, masses and speed, with rotations."""
    n = np.array([[0.5, TILT], [-0.5, TILT]])  # on the third, from either disc
    H = np.zeros((4, 2, 3, 3))  # contacts, rows, discs, (x, y, angle)
    for i in range(2):
        frame = np.array([n[i], [-n[i, 1], n[i, 0]]])
        H[i, :, 2, :2], H[i, :, i, :2] = frame, -frame
        H[i, 1, :, 2] = [-1.0 if j in (i, 2) else 0.0 for j in range(3)]
        H[2 + i, :, i, :2], H[2 + i, 1, i, 2] = [[0.0, 1.0], [-1.0, 0.0]], -1.0
    mu = np.array([mu_discs, mu_discs, mu_floor, mu_floor])
    return *delassus(H.reshape(8, 9), np.tile([1.0, 1.0, 0.5], 3), np.tile([0.0, -1.0, 0.0], 3)), mu


def test_three_discs_stand_if_friction_allows():
    """Forces of a pyramid of three: N = 1/2, F = N tan 15 between discs; 3/2 and F on the floor, times the momentum.

    It stands iff mu >= tan 15 between discs and mu >= tan 15 / 3 on the floor (textbook statics); impulses to 1e-9.
    """
    F = 0.5 * np.tan(np.pi / 12)
    r, info = coulomb.solve(*pyramid(1.001 * 2.0 * F, 1.001 * F / 1.5), tol=TOL)
    assert info.converged
    np.testing.assert_allclose(r[::2], [0.5, 0.5, 1.5, 1.5], rtol=1e-9)
    np.testing.assert_allclose(np.abs(r[1::2]), F, rtol=1e-9)
    for mu in ((0.999 * 2.0 * F, 1.0), (1.0, 0.999 * F / 1.5)):
        W, q, friction = pyramid(*mu)
        r, info = coulomb.solve(W, q, friction, tol=TOL)
        assert info.converged
        assert violation(W, q, friction, r) < 1e-9
        assert np.abs(W @ r + q).max() > 1e-5  # it slips


@pytest.mark.parametrize("mu", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("supports", [(-1.0, 0.0, 1.0), (-1.0, -0.2, 0.1, 0.7, 1.0), (0.5, 0.5, -1.0)])
def test_redundant_supports_of_a_rigid_body(supports, mu):
    """A block falls upon three or five supports: W has rank 3. Sum and moment of the impulses are unique, to 1e-9."""
    at, mass, inertia = np.array(supports), 2.0, 0.5
    H = np.zeros((2 * at.size, 3))
    H[::2, 1], H[::2, 2], H[1::2, 0], H[1::2, 2] = 1.0, at, -1.0, -0.4
    W, q = delassus(H, np.array([mass, mass, inertia]), np.array([0.0, -1.0, 0.0]))
    friction = np.full(at.size, mu)
    r, info = coulomb.solve(W, q, friction, tol=TOL)
    assert info.converged
    assert violation(W, q, friction, r) < 1e-9
    np.testing.assert_allclose(H.T @ r, [0.0, mass, 0.0], atol=1e-9)


# Cones saturated exactly.


@given(SEED, st.lists(st.floats(0.01, 2.0), min_size=1, max_size=30))
def test_slipping_contacts_lie_on_the_cone_to_the_last_bit(seed, mu):
    """|r_t| == mu r_n as floating-point numbers where a contact slides, never more where it does not.

    Definite W like these, of up to thirty contacts with mu up to 2 and diag(W) over four decades, are solved but for
    one in 6,000; that one does not count.
    """
    W, q, mu = random_problem(seed, mu)
    r, info = coulomb.solve(W, q, mu, tol=TOL)
    edge, u, s = mu * r[::2], W @ r + q, np.sqrt(np.diag(W))
    assert (np.abs(r[1::2]) <= edge).all()
    assume(info.converged)
    slides = (np.abs(u / s)[1::2] > 1e-6 * np.linalg.norm(q / s)) & (r[::2] > 0.0)
    np.testing.assert_array_equal(r[1::2][slides], -np.sign(u[1::2][slides]) * edge[slides])


@pytest.mark.parametrize("mu", [0.5, 0.3, 2.0])
@pytest.mark.parametrize("ulp", [-1, 0, 1])
def test_a_push_of_exactly_mu_p(mu, ulp):
    """On the edge of sliding, and one floating-point number to either side: r = (p, -mu p), u = 0, to 1e-12."""
    push = mu if ulp == 0 else np.nextafter(mu, ulp * np.inf)
    r, info = coulomb.solve(np.eye(2), np.array([-1.0, push]), np.array([mu]), tol=1e-12)
    assert info.converged
    np.testing.assert_allclose(r, [1.0, -mu], atol=1e-12)
    assert abs(r[1]) <= mu * r[0]


# The library.

GROUPS = {
    "discs": "packings, R/h = 5",
    "fine": "packings, R/h = 8",
    "dense": "packings of 30 and 100 discs",
    "lid": "packings, lid takes 1/8 cell a step",
    "shared": "packings, shared-grid contact",
    "nodes": "boxes at shared nodes",
    "boundaries": "boxes at outlines",
    "block": "block on a wall",
    "heavy": "disc on discs 1e4 times lighter",
    "ride": "carried disc, grid rebuilt at every step",
    "rigid": "rigid discs of an initial packing",
    "bodies": "20 random rigid bodies, friction 1",
}
STEPS = {  # at most so many Newton steps, from either start: about half as much again as it takes
    "discs": 55,
    "fine": 45,
    "dense": 30,
    "lid": 200,
    "shared": 6,
    "nodes": 40,
    "boundaries": 250,
    "block": 20,
    "heavy": 50,
    "ride": 40,
    "rigid": 45,
    "bodies": 400,
}
LIBRARY = sorted(path.stem for path in FOLDER.glob("*.npz"))


def group(name):
    """The group of a problem."""
    return next(g for g in GROUPS if g in name)


@cache
def solved(name, warm):
    """Contacts, Newton steps, whether it converged, violation of the laws, milliseconds."""
    p = load(Path(FOLDER) / f"{name}.npz")
    began = process_time()
    r, info = p.solve(warm=warm, tol=TOL)
    took, W, q, k = 1e3 * (process_time() - began), p.W, p.q, p.q.size
    worst = 0.0
    if p.bilateral is not None:
        rest = W[k:] @ np.concatenate([r, info.bilateral]) + p.bilateral.q
        scale = np.sqrt(np.abs(W.diagonal()[k:]))
        size = np.linalg.norm(q / np.sqrt(W.diagonal()[:k]))
        worst = float(np.linalg.norm(rest / np.where(scale > 0.0, scale, 1.0)) / size)
        W, q = W[:k, :k], q + W[:k, k:] @ info.bilateral
    worst = max(worst, violation(W, q, p.mu, r))
    return p.mu.size, info.iterations, info.converged, worst, took


@pytest.mark.parametrize("warm", [False, True])
@pytest.mark.parametrize("name", LIBRARY)
def test_library(name, warm):
    """Saved problems of real runs, cold and from the run's own impulses: to 1e-10, the laws themselves to 1e-9.

    Newton steps stay below those of STEPS. Some have the bilateral unknowns of geometric stiffness.
    """
    _, steps, converged, worst, _ = solved(name, warm)
    assert converged
    assert worst < 1e-9
    assert steps <= STEPS[group(name)]


def test_library_is_there():
    """Of every group at least one problem; all together less than 1.5 MB."""
    assert {group(name) for name in LIBRARY} == set(GROUPS)
    assert sum(path.stat().st_size for path in FOLDER.glob("*.npz")) < 1.5e6


# Public problems, and a plain Gauss-Seidel method.


@pytest.mark.parametrize("name", ["discs_mu0.5_fraction0.75_0.5us", "ride", "bodies_mu1.0_300"])
def test_a_plain_gauss_seidel_method_agrees(name):
    """Within 10,000 sweeps it obeys all laws to 1e-8 |q|; its impulses are those of the solver to 1e-4."""
    p = load(FOLDER / f"{name}.npz")
    W = p.W[: p.q.size, : p.q.size].tocsr()
    newton, info = coulomb.solve(W, p.q, p.mu, tol=TOL)
    r, sweeps, _ = siconos.gauss_seidel(W, p.q, p.mu, tol=1e-8)
    s = np.sqrt(W.diagonal())
    assert info.converged
    assert sweeps < siconos.SWEEPS
    assert violation(W, p.q, p.mu, newton) < 1e-9
    assert violation(W, p.q, p.mu, r) < 1e-8
    np.testing.assert_allclose(s * r, s * newton, atol=1e-4 * np.abs(s * newton).max())


@cache
def swept(name):
    """Violation of the laws by Gauss-Seidel after its 10,000 sweeps, and by Newton's method."""
    p = load(FOLDER / f"{name}.npz")
    W = p.W[: p.q.size, : p.q.size].tocsr()
    sweeps, *_ = siconos.gauss_seidel(W, p.q, p.mu, tol=TOL)
    newton, info = coulomb.solve(W, p.q, p.mu, tol=TOL)
    return violation(W, p.q, p.mu, sweeps), violation(W, p.q, p.mu, newton), info.iterations


@pytest.mark.parametrize("name", [n for n in LIBRARY if group(n) == "heavy"])
def test_sweeps_do_not_solve_a_heavy_disc_on_light_ones(name):
    """Masses differ by 1e4: after 10,000 sweeps the laws are violated by 1e-2 |q| and more; the solver obeys them."""
    sweeps, newton, _ = swept(name)
    assert sweeps > 1e-2
    assert newton < 1e-9


def test_reads_a_file_of_siconos(tmp_path):
    """Two contacts; entries column by column, then q and mu on a line each."""
    W, q, mu = np.diag([2.0, 3.0, 4.0, 5.0]), [-1.0, 0.5, 2.0, 0.25], [0.5, 0.25]
    W[0, 3] = W[3, 0] = -1.5
    lines = ["2", "2", "2", "4", "4", "2", "CSparse Version 3.1.9", "4-by-4, nzmax: 6 nnz: 6, 1-norm: 6.5"]
    for j, column in enumerate(W.T):
        lines += [f"    col {j} : locations 0 to 1", *(f"      {i} : {column[i]:g}" for i in np.flatnonzero(column))]
    lines += ["  ".join(f"{x:.24e}" for x in values) + " " for values in (q, mu)]
    (tmp_path / "problem.dat").write_text("\n".join(lines) + "\n")
    found = siconos.read(tmp_path / "problem.dat")
    np.testing.assert_array_equal(found[0].toarray(), W)
    np.testing.assert_array_equal(found[1], q)
    np.testing.assert_array_equal(found[2], mu)


def test_siconos_problems_are_solved_to_where_sweeps_stall():
    """As docs/verification shows: the laws to 1e-9 |q|; sweeps reach 1e-6, but of two problems not 1e-8."""
    table = siconos.kept()
    assert [line.contacts for line in table] == [667, 2020, 7002]
    for line in table:
        assert line.violation < 1e-9
        assert line.sweeps < siconos.SWEEPS
        assert (line.least > 1e-8) is (line.lowest < 0.0) is (line.contacts > 667)


# The table and its figure.

TRIALS = 2000


def trials(rank):
    """Random problems of up to five contacts: how many are solved, the largest violation, and how many solutions."""
    draw, worst, found, counts = np.random.default_rng(4), 0.0, 0, []
    for seed in range(TRIALS):
        mu = np.where(draw.random(draw.integers(1, 6)) < 0.2, 0.0, 1.0)
        mu = mu * draw.uniform(0.0, 2.0, mu.size)
        W, q, mu = random_problem(seed, mu, rank=rank and min(rank, 2 * mu.size))
        r, info = coulomb.solve(W, q, mu, tol=TOL)
        found += info.converged
        worst = max(worst, violation(W, q, mu, r)) if info.converged else worst
        if rank is None and seed < TRIALS // 10:
            counts.append(len(enumerated(W, q, mu)))
    return found, worst, counts


def measured(name):
    """The library's problems of a group, cold and warm."""
    return [[solved(n, warm) for n in LIBRARY if group(n) == name] for warm in (False, True)]


def library_row(name):
    """One line of the table."""
    cold, warm = measured(name)
    both = [*cold, *warm]
    steps = [f"{f([x[1] for x in found]):g}" for found in (cold, warm) for f in (median, max)]
    failed = sum(not x[2] for x in both)
    met = "met" if failed == 0 and max(x[1] for x in both) <= STEPS[name] else f"missed by {failed} of {len(both)}"
    contacts = f"{min(x[0] for x in cold)} to {max(x[0] for x in cold)}"
    cells = [f"{len(cold)}", contacts, f"{max(x[3] for x in both):.1g}", *steps, f"{STEPS[name]}"]
    return Row(
        GROUPS[name],
        "Signorini's and Coulomb's laws, contact by contact",
        "library",
        tabulated(OF_LIBRARY, {"": [*cells, f"{max(x[4] for x in both):.0f}"]}),
        "-",
        f"natural map 1e-10 within the limit of Newton steps: {met}",
        "test_library",
    )


def siconos_row(line):
    """One line of the table: a problem of Siconos."""
    cells = [f"{line.steps}", f"{line.violation:.1g}", f"{1e-3 * line.milliseconds:.2g}", f"{line.sweeps}"]
    cells += [f"{line.least:.1g}", f"{line.ratio:.2g}", f"{line.lowest:.1g}"]
    return Row(
        "rigid discs that flow, from Siconos",
        "a plain Gauss-Seidel method (siconos.py); data of github.com/siconos/siconos, FrictionContact/test/data",
        f"{line.contacts} contacts",
        tabulated(OF_SICONOS, {"": cells}),
        "-",
        f"laws to 1e-9 of the norm of q: {'met' if line.violation < 1e-9 else 'missed'}",
        "test_siconos_problems_are_solved_to_where_sweeps_stall",
    )


def heavy_row():
    """One line of the table: where masses differ much, sweeps do not converge."""
    found = [swept(name) for name in LIBRARY if group(name) == "heavy"]
    sweeps, newton, steps = zip(*found, strict=True)
    lines = {
        f"{siconos.SWEEPS} sweeps, least and most": [f"{min(sweeps):.1g}", f"{max(sweeps):.1g}"],
        f"at most {max(steps)} Newton steps": ["-", f"{max(newton):.1g}"],
    }
    return Row(
        GROUPS["heavy"],
        "a plain Gauss-Seidel method (siconos.py)",
        f"{len(found)} problems",
        tabulated(["least violation / norm of q", "most"], lines),
        "-",
        f"laws to 1e-9 of the norm of q: {'met' if max(newton) < 1e-9 else 'missed'}",
        "test_sweeps_do_not_solve_a_heavy_disc_on_light_ones",
    )


OF_SICONOS = (
    "Newton steps",
    "violation / norm of q",
    "time [s]",
    "sweeps",
    "least violation by sweeps",
    "time over that of sweeps",
    "lowest over highest eigenvalue",
)
RANDOM = "solved", "violation / norm of q"
OF_LIBRARY = (
    "problems",
    "contacts",
    "violation / norm of q",
    "Newton steps, cold",
    "most",
    "warm",
    "most",
    "limit",
    "most ms",
)


def rows():
    """What docs/verification shows of this module."""
    found, worst, counts = trials(None)
    singular, worst_singular, _ = trials(3)
    several = sum(count > 1 for count in counts)
    return [
        Row(
            "one to five contacts",
            "every contact open, sticking or slipping: all combinations",
            f"{TRIALS} random problems, {len(counts)} enumerated; mu in [0, 2], W definite, diag(W) over 4 decades",
            tabulated((*RANDOM, "several solutions"), {"random": [f"{found}", f"{worst:.1g}", f"{several}"]}),
            "-",
            f"all, 1e-9: {'met' if found == TRIALS and worst < 1e-9 and min(counts) > 0 else 'missed'}",
            "test_finds_one_of_the_enumerated_solutions",
        ),
        Row(
            "redundant contacts",
            "the laws themselves; a motion that opens all contacts exists",
            f"{TRIALS} random problems, W of rank 3",
            tabulated(RANDOM, {"random": [f"{singular}", f"{worst_singular:.1g}"]}),
            "-",
            f"all, 1e-8: {'met' if singular == TRIALS and worst_singular < 1e-8 else 'missed: Newton cycles'}",
            "test_solves_what_has_a_solution_when_contacts_are_redundant",
        ),
        *(library_row(name) for name in GROUPS),
        *(siconos_row(line) for line in siconos.kept()),
        heavy_row(),
    ]


def figures(folder):
    """Draw the Newton steps that each problem of the library takes."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    fig, axis = plt.subplots(figsize=(7, 4), layout="constrained")
    for i, name in enumerate(GROUPS):
        for found, marker, label in zip(measured(name), ("o", "x"), ("cold", "warm"), strict=True):
            steps = [max(x[1], 0.8) for x in found]
            at = i + np.linspace(-0.25, 0.25, len(steps)) if len(steps) > 1 else [i]
            axis.semilogy(at, steps, marker, color="C0" if marker == "o" else "C1", ms=5, mfc="none", label=label)
        axis.hlines(STEPS[name], i - 0.4, i + 0.4, color="k", lw=1, ls=":")
    axis.set(xticks=range(len(GROUPS)), ylabel="Newton steps to 1e-10")
    axis.set_xticklabels(GROUPS, rotation=25, ha="right")
    axis.legend(*(x[:2] for x in axis.get_legend_handles_labels()), fontsize=8, loc=(0.36, 0.85))
    fig.savefig(folder / "contact_solver.png", dpi=120)
    plt.close(fig)
    return {
        "contact_solver.png": "Newton steps that the library's contact problems take to a residual of 1e-10, from"
        " nothing (cold) and from the run's own impulses (warm), 0 drawn as 0.8; dotted: the tests' limits."
    }
