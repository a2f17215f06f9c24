"""Measured orders of the manufactured solutions: the rows and figures of `test_manufactured.py`."""

from functools import cache

import numpy as np
from ledger import Row, numbers, rate, relative
from manufactured import bar, square, vortex

from skmpm import Body, Scene, Scheme, linear, simulate

PROBLEMS = {"bar": bar(), "square": square(), "vortex": vortex()}
CUT = (0.3, 0.45)  # [cells] from the grid lines to the lower left corner
OFFSETS = ((0.05, 0.05), (0.1, 0.6), (0.2, 0.2), (0.25, 0.75), CUT, (0.4, 0.9))
OFFSETS += ((0.5, 0.5), (0.6, 0.35), (0.7, 0.7), (0.8, 0.1), (0.9, 0.15), (0.95, 0.5))


def scene_of(problem, cell, per_cell, offset=(0.0, 0.0)):
    """The scene, and the initial positions X of the points in the problem's own frame, moved by `offset` cells."""
    corner = cell * np.asarray(offset)
    points, shift = problem.points(cell, per_cell, corner), corner[:, None]
    body = Body(points, problem.material, velocity=lambda x: problem.velocity(x - shift, 0.0))
    scene = Scene(
        [body],
        cell=cell,
        supports=problem.supports(corner),
        gravity=lambda x, t: problem.force(x - shift, t),
    )
    return scene, points.x - shift


def march(problem, cell, per_cell, steps, *, offset=(0.0, 0.0), samples=1, **options):
    """Displacements and velocities (samples, 2, n) at equal times up to the end, the exact ones, and the volumes."""
    scene, X = scene_of(problem, cell, per_cell, offset)
    scheme = Scheme(**{"theta": 0.5, **options})
    every, times, found = steps // samples, [], []
    for i, state in enumerate(simulate(scene, dt=problem.until / steps, until=problem.until, scheme=scheme), 1):
        if i % every == 0:
            times.append(state.t)
            found.append((state.x - scene.initial_positions, state.v))
    exact = [
        np.stack([f(X, t) - start for t in times]) for f, start in ((problem.position, X), (problem.velocity, 0.0))
    ]
    return [np.stack(a) for a in zip(*found, strict=True)], exact, scene.initial_volumes


def errors(problem, cell, per_cell, steps, **options):
    """Relative L2 errors of the displacement and the velocity at the end."""
    found, exact, volume = march(problem, cell, per_cell, steps, **options)
    return tuple(relative(a, b, volume) for a, b in zip(found, exact, strict=True))


@cache
def in_space(name, cells, per_cell, steps, *, offset=(0.0, 0.0), fitted=True, solver=linear.banded):
    """Errors of displacement and velocity at h = 1/cells, (grids, 2)."""
    options = {"offset": offset, "moment_fitting": fitted, "linear": solver}
    return np.array([errors(PROBLEMS[name], 1.0 / n, per_cell, steps, **options) for n in cells])


@cache
def sampled(name, steps, theta, *, cell=1 / 16, solver=linear.banded):
    """What `march` finds at eight times."""
    return march(PROBLEMS[name], cell, 3, steps, theta=theta, samples=8, newton_tol=1e-9, linear=solver)


@cache
def in_time(name, steps, theta, *, finest=1024, cell=1 / 16, solver=linear.banded):
    """Errors to the finest step on the same grid and to the exact motion, over eight times, (steps, 2, 2)."""
    best, exact, volume = sampled(name, finest, 0.5, cell=cell, solver=solver)
    rows = []
    for n in steps:
        found, _, _ = sampled(name, n, theta, cell=cell, solver=solver)
        rows.append([[relative(a, b, volume) for a, b in zip(found, to, strict=True)] for to in (best, exact)])
    return np.array(rows)


def orders(size, error):
    """Orders of the columns (displacement, velocity)."""
    return [rate(size, column) for column in np.asarray(error).T]


def _row(problem, cells, found, goal, test):
    """A row about orders in space."""
    displacement, velocity = found.T
    of = orders(1.0 / np.array(cells), found)
    return Row(
        problem=problem,
        reference="exact motion",
        h=", ".join(f"1/{n}" for n in cells),
        error=f"displacement {numbers(displacement)}; velocity {numbers(velocity)}",
        rate=f"{of[0]:.2f}; {of[1]:.2f}",
        goal=goal,
        test=test,
    )


ALIGNED = "test_second_order_in_space_on_aligned_grids"
BY_CUT = "test_order_in_space_with_cut_cells"
GRIDS, RING = (8, 16, 32, 64), (16, 32, 64)


def offsets(per_cell, cells=(8, 16, 32)):
    """Errors of the square's displacement at twelve offsets, (offsets, grids)."""
    return np.array([in_space("square", cells, per_cell, 64, offset=o)[:, 0] for o in OFFSETS])


def rows_in_space():
    """Order in h: aligned, cut, and what fitted weights do."""
    listed = [
        _row(f"manufactured {name}, aligned", GRIDS, in_space(name, GRIDS, 2, 128), "rate >= 1.8", ALIGNED)
        for name in ("bar", "square")
    ]
    found = in_space("square", GRIDS, 3, 64, offset=CUT)
    listed.append(_row("manufactured square, cut at (0.3, 0.45) h", GRIDS, found, "rate >= 1.5", BY_CUT))
    for per_cell in (3, 4):
        found = offsets(per_cell)
        of = np.array([rate(1.0 / np.array((8, 16, 32)), e) for e in found])
        missed = (
            ""
            if of.min() >= 1.5
            else f"; missed at {np.sum(of < 1.5)} of 12: fitted weights would be negative there and are cut"
        )
        listed.append(
            Row(
                problem=f"manufactured square, cut at 12 offsets, {per_cell} x {per_cell} points per cell",
                reference="exact motion",
                h="1/8, 1/16, 1/32",
                error=f"displacement at 1/32: median {np.median(found[:, -1]):.2g}, worst {found[:, -1].max():.2g}",
                rate=f"median {np.median(of):.2f}, worst {of.min():.2f}",
                goal="rate >= 1.5" + missed,
                test="test_order_where_the_grid_cuts_worst",
            )
        )
    found = in_space("vortex", RING, 3, 32)
    listed.append(_row("generalised vortex, cut cells, t = 0.02 s", RING, found, "rate >= 1.5", BY_CUT))
    found = in_space("vortex", RING, 2, 32, fitted=False)
    what = "generalised vortex, volumes as weights, 2 x 2 points per cell"
    listed.append(_row(what, RING, found, "- (what fitted weights are for)", BY_CUT))
    return listed


def rows_in_time():
    """Order in dt on one grid."""
    listed = []
    of_bar = ("test_second_order_in_time_by_the_midpoint_rule", "test_first_order_in_time_by_backward_euler")
    tests = {"bar": of_bar, "square": ("test_order_in_time_of_the_square",) * 2}
    for name in ("bar", "square"):
        cases = ((0.5, (8, 16, 32, 64)), (1.0, (64, 128, 256, 512)))
        for (theta, steps), test in zip(cases, tests[name], strict=True):
            found = in_time(name, steps, theta)
            of = orders(1.0 / np.array(steps), found[:, 0])
            listed.append(
                Row(
                    problem=f"manufactured {name}, theta = {theta:g}, h = 1/16, in"
                    f" {', '.join(str(n) for n in steps)} steps",
                    reference="1024 steps on the same grid",
                    h="1/16",
                    error=f"displacement {numbers(found[:, 0, 0])}; to the exact one {numbers(found[:, 1, 0])}",
                    rate=f"{of[0]:.2f}; velocity {of[1]:.2f}",
                    goal=f"order {1.0 / theta:.0f} in dt",
                    test=test,
                )
            )
    return listed


def rows_of_loss():
    """How the error on a coarse grid depends on the number of steps: nodes keep their velocities between steps."""
    steps = (32, 128, 512)
    error = [errors(PROBLEMS["vortex"], 1 / 16, 3, n)[0] for n in steps]
    return [
        Row(
            problem=f"generalised vortex, h = 1/16, in {', '.join(str(n) for n in steps)} steps",
            reference="exact motion",
            h="1/16",
            error=f"displacement {numbers(error)}",
            rate="-",
            goal="- (the error of the grid does not grow with the number of steps)",
            test="-",
        )
    ]
