"""One disc between four frictionless walls that close in: the cell of a square packing, quasi-static.

Reference: quadratic triangles on a quarter of the disc with an active set of boundary nodes (`finite_elements`) and
the same neo-Hookean law, coded separately; TABLE has what `finite_elements(nu, 48)` gives, three digits of which do
not change from 24 to 48. Walls and disc are turned and shifted on the grid at random. In the continuum a frictionless
round disc has the same pressure at any angle; what changes with it is the noise of the grid.
"""

from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers
from placements import at_random
from skfem import Basis, BilinearForm, ElementTriP2, ElementVector, Functional, LinearForm, MeshTri, condense, solve
from skfem.helpers import ddot, grad

from skmpm import Body, NeoHookean, Points, Scene, Scheme, Wall, disc, observe, simulate

E, NU = 1e6, 0.45
FRACTIONS = np.array([0.83, 0.86, 0.90, 0.93])  # current solid fractions
STRAIN = 0.125  # of the box in each direction, at the end
TABLE = {  # pressure over E at FRACTIONS, by Poisson's ratio
    0.3: (0.01674, 0.03683, 0.07911, np.nan),
    0.45: (0.01807, 0.03938, 0.0837, 0.1382),
}
BARS = {5: 0.10, 8: 0.04, 16: 0.02}  # of the mean over placements, with mean dilatation


# The reference.


def kinematics(w):
    """F, J and F^-T of the displacement `u` at the quadrature points."""
    F = np.asarray(w["u"].grad) + np.eye(2)[:, :, None, None]
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    return F, J, np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]]) / J


def forms(lam, mu):
    """Internal force and its derivative."""

    @LinearForm
    def force(v, w):
        F, J, inverse = kinematics(w)
        return ddot(mu * (F - inverse) + lam * np.log(J) * inverse, grad(v))

    @BilinearForm
    def tangent(u, v, w):
        _, J, inverse = kinematics(w)
        turned = np.einsum("ij...,kj...,kl...->il...", inverse, grad(u), inverse)
        volumetric = lam * ddot(inverse, grad(u)) * inverse
        return ddot(mu * grad(u) + (mu - lam * np.log(J)) * turned + volumetric, grad(v))

    return force, tangent


def finite_elements(nu, n, strains):
    """Current solid fraction and pressure over E at strains of the box, by n x n x 2 triangles on a quarter."""
    force, tangent = forms(nu / (1 + nu) / (1 - 2 * nu), 0.5 / (1 + nu))
    square = MeshTri.init_tensor(*2 * [np.linspace(0, 1, n + 1)])
    s, t = square.p
    basis = Basis(
        MeshTri(np.stack([s * np.sqrt(1 - t**2 / 2), t * np.sqrt(1 - s**2 / 2)]), square.t),
        ElementVector(ElementTriP2()),
        intorder=4,
    )
    x, (vertical, boundary) = basis.doflocs, (np.arange(basis.N) % 2 == 1, np.hypot(*basis.doflocs) > 0.98)
    held = np.flatnonzero(((x[0] < 1e-9) & ~vertical) | ((x[1] < 1e-9) & vertical))
    rim, place = np.setdiff1d(np.flatnonzero(boundary), held), np.where(vertical, x[1], x[0])
    u, active, found = np.zeros(basis.N), np.array([], dtype=int), []
    for strain in strains:
        for _ in range(40):
            field = basis.interpolate(u)
            pull, beyond = force.assemble(basis, u=field), place + u - (1 - strain)
            contact = rim[(np.isin(rim, active) & (pull[rim] <= 0)) | (beyond[rim] > 1e-12)]
            step = solve(*condense(
                tangent.assemble(basis, u=field), -pull, x=np.where(np.isin(np.arange(basis.N), contact), -beyond, 0),
                D=np.concatenate([held, contact]),
            ))  # fmt: skip
            u, same, active = u + step, np.array_equal(contact, active), contact
            if same and np.abs(step).max() < 1e-11:
                break
        else:
            raise ArithmeticError(f"no equilibrium at a strain of {strain}")
        field = basis.interpolate(u)
        area = Functional(lambda w: kinematics(w)[1]).assemble(basis, u=field)
        push = -force.assemble(basis, u=field)[active].sum() / 2
        found.append((area / (1 - strain) ** 2, push / (1 - strain)))
    return np.array(found).T


def reference(nu, n, steps=60):
    """Pressure over E at FRACTIONS by finite elements, nan beyond the last strain."""
    return np.interp(FRACTIONS, *finite_elements(nu, n, np.linspace(0.002, STRAIN, steps)), right=np.nan)


# The same with material points.


@cache
def squeezed(cells, placement, spacing=0.74, mean_dilatation=True):
    """Mean pressure on the walls over E at FRACTIONS, of a disc of `cells` cells per radius."""
    cell, c, s = 1 / cells, np.cos(placement.turn), np.sin(placement.turn)
    turn, centre = np.array([[c, -s], [s, c]]), cell * np.array(placement.offset)
    straight = disc((0, 0), 1, spacing=spacing * cell)
    points = Points(turn @ straight.x + centre[:, None], straight.volume, straight.outline)
    normals = [turn @ n for n in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    walls = [Wall(centre - n, n, velocity=n) for n in normals]
    scene = Scene([Body(points, NeoHookean(E, NU, 1000))], cell=cell, walls=walls)
    scheme = Scheme(inertia=False, mean_dilatation=mean_dilatation)
    seen = [observe(scene, state) for state in simulate(scene, dt=0.004, until=STRAIN, scheme=scheme)]
    return np.interp(FRACTIONS, [o.solid_fraction for o in seen], [o.pressure_walls / E for o in seen])


def errors(cells, count, **options):
    """Relative errors of the pressure, (placements, fractions)."""
    found = [squeezed(cells, placement, **options) for placement in at_random(count, seed=cells)]
    return np.array(found) / TABLE[NU] - 1


@pytest.mark.nightly
@pytest.mark.parametrize("nu", list(TABLE))
def test_the_table(nu):
    """A coarse mesh gives it to 1 %, between a few strains."""
    np.testing.assert_allclose(reference(nu, 12, steps=20), TABLE[nu], rtol=0.01)


@pytest.mark.parametrize(("cells", "count"), [(5, 4), (8, 2), pytest.param(16, 1, marks=pytest.mark.slow)])
def test_pressure_of_one_disc_between_four_walls(cells, count):
    assert np.abs(errors(cells, count).mean(axis=0)).max() < BARS[cells]


def test_plain_elements_are_too_stiff():
    """Without mean dilatation the pressure at R/h = 5 is too large, by 6 % and more at every solid fraction."""
    plain = errors(5, 4, mean_dilatation=False).mean(axis=0)
    assert plain.min() > 0.04
    assert (plain > errors(5, 4).mean(axis=0)).all()


def percent(values):
    return numbers([100 * v for v in values])


def rows():
    """What docs/verification shows of this module."""
    result = []
    for mean_dilatation in (True, False):
        for cells, count in ((5, 20), (8, 20), (16, 6)):
            found = errors(cells, count, mean_dilatation=mean_dilatation)
            mean, spread = found.mean(axis=0), found.std(axis=0)
            goal = {8: 0.03, 16: 0.01}.get(cells)
            met = "shown" if goal is None else f"{goal:.0%}: " + ("met" if np.abs(mean).max() <= goal else "missed")
            kind = "with" if mean_dilatation else "without"
            result.append(Row(
                f"disc between four walls, nu = {NU}, {kind} mean dilatation: pressure at Phi = {numbers(FRACTIONS)}",
                "quadratic finite elements", f"R/h = {cells}, points 0.74 h apart",
                f"mean of {count} placements {percent(mean)} %; standard deviation with the angle in the grid"
                f" {percent(spread)} %", "-", met, "test_pressure_of_one_disc_between_four_walls",
            ))  # fmt: skip
    fem = np.array([TABLE[0.3], TABLE[0.45]])[:, :3]
    result.append(Row(
        "finite elements: pressure over E for nu = 0.45 over that for nu = 0.3", "1 (Vu et al. 2021)",
        "-", numbers(fem[1] / fem[0], 3), "-", "5 %: missed: by current solid fraction 6 to 8 %", "test_the_table",
    ))  # fmt: skip
    return result
