"""Large bodies: multigrid iterations do not grow with size, for any grid offset, nor memory with time."""

import gc
import tracemalloc
from functools import cache, partial

import meshio
import numpy as np
import pytest

import skmpm
from skmpm import linear
from skmpm.grid import build_grids

SPACING = 0.74  # of the points [cells]
COURANT = 10.0  # cells that a pressure wave crosses in a dynamic step


def disc(unknowns, seed, nu):
    """A disc of about that many unknowns, its centre anywhere in a cell, held at its lowest boundary points."""
    radius = np.sqrt(unknowns / (2.0 * np.pi))
    centre = np.random.default_rng(seed).uniform(size=2)
    points = skmpm.disc(centre, radius, spacing=SPACING)
    return hung(points, lambda x: x[1] < centre[1] - 0.99 * radius, nu)


def turned(unknowns, seed, nu):
    """A mesh of squares twice as long as wide, turned by any angle, held at one end."""
    rng = np.random.default_rng(seed)
    wide = round(np.sqrt(unknowns * SPACING**-2 / 16.0))  # with 2 x 2 points each
    i, j = np.meshgrid(np.arange(2 * wide + 1), np.arange(wide + 1), indexing="ij")
    node = np.arange(i.size).reshape(i.shape)
    squares = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1).reshape(-1, 4)
    angle, corner = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(size=2)
    along = np.array([np.cos(angle), np.sin(angle)])
    x = 2.0 * SPACING * (np.outer(along, i) + np.outer([-along[1], along[0]], j)) + corner[:, None]
    points = skmpm.from_mesh(meshio.Mesh(np.vstack([x, np.zeros(i.size)]).T, [("quad", squares)]))
    return hung(points, lambda x: along @ (x - corner[:, None]) < 1e-6, nu)


def hung(points, where, nu):
    gel = skmpm.LinearElastic(E=10e6, nu=nu, density=990.0)
    return skmpm.Scene([skmpm.Body(points, gel)], cell=1.0, supports=[skmpm.Support(where)], gravity=(0.0, -1e-3))


def advanced(scene, inertia, solver):
    """The body after one step from rest, and the solver of the step."""
    made = []

    def recorded(A, blocks, rigid_motions):
        made.append(solver(A, blocks, rigid_motions))
        return made[-1]

    gel = scene.bodies[0].material
    wave = np.sqrt((gel.lame[0] + 2.0 * gel.lame[1]) / gel.density)
    scheme = skmpm.Scheme(inertia=inertia, linear=recorded)
    state = skmpm.step(scene, skmpm.initial(scene, scheme=scheme), COURANT / wave, scheme=scheme)
    return state, made[-1]


@cache
def iterations(shape, unknowns, seed, nu, inertia):
    counts = []
    _, solver = advanced(shape(unknowns, seed, nu), inertia, partial(linear.amg, callback=counts.append))
    assert 0.9 * unknowns < solver.A.shape[0] < 1.2 * unknowns
    return counts[0]


@pytest.mark.parametrize("inertia", [False, True], ids=["quasi-static", "dynamic"])
@pytest.mark.parametrize("nu", [0.3, 0.45])
@pytest.mark.parametrize("shape", [disc, turned])
@pytest.mark.parametrize("seed", range(2))
def test_multigrid_needs_few_iterations_wherever_the_grid_lies(shape, seed, nu, inertia):
    """Measured: 10 to 18 for nu = 0.3, 17 to 32 for nu = 0.45; goal 40."""
    assert iterations(shape, 10_000, seed, nu, inertia) <= (22 if nu == 0.3 else 34)


@pytest.mark.parametrize("inertia", [False, True], ids=["quasi-static", "dynamic"])
@pytest.mark.parametrize("nu", [0.3, 0.45])
def test_multigrid_iterations_stay_as_the_body_grows(nu, inertia):
    """Ten times the unknowns, at most two iterations more. Goal: 40 at 1e6 unknowns, which take 16 and 27.

    With V cycles and no threshold for strong connections a third more: 20 and 28 for nu = 0.3, 32 and 47 for 0.45.
    """
    few, many = (iterations(disc, unknowns, 1, nu, inertia) for unknowns in (10_000, 100_000))
    assert many <= min(few + 2, 40)


@pytest.mark.parametrize("inertia", [False, True], ids=["quasi-static", "dynamic"])
@pytest.mark.parametrize("shape", [disc, turned])
def test_a_large_body_moves_alike_by_multigrid_and_by_the_band(shape, inertia):
    scene = shape(10_000, 4, 0.45)
    (one, _), (other, _) = (advanced(scene, inertia, solver) for solver in (linear.amg, linear.banded))
    for field in ("x", "v", "stress", "support_force"):
        a, b = getattr(one, field), getattr(other, field)
        change = b - scene.initial_positions if field == "x" else b
        assert np.linalg.norm(a - b) <= 1e-8 * np.linalg.norm(change)


def test_memory_does_not_grow_from_step_to_step():
    """New body grids and solvers in every step, none of which may stay: not even a number per point and step."""
    points = skmpm.disc((0.3, 0.1), 8.0, spacing=SPACING)
    gel = skmpm.NeoHookean(10e6, 0.3, 990.0)
    scene = skmpm.Scene([skmpm.Body(points, gel, velocity=(170.0, 290.0))], cell=1.0)
    scheme = skmpm.Scheme(anchor=0.0, linear=linear.amg)
    state = skmpm.initial(scene, scheme=scheme)
    held = []
    tracemalloc.start()
    try:
        for k in range(40):
            state = skmpm.step(scene, state, 1e-3, scheme=scheme)
            if k in (9, 39):
                gc.collect()
                held.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert held[1] - held[0] <= 0.5 * (39 - 9) * points.volume.nbytes


def test_matrices_of_the_points_share_a_pattern_that_cannot_be_changed():
    points = skmpm.disc((0.3, 0.1), 5.0, spacing=SPACING)
    grid = build_grids(points.x, np.zeros(points.size, dtype=int), 1.0, 1)
    N, (Dx, Dy) = grid.interpolation, grid.derivatives
    assert np.shares_memory(N.indices, Dx.indices) and np.shares_memory(N.indices, Dy.indices)
    with pytest.raises(ValueError, match="read-only"):
        N.sort_indices()
