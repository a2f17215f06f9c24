"""Geometric stiffness of contact: second derivative of gaps by differences, bilateral unknowns beside contacts."""

from importlib import import_module

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm import (
    Body,
    NeoHookean,
    Periodic,
    Rigid,
    Scene,
    Scheme,
    Wall,
    contact,
    coulomb,
    disc,
    ellipse,
    initial,
    packing,
    simulate,
)
from skmpm import step as one_step
from skmpm.step.contact_stiffness import contact_stiffness, loaded

GEL = NeoHookean(1e6, 0.3, 1000.0)
R, CELL, DT = 1e-3, 0.2e-3, 1e-5


def pair(apart=2.0, friction=0.0, **options):
    bodies = [
        Body(disc((0, 0), R, spacing=CELL / 2), GEL),
        Body(disc((apart * R, 0.3 * R), 0.8 * R, spacing=CELL / 2), GEL),
    ]
    return Scene(bodies, cell=CELL, friction=friction, **options)


def linearised(scene):
    """The contact law of a scene at rest, and its number of unknowns."""
    state = initial(scene)
    grid = state.derived.assembly.grid
    return contact.point_to_curve(scene, state, grid, DT), 2 * grid.nodes


@given(seed=st.integers(0, 10_000), apart=st.floats(1.776, 1.81))
def test_the_second_derivative_of_the_gap(seed, apart):
    """By differences of fourth order along a random velocity; apart = 1.775 touches.

    The third derivative of the gap jumps where a foot passes a boundary point, and short steps leave round-off: the
    best of four differences counts.
    """
    linearise, unknowns = linearised(pair(apart))
    rng = np.random.default_rng(seed)
    # A smooth motion: each body's own translation, rotation and strain.
    at = rng.standard_normal(unknowns) * 0.02
    direction = rng.standard_normal(unknowns) * 0.2
    rows = linearise(at)
    if rows.size == 0:
        return
    everywhere = np.arange(rows.size)
    tau, beta, _ = (Z @ rows.at_contact_points(direction) for Z in rows.geometric(everywhere))
    kappa, g = rows.geometry.curvature, rows.gap
    expected = -(kappa * tau**2 + 2.0 * tau * beta + g * beta**2) / (1.0 - g * kappa)
    weights = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0  # of fourth order
    errors = []
    for step in (4e-3, 2e-3, 1e-3, 5e-4):
        others = [linearise(at + steps * step * direction) for steps in (-2.0, -1.0, 0.0, 1.0, 2.0)]
        if not all(np.array_equal(other.key, rows.key) for other in others):
            return
        measured = weights @ np.array([other.gap for other in others]) / (step * DT) ** 2
        errors.append(np.abs(measured - expected))
    assert np.min(errors, axis=0).max() <= 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["compression", "tension"])
def test_the_compliance_is_the_inverse_of_that_derivative(sign):
    linearise, unknowns = linearised(pair(1.776))
    rows = linearise(np.zeros(unknowns))
    r = np.linspace(0.5, 1.0, rows.size)
    r[1:] *= sign  # cohesive contacts may be in tension
    turns = contact_stiffness(rows, r, DT, 1.0)
    assert turns.contacts.tolist() == list(range(rows.size))
    direction = np.random.default_rng(0).standard_normal(unknowns)
    zeta = turns.Z @ rows.at_contact_points(direction)
    tau, beta = np.split(zeta, 2)
    g, kappa = rows.gap, rows.geometry.curvature
    second = -(kappa * tau**2 + 2.0 * tau * beta + g * beta**2) / (1.0 - g * kappa)
    rho = -np.linalg.solve(turns.compliance.toarray(), zeta)
    assert -zeta @ rho == pytest.approx(-DT * r @ second, rel=1e-12)


@given(seed=st.integers(0, 10_000), slope=st.sampled_from([-0.8, -0.3, 0.3, 0.8]))
def test_forces_of_slipping_contacts_rotate_as_predicted(seed, slope):
    """Impulses on the cone after a small motion, along rows rebuilt, against those before and rho: second order."""
    linearise, unknowns = linearised(pair(1.776, friction=abs(slope)))
    rng = np.random.default_rng(seed)
    at, direction = rng.standard_normal((2, unknowns)) * [[0.02], [0.2]]
    rows = linearise(at)
    r = np.outer(rng.uniform(0.5, 1.0, rows.size), [1.0, slope]).ravel()
    turns = contact_stiffness(rows, r, DT, 1.0)
    assert turns.contacts.size == rows.size
    rho = -np.linalg.solve(turns.compliance.toarray(), turns.Z @ rows.at_contact_points(direction))
    errors = []
    for step in (1e-2, 1e-3):
        other = linearise(at + step * direction)
        if not np.array_equal(other.key, rows.key):
            return
        if not np.array_equal(other.geometry.stencil, rows.geometry.stencil):
            return  # a foot went on to the next cubic, whose curvature is another
        predicted = rows.at_nodes(rows.D.T @ r + turns.acting.T @ (step * rho))
        turned = other.H.T @ turns.rotated_impulses(r, step * rho)
        errors.append(np.abs(turned - predicted).max() / np.abs(turned - rows.H.T @ r).max())
    assert errors[1] < 1e-3
    assert errors[1] < 0.3 * errors[0] or errors[1] < 1e-6


def test_walls_and_unloaded_or_sticking_contacts_turn_nothing():
    scene = pair(1.776, friction=0.5, walls=[Wall((0, -R), (0, 1), friction=0.5)])
    linearise, unknowns = linearised(scene)
    rows = linearise(np.zeros(unknowns))
    r = np.tile([1.0, 0.5], rows.size)  # on the cone
    r[0] = 0.0
    r[3] = 0.2  # sticks
    chosen = contact_stiffness(rows, r, DT, 1.0).contacts
    assert (rows.bodies[1] == -1).any()
    assert set(chosen) == set(np.flatnonzero(rows.bodies[1] >= 0)) - {0, 1}
    assert set(loaded(rows, r)) == set(chosen) | {1}
    assert contact_stiffness(rows, np.zeros_like(r), DT, 1.0) is None


@given(seed=st.integers(0, 10_000), mu=st.sampled_from([0.0, 0.6]), m=st.integers(1, 3))
def test_linear_unknowns_are_those_eliminated(seed, mu, m):
    """With a definite compliance C they can be eliminated by hand: W - B' C^-1 B, q - B' C^-1 p."""
    rng = np.random.default_rng(seed)
    k = 4
    size = 2 * k if mu else k
    root = rng.standard_normal((size + m, size + m))
    whole = root @ root.T + 0.1 * np.eye(size + m)
    W, B, C = whole[:size, :size], whole[size:, :size], whole[size:, size:]
    q, p = rng.standard_normal(size), rng.standard_normal(m)
    r, info = coulomb.solve(whole, q, np.full(k, mu), tol=1e-10, bilateral=coulomb.Bilateral(p))
    assert info.converged
    assert np.abs(B @ r + C @ info.bilateral + p).max() <= 1e-7
    inverse = np.linalg.inv(C)
    reduced = W - B.T @ inverse @ B
    u = reduced @ r + q - B.T @ inverse @ p
    assert coulomb.residual(r, u, np.full(k, mu), np.diag(reduced)) <= 1e-6


def test_newton_takes_half_the_iterations(monkeypatch):
    """Two frictionless discs, squeezed off centre and turning about each other, with and without."""

    def iterations():
        walls = [Wall((0, -R), (0, 1)), Wall((0, 1.1 * R), (0, -1), velocity=(0, -4.0))]
        walls += [Wall((-R, 0), (1, 0)), Wall((2.58 * R, 0), (-1, 0), velocity=(-4.0, 0))]
        states = simulate(pair(1.776, walls=walls), dt=DT, until=10 * DT)
        return np.mean([state.report.newton for state in states])

    consistent = iterations()
    contact = import_module("skmpm.step.contact_solve")
    monkeypatch.setattr(contact, "contact_stiffness", lambda *arguments: None)
    assert consistent < 0.8 * iterations()


def between_three(middle):
    """Three soft discs that walls press on a free rigid body."""
    at = [np.array([np.cos(a), np.sin(a)]) for a in (0.1, 2.2, 4.3)]
    bodies = [Body(middle, Rigid(1000.0)), *(Body(disc(2.0 * R * n, R, spacing=CELL / 2), GEL) for n in at)]
    walls = [Wall(3.0 * R * n, -n, velocity=-100.0 * R * n) for n in at]
    return Scene(bodies, cell=CELL, walls=walls)


@pytest.mark.parametrize(
    "middle",
    [disc((0, 0), R, spacing=CELL / 2), ellipse((0, 0), (R, 0.97 * R), spacing=CELL / 2)],
    ids=["disc", "ellipse"],
)
def test_impulses_on_a_rigid_body_turn_as_predicted(middle, monkeypatch):
    """By central differences: the body moves, turns, and soft discs around it deform. Gaps over R are the error."""
    newton, found = import_module("skmpm.step.newton"), []
    monkeypatch.setattr(newton, "solve", lambda *a, solve=newton.solve: found.append(solve(*a)) or found[-1])
    scene = between_three(middle)
    state = initial(scene)
    for _ in range(6):
        state = one_step(scene, state, 1e-4, scheme=Scheme(newton_tol=1e-9, gap_tol=1e-9, contact_tol=1e-10))
    contact = found[-1][0].contact
    rows, increment = contact.constraints, contact.increment
    turns = contact_stiffness(rows, contact.r, increment.dt, 1.0, contact.scalar_motion)
    x = increment.grid.position
    strain = np.stack([0.3 * x[0] + 0.1 * x[1], 0.3 * x[0] - 0.2 * x[1]]).T.ravel()
    for nodes, scalars in ((strain, (0, 0, 0)), (0.0 * strain, (R, -0.5 * R, 0)), (0.0 * strain, (0, 0, R))):
        direction = increment.with_scalars(nodes, np.array(scalars, dtype=float))
        of_scalars = turns.Z_scalars @ increment.of_scalars(direction)
        rates = turns.Z @ rows.at_contact_points(increment.on_nodes(direction)) + of_scalars
        rho = -np.linalg.solve(turns.compliance.toarray(), rates)
        predicted = contact.pushed(0.0 * contact.r, turns.acting.T @ rho, turns.acting_scalars.T @ rho)
        size = 1e-4 / increment.dt
        ends = [contact.at(contact.moving + sign * size * direction) for sign in (-1.0, 1.0)]
        assert all(np.array_equal(end.constraints.key, rows.key) for end in ends)
        measured = (ends[1].pushed(contact.r) - ends[0].pushed(contact.r)) / (2.0 * size)
        assert np.abs(measured - predicted).max() <= 1e-3 * np.abs(measured).max()


def test_rigid_grains_of_a_packing_take_few_iterations():
    """Without what they add to the geometric stiffness three of these steps do not end in equilibrium."""
    rng = np.random.default_rng(0)
    found = packing(rng.uniform(0.8e-3, 1.2e-3, 8), 6e-3, solid_fraction=0.8, periodic=True, seed=0)
    bodies = [
        Body(disc(c, r, spacing=0.15e-3), Rigid(1000.0) if i < 4 else GEL)
        for i, (c, r) in enumerate(zip(found.centres.T, found.radii, strict=True))
    ]
    box = Periodic(found.width, found.height, rate=[[-0.01, 0.0], [0.0, -0.01]])
    scheme = Scheme(inertia=False, newton_tol=1e-6)
    reports = [s.report for s in simulate(Scene(bodies, cell=CELL, periodic=box), dt=1.0, until=5.0, scheme=scheme)]
    assert len(reports) == 5
    assert sum(each.newton for each in reports) <= 8 * sum(each.solves for each in reports)
