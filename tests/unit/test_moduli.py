"""Moduli of packings: lattices by their symmetry and by one disc between plates, and what is refused."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from skmpm import (
    Body,
    LinearElastic,
    NeoHookean,
    Periodic,
    Scene,
    SceneError,
    Scheme,
    Wall,
    box,
    disc,
    initial,
    moduli,
    simulate,
)

GEL, R, SIZE, FRICTION = NeoHookean(E=1e6, nu=0.3, density=1000.0), 1e-3, 6, 0.5
STATIC = Scheme(inertia=False)
COMPRESSION = 0.02  # of each side
ROW = np.sqrt(3.0) * R
HEXAGONAL = [((2 * i + 1 + j % 2) * R, (j + 0.5) * ROW) for i in range(4) for j in range(4)]


@cache
def compressed(kind, friction=FRICTION, size=SIZE):
    """A lattice in a periodic box that has shrunk, and its state; a square one is a disc that touches its images."""
    places, sides = ([(R, R)], (2 * R, 2 * R)) if kind == "square" else (HEXAGONAL, (8 * R, 4 * ROW))
    bodies = [Body(disc(x, R, spacing=0.74 * R / size), GEL) for x in places]
    rate = np.log(1.0 - COMPRESSION) / 2.0 * np.eye(2)
    scene = Scene(bodies, cell=R / size, periodic=Periodic(*sides, rate=rate), friction=friction)
    *_, state = simulate(scene, dt=1.0, until=2.0, scheme=STATIC)
    return scene, state


@cache
def measured(friction=FRICTION, held=False):
    """The moduli of the hexagonal lattice."""
    return moduli(*compressed("hexagonal", friction), held=held)


@pytest.mark.parametrize(("friction", "held"), [(0.0, False), (0.0, True), (FRICTION, False)])
def test_a_hexagonal_lattice_is_isotropic(friction, held):
    """The sixfold axis makes C_xxxx = C_yyyy and both shear moduli equal; C is symmetric but for the stress."""
    found = measured(friction, held)
    C = found.tensor
    assert C[0, 0, 0, 0] == pytest.approx(C[1, 1, 1, 1], rel=0.06)
    assert found.shear == pytest.approx(found.shear_pure, rel=0.06)
    assert C[0, 0, 1, 1] == pytest.approx(C[1, 1, 0, 0], abs=np.abs(found.stress).max())
    assert np.abs([C[0, 0, 0, 1], C[1, 1, 0, 1], C[0, 1, 0, 0], C[0, 1, 1, 1]]).max() < 0.03 * C[0, 0, 0, 0]
    np.testing.assert_array_equal(C, C.transpose(1, 0, 2, 3))
    assert not found.rattlers.any()


def test_contacts_that_slide_make_a_packing_softer():
    """Under shear, not under pressure; and where friction is enough, holding contacts changes nothing."""
    sliding, held = (measured(0.0, held) for held in (False, True))
    assert sliding.shear < 0.7 * held.shear
    assert sliding.bulk == pytest.approx(held.bulk, rel=0.02)
    assert moduli(*compressed("hexagonal"), held=True).shear == pytest.approx(held.shear, rel=0.01)


@pytest.mark.parametrize("size", [9, 12])
def test_a_square_lattice_is_as_stiff_as_a_disc_between_plates(size):
    """By mirror symmetry its contacts are smooth plates: C_xxxx and C_yyxx from the forces on these."""
    C, side, strain = moduli(*compressed("square", size=size)).tensor, 2.0 * R * (1.0 - COMPRESSION), 1e-4
    widths = (1.0 - COMPRESSION) * (1.0 + strain * np.array([-1.0, 1.0]))
    forces = np.array([between_plates(1.0 - width, size) for width in widths])
    along, across = -forces[:, 0] / side, -forces[:, 1] / (2.0 * R * widths)
    assert C[0, 0, 0, 0] == pytest.approx(np.diff(along)[0] / (2.0 * strain), rel=2e-3)
    assert C[1, 1, 0, 0] == pytest.approx(np.diff(across)[0] / (2.0 * strain), rel=2e-3)


def between_plates(compression_x, size):
    """Forces along x and y [N/m] on a disc between four smooth plates, compressed by as much and by COMPRESSION."""
    speeds = 0.5 * R * np.array([compression_x, COMPRESSION])
    normals = np.array([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
    walls = [Wall(-R * n, n, velocity=speeds * n, friction=0.0) for n in normals]
    body = Body(disc((0.0, 0.0), R, spacing=0.74 * R / size), GEL)
    scene = Scene([body], cell=R / size, walls=walls)
    scheme = replace(STATIC, newton_tol=1e-8, gap_tol=1e-9, contact_tol=1e-10)
    *_, state = simulate(scene, dt=1.0, until=2.0, scheme=scheme)
    return np.abs(state.wall_force[[1, 3]]).max(axis=1)


def test_moduli_do_not_depend_on_the_strain_or_on_velocities():
    scene, state = compressed("hexagonal")
    usual = measured()
    finer = moduli(scene, replace(state, v=state.v + 1.0), strain=1e-6)
    np.testing.assert_allclose(finer.tensor, usual.tensor, atol=0.01 * usual.bulk)


def test_moduli_do_not_depend_on_how_the_box_moves():
    """That of the scene is left out: the packing rests in the box of the state."""
    scene, state = compressed("hexagonal")
    shearing = replace(scene, periodic=replace(scene.periodic, rate=((-0.1, 0.3), (0.0, -4.0))))
    np.testing.assert_array_equal(moduli(shearing, state).tensor, measured().tensor)


def test_a_body_that_fills_the_box_has_the_moduli_of_its_material():
    """A square of a linear elastic material, pressed by its images: plane strain."""
    E, nu = 1e6, 0.3
    body = Body(box((0.0, 0.0), (R, R), spacing=R / 12), LinearElastic(E, nu, 1000.0))
    periodic = Periodic(R, R, rate=-1e-3 * np.eye(2))
    scene = Scene([body], cell=R / 8, periodic=periodic, friction=1.0)
    *_, state = simulate(scene, dt=1.0, until=2.0, scheme=STATIC)
    found = moduli(scene, state)
    assert found.bulk == pytest.approx(E / (2.0 * (1.0 + nu) * (1.0 - 2.0 * nu)), rel=0.01)
    assert found.shear == pytest.approx(E / (2.0 * (1.0 + nu)), rel=0.01)


def test_a_disc_that_touches_nothing_is_a_rattler():
    scene, state = compressed("hexagonal")
    loose = Body(disc((R, 0.5 * ROW), 0.3 * R, spacing=0.1 * R), GEL)
    bodies = [loose, *scene.bodies[1:]]
    fewer = replace(scene, bodies=bodies, cell=0.15 * R)
    *_, state = simulate(fewer, dt=1.0, until=2.0, scheme=STATIC)
    found = moduli(fewer, state)
    assert found.rattlers.tolist() == [True] + [False] * 15
    assert found.bulk < measured().bulk


def test_what_has_no_moduli_is_refused():
    scene, state = compressed("hexagonal")
    walls = Scene(scene.bodies, cell=scene.cell, walls=[Wall((0.0, -2.0 * R), (0.0, 1.0))])
    with pytest.raises(SceneError, match=r"moduli: the scene has no box that is periodic"):
        moduli(walls, initial(walls))
    with pytest.raises(SceneError, match=r"moduli: the packing bears no pressure \(.* Pa\) in the box"):
        moduli(scene, initial(scene))
    for strain in (0.0, 0.1, np.nan, "small"):
        with pytest.raises(SceneError, match=r"moduli: strain = .* give a strain between 1e-07 and 0.01"):
            moduli(scene, state, strain=strain)
    with pytest.raises(SceneError, match=r"moduli"):
        moduli(compressed("square")[0], state)
