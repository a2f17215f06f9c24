"""The photoelastic study without PEPE: its forces balance, and its picture is that of the field of these forces."""

import numpy as np
import pytest

from examples.studies import photoelastic


@pytest.fixture(scope="module")
def disc():
    """A small packing, the disc with the highest pressure, and the forces on it."""
    scene, state = photoelastic.packing(discs=7, resolution=10.0)
    body = int(np.argmax(photoelastic.skmpm.observe(scene, state).bodies.pressure))
    return scene, state, body, photoelastic.loads(scene, state, body)


def test_the_forces_on_a_disc_balance(disc):
    *_, known = disc
    direction = known.place + np.pi + known.tilt
    resultant = np.hypot(*(known.force * [np.cos(direction), np.sin(direction)]).sum(axis=1))
    assert known.force.size >= 3 and resultant < 1e-3 * known.force.sum()


def test_the_picture_is_that_of_point_forces(disc):
    """Flamant's fields of the forces and the uniform tension that frees the boundary, which no fringe shows."""
    scene, state, body, known = disc
    light, scale = photoelastic.picture(scene, state, body)
    radius = float(np.sqrt(photoelastic.skmpm.observe(scene, state).bodies.area[body] / np.pi))
    y, x = (np.mgrid[: len(light), : len(light)] + 0.5 - 0.5 * len(light)) / scale * [[[-1]], [[1]]]
    total = np.zeros((2, *x.shape))
    for force, place, tilt in zip(*known, strict=True):
        dx, dy = x - radius * np.cos(place), y - radius * np.sin(place)
        r, along = np.hypot(dx, dy), place + np.pi + tilt
        radial = -2.0 * force * (dx * np.cos(along) + dy * np.sin(along)) / (np.pi * r**2)
        total += radial * np.stack([dx**2 - dy**2, 2.0 * dx * dy]) / r**2
    expected = np.sin(np.pi * np.hypot(*total) / photoelastic.FRINGE) ** 2
    inside = np.hypot(x, y) < 0.6 * radius
    assert expected[inside].std() > 0.1
    assert np.sqrt(((light - expected)[inside] ** 2).mean()) < 0.1
