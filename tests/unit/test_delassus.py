"""The Delassus operator of contact points against solves with the whole matrix, in any order of extension."""

import numpy as np
import pytest
import scipy.sparse as sp

from skmpm import Body, NeoHookean, Scene, disc, initial, linear
from skmpm.linear import delassus

GEL = NeoHookean(1e6, 0.3, 1000.0)
CELL = 0.2e-3


class Counting:
    """A solver that counts the rows it is asked for."""

    def __init__(self, solver):
        self.solver, self.asked = solver, []

    def delassus(self, rows):
        """Counted."""
        self.asked.append(rows.shape[0])
        return self.solver.delassus(rows)


@pytest.fixture(params=[linear.banded, linear.direct])
def bodies(request):
    """A counted solver, an oracle, places (all points of three discs and one that does not respond), their bodies."""
    discs = [Body(disc((2.5e-3 * i, 0.3e-3 * i), 1e-3, spacing=CELL), GEL) for i in range(3)]
    assembly = initial(Scene(discs, cell=CELL)).derived.assembly
    grid = assembly.grid
    F = np.eye(2)[:, :, None] + np.zeros(grid.local.shape[1])
    A = assembly.matrix(assembly.stiffness(GEL.tangent(F)), 1e-12)
    made = [kind(A, grid.blocks, grid.rigid_motions) for kind in (request.param, linear.direct)]
    base = sp.csr_array(sp.vstack([grid.interpolation, sp.csr_array((1, grid.nodes))], format="csr"))
    owner = np.append(grid.cell_body[grid.cell_of_point], 0)
    return Counting(made[0]), made[1], base, owner


def combinations(seed, owner, count=6):
    """Rows that combine five places of two bodies each, and the last place, which does not respond."""
    rng, body = np.random.default_rng(seed), np.repeat(owner[:-1], 2)
    dense = np.zeros((count, 2 * owner.size))
    for row in dense:
        pair = rng.choice(3, 2, replace=False)
        row[rng.choice(np.flatnonzero(np.isin(body, pair)), 5)] = rng.normal(size=5)
    dense[:, -1] = 1.0
    return sp.csr_array(dense)


def test_rows_of_three_bodies_are_refused(bodies):
    solver, _, base, owner = bodies
    rows = sp.csr_array(
        (np.ones(3), ([0, 0, 0], [0, base.shape[0], 2 * base.shape[0] - 4])), shape=(1, 2 * owner.size)
    )
    with pytest.raises(ValueError, match="more than two bodies"):
        delassus.Delassus.with_factor(solver, base, owner).between(rows, rows)


def test_rows_respond_as_the_whole_matrix_says(bodies):
    solver, oracle, base, owner = bodies
    found = delassus.Delassus.with_factor(solver, base, owner)
    R = sp.kron(base, np.eye(2), format="csr")
    for seed in range(4):
        left, right = combinations(seed, owner), combinations(seed + 10, owner, count=3)
        W, found = found.between(left, right)
        expected = (left @ R) @ oracle((right @ R).T.toarray())
        assert W.has_sorted_indices and W.shape == (6, 3)
        assert np.abs(W.toarray() - expected).max() <= 1e-11 * np.abs(expected).max()


def test_only_bodies_with_new_places_are_asked_again(bodies):
    solver, _, base, owner = bodies
    found = delassus.Delassus.with_factor(solver, base, owner)
    m = base.shape[0]
    chosen = [np.flatnonzero(owner[:-1] == b)[:3] for b in range(3)]
    first = sp.csr_array(np.eye(2 * m)[2 * np.concatenate(chosen[:2])])
    _, found = found.between(first, first)
    _, found = found.between(first, first)
    assert solver.asked == [12], "two components of three places of two bodies, once"
    third = sp.csr_array(np.eye(2 * m)[2 * chosen[2]])
    _, found = found.between(third, first)
    assert solver.asked == [12, 6]
    more = sp.csr_array(np.eye(2 * m)[2 * np.flatnonzero(owner[:-1] == 0)[3:4]])
    _, found = found.between(more, more)
    assert solver.asked == [12, 6, 8], "all known places of the body, and the new one"
