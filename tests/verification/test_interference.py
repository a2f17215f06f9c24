"""Interference fit: a thick ring on a shaft larger than its bore, by an overlap at the start.

Reference: Lame's thick cylinder in plane strain (Timoshenko & Goodier, Theory of Elasticity, section 28): a rigid
shaft that is larger by d than the bore a presses with p = E d / ((1 + nu) a) (b^2 - a^2) / (b^2 + (1 - 2 nu) a^2). A
step without inertia removes a fifth of the overlap: 0.8^n of it is left after n steps. Tolerance: 1 %, of the
discretisation with five cells across the ring, and of the strain d / a, up to 0.5 %; the bore, 0.5 %, by which the
smooth curve of the shaft leaves its circle.
"""

import meshio
import numpy as np
import pytest

from skmpm import Body, NeoHookean, Rigid, Scene, SceneError, Scheme, disc, from_mesh, initial, step

INNER, OUTER, E, NU, CELL = 10e-3, 16e-3, 2e6, 0.49, 1.2e-3
STATICS = Scheme(inertia=False)


def ring():
    """A thick ring on a polar grid of 56 by 5 quadrilaterals."""
    n, m = 56, 5
    x = (np.linspace(INNER, OUTER, m + 1)[:, None] * np.exp(2j * np.pi / n * np.arange(n))).ravel()
    layer, turn = n * np.arange(m)[:, None], np.arange(n)
    corners = (layer + turn, layer + n + turn, layer + n + (turn + 1) % n, layer + (turn + 1) % n)
    quads = np.stack([corner.ravel() for corner in corners], axis=1)
    return from_mesh(meshio.Mesh(np.stack([x.real, x.imag], axis=1), [("quad", quads)]))


def fit(difference, overlap):
    """A scene of the ring and a shaft whose radius is larger than the bore by `difference` [m]."""
    shaft = Body(disc((0, 0), INNER + difference, spacing=CELL / 2), Rigid(7800.0), motion=(0, 0, 0))
    return Scene([Body(ring(), NeoHookean(E, NU, 1100.0)), shaft], cell=CELL, friction=0.3, overlap=overlap)


@pytest.mark.parametrize("difference", [0.01e-3, 0.05e-3])
def test_a_ring_on_a_larger_shaft_has_lames_pressure(difference):
    scene = fit(difference, difference)
    state, steps = initial(scene, scheme=STATICS), 4
    for _ in range(steps):
        state = step(scene, state, 1.0, scheme=STATICS)
    closed = 1.0 - 0.8**steps
    bore = np.hypot(*state.x[:, scene.owner == 0]).min()
    assert (bore - INNER) / difference == pytest.approx(closed, rel=5e-3)
    assert pressure(state) == pytest.approx(closed * lame(difference), rel=1e-2)


def lame(difference):
    """The pressure of a shaft larger by `difference` [m]."""
    return E * difference / ((1 + NU) * INNER) * (OUTER**2 - INNER**2) / (OUTER**2 + (1 - 2 * NU) * INNER**2)


def pressure(state):
    return state.contacts.force[0].sum() / (2 * np.pi * INNER)


def test_with_inertia_the_ring_comes_to_rest_under_the_same_pressure():
    """An overlap that is meant may be removed at the cost of more energy than there is."""
    scene = fit(0.05e-3, 0.05e-3)
    state = initial(scene)
    for _ in range(30):
        state = step(scene, state, 2e-4)
    assert state.report.energy.kinetic < 1e-4 * state.report.energy.elastic
    assert pressure(state) == pytest.approx(lame(0.05e-3), rel=2e-2)


@pytest.mark.parametrize("difference", [0.01e-3, 0.05e-3, 0.2e-3])
def test_a_larger_shaft_that_is_not_meant_is_refused_with_its_overlap(difference):
    with pytest.raises(SceneError, match=f"bodies 0 and 1 overlap by {difference:.3g} m at the start"):
        fit(difference, 0.0)
