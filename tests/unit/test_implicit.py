"""Newton on the incremental potential: what happens where it is not plain sailing."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

from skmpm import Body, NeoHookean, Scene, Scheme, StepFailed, Wall, disc, initial, linear, simulate, step
from skmpm.implicit import Bulk, Increment, Touching, touching
from skmpm.implicit.newton import Mixing

R = 1e-3


def squeezed(friction=0.5):
    gel = NeoHookean(E=10e6, nu=0.45, density=990.0)
    bodies = [Body(disc((0.2 * y, y), R, spacing=R / 6), gel) for y in (R, 2.97 * R)]
    walls = [Wall((0, 0), (0, 1)), Wall((0, 3.97 * R), (0, -1), velocity=(0, -1.0))]
    return Scene(bodies, cell=R / 4, walls=walls, friction=friction)


def last(scene, steps=12, scheme=None):
    *_, state = simulate(scene, dt=8e-6, until=steps * 8e-6, scheme=scheme or Scheme.accurate())
    return state


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_settled_normals_give_nearly_the_same_step(monkeypatch, friction):
    """Normals of the first iteration instead of the last: the turning of surfaces within one step, some 0.1 %."""
    scene = squeezed(friction)
    expected = last(scene)
    solve = Touching.solve

    def lost(contacts, solver, gradient):
        contacts.lost = 1
        return solve(contacts, solver, gradient)

    monkeypatch.setattr(Touching, "solve", lost)
    state = last(scene)
    assert state.report.settled
    assert not expected.report.settled
    assert state.wall_force[:, 1] == pytest.approx(expected.wall_force[:, 1], rel=1e-2)
    assert state.report.overlap < 1e-4
    assert state.contacts.gap.min() > -1e-4 * scene.cell


def test_normals_are_kept_where_the_contact_solver_gives_up_on_contacts_that_turn(monkeypatch):
    """It may take no Newton step: the step is found all the same, and reported as one with kept normals."""
    monkeypatch.setattr(touching, "PATIENCE", 0)
    state = last(squeezed(0.0))
    assert state.report.settled
    assert state.report.residual < Scheme().gap_tol


def test_mixing_converges_where_plain_iteration_diverges():
    """A linear map with eigenvalues between -1.5 and 0.9: as many steps as there are different ones."""
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.normal(size=(20, 20)))[0]
    values = np.repeat([-1.5, 0.9, 0.3, -0.2], 5)
    G, fixed = basis @ (values[:, None] * basis.T), rng.normal(size=20)
    w, mixing = np.zeros(20), Mixing(np.ones(20))
    for _ in range(6):
        w = w + mixing.mixed(w, G @ (w - fixed) + fixed - w, 1.0, wanted=True)
    assert np.abs(w - fixed).max() < 1e-9


def test_an_indefinite_matrix_is_replaced_by_the_projected_one():
    calls = []

    def refuses_two(A, blocks, motions):
        calls.append(A)
        if len(calls) <= 2:  # the exact one, and with more inertia for bodies that would turn
            raise np.linalg.LinAlgError("not positive definite")
        return linear.banded(A, blocks, motions)

    scene = squeezed()
    state = last(scene, 1, Scheme.accurate(linear=refuses_two))
    assert len(calls) == state.report.linear + 2
    assert state.v == pytest.approx(last(scene, 1).v, abs=1e-5)


def test_pressure_drives_a_disc_round_in_long_steps_and_inertia_steadies_it():
    """Squeezed evenly by 1 %, A has one negative eigenvalue: that of turning; the matrix used has none."""
    gel = NeoHookean(E=10e6, nu=0.45, density=990.0)
    scene = Scene([Body(disc((0.1 * R, 0.0), R, spacing=R / 7), gel)], cell=R / 5)
    state = initial(scene)
    assembly, dt = state.derived.assembly, 20e-6
    bulk = Bulk(assembly, [(gel, slice(None))], None, None)
    at = bulk.at(-0.01 * assembly.sheets.position.T.ravel())
    step = Increment(bulk, at.displacement, np.zeros_like(at.displacement), 0.0 * at.displacement, dt, Scheme())
    A = step.matrix(at).toarray()
    values, vectors = np.linalg.eigh(A)
    assert values[0] < 0.0 < values[1]
    assert np.linalg.norm(vectors[:, 0] @ la.orth(assembly.sheets.rigid_motions())) > 0.95
    solver = step.factorised(at, projected=False)
    used = np.linalg.inv(solver(np.eye(A.shape[0])))
    assert np.linalg.eigvalsh(0.5 * (used + used.T))[0] > 0.0
    added = np.diag(used - A) / assembly.mass
    assert added.min() > 0.0 and np.ptp(added) < 1e-6 * added.mean()
    assert np.abs(used - A - np.diag(added * assembly.mass)).max() < 1e-9 * np.abs(A).max()


def test_a_start_that_turns_points_inside_out_is_shortened():
    gel = NeoHookean(E=1e6, nu=0.3, density=1000.0)
    body = Body(disc((0, 0), R, spacing=R / 6), gel, velocity=lambda x: np.stack([-1.5e5 * x[0], 0.0 * x[1]]))
    state = last(Scene([body], cell=R / 4), 2)
    assert np.linalg.det(state.F.transpose(2, 0, 1)).min() > 0.0


def test_failure_says_what_is_left_and_keeps_the_state():
    scene = squeezed()
    start = initial(scene)
    with pytest.raises(StepFailed, match=r"body \d: .*momentum imbalance .*contact residual .*smaller dt") as failure:
        step(replace(scene, friction=0.5), start, 8e-6, scheme=Scheme(max_newton=1))
    assert failure.value.state.t == start.t
