"""Contact patch test: two blocks on each other, pressed between smooth plates, against uniform stress.

Each block is 10 cells wide and 5 high, anywhere on the grid, so that their common boundary cuts cells. Their points
do not match where spacings differ. Hooke's law, one per cent of strain, without inertia or friction: the exact
stress is -E / (1 - nu^2) 0.01 across, zero else. One block of both heights shows what the bulk alone contributes.
Rollers hold the left sides: blocks that slide off each other have less energy, so that without them the exact
solution is unstable.
"""

from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers

from skmpm import Body, LinearElastic, Scene, Scheme, Support, Wall, box, simulate

E, STRAIN, WIDTH, HEIGHT = 1e6, 0.01, 10, 5  # [Pa], -, [cells], [cells]
SPACINGS = (0.74, 0.5, 1 / 3)  # [cells]
CASES = 12  # positions on the grid, of the table


def blocks(offset, nu, spacing, ratio):
    """Two blocks, the points of the upper one `ratio` times as far apart; one block if it is zero."""
    material, height = LinearElastic(E, nu, 1000.0), 2.0 * HEIGHT
    if ratio == 0.0:
        bodies = [Body(box(offset, (WIDTH, height), spacing=spacing), material)]
    else:
        above = offset + np.array([0.0, HEIGHT])
        size = (WIDTH, HEIGHT)
        bodies = [Body(box(offset, size, spacing=spacing), material)]
        bodies.append(Body(box(above, size, spacing=ratio * spacing), material))
    plates = [Wall(offset, (0, 1)), Wall(offset + np.array([0.0, height]), (0, -1), velocity=(0.0, -STRAIN * height))]
    rollers = Support(lambda x: x[0] < offset[0] + 1e-6, velocity=(0.0, None))
    return Scene(bodies, cell=1.0, walls=plates, supports=[rollers])


def stress_error(scene, nu):
    """Root mean square of the stress error, all components, over the exact stress."""
    *_, state = simulate(scene, dt=1.0, until=1.0, scheme=Scheme(inertia=False, newton_tol=1e-8))
    exact = -E / (1.0 - nu**2) * STRAIN * np.array([[0.0, 0.0], [0.0, 1.0]])
    square = ((state.stress - exact[:, :, None]) ** 2).sum(axis=(0, 1))
    return float(np.sqrt(np.average(square, weights=state.weight))) / abs(exact[1, 1])


@cache
def patch(nu, spacing, ratio, cases):
    """Errors at random positions on the grid, (cases,)."""
    offsets = np.random.default_rng(0).uniform(0.0, 1.0, (cases, 2))
    return np.array([stress_error(blocks(offset, nu, spacing, ratio), nu) for offset in offsets])


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_uniform_stress_across_a_contact(nu):
    """To 0.2 % where points are 0.74 cells apart and match, the bulk's part; 1.5 % where they do not."""
    assert rms(patch(nu, 0.74, 1.0, 12)) < 0.002
    assert rms(patch(nu, 1 / 3, 1.0, 4)) < 1e-6
    assert rms(patch(nu, 0.74, 0.8, 4)) < 0.015


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_the_bulk_contributes_little(nu):
    """One block: 1 %; at h/3 0.3 %, of one position in four, since weights of points reproduce moments elsewhere."""
    assert rms(patch(nu, 0.74, 0.0, 4)) < 0.01
    assert rms(patch(nu, 1 / 3, 0.0, 4)) < 0.003


def rows():
    found = []
    for nu in (0.0, 0.3):
        errors = {ratio: [rms(patch(nu, s, ratio, CASES)) for s in SPACINGS] for ratio in (1.0, 0.8, 0.0)}
        met = "met" if max(errors[ratio][0] for ratio in (1.0, 0.8)) <= 0.015 else "missed: the contact's part"
        found.append(
            Row(
                f"two blocks pressed together, nu = {nu:g}: stress at the points (rms)",
                "uniform stress",
                f"spacing 0.74 h, h/2, h/3; {CASES} positions on the grid",
                f"{numbers(errors[1.0])}; upper points 0.8 times as far apart {numbers(errors[0.8])};"
                f" one block instead of two {numbers(errors[0.0])} of the stress",
                "-",
                f"0.015 at 0.74 h: {met}",
                "test_uniform_stress_across_a_contact",
            )
        )
    return found
