"""Newton steps that rotate bodies exactly: no strain by rotation, the line to first order, the same momentum."""

import numpy as np
import pytest

from skmpm import Body, LinearElastic, NeoHookean, Scene, Scheme, disc, initial
from skmpm.step.bulk import Bulk
from skmpm.step.equations import Increment
from skmpm.step.rotation import retracted

R, DT = 1e-3, 1e-4


def step_of(material, theta=1.0):
    """The equations of a step of two discs apart."""
    scene = Scene([Body(disc((x, 0.0), R, spacing=R / 6), material) for x in (0.0, 3.0 * R)], cell=R / 4)
    assembly = initial(scene).derived.assembly
    rest = np.zeros(2 * assembly.grid.nodes)
    return Increment(
        Bulk(assembly, [(material, slice(None))], None, None).at(rest), rest, (), DT, Scheme(theta=theta)
    )


def spins(increment, angles):
    """The velocity (2 nodes,) that turns the bodies by small angles about their centres in a step."""
    grid = increment.grid
    arm = grid.arms(grid.position, increment.bulk.assembly.lumped[::2])
    rate = np.asarray(angles)[grid.node_body] / (increment.scheme.theta * increment.dt)
    return (rate * np.stack([-arm[1], arm[0]])).T.ravel()


GEL = NeoHookean(E=1e6, nu=0.3, density=1e3)


@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_a_rotation_strains_nothing(theta):
    """0.05 and -0.2 rad: the straight line stores E phi^4 / 8 per volume and more, 1e9 times the rotation."""
    increment = step_of(GEL, theta)
    spin = spins(increment, (0.05, -0.2))
    straight, turned = (
        increment.bulk.energy(increment.at(w)) for w in (spin, retracted(increment, 0.0 * spin, spin))
    )
    assert straight > 1e-6 * GEL.E * R**2
    assert abs(turned) < 1e-9 * straight


def test_a_rotation_turns_by_its_angle_from_any_iterate():
    increment = step_of(GEL)
    first = spins(increment, (0.3, 0.0))
    x = increment.grid.position.T.ravel()
    once = retracted(increment, 0.0 * first, first)
    arm = increment.grid.arms((x + DT * once).reshape(-1, 2).T, increment.bulk.assembly.lumped[::2])
    again = np.where(np.repeat(increment.grid.node_body == 0, 2), np.stack([-arm[1], arm[0]]).T.ravel(), 0.0) / DT
    both = retracted(increment, once, 0.1 * again)
    assert both == pytest.approx(retracted(increment, 0.0 * first, first + spins(increment, (0.1, 0.0))), abs=1e-9)


def test_it_is_the_line_to_first_order_and_keeps_momentum():
    increment = step_of(GEL)
    w, direction = 1e-2 * np.random.default_rng(0).normal(size=(2, 2 * increment.grid.nodes))
    direction = direction + spins(increment, (0.05, -0.1))
    errors = [np.abs(retracted(increment, w, e * direction) - w - e * direction).max() for e in (1.0, 0.5)]
    assert 3.5 < errors[0] / errors[1] < 4.5
    change = (retracted(increment, w, direction) - w - direction) * increment.bulk.assembly.lumped
    size = np.abs(direction * increment.bulk.assembly.lumped).sum()
    assert np.abs(increment.grid.sums(change.reshape(-1, 2).T)).max() < 1e-14 * size


def test_linear_materials_take_the_line():
    linear, gel = step_of(LinearElastic(E=1e6, nu=0.3, density=1e3)), step_of(GEL)
    spin = spins(linear, (0.05, -0.2))
    assert np.array_equal(retracted(linear, spin, spin), spin + spin)
    assert not np.array_equal(retracted(gel, spin, spin), spin + spin)
