"""Save contact problems of real runs to tests/verification/problems: `python save_problems.py [name ...]`.

The library that test_contact_solver.py solves: what `Scheme` steps hand to `coulomb.solve`, of every run the problem
that takes the solver the most Newton steps. Without names all runs are made, which takes some minutes. The matrix is
kept as its lower triangle; r0 are the impulses that the run started from. One problem is random: see `random_bodies`.
"""

import sys
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import scipy.sparse as sp

import skmpm
from skmpm import coulomb

FOLDER = Path(__file__).resolve().parent / "problems"
TOL = 1e-10


@dataclass(frozen=True)
class Problem:
    """What `coulomb.solve` is called with."""

    W: sp.csr_array
    q: np.ndarray
    mu: np.ndarray
    r0: np.ndarray
    bilateral: coulomb.Bilateral | None = None
    factor: sp.csr_array | None = None  # H, of W = H H', where that is kept instead of W

    def solve(self, *, warm, tol=TOL):
        """Impulses and info, from the run's own impulses or from nothing."""
        r0 = self.r0 if warm else None
        return coulomb.solve(self.W, self.q, self.mu, r0=r0, tol=tol, bilateral=self.bilateral)


# Files.


def triangle(A):
    """The lower triangle of a symmetric matrix, as arrays to keep."""
    return packed(sp.csr_array(sp.tril(A)))


def packed(A):
    """A matrix as arrays to keep."""
    A.sort_indices()
    small = np.int16 if A.shape[0] < 2**15 else np.int32
    data = A.data.view(np.uint8).reshape(-1, 8).T  # signs and exponents together, which compress
    return {"data": data, "indices": A.indices.astype(small), "indptr": A.indptr.astype(np.int32)}


def whole(arrays):
    """The symmetric matrix of a lower triangle."""
    L = unpacked(arrays)
    return sp.csr_array(L + sp.tril(L, -1).T)


def unpacked(arrays):
    """The matrix of kept arrays, square if no number of columns is among them."""
    size = arrays["indptr"].size - 1
    shape = size, int(arrays["columns"]) if "columns" in arrays else size
    data = np.ascontiguousarray(arrays["data"].T).view(float).ravel()
    return sp.csr_array((data, arrays["indices"].astype(np.int32), arrays["indptr"]), shape=shape)


def save(name, problem):
    """Write one problem."""
    W, q = problem.W, problem.q
    if problem.bilateral is not None:
        q = np.concatenate([q, problem.bilateral.q])
    H = problem.factor
    matrix = triangle(W) if H is None else {**packed(H), "columns": np.array(H.shape[1])}
    FOLDER.mkdir(exist_ok=True)
    np.savez_compressed(FOLDER / f"{name}.npz", q=q, mu=problem.mu, r0=problem.r0, **matrix)


def load(path):
    """Read one problem."""
    with np.load(path) as arrays:
        if "columns" in arrays:
            H = unpacked(arrays)
            return Problem(sp.csr_array(H @ H.T), arrays["q"], arrays["mu"], arrays["r0"], factor=H)
        W, q, mu, r0 = whole(arrays), arrays["q"], arrays["mu"], arrays["r0"]
    k = r0.size
    if q.size == k:
        return Problem(W, q, mu, r0)
    return Problem(W, q[:k], mu, r0, coulomb.Bilateral(q[k:]))


# Runs.


@contextmanager
def recorded():
    """Within, every call of `coulomb.solve` leaves its problem in the list."""
    problems, solve = [], coulomb.solve

    def record(W, q, mu, *, r0=None, bilateral=None, **options):
        start = np.zeros_like(q) if r0 is None else np.array(r0)
        problems.append(Problem(sp.csr_array(W).copy(), np.array(q), np.array(mu, dtype=float), start, bilateral))
        return solve(W, q, mu, r0=r0, bilateral=bilateral, **options)

    coulomb.solve = record
    try:
        yield problems
    finally:
        coulomb.solve = solve


def run(scene, dt, steps, scheme, state=None):
    """The problems of some steps; those of a step that fails are among them."""
    state = skmpm.initial(scene, scheme=scheme) if state is None else state
    with recorded() as problems:
        try:
            for _ in range(steps):
                state = skmpm.step(scene, state, dt, scheme=scheme)
        except skmpm.StepFailed:
            pass
    return problems


def compaction(
    discs, ratio, friction, fraction, dt, *, start=0.55, law=skmpm.NeoHookean, scheme=None, speed=2.0, before=8e-6
):
    """Two steps dt of the main job's discs, R/h = ratio, once the lid has squeezed them to a solid fraction.

    The lid moves at `speed` [m/s], in steps of `before` [s].
    """
    scheme = skmpm.Scheme() if scheme is None else scheme
    radii = np.random.default_rng(discs).uniform(0.7e-3, 1.2e-3, discs)
    solid = np.pi * (radii**2).sum()
    width, cell = float(np.sqrt(solid / 0.72)), 0.95e-3 / ratio
    packed = skmpm.packing(radii, width, solid_fraction=start, seed=discs)
    material = law(E=10e6, nu=0.45, density=990.0)
    placed = zip(packed.centres.T, packed.radii, strict=True)
    bodies = [skmpm.Body(skmpm.disc(c, r, spacing=0.74 * cell), material) for c, r in placed]
    lid = skmpm.Wall((0.0, packed.height), (0.0, -1.0), velocity=(0.0, -speed))
    walls = [skmpm.Wall((0, 0), (0, 1)), lid, skmpm.Wall((0, 0), (1, 0)), skmpm.Wall((width, 0), (-1, 0))]
    scene = skmpm.Scene(bodies, cell=cell, walls=walls, friction=friction)
    until = (packed.height - solid / (width * fraction)) / speed
    *_, state = skmpm.simulate(scene, dt=before, until=until, scheme=scheme)
    return run(scene, dt, 2, scheme, state)


def slow(discs, friction, fraction, dt):
    """The same under a lid that takes 1/8 cell a step, whatever dt."""
    return compaction(discs, 5, friction, fraction, dt, start=0.62, speed=0.95e-3 / 40.0 / dt, before=dt)


def shared(discs, ratio, friction, fraction, dt):
    """The same with the shared-grid contact of Nezamabadi et al. (2017)."""
    return compaction(
        discs, ratio, friction, fraction, dt, law=skmpm.LinearElastic, scheme=skmpm.Scheme.nezamabadi2017()
    )


CORNERS = {
    "four": [(-1, -1), (0, -1), (0, 0), (-1, 0)],
    "three": [(-1, -1), (0, -1), (-0.5, 0)],
    "wall corner": [(-1, -1), (0, -1)],
}


def boxes(kind, shift, friction, scheme, *, ratio=5, steps=4):
    """Boxes that run into each other at one node, shifted against the grid, or into a corner of two walls."""
    cell = 0.02
    side, place = ratio * cell, cell * np.array(shift)
    material = skmpm.LinearElastic(E=1e6, nu=0.3, density=1000.0)
    bodies = []
    for corner in side * np.array(CORNERS[kind]):
        velocity = tuple(-np.sign(corner + 0.5 * side + 1e-9))
        bodies.append(
            skmpm.Body(skmpm.box(place + corner, (side, side), spacing=cell / 2), material, velocity=velocity)
        )
    walls = []
    if kind == "wall corner":
        walls = [skmpm.Wall(place - side, (0, 1), friction=friction), skmpm.Wall(place - side, (1, 0))]
    return run(skmpm.Scene(bodies, cell=cell, walls=walls, friction=friction), 2e-4, steps, scheme)


def block(shift, gravity, dt, scheme, *, friction=0.3, law=skmpm.NeoHookean, steps=4):
    """A block on a wall."""
    cell = 0.02
    body = skmpm.Body(skmpm.box(cell * np.array(shift), (0.2, 0.1), spacing=cell / 2), law(1e6, 0.3, 1000.0))
    wall = skmpm.Wall((0.0, shift[1] * cell), (0.0, 1.0), friction=friction)
    return run(skmpm.Scene([body], cell=cell, walls=[wall], friction=friction, gravity=gravity), dt, steps, scheme)


def heavy(below, dt, *, offset=(0.3, 0.6), ratio=1e4):
    """A disc on one or two that are 1e4 times lighter, falling under gravity; no walls at the sides."""
    radius, cell = 0.1, 0.02
    shift = cell * np.array(offset)
    centres = [(2.1 * radius * i, radius) for i in range(below)]
    centres.append((1.05 * radius * (below - 1), 3.001 * radius if below == 1 else 2.75 * radius))
    densities = [0.1] * below + [0.1 * ratio]
    bodies = [
        skmpm.Body(skmpm.disc(shift + np.array(c), radius, spacing=cell / 2), skmpm.NeoHookean(3e6, 0.3, density))
        for c, density in zip(centres, densities, strict=True)
    ]
    scene = skmpm.Scene(
        bodies, cell=cell, walls=[skmpm.Wall(shift, (0, 1), friction=0.5)], friction=0.5, gravity=(0.0, -10.0)
    )
    return run(scene, dt, 12, skmpm.Scheme())


def ride(fitted, rings=15):
    """A disc squeezed by four plates and taken along by them, its body grid rebuilt at every step."""
    radius, squeeze, ride = 1e-3, 4e-4, 4e-3

    def plate(normal):
        n = np.array(normal, dtype=float)

        def velocity(t):
            s, moved = np.clip(t / squeeze, 0.0, 1.0), np.clip((t - 6e-4) / ride, 0.0, 1.0)
            pressed = 0.05 * radius * 30.0 * s**2 * (1.0 - s) ** 2 / squeeze
            return pressed * n + np.array([6.0 * radius / 5 * 30.0 * moved**2 * (1.0 - moved) ** 2 / ride, 0.0])

        return skmpm.Wall(centre - radius * n, normal, velocity=velocity, friction=0.3)

    centre = radius * np.array([0.013, 0.007])
    walls = [plate(n) for n in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    material = skmpm.NeoHookean(1e7, 0.45, 990.0)
    body = skmpm.Body(skmpm.disc(centre, radius, spacing=radius / rings), material)
    scene = skmpm.Scene([body], cell=radius / 5, walls=walls)
    return run(scene, 2e-5, 120, skmpm.Scheme(anchor=0.0, moment_fitting=fitted))


def rigid(discs, fraction, friction):
    """The rigid discs of an initial packing."""
    radii = np.random.default_rng(7).uniform(0.7e-3, 1.2e-3, discs)
    width = float(np.sqrt(np.pi * (radii**2).sum() / 0.72))
    with recorded() as problems:
        skmpm.packing(radii, width, solid_fraction=fraction, friction=friction, seed=1)
    return problems


def random_bodies(bodies, contacts, friction, gap, seed):
    """Rigid bodies with contacts at random points, normals and pairs, one in ten with a wall; W of rank 3 bodies.

    Without impulses contacts move as rigid bodies do, apart from gaps that are `gap` of the size of these velocities:
    there is a motion that opens every contact without sliding. Rows are multiples of 1/1024, so that files are small.
    """
    draw = np.random.default_rng(seed)
    angle, point = draw.uniform(0.0, 2.0 * np.pi, contacts), draw.uniform(-1.0, 1.0, (2, 2, contacts))
    first = draw.integers(bodies, size=contacts)
    second = (first + draw.integers(1, bodies, contacts)) % bodies
    light = draw.uniform(0.7, 1.4, bodies)  # 1 / sqrt(mass)
    H = np.zeros((contacts, 2, bodies, 3))
    each, other = np.arange(contacts), draw.random(contacts) > 0.1
    for row, (x, y) in enumerate([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))]):
        for body, sign, at in ((first, 1.0, point[0]), (second, -1.0 * other, point[1])):
            turn = 1.6 * (at[0] * y - at[1] * x)  # moments of inertia are 0.4 of the masses
            H[each, row, body] = (sign * light[body] * np.stack([x, y, turn])).T
    factor = np.round(1024.0 * H.reshape(2 * contacts, -1)) / 1024.0
    s, q = np.linalg.norm(factor, axis=1), factor @ draw.normal(size=3 * bodies)
    q[::2] += gap * s[::2] * np.linalg.norm(q / s)
    W, r0 = sp.csr_array(factor @ factor.T), np.zeros(2 * contacts)
    return Problem(W, q, np.full(contacts, friction), r0, factor=sp.csr_array(factor))


def plain(make):
    """The run's problems without the bilateral unknowns of geometric stiffness."""
    return [replace(p, W=p.W[: p.q.size, : p.q.size].tocsr(), bilateral=None) for p in make()]


SHARED, CURVES, ANEW = skmpm.Scheme.nezamabadi2017(), skmpm.Scheme(), skmpm.Scheme(anchor=0.0, contact_tol=1e-10)
TIMES = {"0.5us": 0.5e-6, "5us": 5e-6, "50us": 50e-6}
RUNS = {
    **{
        f"discs_mu{mu}_fraction{fraction}_{name}": partial(compaction, 4, 5, mu, fraction, TIMES[name])
        for mu in (0.5, 0.0)
        for fraction, names in ((0.65, ("50us",)), (0.75, TIMES), (0.88, ("50us",)), (0.97, ("50us",)))
        for name in names
    },
    **{
        f"fine_mu{mu}_fraction{fraction}_{name}": partial(compaction, 3, 8, mu, fraction, TIMES[name])
        for mu, (fraction, name) in product((0.5, 0.0), ((0.8, "50us"), (0.95, "5us")))
    },
    "dense_mu0.5_30": partial(compaction, 30, 5, 0.5, 0.8, 50e-6, start=0.68),
    "dense_mu0.0_100": partial(plain, partial(compaction, 100, 5, 0.0, 0.8, 5e-6, start=0.72)),
    **{
        f"lid_mu{mu}_fraction{fraction}_{name}": partial(slow, 6, mu, fraction, dt)
        for mu, fraction, name, dt in (
            (0.5, 0.8, "8ms", 8e-3),
            (0.5, 0.9, "8ms", 8e-3),
            (0.0, 0.8, "800us", 8e-4),
        )
    },
    **{f"shared_mu{mu}_R{ratio}h": partial(shared, 3, ratio, mu, 0.8, 5e-6) for mu, ratio in ((0.5, 5), (0.0, 8))},
    **{
        f"{kind.replace(' ', '_')}_{name}_mu{mu}_R{ratio}h": partial(boxes, kind, shift, mu, scheme, ratio=ratio)
        for kind in CORNERS
        for name, scheme, mu, ratio, shift in (
            ("nodes", SHARED, 0.5, 5, (0.3, 0.7)),
            ("nodes", SHARED, 0.0, 5, (0.3, 0.7)),
            ("nodes", SHARED, 0.5, 8, (0.0, 0.0)),
            ("boundaries", CURVES, 0.5, 5, (0.3, 0.7)),
            ("boundaries", CURVES, 0.0, 5, (0.3, 0.7)),
        )
    },
    "block_anew_1ms": partial(block, (0.0, 0.0), (0.0, -10.0), 1e-3, ANEW),
    "block_slow_10ms": partial(block, (0.3, 0.6), (3.0, -10.0), 1e-2, skmpm.Scheme(inertia=False), friction=0.35),
    "block_slow_smooth_10ms": partial(
        block, (0.3, 0.6), (0.0, -10.0), 1e-2, skmpm.Scheme(inertia=False), friction=0.0, law=skmpm.LinearElastic
    ),
    "heavy_on_one_10ms": partial(heavy, 1, 1e-2),
    "heavy_on_one_20ms": partial(heavy, 1, 2e-2),
    "heavy_on_two_10ms": partial(heavy, 2, 1e-2),
    "heavy_on_two_20ms": partial(heavy, 2, 2e-2),
    "ride": partial(ride, False),
    "rigid_mu0.0": partial(rigid, 40, 0.7, 0.0),
    "rigid_mu0.5": partial(rigid, 40, 0.7, 0.5),
    "bodies_mu1.0_300": lambda: [random_bodies(20, 300, 1.0, 1e-3, 3)],
}


def solvable(problem):
    """Cold and warm to 1e-10: the harder start's Newton steps, or -1 if one of them fails."""
    infos = [problem.solve(warm=warm)[1] for warm in (False, True)]
    return max(info.iterations for info in infos) if all(info.converged for info in infos) else -1


def main(names):
    """Make the runs and keep of each the problem that takes the most steps."""
    for name in names:
        problems = RUNS[name]()
        steps = [solvable(problem) for problem in problems]
        failed, most = steps.count(-1), max(steps, default=-1)
        sys.stdout.write(f"{name}: {len(problems)} problems, {failed} not solved, at most {most} Newton steps\n")
        if most >= 0:
            save(name, problems[int(np.argmax(steps))])


if __name__ == "__main__":
    main(sys.argv[1:] or RUNS)
