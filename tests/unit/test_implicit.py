"""Newton's method: geometric stiffness of contact, indefinite matrices, momentum correction, failures."""

import re
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from skmpm import (
    Body,
    LinearElastic,
    NeoHookean,
    Scene,
    Scheme,
    StepFailed,
    Support,
    Wall,
    box,
    coulomb,
    disc,
    initial,
    linear,
    simulate,
    step,
)
from skmpm.linear import band
from skmpm.linear.corrected import without_added_mass
from skmpm.step import contact_solve
from skmpm.step.bulk import Bulk
from skmpm.step.contact_stiffness import ContactStiffness
from skmpm.step.equations import Increment
from skmpm.step.factor import Refactorisation
from skmpm.step.matrix import solver_of
from skmpm.step.rotation import drift, matrix_turns, turned_solver, with_balanced_momentum

R = 1e-3


def squeezed(friction=0.5):
    gel = NeoHookean(E=10e6, nu=0.45, density=990.0)
    bodies = [Body(disc((0.2 * y, y), R, spacing=R / 6), gel) for y in (R, 2.97 * R)]
    walls = [Wall((0, 0), (0, 1)), Wall((0, 3.97 * R), (0, -1), velocity=(0, -1.0))]
    return Scene(bodies, cell=R / 4, walls=walls, friction=friction)


def last(scene, steps=12, scheme=None):
    *_, state = simulate(scene, dt=8e-6, until=steps * 8e-6, scheme=scheme or Scheme.accurate())
    return state


QUASISTATIC = Scheme(inertia=False)


def test_with_inertia_the_stiffness_that_failed_is_tried_again(monkeypatch):
    """A step whose first contact solve fails with geometric stiffness converges as one in which none does."""
    expected, most, failures, solve = last(squeezed(0.0), 6), contact_solve.MAX_STEPS, [], contact_solve.solve
    converged, inner = [], coulomb.solve

    def noted(*arguments, **options):
        found = inner(*arguments, **options)
        converged.append(found[1].converged)
        return found

    def failing_at_first(contact, *arguments):
        converged.clear()
        first = contact.problem.known.normal is None
        monkeypatch.setattr(contact_solve, "MAX_STEPS", 0 if first else most)
        found = solve(contact, *arguments)
        failures.append((first, not all(converged)))
        return found

    monkeypatch.setattr(coulomb, "solve", noted)
    monkeypatch.setattr(import_module("skmpm.step.newton"), "solve", failing_at_first)
    state = last(squeezed(0.0), 6)
    assert (True, True) in failures and (False, False) in failures and (False, True) not in failures
    assert state.wall_force == pytest.approx(expected.wall_force, rel=1e-5, abs=1e-6)


def test_where_the_stiffness_fails_half_of_it_is_used(monkeypatch):
    """If no contact solve succeeds with all of it, steps take fewer iterations with half of it than without."""
    newton, solve, softer = import_module("skmpm.step.newton"), contact_solve.solve, ContactStiffness.softer
    most, shares = contact_solve.MAX_STEPS, []

    def failing(*arguments):
        monkeypatch.setattr(contact_solve, "MAX_STEPS", 0)
        return solve(*arguments)

    def recorded(stiffness, share):
        monkeypatch.setattr(contact_solve, "MAX_STEPS", most)
        shares.append(share)
        return softer(stiffness, share)

    expected = last(squeezed(0.0), 6)
    monkeypatch.setattr(newton, "solve", failing)
    monkeypatch.setattr(ContactStiffness, "softer", recorded)
    half = last(squeezed(0.0), 6)
    assert set(shares) == {0.5}
    monkeypatch.setattr(ContactStiffness, "softer", softer)
    without = last(squeezed(0.0), 6)
    assert expected.report.newton <= half.report.newton < without.report.newton
    assert half.wall_force == pytest.approx(expected.wall_force, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_contact_solve_leaves_the_iterate_as_it_is(monkeypatch, friction):
    """Solved twice, an iterate gives the same direction and impulses bit for bit, and keeps its own."""
    newton, calls = import_module("skmpm.step.newton"), []

    def twice(contact, factor, configuration, gradient):
        r, delassus, key = contact.r.copy(), factor.delassus, contact.problem.known.key
        found, again = (contact_solve.solve(contact, factor, configuration, gradient) for _ in range(2))
        (direction, _), (same, _) = found, again
        assert np.array_equal(direction.direction, same.direction)
        assert np.array_equal(direction.contact.r, same.contact.r)
        assert np.array_equal(contact.r, r)
        assert factor.delassus is delassus and contact.problem.known.key is key
        calls.append(direction.contact.r.any() and not np.array_equal(direction.contact.r, r))
        return found

    monkeypatch.setattr(newton, "solve", twice)
    last(squeezed(friction))
    assert any(calls)


def test_an_indefinite_matrix_gets_mass_and_stiffness():
    calls = []

    def fails_twice(A, blocks, motions):
        calls.append(A)
        if len(calls) <= 2:  # the exact one, and that with the first mass
            raise np.linalg.LinAlgError("not positive definite")
        return linear.banded(A, blocks, motions)

    scene = squeezed()
    state = last(scene, 1, Scheme.accurate(linear=fails_twice))
    assert len(calls) == state.report.factorisations + 2
    assert state.v == pytest.approx(last(scene, 1).v, abs=1e-5)


def test_only_the_body_whose_matrix_is_indefinite_is_modified(monkeypatch):
    """Two equal discs, one compressed by 1 %, in a step for which its rotation is unstable, as below."""
    gel = NeoHookean(E=10e6, nu=0.45, density=990.0)
    scene = Scene([Body(disc((x * R, 0.0), R, spacing=R / 7), gel) for x in (0.1, 3.1)], cell=R / 5)
    assembly, dt = initial(scene).derived.assembly, 20e-6
    bulk, grid = Bulk(assembly, [(gel, slice(None))], None, None), assembly.grid
    centre = np.stack([grid.position[:, grid.node_body == b].mean(axis=1) for b in (0, 1)])
    inward = -0.01 * (grid.position.T - centre[grid.node_body]) * (grid.node_body == 1)[:, None]
    at, still = bulk.at(inward.ravel()), np.zeros(2 * grid.nodes)
    step = Increment(at, still, (), dt, Scheme())
    A, split = step.matrix(at).toarray(), grid.blocks[1]
    assert np.linalg.eigvalsh(A[:split, :split])[0] > 0.0 > np.linalg.eigvalsh(A[split:, split:])[0]
    inverse, factorised, of_bodies = solver_of(step, at)(np.eye(A.shape[0])), [], band._factorised
    assert inverse[:split, :split] @ A[:split, :split] == pytest.approx(np.eye(split), abs=1e-9)
    assert np.linalg.eigvalsh(inverse[split:, split:])[0] > 0.0
    monkeypatch.setattr(
        band,
        "_factorised",
        lambda factor, A, chosen: factorised.append(chosen.tolist()) or of_bodies(factor, A, chosen),
    )
    solver_of(step, at)
    assert factorised == [[True, True], [False, True]]


def test_rotation_of_a_disc_under_pressure_is_unstable_in_long_steps_and_stabilised_by_inertia():
    """Uniform compression by 1 %: A has one negative eigenvalue, for the rotation; the modified matrix has none."""
    gel = NeoHookean(E=10e6, nu=0.45, density=990.0)
    scene = Scene([Body(disc((0.1 * R, 0.0), R, spacing=R / 7), gel)], cell=R / 5)
    state = initial(scene)
    assembly, dt = state.derived.assembly, 20e-6
    bulk = Bulk(assembly, [(gel, slice(None))], None, None)
    at = bulk.at(-0.01 * assembly.grid.position.T.ravel())
    step = Increment(at, np.zeros_like(at.displacement), (), dt, Scheme())
    A = step.matrix(at).toarray()
    values, vectors = np.linalg.eigh(A)
    assert values[0] < 0.0 < values[1]
    assert np.linalg.norm(vectors[:, 0] @ la.orth(assembly.grid.rigid_motions)) > 0.95
    solver = solver_of(step, at)
    used = np.linalg.inv(solver(np.eye(A.shape[0])))
    assert np.linalg.eigvalsh(0.5 * (used + used.T))[0] > 0.0
    # c (M - M T (T'M T)^-1 T'M), T the translations: these keep their inertia to round-off.
    mass, move = assembly.mass, assembly.grid.rigid_motions[:, :2]
    relative = np.diag(mass) - np.outer(mass * move[:, 0], mass * move[:, 0]) / mass[::2].sum()
    relative -= np.outer(mass * move[:, 1], mass * move[:, 1]) / mass[::2].sum()
    c = np.sum((used - A) * relative) / np.sum(relative**2)
    assert 0.1 < c < 1.0
    assert np.abs(used - A - c * relative).max() < 1e-9 * np.abs(A).max()
    assert np.abs(used @ move - mass[:, None] * move).max() < 1e-9 * mass.max()


def test_the_delassus_operator_with_added_mass_is_that_of_its_own_inverse():
    """The operator of the corrected solver against solves, at points of two bodies."""
    scene = squeezed()
    state = initial(scene)
    assembly = state.derived.assembly
    grid, mass = assembly.grid, assembly.mass
    c = np.array([0.7, 0.0])[: grid.bodies]
    inner = linear.direct(sp.bsr_array(np.diag((1.0 + np.repeat(c[grid.node_body], 2)) * mass)), grid.blocks, None)
    total = grid.sums(mass[None, ::2])[0]
    solver = without_added_mass(inner, grid.blocks, c * total, total)
    H = sp.csr_array(sp.kron(grid.interpolation[[0, 5, -1]], np.eye(2), format="csr"))
    wanted = H @ solver(H.T.toarray())
    assert solver.delassus(H).toarray() == pytest.approx(wanted, rel=1e-12, abs=1e-14 * np.abs(wanted).max())
    move = grid.rigid_motions[:, :2]
    assert solver(mass[:, None] * move) == pytest.approx(move, abs=1e-12)


def compressed_disc(dt):
    """A disc under uniform compression by 1 %: the equations of a step, the configuration and the matrix."""
    gel = NeoHookean(E=10e6, nu=0.45, density=990.0)
    scene = Scene([Body(disc((0.1 * R, 0.0), R, spacing=R / 7), gel)], cell=R / 5)
    assembly = initial(scene).derived.assembly
    bulk = Bulk(assembly, [(gel, slice(None))], None, None)
    at = bulk.at(-0.01 * assembly.grid.position.T.ravel())
    still = np.zeros_like(at.displacement)
    step = Increment(at, still, (), dt, Scheme())
    return step, at, step.matrix(at).toarray()


def test_the_matrix_turns_with_the_body():
    """The factorised matrix of a disc, turned by 0.3 rad, against that of the disc turned by as much."""
    step, at, _ = compressed_disc(2e-6)
    angle = 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    x = step.grid.position + at.displacement.reshape(-1, 2).T
    new = step.bulk.at((turn @ x - step.grid.position).T.ravel())
    turned = turned_solver(step, solver_of(step, at), at.displacement, new.displacement)
    assert turned.angle == pytest.approx(angle, abs=1e-12)
    b = np.random.default_rng(0).normal(size=(x.size, 2))
    wanted = solver_of(step, new)(b)
    assert turned(b) == pytest.approx(wanted, abs=1e-9 * np.abs(wanted).max())
    assert turned(b[:, 0]) == pytest.approx(turned(b)[:, 0], rel=1e-12)
    H = sp.csr_array(sp.kron(step.grid.interpolation[[0, 5, -1]], np.eye(2), format="csr"))
    operator = H @ turned(H.T.toarray())
    assert turned.delassus(H).toarray() == pytest.approx(operator, rel=1e-9, abs=1e-12 * np.abs(operator).max())
    rows = turned.turned_back(H, step.grid.node_body)
    assert (rows @ rows.T).toarray() == pytest.approx((H @ H.T).toarray(), abs=1e-12)


@pytest.mark.parametrize(("material", "turns"), [(NeoHookean, True), (LinearElastic, False)])
def test_only_the_matrix_of_a_free_body_of_nonlinear_material_turns(material, turns):
    gel = material(E=10e6, nu=0.45, density=990.0)
    assembly = initial(Scene([Body(disc((0.1 * R, 0.0), R, spacing=R / 7), gel)], cell=R / 5)).derived.assembly
    still = np.zeros(2 * assembly.grid.nodes)
    step = Increment(Bulk(assembly, [(gel, slice(None))], None, None).at(still), still, (), 1e-6, Scheme())
    assert matrix_turns(step) == turns


@pytest.mark.parametrize(("iterations", "dt"), [(1, 1e-5), (2, 4e-5), (1, 8e-5), (3, 8e-5)])
def test_a_failure_names_the_criteria_that_are_not_met_and_no_other(iterations, dt):
    """It once named an out-of-balance force and a residual that were both below their tolerances."""
    scene, scheme = squeezed(), Scheme.accurate(max_newton=iterations)
    with pytest.raises(StepFailed, match=r"no convergence in \d Newton iterations: ") as failure:
        step(scene, last(scene, 4), dt, scheme=scheme)
    found = re.findall(r"(?:force|residual) (\S+) \(tolerance (\S+?)\)", str(failure.value))
    assert found
    assert all(float(value) > float(tolerance) for value, tolerance in found)
    found = np.array(re.findall(r"(?:body|bodies) \d.*? near \((\S+), (\S+)\) m", str(failure.value)), dtype=float)
    assert found.size
    points, places = failure.value.state.x.T, found[:, None]
    assert (np.linalg.norm(places - points, axis=2).min(axis=1) < np.sqrt(2.0) * scene.cell).all()


def test_pressed_bodies_in_long_steps_get_mass_before_a_factorisation_fails(monkeypatch):
    """With just the mass that a rotation lacks the softest mode stayed unstable."""
    matrix, calls = import_module("skmpm.step.matrix"), []
    for name in ("without_added_mass", "_solver"):
        original = getattr(matrix, name)
        monkeypatch.setattr(matrix, name, lambda *a, of=original, n=name: (calls.append(n), of(*a))[1])
    gel, speed = NeoHookean(E=10e6, nu=0.45, density=990.0), 5e-3
    walls = [
        Wall((-R * x, -R * y), (x, y), friction=0.5, velocity=(speed * x, speed * y))
        for x, y in ((0, 1), (0, -1), (1, 0), (-1, 0))
    ]
    scene = Scene([Body(disc((0.0, 0.0), R, spacing=R / 7), gel)], cell=R / 5, walls=walls)
    states = list(simulate(scene, until=0.1 * R / speed))
    assert states[-1].report.unbalanced < 1e-3
    assert calls.count("without_added_mass") >= 2
    assert calls.count("_solver") <= 1.1 * sum(state.report.factorisations for state in states)


def rates(refactorisation, norms, tol=1e-3, *, in_contact=True):
    """When a new matrix is made, for out-of-balance norms over the tolerance by iteration."""
    made, before = [], np.inf
    step = SimpleNamespace(linear=False, scheme=SimpleNamespace(newton_tol=tol))
    for i, norm in enumerate(norms):
        due = refactorisation.due(step, i, tol * norm, tol * before, norm, in_contact=in_contact)
        if i == 0 or due:
            made.append(i)
            refactorisation.made(i)
        before = norm
    return made


@pytest.mark.parametrize(
    ("norms", "made"),
    [
        ((1000.0, 5.0, 0.02), [0]),  # one more iteration converges
        ((1000.0, 18.0, 9.0, 4.5), [0, 2]),  # the matrix has become slow
        ((1000.0, 600.0, 300.0, 0.5), [0, 1, 2]),  # far from convergence
        ((22.0, 2.6, 2.5, 2.4, 2.3, 2.2), [0, 2]),  # a new one was as slow
        ((22.0, 2.6, 2.5, 0.1, 0.09), [0, 2]),
    ],
)
def test_a_new_matrix_is_made_where_the_present_one_has_become_slow(norms, made):
    assert rates(Refactorisation(), norms) == made


@pytest.mark.parametrize(
    ("norms", "made"),
    [
        ((1000.0, 70.0, 0.8), [0]),  # at the rate of the first, two more converge
        ((1000.0, 200.0, 3.6, 0.4), [0, 1]),  # not three
        ((1000.0, 100.0, 60.0, 0.5), [0, 2]),  # slower than the first
    ],
)
def test_without_contact_a_matrix_is_kept_for_as_long_as_a_new_one_takes(norms, made):
    assert rates(Refactorisation(), norms, in_contact=False) == made


def test_momentum_is_corrected_against_the_last_contact_solve_or_not_at_all():
    """Bodies under pressure respond by stiffness: at 800 us the correction by mass needs 1e-7 of contact forces."""
    scene = squeezed()
    state = last(scene, 4)
    assembly = state.derived.assembly
    bulk = Bulk(assembly, [(scene.bodies[0].material, slice(None))], None, None)
    still = np.zeros_like(state.displacement)
    short = Increment(bulk.at(state.displacement), still, (), 8e-6, Scheme())
    step = replace(short, dt=8e-4)
    grid, impulse = bulk.assembly.grid, still.copy()
    moving = np.repeat(grid.node_body == 1, 2) * 1.0
    kick = assembly.lumped * moving  # the impulse that balances its momentum
    assert drift(step, moving, impulse, impulse) == pytest.approx([0.0, np.sqrt(2.0) * 8e-4 / scene.cell])
    assert with_balanced_momentum(short, moving, impulse, kick) is None, "inertia resists in short steps"
    assert with_balanced_momentum(step, moving, impulse, impulse) is None, "too far for a correction"
    assert drift(step, moving, impulse, kick).max() < 1e-12
    assert with_balanced_momentum(step, moving, impulse, kick) == pytest.approx(moving, rel=1e-12)
    assert with_balanced_momentum(step, moving, impulse, 0.99999 * kick) == pytest.approx(0.99999 * moving, rel=1e-12)


def test_the_tolerated_energy_gain_is_relative_to_the_energy_exchanged_in_the_step():
    """Arches at rest had every twelfth step halved, for 1e-5 of an energy that did not change."""
    checks, report = import_module("skmpm.step.acceptance"), import_module("skmpm.step.terms")
    scene = squeezed()
    states = [last(scene, 2), replace(last(scene, 2), step_control=replace(last(scene, 2).step_control, halvings=9))]

    def budget(gain, exchanged):
        passed_on = 0.5 * (exchanged - gain)  # from kinetic to elastic energy
        return report.Budget(kinetic=np.array([1.0, 1.0 - passed_on]), elastic=np.array([0.0, passed_on + gain]))

    for state in states:
        checks.check_step(scene, Scheme(), state, state, budget(1e-4, 0.02))
        with pytest.raises(
            RuntimeError, match=r"gain energy without work, 10 % of the energy exchanged in the step \(tolerance 1 %"
        ):
            checks.check_step(scene, Scheme(), state, state, budget(1e-4, 1e-3))


@pytest.mark.parametrize("squeeze", [0.25, 0.3])
def test_without_inertia_the_smallest_share_of_the_gradient_stiffness_that_makes_the_matrix_definite(squeeze):
    """Of 1/16, 1/4, ... the first: the free side of a clamped box buckles."""
    scene = Scene(
        [Body(box((0.0, 0.0), (4 * R, R), spacing=R / 8), NeoHookean(1e6, 0.3, 1e3))],
        cell=R / 4,
        supports=[Support(lambda x: x[1] < 1e-9)],
    )
    derived = initial(scene).derived
    position = derived.assembly.grid.position
    bulk = Bulk(derived.assembly, [(scene.bodies[0].material, slice(None))], None, None)
    at = bulk.at((position * [[-squeeze], [0.0]]).T.ravel())
    still, kept = np.zeros(position.size), derived.supports.T.toarray()
    step = Increment(at, still, (), 1.0, Scheme(inertia=False), derived.supports, np.zeros(2), metric=still)
    G = derived.assembly.matrix(bulk.gradient_stiffness.copy(), 1.0, np.zeros((position.shape[1], 2, 2))).toarray()
    u = np.random.default_rng(1).normal(size=still.size)
    density = (derived.assembly.grid.gradient_at_points(u) ** 2).sum(axis=(0, 1)) @ derived.assembly.volume
    mu = scene.bodies[0].material.lame[1]
    assert 0.5 * u @ G @ u == pytest.approx(0.5 * mu * density + derived.assembly.ghost_energy(u), rel=1e-12)
    A, G = (kept.T @ matrix @ kept for matrix in (step.matrix(at).toarray(), G))
    free = np.flatnonzero(np.diag(G))
    more = [(A + share * G)[np.ix_(free, free)] for share in 4.0 ** np.arange(-2, 4)]
    least = int(np.argmax([np.linalg.eigvalsh(matrix)[0] > 0.0 for matrix in more]))
    assert np.linalg.eigvalsh(A[np.ix_(free, free)])[0] < 0.0 and np.linalg.eigvalsh(more[least])[0] > 0.0
    b = np.random.default_rng(0).normal(size=still.size)
    solution = solver_of(step, at, in_contact=True)(b)
    assert more[least] @ (kept.T @ solution)[free] == pytest.approx((kept.T @ b)[free], rel=1e-6, abs=1e-6)


def test_an_initial_guess_that_inverts_points_is_replaced():
    gel = NeoHookean(E=1e6, nu=0.3, density=1000.0)
    body = Body(disc((0, 0), R, spacing=R / 6), gel, velocity=lambda x: np.stack([-1.5e5 * x[0], 0.0 * x[1]]))
    state = last(Scene([body], cell=R / 4), 2)
    assert np.linalg.det(state.F.transpose(2, 0, 1)).min() > 0.0


def test_failure_reports_the_out_of_balance_force_and_keeps_the_state():
    scene = squeezed()
    start = initial(scene)
    with pytest.raises(StepFailed, match=r"body \d near .*: .*out-of-balance force .*smaller dt") as failure:
        step(replace(scene, friction=0.5), start, 8e-6, scheme=Scheme(max_newton=1))
    assert failure.value.state.t == start.t
